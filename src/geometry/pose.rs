//! Rigid poses as `DAffine3`, and OpenCV's Rodrigues vectors.

use glam::{DAffine3, DQuat, DVec3};

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
}
