//! Footage: how many markers are found in photographs of a room, how many that are not there, and how often and how far poses
//! of rendered sheets in a hand are off, beside the bare libraries. All see the same pictures.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

use anyhow::Result;
use glam::{DAffine3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Scale, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::tracking::bare_library;
use crate::app::stages::stats::quantile;
use crate::app::truth::photographs::{
    self, Photographs, Still, TURNED_CAMERA, read_picture, turned_tag,
};
use crate::app::truth::sheets::{Light, camera_above, cube, with_noise};
use crate::app::truth::{PoseErrors, shifts_px};
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

/// The chart.
pub struct Footage;

/// One library on one footage.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
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

/// A tag that a hand put down in steps of 10°, from -70° to 70°.
const TURNED: &str = "a turned tag";
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

/// The ids that a library reads in each picture: every marker of the family is wanted.
fn read_ids(library: &str, footage: &Photographs, stills: &[Still]) -> Result<Vec<Vec<u32>>> {
    let settings = settings(library);
    let family = footage.family()?;
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
        let tracker = match played.take() {
            Some(tracker) if footage.plays_on() => tracker,
            _ => every(still.frame.size_px)?,
        };
        let tracker = played.insert(tracker);
        tracker.track(&still.frame)?;
        ids.push(tracker.detections().iter().map(|seen| seen.id).collect());
    }
    Ok(ids)
}

fn rows_of_photographs(lab: &Lab<'_>, footage: &Photographs) -> Result<Option<Vec<FootageRow>>> {
    let mut stills = footage.read()?;
    if lab.quick {
        stills.truncate(9);
    }
    let wanted: usize = stills.iter().map(|still| still.ids.len()).sum();
    let mut rows = Vec::new();
    for library in LIBRARIES {
        if lab.is_stopped() {
            return Ok(None);
        }
        if library == APRILTAG && !footage.is_read_by_libapriltag() {
            continue;
        }
        let (mut found, mut invented) = (0, 0);
        for (still, ids) in stills.iter().zip(read_ids(library, footage, &stills)?) {
            let unlike: BTreeSet<u32> = ids.iter().copied().collect();
            found += unlike.intersection(&still.ids).count();
            let is_there = |id: &u32| still.ids.contains(id) || still.besides.contains(id);
            invented += ids.iter().filter(|id| !is_there(id)).count();
        }
        rows.push(FootageRow {
            footage: footage.name.to_owned(),
            library: library.to_owned(),
            pictures: stills.len() as u32,
            wanted: wanted as u32,
            found_pct: (wanted > 0).then(|| rounded(100.0 * found as f64 / wanted as f64)),
            invented: invented as u32,
            ..FootageRow::default()
        });
    }
    Ok(Some(rows))
}

/// How often a lone tag's pose is turned the wrong way in photographs of it.
fn rows_of_the_turned(lab: &Lab<'_>) -> Result<Option<Vec<FootageRow>>> {
    let anchors = [Anchor {
        name: TURNED.to_owned(),
        markers: vec![Marker::alone(Family::TAG36H11, 76, 0.065)],
    }];
    let mut rows = Vec::new();
    for library in LIBRARIES {
        let mut excess_deg = Vec::new();
        for (stated_deg, path) in turned_tag() {
            if lab.is_stopped() {
                return Ok(None);
            }
            let picture = read_picture(&path)?;
            let mut tracker = Tracker::new(&settings(library), &anchors, TURNED_CAMERA)?;
            let poses = tracker.track(&picture)?;
            let pose = poses.first().and_then(|pose| pose.camera_from_anchor);
            excess_deg.extend(pose.map(|pose| {
                let normal = pose.matrix3.z_axis;
                normal.x.atan2(-normal.z).to_degrees() - stated_deg
            }));
        }
        // The hand that put it down left a constant of 2° to 3°.
        let constant_deg = quantile(&excess_deg, 0.5);
        let is_flipped = |excess: &&f64| (**excess - constant_deg).abs() > FLIPPED_DEG;
        let flipped = excess_deg.iter().filter(is_flipped).count();
        let wanted = turned_tag().count();
        let pct = |count: usize, of: usize| rounded(100.0 * count as f64 / of.max(1) as f64);
        rows.push(FootageRow {
            footage: TURNED.to_owned(),
            library: library.to_owned(),
            pictures: wanted as u32,
            wanted: wanted as u32,
            found_pct: Some(pct(excess_deg.len(), wanted)),
            flipped_pct: Some(pct(flipped, excess_deg.len())),
            ..FootageRow::default()
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

/// The photographs that are there.
fn photographs() -> impl Iterator<Item = &'static Photographs> {
    photographs::ALL
        .iter()
        .filter(|footage| footage.place().exists())
}

impl Chart for Footage {
    const NAME: &'static str = "footage";
    const FAMILY: &'static str = "tracking";
    const SHOWS: &'static str = "What is found, what is not there, and what is wrong, each picture by itself but for films and \
        markers of few bits. Photographs of others: a room with 236 tags that people counted (72 pictures), a clipboard of 30 \
        small tags in several lights, a hallway (swatbotics/apriltag); road signs on a table and a tag that is turned from -70 to \
        70 degrees (duckietown/lib-dt-apriltags); a calibration grid with borders of two cells (chutsu/yac), which libapriltag \
        does not read; OpenCV's tutorials. Asked for where none is: markers of families with few bits in the same room, and in a \
        film of a wall. In a hand: rendered sheets (640 x 480, noise of 2 levels, markers of 40 mm) that sway and turn for \
        five seconds, a lone one nearly frontal now and then, where its two poses come together; a cube with edges of 80 mm \
        that turns over all its faces. Found: markers, or frames with a pose. Flipped: frames whose pose is turned by more than 15 \
        degrees. Shift and jitter as in chart tracking. The libraries search each picture at full resolution; poses \
        come from their corners.";
    type Row = FootageRow;

    fn inputs(&self, _: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let mut places: Vec<PathBuf> = photographs().map(Photographs::place).collect();
        places.extend(turned_tag().map(|(_, path)| path));
        places.sort();
        places.dedup();
        Ok(places)
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        let turned = turned_tag().next().map(|_| TURNED);
        let of_others = photographs().map(|footage| footage.name).chain(turned);
        let units = of_others.chain([MARKER, REST, BOARD, CUBE]);
        Ok(units.map(str::to_owned).collect())
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<FootageRow>>> {
        if unit == TURNED {
            return rows_of_the_turned(lab);
        }
        match photographs().find(|footage| footage.name == unit) {
            Some(footage) => rows_of_photographs(lab, footage),
            None => rows_of_sheets(lab, unit),
        }
    }

    fn figure(&self, rows: &[FootageRow]) -> Figure {
        type Metric = (&'static str, &'static str, fn(&FootageRow) -> Option<f64>);
        let metrics: [Metric; 4] = [
            ("Found", "% of what is there", |row| row.found_pct),
            ("Not there", "markers that are read where none is", |row| {
                row.flipped_pct.is_none().then_some(f64::from(row.invented))
            }),
            ("Flipped", "% of poses", |row| row.flipped_pct),
            ("Jitter", "px", |row| row.jitter_px),
        ];
        let panels = metrics.map(|(title, label, value)| {
            let mut shown: Vec<String> = Vec::new();
            for row in rows.iter().filter(|row| value(row).is_some()) {
                if !shown.contains(&row.footage) {
                    shown.push(row.footage.clone());
                }
            }
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
                            Some(Point::at(value(row)?, place as f64))
                        })
                        .collect(),
                });
            FigurePanel {
                title: title.to_owned(),
                series: series.collect(),
                x: Axis::from_zero(label),
                y: Axis {
                    label: String::new(),
                    scale: Scale::Names(shown),
                    spans: Vec::new(),
                },
                ..FigurePanel::default()
            }
        });
        Figure {
            title: "Footage: what is found, and what is wrong".to_owned(),
            reading: "Found: the higher the better; the rest the lower the better.".to_owned(),
            columns: 2,
            panel_size: [560.0, 420.0],
            panels: panels.into(),
        }
    }
}
