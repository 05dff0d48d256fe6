//! A camera's calibration from views of a chessboard: found view by view, chosen by what they add, solved by OpenCV.

use glam::DVec2;
use opencv::calib3d;
use opencv::core::{
    Mat, Point2f, Point3f, Size, TermCriteria, TermCriteria_COUNT, TermCriteria_EPS, Vector,
};
use opencv::imgproc;
use opencv::prelude::*;

use crate::geometry::camera::Intrinsics;

/// Views that differ less from one that is kept add nothing: mean distance of their corners, as a part of the picture's
/// width.
const NEW_VIEW: f64 = 0.04;
/// More views make no better calibration, only a slower one; the nearest ones then make room.
const MOST_VIEWS: usize = 40;
/// Fewer cannot tell a camera from its views.
pub const FEWEST_VIEWS: usize = 3;
/// A view is left out whose error is so many times the median's,
const MISFIT: f64 = 3.0;
/// and larger than this, pixels.
const MISFIT_PX: f64 = 0.5;
/// A focal length that is less certain than this, as a part of it, is none.
const MOST_DEVIATION: f64 = 0.05;
/// Views that are tilted by less than this, radians, do not tell the focal length from the distance.
const LEAST_TILT: f64 = 0.14;
/// The picture is looked at in so many columns and rows of cells.
pub const CELLS: [usize; 2] = [8, 6];
/// A third radial coefficient is worth having when it is so many times its standard deviation,
const SIGNIFICANT: f64 = 3.0;
/// and corners reach so far out, as a part of the way to the picture's corner: beyond them it runs wild.
const REACH: f64 = 0.8;

/// A chessboard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chessboard {
    /// Inner corners in a row and in a column.
    pub corners: [u32; 2],
    /// Side of a square, metres.
    pub square_m: f64,
}

/// A view of the chessboard.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Index of its frame.
    pub frame: u32,
    /// Corners row by row, distorted pixels.
    pub corners_px: Vec<DVec2>,
}

/// What a picture was worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// The chessboard is not in it, or not whole.
    Nothing,
    /// It is, but much as in a view that is kept already.
    Known,
    /// It is, and the view is kept.
    New,
}

/// Gathers views one by one, from a recording or before a camera.
pub struct Gathering {
    board: Chessboard,
    size_px: [u32; 2],
    views: Vec<View>,
}

/// A calibration and how far it can be trusted.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// Standard deviations of the focal lengths, pixels.
    pub focal_deviation_px: DVec2,
    /// Standard deviations of the principal point, pixels.
    pub center_deviation_px: DVec2,
    /// Root mean square distance of all corners from where the calibration puts them, pixels.
    pub rms_px: f64,
    /// The views that it rests on, each with its own root mean square distance, pixels.
    pub views: Vec<(View, f64)>,
    /// The frames of views that did not fit the others, with their distances.
    pub dropped: Vec<(u32, f64)>,
    /// The largest angle between the chessboard and the picture, radians.
    pub largest_tilt: f64,
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum CalibratingError {
    /// Too few views.
    #[error(
        "{found} views of the chessboard; at least {FEWEST_VIEWS} that differ are needed, a dozen are good"
    )]
    TooFewViews {
        /// How many there are.
        found: usize,
    },
    /// The views do not determine the camera.
    #[error(
        "the views are too much alike: the focal length is {focal_px:.0} ± {deviation_px:.0} px; tilt the chessboard, \
         and show it near and far"
    )]
    AllAlike {
        /// What came out.
        focal_px: f64,
        /// Its standard deviation.
        deviation_px: f64,
    },
    /// A picture of another size.
    #[error("a picture of {} x {} pixels among pictures of {} x {}", found_px[0], found_px[1], size_px[0], size_px[1])]
    Size {
        /// The picture's.
        found_px: [u32; 2],
        /// The others'.
        size_px: [u32; 2],
    },
    /// OpenCV failed.
    #[error("OpenCV: {0}")]
    Library(String),
}

impl From<opencv::Error> for CalibratingError {
    fn from(error: opencv::Error) -> Self {
        Self::Library(error.message)
    }
}

impl Gathering {
    /// Nothing gathered yet, of pictures of one size.
    pub fn new(board: Chessboard, size_px: [u32; 2]) -> Self {
        Self {
            board,
            size_px,
            views: Vec::new(),
        }
    }

    /// Looks for the chessboard in an 8-bit grey picture (rows from the top, no padding).
    ///
    /// # Errors
    /// A picture of another size, or a failure in OpenCV.
    pub fn look(
        &mut self,
        frame: u32,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Look, CalibratingError> {
        if size_px != self.size_px
            || grey.len() as u64 != u64::from(size_px[0]) * u64::from(size_px[1])
        {
            return Err(CalibratingError::Size {
                found_px: size_px,
                size_px: self.size_px,
            });
        }
        let Some(corners_px) = find(self.board, grey, size_px)? else {
            return Ok(Look::Nothing);
        };
        let least_px = NEW_VIEW * f64::from(size_px[0]);
        if self
            .views
            .iter()
            .any(|view| distance_px(&view.corners_px, &corners_px) < least_px)
        {
            return Ok(Look::Known);
        }
        self.views.push(View { frame, corners_px });
        if self.views.len() > MOST_VIEWS {
            self.drop_most_alike();
        }
        Ok(Look::New)
    }

    /// The views that are kept.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// How many corners lie in each cell of the picture, rows of [`CELLS`] from the top.
    pub fn coverage(&self) -> Vec<usize> {
        coverage(self.views.iter(), self.size_px)
    }

    /// The calibration that all views agree on.
    ///
    /// # Errors
    /// Too few views, views that are too much alike, or a failure in OpenCV.
    pub fn solve(&self) -> Result<Calibrated, CalibratingError> {
        let mut views: Vec<&View> = self.views.iter().collect();
        let mut dropped = Vec::new();
        loop {
            if views.len() < FEWEST_VIEWS {
                return Err(CalibratingError::TooFewViews { found: views.len() });
            }
            let solved = self.solve_for(&views)?;
            let mut sorted = solved.per_view_px.clone();
            sorted.sort_by(f64::total_cmp);
            let limit_px = (MISFIT * sorted[sorted.len() / 2]).max(MISFIT_PX);
            let worst = (0..views.len())
                .max_by(|&a, &b| solved.per_view_px[a].total_cmp(&solved.per_view_px[b]))
                .filter(|&worst| solved.per_view_px[worst] > limit_px);
            if let Some(worst) = worst.filter(|_| views.len() > FEWEST_VIEWS) {
                dropped.push((views[worst].frame, solved.per_view_px[worst]));
                views.remove(worst);
                continue;
            }
            let focal_px = solved.intrinsics.focal_px.x;
            let deviation_px = solved.focal_deviation_px.x;
            // OpenCV's deviations know nothing of the valley that frontal views leave.
            if !(deviation_px < MOST_DEVIATION * focal_px && solved.largest_tilt > LEAST_TILT) {
                return Err(CalibratingError::AllAlike {
                    focal_px,
                    deviation_px,
                });
            }
            return Ok(Calibrated {
                intrinsics: solved.intrinsics,
                focal_deviation_px: solved.focal_deviation_px,
                center_deviation_px: solved.center_deviation_px,
                rms_px: solved.rms_px,
                views: views.into_iter().cloned().zip(solved.per_view_px).collect(),
                dropped,
                largest_tilt: solved.largest_tilt,
            });
        }
    }

    /// With a third radial coefficient where the views bear it out.
    fn solve_for(&self, views: &[&View]) -> Result<Solved, CalibratingError> {
        let without = self.solve_with(views, calib3d::CALIB_FIX_K3)?;
        let half_px = DVec2::from(self.size_px.map(f64::from)) / 2.0;
        let corners = views.iter().flat_map(|view| &view.corners_px);
        let farthest_px = corners
            .map(|corner| corner.distance(half_px))
            .fold(0.0, f64::max);
        if farthest_px < REACH * half_px.length() {
            return Ok(without);
        }
        let with = self.solve_with(views, 0)?;
        let [.., k3] = with.intrinsics.distortion;
        let significant = k3.abs() > SIGNIFICANT * with.k3_deviation;
        Ok(if significant { with } else { without })
    }

    fn solve_with(&self, views: &[&View], flags: i32) -> Result<Solved, CalibratingError> {
        let [columns, rows] = self.board.corners;
        let square_m = self.board.square_m as f32;
        let grid: Vector<Point3f> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (column as f32, row as f32)))
            .map(|(x, y)| Point3f::new(x * square_m, y * square_m, 0.0))
            .collect();
        let objects: Vector<Vector<Point3f>> = views.iter().map(|_| grid.clone()).collect();
        let pictures: Vector<Vector<Point2f>> = views
            .iter()
            .map(|view| {
                let corners = view.corners_px.iter();
                corners
                    .map(|corner| Point2f::new(corner.x as f32, corner.y as f32))
                    .collect()
            })
            .collect();
        let (mut camera, mut distortion) = (Mat::default(), Mat::default());
        let (mut turns, mut shifts) = (Vector::<Mat>::new(), Vector::<Mat>::new());
        let (mut deviations, mut poses_deviations, mut errors) =
            (Mat::default(), Mat::default(), Mat::default());
        let criteria = TermCriteria::new(TermCriteria_COUNT + TermCriteria_EPS, 100, 1e-12)?;
        let rms_px = calib3d::calibrate_camera_extended(
            &objects,
            &pictures,
            Size::new(self.size_px[0] as i32, self.size_px[1] as i32),
            &mut camera,
            &mut distortion,
            &mut turns,
            &mut shifts,
            &mut deviations,
            &mut poses_deviations,
            &mut errors,
            flags,
            criteria,
        )?;
        let entry = |matrix: &Mat, k: i32| -> opencv::Result<f64> { Ok(*matrix.at::<f64>(k)?) };
        let k = |row: i32, column: i32| -> opencv::Result<f64> {
            Ok(*camera.at_2d::<f64>(row, column)?)
        };
        let mut largest_tilt = 0.0_f64;
        for turn in &turns {
            let axis = glam::DVec3::new(entry(&turn, 0)?, entry(&turn, 1)?, entry(&turn, 2)?);
            let normal = glam::DQuat::from_scaled_axis(axis) * glam::DVec3::Z;
            largest_tilt = largest_tilt.max(normal.z.abs().min(1.0).acos());
        }
        let mut coefficients = [0.0; 5];
        for (index, coefficient) in coefficients.iter_mut().enumerate() {
            *coefficient = entry(&distortion, index as i32)?;
        }
        Ok(Solved {
            intrinsics: Intrinsics {
                size_px: self.size_px,
                focal_px: DVec2::new(k(0, 0)?, k(1, 1)?),
                center_px: DVec2::new(k(0, 2)?, k(1, 2)?),
                distortion: coefficients,
            },
            focal_deviation_px: DVec2::new(entry(&deviations, 0)?, entry(&deviations, 1)?),
            center_deviation_px: DVec2::new(entry(&deviations, 2)?, entry(&deviations, 3)?),
            k3_deviation: entry(&deviations, 8)?,
            rms_px,
            per_view_px: (0..views.len() as i32)
                .map(|view| entry(&errors, view))
                .collect::<opencv::Result<_>>()?,
            largest_tilt,
        })
    }

    /// Of the two views that are nearest to each other the later one goes.
    fn drop_most_alike(&mut self) {
        let count = self.views.len();
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
        let nearest = pairs.min_by(|&(a, b), &(c, d)| {
            let apart = |a: usize, b: usize| {
                distance_px(&self.views[a].corners_px, &self.views[b].corners_px)
            };
            apart(a, b).total_cmp(&apart(c, d))
        });
        if let Some((_, later)) = nearest {
            self.views.remove(later);
        }
    }
}

struct Solved {
    intrinsics: Intrinsics,
    focal_deviation_px: DVec2,
    center_deviation_px: DVec2,
    k3_deviation: f64,
    rms_px: f64,
    per_view_px: Vec<f64>,
    largest_tilt: f64,
}

/// How many of the views' corners lie in each cell of the picture, rows of [`CELLS`] from the top.
pub fn coverage<'a>(views: impl Iterator<Item = &'a View>, size_px: [u32; 2]) -> Vec<usize> {
    let [columns, rows] = CELLS;
    let mut cells = vec![0; columns * rows];
    for corner in views.flat_map(|view| &view.corners_px) {
        let cell = |at: f64, side: u32, count: usize| {
            ((at / f64::from(side) * count as f64) as usize).min(count - 1)
        };
        cells[cell(corner.y, size_px[1], rows) * columns + cell(corner.x, size_px[0], columns)] +=
            1;
    }
    cells
}

/// The corners, row by row; `None` where the chessboard is not whole in the picture.
fn find(board: Chessboard, grey: &[u8], size_px: [u32; 2]) -> opencv::Result<Option<Vec<DVec2>>> {
    let picture = Mat::new_rows_cols_with_data(size_px[1] as i32, size_px[0] as i32, grey)?;
    let pattern = Size::new(board.corners[0] as i32, board.corners[1] as i32);
    let mut corners = Vector::<Point2f>::new();
    let flags = calib3d::CALIB_CB_NORMALIZE_IMAGE | calib3d::CALIB_CB_ACCURACY;
    let mut found = calib3d::find_chessboard_corners_sb(&picture, pattern, &mut corners, flags)?;
    if !found {
        let flags = calib3d::CALIB_CB_ADAPTIVE_THRESH
            | calib3d::CALIB_CB_NORMALIZE_IMAGE
            | calib3d::CALIB_CB_FAST_CHECK;
        found = calib3d::find_chessboard_corners(&picture, pattern, &mut corners, flags)?;
    }
    if found {
        // Saddle points, to a few hundredths of a pixel; the window keeps clear of the neighbouring corners.
        let apart_px = corners
            .get(0)
            .and_then(|a| corners.get(1).map(|b| (a.x - b.x).hypot(a.y - b.y)))?;
        let half = ((apart_px / 4.0) as i32).clamp(2, 8);
        let criteria = TermCriteria::new(TermCriteria_COUNT + TermCriteria_EPS, 50, 1e-3)?;
        let (window, no_zone) = (Size::new(half, half), Size::new(-1, -1));
        imgproc::corner_sub_pix(&picture, &mut corners, window, no_zone, criteria)?;
    }
    let corners: Vec<DVec2> = corners
        .iter()
        .map(|corner| DVec2::new(f64::from(corner.x), f64::from(corner.y)))
        .collect();
    let whole = found && corners.len() == (board.corners[0] * board.corners[1]) as usize;
    Ok(whole.then_some(corners))
}

/// Mean distance of the corners of two views, whichever end each was counted from.
fn distance_px(a: &[DVec2], b: &[DVec2]) -> f64 {
    let mean = |pairs: f64| pairs / a.len().max(1) as f64;
    let straight = a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum();
    let turned = a
        .iter()
        .zip(b.iter().rev())
        .map(|(a, b)| a.distance(*b))
        .sum();
    mean(f64::min(straight, turned))
}
