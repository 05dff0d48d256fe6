//! What glossy virtual things mirror, held against rays that are followed here once more: the video's own colours, the picture's
//! shadows, the light from everywhere, and a furnace.

use crate::common::{flat_mesh, frame_of, gpu, lamp, look_at, object, scene, table_top};
use glam::{DAffine3, DVec2, DVec3, Vec3};
use gnomon::capture::Frame;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::geometry::cuboid::cuboid;
use gnomon::light::layer_albedo;
use gnomon::light::srgb::srgb_from_linear;
use gnomon::light::{Light, Material};
use gnomon::render::{REAL, Renderer, Shown, VIRTUAL};
use gnomon::scene::{Object, Scene};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [480, 360],
    focal_px: DVec2::new(520.0, 515.0),
    center_px: DVec2::new(241.3, 177.2),
    distortion: Distortion::NONE,
};
const AMBIENT: f64 = 0.2;
/// The mirror stands in this plane, and what is reflected in it lies before it.
const MIRROR_Y: f64 = 0.1;

/// Levels that rise evenly over the picture, each channel its own way: what is read half a pixel off is read right.
fn ramps() -> Frame {
    let [width, height] = CAMERA.size_px.map(|side| side as usize);
    frame_of(CAMERA.size_px, |byte| {
        let (x, y) = (byte / 4 % width, byte / 4 / width);
        match byte % 4 {
            0 => (60 + 140 * x / width) as u8,
            1 => (60 + 140 * y / height) as u8,
            2 => (200 - 140 * x / width) as u8,
            _ => 255,
        }
    })
}

/// A metal that reflects all light.
fn metal(roughness: f64) -> Material {
    Material {
        roughness: Some(roughness),
        metallic: 1.0,
        ..Material::matt(DVec3::ONE)
    }
}

/// An upright mirror that looks towards the camera and throws no shadow.
fn mirror(roughness: f64) -> Object {
    let y = MIRROR_Y as f32;
    let corners = [[-0.1, 0.01], [0.1, 0.01], [0.1, 0.16], [-0.1, 0.16]];
    let positions = corners.map(|[x, z]: [f32; 2]| Vec3::new(x, y, z)).to_vec();
    let mesh = flat_mesh(positions, vec![[0, 1, 2], [0, 2, 3]]);
    Object {
        materials: vec![metal(roughness)],
        casts: false,
        ..object("mirror", mesh, DVec3::ONE, DAffine3::IDENTITY)
    }
}

fn table() -> Object {
    table_top(1.0, DVec3::splat(0.5))
}

fn block(name: &str, low: [f32; 3], high: [f32; 3]) -> Object {
    let (positions, triangles) = cuboid(Vec3::from_array(low), Vec3::from_array(high));
    let mesh = flat_mesh(positions, triangles);
    object(name, mesh, DVec3::splat(0.5), DAffine3::IDENTITY)
}

fn camera_from_world() -> DAffine3 {
    look_at(DVec3::new(0.05, -0.45, 0.3), DVec3::new(0.0, 0.02, 0.02))
}

/// The picture, and what is seen where.
struct Drawn {
    picture: Vec<u8>,
    role: Vec<u8>,
}

impl Drawn {
    fn new(scene: &Scene, frame: &Frame) -> Self {
        let mut renderer = Renderer::new(gpu(), scene, CAMERA).expect("a renderer");
        renderer.upload(frame).expect("an uploaded frame");
        renderer.draw(&[Some(camera_from_world())], Shown::Composite);
        Self {
            picture: renderer.read_picture().expect("a picture"),
            role: renderer.layers().expect("layers").role,
        }
    }
}

fn at(picture: &[u8], [x, y]: [usize; 2]) -> [u8; 3] {
    let first = 4 * (y * CAMERA.size_px[0] as usize + x);
    [picture[first], picture[first + 1], picture[first + 2]]
}

fn role_at(role: &[u8], [x, y]: [usize; 2]) -> u8 {
    role[y * CAMERA.size_px[0] as usize + x]
}

/// Where the way through a pixel comes to the mirror's plane, and where it goes from there.
fn mirrored_way([x, y]: [usize; 2]) -> (DVec3, DVec3) {
    let world_from_camera = camera_from_world().inverse();
    let eye = world_from_camera.translation;
    let pixel = DVec2::new(x as f64, y as f64);
    let ahead = ((pixel - CAMERA.center_px) / CAMERA.focal_px).extend(1.0);
    let direction = world_from_camera.transform_vector3(ahead);
    let place = eye + direction * ((MIRROR_Y - eye.y) / direction.y);
    (place, DVec3::new(direction.x, -direction.y, direction.z))
}

/// Where a mirrored ray of a pixel comes to the table, as the camera sees it; `None` where it does not, or not in the picture.
enum Mirrored {
    Table([usize; 2]),
    OutsideOfThePicture,
    Nothing,
}

/// What the mirror has in a pixel, if it is seen there with some room around.
fn mirrored(drawn: &Drawn, [x, y]: [usize; 2]) -> Option<Mirrored> {
    let [width, height] = CAMERA.size_px.map(|side| side as usize);
    for [across, down] in [[0, 0], [2, 0], [0, 2], [4, 2], [2, 4]] {
        let beside = [(x + across).checked_sub(2)?, (y + down).checked_sub(2)?];
        if beside[0] >= width || beside[1] >= height || role_at(&drawn.role, beside) != VIRTUAL {
            return None;
        }
    }
    let (place, back) = mirrored_way([x, y]);
    let on_mirror = place.x.abs() < 0.1 && (0.01..0.16).contains(&place.z);
    if !on_mirror {
        return None;
    }
    if back.z >= -1e-6 {
        return Some(Mirrored::Nothing);
    }
    let met = place + back * (place.z / -back.z);
    if met.x.abs() > 1.0 || met.y.abs() > 1.0 {
        return Some(Mirrored::Nothing);
    }
    let seen = camera_from_world().transform_point3(met);
    if seen.z <= 0.0 {
        return Some(Mirrored::OutsideOfThePicture);
    }
    let pixel = seen.truncate() / seen.z * CAMERA.focal_px + CAMERA.center_px;
    let inside = pixel.x > 2.0
        && pixel.y > 2.0
        && pixel.x < (width - 3) as f64
        && pixel.y < (height - 3) as f64;
    Some(match inside {
        true => Mirrored::Table([pixel.x.round() as usize, pixel.y.round() as usize]),
        false => Mirrored::OutsideOfThePicture,
    })
}

fn pixels() -> impl Iterator<Item = [usize; 2]> {
    let [width, height] = CAMERA.size_px.map(|side| side as usize);
    (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
}

fn difference(one: [u8; 3], other: [u8; 3]) -> u8 {
    let channels = one.iter().zip(other);
    channels.map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0)
}

/// A light that no ambient light dims in the picture's own numbers: what is mirrored is the video, or the ambient radiance.
#[test]
fn a_mirror_has_the_videos_colours_where_it_shows_the_table() {
    let frame = ramps();
    let scene = scene(vec![table()], vec![mirror(1e-4)], Vec::new(), AMBIENT);
    let drawn = Drawn::new(&scene, &frame);
    let (mut of_table, mut worst) = (0, 0);
    for pixel in pixels() {
        if let Some(Mirrored::Table(seen)) = mirrored(&drawn, pixel) {
            // (The mirror itself hides what lies behind it, which the video shows all the same.)
            of_table += 1;
            worst = worst.max(difference(at(&drawn.picture, pixel), at(&frame.rgba, seen)));
        }
    }
    assert!(of_table > 2000, "{of_table} pixels");
    assert!(worst <= 2, "off by {worst} levels");
}

#[test]
fn a_mirror_has_the_ambient_light_where_it_shows_nothing() {
    // (Seen from below nothing is before the mirror but light.)
    let frame = ramps();
    let scene = scene(
        vec![block("far off", [3.0, 3.0, 0.0], [3.1, 3.1, 0.1])],
        vec![mirror(1e-4)],
        Vec::new(),
        AMBIENT,
    );
    let drawn = Drawn::new(&scene, &frame);
    let expected = (255.0 * srgb_from_linear(AMBIENT)).round() as u8;
    let mut count = 0;
    for pixel in pixels() {
        if mirrored(&drawn, pixel).is_some() {
            count += 1;
            let found = at(&drawn.picture, pixel);
            assert!(
                difference(found, [expected; 3]) <= 1,
                "{pixel:?}: {found:?}"
            );
        }
    }
    assert!(count > 5000, "{count} pixels");
}

/// The shadow of a virtual thing lies on the table in the mirror too.
#[test]
fn a_mirror_shows_the_picture_with_its_shadows() {
    let frame = frame_of(CAMERA.size_px, |_| 150);
    let bounds = [DVec3::new(-0.08, 0.0, 0.05), DVec3::new(0.02, 0.04, 0.06)];
    let [low, high] = bounds.map(|corner| corner.as_vec3().to_array());
    let scene = scene(
        vec![table()],
        vec![mirror(1e-4), block("caster", low, high)],
        vec![lamp([-0.3, -0.1, 0.4], [0.3; 3])],
        AMBIENT,
    );
    let drawn = Drawn::new(&scene, &frame);
    let (mut shadowed, mut wrong, mut all) = (0, 0, 0);
    for pixel in pixels() {
        let Some(Mirrored::Table(seen)) = mirrored(&drawn, pixel) else {
            continue;
        };
        let there = at(&drawn.picture, seen);
        // (The sharpest metal that shaders know blurs by some pixels.)
        if !is_even(&drawn, seen) || meets_block(pixel, &bounds) {
            continue;
        }
        all += 1;
        shadowed += usize::from(there[0] < 120);
        wrong += usize::from(difference(at(&drawn.picture, pixel), there) > 4);
    }
    assert!(
        all > 1000 && shadowed > 50,
        "{all} pixels, {shadowed} in shadow"
    );
    // (Coarser levels of the picture reach a little farther than that.)
    assert!(50 * wrong < all, "{wrong} of {all} are otherwise");
}

/// Whether the table is seen around a pixel, and equally bright everywhere.
fn is_even(drawn: &Drawn, [x, y]: [usize; 2]) -> bool {
    const AROUND: usize = 10;
    let own = at(&drawn.picture, [x, y]);
    let [width, height] = CAMERA.size_px.map(|side| side as usize);
    let corner = [x.saturating_sub(AROUND), y.saturating_sub(AROUND)];
    let end = [(x + AROUND).min(width - 1), (y + AROUND).min(height - 1)];
    let rows = corner[1]..=end[1];
    let mut around = rows.flat_map(|y| (corner[0]..=end[0]).map(move |x| [x, y]));
    around.all(|pixel| {
        role_at(&drawn.role, pixel) == REAL && difference(at(&drawn.picture, pixel), own) <= 6
    })
}

/// Whether the mirrored ray of a pixel meets a box, or nearly (slabs).
fn meets_block(pixel: [usize; 2], [low, high]: &[DVec3; 2]) -> bool {
    let (place, back) = mirrored_way(pixel);
    let (a, b) = (
        (*low - DVec3::splat(8e-3) - place) / back,
        (*high + DVec3::splat(8e-3) - place) / back,
    );
    let (enters, leaves) = (a.min(b).max_element(), a.max(b).min_element());
    enters < leaves && leaves > 0.0
}

/// Where a virtual thing hides from the camera what the mirror shows, the video knows it all the same, and the lamp's light that
/// virtual things take there is taken off.
#[test]
fn what_a_virtual_thing_hides_from_the_camera_is_mirrored_as_the_video_has_it() {
    let frame = ramps();
    let screen = Object {
        casts: false,
        ..block("screen", [-0.06, -0.04, 0.0], [0.06, -0.038, 0.05])
    };
    let scene = scene(
        vec![table()],
        vec![mirror(1e-4), screen],
        Vec::<Light>::new(),
        AMBIENT,
    );
    let drawn = Drawn::new(&scene, &frame);
    let bounds = [
        DVec3::new(-0.06, -0.04, 0.0),
        DVec3::new(0.06, -0.038, 0.05),
    ];
    let (mut count, mut worst) = (0, 0);
    for pixel in pixels() {
        let Some(Mirrored::Table(seen)) = mirrored(&drawn, pixel) else {
            continue;
        };
        if role_at(&drawn.role, seen) == VIRTUAL && !meets_block(pixel, &bounds) {
            count += 1;
            worst = worst.max(difference(at(&drawn.picture, pixel), at(&frame.rgba, seen)));
        }
    }
    assert!(count > 200, "{count} pixels");
    assert!(worst <= 2, "off by {worst} levels");
}

/// Where all around is as bright, what is mirrored is that, times what the layer reflects of light from everywhere.
#[test]
fn a_rough_metal_in_a_furnace_reflects_what_its_layer_does() {
    for roughness in [0.05, 0.25, 0.6] {
        let level = (255.0 * srgb_from_linear(AMBIENT)).round() as u8;
        let frame = frame_of(CAMERA.size_px, |_| level);
        // (What the camera does not see is as bright as it reflects: all of it.)
        let white = |object: Object| Object {
            materials: vec![Material::matt(DVec3::ONE)],
            ..object
        };
        let block = block("block", [-0.05, -0.05, 0.0], [0.05, -0.02, 0.06]);
        let scene = scene(
            vec![white(table()), white(block)],
            vec![mirror(roughness)],
            Vec::new(),
            AMBIENT,
        );
        let drawn = Drawn::new(&scene, &frame);
        let (mut count, mut worst) = (0, 0.0_f64);
        for pixel in pixels() {
            if mirrored(&drawn, pixel).is_none() {
                continue;
            }
            // What a white metal reflects of light from everywhere, of the table that the shaders have.
            let (_, back) = mirrored_way(pixel);
            let [factor, summand, _] = layer_albedo::between(-back.normalize().y, roughness);
            let expected = AMBIENT * (factor + summand);
            let expected = 255.0 * srgb_from_linear(expected);
            let found = f64::from(at(&drawn.picture, pixel)[0]);
            count += 1;
            worst = worst.max((found - expected).abs());
        }
        assert!(count > 5000, "{count} pixels");
        assert!(worst < 4.0, "roughness {roughness}: off by {worst} levels");
    }
}

#[test]
fn a_still_scene_is_still_and_reflections_can_be_left_out() {
    let frame = ramps();
    let mut scene = scene(vec![table()], vec![mirror(0.2)], Vec::new(), AMBIENT);
    let mut renderer = Renderer::new(gpu(), &scene, CAMERA).expect("a renderer");
    renderer.upload(&frame).expect("an uploaded frame");
    let nodes = [Some(camera_from_world())];
    let mut draw = |nodes: &[Option<DAffine3>]| {
        renderer.draw(nodes, Shown::Composite);
        let is_followed = renderer.passes().contains(&"reflections");
        (renderer.read_picture().expect("a picture"), is_followed)
    };
    let (first, is_followed) = draw(&nodes);
    assert!(is_followed);
    let aside = DAffine3::from_translation(DVec3::X * 0.02) * camera_from_world();
    assert!(draw(&[Some(aside)]).0 != first);
    assert!(draw(&nodes).0 == first, "the same view is another picture");

    scene.shadows.reflection_samples = 0;
    let without = Drawn::new(&scene, &frame);
    let level = |picture: &[u8]| u64::from(at(picture, [240, 150])[0]);
    assert_eq!(role_at(&without.role, [240, 150]), VIRTUAL);
    assert_ne!(level(&without.picture), level(&first));
}
