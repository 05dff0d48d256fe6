//! The flat parts of a board: sheets of paper on a cube, on walls, or the one that it is.

use glam::DAffine3;

use super::Marker;

/// What a sheet on cardboard may be off its plane, as a part of the marker's side.
const EVEN: f64 = 1e-3;

/// Markers of a board that lie in one plane and face the same way.
#[derive(Debug, Clone, PartialEq)]
pub struct Face {
    /// Its plane is z = 0, its markers face up; the anchor's own frame where they lie in its plane.
    pub anchor_from_face: DAffine3,
    /// In the face's frame; at least one.
    pub markers: Vec<Marker>,
}

impl Face {
    /// The faces of a board, in the order of their first markers. One that is not in the anchor's plane has its first
    /// marker's frame.
    pub fn all_of(markers: &[Marker]) -> Vec<Self> {
        let mut faces: Vec<Self> = Vec::new();
        for marker in markers {
            let face = faces.iter_mut().find_map(|face| {
                let placed = face.placed(marker)?;
                Some((face, placed))
            });
            match face {
                Some((face, placed)) => face.markers.push(placed),
                None => faces.push(Self::beginning_with(marker)),
            }
        }
        faces
    }

    fn beginning_with(marker: &Marker) -> Self {
        if marker.is_in_plane() {
            return Self {
                anchor_from_face: DAffine3::IDENTITY,
                markers: vec![*marker],
            };
        }
        Self {
            anchor_from_face: marker.anchor_from_marker,
            markers: vec![Marker {
                anchor_from_marker: DAffine3::IDENTITY,
                ..*marker
            }],
        }
    }

    /// The marker in the face's frame, laid into its plane; `None` where it lies in another.
    fn placed(&self, marker: &Marker) -> Option<Marker> {
        let in_face = Marker {
            anchor_from_marker: self.anchor_from_face.inverse() * marker.anchor_from_marker,
            ..*marker
        };
        let corners_m = in_face.corners_m();
        let farthest_m = corners_m.map(|corner_m| corner_m.z.abs());
        let farthest_m = farthest_m.into_iter().fold(0.0, f64::max);
        let lies_in = farthest_m < EVEN * marker.size_m && in_face.normal().z > 0.0;
        if marker.is_in_plane() && self.anchor_from_face == DAffine3::IDENTITY {
            return Some(*marker);
        }
        lies_in.then(|| in_face.in_plane(in_face.center_m().truncate(), in_face.rotation_rad()))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use glam::{DQuat, DVec2, DVec3};

    use super::*;
    use crate::scene::Family;

    #[test]
    fn a_flat_board_is_one_face_and_a_cube_is_six() {
        let lone = |id| Marker::alone(Family::TAG36H11, id, 0.04);
        let flat: Vec<Marker> = (0..3)
            .map(|k| lone(k).in_plane(DVec2::new(0.1 * f64::from(k), 0.02), 0.3))
            .collect();
        let faces = Face::all_of(&flat);
        assert_eq!(faces.len(), 1);
        assert_eq!(faces[0].markers, flat);
        assert_eq!(faces[0].anchor_from_face, DAffine3::IDENTITY);

        // Two markers on each side of a cube, the second one turned.
        let turns = [
            DQuat::IDENTITY,
            DQuat::from_rotation_x(FRAC_PI_2),
            DQuat::from_rotation_x(-FRAC_PI_2),
            DQuat::from_rotation_y(FRAC_PI_2),
            DQuat::from_rotation_y(-FRAC_PI_2),
            DQuat::from_rotation_x(2.0 * FRAC_PI_2),
        ];
        let cube: Vec<Marker> = (0..12)
            .map(|id: u32| {
                let marker = lone(id).in_plane(DVec2::new(0.05 * f64::from(id % 2), 0.0), 0.4);
                let anchor_from_face = DAffine3::from_quat(turns[id as usize / 2])
                    * DAffine3::from_translation(DVec3::Z * 0.1);
                Marker {
                    anchor_from_marker: anchor_from_face * marker.anchor_from_marker,
                    ..marker
                }
            })
            .collect();
        let faces = Face::all_of(&cube);
        assert_eq!(faces.len(), 6);
        for face in &faces {
            assert_eq!(face.markers.len(), 2);
            for marker in &face.markers {
                assert!(marker.is_in_plane());
                let known = cube.iter().find(|known| known.id == marker.id).unwrap();
                let again = face.anchor_from_face * marker.anchor_from_marker;
                assert!(again.abs_diff_eq(known.anchor_from_marker, 1e-12));
            }
        }
    }
}
