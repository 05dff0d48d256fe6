//! How many volumes of a silhouette may lie one in another, so that a narrow counter never wraps.
//!
//! Seen from the light, that number is how often the silhouette winds around a direction: it changes at silhouette edges
//! alone, by one at each.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{Caster, LightPlace, Silhouette};
use crate::geometry::exact_side::exact_side;

/// A direction along which no mesh has a reason to put a vertex.
const SOME_DIRECTION: DVec3 = DVec3::new(
    0.267_261_241_912_424,
    0.534_522_483_824_849,
    0.801_783_725_737_273,
);

impl Caster {
    /// An upper bound of the number of casting triangles between the light and any point, if it is at most `enough`; else a number
    /// above `enough`.
    pub(super) fn most_layers(
        &self,
        light: LightPlace,
        silhouette: &Silhouette,
        enough: u32,
    ) -> u32 {
        let casting = silhouette.casting.len() as u32;
        if self.bounds.is_none() || casting <= enough {
            return casting;
        }
        if let Some(outline) = self.flattened(light, silhouette) {
            // A line in from outside passes as many edges inwards as outwards, or it would not get out again.
            let quick = outline.len() as u32 / 2;
            return match quick <= enough {
                true => quick,
                false => most_windings(&outline, enough),
            };
        }
        let LightPlace::Point(light) = light else {
            return casting;
        };
        let pole = SOME_DIRECTION;
        let at_pole = self.casting_towards(silhouette, light, pole);
        casting.min(at_pole + self.most_around(silhouette, light, pole))
    }

    /// The silhouette as a light from outside sees it, on a plane on which all great circles are straight lines, each edge with
    /// what it bounds on its left. `None` where the light lies in the mesh's box: it has no plane before it.
    fn flattened(&self, light: LightPlace, silhouette: &Silhouette) -> Option<Vec<[DVec2; 2]>> {
        let bounds = self.bounds.as_ref()?;
        let forward = match light {
            LightPlace::Point(light) => {
                (light.clamp(bounds.low, bounds.high) - light).try_normalize()?
            }
            LightPlace::Along(direction) => direction,
        };
        let right = forward.any_orthonormal_vector();
        let up = right.cross(forward);
        let flat = |index: u32| {
            let place = self.positions[index as usize].as_dvec3();
            let (way, depth) = match light {
                LightPlace::Point(light) => (place - light, (place - light).dot(forward)),
                LightPlace::Along(_) => (place - bounds.low, 1.0),
            };
            DVec2::new(way.dot(right), way.dot(up)) / depth
        };
        let edges = silhouette.edges.iter().map(|edge| edge.map(flat));
        let edges: Vec<_> = edges.collect();
        let is_finite = |edge: &[DVec2; 2]| edge.iter().all(|end| end.is_finite());
        edges.iter().all(is_finite).then_some(edges)
    }

    /// An upper bound of how many more casting triangles any direction from the light meets than the pole does.
    ///
    /// A great circle crosses silhouette edges as often inwards as outwards: no direction can have more than half the edges that
    /// a great circle through it and the pole meets, besides what the pole has.
    fn most_around(&self, silhouette: &Silhouette, light: DVec3, pole: DVec3) -> u32 {
        let (first, second) = pole.any_orthonormal_pair();
        let angle = |index: u32| {
            let way = self.positions[index as usize].as_dvec3() - light;
            way.dot(second).atan2(way.dot(first)) / PI
        };
        let spans = silhouette.edges.iter().map(|&[from, to]| {
            // In half turns: a great circle is two opposite meridians. The arc takes the shorter way.
            let from = angle(from);
            let turn = (angle(to) - from + 1.0).rem_euclid(2.0) - 1.0;
            [from + turn.min(0.0), from + turn.max(0.0)]
        });
        most_overlapping(&spans.collect::<Vec<_>>()) / 2
    }

    /// Casting triangles that the ray from the light meets (Möller & Trumbore 1997).
    pub(super) fn casting_towards(
        &self,
        silhouette: &Silhouette,
        light: DVec3,
        direction: DVec3,
    ) -> u32 {
        let meets = |triangle: [u32; 3]| {
            let [a, b, c] = triangle.map(|index| self.positions[index as usize].as_dvec3());
            let (first, second) = (b - a, c - a);
            let across = direction.cross(second);
            let determinant = first.dot(across);
            let u = (light - a).dot(across) / determinant;
            let aside = (light - a).cross(first);
            let v = direction.dot(aside) / determinant;
            u >= 0.0 && v >= 0.0 && u + v <= 1.0 && second.dot(aside) / determinant > 0.0
        };
        let casting = silhouette.casting.iter();
        casting
            .filter(|casting| meets(self.triangles[casting.triangle as usize]))
            .count() as u32
    }
}

/// An upper bound of how often closed outlines wind around any point, either way, if it is at most `enough`; else a number
/// above `enough`.
fn most_windings(outline: &[[DVec2; 2]], enough: u32) -> u32 {
    let ends = || outline.iter().flatten().copied();
    let (low, high) = ends().fold(
        (DVec2::INFINITY, DVec2::NEG_INFINITY),
        |(low, high), end| (low.min(end), high.max(end)),
    );
    // Nothing winds around a point outside.
    let outside = low - (high - low).max(DVec2::splat(f64::MIN_POSITIVE)) * ASIDE;
    let whole = Cell {
        low,
        high,
        within: outline.to_vec(),
        known: (outside, 0),
    };
    whole.most_windings(enough, MOST_CUTS)
}

/// Where a cell is cut, as a part of its size: not in the middle, where outlines of round numbers have vertices.
const ASIDE: DVec2 = DVec2::new(0.496_713_218_7, 0.503_181_574_3);

/// How often a cell may be cut: around a vertex at which more edges meet than may be, none of the smaller ones has fewer.
const MOST_CUTS: u32 = 24;

/// A part of the plane.
struct Cell {
    low: DVec2,
    high: DVec2,
    /// All edges that pass through it, and through the way to it from the known point.
    within: Vec<[DVec2; 2]>,
    /// A point, and how often the outline winds around it.
    known: (DVec2, i64),
}

impl Cell {
    fn most_windings(self, enough: u32, cuts_left: u32) -> u32 {
        let Self {
            low,
            high,
            within,
            known: (from, before),
        } = self;
        let center = low + (high - low) * ASIDE;
        let crossings = within.iter().map(|edge| crossing(*edge, from, center));
        let windings = before + crossings.sum::<i64>();
        let within: Vec<_> = within
            .into_iter()
            .filter(|edge| touches(edge, low, high))
            .collect();
        // A straight way from the center enters what lies beyond an edge on whose right it starts, and leaves it on its left.
        let right_of = |[a, b]: &&[DVec2; 2]| exact_side(*a, *b, center) < 0.0;
        let entered = within.iter().filter(right_of).count() as i64;
        let left = within.len() as i64 - entered;
        let most = (windings + entered).max(left - windings).max(0) as u32;
        if most <= enough || cuts_left == 0 || windings.unsigned_abs() > u64::from(enough) {
            return most;
        }
        let mut most_of_parts = 0;
        for [x, y] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let columns = [low.x, center.x, high.x];
            let rows = [low.y, center.y, high.y];
            let (low, high) = (
                DVec2::new(columns[x], rows[y]),
                DVec2::new(columns[x + 1], rows[y + 1]),
            );
            let part = Self {
                low,
                high,
                // (The way from the center to that of a part lies in the part.)
                within: within
                    .iter()
                    .copied()
                    .filter(|edge| touches(edge, low, high))
                    .collect(),
                known: (center, windings),
            };
            most_of_parts = most_of_parts.max(part.most_windings(enough, cuts_left - 1));
            if most_of_parts > enough {
                break;
            }
        }
        most_of_parts
    }
}

/// 1 where the straight way from one point to another enters what an edge has on its left, -1 where it leaves it; else 0.
fn crossing(edge: [DVec2; 2], from: DVec2, to: DVec2) -> i64 {
    let apart = |one: f64, other: f64| (one < 0.0) != (other < 0.0);
    let [a, b] = edge;
    let [starts, ends] = [from, to].map(|point| exact_side(a, b, point));
    if !apart(starts, ends) {
        return 0;
    }
    let [a, b] = edge.map(|end| exact_side(from, to, end));
    match apart(a, b) {
        true if starts < 0.0 => 1,
        true => -1,
        false => 0,
    }
}

/// Whether an edge may pass through a box or its sides.
fn touches([a, b]: &[DVec2; 2], low: DVec2, high: DVec2) -> bool {
    if a.max(*b).cmplt(low).any() || a.min(*b).cmpgt(high).any() {
        return false;
    }
    // No corner lies on the other side of the line: rounding is given a little more than it takes.
    let along = b - a;
    let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
    let away = along.perp_dot(center - a).abs();
    let reach = along.x.abs() * half.y + along.y.abs() * half.x;
    let size = along.abs().max_element() * (center - a).abs().max_element();
    away <= reach + 1e-14 * size
}

/// An upper bound of how many of the spans share a point, where whole numbers are one and the same.
fn most_overlapping(spans: &[[f64; 2]]) -> u32 {
    let bins = (4 * spans.len()).max(64);
    let mut change = vec![0_i64; bins + 1];
    let mut wrapped = 0;
    for &[low, high] in spans {
        // A bin more on both sides leaves rounding no say.
        let first = (low * bins as f64).floor() as i64 - 1;
        let last = (high * bins as f64).floor() as i64 + 1;
        if last - first >= bins as i64 {
            wrapped += 1;
            continue;
        }
        let first = first.rem_euclid(bins as i64) as usize;
        let last = last.rem_euclid(bins as i64) as usize;
        change[first] += 1;
        change[last + 1] -= 1;
        wrapped += i64::from(first > last);
    }
    let mut overlapping = wrapped;
    let mut most = 0;
    for change in change {
        overlapping += change;
        most = most.max(overlapping);
    }
    most as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlapping_spans_are_bounded_from_above() {
        assert_eq!(most_overlapping(&[]), 0);
        assert_eq!(most_overlapping(&[[0.1, 0.2], [0.5, 0.6], [0.15, 0.55]]), 2);
        // Whole numbers are one and the same.
        assert_eq!(
            most_overlapping(&[[0.9, 1.1], [-0.02, 0.02], [0.4, 0.5]]),
            2
        );
        assert_eq!(most_overlapping(&[[0.0, 1.0], [0.3, 0.4]]), 2);
    }

    /// A polygon of so many corners on a circle, counter-clockwise, or clockwise where there are fewer than none.
    fn circle(center: DVec2, radius: f64, corners: i32) -> Vec<[DVec2; 2]> {
        let corner = |number: i32| {
            let angle = 2.0 * PI * f64::from(number) / f64::from(corners);
            center + radius * DVec2::from_angle(angle)
        };
        let count = corners.abs();
        (0..count)
            .map(|number| [corner(number), corner((number + 1) % count)])
            .collect()
    }

    /// The least that is enough.
    fn bound(outline: &[[DVec2; 2]]) -> u32 {
        let found = (0..).find(|&enough| most_windings(outline, enough) <= enough);
        found.expect("some number is large enough")
    }

    #[test]
    fn windings_are_bounded_closely() {
        let apart: Vec<_> = (0..50)
            .flat_map(|number| circle(DVec2::new(3.0 * f64::from(number), 0.3), 1.0, 40))
            .collect();
        assert!((1..=3).contains(&bound(&apart)), "{}", bound(&apart));
        let nested: Vec<_> = (1..=50)
            .flat_map(|number| circle(DVec2::new(0.4, 0.7), f64::from(number), 40))
            .collect();
        assert!((50..=52).contains(&bound(&nested)), "{}", bound(&nested));
        // What winds the other way takes off again.
        let rings: Vec<_> = (1..=50)
            .flat_map(|number| {
                circle(
                    DVec2::new(0.4, 0.7),
                    f64::from(number),
                    if number % 2 == 0 { 40 } else { -40 },
                )
            })
            .collect();
        assert!((1..=3).contains(&bound(&rings)), "{}", bound(&rings));
        let turned: Vec<_> = nested.iter().map(|&[a, b]| [b, a]).collect();
        assert!((50..=52).contains(&bound(&turned)), "{}", bound(&turned));
    }

    #[test]
    fn windings_are_those_of_triangles_thrown_at_random() {
        let mut random = fastrand::Rng::with_seed(7);
        for count in [3, 30, 300] {
            let mut point = || DVec2::new(random.f64(), random.f64());
            let triangles: Vec<[DVec2; 3]> =
                (0..count).map(|_| [point(), point(), point()]).collect();
            let outline: Vec<_> = triangles
                .iter()
                .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
                .collect();
            let winding = |at: DVec2| {
                let around = triangles.iter().map(|&[a, b, c]| {
                    let sides = [[a, b], [b, c], [c, a]].map(|[a, b]| exact_side(a, b, at));
                    i64::from(sides.iter().all(|side| *side > 0.0))
                        - i64::from(sides.iter().all(|side| *side < 0.0))
                });
                around.sum::<i64>().unsigned_abs() as u32
            };
            let seen = (0..40_000).map(|_| winding(point())).max();
            let (seen, bound) = (seen.unwrap_or(0), bound(&outline));
            assert!(
                bound >= seen && bound <= seen + 3,
                "{count}: {seen} seen, {bound}"
            );
        }
    }
}
