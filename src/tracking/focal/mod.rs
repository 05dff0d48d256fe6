//! A camera that nobody has calibrated: its focal length is guessed from the pictures' size, and learnt from the markers
//! while pictures come, with how sure that is.
//!
//! Detected corners are looked at, and not what a tracker makes of them: that has put them where its own camera would see
//! them.

mod camera_fit;
pub(super) mod free_camera;

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use glam::DVec2;

use super::light::grey_from_rgba;
use super::{Detection, Detector, TrackingError};
use crate::capture::Frame;
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::homography::{best_homography, mapped};
use crate::scene::{Anchor, Face, Family, Marker, TrackingSettings};
use camera_fit::{BoardCorner, fit, information};
use free_camera::FOCAL_PRIOR;

/// Tangent of half the angle that a camera nobody has calibrated is taken to see across: most webcams see about 60°.
const GUESSED_HALF_WIDTH: f64 = 0.577;
/// A focal length that is at least so certain is known, as a part of it.
const SURE: f64 = 0.01;
/// What a focal length is off, as a part of it, where the camera is not quite what is fitted: pixels that are no squares, a
/// lens with more terms than two.
const MODEL_ERROR: f64 = 0.002;
/// From here on more pictures are not worth the time.
const SURE_ENOUGH: f64 = 0.003;
/// Fewer views are no judges of their own scatter.
const FEWEST_VIEWS: usize = 6;
/// What a camera is learnt from at most.
const MOST_VIEWS: usize = 40;
/// Views whose boards lie closer are alike: root mean square distance of the board's own corners, as a part of the
/// picture's diagonal.
const ALIKE: f64 = 0.02;
/// A homography that leaves more shows a board that is not what it should be, pixels: a bent lens leaves less.
const MOST_MISFIT_PX: f64 = 6.0;
/// The part of the views by which their number has grown when they are worth another fit.
const GROWTH: f64 = 0.2;

/// A camera as far as it is learnt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearntCamera {
    /// The most likely one.
    pub intrinsics: Intrinsics,
    /// Standard deviation of the focal length as a part of it.
    pub focal_deviation: f64,
    /// What it rests on.
    pub basis: CameraBasis,
}

/// What a camera that nobody has calibrated is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraBasis {
    /// What is usual.
    Guess,
    /// So many views of the scene's markers.
    Views(usize),
    /// Views of an earlier run.
    Kept,
}

impl LearntCamera {
    /// A usual camera, by its pictures' size.
    pub fn guess(size_px: [u32; 2]) -> Self {
        Self {
            intrinsics: guessed_intrinsics(size_px),
            focal_deviation: FOCAL_PRIOR,
            basis: CameraBasis::Guess,
        }
    }

    /// What so many views of markers tell; the deviation is the focal length's, as a part of it.
    pub(super) fn of_views(intrinsics: Intrinsics, focal_deviation: f64, views: usize) -> Self {
        // So few may agree by chance.
        let least = match views < FEWEST_VIEWS {
            true => 2.0 * SURE,
            false => 0.0,
        };
        Self {
            intrinsics,
            focal_deviation: focal_deviation.hypot(MODEL_ERROR).max(least),
            basis: CameraBasis::Views(views),
        }
    }

    /// What an earlier run was sure of.
    pub fn kept(intrinsics: Intrinsics) -> Self {
        Self {
            intrinsics,
            focal_deviation: SURE,
            basis: CameraBasis::Kept,
        }
    }

    /// Whether the focal length is known well enough to be kept.
    pub fn is_sure(&self) -> bool {
        self.focal_deviation <= SURE && self.basis != CameraBasis::Guess
    }

    /// Whether it is so much better than another that it is worth a jump of all that is shown, or is sure and contradicts it.
    pub fn replaces(&self, other: &Self) -> bool {
        let apart = (self.intrinsics.focal_px.x / other.intrinsics.focal_px.x)
            .ln()
            .abs();
        let contradicts = apart > 3.0 * other.focal_deviation.max(SURE);
        self.focal_deviation < 0.5 * other.focal_deviation
            || self.is_sure() && (contradicts || !other.is_sure())
    }

    /// The focal length, and how it is known.
    pub fn in_words(&self) -> String {
        let focal_px = self.intrinsics.focal_px.x;
        let known = match self.basis {
            CameraBasis::Guess => "guessed".to_owned(),
            CameraBasis::Views(1) => "learnt from one view of the markers".to_owned(),
            CameraBasis::Views(views) => format!("learnt from {views} views of the markers"),
            CameraBasis::Kept => "learnt in an earlier run".to_owned(),
        };
        format!(
            "focal length {focal_px:.1} ± {:.1} px, {known}",
            focal_px * self.focal_deviation
        )
    }
}

/// A camera that nobody has calibrated, by its pictures' size.
pub fn guessed_intrinsics(size_px: [u32; 2]) -> Intrinsics {
    let [width, height] = size_px.map(f64::from);
    Intrinsics {
        size_px,
        focal_px: DVec2::splat(width.max(height) / 2.0 / GUESSED_HALF_WIDTH),
        center_px: (DVec2::new(width, height) - 1.0) / 2.0,
        distortion: Distortion::NONE,
    }
}

/// A camera that is being learnt from the pictures of a scene's markers. What it comes to depends on the pictures alone.
pub struct CameraLearner {
    detector: Detector,
    wanted: WantedBoards,
    views: Vec<View>,
    /// How many there were, and how many have been replaced since, when the camera was fitted last.
    fitted_views: usize,
    replaced: usize,
    camera: LearntCamera,
    grey: Vec<u8>,
}

/// The boards whose views are learnt from.
enum WantedBoards {
    /// Those of a scene, each flat part by itself.
    Faces(Vec<Face>),
    /// Each marker of a family by itself; of how large it is the focal length does not depend.
    EveryMarker(Family),
}

/// A marker, and its corners as printed from the top left clockwise; distorted pixels.
type SeenMarker = (Marker, [DVec2; 4]);

/// A board as a picture shows it.
struct View {
    /// The number of the face, or the marker's id.
    board: usize,
    corners: Vec<BoardCorner>,
    /// Where a plain homography puts the corners of the box around the board's own corners.
    outline_px: [DVec2; 4],
    /// What it tells of the focal length.
    information: f64,
}

impl CameraLearner {
    /// A learner from views of anchors.
    ///
    /// # Errors
    /// A family that no detector knows.
    pub fn of_anchors(
        settings: &TrackingSettings,
        anchors: &[Anchor],
        size_px: [u32; 2],
    ) -> Result<Self, TrackingError> {
        let mut families: Vec<Family> = (anchors.iter())
            .flat_map(|anchor| anchor.markers.iter().map(|marker| marker.family))
            .collect();
        families.sort();
        families.dedup();
        let faces = anchors
            .iter()
            .flat_map(|anchor| Face::all_of(&anchor.markers));
        let wanted = WantedBoards::Faces(faces.collect());
        Self::new(Detector::new(settings, &families)?, wanted, size_px)
    }

    /// A learner from views of any markers of a family, each by itself.
    ///
    /// # Errors
    /// A family that no detector knows.
    pub fn of_every_marker(
        settings: &TrackingSettings,
        family: Family,
        size_px: [u32; 2],
    ) -> Result<Self, TrackingError> {
        let detector = Detector::new(settings, &[family])?;
        Self::new(detector, WantedBoards::EveryMarker(family), size_px)
    }

    fn new(
        detector: Detector,
        wanted: WantedBoards,
        size_px: [u32; 2],
    ) -> Result<Self, TrackingError> {
        Ok(Self {
            detector,
            wanted,
            views: Vec::new(),
            fitted_views: 0,
            replaced: 0,
            camera: LearntCamera::guess(size_px),
            grey: Vec::new(),
        })
    }

    /// Looks at a picture.
    ///
    /// # Errors
    /// A picture of another size, or a failure of a library.
    pub fn look(&mut self, frame: &Frame) -> Result<(), TrackingError> {
        if frame.size_px != self.camera.intrinsics.size_px {
            return Err(TrackingError::FrameSize {
                frame_px: frame.size_px,
                calibration_px: self.camera.intrinsics.size_px,
            });
        }
        let mut grey = std::mem::take(&mut self.grey);
        let detected = grey_from_rgba(frame, &mut grey)
            .and_then(|()| self.detector.detect_proven(&grey, frame.size_px));
        self.grey = grey;
        self.look_at(&detected?);
        Ok(())
    }

    /// Looks at what a detector saw in a picture.
    pub fn look_at(&mut self, detections: &[Detection]) {
        self.take(detections);
        let grown = self.views.len() + self.replaced;
        if grown as f64 >= (1.0 + GROWTH) * self.fitted_views as f64 && grown > self.fitted_views {
            self.fit();
        }
    }

    /// The camera as far as it is learnt.
    pub fn camera(&self) -> LearntCamera {
        self.camera
    }

    /// Whether more pictures would hardly make it better.
    pub fn is_done(&self) -> bool {
        self.camera.is_sure() && self.camera.focal_deviation <= SURE_ENOUGH
    }

    /// The camera that all views together tell; those since the last fit have had no say yet.
    pub fn finish(&mut self) -> LearntCamera {
        if self.views.len() + self.replaced > self.fitted_views {
            self.fit();
        }
        self.camera
    }

    fn fit(&mut self) {
        (self.fitted_views, self.replaced) = (self.views.len(), 0);
        let views: Vec<&[BoardCorner]> = self.views.iter().map(|view| &view.corners[..]).collect();
        let Some(fitted) = fit(self.camera.intrinsics.size_px, &views) else {
            return;
        };
        self.camera =
            LearntCamera::of_views(fitted.intrinsics, fitted.focal_deviation, fitted.views);
        for view in &mut self.views {
            view.information = information(&self.camera.intrinsics, &view.corners);
        }
    }

    /// Takes the views of a picture that differ from all others, or tell more than the one that tells least.
    fn take(&mut self, detections: &[Detection]) {
        let [width, height] = self.camera.intrinsics.size_px.map(f64::from);
        let alike_px = ALIKE * DVec2::new(width, height).length();
        for (board, markers) in self.wanted.boards(detections) {
            let Some(mut view) = View::of(board, &markers) else {
                continue;
            };
            let alike = self
                .views
                .iter_mut()
                .find(|kept| kept.is_alike(&view, alike_px));
            if let Some(kept) = alike {
                if view.corners.len() > kept.corners.len() {
                    view.information = information(&self.camera.intrinsics, &view.corners);
                    *kept = view;
                    self.replaced += 1;
                }
                continue;
            }
            view.information = information(&self.camera.intrinsics, &view.corners);
            if self.views.len() < MOST_VIEWS {
                self.views.push(view);
                continue;
            }
            let least =
                (self.views.iter_mut()).min_by(|a, b| a.information.total_cmp(&b.information));
            if let Some(least) = least.filter(|least| least.information < view.information) {
                *least = view;
                self.replaced += 1;
            }
        }
    }
}

impl WantedBoards {
    /// The markers of each board that a picture shows just once, with their corners.
    fn boards(&self, detections: &[Detection]) -> Vec<(usize, Vec<SeenMarker>)> {
        let mut times: BTreeMap<(Family, u32), usize> = BTreeMap::new();
        for seen in detections {
            *times.entry((seen.family, seen.id)).or_default() += 1;
        }
        let once: Vec<&Detection> = (detections.iter())
            .filter(|seen| times[&(seen.family, seen.id)] == 1)
            .collect();
        match self {
            Self::Faces(faces) => (faces.iter().enumerate())
                .map(|(number, face)| {
                    let seen = face.markers.iter().filter_map(|marker| {
                        let is_marker = |seen: &&&Detection| {
                            (seen.family, seen.id) == (marker.family, marker.id)
                        };
                        Some((*marker, once.iter().find(is_marker)?.corners_px))
                    });
                    (number, seen.collect())
                })
                .collect(),
            Self::EveryMarker(family) => (once.into_iter())
                .filter(|seen| seen.family == *family)
                .map(|seen| {
                    let marker = Marker::alone(seen.family, seen.id, 1.0);
                    (seen.id as usize, vec![(marker, seen.corners_px)])
                })
                .collect(),
        }
    }
}

impl View {
    /// `None` where no plane explains the corners.
    fn of(board: usize, markers: &[SeenMarker]) -> Option<Self> {
        // A print in another program's drawing is turned by quarters; of a lone marker that is no matter.
        let turns = match markers.len() {
            0 => return None,
            1 => 1,
            _ => 4,
        };
        (0..turns).find_map(|quarters| Self::turned(board, markers, quarters))
    }

    fn turned(board: usize, markers: &[SeenMarker], quarters: u32) -> Option<Self> {
        let corners: Vec<BoardCorner> = markers
            .iter()
            .flat_map(|(marker, corners_px)| {
                let turn =
                    DVec2::from_angle(marker.rotation_rad() + f64::from(quarters) * FRAC_PI_2);
                let half_m = 0.5 * marker.size_m;
                let ways = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
                ways.into_iter()
                    .zip(corners_px)
                    .map(move |(way, &pixel)| BoardCorner {
                        center_m: marker.center_m().truncate(),
                        from_center_m: turn.rotate(DVec2::from(way) * half_m),
                        pixel,
                    })
            })
            .collect();
        let pairs: Vec<(DVec2, DVec2)> = (corners.iter())
            .map(|corner| (corner.board_m(), corner.pixel))
            .collect();
        let picture_from_board = best_homography(&pairs)?;
        let squares_px = (pairs.iter())
            .map(|&(board_m, pixel)| mapped(&picture_from_board, board_m).distance_squared(pixel));
        let misfit_px = (squares_px.sum::<f64>() / pairs.len() as f64).sqrt();
        if misfit_px > MOST_MISFIT_PX {
            return None;
        }
        let points_m = || pairs.iter().map(|pair| pair.0);
        let least_m = points_m().fold(DVec2::INFINITY, DVec2::min);
        let most_m = points_m().fold(DVec2::NEG_INFINITY, DVec2::max);
        let outline_m = [
            least_m,
            DVec2::new(most_m.x, least_m.y),
            most_m,
            DVec2::new(least_m.x, most_m.y),
        ];
        Some(Self {
            board,
            outline_px: outline_m.map(|corner_m| mapped(&picture_from_board, corner_m)),
            corners,
            information: 0.0,
        })
    }

    fn is_alike(&self, other: &Self, alike_px: f64) -> bool {
        let pairs = self.outline_px.iter().zip(&other.outline_px);
        let squares_px: f64 = pairs.map(|(a, b)| a.distance_squared(*b)).sum();
        self.board == other.board && (squares_px / 4.0).sqrt() < alike_px
    }
}

#[cfg(test)]
mod tests;
