//! Where an anchor may be by the corners of its markers: a homography and its two decompositions (IPPE). Of markers in several
//! planes each says where the others may be.
//!
//! T. Collins and A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 2014.

use glam::{DAffine3, DMat2, DMat3, DVec2, DVec3};

use crate::geometry::camera::Intrinsics;
use crate::geometry::homography::{PointScale, linear_homography};
use crate::geometry::least_squares::NormalEquations;

/// Points that lie off a plane by less than this part of the first marker's side lie in it.
const FLAT: f64 = 1e-3;

/// So many markers, the largest ones, say where others in other planes may be.
const SAYING: usize = 4;

/// A point of an anchor and where it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CornerObservation {
    /// The point in the anchor's space, metres.
    pub(super) point_m: DVec3,
    /// Undistorted pixel.
    pub(super) pixel: DVec2,
}

/// The way out of a marker's printed side, from its corners as printed; of any length.
pub(super) fn normal_of(corners: &[CornerObservation]) -> Option<DVec3> {
    let [top_left, top_right, _, bottom_left] = corners else {
        return None;
    };
    let up_m = top_left.point_m - bottom_left.point_m;
    Some((top_right.point_m - top_left.point_m).cross(up_m))
}

/// The frame whose plane z = 0 has all points: the anchor's own where that has them, else the first marker's. `None` where
/// they are in several planes.
fn anchor_from_plane(observations: &[CornerObservation]) -> Option<DAffine3> {
    if observations.iter().all(|seen| seen.point_m.z == 0.0) {
        return Some(DAffine3::IDENTITY);
    }
    let first = observations.get(..4)?;
    let z = normal_of(first)?.try_normalize()?;
    let along_m = first[1].point_m - first[0].point_m;
    let x = along_m.try_normalize()?;
    let frame =
        DAffine3::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), first[0].point_m);
    let within_m = FLAT * along_m.length();
    let is_in_plane = |seen: &CornerObservation| z.dot(seen.point_m - first[0].point_m).abs();
    let mut heights_m = observations.iter().map(is_in_plane);
    heights_m
        .all(|height_m| height_m < within_m)
        .then_some(frame)
}

/// Poses near which those that explain the observations lie: of a plane the two that its homography allows, else those of
/// the markers that are seen largest.
pub(super) fn starts(intrinsics: &Intrinsics, observations: &[CornerObservation]) -> Vec<DAffine3> {
    if let Some(anchor_from_plane) = anchor_from_plane(observations) {
        return starts_in(intrinsics, observations, &anchor_from_plane);
    }
    let mut markers: Vec<&[CornerObservation]> = observations.chunks_exact(4).collect();
    let area_px = |corners: &[CornerObservation]| {
        let across_px = corners[2].pixel - corners[0].pixel;
        across_px.perp_dot(corners[3].pixel - corners[1].pixel)
    };
    markers.sort_by(|a, b| area_px(b).total_cmp(&area_px(a)));
    let largest = markers.into_iter().take(SAYING);
    largest
        .filter_map(|corners| Some((corners, anchor_from_plane(corners)?)))
        .flat_map(|(corners, frame)| starts_in(intrinsics, corners, &frame))
        .collect()
}

/// The two poses of observations in a plane.
fn starts_in(
    intrinsics: &Intrinsics,
    observations: &[CornerObservation],
    anchor_from_plane: &DAffine3,
) -> Vec<DAffine3> {
    if *anchor_from_plane == DAffine3::IDENTITY {
        return ippe_starts(intrinsics, observations).map_or(Vec::new(), Vec::from);
    }
    let plane_from_anchor = anchor_from_plane.inverse();
    let in_plane: Vec<CornerObservation> = observations
        .iter()
        .map(|seen| CornerObservation {
            point_m: plane_from_anchor.transform_point3(seen.point_m),
            ..*seen
        })
        .collect();
    let starts = ippe_starts(intrinsics, &in_plane).into_iter().flatten();
    starts
        .map(|camera_from_plane| camera_from_plane * plane_from_anchor)
        .collect()
}

/// The two poses that the homography's derivative at the points' centre allows (IPPE, section 4); the points must lie in
/// the plane z = 0.
fn ippe_starts(
    intrinsics: &Intrinsics,
    observations: &[CornerObservation],
) -> Option<[DAffine3; 2]> {
    let in_plane = |observation: &CornerObservation| observation.point_m.truncate();
    let scale = PointScale::of(observations.iter().map(in_plane));
    let pairs = observations
        .iter()
        .map(|observation| {
            (
                scale.scaled(in_plane(observation)),
                intrinsics.plane_from_pixel(observation.pixel),
            )
        })
        .collect::<Vec<_>>();
    let homography = linear_homography(&pairs)?;
    // The picture of the centre, and the derivative there.
    let center = homography.z_axis;
    let image_center = center.truncate() / center.z;
    let derivative = |column: DVec3| (column.truncate() - image_center * column.z) / center.z;
    let jacobian = DMat2::from_cols(derivative(homography.x_axis), derivative(homography.y_axis));
    let rotations = ippe_rotations(image_center, jacobian)?;
    let mut poses = [DAffine3::IDENTITY; 2];
    for (pose, rotation) in poses.iter_mut().zip(rotations) {
        let translation_m = translation_for(intrinsics, observations, &rotation)?;
        *pose = DAffine3::from_mat3_translation(rotation, translation_m);
    }
    Some(poses)
}

/// The two rotations of a plane whose centre is seen at `image_center` with the derivative `jacobian` (up to scale).
fn ippe_rotations(image_center: DVec2, jacobian: DMat2) -> Option<[DMat3; 2]> {
    // The rotation that turns the optical axis to the centre's ray.
    let ray = image_center.extend(1.0).normalize();
    let axis_to_ray = glam::DMat3::from_quat(glam::DQuat::from_rotation_arc(DVec3::Z, ray));
    let seen = |column: DVec3| column.truncate() - image_center * column.z;
    let basis = DMat2::from_cols(seen(axis_to_ray.x_axis), seen(axis_to_ray.y_axis));
    let scaled = basis.inverse() * jacobian;
    // The largest singular value is what remains of the depth.
    let (rows_x, rows_y) = (scaled.row(0), scaled.row(1));
    let (xx, xy, yy) = (
        rows_x.length_squared(),
        rows_x.dot(rows_y),
        rows_y.length_squared(),
    );
    let largest = (0.5 * (xx + yy + ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt())).sqrt();
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    let upper = scaled * (1.0 / largest);
    // Unit columns that are perpendicular give the last row up to its sign.
    let first = (1.0 - upper.x_axis.length_squared()).max(0.0).sqrt();
    let second = (1.0 - upper.y_axis.length_squared()).max(0.0).sqrt();
    let second = if upper.x_axis.dot(upper.y_axis) > 0.0 {
        -second
    } else {
        second
    };
    let rotation = |sign: f64| {
        let x = upper.x_axis.extend(sign * first);
        let y = upper.y_axis.extend(sign * second);
        let x = x.normalize();
        let y = (y - x * x.dot(y)).normalize();
        axis_to_ray * DMat3::from_cols(x, y, x.cross(y))
    };
    let rotations = [rotation(1.0), rotation(-1.0)];
    rotations
        .iter()
        .all(|rotation| rotation.is_finite())
        .then_some(rotations)
}

/// The translation that fits best, linearly, once the rotation is known.
fn translation_for(
    intrinsics: &Intrinsics,
    observations: &[CornerObservation],
    rotation: &DMat3,
) -> Option<DVec3> {
    let mut equations = NormalEquations::<3>::ZERO;
    for observation in observations {
        let image = intrinsics.plane_from_pixel(observation.pixel);
        let turned = *rotation * observation.point_m;
        equations.add(&[1.0, 0.0, -image.x], image.x * turned.z - turned.x);
        equations.add(&[0.0, 1.0, -image.y], image.y * turned.z - turned.y);
    }
    equations.solve().map(DVec3::from)
}
