//! What is left out of the scenes that ship, and what that costs in error: pictures against those of everything.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, Panel, Point, Rule, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::shots::Shots;
use crate::app::truth::changed_by;
use crate::render::{Renderer, Shown};
use crate::scene::{Counting, Scene};

/// By how many pixels silhouettes may move.
const ERRORS_PX: [f64; 6] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
const TRIANGLES: &str = "triangles";
const CAPS: &str = "caps and far sides";

/// The chart.
pub struct LeftOut;

/// One thing left out of one recording, the mean of its key frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Row {
    recording: String,
    left_out: String,
    max_silhouette_error_px: f64,
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
struct Drawn {
    rgba: Vec<u8>,
    triangles: f64,
}

fn draw(lab: &Lab<'_>, shots: &Shots, scene: &Scene) -> Result<Vec<Drawn>> {
    let mut renderer = Renderer::new(Arc::clone(&lab.gpu()?), scene, shots.intrinsics)?;
    let drawn = shots.shots.iter().map(|shot| {
        renderer.upload(&shot.frame)?;
        renderer.draw(&shot.camera_from_anchor, Shown::Composite);
        Ok(Drawn {
            rgba: renderer.read_picture()?,
            triangles: renderer.triangles() as f64,
        })
    });
    drawn.collect()
}

impl Chart for LeftOut {
    const NAME: &'static str = "left-out";
    const FAMILY: &'static str = "choosing";
    const SHOWS: &'static str = "What is not drawn, and what that changes: the key frames of the recordings with things as \
        coarse as silhouettes may move, and with volumes counted without caps where that is safe (which changes nothing), \
        against the same with all triangles and caps. The picture's error is the root mean square over all its pixels.";
    type Row = Row;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        lab.recording_inputs()
    }

    fn units(&self, lab: &Lab<'_>) -> Result<Vec<String>> {
        lab.recording_names()
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<Row>>> {
        let recording = lab.recording(unit)?;
        let mut scene = recording.load_scene()?;
        let shots = Shots::of(&recording, &scene)?;
        scene.shadows.max_silhouette_error_px = 0.0;
        scene.shadows.counting = Counting::DepthFail;
        let all = draw(lab, &shots, &scene)?;
        let mut ways = vec![(CAPS, 0.0, Counting::Auto)];
        ways.extend(ERRORS_PX.map(|error_px| (TRIANGLES, error_px, Counting::DepthFail)));
        let mut rows = Vec::new();
        for (left_out, max_silhouette_error_px, counting) in ways {
            if lab.is_stopped() {
                return Ok(None);
            }
            scene.shadows.max_silhouette_error_px = max_silhouette_error_px;
            scene.shadows.counting = counting;
            let drawn = draw(lab, &shots, &scene)?;
            let changes: Vec<(usize, f64, u8)> = drawn
                .iter()
                .zip(&all)
                .map(|(drawn, all)| changed_by(&drawn.rgba, &all.rgba))
                .collect();
            let count = changes.len().max(1) as f64;
            let squares = changes.iter().map(|(px, rms, _)| *px as f64 * rms * rms);
            let squares: f64 = squares.sum();
            let changed: f64 = changes.iter().map(|(px, ..)| *px as f64).sum();
            let [width, height] = shots.size_px().map(f64::from);
            let triangles = |drawn: &[Drawn]| {
                rounded(drawn.iter().map(|drawn| drawn.triangles).sum::<f64>() / count)
            };
            rows.push(Row {
                recording: unit.to_owned(),
                left_out: left_out.to_owned(),
                max_silhouette_error_px,
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

    fn figure(&self, rows: &[Row]) -> Figure {
        let mut recordings: Vec<&str> = rows.iter().map(|row| row.recording.as_str()).collect();
        recordings.dedup();
        type Metric = (&'static str, fn(&Row) -> f64);
        let metrics: [Metric; 2] = [
            ("triangles drawn, % of all", |row| {
                100.0 * row.triangles / row.of_triangles.max(1.0)
            }),
            ("the picture's error, levels of 255", |row| row.rms_levels),
        ];
        let panels = metrics.map(|(name, value)| Panel {
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
                at: 0.5,
                label: "balanced".to_owned(),
            }],
            ..Panel::default()
        });
        Figure {
            title: "What is left out, and what that costs".to_owned(),
            reading: "At the dashed line, which is the default, the error is less than one level."
                .to_owned(),
            columns: metrics.len(),
            panel_size: [520.0, 340.0],
            panels: panels.to_vec(),
        }
    }
}
