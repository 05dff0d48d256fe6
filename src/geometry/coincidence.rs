//! Where things are exactly in one place: surfaces that lie in one another, and points on a surface.

use glam::DVec3;

use super::bounds::Bounds;

/// How triangles of two surfaces lie in one plane and overlap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Coincidence {
    /// Some face the same way.
    pub alike: bool,
    /// Some are turned to each other.
    pub opposed: bool,
}

/// Whether triangles of two meshes overlap in one plane, to `within_m` metres; both in one space.
pub fn coincidence(one: &[[DVec3; 3]], other: &[[DVec3; 3]], within_m: f64) -> Coincidence {
    let mut found = Coincidence::default();
    let grown = |triangle: &[DVec3; 3]| Some(Bounds::around(*triangle)?.grown(within_m));
    let mut sorted: Vec<(Bounds, &[DVec3; 3])> = other
        .iter()
        .filter_map(|triangle| Some((grown(triangle)?, triangle)))
        .collect();
    sorted.sort_by(|(a, _), (b, _)| a.low.x.total_cmp(&b.low.x));
    for triangle in one {
        let (Some(bounds), Some(normal)) = (grown(triangle), unit_normal(triangle)) else {
            continue;
        };
        let reached = sorted.partition_point(|(around, _)| around.low.x <= bounds.high.x);
        for (around, facing) in &sorted[..reached] {
            let near = !around.is_apart_from(&bounds);
            let Some(other_normal) = near.then(|| unit_normal(facing)).flatten() else {
                continue;
            };
            let off_m = |point: &DVec3| normal.dot(*point - triangle[0]).abs();
            let in_plane = facing.iter().all(|corner| off_m(corner) <= within_m);
            if in_plane && overlap(triangle, facing, normal, within_m) {
                match normal.dot(other_normal) > 0.0 {
                    true => found.alike = true,
                    false => found.opposed = true,
                }
            }
        }
        if found.alike && found.opposed {
            break;
        }
    }
    found
}

/// Whether two meshes may have a place in common where each has a surface, to `within_m` metres; both in one space. `true`
/// too where there are too many triangles near each other to look at all pairs.
pub fn may_coincide(one: &[[DVec3; 3]], other: &[[DVec3; 3]], within_m: f64) -> bool {
    let around = |triangles: &[[DVec3; 3]]| Bounds::around(triangles.iter().flatten().copied());
    let (Some(around_one), Some(around_other)) = (around(one), around(other)) else {
        return false;
    };
    let near = |triangles: &[[DVec3; 3]], bounds: &Bounds| -> Vec<[DVec3; 3]> {
        let bounds = bounds.grown(within_m);
        let reaches = |triangle: &&[DVec3; 3]| {
            Bounds::around(**triangle).is_some_and(|triangle| !triangle.is_apart_from(&bounds))
        };
        triangles.iter().filter(reaches).copied().collect()
    };
    let (one, other) = (near(one, &around_other), near(other, &around_one));
    one.len() * other.len() > MOST_PAIRS
        || coincidence(&one, &other, within_m) != Coincidence::default()
}

/// Pairs of triangles that are looked at in some milliseconds.
const MOST_PAIRS: usize = 4_000_000;

/// Whether a point lies on some of the triangles, to `within_m` metres.
pub fn is_on_surface(
    point: DVec3,
    triangles: impl IntoIterator<Item = [DVec3; 3]>,
    within_m: f64,
) -> bool {
    triangles.into_iter().any(|triangle| {
        let Some(normal) = unit_normal(&triangle) else {
            return false;
        };
        let [a, b, c] = triangle;
        let inside = |from: DVec3, to: DVec3| {
            let inward = normal.cross(to - from).normalize_or_zero();
            inward.dot(point - from) >= -within_m
        };
        normal.dot(point - a).abs() <= within_m && inside(a, b) && inside(b, c) && inside(c, a)
    })
}

fn unit_normal([a, b, c]: &[DVec3; 3]) -> Option<DVec3> {
    (b - a).cross(c - a).try_normalize()
}

/// Whether two triangles of one plane share more than `margin_m` of it: no side of either has all of the other beyond it
/// (separating axes).
fn overlap(one: &[DVec3; 3], other: &[DVec3; 3], normal: DVec3, margin_m: f64) -> bool {
    let separates = |edges: &[DVec3; 3], far: &[DVec3; 3]| {
        (0..3).any(|side| {
            let (from, to) = (edges[side], edges[(side + 1) % 3]);
            let across = normal.cross(to - from).normalize_or_zero();
            // The third corner tells which side is the inner one.
            let inward = across * across.dot(edges[(side + 2) % 3] - from).signum();
            far.iter()
                .all(|corner| inward.dot(*corner - from) <= margin_m)
        })
    };
    !separates(one, other) && !separates(other, one)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(low: DVec3, side_m: f64) -> [[DVec3; 3]; 2] {
        let (x, y) = (DVec3::X * side_m, DVec3::Y * side_m);
        [[low, low + x, low + x + y], [low, low + x + y, low + y]]
    }

    #[test]
    fn a_sheet_in_the_table_is_found_and_one_above_or_beside_it_is_not() {
        let table = square(DVec3::new(-0.5, -0.5, 0.0), 1.0);
        let at = |place: DVec3| coincidence(&square(place, 0.1), &table, 1e-5);
        assert!(at(DVec3::new(0.1, 0.2, 0.0)).alike);
        assert!(at(DVec3::new(0.1, 0.2, 9e-6)).alike);
        assert_eq!(at(DVec3::new(0.1, 0.2, 2e-5)), Coincidence::default());
        assert_eq!(at(DVec3::new(0.7, 0.2, 0.0)), Coincidence::default());
        // Edge to edge is no overlap.
        assert_eq!(at(DVec3::new(0.5, 0.2, 0.0)), Coincidence::default());
        let turned = square(DVec3::ZERO, 0.1).map(|[a, b, c]| [a, c, b]);
        let found = coincidence(&turned, &table, 1e-5);
        assert!(found.opposed && !found.alike);
    }

    #[test]
    fn a_point_on_a_face_an_edge_or_a_corner_is_on_the_surface() {
        let triangles = square(DVec3::ZERO, 1.0);
        let is_on = |point: DVec3| is_on_surface(point, triangles, 1e-6);
        assert!(is_on(DVec3::new(0.3, 0.6, 0.0)) && is_on(DVec3::new(0.5, 0.0, 0.0)));
        assert!(is_on(DVec3::ONE.with_z(0.0)) && is_on(DVec3::new(0.3, 0.6, 5e-7)));
        assert!(!is_on(DVec3::new(0.3, 0.6, 1e-5)) && !is_on(DVec3::new(1.1, 0.5, 0.0)));
    }
}
