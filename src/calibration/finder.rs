//! Finds a target's inner corners in a picture.
//!
//! Chessboards are OpenCV's to find. ChArUco boards are found by their markers and the corners between them fitted
//! (`corner_fit.rs`), which holds for every release of OpenCV alike: their own ChArUco code moved twice and changed the
//! layout of its boards with 4.6.

use std::collections::BTreeMap;

use glam::DVec2;
use opencv::core::{
    Mat, Point2f, Size, TermCriteria, TermCriteria_COUNT, TermCriteria_EPS, Vector,
};
use opencv::prelude::*;
use opencv::{boxed_ref::BoxedRef, calib3d, imgproc};

use super::corner_fit::{ExpectedCorner, LEAST_CLEAR_PX};
use super::shown_instead::{ShownInstead, mirrored, other_board_in};
use super::{CalibrateError, Target, TargetCorner, TargetMarkers};
use crate::geometry::homography::{best_homography, mapped};
use crate::scene::TrackingSettings;
use crate::tracking::{Detector, TrackingError};

/// Finds one target; built once, used by one thread at a time.
pub struct TargetFinder {
    target: Target,
    /// The detector of a ChArUco board's markers.
    detector: Option<Detector>,
    /// Pictures that show a board of as many rows as this one has columns, and the other way round.
    swapped: u32,
    small: SmallSquares,
    instead: ShownInstead,
    has_found: bool,
}

/// Pictures in which most of a ChArUco board's corners have markers too near for the corner to be told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SmallSquares {
    /// How many there are.
    pub pictures: u32,
    /// The largest squares in them, pixels.
    pub square_px: f64,
    /// What they would have to have for their corners to be told, pixels.
    pub needed_px: f64,
}

/// What a picture shows of a ChArUco board.
#[derive(Default)]
struct BoardView {
    corners: Vec<TargetCorner>,
    /// The squares at corners that markers are too near to: their sides and what these would have to be, pixels.
    small_px: Vec<[f64; 2]>,
}

/// A marker's corners, as printed, in the target's frame and in the picture.
type MarkerPairs = [(DVec2, DVec2); 4];

/// Standard deviation of the blur under which corners are refined, pixels.
const SOFTNESS_PX: f64 = 1.0;
/// How far around a chessboard's corner is looked at, as a part of the way to its neighbours: farther is no better.
const REACH: f64 = 0.4;
/// A layout whose markers are off by less than this part of the other's squares fits better.
const DISTINCT: f64 = 0.5;
/// Fewer markers tell no layout from another.
const FEWEST_MARKERS: usize = 4;
/// A layout fits whose markers are off by less than this on the whole (root mean square), as a part of a square…
const FITS: f64 = 0.1;
/// …and another does not whose markers are off by more.
const DOES_NOT_FIT: f64 = 0.3;
/// A homography from fewer corners is none to trust.
const FEWEST_CORNERS: usize = 6;

impl TargetFinder {
    /// # Errors
    /// A family that no detector knows.
    pub fn new(target: Target) -> Result<Self, CalibrateError> {
        let detector = |markers: &TargetMarkers| {
            let settings = TrackingSettings {
                decimation: 1.0,
                ..TrackingSettings::default()
            };
            Detector::new(&settings, &[markers.family])
        };
        Ok(Self {
            target,
            detector: target.markers.as_ref().map(detector).transpose()?,
            swapped: 0,
            small: SmallSquares::default(),
            instead: ShownInstead::default(),
            has_found: false,
        })
    }

    /// What is looked for.
    pub fn target(&self) -> &Target {
        &self.target
    }

    /// How many of the pictures so far show a ChArUco board whose columns and rows are given the wrong way round.
    pub fn swapped(&self) -> u32 {
        self.swapped
    }

    /// The pictures so far whose squares are too small.
    pub fn small_squares(&self) -> SmallSquares {
        self.small
    }

    /// What the pictures so far show in place of the target.
    pub fn shown_instead(&self) -> &ShownInstead {
        &self.instead
    }

    /// The corners that an 8-bit grey picture (rows from the top, no padding) shows: all of a chessboard's, or those of a
    /// ChArUco board whose markers are seen; none where the target is not found.
    ///
    /// # Errors
    /// Bytes that do not make up the picture's size, or a failure of a library.
    pub fn find(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<TargetCorner>, CalibrateError> {
        let [width, height] = size_px;
        let fits = i32::try_from(width).is_ok() && i32::try_from(height).is_ok();
        if !fits || grey.is_empty() || grey.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(TrackingError::PictureSize {
                bytes: grey.len(),
                size_px,
            }
            .into());
        }
        let picture = Mat::new_rows_cols_with_data(height as i32, width as i32, grey)?;
        let corners = match self.target.markers {
            Some(markers) => self.board_corners(&markers, grey, size_px)?,
            None => self.whole_chessboard(&picture)?,
        };
        if corners.len() < FEWEST_CORNERS {
            return Ok(Vec::new());
        }
        self.has_found = true;
        Ok(corners)
    }

    fn board_corners(
        &mut self,
        markers: &TargetMarkers,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<TargetCorner>, CalibrateError> {
        let Some(detector) = &mut self.detector else {
            return Ok(Vec::new());
        };
        let seen = seen_markers(detector, grey, size_px, markers)?;
        if is_swapped(&self.target, markers, &seen)? {
            self.swapped += 1;
            return Ok(Vec::new());
        }
        let view = charuco_corners(&self.target, markers, &seen, grey, size_px)?;
        self.small.note(&view);
        if seen.len() < FEWEST_MARKERS && self.instead.is_worth_a_look() {
            let seen = seen_markers(detector, &mirrored(grey, size_px), size_px, markers)?;
            let placed = placed_markers(&self.target, markers, &seen)?;
            let is_board = placed.is_some_and(|(_, placed)| placed.len() >= FEWEST_MARKERS);
            self.instead.mirrored += u32::from(is_board);
        }
        Ok(view.corners)
    }

    fn whole_chessboard(
        &mut self,
        picture: &BoxedRef<'_, Mat>,
    ) -> Result<Vec<TargetCorner>, CalibrateError> {
        // To look for a board that is not there takes long: where another one was seen again and again it is looked for first.
        let suspected = self.instead.suspected().filter(|_| !self.has_found);
        if suspected.is_some() && other_board_in(picture, &self.target)? == suspected {
            self.instead.note_board(suspected);
            return Ok(Vec::new());
        }
        let corners = chessboard_corners(&self.target, picture)?;
        let is_open = corners.is_empty() && !self.has_found && suspected.is_none();
        if is_open && self.instead.is_worth_a_look() {
            self.instead
                .note_board(other_board_in(picture, &self.target)?);
        }
        Ok(corners)
    }
}

impl SmallSquares {
    fn note(&mut self, view: &BoardView) {
        if view.small_px.len() <= view.corners.len() {
            return;
        }
        self.pictures += 1;
        let largest = view.small_px.iter().max_by(|a, b| a[0].total_cmp(&b[0]));
        if let Some(&[square_px, needed_px]) = largest.filter(|px| px[0] > self.square_px) {
            (self.square_px, self.needed_px) = (square_px, needed_px);
        }
    }
}

fn chessboard_corners(
    target: &Target,
    picture: &BoxedRef<'_, Mat>,
) -> opencv::Result<Vec<TargetCorner>> {
    let [across, down] = target.corners().map(|corners| corners as i32);
    // Neither the exhaustive search nor the upsampled one is worth several times the time.
    let flags = calib3d::CALIB_CB_NORMALIZE_IMAGE;
    let mut found = Vector::<Point2f>::new();
    let size = Size::new(across, down);
    if !calib3d::find_chessboard_corners_sb(picture, size, &mut found, flags)? {
        return Ok(Vec::new());
    }
    let soft = softened(picture)?;
    let pixels: Vec<DVec2> = found.iter().map(vector).collect();
    let across = across as usize;
    let mut corners = Vec::new();
    for (k, target_m) in target.corners_m().into_iter().enumerate() {
        let (column, row) = (k % across, k / across);
        let neighbours = [
            (column > 0).then(|| k - 1),
            (column + 1 < across).then_some(k + 1),
            (row > 0).then(|| k - across),
            (row + 1 < down as usize).then_some(k + across),
        ];
        let spacing_px = neighbours
            .into_iter()
            .flatten()
            .filter_map(|other| Some(pixels.get(other)?.distance(pixels[k])))
            .fold(f64::INFINITY, f64::min);
        // The finder's own places scatter by a tenth of a pixel, nearly twice as much as saddle points do.
        let refined = saddle_point(&soft, pixels[k], REACH * spacing_px)?;
        corners.push(TargetCorner {
            target_m,
            pixel: refined.unwrap_or(pixels[k]),
        });
    }
    Ok(corners)
}

/// The corners of the markers that are seen once, by id.
fn seen_markers(
    detector: &mut Detector,
    grey: &[u8],
    size_px: [u32; 2],
    markers: &TargetMarkers,
) -> Result<BTreeMap<u32, [DVec2; 4]>, CalibrateError> {
    let mut seen = BTreeMap::new();
    let mut twice = Vec::new();
    for found in detector.detect(grey, size_px)? {
        if found.family == markers.family && seen.insert(found.id, found.corners_px).is_some() {
            twice.push(found.id);
        }
    }
    seen.retain(|id, _| !twice.contains(id));
    Ok(seen)
}

/// The board's inner corners beside markers that are seen.
fn charuco_corners(
    target: &Target,
    markers: &TargetMarkers,
    seen: &BTreeMap<u32, [DVec2; 4]>,
    grey: &[u8],
    size_px: [u32; 2],
) -> opencv::Result<BoardView> {
    let mut view = BoardView::default();
    let Some((_, placed)) = placed_markers(target, markers, seen)? else {
        return Ok(view);
    };
    for target_m in target.corners_m() {
        let mut near: Vec<&MarkerPairs> = placed.iter().collect();
        near.sort_by(|a, b| distance_m(a, target_m).total_cmp(&distance_m(b, target_m)));
        near.truncate(4);
        // The markers at a corner have their middles half a square away each way.
        let touches = near
            .first()
            .is_some_and(|marker| distance_m(marker, target_m) < 0.8 * target.square_m);
        if !touches {
            continue;
        }
        let pairs: Vec<(DVec2, DVec2)> = near.into_iter().flatten().copied().collect();
        let Some(picture_from_target) = best_homography(&pairs) else {
            continue;
        };
        let at = |way: DVec2| mapped(&picture_from_target, target_m + way * target.square_m);
        let corner = ExpectedCorner {
            pixel: at(DVec2::ZERO),
            along_px: [DVec2::X, DVec2::Y].map(|way| (at(way) - at(-way)) / 2.0),
            clear: 0.5 - markers.size_m / target.square_m / 2.0,
        };
        let clear_px = corner.clear_px();
        if clear_px < LEAST_CLEAR_PX {
            let square_px = corner.along_px[0].length().min(corner.along_px[1].length());
            view.small_px
                .push([square_px, square_px * LEAST_CLEAR_PX / clear_px]);
        } else if let Some(pixel) = corner.found(grey, size_px) {
            view.corners.push(TargetCorner { target_m, pixel });
        }
    }
    Ok(view)
}

/// Whether the markers that are seen make up a board with as many rows as this one has columns, and not this one.
fn is_swapped(
    target: &Target,
    markers: &TargetMarkers,
    seen: &BTreeMap<u32, [DVec2; 4]>,
) -> opencv::Result<bool> {
    let swapped = target.swapped();
    if swapped.squares == target.squares {
        return Ok(false);
    }
    let misfit = |target: &Target| -> opencv::Result<Option<f64>> {
        let placed = placed_markers(target, markers, seen)?;
        Ok(placed
            .filter(|(_, placed)| placed.len() >= FEWEST_MARKERS)
            .map(|(misfit, placed)| {
                let side_px = |pairs: &MarkerPairs| pairs[0].1.distance(pairs[1].1);
                let sides_px: f64 = placed.iter().map(side_px).sum();
                let square_px = sides_px / placed.len() as f64 * target.square_m / markers.size_m;
                (misfit / (4 * placed.len()) as f64).sqrt() / square_px
            }))
    };
    Ok(match (misfit(target)?, misfit(&swapped)?) {
        (Some(given), Some(swapped)) => given > DOES_NOT_FIT && swapped < FITS,
        _ => false,
    })
}

/// The markers that are seen, where they lie on the board, and the squared distances that leaves, in pixels; `None` where
/// they make up no board.
///
/// OpenCV before 4.6 began boards with an even number of rows with a white square: the layout that fits is taken.
fn placed_markers(
    target: &Target,
    markers: &TargetMarkers,
    seen: &BTreeMap<u32, [DVec2; 4]>,
) -> opencv::Result<Option<(f64, Vec<MarkerPairs>)>> {
    let mut best: Option<(f64, Vec<MarkerPairs>)> = None;
    for starts_white in [false, true] {
        if starts_white && target.squares[1] % 2 == 1 {
            continue;
        }
        let squares = target.marker_squares(starts_white);
        let placed: Vec<MarkerPairs> = (0..)
            .zip(squares)
            .filter_map(|(id, square)| {
                let corners_px = seen.get(&id)?;
                let corners_m = marker_corners_m(target, markers, square);
                Some(std::array::from_fn(|k| (corners_m[k], corners_px[k])))
            })
            .collect();
        let pairs = placed.concat();
        let Some(picture_from_target) = best_homography(&pairs) else {
            continue;
        };
        let squared = |&(target_m, pixel): &(DVec2, DVec2)| {
            (mapped(&picture_from_target, target_m) - pixel).length_squared()
        };
        let misfit = pairs.iter().map(squared).sum::<f64>();
        // Without its first or last column a board of one layout is one of the other: the corners are the same.
        let fits_better = |(least, _): &(f64, Vec<MarkerPairs>)| misfit < DISTINCT * least;
        if best.as_ref().is_none_or(fits_better) {
            best = Some((misfit, placed));
        }
    }
    Ok(best)
}

/// As printed: top left, top right, bottom right, bottom left.
fn marker_corners_m(target: &Target, markers: &TargetMarkers, square: [u32; 2]) -> [DVec2; 4] {
    let middle_m = (DVec2::new(f64::from(square[0]), f64::from(square[1])) + 0.5) * target.square_m;
    let half_m = markers.size_m / 2.0;
    [
        (-half_m, -half_m),
        (half_m, -half_m),
        (half_m, half_m),
        (-half_m, half_m),
    ]
    .map(|corner| middle_m + DVec2::from(corner))
}

/// From a marker's middle.
fn distance_m(marker: &MarkerPairs, point_m: DVec2) -> f64 {
    let middle_m = (marker[0].0 + marker[2].0) / 2.0;
    middle_m.distance(point_m)
}

/// Differences of neighbouring pixels are slopes only where edges run over some of them.
fn softened(picture: &BoxedRef<'_, Mat>) -> opencv::Result<Mat> {
    let mut soft = Mat::default();
    imgproc::gaussian_blur_def(picture, &mut soft, Size::new(0, 0), SOFTNESS_PX)?;
    Ok(soft)
}

/// Where the black and white squares meet, looked for no farther than `clear_px` from a guess; `None` where it is not.
fn saddle_point(soft: &Mat, guess_px: DVec2, clear_px: f64) -> opencv::Result<Option<DVec2>> {
    const LEAST_PX: f64 = 2.5;
    const MOST_PX: f64 = 12.0;
    // What lies beyond is smeared in.
    let reach_px = (clear_px - 1.5 * SOFTNESS_PX).min(MOST_PX);
    if reach_px.is_nan() || reach_px < LEAST_PX {
        return Ok(None);
    }
    let (width, height) = (f64::from(soft.cols()), f64::from(soft.rows()));
    let room_px = guess_px
        .min(DVec2::new(width, height) - 1.0 - guess_px)
        .min_element();
    if room_px.is_nan() || room_px <= reach_px + 1.0 {
        return Ok(None);
    }
    let window = Size::new(reach_px as i32, reach_px as i32);
    let mut points =
        Vector::<Point2f>::from_slice(&[Point2f::new(guess_px.x as f32, guess_px.y as f32)]);
    let until = TermCriteria::new(TermCriteria_COUNT + TermCriteria_EPS, 60, 1e-4)?;
    imgproc::corner_sub_pix(soft, &mut points, window, Size::new(-1, -1), until)?;
    let found_px = vector(points.get(0)?);
    // Where it runs away OpenCV gives the guess back.
    let moved_px = found_px.distance(guess_px);
    Ok((moved_px > 0.0 && moved_px < reach_px).then_some(found_px))
}

fn vector(point: Point2f) -> DVec2 {
    DVec2::new(f64::from(point.x), f64::from(point.y))
}
