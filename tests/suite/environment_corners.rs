//! What an environment's light is worked out of at corners: gloss as the paper has it against sums over the probe, and meshes whose
//! corners are too few.

use glam::{DAffine3, DVec2, DVec3, Vec3};
use gnomon::geometry::ray_caster::RayCaster;
use gnomon::light::material::Material;
use gnomon::light::probe::Probe;
use gnomon::render::VIRTUAL;
use gnomon::scene::{EnvironmentMethod, Object, Scene};

use crate::common::shapes::sphere;
use crate::common::{Picture, flat_mesh, object};
use crate::environment::{
    CAMERA, black_box, camera, exact, gains, probe_scene, triangles, under_sky,
};

const ROUGHNESS: f64 = 0.4;
const BALL_AT: DVec3 = DVec3::new(0.0, -0.05, 0.2);
const BALL_RADIUS: f64 = 0.06;

/// A black ball with a glossy layer, smooth.
fn glossy_ball() -> Object {
    let soup = sphere(BALL_RADIUS as f32, 24, 48);
    let mut mesh = flat_mesh(soup.positions, soup.triangles);
    for (normals, triangle) in mesh.corner_normals.iter_mut().zip(&mesh.triangles) {
        *normals = triangle.map(|index| mesh.positions[index as usize].normalize());
    }
    let place = DAffine3::from_translation(BALL_AT);
    let mut ball = object("ball", mesh, DVec3::ZERO, place);
    ball.materials[0].roughness = Some(ROUGHNESS);
    ball
}

/// The ball under a light, and perhaps under a thing.
fn ball_under(probe: Probe, above: Option<Object>, method: EnvironmentMethod) -> Picture {
    let mut scene = under_sky(
        0,
        Vec::new(),
        above.into_iter().chain([glossy_ball()]).collect(),
    );
    scene.probe = Some(probe_scene(probe));
    scene.probe.as_mut().expect("a probe").exposure = 1.0;
    scene.shadows.environment.method = method;
    // (The light from afar alone is judged here, not what stands on the table.)
    scene.shadows.reflection_samples = 0;
    let (_, _, picture) = gains(&scene, camera());
    picture
}

/// Light of one radiance.
pub(crate) fn even(radiance: f32) -> Probe {
    Probe::new([96, 48], vec![Vec3::splat(radiance); 96 * 48]).expect("pixels")
}

/// A sky that is bright to one side, without an edge.
fn glow() -> Probe {
    let grid = even(1.0);
    let toward = DVec3::new(0.3, -0.7, 0.6).normalize();
    let pixels = (0..96 * 48).map(|index| {
        let way = grid.direction((index % 96) as f64 + 0.5, (index / 96) as f64 + 0.5);
        Vec3::splat((0.5 + 5.0 * way.dot(toward).max(0.0).powi(4)) as f32)
    });
    Probe::new([96, 48], pixels.collect()).expect("pixels")
}

/// Pixels well within the ball's outline, with its normal and the direction that is mirrored there.
fn on_ball() -> Vec<(usize, DVec3, DVec3)> {
    let world_from_camera = camera().inverse();
    let eye = world_from_camera.translation;
    let pixels = (0..120 * 90).filter_map(|index| {
        let pixel = DVec2::new((index % 120) as f64, (index / 120) as f64);
        let way = ((pixel - CAMERA.center_px) / CAMERA.focal_px).extend(1.0);
        let way = world_from_camera.transform_vector3(way).normalize();
        let to_middle = BALL_AT - eye;
        let along = to_middle.dot(way);
        let across = to_middle.length_squared() - along * along;
        let inside = BALL_RADIUS * BALL_RADIUS - across;
        if inside < 0.3 * BALL_RADIUS * BALL_RADIUS {
            return None;
        }
        let normal = (way * (along - inside.sqrt()) - to_middle) / BALL_RADIUS;
        Some((index, normal, way - normal * (2.0 * normal.dot(way))))
    });
    pixels.collect()
}

/// Mean radiance over Phong's lobe of what nothing of a caster hides.
fn mean_over_lobe(probe: &Probe, mirrored: DVec3, is_hidden: impl Fn(DVec3) -> bool) -> f64 {
    let exponent = 0.5 / (ROUGHNESS * ROUGHNESS) - 0.5;
    let parts =
        probe
            .rays()
            .filter(|(way, _, _)| !is_hidden(*way))
            .map(|(way, radiance, solid_angle)| {
                f64::from(radiance.y) * mirrored.dot(way).max(0.0).powf(exponent) * solid_angle
            });
    parts.sum::<f64>() * (exponent + 1.0) / std::f64::consts::TAU
}

/// Root mean square by which a picture of the ball is off, as parts of the mean; what the layer reflects of light from everywhere
/// is known from one in even light.
fn off(picture: &Picture, expected: impl Fn(usize, DVec3, DVec3) -> f64) -> f64 {
    let even = ball_under(even(8.0), None, EnvironmentMethod::Rays);
    let (mut squares, mut sum, mut count) = (0.0, 0.0, 0);
    for (index, normal, mirrored) in on_ball() {
        let reflected = even.linear(index).y / 8.0;
        let expected = expected(index, normal, mirrored);
        squares += (picture.linear(index).y / reflected - expected).powi(2);
        sum += expected;
        count += 1;
    }
    assert!(count > 300, "{count}");
    (squares / f64::from(count)).sqrt() / (sum / f64::from(count))
}

/// A sun, 7° wide, in a dim sky.
fn wide_sun() -> Probe {
    let size_px = [256, 128];
    let grid = Probe::new(size_px, vec![Vec3::ZERO; 256 * 128]).expect("pixels");
    let toward = DVec3::new(0.6, -0.5, 0.45).normalize();
    let radiance = |direction: DVec3| match direction.angle_between(toward) < 3.5_f64.to_radians() {
        true => 45.0,
        false => 0.15,
    };
    let pixels = grid.rays().map(|(way, ..)| Vec3::splat(radiance(way)));
    Probe::new(size_px, pixels.collect()).expect("pixels")
}

/// Few harmonics let the sun's light run on to what it does not reach.
#[test]
fn a_wide_sun_ends_on_a_ball_where_it_does() {
    let mut ball = glossy_ball();
    ball.materials[0] = Material::matt(DVec3::ONE);
    let mut scene = under_sky(0, Vec::new(), vec![ball]);
    scene.phantoms.clear();
    scene.probe = Some(probe_scene(wide_sun()));
    let probe = scene.probe.as_mut().expect("a probe");
    probe.exposure = 1.0;
    let lit = probe.probe.clone();
    let (_, _, picture) = gains(&scene, camera());
    let expected = |normal: DVec3| -> f64 {
        let parts = lit.rays();
        let parts = parts.map(|(way, radiance, solid_angle)| {
            f64::from(radiance.y) * way.dot(normal).max(0.0) * solid_angle
        });
        parts.sum::<f64>() / std::f64::consts::PI
    };
    let on_ball = on_ball();
    let all = on_ball.iter().map(|(index, normal, _)| {
        let expected = expected(*normal);
        (expected, picture.linear(*index).y - expected)
    });
    let all: Vec<(f64, f64)> = all.collect();
    let brightest = all
        .iter()
        .map(|(expected, _)| *expected)
        .fold(0.0, f64::max);
    let worst = all.iter().map(|(_, off)| off.abs()).fold(0.0, f64::max);
    assert!(
        all.len() > 200 && brightest < 1.0,
        "{} {brightest}",
        all.len()
    );
    assert!(worst < 0.02 * brightest, "{worst} of {brightest}");
}

#[test]
fn even_light_is_mirrored_alike_by_both_lobes() {
    let [rays, maps] = [EnvironmentMethod::Rays, EnvironmentMethod::Maps]
        .map(|method| ball_under(even(8.0), None, method));
    for (index, _, _) in on_ball() {
        let (one, other) = (rays.linear(index).y, maps.linear(index).y);
        assert!((one / other - 1.0).abs() < 0.03, "{index}: {one} {other}");
    }
}

#[test]
fn gloss_by_harmonics_is_phongs_lobe_over_the_probe() {
    let probe = glow();
    let picture = ball_under(glow(), None, EnvironmentMethod::Maps);
    let by_maps = off(&picture, |_, _, mirrored| {
        mean_over_lobe(&probe, mirrored, |_| false)
    });
    assert!(by_maps < 0.03, "{by_maps}");
}

#[test]
fn gloss_loses_what_others_hide_of_it() {
    let probe = glow();
    // Between the ball and the glow.
    let place = DAffine3::from_translation(DVec3::new(0.03, -0.15, 0.32));
    let above = || black_box("slab", [-0.05, -0.05, 0.0], [0.05, 0.05, 0.01], place);
    let caster = RayCaster::new(&triangles(&above()));
    let picture = ball_under(glow(), Some(above()), EnvironmentMethod::Maps);
    let exact = |_: usize, normal: DVec3, mirrored: DVec3| {
        let start = (BALL_AT + normal * (BALL_RADIUS * 1.001)).as_vec3();
        mean_over_lobe(&probe, mirrored, |way| {
            caster.is_hidden(start, way.as_vec3(), f32::INFINITY)
        })
    };
    let by_maps = off(&picture, exact);
    let without = off(&picture, |_, _, mirrored| {
        mean_over_lobe(&probe, mirrored, |_| false)
    });
    assert!(
        by_maps < 0.08 && by_maps < 0.5 * without,
        "{by_maps}, without {without}"
    );
}

/// Ends of the shelf's floor, a little inside, metres.
const LOW_X: f64 = -0.075;
const HIGH_X: f64 = 0.065;

/// A shelf: a floor and a wall behind it in one mesh of twenty triangles.
pub(crate) fn shelf() -> Object {
    let profile = [
        [0.0, 0.0],
        [0.16, 0.0],
        [0.16, 0.01],
        [0.01, 0.01],
        [0.01, 0.1],
        [0.0, 0.1],
    ];
    let corner = |y: f32| move |[x, z]: [f32; 2]| Vec3::new(x, y, z);
    let positions = profile
        .map(corner(-0.08))
        .into_iter()
        .chain(profile.map(corner(0.08)));
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for index in 1..5 {
        triangles.push([0, index, index + 1]);
        triangles.push([6, 6 + index + 1, 6 + index]);
    }
    for index in 0..6 {
        let next = (index + 1) % 6;
        triangles.push([index, 6 + index, 6 + next]);
        triangles.push([index, 6 + next, next]);
    }
    let mesh = flat_mesh(positions.collect(), triangles);
    assert!(mesh.closed_and_consistent() && mesh.signed_volume_m3() > 0.0);
    object(
        "shelf",
        mesh,
        DVec3::splat(0.1),
        // Its wall towards the bright side.
        DAffine3::from_translation(DVec3::new(0.08, 0.0, 0.05))
            * DAffine3::from_rotation_z(std::f64::consts::PI),
    )
}

fn shelf_scene() -> Scene {
    let mut scene = under_sky(0, Vec::new(), vec![shelf()]);
    scene.probe.as_mut().expect("a probe").exposure = 2.0;
    scene
}

#[test]
fn a_coarse_shelf_is_as_dark_in_its_corner_as_rays_say() {
    let scene = shelf_scene();
    let (_, role, picture) = gains(&scene, camera());
    let probe = scene.probe.as_ref().expect("a probe");
    let caster = RayCaster::new(&triangles(&scene.virtuals[0]));
    let at = |x: f64, y: f64| {
        let place = DVec3::new(x, y, 0.06);
        exact(&probe.probe, place, DVec3::Z, &[&caster]) * probe.exposure * 0.1
            / std::f64::consts::PI
    };
    // Corners of the floor, a little inside.
    let corners = [
        [LOW_X, -0.075],
        [HIGH_X, -0.075],
        [LOW_X, 0.075],
        [HIGH_X, 0.075],
    ];
    let at_corners = corners.map(|[x, y]| at(x, y));
    let world_from_camera = camera().inverse();
    let eye = world_from_camera.translation;
    let [mut squares, mut coarse_squares, mut sum, mut count] = [0.0; 4];
    for (index, &role) in role.iter().enumerate() {
        let pixel = DVec2::new((index % 120) as f64, (index / 120) as f64);
        let way = ((pixel - CAMERA.center_px) / CAMERA.focal_px).extend(1.0);
        let way = world_from_camera.transform_vector3(way);
        let place = eye + way * ((0.06 - eye.z) / way.z);
        let is_floor = place.x > LOW_X && place.x < HIGH_X && place.y.abs() < 0.075;
        let behind_wall = caster.is_hidden(eye.as_vec3(), (place - eye).as_vec3(), 0.999);
        if !is_floor || behind_wall {
            continue;
        }
        assert_eq!(role, VIRTUAL, "{index}");
        let expected = at(place.x, place.y);
        let (u, v) = (
            (place.x - LOW_X) / (HIGH_X - LOW_X),
            (place.y + 0.075) / 0.15,
        );
        let [a, b, c, d] = at_corners;
        let coarse = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
        squares += (picture.linear(index).y - expected).powi(2);
        coarse_squares += (coarse - expected).powi(2);
        sum += expected;
        count += 1.0;
    }
    assert!(count > 400.0, "{count}");
    let [off, coarse] =
        [squares, coarse_squares].map(|it: f64| (it / count).sqrt() / (sum / count));
    assert!(
        off < 0.04 && off < 0.6 * coarse,
        "{off}, between its own corners {coarse}"
    );
}

/// A patch of the white shelf's floor or wall in the world.
struct Patch {
    place: DVec3,
    normal: DVec3,
    area: f64,
    /// Irradiance.
    arriving: f64,
}

/// The shelf's floor or its wall in patches, each with the light from afar that nothing hides.
fn patches(probe: &Probe, caster: &RayCaster, is_floor: bool) -> Vec<Patch> {
    const SIDE: usize = 24;
    let along =
        |low: f64, high: f64, index: usize| low + (high - low) * (index as f64 + 0.5) / SIDE as f64;
    let places = (0..SIDE * SIDE).map(|index| (index % SIDE, index / SIDE));
    let of_place = |(column, row)| {
        let y = along(-0.08, 0.08, column);
        let (place, normal, size) = match is_floor {
            true => (DVec3::new(along(-0.08, 0.07, row), y, 0.06), DVec3::Z, 0.15),
            false => (
                DVec3::new(0.07, y, along(0.06, 0.15, row)),
                DVec3::NEG_X,
                0.09,
            ),
        };
        Patch {
            place,
            normal,
            area: 0.16 * size / (SIDE * SIDE) as f64,
            arriving: exact(probe, place, normal, &[caster]),
        }
    };
    places.map(of_place).collect()
}

/// Irradiance of a place from white patches of an albedo.
fn from_patches(place: DVec3, normal: DVec3, patches: &[Patch], albedo: f64) -> f64 {
    let parts = patches.iter().map(|patch| {
        let way = patch.place - place;
        let squared = way.length_squared();
        let cosines = way.dot(normal).max(0.0) * (-way.dot(patch.normal)).max(0.0);
        albedo / std::f64::consts::PI * patch.arriving * patch.area * cosines / (squared * squared)
    });
    parts.sum()
}

const ALBEDO: f64 = 0.8;

/// Gives patches what others reflect, beside what is theirs alone.
fn pass_on(patches: &mut [Patch], alone: &[f64], others: &[Patch]) {
    for (patch, alone) in patches.iter_mut().zip(alone) {
        patch.arriving = alone + from_patches(patch.place, patch.normal, others, ALBEDO);
    }
}

/// What its wall and its floor reflect on to each other.
#[test]
fn a_white_shelf_is_as_bright_in_its_corner_as_radiosity_says() {
    let mut scene = shelf_scene();
    scene.virtuals[0].materials[0].albedo = DVec3::splat(ALBEDO);
    scene.probe.as_mut().expect("a probe").exposure = 0.5;
    let (_, _, picture) = gains(&scene, camera());
    let probe = scene.probe.as_ref().expect("a probe");
    let caster = RayCaster::new(&triangles(&scene.virtuals[0]));
    let mut floor = patches(&probe.probe, &caster, true);
    let mut wall = patches(&probe.probe, &caster, false);
    let [of_floor, of_wall] = [&floor, &wall].map(|patches| {
        let direct = patches.iter().map(|patch| patch.arriving);
        direct.collect::<Vec<f64>>()
    });
    // What is left of light after so many bounces is nothing.
    for _ in 0..8 {
        pass_on(&mut wall, &of_wall, &floor);
        pass_on(&mut floor, &of_floor, &wall);
    }
    let [mut squares, mut off, mut reflected, mut whole] = [0.0; 4];
    for (patch, direct) in floor.iter().zip(of_floor) {
        // (Nearer to the wall than its patches are wide they tell little.)
        if patch.place.x > 0.06 || patch.place.y.abs() > 0.075 {
            continue;
        }
        let radiance = ALBEDO / std::f64::consts::PI * probe.exposure;
        let difference = picture.linear(pixel_of(patch.place)).y / radiance - patch.arriving;
        squares += difference * difference / floor.len() as f64;
        off += difference;
        reflected += patch.arriving - direct;
        whole += patch.arriving / floor.len() as f64;
    }
    let rms = squares.sqrt() / whole;
    assert!(rms < 0.045, "{rms}");
    // (Between corners it is more than it should be: light from a wall falls off as a hollow curve.)
    assert!(off.abs() < 0.2 * reflected, "{off} of {reflected}");
}

/// The pixel that shows a place.
pub(crate) fn pixel_of(place: DVec3) -> usize {
    let seen = camera().transform_point3(place);
    let pixel = CAMERA.focal_px * seen.truncate() / seen.z + CAMERA.center_px;
    pixel.y.round() as usize * 120 + pixel.x.round() as usize
}

/// A box of one albedo.
fn white_box(name: &str, low: [f32; 3], high: [f32; 3]) -> Object {
    let mut made = black_box(name, low, high, DAffine3::IDENTITY);
    made.materials[0].albedo = DVec3::splat(ALBEDO);
    made
}

/// A sky with a glow low above the horizon, towards the camera.
fn evening() -> Probe {
    let grid = even(1.0);
    let toward = DVec3::new(0.2, -1.0, 0.2).normalize();
    let pixels = (0..96 * 48).map(|index| {
        let way = grid.direction((index % 96) as f64 + 0.5, (index / 96) as f64 + 0.5);
        let glow = 30.0 * way.dot(toward).max(0.0).powi(60);
        Vec3::splat(if way.z > 0.0 { 0.3 + glow } else { 0.05 } as f32)
    });
    Probe::new([96, 48], pixels.collect()).expect("pixels")
}

/// Harmonics smear a low glow over what the table hides.
#[test]
fn a_low_glow_is_all_on_what_faces_it() {
    let cube = white_box("cube", [-0.03, 0.0, 0.0], [0.03, 0.05, 0.06]);
    let mut scene = under_sky(0, Vec::new(), vec![cube]);
    scene.probe = Some(probe_scene(evening()));
    let (_, _, picture) = gains(&scene, camera());
    let place = DVec3::new(0.0, 0.0, 0.04);
    let probe = scene.probe.as_ref().expect("a probe");
    let irradiance = exact(&probe.probe, place, DVec3::NEG_Y, &[]) * probe.exposure;
    let expected = ALBEDO / std::f64::consts::PI * irradiance;
    let found = picture.linear(pixel_of(place)).y;
    assert!(
        (found / expected - 1.0).abs() < 0.03,
        "{found}, not {expected}"
    );
}

/// Nothing is taken of what a real wall reflects on to a virtual face for the light that the same wall hides.
#[test]
fn a_wall_gives_what_it_reflects_for_what_it_hides() {
    let cube = white_box("cube", [-0.03, 0.0, 0.0], [0.03, 0.05, 0.06]);
    // Beside the camera's way to the cube, lit from there.
    let wall = white_box("wall", [0.05, -0.12, 0.0], [0.06, 0.1, 0.15]);
    let caster = RayCaster::new(&triangles(&wall));
    let toward = DVec3::new(-0.6, -0.5, 0.6).normalize();
    let grid = even(1.0);
    let pixels = (0..96 * 48).map(|index| {
        let way = grid.direction((index % 96) as f64 + 0.5, (index / 96) as f64 + 0.5);
        Vec3::splat((0.2 + 8.0 * way.dot(toward).max(0.0).powi(8)) as f32)
    });
    let probe = probe_scene(Probe::new([96, 48], pixels.collect()).expect("pixels"));
    let (place, normal) = (DVec3::new(0.015, 0.0, 0.04), DVec3::NEG_Y);
    let irradiance_beside = |wall: &Object| {
        let mut scene = under_sky(0, vec![wall.clone()], vec![cube.clone()]);
        scene.probe = Some(probe.clone());
        let (_, _, picture) = gains(&scene, camera());
        picture.linear(pixel_of(place)).y * std::f64::consts::PI / (ALBEDO * probe.exposure)
    };
    let mut black = wall.clone();
    black.materials[0].albedo = DVec3::ZERO;
    let [found, beside_black] = [&wall, &black].map(irradiance_beside);
    let direct = exact(&probe.probe, place, normal, &[&caster]);
    // The wall's side in front of the cube, and the cube's front, which light each other.
    let patch = |place: DVec3, normal: DVec3, casters: &[&RayCaster]| Patch {
        place,
        normal,
        area: 0.005 * 0.005,
        arriving: exact(&probe.probe, place, normal, casters),
    };
    let along = |step: usize| 0.005 * (step as f64 + 0.5);
    let grid_of = |columns: usize, rows: usize| {
        (0..columns * rows).map(move |index| (along(index % columns), along(index / columns)))
    };
    let mut side: Vec<Patch> = grid_of(24, 30)
        .map(|(y, z)| patch(DVec3::new(0.05, y - 0.12, z), DVec3::NEG_X, &[]))
        .collect();
    let mut front: Vec<Patch> = grid_of(12, 12)
        .map(|(x, z)| patch(DVec3::new(x - 0.03, 0.0, z), normal, &[&caster]))
        .collect();
    let alone = |patches: &[Patch]| patches.iter().map(|it| it.arriving).collect::<Vec<f64>>();
    let (of_side, of_front) = (alone(&side), alone(&front));
    for _ in 0..6 {
        pass_on(&mut side, &of_side, &front);
        pass_on(&mut front, &of_front, &side);
    }
    let reflected = from_patches(place, normal, &side, ALBEDO);
    assert!(
        (beside_black / direct - 1.0).abs() < 0.06,
        "{beside_black}, not {direct}"
    );
    let gained = found - beside_black;
    assert!(
        (gained / reflected - 1.0).abs() < 0.15,
        "{gained}, not {reflected}"
    );
}

#[test]
fn what_is_cut_has_the_outline_that_it_had() {
    let scene = shelf_scene();
    let (_, role, _) = gains(&scene, camera());
    let mut black = scene.clone();
    // Without light from afar nothing is cut.
    black.probe = None;
    black.shadows.technique = gnomon::scene::Technique::Volumes;
    black.ambient_radiance = DVec3::ONE;
    let (_, whole, _) = gains(&black, camera());
    assert_eq!(role, whole);
}
