//! A marker found again where a prediction puts it, by its code alone and without a detector.
//!
//! Every edge of the template says which of two neighbouring cells is the lighter one, whatever light or shadow lies on
//! the marker. The shift of the prediction under which they say so most clearly is where the marker is; when hardly one
//! objects it *is* that marker, since a picture of anything else obeys about half of them.

use glam::{DAffine3, DVec2, DVec3};

use super::light::Grey;
use super::marker_template::MarkerTemplate;
use super::pixel_pose::pixel_of;
use crate::geometry::camera::Intrinsics;

/// The part of all differences of light that must have the right sign, less those that have the wrong one.
const AGREEMENT: f32 = 0.75;
/// Edges whose two cells must be in the picture for all shifts.
const FEWEST_PAIRS: usize = 20;
/// The mean difference of light between the two cells of an edge, grey levels; less is a blank wall.
const LEAST_DIFFERENCE: f32 = 3.0;
/// A cell smaller than this in the picture is not told from its neighbours, pixels.
const SMALLEST_CELL_PX: f64 = 1.2;

/// How far a marker may have moved from where it is predicted, in cells, and how fine the steps are, per cell.
pub(super) struct Reach {
    pub cells: f64,
    pub steps_per_cell: f64,
}

/// Between frames of a hand that moves as before, and of one that jerks.
pub(super) const REACHES: [Reach; 2] = [
    Reach {
        cells: 1.0,
        steps_per_cell: 4.0,
    },
    Reach {
        cells: 6.0,
        steps_per_cell: 3.0,
    },
];

/// How far the marker lies from where `pose` puts it, pixels. `None` when it is not within reach.
pub(super) fn find_shift(
    picture: Grey<'_>,
    intrinsics: &Intrinsics,
    template: &MarkerTemplate,
    pose: &DAffine3,
    reach: &Reach,
) -> Option<DVec2> {
    let place = |point_m: DVec3| pixel_of(intrinsics, pose, point_m);
    let corners = template.corners_m().map(place);
    let [Some(a), Some(b), Some(c), Some(d)] = corners else {
        return None;
    };
    // Half of the cross product of the diagonals, positive where the front is seen.
    let area = 0.5 * (c - a).perp_dot(d - b);
    let cell_px = area.max(0.0).sqrt() / f64::from(template.side);
    if cell_px < SMALLEST_CELL_PX {
        return None;
    }
    let stride = (cell_px / reach.steps_per_cell).round().max(1.0) as i32;
    let steps = (reach.cells * cell_px / f64::from(stride)).ceil() as i32;
    let margin = f64::from(steps * stride);

    // The darker and the lighter cell of each edge, as indices into the picture.
    let [width, height] = picture.size_px.map(f64::from);
    let (low, high) = (
        DVec2::splat(margin),
        DVec2::new(width - 1.0, height - 1.0) - margin,
    );
    let row = picture.size_px[0] as i32;
    let index = |point_m: DVec3| {
        let pixel = place(point_m)?.round();
        let inside = pixel.cmpge(low).all() && pixel.cmple(high).all();
        inside.then(|| pixel.y as i32 * row + pixel.x as i32)
    };
    let pairs: Vec<[i32; 2]> = template
        .edges
        .iter()
        .filter_map(|edge| {
            let half = 0.5 * edge.across_m;
            let pair = [index(edge.point_m - half)?, index(edge.point_m + half)?];
            Some(if edge.brightens {
                pair
            } else {
                [pair[1], pair[0]]
            })
        })
        .collect();
    if pairs.len() < FEWEST_PAIRS {
        return None;
    }

    let differences = |x: i32, y: i32| {
        let shift = y * row + x;
        let level = |index: i32| i32::from(picture.levels[(index + shift) as usize]);
        pairs.iter().fold((0, 0), |(sum, most), pair| {
            let difference = level(pair[1]) - level(pair[0]);
            (sum + difference, most + difference.abs())
        })
    };
    let shifts =
        (-steps..=steps).flat_map(|y| (-steps..=steps).map(move |x| (x * stride, y * stride)));
    let sums: Vec<((i32, i32), (i32, i32))> =
        shifts.map(|(x, y)| ((x, y), differences(x, y))).collect();
    let &(_, (best, all)) = sums.iter().max_by_key(|(_, (sum, _))| *sum)?;
    let clear = best as f32 >= AGREEMENT * all as f32
        && best as f32 >= LEAST_DIFFERENCE * pairs.len() as f32;
    if !clear {
        return None;
    }
    // About a cell is as good as its middle: the middle of all shifts that are nearly as good.
    let good = sums.iter().filter(|(_, (sum, _))| 10 * sum >= 9 * best);
    let (total, count) = good.fold((DVec2::ZERO, 0.0), |(total, count), ((x, y), _)| {
        (
            total + DVec2::new(f64::from(*x), f64::from(*y)),
            count + 1.0,
        )
    });
    Some(total / count)
}
