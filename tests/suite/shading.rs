//! Shading and gains held against closed forms and the CPU twins in `light`: what a light gives a virtual surface, what
//! its loss takes from a real one, that nothing is darkened twice, and how the recorded picture passes.

use crate::common::{flat_mesh, gpu, grey_frame, lamp, look_at, object, scene, sun, table_top};
use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use gnomon::app::truth::ray_cast::pixels;
use gnomon::capture::Frame;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::geometry::cuboid::cuboid;
use gnomon::geometry::mesh::{CornerLook, Mesh};
use gnomon::light::material::{Encoding, Map, Maps};
use gnomon::light::texture::Texture;
use gnomon::light::{Light, Material, irradiance, reflectance};
use gnomon::render::{Layers, Renderer, Shown};
use gnomon::scene::{Object, Scene};
use std::f64::consts::PI;
use std::sync::Arc;

const SIZE_PX: [u32; 2] = [480, 360];
const AMBIENT: f64 = 0.1;
const ALBEDO: DVec3 = DVec3::new(0.7, 0.4, 0.2);

const PERFECT_LENS: Intrinsics = Intrinsics {
    size_px: SIZE_PX,
    focal_px: DVec2::new(600.0, 590.0),
    center_px: DVec2::new(237.1, 182.9),
    distortion: Distortion::NONE,
};

/// Every pixel another colour than its neighbours.
fn noise(size_px: [u32; 2]) -> Vec<u8> {
    let mut state = 0x9e37_79b9_u32;
    (0..size_px[0] * size_px[1])
        .flat_map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            let [red, green, blue, _] = state.to_le_bytes();
            [red, green, blue, 255]
        })
        .collect()
}

/// The composite and its layers.
fn render(
    scene: &Scene,
    intrinsics: Intrinsics,
    camera_from_world: DAffine3,
    rgba: Vec<u8>,
) -> (Vec<u8>, Layers) {
    let mut renderer = Renderer::new(gpu(), scene, intrinsics).expect("a renderer");
    let frame = Frame {
        index: 0,
        time_secs: 0.0,
        size_px: intrinsics.size_px,
        rgba,
    };
    renderer.upload(&frame).expect("an uploaded frame");
    renderer.draw(&[Some(camera_from_world)], Shown::Composite);
    let picture = renderer.read_picture().expect("a picture");
    (picture, renderer.layers().expect("layers"))
}

/// An octahedron whose faces are split again and again, its normals those of the sphere.
fn sphere_mesh(radius_m: f64) -> Mesh {
    const SPLITS: u32 = 48;
    let mut mesh = Mesh::default();
    let mut index_at = std::collections::HashMap::new();
    for octant in 0..8 {
        let sign = |bit: u32| if octant >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let signs = DVec3::new(sign(0), sign(1), sign(2));
        let mut corner = |i: u32, j: u32| -> u32 {
            let (a, b) = (f64::from(i), f64::from(j));
            let flat = DVec3::new(a, b, f64::from(SPLITS) - a - b) * signs;
            let key = flat.as_ivec3().to_array();
            *index_at.entry(key).or_insert_with(|| {
                mesh.positions.push((flat.normalize() * radius_m).as_vec3());
                mesh.positions.len() as u32 - 1
            })
        };
        let mut triangles = Vec::new();
        for i in 0..SPLITS {
            for j in 0..SPLITS - i {
                triangles.push([corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
                if i + j + 1 < SPLITS {
                    triangles.push([corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]);
                }
            }
        }
        // An odd number of mirrors turns the triangles round.
        if signs.x * signs.y * signs.z < 0.0 {
            triangles
                .iter_mut()
                .for_each(|triangle| triangle.swap(1, 2));
        }
        mesh.triangles.extend(triangles);
    }
    let normal = |index: u32| mesh.positions[index as usize].normalize();
    mesh.corner_normals = mesh.triangles.iter().map(|t| t.map(normal)).collect();
    mesh.triangle_materials = vec![0; mesh.triangles.len()];
    mesh
}

/// A box with its sides along the axes.
#[derive(Clone, Copy)]
struct Crate {
    low: DVec3,
    high: DVec3,
}

impl Crate {
    fn new(low: [f64; 3], high: [f64; 3]) -> Self {
        Self {
            low: DVec3::from_array(low),
            high: DVec3::from_array(high),
        }
    }

    fn object(self, name: &str) -> Object {
        let (positions, triangles) = cuboid(self.low.as_vec3(), self.high.as_vec3());
        let mesh = flat_mesh(positions, triangles);
        object(name, mesh, ALBEDO, DAffine3::IDENTITY)
    }

    /// Whether the straight way from a point towards the light meets the box (slabs).
    fn hides(self, point: DVec3, light: &Light) -> bool {
        let (way, reach) = match *light {
            Light::Point { position_m, .. } => (position_m - point, 1.0),
            Light::Directional { direction, .. } => (-direction, f64::INFINITY),
        };
        let (a, b) = ((self.low - point) / way, (self.high - point) / way);
        let (enters, leaves) = (a.min(b).max_element(), a.max(b).min_element());
        enters < leaves && leaves > 1e-9 && enters < reach
    }
}

/// IEC 61966-2-1, in levels.
fn srgb_levels(linear: f64) -> f64 {
    let shown = linear.clamp(0.0, 1.0);
    255.0
        * if shown <= 0.003_130_8 {
            shown * 12.92
        } else {
            1.055 * shown.powf(1.0 / 2.4) - 0.055
        }
}

fn linear_of_level(level: u8) -> f64 {
    let encoded = f64::from(level) / 255.0;
    if encoded <= 0.040_45 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// Eye and direction of a pixel's ray, in the world.
fn ray(camera_from_world: &DAffine3, pixel: DVec2) -> (DVec3, DVec3) {
    let world_from_camera = camera_from_world.inverse();
    let ideal = (pixel - PERFECT_LENS.center_px) / PERFECT_LENS.focal_px;
    (
        world_from_camera.translation,
        world_from_camera
            .transform_vector3(ideal.extend(1.0))
            .normalize(),
    )
}

/// Where a pixel sees the plane z = 0.
fn table_point(camera_from_world: &DAffine3, pixel: DVec2) -> DVec3 {
    let (eye, direction) = ray(camera_from_world, pixel);
    eye - direction * (eye.z / direction.z)
}

fn to_light(light: &Light, point: DVec3) -> DVec3 {
    match *light {
        Light::Point { position_m, .. } => (position_m - point).normalize(),
        Light::Directional { direction, .. } => -direction,
    }
}

const RADIUS_M: f64 = 0.1;

fn sphere_camera() -> DAffine3 {
    look_at(DVec3::new(0.12, -0.35, 0.2), DVec3::ZERO)
}

fn sphere_scene(material: Material, lights: Vec<Light>) -> Scene {
    let mut sphere = object("sphere", sphere_mesh(RADIUS_M), ALBEDO, DAffine3::IDENTITY);
    sphere.materials = vec![material];
    scene(vec![], vec![sphere], lights, 0.0)
}

/// Pixels well inside the sphere (where triangles meet, drivers may take a surface's centroid at any sample) and away from every light's terminator, with point and normal.
fn sphere_points(lights: &[Light]) -> Vec<(usize, DVec3, DVec3)> {
    let camera = sphere_camera();
    pixels(SIZE_PX)
        .filter_map(|(index, pixel)| {
            let (eye, direction) = ray(&camera, pixel);
            let half = eye.dot(direction);
            let root = half * half - eye.length_squared() + RADIUS_M * RADIUS_M;
            let point = eye + direction * (-half - root.max(0.0).sqrt());
            let normal = point.normalize();
            let clear = |light: &Light| normal.dot(to_light(light, point)).abs() > 0.12;
            let inside = root > 0.0 && normal.dot(-direction) > 0.3;
            (inside && lights.iter().all(clear)).then_some((index, point, normal))
        })
        .collect()
}

/// The radiance that the CPU twins say.
fn expected_radiance(material: &Material, lights: &[Light], point: DVec3, normal: DVec3) -> DVec3 {
    let eye = sphere_camera().inverse().translation;
    let to_camera = (eye - point).normalize();
    lights
        .iter()
        .map(|light| {
            let arriving = irradiance(light, point, normal);
            arriving * reflectance(material, normal, to_light(light, point), to_camera)
        })
        .sum()
}

fn hold_sphere(name: &str, roughness: Option<f64>, lights: &[Light]) {
    let material = Material {
        roughness,
        ..Material::matt(ALBEDO)
    };
    hold_scene(name, &sphere_scene(material, lights.to_vec()), &material);
}

/// Holds a scene's sphere against what the twins say of a material.
fn hold_scene(name: &str, scene: &Scene, material: &Material) {
    hold_bent(name, scene, material, |normal| normal);
}

/// The same of a sphere whose normals are others.
fn hold_bent(name: &str, scene: &Scene, material: &Material, bent: impl Fn(DVec3) -> DVec3) {
    let lights = &scene.world_lights()[..];
    let (picture, _) = render(
        scene,
        PERFECT_LENS,
        sphere_camera(),
        grey_frame(SIZE_PX).rgba,
    );
    let points = sphere_points(lights);
    let mut worst = 0.0_f64;
    let mut brightest = 0;
    for &(index, point, normal) in &points {
        let normal = bent(normal);
        let expected = material.emission + expected_radiance(material, lights, point, normal);
        for channel in 0..3 {
            let level = picture[4 * index + channel];
            worst = worst.max((f64::from(level) - srgb_levels(expected[channel])).abs());
            brightest = brightest.max(level);
        }
    }
    eprintln!(
        "{name}: {} pixels, worst {worst:.2} levels, brightest {brightest}",
        points.len()
    );
    assert!(points.len() > 5000, "{name}: {} pixels", points.len());
    assert!(
        (150..255).contains(&brightest),
        "{name}: the brightest of the picture is {brightest}"
    );
    assert!(worst <= 2.0, "{name}: {worst} levels");
}

#[test]
fn sphere_under_a_directional_light_is_lambert() {
    hold_sphere("lambert", None, &[sun([-0.5, 0.6, -1.0], [2.6, 2.4, 2.0])]);
}

#[test]
fn sphere_under_a_directional_light_is_glossy() {
    hold_sphere(
        "roughness 0.3",
        Some(0.3),
        &[sun([-0.5, 0.6, -1.0], [1.6, 1.5, 1.4])],
    );
}

#[test]
fn point_light_near_a_sphere() {
    hold_sphere(
        "point light",
        Some(0.3),
        &[lamp([0.2, -0.15, 0.25], [0.12, 0.14, 0.16])],
    );
}

#[test]
fn metal_is_its_layer_in_its_color_and_emission_adds() {
    for (name, metallic, lights) in [
        ("metal", 1.0, vec![sun([-0.5, 0.6, -1.0], [1.0, 0.9, 0.8])]),
        (
            "half metal",
            0.5,
            vec![sun([-0.5, 0.6, -1.0], [1.4, 1.2, 1.3])],
        ),
        (
            "metal under two lights",
            1.0,
            vec![
                sun([-0.5, 0.6, -1.0], [0.8, 0.9, 0.8]),
                sun([0.8, 0.5, -0.3], [0.3, 0.4, 0.6]),
            ],
        ),
    ] {
        let material = Material {
            roughness: Some(0.4),
            metallic,
            emission: DVec3::new(0.02, 0.05, 0.1),
            ..Material::matt(ALBEDO)
        };
        hold_scene(name, &sphere_scene(material, lights), &material);
    }
}

#[test]
fn pictures_and_colors_multiply_the_material() {
    // One colour everywhere, so that it is known whatever the texture coordinates.
    let texture = |name: &str, texel: [u8; 4]| {
        std::sync::Arc::new(Texture {
            name: name.to_owned(),
            size_px: [4, 2],
            rgba: texel.repeat(8),
        })
    };
    let textures = vec![
        texture("color", [188, 230, 255, 255]),
        texture("metal and roughness", [0, 204, 102, 255]),
        texture("normal", [140, 128, 255, 255]),
    ];
    let seen = Material {
        roughness: Some(0.5),
        metallic: 0.5,
        maps: Maps {
            color: Some(Map::of(0)),
            roughness: Some(Map::of(1)),
            metallic: Some(Map::of(1)),
            normal: Some(Map::of(2)),
            ..Maps::NONE
        },
        ..Material::matt(ALBEDO)
    };
    let tint = DVec3::new(0.9, 1.0, 0.8);
    let texel = textures[0].texel([0, 0], Encoding::Srgb).truncate();
    let expected = Material {
        roughness: Some(0.5 * 0.8 * 0.8),
        metallic: 0.5 * 0.4,
        ..Material::matt(ALBEDO * texel * tint)
    };
    for lights in [
        vec![sun([-0.5, 0.6, -1.0], [2.6, 2.4, 2.0])],
        vec![
            sun([-0.5, 0.6, -1.0], [2.3, 2.2, 1.0]),
            sun([0.8, 0.5, -0.3], [0.5, 0.9, 1.4]),
        ],
    ] {
        let mut scene = sphere_scene(seen, lights);
        let sphere = &mut scene.virtuals[0];
        sphere.textures.clone_from(&textures);
        let corner = |place: &Vec3| CornerLook {
            uv: [Vec2::new(3.0 * place.x, 5.0 * place.y); 2],
            color: tint.as_vec3().extend(1.0),
            tangent: place
                .cross(Vec3::new(0.3, 0.5, 0.8))
                .normalize_or_zero()
                .extend(1.0),
            ..CornerLook::default()
        };
        let mesh = Arc::make_mut(&mut sphere.mesh);
        mesh.looks = mesh.positions.iter().map(corner).collect();
        mesh.corner_looks.clone_from(&mesh.triangles);
        // The normal map leans towards u by x and towards v by y, of -1 to 1.
        let bent = |normal: DVec3| {
            let along_u = normal.cross(DVec3::new(0.3, 0.5, 0.8)).normalize();
            let along_v = normal.cross(along_u);
            let [x, y] = [140.0, 128.0].map(|byte: f64| byte / 255.0 * 2.0 - 1.0);
            (along_u * x + along_v * y + normal).normalize()
        };
        hold_bent("textured", &scene, &expected, bent);
    }
}

#[test]
fn lights_add_up_in_linear_light() {
    let first = sun([-0.5, 0.6, -1.0], [1.3, 1.2, 1.0]);
    let second = sun([0.8, 0.5, -0.3], [0.5, 0.9, 1.4]);
    hold_sphere("two lights", None, &[first, second]);

    // The same without the twin: the pictures themselves add up.
    let material = Material::matt(ALBEDO);
    let picture = |lights: &[Light]| {
        render(
            &sphere_scene(material, lights.to_vec()),
            PERFECT_LENS,
            sphere_camera(),
            grey_frame(SIZE_PX).rgba,
        )
        .0
    };
    let (one, other, together) = (
        picture(&[first]),
        picture(&[second]),
        picture(&[first, second]),
    );
    let mut doubly_lit = 0;
    for (index, _, normal) in sphere_points(&[first, second]) {
        for channel in (0..3).map(|channel| 4 * index + channel) {
            let sum = linear_of_level(one[channel]) + linear_of_level(other[channel]);
            let levels = f64::from(together[channel]) - srgb_levels(sum);
            assert!(levels.abs() <= 2.0, "pixel {index}: {levels} levels");
        }
        let lit = |light: &Light| normal.dot(to_light(light, DVec3::ZERO)) > 0.0;
        doubly_lit += usize::from(lit(&first) && lit(&second));
    }
    assert!(doubly_lit > 1000, "{doubly_lit} pixels get both lights");
}

/// A flat virtual plate under a lamp: I h / (h² + r²)^(3/2), so a fourth at twice the height.
#[test]
fn point_light_falls_off_with_the_square_of_distance() {
    let camera = look_at(DVec3::new(0.0, -0.25, 0.5), DVec3::ZERO);
    let intensity = 0.5;
    let mut middle = Vec::new();
    for height_m in [0.25, 0.5, 1.0] {
        let plate = Object {
            name: "plate".to_owned(),
            ..table_top(2.0, ALBEDO)
        };
        let light = lamp([0.0, 0.0, height_m], [intensity; 3]);
        let (picture, _) = render(
            &scene(vec![], vec![plate], vec![light], 0.0),
            PERFECT_LENS,
            camera,
            grey_frame(SIZE_PX).rgba,
        );
        for (index, pixel) in pixels(SIZE_PX) {
            let distance_m = table_point(&camera, pixel).length();
            let arriving = intensity * height_m / (height_m.powi(2) + distance_m.powi(2)).powf(1.5);
            for channel in 0..3 {
                let expected = srgb_levels(ALBEDO[channel] / PI * arriving);
                let levels = f64::from(picture[4 * index + channel]) - expected;
                assert!(
                    levels.abs() <= 2.0 || expected >= 254.0,
                    "height {height_m}, pixel {pixel}: {levels} levels"
                );
            }
        }
        let [x, y] = PERFECT_LENS.center_px.round().to_array().map(|c| c as u32);
        let blue = picture[4 * (y * SIZE_PX[0] + x) as usize + 2];
        middle.push(linear_of_level(blue));
    }
    for pair in middle.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((ratio - 4.0).abs() < 0.2, "{ratio} of {middle:?}");
    }
}

const CASTER: Crate = Crate {
    low: DVec3::new(-0.05, -0.04, 0.02),
    high: DVec3::new(0.05, 0.05, 0.12),
};

fn table_camera() -> DAffine3 {
    look_at(DVec3::new(0.05, -0.55, 0.6), DVec3::new(0.05, 0.02, 0.0))
}

/// Ambient / (ambient + E cos) of the table, without a box's light.
fn closed_form_gain(light: &Light, point: DVec3) -> DVec3 {
    let around = PI * AMBIENT;
    around / (around + irradiance(light, point, DVec3::Z))
}

/// What holds for the whole neighbourhood of a pixel on the table: all, none, or neither of both.
fn everywhere(
    camera: &DAffine3,
    pixel: DVec2,
    reach_px: f64,
    holds: impl Fn(DVec3) -> bool,
) -> Option<bool> {
    let mut found = (0..25).map(|step| {
        let offset = DVec2::new(f64::from(step % 5) - 2.0, f64::from(step / 5) - 2.0);
        holds(table_point(camera, pixel + offset * (reach_px / 2.0)))
    });
    let first = found.next()?;
    found.all(|next| next == first).then_some(first)
}

/// The pixels whose whole neighbourhood is real.
fn all_real(layers: &Layers, size_px: [u32; 2]) -> Vec<bool> {
    let [width, height] = size_px.map(i64::from);
    let real = |x: i64, y: i64| layers.role[(y * width + x) as usize] == 100;
    (0..width * height)
        .map(|index| {
            let (x, y) = (index % width, index / width);
            (-2..=2).all(|dy| {
                (-2..=2).all(|dx| real((x + dx).clamp(0, width - 1), (y + dy).clamp(0, height - 1)))
            })
        })
        .collect()
}

/// Holds the gain of every table pixel that is clear of edges against `expected`; gives how many are darkened, and how
/// many lie in both a real and a virtual shadow.
fn hold_gains(name: &str, real: &[Crate], seeming: &[Crate], light: Light) -> [usize; 2] {
    let camera = table_camera();
    let phantoms = std::iter::once(table_top(2.0, ALBEDO))
        .chain(real.iter().map(|it| it.object("real")))
        .collect();
    let virtuals = seeming.iter().map(|it| it.object("virtual")).collect();
    let (_, layers) = render(
        &scene(phantoms, virtuals, vec![light], AMBIENT),
        PERFECT_LENS,
        camera,
        grey_frame(SIZE_PX).rgba,
    );
    let clear = all_real(&layers, SIZE_PX);
    let (mut darkened, mut both, mut worst) = (0, 0, 0.0_f64);
    for (index, pixel) in pixels(SIZE_PX) {
        // The real boxes' own faces are no table.
        let (eye, _) = ray(&camera, pixel);
        let sight = Light::point(eye, DVec3::ONE);
        let seen = |point: DVec3| real.iter().any(|it| it.hides(point, &sight));
        if !clear[index] || everywhere(&camera, pixel, 1.5, seen) != Some(false) {
            continue;
        }
        let in_shadow = |boxes: &[Crate]| {
            everywhere(&camera, pixel, 1.5, |point| {
                boxes.iter().any(|it| it.hides(point, &light))
            })
        };
        let (Some(in_real), Some(in_virtual)) = (in_shadow(real), in_shadow(seeming)) else {
            continue;
        };
        let gain = layers.gain[index];
        if in_virtual && !in_real {
            let expected = closed_form_gain(&light, table_point(&camera, pixel));
            let found = DVec3::from_array(gain.map(f64::from));
            worst = worst.max((found - expected).abs().max_element());
            darkened += 1;
        } else {
            assert_eq!(gain, [1.0; 3], "{name}: nothing is hidden from {pixel}");
            both += usize::from(in_real && in_virtual);
        }
    }
    eprintln!("{name}: {darkened} pixels darkened, {both} in both, worst {worst:.2e}");
    assert!(worst < 1e-3, "{name}: {worst}");
    [darkened, both]
}

#[test]
fn virtual_shadow_leaves_what_the_ambient_light_gives() {
    let lights = [
        ("sun", sun([0.6, 0.3, -1.0], [1.2, 0.9, 0.6])),
        ("lamp", lamp([-0.3, -0.1, 0.5], [0.4, 0.3, 0.2])),
    ];
    for (name, light) in lights {
        let [darkened, _] = hold_gains(name, &[], &[CASTER], light);
        assert!(darkened > 500, "{name}: {darkened} pixels");
    }
}

#[test]
fn what_is_dark_already_is_not_darkened_again() {
    let tall = Crate::new([-0.2, -0.06, 0.0], [-0.12, 0.06, 0.2]);
    let [darkened, both] = hold_gains(
        "in a real shadow",
        &[tall],
        &[CASTER],
        sun([0.9, 0.1, -0.8], [1.2, 0.9, 0.6]),
    );
    assert!(
        darkened > 100 && both > 100,
        "{darkened} darkened, {both} in both"
    );
}

#[test]
fn two_virtual_casters_darken_once() {
    let light = sun([0.6, 0.3, -1.0], [1.2, 0.9, 0.6]);
    let above = Crate::new([-0.12, -0.08, 0.15], [-0.02, 0.04, 0.2]);
    let [darkened, _] = hold_gains("two casters", &[], &[CASTER, above], light);
    let camera = table_camera();
    let overlap = pixels(SIZE_PX)
        .map(|(_, pixel)| table_point(&camera, pixel))
        .filter(|&point| CASTER.hides(point, &light) && above.hides(point, &light))
        .count();
    assert!(
        darkened > 500 && overlap > 500,
        "{darkened} darkened, {overlap} under both"
    );
}

#[test]
fn perfect_lens_passes_the_video_bit_for_bit() {
    let light = sun([0.6, 0.3, -1.0], [1.2, 0.9, 0.6]);
    let video = noise(SIZE_PX);
    let scene = scene(
        vec![table_top(2.0, ALBEDO)],
        vec![CASTER.object("box")],
        vec![light],
        AMBIENT,
    );
    let (picture, layers) = render(&scene, PERFECT_LENS, table_camera(), video.clone());
    let clear = all_real(&layers, SIZE_PX);
    let (mut untouched, mut changed) = (0, 0);
    for (index, &clear) in clear.iter().enumerate() {
        let at = 4 * index..4 * index + 4;
        if clear && layers.gain[index] == [1.0; 3] {
            assert_eq!(picture[at.clone()], video[at], "pixel {index}");
            untouched += 1;
        } else {
            changed += usize::from(picture[at.clone()] != video[at]);
        }
    }
    assert!(
        untouched > 20_000 && changed > 1000,
        "{untouched} untouched, {changed} changed"
    );

    let mut renderer = Renderer::new(gpu(), &scene, PERFECT_LENS).expect("a renderer");
    let frame = Frame {
        index: 0,
        time_secs: 0.0,
        size_px: SIZE_PX,
        rgba: video.clone(),
    };
    renderer.upload(&frame).expect("an uploaded frame");
    for (poses, shown) in [
        (None, Shown::Composite),
        (Some(table_camera()), Shown::Bare),
    ] {
        renderer.draw(&[poses], shown);
        assert!(
            renderer.read_picture().expect("a picture") == video,
            "{shown:?}: the video alone"
        );
    }
}

#[test]
fn what_goes_fades_and_the_rest_stays_bit_for_bit() {
    let light = sun([0.6, 0.3, -1.0], [1.2, 0.9, 0.6]);
    let scene = scene(
        vec![table_top(2.0, ALBEDO)],
        vec![CASTER.object("box")],
        vec![light],
        AMBIENT,
    );
    let mut renderer = Renderer::new(gpu(), &scene, PERFECT_LENS).expect("a renderer");
    let frame = Frame {
        index: 0,
        time_secs: 0.0,
        size_px: SIZE_PX,
        rgba: noise(SIZE_PX),
    };
    renderer.upload(&frame).expect("an uploaded frame");
    let mut picture = |visibility: f64| {
        renderer.draw_fading(&[Some(table_camera())], &[visibility], Shown::Composite);
        renderer.read_picture().expect("a picture")
    };
    let [whole, half, tenth, none] = [1.0, 0.5, 0.1, 0.0].map(&mut picture);
    assert_eq!(none, frame.rgba, "the video alone");
    let mut faded = 0;
    for (part, picture) in [(0.5, half), (0.1, tenth)] {
        for ((&whole, &none), &mixed) in whole.iter().zip(&none).zip(&picture) {
            let expected = f64::from(none) + part * (f64::from(whole) - f64::from(none));
            assert!(
                (f64::from(mixed) - expected).abs() <= 0.51,
                "{none}, {whole}: {mixed}"
            );
            faded += usize::from(whole != none);
        }
    }
    assert!(faded > 5000, "{faded}");
}

#[test]
fn lens_distortion_is_undone_bilinearly() {
    for distortion in [
        Distortion::Polynomial([0.08, -0.19, 0.004, -0.003, 0.05]),
        Distortion::Rational([
            0.08, -0.19, 0.004, -0.003, 0.05, 0.1, -0.06, 0.02, 0.003, -0.002, -0.004, 0.001, 0.03,
            -0.02,
        ]),
        Distortion::Fisheye([-0.013, 0.021, -0.019, 0.005]),
    ] {
        undistorted_as_by_rays(distortion);
    }
}

fn undistorted_as_by_rays(distortion: Distortion) {
    let lens = Intrinsics {
        distortion,
        ..PERFECT_LENS
    };
    let video = noise(SIZE_PX);
    let light = sun([0.6, 0.3, -1.0], [1.2, 0.9, 0.6]);
    let (picture, layers) = render(
        &scene(
            vec![table_top(2.0, ALBEDO)],
            vec![CASTER.object("box")],
            vec![light],
            AMBIENT,
        ),
        lens,
        table_camera(),
        video.clone(),
    );
    let clear = all_real(&layers, SIZE_PX);
    let level = |x: f64, y: f64, channel: usize| {
        let at = |value: f64, size: u32| value.clamp(0.0, f64::from(size) - 1.0) as usize;
        let index = at(y, SIZE_PX[1]) * SIZE_PX[0] as usize + at(x, SIZE_PX[0]);
        f64::from(video[4 * index + channel])
    };
    let (mut worst, mut moved, mut untouched) = (0.0_f64, 0.0_f64, 0);
    for (index, pixel) in pixels(SIZE_PX) {
        if !clear[index] || layers.gain[index] != [1.0; 3] {
            continue;
        }
        untouched += 1;
        let ideal = (pixel - lens.center_px) / lens.focal_px;
        let seen = match distortion {
            // OpenCV's model, written from its documentation.
            Distortion::Polynomial([k1, k2, p1, p2, k3]) => {
                let DVec2 { x, y } = ideal;
                let r2 = x * x + y * y;
                let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
                DVec2::new(
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                )
            }
            // `lenses.rs` holds these against OpenCV.
            other => other.distort(ideal),
        };
        let DVec2 { x: u, y: v } = seen * lens.focal_px + lens.center_px;
        moved = moved.max((DVec2::new(u, v) - pixel).length());
        let (s, t) = (u - u.floor(), v - v.floor());
        for channel in 0..3 {
            let row = |y: f64| {
                (1.0 - s) * level(u.floor(), y, channel) + s * level(u.floor() + 1.0, y, channel)
            };
            let expected = (1.0 - t) * row(v.floor()) + t * row(v.floor() + 1.0);
            worst = worst.max((f64::from(picture[4 * index + channel]) - expected).abs());
        }
    }
    eprintln!("{untouched} pixels, moved by up to {moved:.2} px, worst {worst:.2} levels");
    assert!(untouched > 20_000 && moved > 1.0);
    assert!(worst <= 1.0, "{worst} levels");
}

/// What a material sends of light 1 from everywhere to a camera at some angle from its normal.
fn reflected_of_everywhere(material: &Material, cos_camera: f64) -> DVec3 {
    const STEPS: u32 = 240;
    let to_camera = DVec3::new((1.0 - cos_camera * cos_camera).sqrt(), 0.0, cos_camera);
    let mut sum = DVec3::ZERO;
    for index in 0..STEPS * STEPS {
        let [down, around] =
            [index / STEPS, index % STEPS].map(|at| (f64::from(at) + 0.5) / f64::from(STEPS));
        // Even in the square of the sine: the cosine is in it.
        let (sine, cosine) = (2.0 * PI * around).sin_cos();
        let radius = down.sqrt();
        let to_light = DVec3::new(radius * cosine, radius * sine, (1.0 - down).sqrt());
        sum += reflectance(material, DVec3::Z, to_light, to_camera);
    }
    sum * PI / f64::from(STEPS * STEPS)
}

/// Of ambient light and lamps.
fn hold_in_ambient_light(name: &str, material: &Material, samples: u32, lights: &[Light]) {
    const RADIANCE: f64 = 0.5;
    let mut scene = sphere_scene(*material, lights.to_vec());
    scene.ambient_radiance = DVec3::splat(RADIANCE);
    scene.shadows.samples = samples;
    let steps = 40;
    let of_everywhere: Vec<DVec3> = (0..=steps)
        .map(|step| reflected_of_everywhere(material, f64::from(step.max(1)) / f64::from(steps)))
        .collect();
    let (picture, _) = render(
        &scene,
        PERFECT_LENS,
        sphere_camera(),
        grey_frame(SIZE_PX).rgba,
    );
    let eye = sphere_camera().inverse().translation;
    let mut worst = 0.0_f64;
    for (index, point, normal) in sphere_points(lights) {
        let place = normal.dot((eye - point).normalize()) * f64::from(steps);
        let low = (place as usize).min(steps as usize - 1);
        let ambient = of_everywhere[low].lerp(of_everywhere[low + 1], place - low as f64);
        let expected = RADIANCE * ambient + expected_radiance(material, lights, point, normal);
        for channel in 0..3 {
            let level = f64::from(picture[4 * index + channel]);
            worst = worst.max((level - srgb_levels(expected[channel])).abs());
        }
    }
    eprintln!("{name}, {samples} samples: worst {worst:.2} levels");
    assert!(worst <= 3.0, "{name}, {samples} samples: {worst} levels");
}

#[test]
fn what_is_glossy_mirrors_the_ambient_light_as_its_brdf_says() {
    let layered = |metallic, roughness, albedo| Material {
        roughness: Some(roughness),
        metallic,
        ..Material::matt(albedo)
    };
    for (name, material) in [
        ("metal", layered(1.0, 0.3, ALBEDO)),
        ("rough metal", layered(1.0, 0.8, ALBEDO)),
        ("half metal", layered(0.5, 0.4, ALBEDO)),
        ("dielectric", layered(0.0, 0.3, ALBEDO)),
    ] {
        hold_in_ambient_light(name, &material, 4, &[]);
        let lamp = sun([-0.5, 0.6, -1.0], [0.3, 0.3, 0.3]);
        // One light and one sample are shaded straight into the picture.
        hold_in_ambient_light(name, &material, 1, &[lamp]);
    }
}

/// The white furnace: a mirror that takes nothing away is as bright as all around it.
#[test]
fn a_white_metal_ball_vanishes_in_constant_light() {
    let material = Material {
        roughness: Some(0.05),
        metallic: 1.0,
        ..Material::matt(DVec3::ONE)
    };
    let mut scene = sphere_scene(material, vec![]);
    scene.ambient_radiance = DVec3::splat(0.5);
    let frame = grey_frame(SIZE_PX).rgba;
    let (picture, _) = render(&scene, PERFECT_LENS, sphere_camera(), frame);
    let points = sphere_points(&[]);
    for &(index, ..) in &points {
        let off = (linear_of_level(picture[4 * index]) / 0.5 - 1.0).abs();
        assert!(off < 0.02, "{off}");
    }
}
