//! Rigid poses as `DAffine3`, small steps of them, and OpenCV's Rodrigues vectors.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A step of a pose: a turn about its own origin in the axes that it maps to (left of the rotation; radians), then a shift
/// in these axes (metres).
pub type PoseStep = [f64; 6];

/// The rotation of a pose after a turn in the axes that it maps to, radians.
pub fn turned(pose: &DAffine3, turn: DVec3) -> DQuat {
    (DQuat::from_scaled_axis(turn) * DQuat::from_mat3(&pose.matrix3)).normalize()
}

/// A pose after a step.
pub fn moved(pose: &DAffine3, step: PoseStep) -> DAffine3 {
    let [rx, ry, rz, tx, ty, tz] = step;
    DAffine3::from_rotation_translation(
        turned(pose, DVec3::new(rx, ry, rz)),
        pose.translation + DVec3::new(tx, ty, tz),
    )
}

/// The step from one pose to another, by the shorter way round.
pub fn difference(to: &DAffine3, from: &DAffine3) -> PoseStep {
    let rotation = DQuat::from_mat3(&(to.matrix3 * from.matrix3.transpose())).normalize();
    let turn = rotation.to_scaled_axis();
    let turn = match turn.length() > std::f64::consts::PI {
        true => turn * (1.0 - std::f64::consts::TAU / turn.length()),
        false => turn,
    };
    let shift_m: DVec3 = to.translation - from.translation;
    [turn.x, turn.y, turn.z, shift_m.x, shift_m.y, shift_m.z]
}

/// The derivative by a pose's step of something whose derivative by a point's place, `gradient`, is known; `turned_m` is
/// the point from the pose's origin, in the axes that the pose maps to.
#[inline]
pub fn by_step(turned_m: DVec3, gradient: DVec3) -> PoseStep {
    // gradient · (turn × turned) = turn · (turned × gradient)
    let by_turn = turned_m.cross(gradient);
    [
        by_turn.x, by_turn.y, by_turn.z, gradient.x, gradient.y, gradient.z,
    ]
}

/// The angle between the rotations of two poses, radians.
pub fn rotation_between(a: &DAffine3, b: &DAffine3) -> f64 {
    let turned: DMat3 = a.matrix3.transpose() * b.matrix3;
    // From the sine and the cosine, since each alone is blind somewhere.
    let sine = DVec3::new(
        turned.y_axis.z - turned.z_axis.y,
        turned.z_axis.x - turned.x_axis.z,
        turned.x_axis.y - turned.y_axis.x,
    )
    .length()
        / 2.0;
    let cosine = (turned.x_axis.x + turned.y_axis.y + turned.z_axis.z - 1.0) / 2.0;
    sine.atan2(cosine)
}

/// A pose from a translation in metres and a Rodrigues vector (axis times angle in radians).
pub fn pose_from_rodrigues(translation_m: DVec3, rotation: DVec3) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_scaled_axis(rotation), translation_m)
}

/// The Rodrigues vector (axis times angle in radians, angle at most π) of a rigid pose.
pub fn rodrigues_from_pose(pose: &DAffine3) -> DVec3 {
    let rotation = DQuat::from_mat3(&pose.matrix3).normalize();
    let shortest = if rotation.w < 0.0 {
        -rotation
    } else {
        rotation
    };
    let sine = shortest.xyz().length();
    // glam's own conversion gives up below 1e-8 rad; a slow turn is still a turn.
    let scale = if sine > 0.0 {
        2.0 * sine.atan2(shortest.w) / sine
    } else {
        2.0
    };
    shortest.xyz() * scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rodrigues_goes_there_and_back() {
        for rotation in [
            DVec3::ZERO,
            DVec3::new(0.1, -2.0, 0.7),
            DVec3::new(3.1, 0.0, 0.0),
            DVec3::new(0.0, 1e-9, 0.0),
        ] {
            let pose = pose_from_rodrigues(DVec3::new(1.0, 2.0, 3.0), rotation);
            assert!(
                (rodrigues_from_pose(&pose) - rotation).length() < 1e-12,
                "{rotation}"
            );
        }
    }

    fn pose() -> DAffine3 {
        pose_from_rodrigues(DVec3::new(0.1, -0.2, 0.6), DVec3::new(2.9, 0.2, -0.4))
    }

    #[test]
    fn a_step_leads_to_the_pose_that_it_is_the_difference_of() {
        let step = [0.3, -0.1, 0.2, 0.01, 0.02, -0.03];
        let there = moved(&pose(), step);
        for (found, expected) in difference(&there, &pose()).iter().zip(step) {
            assert!((found - expected).abs() < 1e-12);
        }
        let turn = DVec3::new(0.3, -0.1, 0.2).length();
        assert!((rotation_between(&pose(), &there) - turn).abs() < 1e-12);
        // Three quarters of a turn one way are a quarter the other way.
        let far = moved(
            &pose(),
            [0.0, 0.0, 1.5 * std::f64::consts::PI, 0.0, 0.0, 0.0],
        );
        let back = difference(&far, &pose())[2];
        assert!((back + 0.5 * std::f64::consts::PI).abs() < 1e-12, "{back}");
    }

    #[test]
    fn derivatives_by_steps_are_what_small_steps_make() {
        const STEP: f64 = 1e-6;
        let (point_m, gradient) = (DVec3::new(0.05, -0.02, 0.03), DVec3::new(3.0, -2.0, 5.0));
        let height = |pose: DAffine3| gradient.dot(pose.transform_point3(point_m));
        let found = by_step(pose().matrix3 * point_m, gradient);
        for (k, derivative) in found.into_iter().enumerate() {
            let mut step = [0.0; 6];
            step[k] = STEP;
            let ahead = height(moved(&pose(), step));
            let behind = height(moved(&pose(), step.map(|entry| -entry)));
            assert!(((ahead - behind) / (2.0 * STEP) - derivative).abs() < 1e-8);
        }
    }
}
