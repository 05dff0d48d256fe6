//! Sheets of markers as printed, seen by known cameras, and how far poses found in their pictures are off.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
#[allow(unused_imports)] // Each test uses its own part.
pub use gnomon::app::truth::sheets::{Light, camera_above, cube_sides, photograph, with_noise};
use gnomon::capture::Frame;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::scene::{Anchor, DetectorKind, Family, Marker, SearchArea, TrackingSettings};
use gnomon::tracking::{AnchorPose, Tracker};

pub const CAMERA: Intrinsics = Intrinsics {
    size_px: [640, 480],
    focal_px: DVec2::new(615.0, 613.0),
    center_px: DVec2::new(321.4, 238.2),
    distortion: Distortion::NONE,
};

pub const WIDE_CAMERA: Intrinsics = Intrinsics {
    distortion: Distortion::Polynomial([-0.28, 0.09, 0.0015, -0.001, -0.01]),
    ..CAMERA
};

/// Frames of the sequences follow each other so fast, seconds.
pub const FRAME_SECS: f64 = 1.0 / 30.0;

pub fn marker(id: u32, size_m: f64, x_m: f64, y_m: f64) -> Marker {
    Marker::alone(Family::TAG36H11, id, size_m).in_plane(DVec2::new(x_m, y_m), 0.0)
}

pub fn anchor(name: &str, markers: &[Marker]) -> Anchor {
    Anchor {
        name: name.into(),
        markers: markers.to_vec(),
    }
}

/// Four markers of 60 mm around the origin.
pub fn table() -> Vec<Marker> {
    vec![
        marker(0, 0.06, -0.09, 0.06),
        marker(1, 0.06, 0.09, 0.06),
        marker(2, 0.06, -0.09, -0.06),
        marker(17, 0.06, 0.09, -0.06),
    ]
}

pub fn settings(detector: DetectorKind) -> TrackingSettings {
    TrackingSettings {
        detector,
        ..TrackingSettings::default()
    }
}

/// What a program does that only calls a library: corners found anew in the whole of each picture, and a pose from
/// them.
pub fn detector_alone(detector: DetectorKind) -> TrackingSettings {
    TrackingSettings {
        search: SearchArea::Full,
        pose_from_pixels: false,
        filter: false,
        ..settings(detector)
    }
}

pub fn tracker(settings: &TrackingSettings, anchors: &[Anchor], camera: Intrinsics) -> Tracker {
    Tracker::new(settings, anchors, camera).expect("a tracker")
}

pub fn track_once(
    settings: &TrackingSettings,
    anchors: &[Anchor],
    camera: Intrinsics,
    frame: &Frame,
) -> Vec<AnchorPose> {
    tracker(settings, anchors, camera)
        .track(frame)
        .expect("poses")
}

pub fn grey_of(frame: &Frame) -> Vec<u8> {
    frame
        .rgba
        .chunks_exact(4)
        .map(|pixel| {
            let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(f64::from);
            (0.299 * r + 0.587 * g + 0.114 * b).round() as u8
        })
        .collect()
}

/// True corners as printed, distorted pixels.
pub fn true_corners_px(
    camera: &Intrinsics,
    marker: &Marker,
    camera_from_anchor: &DAffine3,
) -> [DVec2; 4] {
    marker.corners_m().map(|corner_m| {
        let in_camera = camera_from_anchor.transform_point3(corner_m);
        camera.pixel_from_plane(camera.distort(in_camera.truncate() / in_camera.z))
    })
}

/// How far a pose puts the corners of markers from where they are, in the mean, pixels.
pub fn shift_px(camera: &Intrinsics, markers: &[Marker], pose: &DAffine3, truth: &DAffine3) -> f64 {
    let corners = markers.iter().flat_map(|marker| {
        let found = true_corners_px(camera, marker, pose);
        let right = true_corners_px(camera, marker, truth);
        std::array::from_fn::<f64, 4, _>(|k| found[k].distance(right[k]))
    });
    corners.sum::<f64>() / (4 * markers.len()) as f64
}

pub fn angle_between_deg(a: &DAffine3, b: &DAffine3) -> f64 {
    DQuat::from_mat3(&a.matrix3)
        .angle_between(DQuat::from_mat3(&b.matrix3))
        .to_degrees()
}

/// A pose turned about the anchor's origin by a vector in camera axes, radians, and shifted, metres.
pub fn turned(pose: &DAffine3, turn: DVec3, shift_m: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(
        DMat3::from_quat(DQuat::from_scaled_axis(turn)) * pose.matrix3,
        pose.translation + shift_m,
    )
}

/// The noise of a hand about its rest: smooth, of some hertz, each coordinate between -1 and 1. Others with other seeds.
pub fn sway(time_secs: f64, seed: u64) -> [f64; 6] {
    std::array::from_fn(|k| {
        let phase = seed as f64 * 1.37 + k as f64 * 2.11;
        let hertz = 0.7 + 0.31 * ((seed + 3 * k as u64) % 7) as f64;
        let slow = (std::f64::consts::TAU * hertz * time_secs + phase).sin();
        let fast = (std::f64::consts::TAU * 2.3 * hertz * time_secs + 2.0 * phase).sin();
        0.75 * slow + 0.25 * fast
    })
}
