//! Footage: how many markers are found in photographs of a room, how many that are not there, and how often and how far poses
//! of rendered sheets in a hand are off, beside the bare libraries. All see the same pictures.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::tracking::bare_library;
use crate::app::truth::sheets::{Light, camera_above, cube, with_noise};
use crate::app::truth::{PoseErrors, shifts_px};
use crate::capture::Frame;
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::pose::rotation_between;
use crate::scene::{Anchor, DetectorKind, Family, Marker, TrackingSettings};
use crate::tracking::focal::guessed_intrinsics;
use crate::tracking::{Detector, Status, Tracker, grey_from_rgba};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [640, 480],
    focal_px: DVec2::new(615.0, 613.0),
    center_px: DVec2::new(321.4, 238.2),
    distortion: Distortion::NONE,
};
/// Noise of the rendered pictures, levels of 255.
const NOISE: f64 = 2.0;
const FRAME_SECS: f64 = 1.0 / 30.0;
/// A pose that is turned by more than this against the truth is a flipped one, degrees.
const FLIPPED_DEG: f64 = 15.0;

/// Photographs of a room with tags on its walls, which are not shipped: where they are not, the chart goes without them.
const ROOM: &str = "../shared/real/swatbotics/mapping_feb_2014";

/// The chart.
pub struct Footage;

/// One library on one footage.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FootageRow {
    footage: String,
    library: String,
    pictures: u32,
    /// Markers that are there, or frames of an anchor that is.
    wanted: u32,
    found_pct: Option<f64>,
    /// Markers that are not there.
    invented: u32,
    flipped_pct: Option<f64>,
    shift_median_px: Option<f64>,
    jitter_px: Option<f64>,
}

const STILLS: &str = "a room";
const WEAK_TAGS: &str = "a room, tag16h5";
const WEAK_ARUCO: &str = "a room, 4X4_50";
const MARKER: &str = "marker in a hand";
const REST: &str = "marker at rest";
const BOARD: &str = "board in a hand";
const CUBE: &str = "cube in a hand";

const APRILTAG: &str = "libapriltag, decimation 1";
const ARUCO: &str = "OpenCV's ArUco, contour";
const OURS: &str = "gnomon";
const LIBRARIES: [&str; 3] = [APRILTAG, ARUCO, OURS];

fn settings(library: &str) -> TrackingSettings {
    let alone = |detector| TrackingSettings {
        detector,
        decimation: 1.0,
        ..bare_library()
    };
    match library {
        APRILTAG => alone(DetectorKind::AprilTag),
        ARUCO => alone(DetectorKind::Aruco),
        _ => TrackingSettings::default(),
    }
}

/// A photograph, and the markers that people see in it.
struct Still {
    frame: Frame,
    ids: BTreeSet<u32>,
}

fn stills(lab: &Lab<'_>) -> Result<Vec<Still>> {
    let list = Path::new(ROOM).join("groundtruth.txt");
    let text = std::fs::read_to_string(&list).with_context(|| list.display().to_string())?;
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let mut stills = Vec::new();
    for (index, line) in (0..)
        .zip(lines)
        .filter(|(k, _)| k % if lab.quick { 8 } else { 1 } == 0)
    {
        let mut words = line.split_whitespace();
        let path = Path::new(ROOM).join(words.next().unwrap_or_default());
        let picture = image::open(&path).with_context(|| path.display().to_string())?;
        let picture = picture.to_rgba8();
        stills.push(Still {
            frame: Frame {
                index,
                time_secs: f64::from(index) * FRAME_SECS,
                size_px: [picture.width(), picture.height()],
                rgba: picture.into_raw(),
            },
            ids: words.filter_map(|word| word.parse().ok()).collect(),
        });
    }
    Ok(stills)
}

/// The ids that a library reads in each still: every marker of the family is wanted.
fn read_ids(library: &str, family: Family, stills: &[Still]) -> Result<Vec<Vec<u32>>> {
    let settings = settings(library);
    let mut ids = Vec::new();
    if library != OURS {
        let mut detector = Detector::new(&settings, &[family])?;
        let mut grey = Vec::new();
        for still in stills {
            grey_from_rgba(&still.frame, &mut grey)?;
            let found = detector.detect(&grey, still.frame.size_px)?;
            ids.push(found.iter().map(|seen| seen.id).collect());
        }
        return Ok(ids);
    }
    let every =
        |size_px| Tracker::of_every_marker(&settings, (family, 0.1), guessed_intrinsics(size_px));
    let mut played: Option<Tracker> = None;
    for still in stills {
        // Strong codes are proof in any picture by itself; what weak ones are worth shows where pictures follow each other.
        let tracker = match played.take() {
            Some(tracker) if family != Family::TAG36H11 => tracker,
            _ => every(still.frame.size_px)?,
        };
        let tracker = played.insert(tracker);
        tracker.track(&still.frame)?;
        ids.push(tracker.detections().iter().map(|seen| seen.id).collect());
    }
    Ok(ids)
}

fn rows_of_stills(lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<FootageRow>>> {
    let (family, libraries): (Family, &[&str]) = match unit {
        WEAK_TAGS => (Family::TAG16H5, &LIBRARIES),
        WEAK_ARUCO => {
            let family = Family::from_name("DICT_4X4_50").context("no such family")?;
            (family, &[ARUCO, OURS])
        }
        _ => (Family::TAG36H11, &LIBRARIES),
    };
    let stills = stills(lab)?;
    let mut rows = Vec::new();
    for library in libraries {
        if lab.is_stopped() {
            return Ok(None);
        }
        let (mut wanted, mut found, mut invented) = (0, 0, 0);
        for (still, ids) in stills.iter().zip(read_ids(library, family, &stills)?) {
            let there = |id: &u32| family == Family::TAG36H11 && still.ids.contains(id);
            let unlike: BTreeSet<u32> = ids.iter().copied().filter(there).collect();
            wanted += if family == Family::TAG36H11 {
                still.ids.len()
            } else {
                0
            };
            found += unlike.len();
            invented += ids.iter().filter(|id| !there(id)).count();
        }
        rows.push(FootageRow {
            footage: unit.to_owned(),
            library: (*library).to_owned(),
            pictures: stills.len() as u32,
            wanted: wanted as u32,
            found_pct: (wanted > 0).then(|| rounded(100.0 * found as f64 / wanted as f64)),
            invented: invented as u32,
            flipped_pct: None,
            shift_median_px: None,
            jitter_px: None,
        });
    }
    Ok(Some(rows))
}

/// What is filmed, and where it is in a frame.
fn sheet(unit: &str, frame: u32) -> (Vec<Marker>, DAffine3) {
    let time_secs = f64::from(frame) * FRAME_SECS;
    let marker =
        |id, x, y| Marker::alone(Family::TAG36H11, id, 0.04).in_plane(DVec2::new(x, y), 0.0);
    let sway = |hertz: f64, phase: f64| (TAU * hertz * time_secs + phase).sin();
    let at_m = DVec3::new(
        0.04 * sway(0.5, 0.0),
        0.03 * sway(0.7, 1.0),
        0.55 + 0.1 * sway(0.3, 2.0),
    );
    // Nearly frontal now and then, where a plane's two poses come together.
    let in_hand = camera_above(22.0 * sway(0.4, 0.5), 50.0 * time_secs, at_m);
    match unit {
        REST => (
            vec![marker(17, 0.0, 0.0)],
            camera_above(30.0, 20.0, DVec3::new(0.01, 0.0, 0.6)),
        ),
        MARKER => (vec![marker(17, 0.0, 0.0)], in_hand),
        BOARD => {
            let places = [
                (0, -0.05, 0.035),
                (1, 0.05, 0.035),
                (2, -0.05, -0.035),
                (3, 0.05, -0.035),
            ];
            (places.map(|(id, x, y)| marker(id, x, y)).to_vec(), in_hand)
        }
        _ => {
            let turn =
                DQuat::from_rotation_x(0.9 * time_secs) * DQuat::from_rotation_y(PI * time_secs);
            (cube(), DAffine3::from_rotation_translation(turn, at_m))
        }
    }
}

fn rows_of_sheets(lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<FootageRow>>> {
    let frames = if lab.quick { 10 } else { 150 };
    let anchors = [Anchor {
        name: unit.to_owned(),
        markers: sheet(unit, 0).0,
    }];
    let trackers = LIBRARIES.map(|library| Tracker::new(&settings(library), &anchors, CAMERA));
    let [a, b, c] = trackers;
    let mut trackers = [a?, b?, c?];
    let mut errors = [(); 3].map(|()| (PoseErrors::default(), 0_u32));
    for number in 0..frames {
        if lab.is_stopped() {
            return Ok(None);
        }
        let (markers, truth) = sheet(unit, number);
        let light = Light::of_boards(&CAMERA, &[(&markers, truth)]);
        let clean = light.frame(f64::from(number) * FRAME_SECS);
        let frame = with_noise(&clean, NOISE, u64::from(number) + 1);
        for (tracker, (errors, flipped)) in trackers.iter_mut().zip(&mut errors) {
            let found = tracker.track(&frame)?;
            // What is only predicted was not found.
            let seen = |pose: &&crate::tracking::AnchorPose| {
                matches!(pose.status, Status::Tracked | Status::Ambiguous)
            };
            let found = found.first().filter(seen);
            let found = found.and_then(|pose| pose.camera_from_anchor);
            errors.add(found.map(|found| shifts_px(&CAMERA, &found, &truth)));
            let is_flipped =
                |found: &DAffine3| rotation_between(found, &truth).to_degrees() > FLIPPED_DEG;
            *flipped += u32::from(found.is_some_and(|found| is_flipped(&found)));
        }
    }
    let rows = LIBRARIES
        .iter()
        .zip(errors)
        .map(|(library, (errors, flipped))| FootageRow {
            footage: unit.to_owned(),
            library: (*library).to_owned(),
            pictures: frames,
            wanted: frames,
            found_pct: Some(rounded(errors.with_pose_pct())),
            invented: 0,
            flipped_pct: Some(rounded(100.0 * f64::from(flipped) / f64::from(frames))),
            shift_median_px: errors.shift_px(0.5).map(rounded),
            jitter_px: errors.jitter_px().map(rounded),
        });
    Ok(Some(rows.collect()))
}

impl Chart for Footage {
    const NAME: &'static str = "footage";
    const FAMILY: &'static str = "tracking";
    const SHOWS: &'static str = "What is found, what is not there, and what is wrong. A room: 72 photographs with 236 tags \
        that people counted (swatbotics/apriltag), each by itself; the same asked for markers of families with few bits, of \
        which none is there. In a hand: rendered sheets (640 x 480, noise of 2 levels, markers of 40 mm) that sway and turn for \
        five seconds, a lone one nearly frontal now and then, where its two poses come together; a cube with edges of 80 mm \
        that turns over all its faces. Found: markers, or frames with a pose. Flipped: frames whose pose is turned by more than 15 \
        degrees. Shift and jitter as in chart tracking. The libraries search each picture at full resolution; poses \
        come from their corners.";
    type Row = FootageRow;

    fn inputs(&self, _: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let room = PathBuf::from(ROOM);
        Ok(if room.is_dir() {
            vec![room]
        } else {
            Vec::new()
        })
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        let of_room = [STILLS, WEAK_TAGS, WEAK_ARUCO];
        let of_room = of_room.into_iter().filter(|_| Path::new(ROOM).is_dir());
        let units = of_room.chain([MARKER, REST, BOARD, CUBE]);
        Ok(units.map(str::to_owned).collect())
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<FootageRow>>> {
        match unit {
            STILLS | WEAK_TAGS | WEAK_ARUCO => rows_of_stills(lab, unit),
            _ => rows_of_sheets(lab, unit),
        }
    }

    fn figure(&self, rows: &[FootageRow]) -> Figure {
        type Metric = (&'static str, fn(&FootageRow) -> Option<f64>);
        let metrics: [Metric; 4] = [
            ("found, %", |row| row.found_pct),
            ("not there, markers", |row| {
                row.flipped_pct.is_none().then_some(f64::from(row.invented))
            }),
            ("flipped, % of frames", |row| row.flipped_pct),
            ("jitter, px", |row| row.jitter_px),
        ];
        let mut footage: Vec<&str> = Vec::new();
        for row in rows {
            if !footage.contains(&row.footage.as_str()) {
                footage.push(&row.footage);
            }
        }
        let panels = metrics.map(|(label, value)| {
            let shown = footage.iter().filter(|name| {
                rows.iter()
                    .any(|row| row.footage == **name && value(row).is_some())
            });
            let shown: Vec<&str> = shown.copied().collect();
            let series = LIBRARIES
                .into_iter()
                .enumerate()
                .map(|(look, library)| Series {
                    name: library.to_owned(),
                    look,
                    joined: false,
                    points: rows
                        .iter()
                        .filter(|row| row.library == library)
                        .filter_map(|row| {
                            let place = shown.iter().position(|name| *name == row.footage)?;
                            let value = value(row)?;
                            // Each is named once.
                            let name = if library == OURS {
                                row.footage.as_str()
                            } else {
                                ""
                            };
                            Some(Point::named((place + 1) as f64, value, name))
                        })
                        .collect(),
                });
            FigurePanel {
                title: label.to_owned(),
                x: Axis {
                    spans: vec![0.0, shown.len() as f64 + 1.0],
                    ..Axis::from_zero("footage")
                },
                y: Axis::from_zero(label),
                series: series.collect(),
                ..FigurePanel::default()
            }
        });
        Figure {
            title: "Footage: what is found, and what is wrong".to_owned(),
            reading: "Found: the higher the better; the rest the lower the better.".to_owned(),
            columns: 2,
            panel_size: [560.0, 320.0],
            panels: panels.into(),
        }
    }
}
