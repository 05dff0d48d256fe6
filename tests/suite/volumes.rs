//! Shadow volumes in thousands of random cases against rays in double precision, the smoothness of edges against area
//! averages, and smooth shading of coarse meshes against its closed form.

use crate::common::composite::{Expected, Verdict};
use crate::common::judge::{ENOUGH, is_edge};
use crate::common::near_edges::{SAMPLES_PX, is_on_edge, is_uniform, sample_places};
use crate::common::random::{Random, random_camera, random_stage};
use crate::common::shapes;
use crate::common::{Stage, Thing, lamp, linear_of_level, look_at, sun};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use gnomon::app::truth::FACES_AWAY;
use gnomon::app::truth::ray_cast::{Exact, GRAZES, SeenSurface, View, World, pixels};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::light::{Light, irradiance};
use gnomon::render::{REAL, REAL_HIDES, VIRTUAL_HIDES};
use std::f64::consts::PI;

/// Random scenes, of each kind; each has some lights and is seen from some places.
const SCENES: u64 = 330;
const CAMERAS: usize = 3;

/// Holds every light's bits and the composite in all scenes of a kind.
fn hold_random(broken: bool) {
    let only: Option<u64> = std::env::var("GNOMON_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok());
    let seeds = only.map_or(0..SCENES, |seed| seed..seed + 1);
    let (mut cases, mut compared, mut shadowed) = (0, 0, 0);
    let mut failures = Vec::new();
    let mut sum = Verdict::default();
    for seed in seeds {
        let mut random = Random::new(2 * seed + u64::from(broken));
        let (stage, places, intrinsics) = random_stage(&mut random, broken);
        let lights = &stage.scene.world_lights();
        let mut renderer = stage.renderer(intrinsics);
        for camera in 0..CAMERAS {
            let view = View {
                intrinsics,
                camera_from_world: random_camera(&mut random, &places, lights),
            };
            let (picture, layers) = stage.shoot(&mut renderer, view.camera_from_world);
            let exact = stage.world.cast(lights, &view, 0.0);
            for light in 0..lights.len() {
                cases += 1;
                let found = &layers.shadow[light];
                let (held, dark, failure) = hold_light(&stage, &view, &exact, light, found);
                compared += held;
                shadowed += dark;
                failures.extend(failure.map(|failure| {
                    format!("seed {seed}, camera {camera}, light {light}: {failure}")
                }));
            }
            let expected = Expected::of_exact(&stage, view, &exact);
            let verdict = expected.judge(&picture, None);
            if verdict.wrong > 0 {
                let (wrong, first) = (verdict.wrong, verdict.first.join("\n"));
                failures.push(format!(
                    "seed {seed}, camera {camera}: {wrong} wrong: {first}"
                ));
            }
            if let (count, Some(first)) = expected.disagreements(&picture, &layers) {
                failures.push(format!(
                    "seed {seed}, camera {camera}: {count} pixels differ from their layers: {first}"
                ));
            }
            sum.join(&verdict);
        }
    }
    eprintln!("{cases} cases, {compared} pixels, {shadowed} of them in a virtual shadow");
    eprintln!("{}", sum.summary());
    assert!(
        failures.is_empty(),
        "{} of {cases} cases (run one by GNOMON_SEED=n):\n{}",
        failures.len(),
        failures.join("\n")
    );
    assert!(only.is_some() || cases > 1000 && shadowed * 20 > compared);
}

/// Pixels that were held, those in a virtual shadow, and what is wrong beyond the edges.
fn hold_light(
    stage: &Stage,
    view: &View,
    exact: &Exact,
    light: usize,
    found_bits: &[u8],
) -> (usize, usize, Option<String>) {
    let exact_bits = &exact.bits[light];
    let light = &stage.scene.lights[light].light;
    let (mut held, mut dark, mut wrong, mut first) = (0, 0, 0, None);
    for (index, center) in pixels(exact.size_px) {
        let (bits, found) = (exact_bits[index], found_bits[index]);
        let surface = exact.surfaces[index].filter(|surface| surface.role == REAL);
        let Some(surface) = surface.filter(|_| bits & (FACES_AWAY | GRAZES) == 0) else {
            continue;
        };
        held += 1;
        dark += usize::from(bits & VIRTUAL_HIDES != 0);
        let differs = (bits ^ found) & (VIRTUAL_HIDES | REAL_HIDES) != 0;
        if differs && !is_edge(&stage.world, view, exact, index, light, exact_bits) {
            wrong += 1;
            first.get_or_insert_with(|| {
                let point = surface.point;
                format!("pixel {center} at {point} has bits {found} for {bits} under {light:?}")
            });
        }
        if wrong >= ENOUGH {
            break;
        }
    }
    let failure = first.map(|first| format!("at least {wrong} wrong: {first}"));
    (held, dark, failure)
}

#[test]
fn random_closed_meshes() {
    hold_random(false);
}

#[test]
fn random_broken_meshes() {
    hold_random(true);
}

/// The light that a pixel loses at an edge against the part of its area that is in shadow.
#[test]
fn edges_are_as_smooth_as_four_samples_can_make_them() {
    let intrinsics = Intrinsics {
        size_px: [320, 240],
        focal_px: DVec2::splat(300.0),
        center_px: DVec2::new(161.3, 118.7),
        distortion: Distortion::NONE,
    };
    // One irradiance everywhere: what is lost tells the part in shadow.
    let light = sun([0.3, 0.2, -1.0], [1.0; 3]);
    let ambient = DVec3::splat(0.1);
    let stage = casters_above_the_ground(light, ambient);
    let around = PI * ambient.x;
    let dark = around / (around + irradiance(&light, DVec3::ZERO, DVec3::Z).x);
    let mut renderer = stage.renderer(intrinsics);
    let (mut errors, mut pattern_errors) = (Vec::new(), Vec::new());
    for side in 0..6 {
        let turn = DVec2::from_angle(0.3 + f64::from(side)) * 0.45;
        let view = View {
            intrinsics,
            camera_from_world: look_at(turn.extend(0.5), DVec3::new(0.02, 0.02, 0.0)),
        };
        let picture = stage.picture(&mut renderer, view.camera_from_world);
        for edge in shares_at_edges(&stage, &view, light) {
            let found = (1.0 - picture.linear(edge.pixel).x) / (1.0 - dark);
            errors.push(found - edge.of_area);
            pattern_errors.push(edge.of_samples - edge.of_area);
        }
    }
    let count = errors.len() as f64;
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / count;
    let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
    let (mean, rms, pattern_rms) = (mean(&errors), rms(&errors), rms(&pattern_errors));
    eprintln!("{count} pixels: mean {mean:.5}, rms {rms:.4}, of the pattern {pattern_rms:.4}");
    assert!(errors.len() > 1000, "{count} edge pixels");
    // Corners are snapped to 1/256 px: an edge of about a pixel's length so passes to the other side of 4 · 2/256
    // samples, each of which is worth a quarter.
    let snapping = 4.0 * 2.0 / 256.0 / 16.0;
    let bound = (pattern_rms * pattern_rms + snapping).sqrt();
    assert!(rms <= bound, "{rms} is more than {bound}");
    // Samples that lie about the pixel's centre err as often to both sides: three standard errors.
    assert!(mean.abs() <= 3.0 * bound / count.sqrt(), "{mean}");
}

/// A torus, a lump with holes and a cube, over a plane.
fn casters_above_the_ground(light: Light, ambient: DVec3) -> Stage {
    let mut random = Random::new(17);
    let lump = shapes::sphere(0.05, 8, 11).map(|place| place * random.between(0.7, 1.3) as f32);
    let lump = shapes::Soup {
        normals: None,
        ..lump
    };
    let casters = [
        Thing::made(shapes::torus(0.05, 0.02, 40, 20)).at([0.05, 0.0, 0.08]),
        Thing::made(lump.without(|index| index % 6 == 0)).at([-0.08, 0.02, 0.07]),
        Thing::made(shapes::cuboid([-0.03; 3], [0.03; 3])).at([0.02, 0.12, 0.05]),
    ];
    let ground = Thing::made(shapes::rectangle([-0.5, -0.5], [0.5, 0.5]));
    Stage::new(
        &[ground],
        &casters,
        Some(DAffine3::IDENTITY),
        vec![light],
        ambient,
    )
}

/// A pixel of the ground that an edge of a virtual shadow passes, and how much of it lies in the shadow.
struct EdgePixel {
    pixel: usize,
    of_area: f64,
    of_samples: f64,
}

fn shares_at_edges(stage: &Stage, view: &View, light: Light) -> Vec<EdgePixel> {
    const STEPS: u32 = 16;
    let size_px = view.intrinsics.size_px;
    let exact = stage.world.cast(&[light], view, 0.0);
    let hidden = |place: DVec2| {
        let seen = stage.world.look(view, place).filter(|s| s.role == REAL);
        seen.map(|s| stage.world.bits(&s, &light, 0.0) & VIRTUAL_HIDES != 0)
    };
    let share = |hidden: &[bool]| {
        hidden.iter().filter(|hidden| **hidden).count() as f64 / hidden.len() as f64
    };
    let mut edges = Vec::new();
    for (index, center) in pixels(size_px) {
        let same = |a: usize, b: usize| exact.bits[0][a] == exact.bits[0][b];
        if exact.role(index) != REAL || is_uniform(size_px, index, same) {
            continue;
        }
        let area: Option<Vec<bool>> = (0..STEPS * STEPS)
            .map(|step| {
                let cell = DVec2::new(f64::from(step % STEPS), f64::from(step / STEPS));
                hidden(center + (cell + 0.5) / f64::from(STEPS) - 0.5)
            })
            .collect();
        let samples: Option<Vec<bool>> = SAMPLES_PX
            .iter()
            .map(|&sample| hidden(center + DVec2::from_array(sample)))
            .collect();
        // A pixel with the caster itself in it has no area of table to average over.
        let (Some(area), Some(samples)) = (area, samples) else {
            continue;
        };
        let (of_area, of_samples) = (share(&area), share(&samples));
        if of_area == 0.0 || of_area == 1.0 {
            continue;
        }
        edges.push(EdgePixel {
            pixel: index,
            of_area,
            of_samples,
        });
    }
    edges
}

/// A coarse sphere with a sphere's normals under one light: each pixel gives back albedo / π · E · max(N·L, 0) with its
/// interpolated normal, or nothing where another thing takes the light. The facets that the terminator crosses are not
/// dark as a whole because they turn their backs on the light.
#[test]
fn terminator_of_a_coarse_smooth_sphere() {
    const RADIUS_M: f64 = 0.1;
    let intrinsics = Intrinsics {
        size_px: [320, 240],
        focal_px: DVec2::splat(330.0),
        center_px: DVec2::new(159.5, 119.5),
        distortion: Distortion::NONE,
    };
    let view = View {
        intrinsics,
        camera_from_world: look_at(DVec3::new(0.1, -0.34, 0.12), DVec3::ZERO),
    };
    let soup = shapes::sphere(RADIUS_M as f32, 8, 12);
    let normals = soup.normals.clone().expect("the normals of the sphere");
    let ball = Thing::made(soup.clone());
    let plate = Thing::made(shapes::cuboid([-0.03, -0.03, 0.0], [0.03, 0.03, 0.005]));
    let lights = [
        ("distant light", sun([1.0, 0.2, -0.3], [4.0; 3])),
        ("light from behind", sun([0.9, -0.5, -0.2], [4.0; 3])),
        ("lamp", lamp([-0.25, 0.02, 0.1], [0.15; 3])),
    ];
    for (name, light) in lights {
        // Beside the sphere on the light's side, where the camera does not see it in front.
        let towards = match light {
            Light::Point { position_m, .. } => position_m.normalize(),
            Light::Directional { direction, .. } => -direction,
        };
        let shade = DAffine3::from_rotation_translation(
            DQuat::from_rotation_arc(DVec3::Z, towards),
            towards * 0.17,
        );
        for virtuals in [
            vec![ball.clone()],
            vec![ball.clone(), plate.clone().placed(shade)],
        ] {
            hold_smooth_sphere(name, &virtuals, light, &view, &soup, &normals);
        }
    }
}

fn hold_smooth_sphere(
    name: &str,
    virtuals: &[Thing],
    light: Light,
    view: &View,
    soup: &shapes::Soup,
    normals: &[glam::Vec3],
) {
    let stage = Stage::new(
        &[],
        virtuals,
        Some(DAffine3::IDENTITY),
        vec![light],
        DVec3::ZERO,
    );
    let albedo = stage.scene.virtuals[0].materials[0].albedo;
    let mut renderer = stage.renderer(view.intrinsics);
    let picture = stage.picture(&mut renderer, view.camera_from_world);
    let of_sphere = soup.triangles.len();
    let others = World::new(stage.world.triangles[of_sphere..].to_vec());
    // Radiance of a place on the sphere.
    let radiance = |seen: &SeenSurface| -> f64 {
        let triangle = stage.world.triangles[seen.triangle].corners;
        let corners = soup.triangles[seen.triangle];
        let of_corners = corners.map(|corner| normals[corner as usize].as_dvec3());
        let normal = interpolated_normal(seen.point, triangle, of_corners);
        if others.bits(seen, &light, 0.0) & VIRTUAL_HIDES != 0 {
            return 0.0;
        }
        let arriving = irradiance(&light, seen.point, normal);
        albedo.x / PI * arriving.x
    };
    let (mut held, mut backs, mut shaded, mut wrong, mut worst) = (0, 0, 0, 0, 0.0_f64);
    for (index, center) in pixels(view.intrinsics.size_px) {
        // All that a pixel's samples may be is between the least and the most within it.
        let Some(within) = seen_within(&stage.world, view, center, of_sphere) else {
            continue;
        };
        let (mut low, mut high) = (f64::MAX, 0.0_f64);
        for surface in &within {
            low = low.min(radiance(surface));
            high = high.max(radiance(surface));
        }
        let level = f64::from(picture.pixel(index)[0]);
        let found = linear_of_level(level);
        let (least, most) = (linear_of_level(level - 1.5), linear_of_level(level + 1.5));
        held += 1;
        let [a, b, c] = stage.world.triangles[within[12].triangle].corners;
        let facet = (b - a).cross(c - a);
        let towards = match light {
            Light::Point { position_m, .. } => position_m - within[12].point,
            Light::Directional { direction, .. } => -direction,
        };
        backs += usize::from(facet.dot(towards) < 0.0 && low > 0.0);
        shaded += usize::from(facet.dot(towards) > 0.0 && high == 0.0);
        // On an edge of the mesh snapping decides on which side a sample lies, and a side of the volume begins there.
        if (most < low || least > high)
            && !sample_places(center).any(|place| is_on_edge(&stage.world, view, place, &light))
        {
            wrong += 1;
            worst = worst.max((found - high).max(low - found));
        }
    }
    eprintln!(
        "{name}, {} things: {held} pixels, {backs} lit on backs of facets, {shaded} shaded on fronts, {wrong} wrong by up to {worst:.3}",
        virtuals.len()
    );
    assert!(held > 10_000, "{name}: {held} pixels");
    assert!(backs > 100, "{name}: {backs} pixels lit on facets' backs");
    assert!(
        virtuals.len() == 1 || shaded > 300,
        "{name}: the plate shades {shaded} pixels"
    );
    assert_eq!(wrong, 0, "{name}: pixels wrong by up to {worst}");
}

/// A triangle's normal at a point of it, from those of its corners.
fn interpolated_normal(point: DVec3, [a, b, c]: [DVec3; 3], of_corners: [DVec3; 3]) -> DVec3 {
    let across = (b - a).cross(c - a);
    let share = |p: DVec3, q: DVec3| (p - point).cross(q - point).dot(across);
    let shares = [share(b, c), share(c, a), share(a, b)];
    let normal: DVec3 = shares
        .iter()
        .zip(of_corners)
        .map(|(share, corner)| corner * *share)
        .sum();
    normal.normalize()
}

/// What is seen at 5 x 5 places of a pixel; `None` unless all of it is among the first so many triangles.
fn seen_within(
    world: &World,
    view: &View,
    center: DVec2,
    triangles: usize,
) -> Option<Vec<SeenSurface>> {
    (0..25)
        .map(|step| {
            let offset = DVec2::new(f64::from(step % 5) - 2.0, f64::from(step / 5) - 2.0);
            let seen = world.look(view, center + offset * 0.25);
            seen.filter(|surface| surface.triangle < triangles)
        })
        .collect()
}
