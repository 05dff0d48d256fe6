//! What is left out of the scenes that ship, and what that costs in error: pictures against those of everything.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use glam::DAffine3;
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Rule, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::peers_table::{LIGHT_M, PeersStage, SIZE_PX, TORUS_CENTER_M, torus};
use super::shots::{Shots, grey_frame};
use crate::app::truth::changed_by;
use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::render::Shown;
use crate::scene::{Scene, VolumeCounting};

/// By how many pixels silhouettes may move.
const ERRORS_PX: [f64; 6] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
const DEFAULT_PX: f64 = 0.5;
const TRIANGLES: &str = "triangles";
/// The recording with soft shadows.
const ROOM: &str = "room";
/// A torus of so many triangles over the table that shadow programs are compared on.
const FINE_TORUS: &str = "torus of 100,000 triangles";
const CAPS: &str = "caps and far sides";
const SOURCES: &str = "sources";
/// How many sources get a shadow each.
const SOURCE_COUNTS: [u32; 5] = [5, 10, 20, 50, 100];

/// The chart.
pub struct LeftOut;

/// One thing left out of one recording, the mean of its key frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LeftOutRow {
    recording: String,
    left_out: String,
    max_silhouette_error_px: f64,
    /// Of soft shadows; none: all, or no such shadows.
    sources: Option<u32>,
    triangles: f64,
    of_triangles: f64,
    changed_px: f64,
    /// Over the whole picture, levels of 255.
    rms_levels: f64,
    /// Over the changed pixels.
    rms_changed_levels: f64,
    largest_levels: f64,
}

/// A composite and the triangles in it.
struct DrawnRow {
    rgba: Vec<u8>,
    triangles: f64,
}

/// A scene and the frames in which it is looked at.
struct Looks {
    scene: Scene,
    intrinsics: Intrinsics,
    frames: Vec<(Frame, Vec<Option<DAffine3>>)>,
}

impl Looks {
    fn of(lab: &Lab<'_>, unit: &str) -> Result<Self> {
        if unit == FINE_TORUS {
            let stage = PeersStage::new(
                vec![(torus(100_000, 1.0), TORUS_CENTER_M)],
                &[LIGHT_M],
                SIZE_PX,
                4,
            );
            let frame = |turn| (grey_frame(SIZE_PX), stage.poses(turn));
            return Ok(Self {
                intrinsics: stage.intrinsics,
                frames: [0, 20, 40].map(frame).to_vec(),
                scene: stage.scene,
            });
        }
        let recording = lab.recording(unit)?;
        let scene = recording.load_scene()?;
        let shots = Shots::of(lab, &recording, &scene)?;
        let frames = shots.shots.into_iter();
        Ok(Self {
            scene,
            intrinsics: shots.intrinsics,
            frames: frames
                .map(|shot| (shot.frame, shot.camera_from_anchor))
                .collect(),
        })
    }
}

fn draw(lab: &Lab<'_>, looks: &Looks) -> Result<Vec<DrawnRow>> {
    let mut renderer =
        crate::app::precomputed::renderer(Arc::clone(&lab.gpu()?), &looks.scene, looks.intrinsics)?;
    let drawn = looks.frames.iter().map(|(frame, camera_from_anchor)| {
        renderer.upload(frame)?;
        renderer.draw(camera_from_anchor, Shown::Composite);
        Ok(DrawnRow {
            rgba: renderer.read_picture()?,
            triangles: renderer.triangles() as f64,
        })
    });
    drawn.collect()
}

impl Chart for LeftOut {
    const NAME: &'static str = "left-out";
    const FAMILY: &'static str = "choosing";
    const SHOWS: &'static str = "What is not drawn, and what that changes: the key frames of the recordings, and a finely made torus over a table, with things as \
        coarse as silhouettes may move, and with volumes counted without caps where that is safe (which changes nothing), \
        against the same with all triangles and caps; and in the room, where shadows are soft, the sources that get none of \
        their own, against all. The picture's error is the root mean square over all its pixels.";
    type Row = LeftOutRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        lab.recording_inputs()
    }

    fn units(&self, lab: &Lab<'_>) -> Result<Vec<String>> {
        let mut names = lab.recording_names()?;
        if !lab.quick {
            names.push(FINE_TORUS.to_owned());
        }
        Ok(names)
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<LeftOutRow>>> {
        let mut looks = Looks::of(lab, unit)?;
        let scene = &mut looks.scene;
        scene.shadows.max_silhouette_error_px = 0.0;
        scene.shadows.counting = VolumeCounting::DepthFail;
        scene.shadows.shafts.sources = None;
        let is_soft = scene.chosen_technique().0.has_shafts();
        let step = lab.step();
        let all = draw(lab, &looks)?;
        let mut ways = Vec::new();
        if !is_soft {
            ways.push((CAPS, 0.0, VolumeCounting::Auto, None));
        }
        // Many shadows take a while, too long for a look at what triangles do to soft ones.
        if !(is_soft && lab.quick) {
            let errors_px = ERRORS_PX.iter().skip(step - 1).step_by(step);
            let way = |&error_px: &f64| (TRIANGLES, error_px, VolumeCounting::DepthFail, None);
            ways.extend(errors_px.map(way));
        }
        if is_soft {
            let counts = SOURCE_COUNTS.iter().skip(step - 1).step_by(step);
            ways.extend(counts.map(|&few| (SOURCES, 0.0, VolumeCounting::DepthFail, Some(few))));
        }
        let mut rows = Vec::new();
        for (left_out, max_silhouette_error_px, counting, sources) in ways {
            if lab.is_stopped() {
                return Ok(None);
            }
            let shadows = &mut looks.scene.shadows;
            shadows.max_silhouette_error_px = max_silhouette_error_px;
            shadows.counting = counting;
            shadows.shafts.sources = sources;
            let drawn = draw(lab, &looks)?;
            let changes: Vec<(usize, f64, u8)> = drawn
                .iter()
                .zip(&all)
                .map(|(drawn, all)| changed_by(&drawn.rgba, &all.rgba))
                .collect();
            let count = changes.len().max(1) as f64;
            let squares = changes.iter().map(|(px, rms, _)| *px as f64 * rms * rms);
            let squares: f64 = squares.sum();
            let changed: f64 = changes.iter().map(|(px, ..)| *px as f64).sum();
            let [width, height] = looks.intrinsics.size_px.map(f64::from);
            let triangles = |drawn: &[DrawnRow]| {
                rounded(drawn.iter().map(|drawn| drawn.triangles).sum::<f64>() / count)
            };
            rows.push(LeftOutRow {
                recording: unit.to_owned(),
                left_out: left_out.to_owned(),
                max_silhouette_error_px,
                sources,
                triangles: triangles(&drawn),
                of_triangles: triangles(&all),
                changed_px: rounded(changed / count),
                rms_levels: rounded((squares / (count * width * height)).sqrt()),
                rms_changed_levels: rounded((squares / changed.max(1.0)).sqrt()),
                largest_levels: changes
                    .iter()
                    .map(|(.., largest)| f64::from(*largest))
                    .fold(0.0, f64::max),
            });
        }
        Ok(Some(rows))
    }

    fn figure(&self, rows: &[LeftOutRow]) -> Figure {
        let mut recordings: Vec<&str> = rows.iter().map(|row| row.recording.as_str()).collect();
        recordings.dedup();
        type Metric = (&'static str, fn(&LeftOutRow) -> f64);
        let metrics: [Metric; 2] = [
            ("triangles drawn, % of all", |row| {
                100.0 * row.triangles / row.of_triangles.max(1.0)
            }),
            ("the picture's error, levels of 255", |row| row.rms_levels),
        ];
        let mut panels = metrics
            .map(|(name, value)| FigurePanel {
                title: name.to_owned(),
                x: Axis::log("silhouettes may move by, px"),
                y: Axis::from_zero(name),
                series: recordings
                    .iter()
                    .enumerate()
                    .map(|(look, &recording)| Series {
                        name: recording.to_owned(),
                        look,
                        joined: true,
                        points: rows
                            .iter()
                            .filter(|row| row.recording == recording && row.left_out == TRIANGLES)
                            .map(|row| Point::at(row.max_silhouette_error_px, value(row)))
                            .collect(),
                    })
                    .collect(),
                rules: vec![Rule {
                    upright: true,
                    at: DEFAULT_PX,
                    label: "balanced".to_owned(),
                }],
                ..FigurePanel::default()
            })
            .to_vec();
        let few = rows.iter().filter(|row| row.left_out == SOURCES);
        let few = few.filter_map(|row| Some((row, f64::from(row.sources?))));
        let (name, value) = metrics[1];
        panels.push(FigurePanel {
            title: format!("few sources: {name}"),
            x: Axis::log("sources with a shadow each"),
            y: Axis::from_zero(name),
            series: vec![Series {
                name: ROOM.to_owned(),
                look: recordings
                    .iter()
                    .position(|name| *name == ROOM)
                    .unwrap_or(0),
                joined: true,
                points: few
                    .map(|(row, count)| Point::at(count, value(row)))
                    .collect(),
            }],
            rules: vec![Rule {
                upright: true,
                at: 50.0,
                label: "balanced".to_owned(),
            }],
            ..FigurePanel::default()
        });
        let at_default = rows
            .iter()
            .filter(|row| row.left_out == TRIANGLES && row.max_silhouette_error_px == DEFAULT_PX);
        let error = at_default.map(|row| row.rms_levels).fold(0.0, f64::max);
        Figure {
            title: "What is left out, and what that costs".to_owned(),
            reading: format!(
                "At the dashed lines, which are the default, less than a level of 255: at most {error} by triangles."
            ),
            columns: panels.len(),
            panel_size: [440.0, 320.0],
            panels,
        }
    }
}
