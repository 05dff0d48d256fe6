//! The plane that most markers lie in.

use glam::{DAffine3, DMat3, DVec3};

use super::bundle::PlacedMarker;

/// The frame whose z = 0 is the plane through the markers' corners: origin and x axis are those of the gauge, put into the
/// plane. A marker farther off than it may be does not count. `None` where the markers leave it open.
pub(super) fn plane_from_world(
    markers: &[PlacedMarker],
    gauge: usize,
    may_be_off_m: &[f64],
) -> Option<DAffine3> {
    let mut counting: Vec<usize> = (0..markers.len()).collect();
    loop {
        let plane_from_world = through(markers, &counting, gauge)?;
        let beyond_m = |&marker: &usize| {
            farthest_m(&markers[marker], &plane_from_world) - may_be_off_m[marker]
        };
        let worst = counting
            .iter()
            .enumerate()
            .map(|(at, marker)| (at, beyond_m(marker)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            // Two markers always have a plane near them that means nothing.
            Some((at, beyond_m)) if beyond_m > 0.0 && counting.len() > 2 => {
                counting.swap_remove(at)
            }
            _ => return Some(plane_from_world),
        };
    }
}

/// The distance of a marker's farthest corner from the plane, metres.
pub(super) fn farthest_m(marker: &PlacedMarker, plane_from_world: &DAffine3) -> f64 {
    let heights_m = marker
        .corners_m()
        .map(|corner_m| plane_from_world.transform_point3(corner_m).z.abs());
    heights_m.into_iter().fold(0.0, f64::max)
}

fn through(markers: &[PlacedMarker], counting: &[usize], gauge: usize) -> Option<DAffine3> {
    let corners_m: Vec<DVec3> = counting
        .iter()
        .flat_map(|&marker| markers[marker].corners_m())
        .collect();
    let middle_m = corners_m.iter().sum::<DVec3>() / corners_m.len() as f64;
    let mut scatter = DMat3::ZERO;
    for corner_m in &corners_m {
        let off = *corner_m - middle_m;
        scatter += DMat3::from_cols(off * off.x, off * off.y, off * off.z);
    }
    let normal = least_axis(scatter)?;
    let gauge_from = &markers[gauge].world_from_marker;
    let up = normal * normal.dot(gauge_from.matrix3.z_axis).signum();
    let along = gauge_from.matrix3.x_axis;
    let x = (along - up * up.dot(along)).try_normalize()?;
    let off = up * up.dot(gauge_from.translation - middle_m);
    let origin_m = gauge_from.translation - off;
    let world_from_plane =
        DAffine3::from_mat3_translation(DMat3::from_cols(x, up.cross(x), up), origin_m);
    Some(world_from_plane.inverse())
}

/// The eigenvector of a symmetric matrix for the least eigenvalue: the power method on its inverse, which is nearly singular
/// where it matters and so settles in a few rounds.
fn least_axis(scatter: DMat3) -> Option<DVec3> {
    let trace = scatter.x_axis.x + scatter.y_axis.y + scatter.z_axis.z;
    let lifted = scatter + DMat3::IDENTITY * (1e-9 * trace);
    let inverse = lifted.inverse();
    // One of the axes is not at right angles to the answer.
    let start = [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .max_by(|a, b| (inverse * *a).length().total_cmp(&(inverse * *b).length()))?;
    let mut axis = start;
    for _ in 0..200 {
        axis = (inverse * axis).try_normalize()?;
    }
    axis.is_finite().then_some(axis)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn a_raised_marker_does_not_tilt_the_plane() {
        let world_from_plane = DAffine3::from_rotation_translation(
            DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.9),
            DVec3::new(0.1, 0.2, 0.3),
        );
        let markers: Vec<PlacedMarker> = [
            (0.0, 0.0, 0.0),
            (0.2, 0.0, 0.0),
            (0.0, 0.2, 0.0),
            (0.2, 0.2, 0.03),
        ]
        .map(|(x_m, y_m, z_m)| PlacedMarker {
            world_from_marker: world_from_plane
                * DAffine3::from_translation(DVec3::new(x_m, y_m, z_m)),
            size_m: 0.04,
        })
        .to_vec();
        let found = plane_from_world(&markers, 0, &[0.002; 4]).unwrap();
        assert!(found.abs_diff_eq(world_from_plane.inverse(), 1e-9));
        assert!((farthest_m(&markers[3], &found) - 0.03).abs() < 1e-9);
    }
}
