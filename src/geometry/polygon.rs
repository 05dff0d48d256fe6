//! Polygons in space, cut into triangles.

use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Twice the area that a fan may have too much, as a part of the polygon's own, before it is no fan.
const FAN_SLACK: f64 = 1e-9;

/// A fan of more corners has a hub where too many slivers meet: what looks for the nearest of them looks at all.
const MOST_OF_A_FAN: usize = 64;

/// Polygons of fewer corners cost nothing, whatever they are.
const FEWEST_LOOKED_AT: usize = 16;

/// What cuts polygons. A fan starts at a corner, so the same polygon twice, or once from each side, could be cut along
/// different diagonals; here copies are cut as the first one was.
#[derive(Default)]
pub struct PolygonCutter {
    /// Where the first polygon with these places began and which way it went on, by a hash of the places.
    first_alike: HashMap<u64, [Place; 2]>,
    earcut: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    cut: Vec<u32>,
}

/// A place, bit by bit.
type Place = [u32; 3];

impl PolygonCutter {
    /// The triangles of a polygon with at least three corners, as indices of its corners, wound as it is. One that is
    /// convex becomes a fan, or is halved again and again where it has many corners; another is cut by its ears (Eberly 2008) in
    /// its plane, whose normal is Newell's.
    pub fn triangles(&mut self, corners: &[Vec3], triangles: &mut Vec<[u32; 3]>) {
        let count = corners.len();
        if count < 3 {
            return;
        }
        if let Some(kept) = once_each(corners) {
            let places: Vec<Vec3> = kept
                .iter()
                .map(|corner| corners[*corner as usize])
                .collect();
            let first = triangles.len();
            self.triangles(&places, triangles);
            for corner in triangles[first..].iter_mut().flatten() {
                *corner = kept[*corner as usize];
            }
            return;
        }
        // A triangle has no diagonal.
        let (start, is_reversed) = match count {
            3 => (0, false),
            _ => self.begin_alike(corners),
        };
        let index = |step: usize| match is_reversed {
            true => (start + count - step % count) % count,
            false => (start + step) % count,
        };
        let ordered: Vec<DVec3> = (0..count)
            .map(|step| corners[index(step)].as_dvec3())
            .collect();
        let mut add = |corners: [usize; 3]| {
            let [a, b, c] = corners.map(|step| index(step) as u32);
            triangles.push(if is_reversed { [a, c, b] } else { [a, b, c] });
        };
        let normal = newell_normal(&ordered);
        if is_fan(&ordered, normal) {
            match count > MOST_OF_A_FAN && is_convex(&ordered, normal) {
                true => halves(count, add),
                false => (1..count - 1).for_each(|step| add([0, step, step + 1])),
            }
            return;
        }
        let normal = normal.normalize_or_zero();
        let (u, v) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend(ordered.iter().map(|corner| {
            let from_first = corner - ordered[0];
            DVec2::new(from_first.dot(u), from_first.dot(v)).to_array()
        }));
        self.earcut
            .earcut_slice(&self.flat, &[] as &[u32], &mut self.cut);
        let at = |step: u32| DVec2::from_array(self.flat[step as usize]);
        for cut in self.cut.chunks_exact(3) {
            let [a, b, c] = [cut[0], cut[1], cut[2]];
            // Ears come clockwise or not, as the polygon lay.
            let is_turned = (at(b) - at(a)).perp_dot(at(c) - at(a)) < 0.0;
            let [b, c] = if is_turned { [c, b] } else { [b, c] };
            add([a, b, c].map(|step| step as usize));
        }
    }

    /// The corner that a polygon's cuts begin at, and whether they go against its own way.
    fn begin_alike(&mut self, corners: &[Vec3]) -> (usize, bool) {
        let places: Vec<Place> = corners.iter().map(place).collect();
        let mut sorted = places.clone();
        sorted.sort_unstable();
        let mut hasher = DefaultHasher::new();
        sorted.hash(&mut hasher);
        let key = hasher.finish();
        let [start, next] = *self
            .first_alike
            .entry(key)
            .or_insert([places[0], places[1]]);
        let start = places.iter().position(|place| *place == start);
        let start = start.unwrap_or(0);
        let count = places.len();
        let is_reversed =
            places[(start + 1) % count] != next && places[(start + count - 1) % count] == next;
        (start, is_reversed)
    }
}

/// A corner's place: adding 0 makes 0 of -0, which is the same.
fn place(corner: &Vec3) -> Place {
    (*corner + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// The first corners at each of a polygon's places, if it has more than twice as many corners as places. A bridge to a hole
/// repeats two corners and brings three, so no polygon has that many; ears of one that has are looked for forever.
fn once_each(corners: &[Vec3]) -> Option<Vec<u32>> {
    if corners.len() < FEWEST_LOOKED_AT {
        return None;
    }
    let mut known: HashSet<Place> = HashSet::new();
    let numbered = corners.iter().enumerate();
    let firsts = numbered.filter(|(_, corner)| known.insert(place(corner)));
    let firsts: Vec<u32> = firsts.map(|(index, _)| index as u32).collect();
    (firsts.len() * 2 < corners.len()).then_some(firsts)
}

/// Twice the area of a polygon, along its normal (Newell's).
fn newell_normal(corners: &[DVec3]) -> DVec3 {
    let origin = corners[0];
    let next = corners.iter().cycle().skip(1);
    let pairs = corners.iter().zip(next);
    pairs
        .map(|(a, b)| (*a - origin).cross(*b - origin))
        .sum::<DVec3>()
}

/// Whether the fan from the first corner covers the polygon just once.
fn is_fan(corners: &[DVec3], normal: DVec3) -> bool {
    let twice_area = normal.length();
    if corners.len() == 3 || twice_area == 0.0 {
        return true;
    }
    let mut sum = 0.0;
    for pair in corners[1..].windows(2) {
        let cross = (pair[0] - corners[0]).cross(pair[1] - corners[0]);
        if cross.dot(normal) < -FAN_SLACK * twice_area * twice_area {
            return false;
        }
        sum += cross.dot(normal) / twice_area;
    }
    // A fan may turn around its corner more than once.
    sum <= twice_area * (1.0 + FAN_SLACK) && turns_once(corners, normal)
}

/// Whether a polygon of which the fan is right turns one way at all corners.
fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let squared = normal.length_squared();
    (0..corners.len()).all(|at| {
        let [a, b, c] = [0, 1, 2].map(|step| corners[(at + step) % corners.len()]);
        (b - a).cross(c - b).dot(normal) >= -FAN_SLACK * squared
    })
}

/// The triangles of a convex polygon of so many corners, at each of which few meet.
fn halves(count: usize, mut add: impl FnMut([usize; 3])) {
    let mut rest = vec![(0, count - 1)];
    while let Some((first, last)) = rest.pop() {
        if last - first > 1 {
            let middle = usize::midpoint(first, last);
            add([first, middle, last]);
            rest.extend([(first, middle), (middle, last)]);
        }
    }
}

/// Whether the directions from the first corner to the others turn by less than a whole turn.
fn turns_once(corners: &[DVec3], normal: DVec3) -> bool {
    let turn_rad: f64 = corners[1..]
        .windows(2)
        .map(|pair| {
            let (a, b) = (pair[0] - corners[0], pair[1] - corners[0]);
            a.cross(b).dot(normal).atan2(a.dot(b) * normal.length())
        })
        .sum();
    turn_rad < std::f64::consts::TAU - 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(corners: &[[f32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let corners: Vec<Vec3> = corners.iter().copied().map(Vec3::from_array).collect();
        let mut triangles = Vec::new();
        PolygonCutter::default().triangles(&corners, &mut triangles);
        (corners, triangles)
    }

    fn areas(corners: &[Vec3], triangles: &[[u32; 3]]) -> (DVec3, f64) {
        let crosses = triangles.iter().map(|corner| {
            let [a, b, c] = corner.map(|index| corners[index as usize].as_dvec3());
            (b - a).cross(c - a) / 2.0
        });
        let crosses: Vec<DVec3> = crosses.collect();
        (
            crosses.iter().sum(),
            crosses.iter().map(|cross| cross.length()).sum(),
        )
    }

    #[test]
    fn concave_polygons_in_any_plane_keep_their_area_and_way() {
        // The letter C, 8 x 8 with a bite of 6 x 4, and a star, each turned and reversed.
        let c = [
            (0., 0.),
            (8., 0.),
            (8., 2.),
            (2., 2.),
            (2., 6.),
            (8., 6.),
            (8., 8.),
            (0., 8.),
        ];
        let star: Vec<(f32, f32)> = (0..10)
            .map(|step| {
                let angle = std::f32::consts::TAU * step as f32 / 10.0;
                let radius = if step % 2 == 0 { 2.0 } else { 0.5 };
                (radius * angle.cos(), radius * angle.sin())
            })
            .collect();
        let star_area = 10.0 * 0.5 * 2.0 * 0.5 * (std::f64::consts::TAU / 10.0).sin();
        for (outline, area) in [(c.to_vec(), 40.0), (star, star_area)] {
            for turn in 0..outline.len() {
                for is_reversed in [false, true] {
                    let mut outline = outline.clone();
                    outline.rotate_left(turn);
                    if is_reversed {
                        outline.reverse();
                    }
                    let corners: Vec<[f32; 3]> =
                        outline.iter().map(|&(x, y)| [x, y, 0.5 * x]).collect();
                    let (corners, triangles) = triangles(&corners);
                    assert_eq!(triangles.len(), corners.len() - 2);
                    let (sum, total) = areas(&corners, &triangles);
                    assert!((sum.z.abs() - area).abs() < 1e-5, "{sum} {area}");
                    assert!((total - sum.length()).abs() < 1e-5, "no overlap");
                    assert_eq!(sum.z < 0.0, is_reversed);
                }
            }
        }
    }

    #[test]
    fn copies_are_cut_along_the_same_diagonals() {
        let mut cutter = PolygonCutter::default();
        let quad = [Vec3::ZERO, Vec3::X, Vec3::new(1., 1., 0.1), Vec3::Y];
        let mut diagonals = Vec::new();
        for turn in 0..4 {
            for is_reversed in [false, true] {
                let mut corners = quad;
                corners.rotate_left(turn);
                if is_reversed {
                    corners.reverse();
                }
                let mut triangles = Vec::new();
                cutter.triangles(&corners, &mut triangles);
                let places = |triangle: &[u32; 3]| triangle.map(|corner| corners[corner as usize]);
                let [first, second] = [places(&triangles[0]), places(&triangles[1])];
                let mut shared: Vec<String> = first
                    .iter()
                    .filter(|corner| second.contains(corner))
                    .map(|corner| corner.to_string())
                    .collect();
                shared.sort();
                diagonals.push(shared);
                let (sum, _) = areas(&corners, &triangles);
                assert_eq!(sum.z < 0.0, is_reversed);
            }
        }
        diagonals.dedup();
        assert_eq!(diagonals.len(), 1);
    }

    /// A fan has one, where all of its slivers meet.
    #[test]
    fn a_round_lid_has_no_hub() {
        let count = 1000;
        let rim: Vec<[f32; 3]> = (0..count)
            .map(|step| {
                let (sine, cosine) = (step as f32 * std::f32::consts::TAU / count as f32).sin_cos();
                [cosine, 0.6 * sine, 0.8 * sine]
            })
            .collect();
        let (corners, triangles) = triangles(&rim);
        assert_eq!(triangles.len(), count - 2);
        let mut meeting = vec![0; count];
        for corner in triangles.iter().flatten() {
            meeting[*corner as usize] += 1;
        }
        assert!(meeting.iter().all(|&meeting| (1..24).contains(&meeting)));
        let (sum, all) = areas(&corners, &triangles);
        let expected = newell_normal(&corners.iter().map(|it| it.as_dvec3()).collect::<Vec<_>>());
        assert!((sum - expected / 2.0).length() < 1e-6 && (all - sum.length()).abs() < 1e-6);
    }

    /// What ears were looked for in for minutes: the corners of a square, again and again.
    #[test]
    fn a_polygon_of_repeated_corners_is_cut_once() {
        let square = [[0., 0., 0.], [2., 0., 0.], [2., 2., 0.], [0., 2., 0.]];
        let (corners, cut) = triangles(&square.repeat(50_000));
        assert_eq!(cut.len(), 2);
        assert!((areas(&corners, &cut).0 - DVec3::Z * 4.0).length() < 1e-9);
        // Two places, or one, have no area; how they are cut matters to nobody.
        assert!(triangles(&square[..2].repeat(100)).1.is_empty());
        // A ring: a bridge leads to the hole and back.
        let circle = |radius: f32, turn: f32| {
            (0..=12).map(move |step| {
                let angle = turn * std::f32::consts::TAU * (step % 12) as f32 / 12.0;
                [radius * angle.cos(), radius * angle.sin(), 0.]
            })
        };
        let ring: Vec<[f32; 3]> = circle(2.0, 1.0).chain(circle(1.0, -1.0)).collect();
        let (corners, cut) = triangles(&ring);
        let area = 12.0 * 0.5 * 3.0 * (std::f64::consts::TAU / 12.0).sin();
        assert!((areas(&corners, &cut).0.z - area).abs() < 1e-5);
    }

    #[test]
    fn odd_polygons_are_no_trouble() {
        // Nothing but a line, a point, a bow tie, a spiral of two turns.
        let line: Vec<[f32; 3]> = (0..5).map(|step| [step as f32, 0., 0.]).collect();
        assert_eq!(triangles(&line).1.len(), 3);
        assert_eq!(triangles(&[[1.; 3]; 6]).1.len(), 4);
        triangles(&[[0., 0., 0.], [1., 1., 0.], [1., 0., 0.], [0., 1., 0.]]);
        let spiral: Vec<[f32; 3]> = (0..40)
            .map(|step| {
                let angle = step as f32 * 0.4;
                [angle * angle.cos(), angle * angle.sin(), 0.]
            })
            .collect();
        triangles(&spiral);
        assert!(triangles(&[[0.; 3], [1.; 3]]).1.is_empty());
    }
}
