//! A marker read again: whether the whole picture of it is there, each cell and what lies between them.
//!
//! A detector asks for a dark frame and for the middles of the cells. A picture on a wall, a window or another family's
//! marker has both now and then, and where a family has few bits or many markers, a code of it as well. The whole of a
//! marker's picture is hard to come by: between its cells there is nothing, and within them it is even.
//!
//! What is compared are the differences between places one cell apart, since light and shadow across a marker change
//! them little.

use glam::{DVec2, DVec3};

use super::expected_picture::{ExpectedPicture, PER_CELL};
use super::light::Grey;
use super::marker_template::MarkerTemplate;
use super::printed_marker::PrintedMarker;
use super::{Detection, TrackingError};
use crate::geometry::homography::linear_homography;
use crate::scene::{Family, Ink, Marker};

/// A cell of more pixels is looked at in more than one place for each sample.
const SAMPLE_PX: f64 = 2.0;
/// The most places a side for each sample.
const MOST_PLACES: i32 = 3;

/// The least agreement with which a marker is followed.
pub(super) fn least_to_follow(family: Family) -> f64 {
    match family.false_rate(family.correctable_bits().min(1)) {
        rate if rate < 1e-5 => 0.15,
        rate if rate < 1e-3 => 0.25,
        _ => 0.4,
    }
}

/// By how much the picture is the marker's where its corners were seen: 1 where all differences are as they should be
/// but for one factor, 0 where they have nothing to do with them. `None` where it is not wholly in the picture.
pub(super) fn agreement_at_corners(
    picture: Grey<'_>,
    template: &MarkerTemplate,
    corners_px: [DVec2; 4],
) -> Option<f64> {
    agreement(
        picture,
        template,
        place_by_corners(f64::from(template.side), corners_px)?,
    )
}

/// The same of a marker of any family.
///
/// # Errors
/// A marker that its family does not have.
pub(super) fn agreement_of(
    picture: Grey<'_>,
    detection: &Detection,
) -> Result<Option<f64>, TrackingError> {
    let Detection { family, id, .. } = *detection;
    let printed = PrintedMarker::of(family, id)?;
    let template = MarkerTemplate::new(&Marker::alone(family, id, 1.0), printed);
    Ok(agreement_at_corners(
        picture,
        &template,
        detection.corners_px,
    ))
}

/// Where a point in cells from the top left corner of a square of `side` cells is, pixels.
fn place_by_corners(side: f64, corners_px: [DVec2; 4]) -> Option<impl Fn(DVec2) -> Option<DVec2>> {
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(DVec2::from);
    let pairs: Vec<(DVec2, DVec2)> = corners.into_iter().zip(corners_px).collect();
    let homography = linear_homography(&pairs)?;
    Some(move |cells: DVec2| {
        let DVec3 { x, y, z } = homography * (cells / side).extend(1.0);
        Some(DVec2::new(x, y) / z)
    })
}

/// Whether a marker's black border ends where its corners were found: along at least two of its sides, a quarter of a cell
/// outside is lighter than as much inside. Within a wider border of the same code a detector (OpenCV 4.10) finds the
/// narrower one as well, where it is black on both sides. What leaves the picture counts as ending there.
pub(super) fn border_ends(picture: Grey<'_>, side: u32, corners_px: [DVec2; 4]) -> bool {
    /// Of the difference between the lightest and the darkest of what is looked at.
    const LEAST: f32 = 0.1;
    const BESIDE_CELLS: f64 = 0.25;
    let side = f64::from(side);
    let Some(place) = place_by_corners(side, corners_px) else {
        return true;
    };
    let level = |along: f64, up: f64, quarter: usize| {
        let mut point = DVec2::new(along - side / 2.0, up - side / 2.0);
        for _ in 0..quarter {
            point = point.perp();
        }
        picture.level(place(point + side / 2.0)?)
    };
    let (mut lightest, mut darkest) = (f32::MIN, f32::MAX);
    let mut differences: Vec<f32> = Vec::with_capacity(4);
    for quarter in 0..4 {
        let (mut sum, mut count) = (0.0, 0.0);
        for step in 0..side as usize {
            let along = step as f64 + 0.5;
            let outside = level(along, -BESIDE_CELLS, quarter);
            let inside = level(along, BESIDE_CELLS, quarter);
            let within = level(along, side / 2.0, quarter);
            for seen in [outside, inside, within].into_iter().flatten() {
                lightest = lightest.max(seen);
                darkest = darkest.min(seen);
            }
            if let (Some(outside), Some(inside)) = (outside, inside) {
                sum += outside - inside;
                count += 1.0;
            }
        }
        differences.push(if count > 0.0 { sum / count } else { f32::MAX });
    }
    let least = LEAST * (lightest - darkest);
    let ending = differences.iter().filter(|&&difference| difference > least);
    ending.count() >= 2
}

/// Whether a border of several cells is as wide as its family's: the rings of cells after the first are of its ink too. With a
/// bit or two corrected, a code within one cell is read as one within two. What leaves the picture counts as there.
pub(super) fn has_whole_border(picture: Grey<'_>, family: Family, corners_px: [DVec2; 4]) -> bool {
    /// Of the way from the outer ring's level to that of the code's other ink.
    const MOST: f32 = 0.25;
    let side = f64::from(family.cells_across());
    let Some(place) = place_by_corners(side, corners_px) else {
        return true;
    };
    let levels = |ring: u32| {
        let (first, last) = (f64::from(ring) + 0.5, side - f64::from(ring) - 0.5);
        let along = (0..=(last - first) as u32).map(move |step| first + f64::from(step));
        let cells = along.flat_map(move |at| [(at, first), (at, last), (first, at), (last, at)]);
        let levels = cells.filter_map(|cell| picture.level(place(DVec2::from(cell))?));
        match family.ink() {
            Ink::BlackOnWhite => levels.collect(),
            Ink::WhiteOnBlack => levels.map(|level| -level).collect::<Vec<f32>>(),
        }
    };
    let mean = |levels: &[f32]| levels.iter().sum::<f32>() / levels.len() as f32;
    let outer = mean(&levels(0));
    let within = (1..family.cells_across() / 2).flat_map(levels);
    let other_ink = within.fold(outer, f32::max);
    (1..family.border_cells()).all(|ring| {
        let seen = mean(&levels(ring)) - outer;
        seen.is_nan() || seen <= MOST * (other_ink - outer)
    })
}

/// The agreement of [`agreement_at_corners`], where `place` puts a point in cells from the square's top left corner, pixels.
pub(super) fn agreement(
    picture: Grey<'_>,
    template: &MarkerTemplate,
    place: impl Fn(DVec2) -> Option<DVec2>,
) -> Option<f64> {
    let expected = template
        .expected
        .get_or_init(|| ExpectedPicture::of(&template.printed));
    let side = f64::from(template.side);
    let (middle, beside) = (
        DVec2::splat(side / 2.0),
        DVec2::new(side / 2.0 + 1.0, side / 2.0),
    );
    let cell_px = place(middle)?.distance(place(beside)?);
    let places = ((cell_px / (f64::from(PER_CELL) * SAMPLE_PX)) as i32).clamp(1, MOST_PLACES);
    let mut samples = Vec::with_capacity((expected.across * expected.across) as usize);
    for (x, y) in (0..expected.across).flat_map(|y| (0..expected.across).map(move |x| (x, y))) {
        let corner = DVec2::new(f64::from(x + expected.first), f64::from(y + expected.first));
        let mut sum = 0.0;
        for place_of_sample in 0..places * places {
            let within = DVec2::new(
                f64::from(place_of_sample % places) + 0.5,
                f64::from(place_of_sample / places) + 0.5,
            ) / f64::from(places);
            sum += picture.level(place((corner + within) / f64::from(PER_CELL))?)?;
        }
        samples.push(sum / f64::from(places * places) as f32);
    }
    let seen: Vec<f32> = expected
        .pairs
        .iter()
        .map(|pair| samples[pair[1] as usize] - samples[pair[0] as usize])
        .collect();
    let all: f32 = seen.iter().map(|seen| seen * seen).sum();
    let of_blur = |differences: &Vec<f32>| {
        let (mut common, mut own) = (0.0, 0.0);
        for (seen, expected) in seen.iter().zip(differences) {
            common += seen * expected;
            own += expected * expected;
        }
        match common > 0.0 && all > 0.0 {
            true => f64::from(common * common / (all * own)),
            false => 0.0,
        }
    };
    Some(expected.differences.iter().map(of_blur).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_border_ends_where_paper_begins() {
        // A black square from 20 to 80 with a white middle from 40 to 60, at 10 pixels a cell.
        let is_black = |x: usize, y: usize| {
            let within = |low, high| (low..high).contains(&x) && (low..high).contains(&y);
            within(20, 80) && !within(40, 60)
        };
        let level = |index: usize| {
            if is_black(index % 100, index / 100) {
                20
            } else {
                200
            }
        };
        let levels: Vec<u8> = (0..100 * 100).map(level).collect();
        let picture = Grey {
            levels: &levels,
            size_px: [100, 100],
        };
        let square = |low: f64, high: f64| {
            let (low, high) = (low - 0.5, high - 0.5);
            [(low, low), (high, low), (high, high), (low, high)].map(DVec2::from)
        };
        assert!(border_ends(picture, 6, square(20.0, 80.0)));
        assert!(!border_ends(picture, 4, square(30.0, 70.0)));
        // Half out of the picture.
        assert!(border_ends(picture, 6, square(70.0, 130.0)));
    }
}
