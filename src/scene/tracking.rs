//! `[tracking]`: how markers are found.

use super::error::SceneError;
use super::ranges::{Numbers, Whole};
use super::reader::Table;
use super::schema::key::Missing::Is;
use super::schema::section::{Section, Times};
use super::schema::settings::Settings as _;

choices! {
    /// Which library finds the markers.
    pub enum DetectorKind, "detector" {
        /// libapriltag for AprilTag's families, OpenCV's ArUco for the others.
        ByFamily = "family",
        /// libapriltag: AprilTag's families alone.
        AprilTag = "apriltag",
        /// OpenCV's ArUco: every family but AprilTag 3's with rings.
        Aruco = "aruco",
    }
}

choices! {
    /// Where the corners of OpenCV's detector are refined.
    pub enum ArucoRefinement, "refinement" {
        /// As the contour's polygon gives them.
        None = "none",
        /// By the saddle of the gradient in a window (`cornerSubPix`).
        Subpixel = "subpixel",
        /// By lines fitted to the contour.
        Contour = "contour",
        /// By AprilTag's own edge fit: slow.
        AprilTag = "apriltag",
    }
}

choices! {
    /// Where markers are looked for.
    pub enum SearchArea, "search" {
        /// Where they must be by now; in the whole picture now and then, and whenever an anchor is missing.
        Near = "near",
        /// In the whole picture of every frame, and no better than `decimation` allows.
        Full = "full",
    }
}

settings! {
    /// How markers are found.
    #[derive(Debug, Clone, PartialEq)]
    pub struct TrackingSettings, TRACKING: TrackingKeys;

    /// The library that finds the markers.
    detector: DetectorKind => Is(DetectorKind::ByFamily);
    /// libapriltag searches pictures shrunk by this; 1 is full resolution and finds smaller markers.
    decimation: f64, Numbers::between(1.0, 8.0) => Is(2.0);
    /// libapriltag: standard deviation of the blur before the search, pixels.
    blur_px: f64, Numbers::between(0.0, 10.0).unit("px") => Is(0.0);
    /// Fit the edges of what decodes at full resolution, in linear light; with ArUco only where `aruco_refinement` is not
    /// "none".
    refine_edges: bool => Is(true);
    /// libapriltag: let the library fit the edges of whatever is square before it decodes.
    library_edges: bool => Is(false);
    /// OpenCV's ArUco: corner refinement.
    aruco_refinement: ArucoRefinement => Is(ArucoRefinement::Contour);
    /// Bits that may be corrected in a marker's code.
    corrected_bits: u32, Whole::between(0, 3) => Is(1);
    /// libapriltag: detections with a smaller decision margin are dropped.
    min_margin: f64, Numbers::between(0.0, 255.0) => Is(20.0);
    /// OpenCV: threads of the search. (libapriltag has one: with more it may crash.)
    threads: u32, Whole::between(1, 64) => Is(1);
    /// Where markers are looked for.
    search: SearchArea => Is(SearchArea::Near);
    /// Poses from all pixels around the markers' edges, not from a detector's corners alone.
    pose_from_pixels: bool => Is(true);
    /// Smooth poses over time: what rests stays where it is to the bit, what moves is not held back.
    filter: bool => Is(true);
}

/// `[tracking]`.
pub static TRACKING_SECTION: Section = Section {
    name: "tracking",
    says: "How markers are found.",
    times: Times::UpToOnce,
    groups: &[TrackingKeys::ALL],
    shown: &[],
    is_aside: false,
};

/// Reads it.
pub fn tracking(root: &Table) -> Result<TrackingSettings, SceneError> {
    let default = TrackingSettings::default();
    match TRACKING_SECTION.table(root)? {
        Some(table) => TrackingSettings::read(&table, &default),
        None => Ok(default),
    }
}
