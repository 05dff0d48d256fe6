//! Learns the layout of markers from pictures of them: places at first (`placing.rs`), bundle adjustment in space
//! (`bundle.rs`), the plane that they lie in, if they do (`plane.rs`), and bundle adjustment in it.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::Detection;
use super::focal::LearntCamera;
use crate::geometry::camera::Intrinsics;
use crate::scene::{Family, Marker};
use bundle::{BoardView, Bundle, Certainty, MarkerFreedom, MarkerObservation};
use shape::{common_plane, in_space_by, lay_into};

mod bundle;
mod keyframes;
mod placing;
mod plane;
mod shape;

/// A marker in one picture alone is not believed.
const LEAST_PICTURES: usize = 2;
/// How many standard deviations off (root mean square) a marker's corners are in a picture where it is dropped.
const OUTLIER: f64 = 5.0;
/// The least distance (root mean square) of corners for which a marker is dropped, pixels.
const LEAST_OUTLIER_PX: f64 = 0.5;
/// Rounds of dropping.
const ROUNDS: usize = 4;

/// What is known beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapSettings {
    /// Side of the gauge's black square, and of all where sizes are not to be learnt; metres.
    pub size_m: f64,
    /// Id of the marker whose centre is the board's origin and whose x axis is the board's; without one, the lowest.
    pub gauge: Option<u32>,
    /// Whether the other markers' sizes are to be learnt.
    pub learns_sizes: bool,
    /// What a corner may be off the common plane, beside what the pictures leave open; metres.
    pub plane_tolerance_m: f64,
    /// Whether they lie in a plane.
    pub shape: ShapeWanted,
}

/// What a board's markers are to lie in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShapeWanted {
    /// A plane where the pictures bear that out, otherwise space.
    AsSeen,
    /// A plane; a marker off it is an error.
    Flat,
    /// Space, even where a plane would do.
    Space,
}

/// What a board's markers were found to lie in.
#[derive(Debug, Clone, PartialEq)]
pub enum BoardShape {
    /// A plane, z = 0 of the board's frame; its origin and x axis are the gauge's, laid into the plane.
    Flat,
    /// Space.
    Space {
        /// Markers off the plane of the others, and by how much their farthest corner is, metres; empty where no plane was
        /// looked for.
        off: Vec<(u32, f64)>,
        /// The board's frame.
        frame: SpaceFrame,
    },
}

/// The frame of a board in space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpaceFrame {
    /// The gauge's: origin in its middle, x to its right, y to its top, z out of its print.
    Gauge,
    /// As that of a flat board, by the plane that the gauge and most of the others lie in: a single marker's tilt is told less
    /// well.
    PlaneOfMost,
}

/// A layout, and how sure it is.
#[derive(Debug, Clone, PartialEq)]
pub struct LearntBoard {
    /// By id.
    pub markers: Vec<LearntMarker>,
    /// What they lie in.
    pub shape: BoardShape,
    /// Id of the marker that the frame goes by.
    pub gauge: u32,
    /// Pictures that it rests on.
    pub pictures: usize,
    /// Standard deviation of a corner's coordinate around where the layout puts it, pixels.
    pub noise_px: f64,
    /// Ids that only one picture shows together with others: they are left out.
    pub left_out: Vec<u32>,
}

/// A marker of a [`LearntBoard`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearntMarker {
    /// Where it is.
    pub marker: Marker,
    /// Standard deviation of its centre's coordinates, metres; 0 for the gauge.
    pub center_deviation_m: DVec3,
    /// Standard deviation of its turn, radians: in the plane, or in space about all axes together; 0 for the gauge.
    pub rotation_deviation_rad: f64,
    /// Standard deviation of its size, metres; 0 where it was given.
    pub size_deviation_m: f64,
    /// Pictures that it was learnt from.
    pub observations: usize,
    /// Pictures in which it did not fit and was dropped.
    pub dropped: usize,
    /// Root mean square distance of its corners from where the layout puts them, pixels.
    pub rms_px: f64,
    /// Its farthest corner's height above or depth below the plane, if it were not held in it, metres; 0 in space.
    pub off_plane_m: f64,
}

/// Why no layout was learnt.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum MapError {
    /// Nothing to learn.
    #[error(
        "no two markers are in {LEAST_PICTURES} pictures together; film them so that each picture shows several"
    )]
    TooFewMarkers,
    /// The gauge is not among the markers.
    #[error(
        "no picture shows the gauge, marker {gauge}, together with others; seen are {}",
        list(seen)
    )]
    NoGauge {
        /// Its id.
        gauge: u32,
        /// Ids that can be.
        seen: Vec<u32>,
    },
    /// Groups that no picture joins.
    #[error(
        "the markers do not hang together: no picture shows one of {{{}}} with one of the others; film them together",
        groups.iter().map(|group| list(group)).collect::<Vec<_>>().join("}, {")
    )]
    NotConnected {
        /// Ids, the gauge's group first.
        groups: Vec<Vec<u32>>,
    },
    /// A marker that no pose explains.
    #[error(
        "no place explains where the pictures show {}; did they move, or is the calibration another camera's?",
        list(ids)
    )]
    NoPlace {
        /// Ids.
        ids: Vec<u32>,
    },
    /// The equations do not settle.
    #[error(
        "the pictures do not determine the layout: film the markers from more sides and nearer"
    )]
    NotDetermined,
    /// Markers off the common plane.
    #[error(
        "the board is to be flat, but these markers do not lie in the plane of the others: {}",
        off_in_words(off)
    )]
    NotPlanar {
        /// Ids, and by how much their farthest corner is off, metres.
        off: Vec<(u32, f64)>,
    },
}

/// Markers, and by how much their farthest corners are off.
pub fn off_in_words(off: &[(u32, f64)]) -> String {
    let words = off
        .iter()
        .map(|(id, off_m)| format!("{id} by {:.1} mm", off_m * 1e3));
    words.collect::<Vec<_>>().join(", ")
}

fn list(ids: &[u32]) -> String {
    ids.iter()
        .map(u32::to_string)
        .collect::<Vec<_>>()
        .join(", ")
}

/// Learns the layout of the markers of one family. `pictures` holds what a detector saw in each; a marker that is there
/// twice is passed over.
///
/// # Errors
/// What the pictures lack, or that the markers do not lie in a plane.
pub fn learn_board(
    intrinsics: &Intrinsics,
    family: Family,
    pictures: &[Vec<Detection>],
    settings: &MapSettings,
) -> Result<LearntBoard, MapError> {
    Ok(learn(intrinsics, false, family, pictures, settings)?.0)
}

/// As [`learn_board`], by a camera that nobody has calibrated: it is learnt together with the layout, from about where it
/// is thought to be. (A layout learnt first, by a camera that is wrong, would bear that camera out.)
///
/// # Errors
/// As [`learn_board`].
pub fn learn_board_and_camera(
    camera: &LearntCamera,
    family: Family,
    pictures: &[Vec<Detection>],
    settings: &MapSettings,
) -> Result<(LearntBoard, LearntCamera), MapError> {
    let (board, bundle, certainty) = learn(&camera.intrinsics, true, family, pictures, settings)?;
    let views = bundle.views.len();
    let camera = LearntCamera::of_views(bundle.intrinsics, certainty.focal_deviation, views);
    Ok((board, camera))
}

/// The layout, and the adjustment that it comes from.
fn learn(
    intrinsics: &Intrinsics,
    camera_is_free: bool,
    family: Family,
    pictures: &[Vec<Detection>],
    settings: &MapSettings,
) -> Result<(LearntBoard, Bundle, Certainty), MapError> {
    let seen = BoardObservations::of(intrinsics, family, pictures);
    let BoardObservations {
        ids,
        pictures,
        left_out,
    } = seen;
    if ids.len() < 2 {
        return Err(MapError::TooFewMarkers);
    }
    let gauge = match settings.gauge {
        None => 0,
        Some(id) => ids.binary_search(&id).map_err(|_| MapError::NoGauge {
            gauge: id,
            seen: ids.clone(),
        })?,
    };
    connected(&ids, &pictures, gauge)?;
    let width_px = f64::from(intrinsics.size_px[0]);
    let pictures: Vec<Vec<MarkerObservation>> = keyframes::choose(&pictures, width_px)
        .into_iter()
        .map(|index| pictures[index].clone())
        .collect();
    let (placed, views) = placing::place(
        intrinsics,
        &pictures,
        ids.len(),
        gauge,
        settings.size_m,
        settings.learns_sizes,
    );
    let lost: Vec<u32> = (0..ids.len())
        .filter(|&marker| placed[marker].is_none())
        .map(|marker| ids[marker])
        .collect();
    if !lost.is_empty() {
        return Err(MapError::NoPlace { ids: lost });
    }
    let mut bundle = Bundle {
        intrinsics: *intrinsics,
        camera_is_free,
        markers: placed.into_iter().flatten().collect(),
        views: views.into_iter().flatten().collect(),
        gauge,
        freedom: MarkerFreedom::Space,
        sizes_are_free: settings.learns_sizes,
    };
    let mut dropped = vec![0; ids.len()];
    let (certainty, off_plane_m, shape) = adjusted(&mut bundle, &mut dropped, &ids, settings)?;
    let markers = (0..ids.len()).map(|marker| LearntMarker {
        dropped: dropped[marker],
        off_plane_m: off_plane_m[marker],
        ..bundle.learnt(marker, family, ids[marker], &certainty)
    });
    let board = LearntBoard {
        markers: markers.collect(),
        shape,
        gauge: ids[gauge],
        pictures: bundle.views.len(),
        noise_px: certainty.noise_px,
        left_out,
    };
    Ok((board, bundle, certainty))
}

/// Adjusts a bundle in space, and then in the plane that its markers have in common, if that is what it is to have: how sure it
/// is, how far each marker lies off the plane, and which shape it has. `dropped` counts what is left out of each marker.
fn adjusted(
    bundle: &mut Bundle,
    dropped: &mut [usize],
    ids: &[u32],
    settings: &MapSettings,
) -> Result<(Certainty, Vec<f64>, BoardShape), MapError> {
    let in_space = adjust_without_outliers(bundle, dropped, ids)?;
    let plane = common_plane(bundle, &in_space, settings.plane_tolerance_m);
    let is_flat = plane.as_ref().is_some_and(|plane| plane.off.is_empty());
    Ok(match (settings.shape, plane) {
        (ShapeWanted::Flat, None) => return Err(MapError::NotDetermined),
        (ShapeWanted::Flat, Some(plane)) if !is_flat => {
            let off = plane.off_by_id(ids);
            return Err(MapError::NotPlanar { off });
        }
        (ShapeWanted::Flat | ShapeWanted::AsSeen, Some(plane)) if is_flat => {
            lay_into(bundle, &plane.plane_from_world);
            bundle.freedom = MarkerFreedom::Plane;
            let certainty = adjust_without_outliers(bundle, dropped, ids)?;
            (certainty, plane.distances_m, BoardShape::Flat)
        }
        (_, plane) => {
            let mut shape = in_space_by(bundle, plane.as_ref(), ids);
            if let (ShapeWanted::Space, BoardShape::Space { off, .. }) =
                (settings.shape, &mut shape)
            {
                off.clear();
            }
            (in_space, vec![0.0; ids.len()], shape)
        }
    })
}

impl LearntBoard {
    /// This layout, larger by a factor: for a scale that is known better than from a marker's size.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        for learnt in &mut scaled.markers {
            learnt.marker = learnt.marker.stretched(factor);
            learnt.center_deviation_m *= factor;
            learnt.size_deviation_m *= factor;
            learnt.off_plane_m *= factor;
        }
        scaled
    }
}

/// What the detections come to.
struct BoardObservations {
    /// Sorted.
    ids: Vec<u32>,
    /// Markers by their index in `ids`, sorted.
    pictures: Vec<Vec<MarkerObservation>>,
    left_out: Vec<u32>,
}

impl BoardObservations {
    fn of(intrinsics: &Intrinsics, family: Family, pictures: &[Vec<Detection>]) -> Self {
        let mut by_picture: Vec<BTreeMap<u32, SeenCorners>> = pictures
            .iter()
            .map(|picture| once_seen(intrinsics, family, picture))
            .collect();
        let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
        for picture in by_picture.iter().filter(|picture| picture.len() > 1) {
            for id in picture.keys() {
                *counts.entry(*id).or_default() += 1;
            }
        }
        let left_out: Vec<u32> = counts
            .iter()
            .filter(|&(_, &count)| count < LEAST_PICTURES)
            .map(|(&id, _)| id)
            .collect();
        let ids: Vec<u32> = counts
            .into_keys()
            .filter(|id| left_out.binary_search(id).is_err())
            .collect();
        let pictures = by_picture
            .iter_mut()
            .map(|picture| {
                let seen = picture.iter().filter_map(|(id, corners)| {
                    Some(MarkerObservation {
                        marker: ids.binary_search(id).ok()?,
                        seen_px: corners.seen_px,
                        corners_px: corners.undistorted_px,
                    })
                });
                seen.collect()
            })
            .collect();
        Self {
            ids,
            pictures,
            left_out,
        }
    }
}

/// A marker's corners as a picture shows them, pixels, and undistorted.
struct SeenCorners {
    seen_px: [DVec2; 4],
    undistorted_px: [DVec2; 4],
}

/// Corners of the family's markers that a picture shows just once.
fn once_seen(
    intrinsics: &Intrinsics,
    family: Family,
    picture: &[Detection],
) -> BTreeMap<u32, SeenCorners> {
    let mut times: BTreeMap<u32, usize> = BTreeMap::new();
    for detection in picture {
        *times.entry(detection.id).or_default() += 1;
    }
    picture
        .iter()
        .filter(|detection| detection.family == family && times[&detection.id] == 1)
        .filter_map(|detection| {
            let corners = detection
                .corners_px
                .map(|corner| intrinsics.undistorted_pixel(corner));
            let [Some(a), Some(b), Some(c), Some(d)] = corners else {
                return None;
            };
            let corners = SeenCorners {
                seen_px: detection.corners_px,
                undistorted_px: [a, b, c, d],
            };
            Some((detection.id, corners))
        })
        .collect()
}

/// Refuses groups of markers that no picture joins.
fn connected(
    ids: &[u32],
    pictures: &[Vec<MarkerObservation>],
    gauge: usize,
) -> Result<(), MapError> {
    // Each marker's group, by the lowest index in it.
    let mut group: Vec<usize> = (0..ids.len()).collect();
    for picture in pictures {
        for pair in picture.windows(2) {
            let (a, b) = (group[pair[0].marker], group[pair[1].marker]);
            let (low, high) = (a.min(b), a.max(b));
            group
                .iter_mut()
                .filter(|group| **group == high)
                .for_each(|group| *group = low);
        }
    }
    let mut groups: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    for (marker, id) in ids.iter().enumerate() {
        groups.entry(group[marker]).or_default().push(*id);
    }
    if groups.len() == 1 {
        return Ok(());
    }
    let first = groups.remove(&group[gauge]).unwrap_or_default();
    Err(MapError::NotConnected {
        groups: std::iter::once(first).chain(groups.into_values()).collect(),
    })
}

/// Adjusts, drops markers from pictures in which they do not fit, and adjusts again.
fn adjust_without_outliers(
    bundle: &mut Bundle,
    dropped: &mut [usize],
    ids: &[u32],
) -> Result<Certainty, MapError> {
    for _ in 0..ROUNDS {
        let certainty = bundle.adjust().ok_or(MapError::NotDetermined)?;
        let limit_px = (OUTLIER * certainty.noise_px).max(LEAST_OUTLIER_PX);
        let whole = bundle.clone();
        let mut any = false;
        for (view, before) in bundle.views.iter_mut().zip(&whole.views) {
            view.seen.retain(|seen| {
                let fits = rms(&whole.distances_px(before, seen)) <= limit_px;
                dropped[seen.marker] += usize::from(!fits);
                any |= !fits;
                fits
            });
        }
        if !any {
            return Ok(certainty);
        }
        // A lone marker tells where its camera is, and nothing else.
        bundle.views.retain(|view| view.seen.len() > 1);
        let lost: Vec<u32> = (0..ids.len())
            .filter(|&marker| bundle.rms_px(marker).1 == 0)
            .map(|marker| ids[marker])
            .collect();
        if !lost.is_empty() {
            return Err(MapError::NoPlace { ids: lost });
        }
        let pictures: Vec<Vec<MarkerObservation>> =
            bundle.views.iter().map(|view| view.seen.clone()).collect();
        connected(ids, &pictures, bundle.gauge)?;
    }
    bundle.adjust().ok_or(MapError::NotDetermined)
}

fn rms(distances_px: &[f64]) -> f64 {
    let squares: f64 = distances_px
        .iter()
        .map(|distance| distance * distance)
        .sum();
    (squares / distances_px.len() as f64).sqrt()
}

impl Bundle {
    /// What an adjustment tells of a marker.
    fn learnt(
        &self,
        marker: usize,
        family: Family,
        id: u32,
        certainty: &Certainty,
    ) -> LearntMarker {
        let [rx, ry, rz, x, y, z, size] = certainty.deviations[marker];
        let placed = &self.markers[marker];
        let (rms_px, observations) = self.rms_px(marker);
        LearntMarker {
            marker: Marker {
                family,
                id,
                size_m: placed.size_m,
                anchor_from_marker: placed.world_from_marker,
            },
            center_deviation_m: DVec3::new(x, y, z),
            rotation_deviation_rad: DVec3::new(rx, ry, rz).length(),
            size_deviation_m: size * placed.size_m,
            observations,
            dropped: 0,
            rms_px,
            off_plane_m: 0.0,
        }
    }

    /// The root mean square distance of a marker's corners, pixels, and the number of views that see it.
    fn rms_px(&self, marker: usize) -> (f64, usize) {
        let seeing =
            |view: &BoardView| view.seen.iter().find(|seen| seen.marker == marker).copied();
        let distances_px: Vec<f64> = self
            .views
            .iter()
            .filter_map(|view| Some(self.distances_px(view, &seeing(view)?)))
            .flatten()
            .collect();
        match distances_px.len() {
            0 => (0.0, 0),
            count => (rms(&distances_px), count / 4),
        }
    }
}
