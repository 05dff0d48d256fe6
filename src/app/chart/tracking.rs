//! Tracking: time per frame against how far the pose is off, how much it trembles and how often there is one, of gnomon's
//! ways and of the bare libraries. All see the same frame in turn, so that what else the machine does meets them alike.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series, pareto_front};
use super::lab::Lab;
use super::measured::rounded;
use crate::app::stages::source::{self, CalibrationNamed};
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::app::truth::{PoseErrors, TruePoses, shifts_px};
use crate::capture::FrameSource;
use crate::scene::{ArucoRefinement, DetectorKind, SearchArea, TrackingSettings};
use crate::tracking::{Status, Tracker};

/// Frames of a recording that `--quick` looks at.
const QUICK_FRAMES: u32 = 15;

/// The chart.
pub struct Tracking;

/// One way to track one anchor of one recording.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TrackingRow {
    recording: String,
    anchor: String,
    library: String,
    setting: String,
    frames: u32,
    with_pose_pct: f64,
    markers_mean: f64,
    shift_median_px: Option<f64>,
    shift_p95_px: Option<f64>,
    jitter_px: Option<f64>,
    frame_median_ms: f64,
    frame_p95_ms: f64,
}

/// A library, what is set in it, and as what.
struct TrackingWay {
    library: &'static str,
    setting: &'static str,
    settings: TrackingSettings,
}

const APRILTAG: &str = "libapriltag, by decimation";
const ARUCO: &str = "OpenCV's ArUco, by corner refinement";
const OURS: &str = "gnomon";

/// What a program does that only calls a library: its corners, found anew in each picture, and a pose from them.
pub fn bare_library() -> TrackingSettings {
    TrackingSettings {
        search: SearchArea::Full,
        pose_from_pixels: false,
        filter: false,
        refine_edges: false,
        library_edges: true,
        ..TrackingSettings::default()
    }
}

fn ways() -> Vec<TrackingWay> {
    let bare = bare_library();
    let april = |setting, decimation| TrackingWay {
        library: APRILTAG,
        setting,
        settings: TrackingSettings {
            decimation,
            ..bare.clone()
        },
    };
    let aruco = |setting, aruco_refinement| TrackingWay {
        library: ARUCO,
        setting,
        settings: TrackingSettings {
            detector: DetectorKind::Aruco,
            aruco_refinement,
            ..bare.clone()
        },
    };
    let ours = |setting, search, pose_from_pixels, filter| TrackingWay {
        library: OURS,
        setting,
        settings: TrackingSettings {
            search,
            pose_from_pixels,
            filter,
            ..TrackingSettings::default()
        },
    };
    vec![
        april("1", 1.0),
        april("1.5", 1.5),
        april("2", 2.0),
        aruco("none", ArucoRefinement::None),
        aruco("contour", ArucoRefinement::Contour),
        aruco("apriltag", ArucoRefinement::AprilTag),
        ours("corners", SearchArea::Full, false, false),
        ours("pixels", SearchArea::Full, true, false),
        ours("followed", SearchArea::Near, true, false),
        ours("filtered", SearchArea::Near, true, true),
    ]
}

impl Chart for Tracking {
    const NAME: &'static str = "tracking";
    const FAMILY: &'static str = "tracking";
    const SHOWS: &'static str = "Time per frame against the pose's error: shift is how far the pose moves four places \
        about the anchor in the picture, jitter how much that changes from frame to frame. The bare libraries give \
        corners, from which the pose of the whole board is solved; gnomon's ways add to each other: corners fitted again, \
        the pose from all edge pixels, the last place looked at first, the filter. The line is the Pareto front.";
    type Row = TrackingRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        lab.recording_inputs()
    }

    fn units(&self, lab: &Lab<'_>) -> Result<Vec<String>> {
        lab.recording_names()
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<TrackingRow>>> {
        let recording = lab.recording(unit)?;
        let scene = recording.load_scene()?;
        let truth = TruePoses::read(&recording.folder)?;
        let ways = ways();
        let mut tallies: Vec<WayTally> = ways
            .iter()
            .map(|_| WayTally::new(scene.anchors.len()))
            .collect();
        for round in 0..lab.rounds().min(3) {
            let (mut source, intrinsics) =
                source::open_calibrated(&scene.camera, CalibrationNamed::ByKey)?;
            let trackers = ways
                .iter()
                .map(|way| Tracker::new(&way.settings, &scene.anchors, intrinsics));
            let mut trackers = trackers.collect::<Result<Vec<_>, _>>()?;
            while let Some(frame) = next_frame(lab, &mut source)? {
                if lab.is_stopped() {
                    return Ok(None);
                }
                let true_poses = truth.camera_from_anchors(frame.index, &scene.anchors)?;
                let frame_number = frame.index as usize;
                for turn in 0..ways.len() {
                    // Whoever comes first finds the picture out of the cache.
                    let way = (turn + frame_number + round) % ways.len();
                    let (poses, ms) = Stopwatch::time(|| trackers[way].track(&frame));
                    let poses = poses.with_context(|| format!("{unit}, frame {}", frame.index))?;
                    let tally = &mut tallies[way];
                    tally.add_time(frame_number, ms);
                    if round > 0 {
                        continue;
                    }
                    for (anchor, pose) in poses.iter().enumerate() {
                        let found = pose
                            .camera_from_anchor
                            .filter(|_| pose.status != Status::Lost);
                        tally.errors[anchor].add(
                            found.map(|found| shifts_px(&intrinsics, &found, &true_poses[anchor])),
                        );
                        tally.markers[anchor] += pose.markers;
                    }
                }
            }
        }
        let rows = ways.iter().zip(&tallies).flat_map(|(way, tally)| {
            let anchors = scene.anchors.iter().zip(&tally.errors).zip(&tally.markers);
            anchors.map(|((anchor, errors), &markers)| {
                let frames = tally.least_ms.len();
                TrackingRow {
                    recording: unit.to_owned(),
                    anchor: anchor.name.clone(),
                    library: way.library.to_owned(),
                    setting: way.setting.to_owned(),
                    frames: frames as u32,
                    with_pose_pct: rounded(errors.with_pose_pct()),
                    markers_mean: rounded(f64::from(markers) / frames.max(1) as f64),
                    shift_median_px: errors.shift_px(0.5).map(rounded),
                    shift_p95_px: errors.shift_px(0.95).map(rounded),
                    jitter_px: errors.jitter_px().map(rounded),
                    frame_median_ms: rounded(quantile(&tally.least_ms, 0.5)),
                    frame_p95_ms: rounded(quantile(&tally.least_ms, 0.95)),
                }
            })
        });
        Ok(Some(rows.collect()))
    }

    fn figure(&self, rows: &[TrackingRow]) -> Figure {
        let mut places: Vec<(&str, &str)> = Vec::new();
        for row in rows {
            let place = (row.recording.as_str(), row.anchor.as_str());
            if !places.contains(&place) {
                places.push(place);
            }
        }
        type Metric = (&'static str, fn(&TrackingRow) -> Option<f64>);
        let metrics: [Metric; 3] = [
            ("shift, median, px", |row| row.shift_median_px),
            ("shift, 95 % of frames, px", |row| row.shift_p95_px),
            ("jitter, px", |row| row.jitter_px),
        ];
        let mut panels = Vec::new();
        for (label, value) in metrics {
            for &(recording, anchor) in &places {
                let here = |row: &&TrackingRow| row.recording == recording && row.anchor == anchor;
                let point = |row: &TrackingRow| Some([row.frame_median_ms, value(row)?]);
                let series = [APRILTAG, ARUCO, OURS].into_iter().enumerate();
                panels.push(FigurePanel {
                    title: format!("{recording}: {anchor}"),
                    x: Axis::log("time per frame, ms"),
                    y: Axis::log(label),
                    series: series
                        .map(|(look, library)| Series {
                            name: library.to_owned(),
                            look,
                            joined: false,
                            points: rows
                                .iter()
                                .filter(here)
                                .filter(|row| row.library == library)
                                .filter_map(|row| {
                                    let [x, y] = point(row)?;
                                    Some(Point::named(x, y, &label_of(row)))
                                })
                                .collect(),
                        })
                        .collect(),
                    front: pareto_front(rows.iter().filter(here).filter_map(point)),
                    ..FigurePanel::default()
                });
            }
        }
        Figure {
            title: "Tracking: what a pose costs and how good it is".to_owned(),
            reading: "The lower and the farther left the better; a percentage is the frames with a pose, where not all \
                      have one."
                .to_owned(),
            columns: places.len().max(1),
            panel_size: [460.0, 320.0],
            panels,
        }
    }
}

/// A setting, and how often it gives a pose where that is not always.
fn label_of(row: &TrackingRow) -> String {
    if row.with_pose_pct == 100.0 {
        row.setting.clone()
    } else {
        format!("{} ({:.0} %)", row.setting, row.with_pose_pct)
    }
}

fn next_frame(lab: &Lab<'_>, source: &mut FrameSource) -> Result<Option<crate::capture::Frame>> {
    let frame = source.next_frame()?;
    Ok(frame.filter(|frame| !lab.quick || frame.index < QUICK_FRAMES))
}

/// All that is gathered of one way.
struct WayTally {
    /// Of each frame the least of all rounds: nothing takes less than it needs.
    least_ms: Vec<f64>,
    /// By anchor.
    errors: Vec<PoseErrors>,
    /// By anchor, of all frames.
    markers: Vec<u32>,
}

impl WayTally {
    fn new(anchors: usize) -> Self {
        Self {
            least_ms: Vec::new(),
            errors: vec![PoseErrors::default(); anchors],
            markers: vec![0; anchors],
        }
    }

    fn add_time(&mut self, frame: usize, ms: f64) {
        if self.least_ms.len() <= frame {
            self.least_ms.resize(frame + 1, f64::INFINITY);
        }
        self.least_ms[frame] = self.least_ms[frame].min(ms);
    }
}
