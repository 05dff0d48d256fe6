//! What a virtual thing throws back on its surroundings: its surface as a few discs, each with the directions in which the
//! thing itself does not hide it.

use std::f32::consts::PI;

use glam::Vec3;

use crate::geometry::ray_caster::RayCaster;

use super::light_of_room::points_on;

/// Cells along a side of the octahedron's map of all directions; the twin of `CELLS` in shafts.wgsl.
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

/// About `count` surfels of equal area on triangles (with their albedo), spread over them.
pub fn surfels(triangles: &[([Vec3; 3], Vec3)], count: usize) -> Vec<Surfel> {
    let area = |[a, b, c]: [Vec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let mut order: Vec<usize> = (0..triangles.len()).collect();
    let center = |index: usize| triangles[index].0.iter().sum::<Vec3>() / 3.0;
    sort_along_a_curve(&mut order, &center);
    let total: f32 = triangles.iter().map(|(corners, _)| area(*corners)).sum();
    let share = total / count.max(1) as f32;
    let mut result = Vec::with_capacity(count);
    let mut covered = 0.0;
    for index in order {
        let (corners, albedo) = triangles[index];
        let [a, b, c] = corners;
        let before = (covered / share + 0.5).floor();
        covered += area(corners);
        let here = ((covered / share + 0.5).floor() - before) as usize;
        result.extend(points_on(corners, here).map(|position| Surfel {
            position,
            normal: (b - a).cross(c - a).normalize_or_zero(),
            area: share,
            albedo,
        }));
    }
    result
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

/// Whether a thing's triangles hide a direction.
pub fn hides(caster: &RayCaster, start: Vec3, direction: Vec3) -> bool {
    caster.is_hidden(start, direction, f32::INFINITY)
}
