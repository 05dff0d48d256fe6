//! Fewer places to gather light at than a fine mesh has corners, and what its corners get from them: irradiance caching
//! (Ward, Rubinstein & Clear 1988). Light from surroundings varies less than a fine mesh does, and many rays from few places
//! tell more of it than few rays from many, whose noise shows.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::geometry::bounds::Bounds;

/// Records are first as close as this part of all the points' size.
const FIRST_SPACING: f64 = 1.0 / 512.0;
/// Between normals of one record at first, of unit length each.
const FIRST_NORMAL_SPACING: f64 = 0.05;
/// Beyond that (about 30°) normals see other surroundings, however few records there are to be.
const LAST_NORMAL_SPACING: f64 = 0.5;
/// How much farther apart records are where they were too many.
const WIDER: f64 = 1.25;
/// Records count as far as this many spacings, ever less.
const REACH: f64 = 2.0;

/// Places where light is gathered for points of surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct IrradianceRecords {
    /// Some of the points: a place and a unit normal each.
    pub places: Vec<(DVec3, DVec3)>,
    /// For each point the records that it takes its light from, and how much of each; they add up to 1.
    parts: Vec<Vec<(u32, f32)>>,
}

impl IrradianceRecords {
    /// Records for points with unit normals, hardly more than `most`; of as many points or fewer each is its own record.
    pub fn new(points: &[(DVec3, DVec3)], most: usize) -> Self {
        let bounds = Bounds::around(points.iter().map(|(place, _)| *place));
        let Some(bounds) = bounds.filter(|_| points.len() > most) else {
            return Self {
                places: points.to_vec(),
                parts: (0..points.len() as u32)
                    .map(|own| vec![(own, 1.0)])
                    .collect(),
            };
        };
        let size_m = (bounds.high - bounds.low).length().max(f64::MIN_POSITIVE);
        let mut spacing = Spacing {
            low: bounds.low,
            place_m: size_m * FIRST_SPACING,
            normal: FIRST_NORMAL_SPACING,
        };
        let mut records = spacing.records(points);
        while records.len() > most && spacing.place_m < size_m {
            spacing.place_m *= WIDER;
            spacing.normal = (spacing.normal * WIDER).min(LAST_NORMAL_SPACING);
            records = spacing.records(points);
        }
        let places: Vec<(DVec3, DVec3)> = records.into_iter().map(|index| points[index]).collect();
        let parts = spacing.parts(points, &places);
        Self { places, parts }
    }

    /// What each point gets, from what each record gets.
    pub fn at_points(&self, at_records: &[Vec3]) -> Vec<Vec3> {
        let at_point = |parts: &Vec<(u32, f32)>| {
            let parts = parts.iter();
            parts
                .map(|&(record, part)| at_records[record as usize] * part)
                .sum()
        };
        self.parts.iter().map(at_point).collect()
    }
}

/// How far apart records are.
struct Spacing {
    /// No coordinate of a point is less.
    low: DVec3,
    place_m: f64,
    normal: f64,
}

impl Spacing {
    fn cell(&self, place: DVec3) -> [i32; 3] {
        ((place - self.low) / self.place_m)
            .floor()
            .to_array()
            .map(|part| part as i32)
    }

    /// Of each cell of places and normals that has points the one nearest to their middle.
    fn records(&self, points: &[(DVec3, DVec3)]) -> Vec<usize> {
        let mut cells: HashMap<([i32; 3], [i32; 3]), Vec<usize>> = HashMap::new();
        // In the order of the points, so that the same points give the same records.
        let mut order = Vec::new();
        for (index, (place, normal)) in points.iter().enumerate() {
            let facing = (*normal / self.normal).round().to_array();
            let cell = (self.cell(*place), facing.map(|part| part as i32));
            cells
                .entry(cell)
                .or_insert_with(|| {
                    order.push(cell);
                    Vec::new()
                })
                .push(index);
        }
        let middle_one = |cell: &([i32; 3], [i32; 3])| {
            let members = &cells[cell];
            let sum: DVec3 = members.iter().map(|&index| points[index].0).sum();
            let middle = sum / members.len() as f64;
            let away = |index: &usize| points[*index].0.distance_squared(middle);
            let nearest = members.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            nearest.copied()
        };
        order.iter().filter_map(middle_one).collect()
    }

    /// For each point the records within reach, the nearer the more.
    fn parts(&self, points: &[(DVec3, DVec3)], records: &[(DVec3, DVec3)]) -> Vec<Vec<(u32, f32)>> {
        let mut by_cell: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
        for (record, (place, _)) in records.iter().enumerate() {
            by_cell
                .entry(self.cell(*place))
                .or_default()
                .push(record as u32);
        }
        let steps = REACH.ceil() as i32;
        let away = |(place, normal): (DVec3, DVec3), record: u32| {
            let (other, facing) = records[record as usize];
            let along = (place - other) / self.place_m;
            let turned = (normal - facing) / self.normal;
            (along.length_squared() + turned.length_squared()).sqrt()
        };
        let of_point = |&point: &(DVec3, DVec3)| {
            let [x, y, z] = self.cell(point.0);
            let mut near: Vec<(u32, f64)> = Vec::new();
            for (dx, dy) in (-steps..=steps).flat_map(|dx| (-steps..=steps).map(move |dy| (dx, dy)))
            {
                for dz in -steps..=steps {
                    let found = by_cell.get(&[x + dx, y + dy, z + dz]);
                    near.extend(found.into_iter().flatten().map(|&it| (it, away(point, it))));
                }
            }
            let weight = |away: f64| (1.0 - away / REACH).max(0.0).powi(2);
            let sum: f64 = near.iter().map(|(_, away)| weight(*away)).sum();
            if sum > 0.0 {
                let parts = near.into_iter().filter(|(_, away)| *away < REACH);
                return parts
                    .map(|(it, away)| (it, (weight(away) / sum) as f32))
                    .collect();
            }
            // A cell's corner may be farther from its own record: that alone has to do.
            let nearest = near.into_iter().min_by(|(_, a), (_, b)| a.total_cmp(b));
            nearest.map(|(it, _)| (it, 1.0)).into_iter().collect()
        };
        points.iter().map(of_point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A wall of a cylinder of radius 1, as fine as `sides` and `rows` say.
    fn wall(sides: u32, rows: u32) -> Vec<(DVec3, DVec3)> {
        let row = |row: u32| {
            (0..sides).map(move |side| {
                let (sine, cosine) = (TAU * f64::from(side) / f64::from(sides)).sin_cos();
                let normal = DVec3::new(cosine, sine, 0.0);
                (normal + DVec3::Z * f64::from(row) / f64::from(rows), normal)
            })
        };
        (0..=rows).flat_map(row).collect()
    }

    #[test]
    fn few_points_are_their_own_records() {
        let points = wall(12, 4);
        let records = IrradianceRecords::new(&points, points.len());
        assert_eq!(records.places, points);
        let light: Vec<Vec3> = (0..points.len()).map(|it| Vec3::splat(it as f32)).collect();
        assert_eq!(records.at_points(&light), light);
    }

    #[test]
    fn what_is_even_stays_even_and_what_varies_slowly_stays_where_it_is() {
        let points = wall(200, 40);
        for most in [300, 1000] {
            let records = IrradianceRecords::new(&points, most);
            let count = records.places.len();
            assert!(count <= most && count > most / 8, "{count} of {most}");
            let even = records.at_points(&vec![Vec3::splat(0.7); count]);
            assert!(
                even.iter()
                    .all(|light| light.distance(Vec3::splat(0.7)) < 1e-5)
            );
            // Light from one side, and less of it below.
            let light = |(place, normal): &(DVec3, DVec3)| 1.0 + normal.x * 0.5 + place.z * 0.5;
            let gathered = records
                .places
                .iter()
                .map(|it| Vec3::splat(light(it) as f32));
            let found = records.at_points(&gathered.collect::<Vec<_>>());
            for (point, found) in points.iter().zip(&found) {
                let expected = light(point) as f32;
                let off = (found.x - expected).abs();
                assert!(off < 0.12, "{point:?}: {found} {expected}");
            }
            let steps = found
                .windows(2)
                .enumerate()
                .filter(|(index, _)| index % 200 != 199);
            let steepest = steps.map(|(_, pair)| pair[0].distance(pair[1]));
            let steepest = steepest.fold(0.0, f32::max);
            assert!(steepest < 0.1, "{steepest}: no steps");
        }
    }

    #[test]
    fn two_sides_of_a_thin_wall_have_nothing_in_common() {
        let outside = wall(200, 40);
        let inside = outside
            .iter()
            .map(|&(place, normal)| (place - 0.01 * normal, -normal));
        let points: Vec<(DVec3, DVec3)> = outside.iter().copied().chain(inside).collect();
        let records = IrradianceRecords::new(&points, 500);
        let outward = |(place, normal): &(DVec3, DVec3)| place.with_z(0.0).dot(*normal) > 0.0;
        let dark_inside = |it| if outward(it) { Vec3::ONE } else { Vec3::ZERO };
        let gathered: Vec<Vec3> = records.places.iter().map(dark_inside).collect();
        for (point, found) in points.iter().zip(records.at_points(&gathered)) {
            assert!(found.distance(dark_inside(point)) < 1e-5);
        }
    }
}
