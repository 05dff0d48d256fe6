//! Rendered layers held against the ray cast.

use glam::DVec2;
use gnomon::app::truth::FACES_AWAY;
use gnomon::app::truth::ray_cast::{Exact, GRAZES, View, World};
use gnomon::light::Light;
use gnomon::render::{REAL, REAL_HIDES, VIRTUAL_HIDES};

use super::near_edges::{is_on_edge, is_uniform, places_around};

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
    /// Wrong pixels that no edge passes within the snapping of corners.
    pub unsnapped: usize,
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
    places_around(center).any(differs) || is_on_edge(world, view, center, light)
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
        if differs & (VIRTUAL_HIDES | REAL_HIDES) == 0 {
            continue;
        }
        let [x, y] = [
            index as u32 % exact.size_px[0],
            index as u32 / exact.size_px[0],
        ];
        let center = DVec2::new(f64::from(x), f64::from(y));
        let looks = error.unsnapped < ENOUGH;
        error.unsnapped += usize::from(!looks || !is_on_edge(world, view, center, light));
        if error.far >= ENOUGH || !is_edge(world, view, exact, index, light, exact_bits) {
            error.far += 1;
            error.first_far.get_or_insert([x, y]);
        }
    }
    let percent = |count: usize| 100.0 * count as f64 / error.counted.max(1) as f64;
    error.wrong_pct = percent(wrong);
    error.wrong_real_pct = percent(wrong_real);
    error
}
