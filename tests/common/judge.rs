//! Rendered layers held against the ray cast.

use glam::{DVec2, DVec3};
use gnomon::app::truth::FACES_AWAY;
use gnomon::app::truth::ray_cast::{
    Exact, GRAZES, SAMPLES_PX, Surface, View, World, is_uniform, pixels, sample_places,
};
use gnomon::light::{Light, irradiance};
use gnomon::render::{Layers, REAL, REAL_HIDES, VIRTUAL_HIDES};

/// So many pixels that are surely wrong: the rest of a picture's need no rays to say so.
pub const ENOUGH: usize = 20;

/// How one light's bits differ from the truth.
#[derive(Debug, Default)]
pub struct Error {
    /// Real pixels that face the light.
    pub counted: usize,
    /// Those of them in a virtual thing's shadow.
    pub shadowed: usize,
    /// Wrong bits of a virtual thing's shadow, percent of `counted`.
    pub wrong_pct: f64,
    /// Wrong bits of a real thing's shadow, percent of `counted`.
    pub wrong_real_pct: f64,
    /// Wrong pixels with no edge within 1.5 px: how many, and the first of them.
    pub far: usize,
    pub first_far: Option<[u32; 2]>,
}

/// Whether a pixel has an edge of the truth within 1.5 px. The pixels around it tell, and where they are all alike rays
/// between them: what is thinner than a pixel shows its edges at no centre.
pub fn is_edge(
    world: &World,
    view: &View,
    exact: &Exact,
    index: usize,
    light: &Light,
    bits: &[u8],
) -> bool {
    let value = |at: usize| (exact.role(at), bits[at]);
    if !is_uniform(exact.size_px, index, |a, b| value(a) == value(b)) {
        return true;
    }
    let width = exact.size_px[0] as usize;
    let center = DVec2::new((index % width) as f64, (index / width) as f64);
    let differs = |place: DVec2| {
        let seen = world.look(view, place);
        let found = seen.map_or((0, 0), |s| (s.role, world.bits(&s, light, 0.0)));
        found != value(index)
    };
    World::places_around(center).any(differs) || world.is_on_edge(view, center, light)
}

/// Holds the bits of a light at real pixels that face it; `exact` may come from elsewhere than `world`.
pub fn shadow_error(
    world: &World,
    view: &View,
    exact: &Exact,
    light: &Light,
    exact_bits: &[u8],
    found_bits: &[u8],
) -> Error {
    let mut error = Error::default();
    let (mut wrong, mut wrong_real) = (0, 0);
    for (index, (&exact_bit, &found)) in exact_bits.iter().zip(found_bits).enumerate() {
        if exact.role(index) != REAL || exact_bit & (FACES_AWAY | GRAZES) != 0 {
            continue;
        }
        error.counted += 1;
        error.shadowed += usize::from(exact_bit & VIRTUAL_HIDES != 0);
        let differs = exact_bit ^ found;
        wrong += usize::from(differs & VIRTUAL_HIDES != 0);
        wrong_real += usize::from(differs & REAL_HIDES != 0);
        if differs & (VIRTUAL_HIDES | REAL_HIDES) != 0
            && (error.far >= ENOUGH || !is_edge(world, view, exact, index, light, exact_bits))
        {
            let [x, y] = [
                index as u32 % exact.size_px[0],
                index as u32 / exact.size_px[0],
            ];
            error.far += 1;
            error.first_far.get_or_insert([x, y]);
        }
    }
    let percent = |count: usize| 100.0 * count as f64 / error.counted.max(1) as f64;
    error.wrong_pct = percent(wrong);
    error.wrong_real_pct = percent(wrong_real);
    error
}

/// Real pixels away from edges whose gain the closed form does not explain.
#[derive(Debug, Default)]
pub struct GainError {
    pub counted: usize,
    pub darkened: usize,
    pub wrong: usize,
    /// Pixel, what was found and what was expected there.
    pub first: Option<([u32; 2], [f32; 3], DVec3)>,
}

/// What the lights give a surface: (E − E newly hidden) / E, and whether anything is newly hidden.
fn exact_gain(
    lights: &[Light],
    bits: impl Fn(usize) -> u8,
    surface: &Surface,
    ambient: DVec3,
) -> (DVec3, bool) {
    let (mut before, mut after, mut hidden) = (ambient, ambient, false);
    for (index, light) in lights.iter().enumerate() {
        if bits(index) & (FACES_AWAY | REAL_HIDES) != 0 {
            continue;
        }
        let arriving = irradiance(light, surface.point, surface.normal);
        before += arriving;
        if bits(index) & VIRTUAL_HIDES == 0 {
            after += arriving;
        } else {
            hidden = true;
        }
    }
    (if hidden { after / before } else { DVec3::ONE }, hidden)
}

fn is_snapped(world: &World, view: &View, center: DVec2, lights: &[Light]) -> bool {
    sample_places(center).any(|place| {
        lights
            .iter()
            .any(|light| world.is_on_edge(view, place, light))
    })
}

/// Holds the picture's own gain away from all edges against what the lights that are left give.
pub fn gain_error(
    world: &World,
    view: &View,
    exact: &Exact,
    lights: &[Light],
    ambient_radiance: DVec3,
    layers: &Layers,
) -> GainError {
    let ambient = ambient_radiance * std::f64::consts::PI;
    // Sums are kept in half precision: each addition rounds by up to 2⁻¹¹, above and below the line.
    let rounding = 2.0 * (lights.len() + 1) as f64 / 2048.0;
    let mut error = GainError::default();
    let same = |a: usize, b: usize| {
        exact.role(a) == exact.role(b) && exact.bits.iter().all(|bits| bits[a] == bits[b])
    };
    for (index, center) in pixels(exact.size_px) {
        let Some(surface) = exact.surfaces[index].filter(|surface| surface.role == REAL) else {
            continue;
        };
        let grazed = exact.bits.iter().any(|bits| bits[index] & GRAZES != 0);
        if grazed || layers.role[index] != REAL || !is_uniform(exact.size_px, index, same) {
            continue;
        }
        error.counted += 1;
        let found = layers.gain[index];
        let found_wide = DVec3::from_array(found.map(f64::from));
        let at_center = exact_gain(lights, |light| exact.bits[light][index], &surface, ambient);
        error.darkened += usize::from(at_center.1);
        let (mut low, mut high) = (at_center.0, at_center.0);
        let explained = |low: DVec3, high: DVec3| {
            if at_center.1 {
                found_wide.cmpge(low - rounding).all() && found_wide.cmple(high + rounding).all()
            } else {
                found == [1.0; 3]
            }
        };
        if explained(low, high) {
            continue;
        }
        if error.wrong >= ENOUGH {
            error.wrong += 1;
            continue;
        }
        let mut around = sample_places(center).flat_map(World::places_around);
        let is_edge = around.any(|place| {
            let Some(seen) = world.look(view, place) else {
                return true;
            };
            let bits: Vec<u8> = lights.iter().map(|l| world.bits(&seen, l, 0.0)).collect();
            let (gain, _) = exact_gain(lights, |light| bits[light], &seen, ambient);
            low = low.min(gain);
            high = high.max(gain);
            seen.role != REAL || (0..lights.len()).any(|l| bits[l] != exact.bits[l][index])
        });
        // A triangle that reaches behind the camera is cut by the driver, and Mesa's software one interpolates badly on
        // a piece as thin as one sample: that sample's light is then anything up to what it should be.
        let [a, b, c] = world.triangles[surface.triangle].corners;
        let behind = [a, b, c]
            .iter()
            .any(|corner| view.camera_from_world.transform_point3(*corner).z <= 0.0);
        let a_sample = (DVec3::ONE - at_center.0) / SAMPLES_PX.len() as f64;
        let thin_piece = behind && explained(low - a_sample, high + a_sample);
        if !is_edge
            && !explained(low, high)
            && !thin_piece
            && !is_snapped(world, view, center, lights)
        {
            error.wrong += 1;
            let pixel = center.as_uvec2().to_array();
            error.first.get_or_insert((pixel, found, at_center.0));
        }
    }
    error
}
