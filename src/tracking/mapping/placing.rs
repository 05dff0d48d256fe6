//! First places of markers and cameras, from the gauge marker outwards: what bundle adjustment starts from.
//!
//! A lone square has two poses that explain its picture about equally well; the wrong one of them differs from picture
//! to picture, the right one does not. So each new marker is put where one picture says, and the other pictures vote.

use glam::{DAffine3, DVec3};

use super::super::pose::{self, CornerObservation};
use super::bundle::{BoardView, MarkerObservation, PlacedMarker, UNIT_CORNERS};
use crate::geometry::camera::Intrinsics;

/// The most pictures that say where a new marker may be.
const SAYING: usize = 6;
/// The most pictures that vote on where a new marker is.
const VOTING: usize = 12;
/// A picture that does not agree at all has no more to say than this, pixels (root mean square).
const DISAGREES_PX: f64 = 8.0;
/// The number of placed markers in a picture of which both poses are tried.
const STARTS: usize = 2;
/// So many placed markers settle a picture's camera; one more does not move it.
const SETTLED: usize = 3;

/// A picture with both poses of each lone marker in it.
struct BoardPicture<'a> {
    seen: &'a [MarkerObservation],
    /// The poses (camera_from_marker) of each marker seen alone, the better one first.
    lone: Vec<Vec<DAffine3>>,
}

/// Markers and the views that see at least one of them, with the gauge at the origin. A marker that cannot be placed is
/// `None`. Without `sizes_are_free` all have the size of the gauge; with it, the size that they would have if they lay in
/// its plane.
pub(super) fn place(
    intrinsics: &Intrinsics,
    pictures: &[Vec<MarkerObservation>],
    markers: usize,
    gauge: usize,
    size_m: f64,
    sizes_are_free: bool,
) -> (Vec<Option<PlacedMarker>>, Vec<Option<BoardView>>) {
    let pictures: Vec<BoardPicture> = pictures
        .iter()
        .map(|seen| BoardPicture {
            seen,
            lone: seen
                .iter()
                .map(|seen| lone_poses(intrinsics, seen, size_m))
                .collect(),
        })
        .collect();
    let mut placing = Placing {
        intrinsics,
        pictures,
        size_m,
        placed: vec![None; markers],
    };
    placing.placed[gauge] = Some(PlacedMarker {
        world_from_marker: DAffine3::IDENTITY,
        size_m,
    });
    let mut given_up = vec![false; markers];
    while let Some(marker) = placing.next(&given_up) {
        placing.placed[marker] = placing.place_next(marker, sizes_are_free);
        given_up[marker] = placing.placed[marker].is_none();
    }
    let views = placing
        .pictures
        .iter()
        .map(|picture| {
            let (camera_from_world, _) = placing.camera(picture, None)?;
            Some(BoardView {
                camera_from_world,
                seen: picture.seen.to_vec(),
            })
        })
        .collect();
    (placing.placed, views)
}

fn lone_poses(intrinsics: &Intrinsics, seen: &MarkerObservation, size_m: f64) -> Vec<DAffine3> {
    let observations: [CornerObservation; 4] = std::array::from_fn(|corner| CornerObservation {
        point_m: UNIT_CORNERS[corner] * size_m,
        pixel: seen.corners_px[corner],
    });
    let Some(solutions) = pose::solve(intrinsics, &observations) else {
        return Vec::new();
    };
    let both = std::iter::once(solutions.best).chain(solutions.alternative);
    both.map(|solution| solution.camera_from_anchor).collect()
}

/// A picture that judges where a marker may be.
struct Voter<'a> {
    picture: &'a BoardPicture<'a>,
    /// The index of the marker in the picture.
    at: usize,
    /// Where the markers that are placed settle it.
    camera_from_world: Option<DAffine3>,
}

struct Placing<'a> {
    intrinsics: &'a Intrinsics,
    pictures: Vec<BoardPicture<'a>>,
    /// The size of markers that the lone poses are for, metres.
    size_m: f64,
    placed: Vec<Option<PlacedMarker>>,
}

impl Placing<'_> {
    /// The marker that most pictures show together with placed ones.
    fn next(&self, given_up: &[bool]) -> Option<usize> {
        let mut together = vec![0; self.placed.len()];
        for picture in &self.pictures {
            let known = picture
                .seen
                .iter()
                .filter(|seen| self.placed[seen.marker].is_some())
                .count();
            for seen in picture.seen {
                together[seen.marker] += known;
            }
        }
        (0..self.placed.len())
            .filter(|&marker| self.placed[marker].is_none() && !given_up[marker])
            .filter(|&marker| together[marker] > 0)
            .max_by_key(|&marker| (together[marker], std::cmp::Reverse(marker)))
    }

    fn place_next(&self, marker: usize, sizes_are_free: bool) -> Option<PlacedMarker> {
        let mut showing: Vec<(&BoardPicture, usize)> = self
            .pictures
            .iter()
            .filter(|picture| {
                picture
                    .seen
                    .iter()
                    .any(|seen| self.placed[seen.marker].is_some())
            })
            .filter_map(|picture| {
                let at = picture.seen.iter().position(|seen| seen.marker == marker)?;
                Some((picture, at))
            })
            .collect();
        // Large in the picture, so seen well; equally large ones stay in the pictures' order.
        showing.sort_by(|a, b| area_px(b.0, b.1).total_cmp(&area_px(a.0, a.1)));
        let voting: Vec<(&BoardPicture, usize)> = showing
            .iter()
            .step_by(1 + showing.len() / VOTING)
            .copied()
            .collect();
        let mut sizes_m = vec![self.size_m];
        if sizes_are_free {
            // Upright to the gauge it has no size in the gauge's plane that means anything.
            sizes_m.extend(self.size_in_plane(&voting));
            sizes_m.extend(self.size_by_views(&voting));
        }
        let voters: Vec<Voter> = voting
            .iter()
            .map(|&(picture, at)| {
                let known = picture
                    .seen
                    .iter()
                    .filter(|seen| self.placed[seen.marker].is_some());
                let settled = known.count() >= SETTLED;
                Voter {
                    picture,
                    at,
                    camera_from_world: settled
                        .then(|| Some(self.camera(picture, None)?.0))
                        .flatten(),
                }
            })
            .collect();
        let mut best: Option<(f64, PlacedMarker)> = None;
        for (picture, at) in showing.iter().take(SAYING) {
            for hypothesis in self.hypotheses(picture, *at, &sizes_m) {
                let against: f64 = voters
                    .iter()
                    .map(|voter| self.against(voter, marker, &hypothesis).powi(2))
                    .sum();
                if best.as_ref().is_none_or(|(least, _)| against < *least) {
                    best = Some((against, hypothesis));
                }
            }
        }
        best.map(|(_, placed)| placed)
    }

    /// Where a marker may be by one picture that shows it, if it is of one of the sizes.
    fn hypotheses(&self, picture: &BoardPicture, at: usize, sizes_m: &[f64]) -> Vec<PlacedMarker> {
        let Some((camera_from_world, _)) = self.camera(picture, None) else {
            return Vec::new();
        };
        let mut cameras = self.starts(picture);
        cameras.push(camera_from_world);
        let mut hypotheses = Vec::new();
        for &size_m in sizes_m {
            let grown = size_m / self.size_m;
            for lone in &picture.lone[at] {
                let camera_from_marker =
                    DAffine3::from_mat3_translation(lone.matrix3, lone.translation * grown);
                hypotheses.extend(cameras.iter().map(|camera_from_world| PlacedMarker {
                    world_from_marker: camera_from_world.inverse() * camera_from_marker,
                    size_m,
                }));
            }
        }
        hypotheses
    }

    /// How far a picture shows a marker from where it is thought to be, pixels (root mean square).
    fn against(&self, voter: &Voter, marker: usize, hypothesis: &PlacedMarker) -> f64 {
        let rms_px = match &voter.camera_from_world {
            Some(camera_from_world) => {
                let squares = (hypothesis.corners_m().into_iter())
                    .zip(voter.picture.seen[voter.at].corners_px)
                    .map(|(point_m, pixel)| {
                        let in_camera_m = camera_from_world.transform_point3(point_m);
                        let expected_px = self.intrinsics.undistorted_pixel_of(in_camera_m)?;
                        Some(expected_px.distance_squared(pixel))
                    });
                squares
                    .sum::<Option<f64>>()
                    .map(|squares| (squares / 4.0).sqrt())
            }
            None => self
                .camera(voter.picture, Some((marker, hypothesis)))
                .map(|(_, rms_px)| rms_px),
        };
        rms_px.map_or(DISAGREES_PX, |rms_px| rms_px.min(DISAGREES_PX))
    }

    /// The side with which all pictures put a marker's middle in one place, by least squares: what it says of the marker's
    /// distance from a camera, the others' places say of that camera.
    fn size_by_views(&self, showing: &[(&BoardPicture, usize)]) -> Option<f64> {
        // Both poses of a lone marker have its middle in about the same place.
        let ways: Vec<(DVec3, DVec3)> = showing
            .iter()
            .filter_map(|(picture, at)| {
                let (camera_from_world, _) = self.camera(picture, None)?;
                let world_from_camera = camera_from_world.inverse();
                let middle_m = picture.lone[*at].first()?.translation;
                Some((
                    world_from_camera.translation,
                    world_from_camera.transform_vector3(middle_m),
                ))
            })
            .collect();
        let count = ways.len() as f64;
        let eye_m = ways.iter().map(|way| way.0).sum::<DVec3>() / count;
        let way_m = ways.iter().map(|way| way.1).sum::<DVec3>() / count;
        let (mut along, mut squares) = (0.0, 0.0);
        for (eye, way) in &ways {
            along += (*way - way_m).dot(*eye - eye_m);
            squares += (*way - way_m).length_squared();
        }
        let grown = -along / squares;
        (grown.is_finite() && grown > 0.0).then_some(grown * self.size_m)
    }

    /// The side that a marker has if it lies in the plane of the gauge: the median over its pictures.
    fn size_in_plane(&self, showing: &[(&BoardPicture, usize)]) -> Option<f64> {
        let mut sizes_m: Vec<f64> = showing
            .iter()
            .filter_map(|(picture, at)| {
                let (camera_from_world, _) = self.camera(picture, None)?;
                let world_from_camera = camera_from_world.inverse();
                let eye_m = world_from_camera.translation;
                let corners_m = picture.seen[*at].corners_px.map(|pixel| {
                    let ray = self.intrinsics.plane_from_pixel(pixel).extend(1.0);
                    let ray = world_from_camera.transform_vector3(ray);
                    eye_m - ray * (eye_m.z / ray.z)
                });
                let around_m: f64 = (0..4)
                    .map(|corner| corners_m[corner].distance(corners_m[(corner + 1) % 4]))
                    .sum();
                (around_m.is_finite() && around_m > 0.0).then_some(around_m / 4.0)
            })
            .collect();
        sizes_m.sort_by(f64::total_cmp);
        sizes_m.get(sizes_m.len() / 2).copied()
    }

    /// Poses of the camera that the largest placed markers in a picture say.
    fn starts(&self, picture: &BoardPicture) -> Vec<DAffine3> {
        let mut known: Vec<usize> = (0..picture.seen.len())
            .filter(|&at| self.placed[picture.seen[at].marker].is_some())
            .collect();
        known.sort_by(|&a, &b| area_px(picture, b).total_cmp(&area_px(picture, a)));
        let mut starts = Vec::new();
        for at in known.into_iter().take(STARTS) {
            let Some(placed) = &self.placed[picture.seen[at].marker] else {
                continue;
            };
            let marker_from_world = placed.world_from_marker.inverse();
            let grown = placed.size_m / self.size_m;
            starts.extend(picture.lone[at].iter().map(|lone| {
                DAffine3::from_mat3_translation(lone.matrix3, lone.translation * grown)
                    * marker_from_world
            }));
        }
        starts
    }

    /// The camera that explains the placed markers in a picture best, with one more marker where it is thought to be,
    /// and the root mean square of what is left, pixels.
    fn camera(
        &self,
        picture: &BoardPicture,
        more: Option<(usize, &PlacedMarker)>,
    ) -> Option<(DAffine3, f64)> {
        let mut points = Vec::new();
        for seen in picture.seen {
            let placed = match more {
                Some((marker, placed)) if marker == seen.marker => Some(placed),
                _ => self.placed[seen.marker].as_ref(),
            };
            if let Some(placed) = placed {
                let corners = placed.corners_m().into_iter().zip(seen.corners_px);
                points.extend(corners.map(|(point_m, pixel)| CornerObservation { point_m, pixel }));
            }
        }
        self.starts(picture)
            .into_iter()
            .filter_map(|start| pose::refine_roughly(self.intrinsics, &points, start))
            .min_by(|a, b| a.squared_error_px.total_cmp(&b.squared_error_px))
            .map(|found| (found.camera_from_anchor, found.rms_px(points.len())))
    }
}

fn area_px(picture: &BoardPicture, at: usize) -> f64 {
    let [a, b, c, d] = picture.seen[at].corners_px;
    0.5 * (c - a).perp_dot(d - b).abs()
}
