//! Whether learnt markers lie in a plane, and which frame a board has.

use glam::{DAffine3, DVec3};

use super::bundle::{Bundle, Certainty, MARKER_UNKNOWNS, PlacedMarker};
use super::{BoardShape, SpaceFrame, plane};

/// The plane of most markers.
pub(super) struct CommonPlane {
    pub(super) plane_from_world: DAffine3,
    /// How far each marker's farthest corner is from it, metres.
    pub(super) distances_m: Vec<f64>,
    /// Those that are farther than they may be.
    pub(super) off: Vec<usize>,
}

impl CommonPlane {
    pub(super) fn off_by_id(&self, ids: &[u32]) -> Vec<(u32, f64)> {
        let off = self.off.iter();
        off.map(|&marker| (ids[marker], self.distances_m[marker]))
            .collect()
    }
}

/// The plane of most markers; `None` where they leave it open.
pub(super) fn common_plane(
    bundle: &Bundle,
    certainty: &Certainty,
    tolerance_m: f64,
) -> Option<CommonPlane> {
    // Three standard deviations of a height are what the pictures leave open.
    let may_be_off_m: Vec<f64> = (certainty.deviations.iter().zip(&bundle.markers))
        .map(|(deviations, placed)| tolerance_m + 3.0 * height_deviation_m(deviations, placed))
        .collect();
    let plane_from_world = plane::plane_from_world(&bundle.markers, bundle.gauge, &may_be_off_m)?;
    let distances_m: Vec<f64> = bundle
        .markers
        .iter()
        .map(|marker| plane::farthest_m(marker, &plane_from_world))
        .collect();
    let is_off = |&marker: &usize| distances_m[marker] > may_be_off_m[marker];
    Some(CommonPlane {
        off: (0..bundle.markers.len()).filter(is_off).collect(),
        plane_from_world,
        distances_m,
    })
}

/// Turns the world so that its z = 0 is a plane.
fn turn_world(bundle: &mut Bundle, plane_from_world: &DAffine3) {
    let world_from_plane = plane_from_world.inverse();
    for view in &mut bundle.views {
        view.camera_from_world *= world_from_plane;
    }
    for placed in &mut bundle.markers {
        placed.world_from_marker = *plane_from_world * placed.world_from_marker;
    }
}

/// Turns the world so that its plane z = 0 is the markers', and lays them into it.
pub(super) fn lay_into(bundle: &mut Bundle, plane_from_world: &DAffine3) {
    turn_world(bundle, plane_from_world);
    for placed in &mut bundle.markers {
        let in_plane = placed.world_from_marker;
        let center_m = DVec3::new(in_plane.translation.x, in_plane.translation.y, 0.0);
        placed.world_from_marker = DAffine3::from_translation(center_m)
            * DAffine3::from_rotation_z(rotation_rad(&in_plane));
    }
}

/// The shape of markers that are left in space, in the frame of the plane that the gauge and most of the others lie in, if
/// there is one.
pub(super) fn in_space_by(
    bundle: &mut Bundle,
    plane: Option<&CommonPlane>,
    ids: &[u32],
) -> BoardShape {
    /// Two always have a plane near them that means nothing.
    const FEWEST: usize = 3;
    let Some(plane) = plane else {
        return BoardShape::Space {
            off: Vec::new(),
            frame: SpaceFrame::Gauge,
        };
    };
    let in_plane = ids.len() - plane.off.len();
    let has_most = in_plane >= FEWEST && 2 * in_plane > ids.len();
    let frame = match has_most && !plane.off.contains(&bundle.gauge) {
        true => SpaceFrame::PlaneOfMost,
        false => SpaceFrame::Gauge,
    };
    if frame == SpaceFrame::PlaneOfMost {
        turn_world(bundle, &plane.plane_from_world);
    }
    BoardShape::Space {
        off: plane.off_by_id(ids),
        frame,
    }
}

/// The standard deviation of a corner's height: that of the centre's, and of the tilt over half a side.
fn height_deviation_m(deviations: &[f64; MARKER_UNKNOWNS], placed: &PlacedMarker) -> f64 {
    let [rx, ry, _, _, _, z_m, _] = *deviations;
    let half_m = 0.5 * placed.size_m;
    (z_m * z_m + (rx * half_m).powi(2) + (ry * half_m).powi(2)).sqrt()
}

/// Turn about z.
fn rotation_rad(plane_from_marker: &DAffine3) -> f64 {
    let x = plane_from_marker.matrix3.x_axis;
    x.y.atan2(x.x)
}
