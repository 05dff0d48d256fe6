//! A camera's calibration from pictures of a flat target.
//!
//! [`Views`] is shown one grey picture after the other, from files or from a webcam, and says after each what the set
//! still lacks; [`solve`] makes a calibration of it. No type of OpenCV's leaves.

mod corner_fit;
mod coverage;
mod coverage_picture;
mod cross_validation;
mod deviations;
mod finder;
mod focal_change;
mod shown_instead;
mod solve;
mod taker;
mod target;
mod views;

use glam::DVec2;

use crate::tracking::TrackingError;

pub use coverage::Coverage;
pub use coverage_picture::{CoveragePicture, coverage_picture};
pub use finder::{SmallSquares, TargetFinder};
pub use focal_change::FocalChange;
pub use shown_instead::ShownInstead;
pub use solve::{Calibration, FittedView, LensTerms, solve};
pub use taker::{Moment, Taker};
pub use target::{Target, TargetError, TargetMarkers};
pub use views::{FEWEST_VIEWS, Lack, Placing, TargetLook, TargetView, Views};

/// An inner corner of the target, and where a picture shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetCorner {
    /// In the target's frame, metres.
    pub target_m: DVec2,
    /// Distorted pixel; an integer coordinate is a pixel's centre.
    pub pixel: DVec2,
}

/// Why pictures give no calibration.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// Pictures of more than one size.
    #[error(
        "a picture of {} x {} pixels among those of {} x {}: a calibration needs one camera at one size",
        size_px[0], size_px[1], expected_px[0], expected_px[1]
    )]
    OtherSize {
        /// Width and height of the odd one.
        size_px: [u32; 2],
        /// Width and height of the first one.
        expected_px: [u32; 2],
    },
    /// The target is there with its columns for rows.
    #[error(
        "{seen} of {looked} pictures show a ChArUco board of {0} x {1} squares, not of {1} x {0}: its columns come first \
         (--charuco {0}x{1})",
        squares[0], squares[1]
    )]
    Swapped {
        /// Number of pictures.
        looked: u32,
        /// How many show the other board.
        seen: u32,
        /// Its columns and rows.
        squares: [u32; 2],
    },
    /// Another chessboard is there.
    #[error(
        "none of {looked} pictures shows what was looked for ({target}); {seen} show a chessboard of {} x {} inner corners \
         (--chessboard {0}x{1})",
        corners[0], corners[1]
    )]
    OtherBoard {
        /// Number of pictures.
        looked: u32,
        /// How many show the other board.
        seen: u32,
        /// Its inner corners.
        corners: [u32; 2],
        /// What was looked for.
        target: Target,
    },
    /// The board's markers are mirrored.
    #[error(
        "{seen} of {looked} pictures show the target only when they are turned left for right: set --mirror (leave it out \
         where it is set)"
    )]
    Mirrored {
        /// Number of pictures.
        looked: u32,
        /// How many show it so.
        seen: u32,
    },
    /// The markers stand too near to the board's corners, in pixels.
    #[error(
        "{} of {looked} pictures show the target too small: its squares are {:.0} px wide there, and {:.0} are needed for the \
         corners between its markers to be told; hold it nearer, or take larger pictures",
        small.pictures, small.square_px.floor(), small.needed_px.ceil()
    )]
    TooSmall {
        /// Number of pictures.
        looked: u32,
        /// Those that are too small.
        small: SmallSquares,
    },
    /// The target is in none of them.
    #[error(
        "none of {looked} pictures shows what was looked for ({target}); {}",
        if target.markers.is_some() {
            "a ChArUco board is counted by its squares; its markers must be of that dictionary"
        } else {
            "a chessboard is counted by its inner corners, where four squares meet, and must be whole in the picture"
        }
    )]
    NoTarget {
        /// Number of pictures.
        looked: u32,
        /// What was looked for.
        target: Target,
    },
    /// Too few pictures show it.
    #[error(
        "{found} of {looked} pictures show the target; at least {FEWEST_VIEWS} different views are needed, 15 to 30 are good"
    )]
    TooFewViews {
        /// Number of pictures.
        looked: u32,
        /// How many of them show the target.
        found: u32,
    },
    /// It always lies in the same place.
    #[error(
        "{found} pictures show the target, but just {different} of them differ; move it through the whole picture and \
         tilt it by 20 to 40 degrees to all sides (at least {FEWEST_VIEWS} different views are needed)"
    )]
    Alike {
        /// How many pictures show the target.
        found: u32,
        /// How many views are left without those that are like others.
        different: usize,
    },
    /// The views do not tell the focal length.
    #[error(
        "these views do not tell the focal length ({}); tilt the target by 20 to 40 degrees to all sides",
        focal_deviation.map_or_else(
            || "no camera explains them".to_owned(),
            |deviation| format!("it is uncertain by {:.1} %", 100.0 * deviation)
        )
    )]
    Degenerate {
        /// The larger standard deviation of the focal lengths, as a part of them; `None` where nothing was found.
        focal_deviation: Option<f64>,
    },
    /// The views are not of one camera.
    #[error("{0}: calibrate with pictures of one setting alone")]
    Changed(FocalChange),
    /// The lens would send two rays to one pixel.
    #[error(
        "the lens that fits these views turns back on itself within the picture; move the target into the picture's \
         corners"
    )]
    Folds,
    /// A detector failed.
    #[error(transparent)]
    Tracking(#[from] TrackingError),
    /// OpenCV failed.
    #[error("OpenCV: {0}")]
    Library(String),
}

impl From<opencv::Error> for CalibrateError {
    fn from(error: opencv::Error) -> Self {
        Self::Library(error.message)
    }
}
