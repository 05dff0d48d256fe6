//! What an error of the camera's pose does to the shadow: `lamp` drawn at poses that are off, against the truth.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::shots::{Shot, Shots, mean, mean_wrong_pct};
use crate::app::truth::{compare, draw, shifts_px};

/// Pixels by which the pose is off.
const AMOUNTS_PX: [f64; 6] = [0.0, 0.1, 0.2, 0.5, 1.0, 2.0];
const RECORDING: &str = "lamp";

/// The chart.
pub struct WrongPose;

/// A pose error of one kind and size.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct WrongPoseRow {
    pose: String,
    shift_px: f64,
    wrong_shadow_pct: f64,
    factor_rms: f64,
    residual_real: f64,
    change_real: f64,
}

const MOVED: &str = "moved aside";
const TURNED: &str = "turned about the view's axis";

/// A pose beside the true one, by about so many pixels, in a direction of the picture.
fn displaced(
    kind: &str,
    shot: &Shot,
    focal_px: f64,
    amount_px: f64,
    way: DVec2,
) -> Vec<Option<DAffine3>> {
    let world = shot.camera_from_anchor[0].unwrap_or(DAffine3::IDENTITY);
    let depth_m = world.translation.z;
    let error = if kind == TURNED {
        // Half the picture's height from its centre it is off by as much as it is said to be.
        let radius_px = f64::from(shot.frame.size_px[1]) / 4.0;
        let turn = amount_px / radius_px * (way.x + way.y);
        DAffine3::from_quat(DQuat::from_rotation_z(turn))
    } else {
        let aside_m = way * (amount_px * depth_m / focal_px);
        DAffine3::from_translation(DVec3::new(aside_m.x, aside_m.y, 0.0))
    };
    let poses = shot.camera_from_anchor.iter();
    poses.map(|pose| pose.map(|pose| error * pose)).collect()
}

impl Chart for WrongPose {
    const NAME: &'static str = "pose-error";
    const FAMILY: &'static str = "stability";
    const SHOWS: &'static str = "What an error of the camera's pose does: the frames of *lamp* drawn at poses that are off \
        by so many pixels (the mean of four directions, or of both senses), against the path-traced truth. Residual is the \
        picture's error over that of the bare video, on real pixels, where 0 is what the camera would have taken.";
    type Row = WrongPoseRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let recording = lab.recording(RECORDING)?;
        Ok(vec![recording.folder, recording.scene])
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        Ok(vec![MOVED.to_owned(), TURNED.to_owned()])
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<WrongPoseRow>>> {
        let recording = lab.recording(RECORDING)?;
        let scene = recording.load_scene()?;
        let shots = Shots::of(lab, &recording, &scene)?;
        let intrinsics = shots.intrinsics;
        let mut renderer =
            crate::app::precomputed::renderer(Arc::clone(&lab.gpu()?), &scene, intrinsics)?;
        let ways: &[DVec2] = match unit {
            TURNED => &[DVec2::X, DVec2::NEG_X],
            _ => &[DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y],
        };
        let mut rows = Vec::new();
        for amount_px in AMOUNTS_PX {
            if lab.is_stopped() {
                return Ok(None);
            }
            // Nothing is off in no direction.
            let ways = match amount_px {
                0.0 => &ways[..1],
                _ => &ways[..ways.len().min(lab.directions())],
            };
            let (mut errors, mut shift_px) = (Vec::new(), 0.0);
            for &way in ways {
                for shot in &shots.shots {
                    let poses = displaced(unit, shot, intrinsics.focal_px.x, amount_px, way);
                    if let (Some(found), Some(truth)) = (poses[0], shot.camera_from_anchor[0]) {
                        let shifts = shifts_px(&intrinsics, &found, &truth);
                        let sum: f64 = shifts.iter().map(|shift| shift.length()).sum();
                        shift_px += sum / shifts.len() as f64;
                    }
                    let drawn = draw(&mut renderer, &shot.frame, &poses)?;
                    errors.push(compare(shot.frame.index, &shot.truth, &drawn)?);
                }
            }
            rows.push(WrongPoseRow {
                pose: unit.to_owned(),
                shift_px: rounded(shift_px / errors.len().max(1) as f64),
                wrong_shadow_pct: rounded(mean_wrong_pct(&errors).context("a lamp's shadow")?),
                factor_rms: rounded(mean(&errors, |e| e.factor)),
                residual_real: rounded(mean(&errors, |e| e.residual_real)),
                change_real: rounded(mean(&errors, |e| e.change_real)),
            });
        }
        Ok(Some(rows))
    }

    fn figure(&self, rows: &[WrongPoseRow]) -> Figure {
        type Metric = (&'static str, fn(&WrongPoseRow) -> f64);
        let metrics: [Metric; 3] = [
            ("wrong shadow, % of pixels", |row| row.wrong_shadow_pct),
            ("error of the factor, rms", |row| row.factor_rms),
            ("residual on real pixels", |row| row.residual_real),
        ];
        let panels = metrics.map(|(name, value)| {
            let series = [MOVED, TURNED].into_iter().enumerate();
            let series = series.map(|(look, pose)| Series {
                name: pose.to_owned(),
                look,
                joined: true,
                points: rows
                    .iter()
                    .filter(|row| row.pose == pose)
                    .map(|row| Point::at(row.shift_px, value(row)))
                    .collect(),
            });
            FigurePanel {
                title: name.to_owned(),
                x: Axis::from_zero("pose off by, px"),
                y: Axis::from_zero(name),
                series: series.collect(),
                ..FigurePanel::default()
            }
        });
        Figure {
            title: "The camera's pose beside the true one".to_owned(),
            reading:
                "Tracking is off by a few hundredths of a pixel (chart tracking): the left end."
                    .to_owned(),
            columns: metrics.len(),
            panel_size: [420.0, 320.0],
            panels: panels.to_vec(),
        }
    }
}
