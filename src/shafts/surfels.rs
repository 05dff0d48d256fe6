//! What a virtual thing reflects on to its surroundings: its surface as a few discs, each with the directions in which the
//! thing itself does not hide it.

use std::f32::consts::PI;
use std::ops::Range;

use glam::Vec3;

use super::bounding::Aabb;
use super::points::points_on;

/// Neighbours in a group.
const GROUP: usize = 8;
/// A group is seen as one disc from so many of its radii.
const SEEN_AS_ONE: f32 = 5.0;

/// Cells along a side of the octahedron's map of all directions.
const CELLS: usize = 8;

/// The middles of the cells of an octahedron's map of all directions (Engelhardt & Dachsbacher 2008), unit vectors.
pub fn cell_directions() -> impl Iterator<Item = Vec3> {
    (0..CELLS * CELLS).map(|cell| {
        let along = |index: usize| (index as f32 + 0.5) / CELLS as f32 * 2.0 - 1.0;
        let (x, y) = (along(cell % CELLS), along(cell / CELLS));
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        Vec3::new(x - fold * x.signum(), y - fold * y.signum(), z).normalize()
    })
}

/// A disc on a thing's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surfel {
    /// Its centre, in the thing's space, metres.
    pub position: Vec3,
    /// Unit length.
    pub normal: Vec3,
    /// Square metres.
    pub area: f32,
    /// Diffuse reflectance.
    pub albedo: Vec3,
}

/// A disc that sends out light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LitSurfel {
    /// In the world.
    pub surfel: Surfel,
    /// A bit for each cell of the octahedron's map of directions in which its thing does not hide it.
    pub open: u64,
    /// Radiance, linear RGB.
    pub radiance: Vec3,
}

/// Irradiance at a place with a unit normal from all surfels that see it.
pub fn reflected_irradiance<'a>(
    place: Vec3,
    normal: Vec3,
    surfels: impl IntoIterator<Item = &'a LitSurfel>,
) -> Vec3 {
    let from_surfel = |lit: &LitSurfel| lit.radiance * lit.irradiance_part(place, normal);
    surfels.into_iter().map(from_surfel).sum()
}

/// The same for a place on the things themselves: the discs that it faces and that face it, as those of a hollow do.
pub fn interreflected_irradiance<'a>(
    place: Vec3,
    normal: Vec3,
    surfels: impl IntoIterator<Item = &'a LitSurfel>,
) -> Vec3 {
    let from_surfel = |lit: &LitSurfel| lit.radiance * from_disc(place, normal, &lit.surfel);
    surfels.into_iter().map(from_surfel).sum()
}

impl LitSurfel {
    /// Irradiance of a place for each unit of its radiance.
    pub fn irradiance_part(&self, place: Vec3, normal: Vec3) -> f32 {
        from_open_disc(place, normal, &self.surfel, self.open)
    }
}

/// Surfels, and discs that stand for groups of neighbours where they are seen from afar.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupedSurfels {
    surfels: Vec<LitSurfel>,
    groups: Vec<Group>,
}

#[derive(Debug, Clone, PartialEq)]
struct Group {
    whole: LitSurfel,
    radius: f32,
}

impl GroupedSurfels {
    /// Groups surfels that lie beside each other in their order.
    pub fn new(surfels: Vec<LitSurfel>) -> Self {
        let groups = surfels.chunks(GROUP).map(Group::new).collect();
        Self { surfels, groups }
    }

    /// All of them.
    pub fn all(&self) -> &[LitSurfel] {
        &self.surfels
    }

    /// What gives all places in a box about the light that all of them give.
    pub fn seen_from(&self, bounds: Aabb) -> impl Iterator<Item = &LitSurfel> {
        let chunks = self.surfels.chunks(GROUP).zip(&self.groups);
        chunks.flat_map(move |(surfels, group)| {
            let middle = group.whole.surfel.position;
            let distance = bounds.distance(&Aabb::around([middle]));
            match distance > SEEN_AS_ONE * group.radius {
                true => std::slice::from_ref(&group.whole),
                false => surfels,
            }
        })
    }
}

/// The mean over discs by their areas.
pub fn mean_by_area<T>(discs: &[T], area: impl Fn(&T) -> f32, of: impl Fn(&T) -> Vec3) -> Vec3 {
    let whole: f32 = discs.iter().map(&area).sum();
    let sum: Vec3 = discs.iter().map(|disc| of(disc) * area(disc)).sum();
    sum / whole.max(f32::MIN_POSITIVE)
}

/// One disc for several, and the radius around its middle that holds them; `surfel` says what disc each is.
pub fn as_one<T>(discs: &[T], surfel: impl Fn(&T) -> &Surfel) -> (Surfel, f32) {
    let mean = |of: &dyn Fn(&Surfel) -> Vec3| {
        mean_by_area(discs, |disc| surfel(disc).area, |disc| of(surfel(disc)))
    };
    let area: f32 = discs.iter().map(|disc| surfel(disc).area).sum();
    let position = mean(&|surfel| surfel.position);
    let normal = mean(&|surfel| surfel.normal);
    let farthest = discs
        .iter()
        .map(|disc| surfel(disc).position.distance(position))
        .fold(0.0, f32::max);
    let whole = Surfel {
        position,
        normal: normal.normalize_or_zero(),
        // Discs that look apart show less of themselves.
        area: area * normal.length(),
        albedo: mean(&|surfel| surfel.albedo),
    };
    let radius = farthest + (area / discs.len().max(1) as f32 / PI).sqrt();
    (whole, radius)
}

impl Group {
    fn new(surfels: &[LitSurfel]) -> Self {
        let (surfel, radius) = as_one(surfels, |lit| &lit.surfel);
        Self {
            whole: LitSurfel {
                surfel,
                open: surfels.iter().fold(0, |open, lit| open | lit.open),
                radiance: mean_by_area(surfels, |lit| lit.surfel.area, |lit| lit.radiance),
            },
            radius,
        }
    }
}

/// [`from_disc`], where the bit of the direction to the place is set.
pub fn from_open_disc(place: Vec3, normal: Vec3, surfel: &Surfel, open: u64) -> f32 {
    let part = from_disc(place, normal, surfel);
    match part > 0.0 && is_open(open, place - surfel.position) {
        true => part,
        false => 0.0,
    }
}

/// About `count` surfels of equal area on triangles (with their albedo), spread over them.
pub fn surfels(triangles: &[([Vec3; 3], Vec3)], count: usize) -> Vec<Surfel> {
    surfels_of_triangles(triangles, count).0
}

/// The same, and for each triangle those that are on it.
pub fn surfels_of_triangles(
    triangles: &[([Vec3; 3], Vec3)],
    count: usize,
) -> (Vec<Surfel>, Vec<Range<usize>>) {
    let area = |[a, b, c]: [Vec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let mut order: Vec<usize> = (0..triangles.len()).collect();
    let center = |index: usize| triangles[index].0.iter().sum::<Vec3>() / 3.0;
    sort_along_a_curve(&mut order, &center);
    let total: f32 = triangles.iter().map(|(corners, _)| area(*corners)).sum();
    let share = total / count.max(1) as f32;
    let mut result = Vec::with_capacity(count);
    let mut on_triangle = vec![0..0; triangles.len()];
    let mut covered = 0.0;
    for index in order {
        let (corners, albedo) = triangles[index];
        let [a, b, c] = corners;
        let before = (covered / share + 0.5).floor();
        covered += area(corners);
        let here = ((covered / share + 0.5).floor() - before) as usize;
        on_triangle[index] = result.len()..result.len() + here;
        result.extend(points_on(corners, here).map(|position| Surfel {
            position,
            normal: (b - a).cross(c - a).normalize_or_zero(),
            area: share,
            albedo,
        }));
    }
    (result, on_triangle)
}

/// Halves again and again along the longest axis: neighbours in the order are neighbours in space.
fn sort_along_a_curve(order: &mut [usize], center: &impl Fn(usize) -> Vec3) {
    if order.len() < 3 {
        return;
    }
    let points = || order.iter().map(|&index| center(index));
    let size = points().fold(Vec3::MIN, Vec3::max) - points().fold(Vec3::MAX, Vec3::min);
    let axis = size.max_position();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&one, &other| {
        center(one)[axis].total_cmp(&center(other)[axis])
    });
    let (low, high) = order.split_at_mut(middle);
    sort_along_a_curve(low, center);
    sort_along_a_curve(high, center);
}

/// Whether the bit of a direction of any length is set.
fn is_open(open: u64, direction: Vec3) -> bool {
    let flat = direction / direction.abs().element_sum().max(1e-20);
    let folded = if direction.z >= 0.0 {
        (flat.x, flat.y)
    } else {
        let sign = |part: f32| if part >= 0.0 { 1.0 } else { -1.0 };
        (
            (1.0 - flat.y.abs()) * sign(direction.x),
            (1.0 - flat.x.abs()) * sign(direction.y),
        )
    };
    let cell = |part: f32| (((part * 0.5 + 0.5) * CELLS as f32) as usize).min(CELLS - 1);
    open >> (cell(folded.1) * CELLS + cell(folded.0)) & 1 == 1
}

/// A bit for each cell of the octahedron's map in whose direction nothing hides a surfel.
pub fn open_directions(surfel: &Surfel, is_hidden: impl Fn(Vec3, Vec3) -> bool) -> u64 {
    let start = surfel.position + surfel.normal * 1e-4;
    let is_open =
        |direction: Vec3| direction.dot(surfel.normal) > 0.0 && !is_hidden(start, direction);
    cell_directions()
        .zip(0..)
        .filter(|(direction, _)| is_open(*direction))
        .fold(0, |bits, (_, bit)| bits | 1 << bit)
}

/// Irradiance at a place from a disc that sends out radiance 1, nothing between them.
pub fn from_disc(place: Vec3, normal: Vec3, surfel: &Surfel) -> f32 {
    let way = surfel.position - place;
    let distance_squared = way.length_squared();
    let direction = way * distance_squared.max(1e-12).sqrt().recip();
    let cosines = normal.dot(direction).max(0.0) * (-surfel.normal.dot(direction)).max(0.0);
    cosines * surfel.area / (distance_squared + surfel.area / PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::harmonics::sphere;
    use std::f32::consts::TAU;

    #[test]
    fn every_direction_has_the_cell_that_is_about_its_own() {
        for (cell, middle) in cell_directions().enumerate() {
            assert!(is_open(1 << cell, middle * 3.0), "{cell}");
            assert!(!is_open(!(1 << cell), middle), "{cell}");
        }
        for direction in sphere(2000).map(|direction| direction.as_vec3()) {
            let cells = cell_directions().enumerate();
            let found = cells.filter(|(cell, _)| is_open(1 << cell, direction));
            let found: Vec<Vec3> = found.map(|(_, middle)| middle).collect();
            // The widest cells lie amid the octahedron's faces: an eighth of an edge each way from their middle, which
            // is 28° there, seen from the octahedron's.
            assert!(
                found.len() == 1 && found[0].dot(direction) > 28_f32.to_radians().cos(),
                "{direction}"
            );
        }
    }

    #[test]
    fn surfels_share_a_things_area_and_send_what_a_ball_sends() {
        // A ball of radius r with radiance 1 gives a facing surface at distance d the irradiance π (r / d)².
        let (rings, radius) = (24, 0.1);
        let at = |ring: usize, step: usize| {
            let (polar, turn) = (ring as f32 / rings as f32 * PI, step as f32 / 48.0 * TAU);
            Vec3::new(
                polar.sin() * turn.cos(),
                polar.sin() * turn.sin(),
                polar.cos(),
            ) * radius
        };
        let quads = (0..rings).flat_map(|ring| (0..48).map(move |step| (ring, step)));
        let triangles: Vec<([Vec3; 3], Vec3)> = quads
            .flat_map(|(ring, step)| {
                let (a, b) = (at(ring, step), at(ring + 1, step));
                let (c, d) = (at(ring + 1, step + 1), at(ring, step + 1));
                [([a, b, c], Vec3::ONE), ([a, c, d], Vec3::ONE)]
            })
            .collect();
        let surfels = surfels(&triangles, 64);
        assert!((60..=68).contains(&surfels.len()), "{}", surfels.len());
        let area: f32 = surfels.iter().map(|surfel| surfel.area).sum();
        assert!(
            (area / (4.0 * PI * radius * radius) - 1.0).abs() < 0.05,
            "{area}"
        );
        for distance in [0.2, 0.5, 2.0] {
            let place = Vec3::new(0.6, 0.0, 0.8) * distance;
            let toward = -place / distance;
            let sum: f32 = surfels
                .iter()
                .map(|surfel| from_disc(place, toward, surfel))
                .sum();
            let expected = PI * (radius / distance).powi(2);
            assert!(
                (sum / expected - 1.0).abs() < 0.08,
                "{distance}: {sum} for {expected}"
            );
        }
    }
}
