//! Shafts' settings one by one, in the room that ships: how many sources carry the light, how finely shafts are cut, how fine maps
//! and casters are, and what each costs in time and error.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Rule, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::shots::{Shots, mean};
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::render::{Renderer, Shown};
use crate::scene::{Scene, ShadowSettings};

/// The chart.
pub struct ShaftSettingsChart;

/// One value of one setting.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ShaftSettingsRow {
    setting: String,
    value: f64,
    /// Everything that is made before the first frame, the room's transport among it.
    ready_s: f64,
    /// Nothing moves.
    frame_median_ms: f64,
    /// A virtual thing moves.
    moved_median_ms: f64,
    triangles: usize,
    change_real: f64,
    factor_rms: f64,
    residual_virtual: f64,
}

/// The recording with a probe and a room.
const ROOM: &str = "room";

/// A setting, its values, and how a scene takes one.
struct Sweep {
    setting: &'static str,
    values: &'static [f64],
    set: fn(&mut ShadowSettings, f64),
    get: fn(&ShadowSettings) -> f64,
}

const SWEEPS: [Sweep; 4] = [
    Sweep {
        setting: "source_power",
        values: &[0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0],
        set: |shadows, value| shadows.shafts.source_power = value,
        get: |shadows| shadows.shafts.source_power,
    },
    Sweep {
        setting: "least_part",
        values: &[0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2],
        set: |shadows, value| shadows.shafts.least_part = value,
        get: |shadows| shadows.shafts.least_part,
    },
    Sweep {
        setting: "map_px",
        values: &[16.0, 32.0, 64.0, 128.0, 256.0, 512.0],
        set: |shadows, value| shadows.shafts.map_px = value as u32,
        get: |shadows| f64::from(shadows.shafts.map_px),
    },
    Sweep {
        setting: "max_silhouette_error_px",
        values: &[0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0],
        set: |shadows, value| shadows.max_silhouette_error_px = value,
        get: |shadows| shadows.max_silhouette_error_px,
    },
];

/// A scene with one setting at one value, and what is known of it.
struct Candidate {
    scene: Scene,
    renderer: Renderer,
    row: ShaftSettingsRow,
    frames_ms: Vec<f64>,
    moved_ms: Vec<f64>,
}

impl Candidate {
    fn new(lab: &Lab<'_>, shots: &Shots, scene: Scene, sweep: &Sweep) -> Result<Self> {
        let gpu = lab.gpu()?;
        let (renderer, ms) =
            Stopwatch::time(|| Renderer::new(Arc::clone(&gpu), &scene, shots.intrinsics));
        let mut renderer = renderer?;
        let errors = shots.errors(&shots.draw_with(&mut renderer)?)?;
        let row = ShaftSettingsRow {
            setting: sweep.setting.to_owned(),
            value: (sweep.get)(&scene.shadows),
            ready_s: rounded(ms / 1e3),
            frame_median_ms: 0.0,
            moved_median_ms: 0.0,
            triangles: renderer.triangles(),
            change_real: rounded(mean(&errors, |e| e.change_real)),
            factor_rms: rounded(mean(&errors, |e| e.factor)),
            residual_virtual: rounded(mean(&errors, |e| e.residual_virtual)),
        };
        Ok(Self {
            scene,
            renderer,
            row,
            frames_ms: Vec::new(),
            moved_ms: Vec::new(),
        })
    }

    /// A frame in which nothing moves and one in which the first virtual thing has moved to and fro.
    fn time(&mut self, shots: &Shots, round: usize) -> Result<()> {
        const STEP_M: f64 = 0.002;
        let Some(shot) = shots.shots.first() else {
            return Ok(());
        };
        let Self {
            scene, renderer, ..
        } = self;
        let draw = |renderer: &mut Renderer| {
            renderer.draw(&shot.camera_from_anchor, Shown::Composite);
            renderer.wait()
        };
        let (waited, ms) = Stopwatch::time(|| draw(renderer));
        waited?;
        self.frames_ms.push(ms);
        if let Some(thing) = scene.virtuals.first_mut() {
            let to_or_fro = if round.is_multiple_of(2) { 1.0 } else { -1.0 };
            thing.anchor_from_object.translation.x += to_or_fro * STEP_M;
        }
        let (waited, ms) = Stopwatch::time(|| {
            renderer.follow(scene);
            draw(renderer)
        });
        waited?;
        self.moved_ms.push(ms);
        Ok(())
    }
}

impl Chart for ShaftSettingsChart {
    const NAME: &'static str = "shaft-settings";
    const FAMILY: &'static str = "choosing";
    const SHOWS: &'static str = "Shafts' settings one by one, in the room that ships with 50 sources, at true poses against the path-traced truth: the \
        part of all power that sources send out (`source_power`), below which part of any corner's light shafts are cut no further \
        (`least_part`), the side of a source's map (`map_px`), and by how much coarser casters may move silhouettes \
        (`max_silhouette_error_px`). Above the error of what changes on real surfaces, below the time of a frame in which nothing \
        moves and of one in which a thing has moved. The dashed line is the default.";
    type Row = ShaftSettingsRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let room = lab.recording(ROOM)?;
        Ok(vec![room.folder, room.scene])
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        Ok(SWEEPS.map(|sweep| sweep.setting.to_owned()).to_vec())
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<ShaftSettingsRow>>> {
        let recording = lab.recording(ROOM)?;
        let scene = recording.load_scene()?;
        let shots = Shots::of(lab, &recording, &scene)?;
        let mut candidates = Vec::new();
        for sweep in SWEEPS.iter().filter(|sweep| sweep.setting == unit) {
            for &value in sweep.values.iter().step_by(lab.step()) {
                if lab.is_stopped() {
                    return Ok(None);
                }
                let mut scene = scene.clone();
                (sweep.set)(&mut scene.shadows, value);
                candidates.push(Candidate::new(lab, &shots, scene, sweep)?);
            }
        }
        for round in 0..2 * lab.rounds() {
            for candidate in &mut candidates {
                if lab.is_stopped() {
                    return Ok(None);
                }
                candidate.time(&shots, round)?;
            }
        }
        let rows = candidates.into_iter().map(|candidate| ShaftSettingsRow {
            frame_median_ms: rounded(quantile(&candidate.frames_ms, 0.5)),
            moved_median_ms: rounded(quantile(&candidate.moved_ms, 0.5)),
            ..candidate.row
        });
        Ok(Some(rows.collect()))
    }

    fn figure(&self, rows: &[ShaftSettingsRow]) -> Figure {
        type Metric = (&'static str, fn(&ShaftSettingsRow) -> f64);
        const ERRORS: [Metric; 1] = [("error of the change", |row| row.change_real)];
        const TIMES: [Metric; 2] = [
            ("nothing moves", |row| row.frame_median_ms),
            ("a thing moves", |row| row.moved_median_ms),
        ];
        let default = ShadowSettings::default();
        let panel = |sweep: &Sweep, label: &str, metrics: &[Metric]| FigurePanel {
            title: sweep.setting.to_owned(),
            x: Axis::log(sweep.setting),
            y: Axis::from_zero(label),
            series: (metrics.iter().enumerate())
                .map(|(look, (name, value))| Series {
                    name: (*name).to_owned(),
                    look: look + usize::from(metrics.len() > 1),
                    joined: true,
                    points: (rows.iter().filter(|row| row.setting == sweep.setting))
                        .map(|row| Point::at(row.value, value(row)))
                        .collect(),
                })
                .collect(),
            rules: vec![Rule {
                upright: true,
                at: (sweep.get)(&default),
                label: String::new(),
            }],
            ..FigurePanel::default()
        };
        let errors = SWEEPS
            .iter()
            .map(|sweep| panel(sweep, "error of the change", &ERRORS));
        let times = SWEEPS
            .iter()
            .map(|sweep| panel(sweep, "time per frame, ms", &TIMES));
        Figure {
            title: "Shafts: what each setting costs and brings".to_owned(),
            reading: "Upright lines: the default of each.".to_owned(),
            columns: SWEEPS.len(),
            panel_size: [360.0, 300.0],
            panels: errors.chain(times).collect(),
        }
    }
}
