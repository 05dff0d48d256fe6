//! What a glossy floor sends on to a wall behind it, against sums over the floor of what its material reflects in that direction.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use gnomon::light::layer_albedo::mean_reflectance;
use gnomon::light::material::{Material, Shading};
use gnomon::light::{Light, reflectance};
use gnomon::scene::{Object, Scene};

use crate::environment::{camera, gains, probe_scene, under_sky};
use crate::environment_corners::{even, pixel_of, shelf};

/// The sun's way, low over the floor towards the wall, and its irradiance.
const SUN: DVec3 = DVec3::new(0.0, 0.928_476_690_885_259_4, -0.371_390_676_354_103_7);
const IRRADIANCE: f64 = 2.0;
const WALL_ALBEDO: f64 = 0.2;
/// The floor's height, its ends along y, and half its width, metres; where it ends the wall stands.
const FLOOR_M: f64 = 0.06;
const FRONT_M: f64 = -0.08;
const WALL_M: f64 = 0.07;
const HALF_M: f64 = 0.08;
const WALL_TOP_M: f64 = 0.15;

/// The shelf with its wall towards the camera and the sun, its floor of a material of its own.
fn sunlit_shelf(floor: Material) -> Scene {
    let mut thing: Object = shelf();
    thing.anchor_from_object = DAffine3::from_translation(DVec3::new(0.0, 0.08, 0.05))
        * DAffine3::from_rotation_z(-FRAC_PI_2);
    thing.materials = vec![Material::matt(DVec3::splat(WALL_ALBEDO)), floor];
    let mut mesh = (*thing.mesh).clone();
    for (triangle, material) in mesh.triangles.iter().zip(&mut mesh.triangle_materials) {
        let is_floor = triangle.iter().all(|&corner| {
            let place = mesh.positions[corner as usize];
            (place.z - 0.01).abs() < 1e-6 && place.x > 0.005
        });
        *material = u32::from(is_floor);
    }
    thing.mesh = Arc::new(mesh);
    let mut scene = under_sky(0, Vec::new(), vec![thing]);
    scene.probe = Some(probe_scene(even(1e-6)));
    let sun = Light::Directional {
        direction: SUN,
        irradiance: DVec3::splat(IRRADIANCE),
        angle_rad: 0.0,
    };
    scene.lights = vec![sun.into()];
    scene
}

/// Middles of the floor's cells.
const CELLS: usize = 48;

fn middle(low: f64, high: f64, index: usize) -> f64 {
    low + (high - low) * (index as f64 + 0.5) / CELLS as f64
}

/// Places of a rectangle across the whole shelf, from `low` to `high`, and the area that each stands for.
fn cells(low: f64, high: f64, place: impl Fn(f64, f64) -> DVec3) -> (Vec<DVec3>, f64) {
    let places = (0..CELLS * CELLS).map(|index| {
        let across = middle(-HALF_M, HALF_M, index % CELLS);
        place(across, middle(low, high, index / CELLS))
    });
    let area = (high - low) * 2.0 * HALF_M / (CELLS * CELLS) as f64;
    (places.collect(), area)
}

/// For each cell of the floor what reaches it of the sun by way of the wall.
fn from_wall(floor: &[DVec3]) -> Vec<f64> {
    let (wall, area) = cells(FLOOR_M, WALL_TOP_M, |x, z| DVec3::new(x, WALL_M, z));
    let radiance = WALL_ALBEDO / PI * IRRADIANCE * SUN.y;
    let at = |place: &DVec3| {
        let parts = wall.iter().map(|from| {
            let way = from - place;
            way.z * way.y / way.length_squared().powi(2)
        });
        parts.sum::<f64>() * radiance * area
    };
    floor.iter().map(at).collect()
}

/// Radiance of a place of the wall for each unit of the floor's area, of what its cells send there.
fn from_floor(floor: &[(DVec3, f64)], place: DVec3, of_sun: impl Fn(DVec3) -> f64) -> f64 {
    let parts = floor.iter().map(|(from, of_wall)| {
        let way = place - from;
        let toward = way.normalize();
        (of_sun(toward) + of_wall) * toward.z * toward.y / way.length_squared()
    });
    parts.sum::<f64>() * WALL_ALBEDO / PI
}

/// Of light that the wall gets from the floor, added up over its places.
#[derive(Debug, Default)]
struct FromFloor {
    expected: f64,
    found: f64,
    /// As it would be if the floor sent the sun's light everywhere alike.
    alike: f64,
}

#[test]
fn a_floor_mirrors_a_low_sun_on_to_the_wall_behind_it() {
    let (places, area) = cells(FRONT_M, WALL_M, |x, y| DVec3::new(x, y, FLOOR_M));
    let of_wall = from_wall(&places);
    let materials = [(0.35, 0.0, 0.3), (0.5, 1.0, 0.7), (1.0, 0.0, 0.5)];
    let of_material = |(alpha, metallic, color)| {
        let floor = Material {
            roughness: Some(alpha),
            metallic,
            shading: Shading::Principled,
            ..Material::matt(DVec3::splat(color))
        };
        let mean = mean_reflectance(&floor).x / PI;
        let passed_on = of_wall.iter().map(|of_wall| mean * of_wall);
        let cells: Vec<(DVec3, f64)> = places.iter().copied().zip(passed_on).collect();
        let picture = |floor: Material| gains(&sunlit_shelf(floor), camera()).2;
        // (The wall's own light, beside what is as good as nothing of a floor.)
        let black = picture(Material::matt(DVec3::ZERO));
        let lit = picture(floor);
        let arriving = IRRADIANCE * -SUN.z;
        let mut sums = FromFloor::default();
        for index in 0..8 * 12 {
            let place = DVec3::new(
                -0.055 + 0.01 * f64::from(index % 12),
                WALL_M,
                FLOOR_M + 0.012 + 0.009 * f64::from(index / 12),
            );
            let pixel = pixel_of(place);
            sums.found += lit.linear(pixel).y - black.linear(pixel).y;
            sums.expected += area
                * from_floor(&cells, place, |toward| {
                    reflectance(&floor, DVec3::Z, -SUN, toward).x * arriving
                });
            sums.alike += area * from_floor(&cells, place, |_| mean * arriving);
        }
        sums
    };
    let sums = materials.map(of_material);
    for FromFloor {
        expected,
        found,
        alike,
    } in &sums
    {
        // (Between corners it is more than it should be, as for matt floors: light from a floor falls off as a hollow curve.)
        let off = (found / expected - 1.0).abs();
        assert!(off < 0.2, "{sums:?}");
        let alike_off = (alike / expected - 1.0).abs();
        assert!(alike_off < 0.2 || off < 0.6 * alike_off, "{sums:?}");
    }
}
