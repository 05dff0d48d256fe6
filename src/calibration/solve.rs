//! The calibration itself: OpenCV's bundle adjustment (Zhang, "A flexible new technique for camera calibration", 2000),
//! without the views that spoil it, with no more of the lens model than the views tell: both by cross-validation.

use glam::{DAffine3, DVec2, DVec3};
use opencv::calib3d;
use opencv::core::{
    Mat, Point2f, Point3f, Size, TermCriteria, TermCriteria_COUNT, TermCriteria_EPS, Vec3d, Vector,
};
use opencv::prelude::*;

use super::cross_validation::{is_no_worse, left_out_errors};
use super::deviations::{Parameters, deviations, polynomial_of, reduced_views};
use super::focal_change::{FocalChange, focal_change};
use super::views::{FEWEST_VIEWS, Placing, TILTED_RAD, TargetView, Views, coverage_of, lacks_of};
use super::{CalibrateError, Coverage, Lack, TargetCorner};
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::pose::pose_from_rodrigues;
use crate::geometry::quarter_turns::QuarterTurns;

/// A camera, and how it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// What of the lens the views tell; the rest is 0.
    pub lens: LensTerms,
    /// Standard deviation of the focal lengths, pixels.
    pub focal_deviation_px: DVec2,
    /// Standard deviation of the principal point, pixels.
    pub center_deviation_px: DVec2,
    /// Standard deviations of the distortion coefficients.
    pub distortion_deviations: [f64; 5],
    /// Root mean square distance of all corners from where the calibration puts them, pixels.
    pub rms_px: f64,
    /// What it rests on.
    pub views: Vec<FittedView>,
    /// Views that did not fit: number of the picture and root mean square distance, pixels.
    pub dropped: Vec<(u32, f64)>,
    /// What two kinds of views want, where one focal length does not explain them.
    pub focal_change: Option<FocalChange>,
    /// Where the corners lie.
    pub coverage: Coverage,
    /// What the views lack; nothing when they are good.
    pub lacks: Vec<Lack>,
}

/// The terms of the lens's distortion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LensTerms {
    /// How many of k1, k2, k3: 1 to 3.
    pub radial: u32,
    /// Whether p1 and p2 are among them.
    pub tangential: bool,
}

/// A view as the calibration explains it.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedView {
    /// The number under which the picture was shown.
    pub picture: u32,
    /// Where the target lies (its frame: x right, y down as printed).
    pub camera_from_target: DAffine3,
    /// Root mean square distance of its corners from where the calibration puts them, pixels.
    pub rms_px: f64,
    /// The view's corners: where they are, and how far that is from where the calibration puts them; pixels.
    pub residuals: Vec<(DVec2, DVec2)>,
}

/// A focal length that is less certain is none.
const MOST_FOCAL_DEVIATION: f64 = 0.03;
/// How many times worse than the median view a bad view is at least.
const BAD_TIMES: f64 = 3.0;
/// By how much a bad view is worse than the median view at least, pixels.
const BAD_BY_PX: f64 = 0.15;
/// The largest part of the views that is dropped: where more do not fit, it is not the views.
const MOST_DROPPED: f64 = 0.25;
/// An upright picture is turned the other way round where that leaves this part of its error or less.
const TURNED_BETTER: f64 = 0.9;
/// Times that all of them are asked where no others tell the camera first.
const TURNING_ROUNDS: usize = 3;

impl LensTerms {
    /// The last radial term would bend to bad views.
    const ROBUST: Self = Self {
        radial: 2,
        tangential: true,
    };

    /// The lenses with a term less, in the order in which they are tried. k1 always stays: most lenses have some.
    fn fewer(self) -> impl Iterator<Item = Self> {
        let less_radial = (self.radial > 1).then(|| Self {
            radial: self.radial - 1,
            ..self
        });
        let less_tangential = self.tangential.then_some(Self {
            tangential: false,
            ..self
        });
        less_radial.into_iter().chain(less_tangential)
    }

    /// Which of fx, fy, cx, cy, k1, k2, p1, p2, k3 the views decide.
    fn free(self) -> [bool; 9] {
        let (k2, k3) = (self.radial > 1, self.radial > 2);
        [
            true,
            true,
            true,
            true,
            true,
            k2,
            self.tangential,
            self.tangential,
            k3,
        ]
    }
}

impl FittedView {
    /// The angle between the target's normal and the camera's axis, radians.
    pub fn tilt_rad(&self) -> f64 {
        self.camera_from_target
            .matrix3
            .z_axis
            .z
            .abs()
            .min(1.0)
            .acos()
    }
}

/// Calibrates from the views that were collected.
///
/// # Errors
/// Too few views, views that are all alike, views that do not tell the focal length.
pub fn solve(views: &Views) -> Result<Calibration, CalibrateError> {
    let chosen = views.chosen()?;
    // `chosen` made sure that there is a picture.
    let size_px = views.size_px().unwrap_or_default();
    let upright = upright(&chosen, size_px)?;
    let mut chosen: Vec<&TargetView> = upright.iter().collect();
    let most_dropped = (MOST_DROPPED * chosen.len() as f64) as usize;
    let mut dropped = Vec::new();
    let mut fit = CameraFit::of(&chosen, size_px, LensTerms::ROBUST)?;
    while dropped.len() < most_dropped && chosen.len() > FEWEST_VIEWS {
        let Some(worst) = fit.bad_view() else { break };
        let mut others = chosen.clone();
        let view = others.remove(worst);
        let without = CameraFit::of(&others, size_px, LensTerms::ROBUST)?;
        // A view that is merely blurred tells the same camera: it stays.
        let mut errors = fit.left_out_errors(&chosen, LensTerms::ROBUST);
        if let Some(errors) = &mut errors {
            errors.remove(worst);
        }
        let errors_without = without.left_out_errors(&others, LensTerms::ROBUST);
        let spoils = match (errors, errors_without) {
            (Some(with), Some(without)) => without.iter().sum::<f64>() < with.iter().sum(),
            _ => false,
        };
        if !spoils {
            break;
        }
        dropped.push((view.picture, fit.view_rms_px[worst]));
        (fit, chosen) = (without, others);
    }
    let (fit, lens, deviations) = simplest(&chosen, size_px)?;
    let focal_deviation_px = DVec2::new(deviations[0], deviations[1]);
    let focal_deviation = (focal_deviation_px / fit.intrinsics.focal_px).max_element();
    let focal_change = fit.focal_change(&chosen, lens);
    // Also where it is not finite.
    if focal_deviation.is_nan() || focal_deviation > MOST_FOCAL_DEVIATION {
        let focal_deviation = Some(focal_deviation).filter(|deviation| deviation.is_finite());
        let why = focal_change
            .map(CalibrateError::Changed)
            .or(views.too_small());
        return Err(why.unwrap_or(CalibrateError::Degenerate { focal_deviation }));
    }
    let fitted: Vec<FittedView> = chosen
        .iter()
        .enumerate()
        .map(|(k, view)| fit.fitted(k, view))
        .collect();
    let coverage = coverage_of(chosen.iter().copied(), size_px);
    let tilted = fitted.iter().filter(|view| view.tilt_rad() > TILTED_RAD);
    let lacks = lacks_of(chosen.len(), &coverage, tilted.count());
    Ok(Calibration {
        intrinsics: fit.intrinsics,
        lens,
        focal_deviation_px,
        center_deviation_px: DVec2::new(deviations[2], deviations[3]),
        distortion_deviations: std::array::from_fn(|k| deviations[4 + k]),
        rms_px: fit.rms_px,
        focal_change,
        views: fitted,
        dropped,
        coverage,
        lacks,
    })
}

/// The views, each upright picture of which nobody knows how it was turned on that side on which it fits the others better.
fn upright(views: &[&TargetView], size_px: [u32; 2]) -> Result<Vec<TargetView>, CalibrateError> {
    let mut settled: Vec<TargetView> = views.iter().map(|&view| view.clone()).collect();
    let is_open = |view: &TargetView| matches!(view.placing, Placing::UpOrDown(_));
    if !settled.iter().any(is_open) {
        return Ok(settled);
    }
    let known = settled.iter().filter(|view| !is_open(view)).count();
    let rounds = match known >= FEWEST_VIEWS {
        true => 1,
        false => TURNING_ROUNDS,
    };
    for _ in 0..rounds {
        let base: Vec<&TargetView> = (settled.iter())
            .filter(|view| known < FEWEST_VIEWS || !is_open(view))
            .collect();
        let camera = CameraFit::of(&base, size_px, LensTerms::ROBUST)?.intrinsics;
        for view in settled.iter_mut().filter(|view| is_open(view)) {
            let over = view.turned(QuarterTurns::HALF, size_px);
            if error_px(&camera, &over)? < TURNED_BETTER * error_px(&camera, view)? {
                *view = over;
            }
        }
    }
    Ok(settled)
}

/// Root mean square distance of a view's corners from where a camera puts them, the target wherever it fits best; pixels.
fn error_px(camera: &Intrinsics, view: &TargetView) -> Result<f64, CalibrateError> {
    let object_points: Vector<Point3f> = (view.corners.iter())
        .map(|corner| {
            let [x, y] = corner.target_m.as_vec2().to_array();
            Point3f::new(x, y, 0.0)
        })
        .collect();
    let pixels = view.pixels().map(|pixel| pixel.as_vec2());
    let image_points: Vector<Point2f> =
        pixels.map(|pixel| Point2f::new(pixel.x, pixel.y)).collect();
    let (focal, center) = (camera.focal_px, camera.center_px);
    let rows = [
        [focal.x, 0.0, center.x],
        [0.0, focal.y, center.y],
        [0.0, 0.0, 1.0],
    ];
    let matrix = Mat::from_slice_2d(&rows)?;
    let coefficients = polynomial_of(camera);
    let coefficients = Mat::from_slice(&coefficients)?;
    let (mut turn, mut shift) = (Vec3d::default(), Vec3d::default());
    let found = calib3d::solve_pnp_def(
        &object_points,
        &image_points,
        &matrix,
        &coefficients,
        &mut turn,
        &mut shift,
    )?;
    if !found {
        return Ok(f64::INFINITY);
    }
    let pose = pose_from_rodrigues(DVec3::from_array(shift.0), DVec3::from_array(turn.0));
    let squares = view.corners.iter().map(|corner| {
        let expected_px = camera.pixel_of(pose.transform_point3(corner.target_m.extend(0.0)));
        expected_px.map_or(f64::INFINITY, |pixel| pixel.distance_squared(corner.pixel))
    });
    Ok((squares.sum::<f64>() / view.corners.len() as f64).sqrt())
}

/// The lens with no more terms than the views tell, and the parameters' standard deviations: a term is left out where
/// cross-validation does not miss it, or where the lens would fold with it.
fn simplest(
    views: &[&TargetView],
    size_px: [u32; 2],
) -> Result<(CameraFit, LensTerms, Parameters), CalibrateError> {
    let mut lens = LensTerms {
        radial: 3,
        tangential: true,
    };
    let mut fit = match CameraFit::of(views, size_px, lens) {
        Ok(fit) => fit,
        Err(_) => {
            lens.radial = 2;
            CameraFit::of(views, size_px, lens)?
        }
    };
    loop {
        let errors = fit.left_out_errors(views, lens);
        let folds = folds(&fit.intrinsics);
        let mut simpler = None;
        for fewer in lens.fewer() {
            let Ok(other) = CameraFit::of(views, size_px, fewer) else {
                continue;
            };
            let is_radial = fewer.radial < lens.radial;
            let is_as_good = match (&errors, other.left_out_errors(views, fewer)) {
                (Some(errors), Some(others)) => is_no_worse(&others, errors),
                // What the views do not determine they do not tell.
                (None, _) => true,
                (Some(_), None) => false,
            };
            if is_as_good || (folds && is_radial) {
                simpler = Some((other, fewer));
                break;
            }
        }
        match simpler {
            Some(found) => (fit, lens) = found,
            None if folds => return Err(CalibrateError::Folds),
            None => {
                let deviations = deviations(&fit.intrinsics, fit.posed(views), lens.free());
                return Ok((fit, lens, deviations));
            }
        }
    }
}

/// What OpenCV makes of some views.
struct CameraFit {
    intrinsics: Intrinsics,
    camera_from_target: Vec<DAffine3>,
    view_rms_px: Vec<f64>,
    rms_px: f64,
}

impl CameraFit {
    fn of(
        views: &[&TargetView],
        size_px: [u32; 2],
        lens: LensTerms,
    ) -> Result<Self, CalibrateError> {
        let object_points: Vector<Vector<Point3f>> = views
            .iter()
            .map(|view| {
                let points = view.corners.iter().map(|corner| corner.target_m.as_vec2());
                points
                    .map(|point| Point3f::new(point.x, point.y, 0.0))
                    .collect()
            })
            .collect();
        let image_points: Vector<Vector<Point2f>> = views
            .iter()
            .map(|view| {
                let pixels = view.pixels().map(|pixel| pixel.as_vec2());
                pixels.map(|pixel| Point2f::new(pixel.x, pixel.y)).collect()
            })
            .collect();
        let (mut matrix, mut coefficients) = (Mat::default(), Mat::default());
        let (mut turns, mut shifts) = (Vector::<Vec3d>::new(), Vector::<Vec3d>::new());
        let mut view_rms_px = Mat::default();
        let mut flags = 0;
        for (is_fixed, flag) in [
            (lens.radial < 3, calib3d::CALIB_FIX_K3),
            (lens.radial < 2, calib3d::CALIB_FIX_K2),
            (!lens.tangential, calib3d::CALIB_ZERO_TANGENT_DIST),
        ] {
            if is_fixed {
                flags |= flag;
            }
        }
        let rms_px = calib3d::calibrate_camera_extended(
            &object_points,
            &image_points,
            Size::new(size_px[0] as i32, size_px[1] as i32),
            &mut matrix,
            &mut coefficients,
            &mut turns,
            &mut shifts,
            &mut Mat::default(),
            &mut Mat::default(),
            &mut view_rms_px,
            flags,
            TermCriteria::new(TermCriteria_COUNT + TermCriteria_EPS, 100, 1e-9)?,
        )
        // Views that leave its first guess undetermined make it throw.
        .map_err(|_| CalibrateError::Degenerate {
            focal_deviation: None,
        })?;
        let matrix = matrix.data_typed::<f64>()?;
        let coefficients = coefficients.data_typed::<f64>()?;
        let intrinsics = Intrinsics {
            size_px,
            focal_px: DVec2::new(matrix[0], matrix[4]),
            center_px: DVec2::new(matrix[2], matrix[5]),
            distortion: Distortion::Polynomial(std::array::from_fn(|k| {
                coefficients.get(k).copied().unwrap_or(0.0)
            })),
        };
        let poses = turns.iter().zip(&shifts);
        Ok(Self {
            intrinsics,
            camera_from_target: poses
                .map(|(turn, shift)| {
                    pose_from_rodrigues(DVec3::from_array(shift.0), DVec3::from_array(turn.0))
                })
                .collect(),
            view_rms_px: view_rms_px.data_typed::<f64>()?.to_vec(),
            rms_px,
        })
    }

    /// The views, each with where the target lies.
    fn posed<'a>(
        &self,
        views: &'a [&TargetView],
    ) -> impl Iterator<Item = (&'a [TargetCorner], DAffine3)> {
        let seen = views.iter().map(|view| view.corners.as_slice());
        seen.zip(self.camera_from_target.iter().copied())
    }

    /// How far each view would be off for a camera that is known from the others.
    fn left_out_errors(&self, views: &[&TargetView], lens: LensTerms) -> Option<Vec<f64>> {
        left_out_errors(&self.intrinsics, self.posed(views), lens.free())
    }

    /// What the views want, where they are not all of one focal length.
    fn focal_change(&self, views: &[&TargetView], lens: LensTerms) -> Option<FocalChange> {
        let reduced = reduced_views(&self.intrinsics, self.posed(views), lens.free())?;
        focal_change(&self.intrinsics, &reduced, self.rms_px)
    }

    /// The view that fits worst, if it is a bad one.
    fn bad_view(&self) -> Option<usize> {
        let errors_px = &self.view_rms_px;
        let mut sorted = errors_px.clone();
        sorted.sort_by(f64::total_cmp);
        let median_px = *sorted.get(sorted.len() / 2)?;
        let worst = (0..errors_px.len()).max_by(|&a, &b| errors_px[a].total_cmp(&errors_px[b]))?;
        let bad = errors_px[worst] > (BAD_TIMES * median_px).max(median_px + BAD_BY_PX);
        bad.then_some(worst)
    }

    fn fitted(&self, k: usize, view: &TargetView) -> FittedView {
        let camera_from_target = self.camera_from_target[k];
        let intrinsics = &self.intrinsics;
        let residuals = view.corners.iter().map(|corner| {
            let in_camera_m = camera_from_target.transform_point3(corner.target_m.extend(0.0));
            let expected_px = intrinsics.pixel_of(in_camera_m).unwrap_or(DVec2::NAN);
            (corner.pixel, corner.pixel - expected_px)
        });
        FittedView {
            picture: view.picture,
            camera_from_target,
            rms_px: self.view_rms_px[k],
            residuals: residuals.collect(),
        }
    }
}

/// Whether the radial distortion turns back on itself within the picture: two rays would share a pixel.
fn folds(intrinsics: &Intrinsics) -> bool {
    const STEPS: u32 = 1000;
    let [width, height] = intrinsics.size_px.map(f64::from);
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)].map(DVec2::from);
    let farthest = corners
        .map(|corner| intrinsics.plane_from_pixel(corner).length())
        .into_iter()
        .fold(0.0, f64::max);
    let [k1, k2, _, _, k3] = polynomial_of(intrinsics);
    let radius = |r: f64| r * (1.0 + r * r * (k1 + r * r * (k2 + r * r * k3)));
    // Barrel distortion needs more than `farthest` to reach it, but never twice that in a lens that this model fits.
    let mut before = 0.0;
    for step in 1..=STEPS {
        let now = radius(2.0 * farthest * f64::from(step) / f64::from(STEPS));
        if now >= farthest {
            return false;
        }
        if now <= before {
            return true;
        }
        before = now;
    }
    true
}
