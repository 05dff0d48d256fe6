//! Shadows: time per frame against how far the picture is from what the camera would have seen, for each technique and
//! its knobs. All draw the same frame in turn.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Rule, Series, pareto_front};
use super::lab::Lab;
use super::measured::rounded;
use super::shots::{Shots, mean, mean_wrong_pct};
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::app::truth::{Drawn, LinearPicture};
use crate::render::Shown;
use crate::scene::{Quality, Scene, ShadowSettings, ShaftSettings, Technique, VolumeCounting};

/// The chart.
pub struct Shadows;

/// One way to make the shadows of one recording.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ShadowsRow {
    recording: String,
    technique: String,
    setting: String,
    /// None for what is no technique.
    frame_median_ms: Option<f64>,
    residual_real: f64,
    residual_virtual: f64,
    change_real: f64,
    factor_rms: f64,
    /// None where no light is a point or a direction.
    wrong_shadow_pct: Option<f64>,
    outline_levels: f64,
}

const VOLUMES_4: &str = "volumes, 4 samples";
const SHAFTS: &str = "shafts and compact light, by sources";
const GATHERED: &str = "volumes and gathered light, by rays";
const ENVIRONMENT: &str = "environment, by quality";
const VOLUMES_1: &str = "volumes, 1 sample";
/// A series each, in the order of their colours.
const TECHNIQUES: [&str; 5] = [VOLUMES_4, VOLUMES_1, SHAFTS, ENVIRONMENT, GATHERED];
/// Rays from each point for light that is gathered.
const GATHERING_SAMPLES: [u32; 3] = [64, 256, 512];
/// How many sources get a shadow each; `None`: all that are hidden.
const SHAFT_SOURCES: [Option<u32>; 6] = [Some(5), Some(10), Some(20), Some(50), Some(100), None];
/// For a look these do.
const QUICK_SETTINGS: [&str; 6] = ["fast", "balanced", "accurate", "5", "20", "100"];
const TRUTH: &str = "truth on the video";
const BARE: &str = "bare video";

/// A way to make shadows and the scene that asks for it.
struct ShadowWay {
    technique: &'static str,
    setting: String,
    scene: Scene,
}

/// What each technique has to set. Another one adds its ways here.
fn ways(scene: &Scene) -> Vec<ShadowWay> {
    let mut ways = Vec::new();
    for sources in SHAFT_SOURCES {
        ways.extend(with_sources(scene, sources).map(|scene| ShadowWay {
            technique: SHAFTS,
            setting: sources.map_or("all".to_owned(), |count| count.to_string()),
            scene,
        }));
    }
    let mut add = |technique, setting: String, shadows: ShadowSettings| {
        let mut scene = scene.clone();
        scene.shadows = shadows;
        ways.push(ShadowWay {
            technique,
            setting,
            scene,
        });
    };
    if scene.probe.as_ref().is_some_and(|probe| probe.is_far) {
        for (name, quality) in Quality::BY_NAME {
            let shadows = ShadowSettings {
                technique: Technique::Environment,
                ..quality.shadows()
            };
            add(ENVIRONMENT, name.to_owned(), shadows);
        }
    }
    if scene.lights.is_empty() {
        return ways;
    }
    for (name, quality) in Quality::BY_NAME {
        let shadows = ShadowSettings {
            technique: Technique::Volumes,
            // (Of the lights alone: what is gathered has ways of its own.)
            ambient_samples: 0,
            ..quality.shadows()
        };
        add(series(shadows.samples), name.to_owned(), shadows);
    }
    for ambient_samples in GATHERING_SAMPLES {
        let shadows = ShadowSettings {
            technique: Technique::Volumes,
            ambient_samples,
            ..ShadowSettings::default()
        };
        add(GATHERED, ambient_samples.to_string(), shadows);
    }
    for (samples, max_silhouette_error_px, counting) in [
        (1, 0.0, VolumeCounting::Auto),
        (1, 0.0, VolumeCounting::DepthFail),
        (1, 8.0, VolumeCounting::Auto),
        (4, 0.0, VolumeCounting::DepthFail),
        (4, 8.0, VolumeCounting::Auto),
    ] {
        let setting = match counting {
            VolumeCounting::Auto => format!("{max_silhouette_error_px} px"),
            VolumeCounting::DepthFail => "depth-fail".to_owned(),
        };
        let shadows = ShadowSettings {
            technique: Technique::Volumes,
            samples,
            max_silhouette_error_px,
            counting,
            ambient_samples: 0,
            ..ShadowSettings::default()
        };
        add(series(samples), setting, shadows);
    }
    ways
}

/// A scene with a probe, in a room or from afar, by shafts beside compact light; `None` without a probe. `sources`: so many get a
/// shadow each; `None`: all that are hidden.
pub fn with_sources(scene: &Scene, sources: Option<u32>) -> Option<Scene> {
    let mut scene = scene.clone();
    // Else light from afar is left to the environment.
    scene.probe.as_mut()?.is_far = false;
    scene.shadows = ShadowSettings {
        technique: Technique::Auto,
        shafts: ShaftSettings {
            sources,
            ..ShaftSettings::default()
        },
        ..ShadowSettings::default()
    };
    Some(scene)
}

fn series(samples: u32) -> &'static str {
    match samples {
        1 => VOLUMES_1,
        _ => VOLUMES_4,
    }
}

impl Chart for Shadows {
    const NAME: &'static str = "shadows";
    const FAMILY: &'static str = "shadows";
    const SHOWS: &'static str = "Time to draw a frame at true poses against its error. Residual: the picture's error on real \
        pixels that the virtual things change, over that of the bare video; what the video's own noise leaves, with the \
        true change put on it, is the floor. Factor: rms error of what the shadow leaves of the light, 1 without a shadow. \
        A setting is the samples per pixel and by how much coarser versions of things may move their silhouettes; \
        `depth-fail` counts volumes that way everywhere. Volumes draw lights alone; where light is gathered \
        besides, the setting is its rays. What is left of the error is light between surfaces and what the \
        torus hides of the surroundings, which point lights do not have.";
    type Row = ShadowsRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        lab.recording_inputs()
    }

    fn units(&self, lab: &Lab<'_>) -> Result<Vec<String>> {
        lab.recording_names()
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<ShadowsRow>>> {
        const DRAWS: usize = 4;
        // Frames of software drivers with many sources take half a second each.
        let (longest_ms, least_draws) = if lab.quick { (2e3, 1) } else { (6e4, 3) };
        let recording = lab.recording(unit)?;
        let scene = recording.load_scene()?;
        let shots = Shots::of(lab, &recording, &scene)?;
        let gpu = lab.gpu()?;
        let mut ways = ways(&scene);
        if lab.quick {
            ways.retain(|way| QUICK_SETTINGS.contains(&way.setting.as_str()));
        }
        let (mut rows, mut renderers) = (Vec::new(), Vec::new());
        for way in &ways {
            if lab.is_stopped() {
                return Ok(None);
            }
            let mut renderer =
                crate::app::precomputed::renderer(Arc::clone(&gpu), &way.scene, shots.intrinsics)?;
            let drawn = shots.draw_with(&mut renderer)?;
            rows.push(row(unit, way.technique, &way.setting, &shots, &drawn)?);
            renderers.push(renderer);
        }
        // Of each frame the least of all draws: nothing takes less than it needs.
        let mut least_ms = vec![vec![f64::INFINITY; shots.shots.len()]; ways.len()];
        let watch = Stopwatch::start();
        for draw in 0..DRAWS * lab.rounds().pow(2) {
            if draw >= least_draws && watch.elapsed_ms() > longest_ms {
                break;
            }
            for (index, shot) in shots.shots.iter().enumerate() {
                if lab.is_stopped() {
                    return Ok(None);
                }
                for (renderer, least_ms) in renderers.iter_mut().zip(&mut least_ms) {
                    renderer.upload(&shot.frame)?;
                    let (waited, ms) = Stopwatch::time(|| {
                        renderer.draw(&shot.camera_from_anchor, Shown::Composite);
                        renderer.wait()
                    });
                    waited?;
                    least_ms[index] = least_ms[index].min(ms);
                }
            }
        }
        for (row, least_ms) in rows.iter_mut().zip(&least_ms) {
            row.frame_median_ms = Some(rounded(quantile(least_ms, 0.5)));
        }
        let drawn = shots.draw(&gpu, &scene)?;
        rows.push(row(unit, TRUTH, "", &shots, &with_truth(&shots, &drawn))?);
        let bare: Vec<Drawn> = drawn.into_iter().map(without_anything).collect();
        rows.push(row(unit, BARE, "", &shots, &bare)?);
        Ok(Some(rows))
    }

    fn figure(&self, rows: &[ShadowsRow]) -> Figure {
        let mut recordings: Vec<&str> = rows.iter().map(|row| row.recording.as_str()).collect();
        recordings.dedup();
        type Metric = (&'static str, fn(&ShadowsRow) -> f64);
        let metrics: [Metric; 3] = [
            ("residual on real pixels", |row| row.residual_real),
            ("error of the factor, rms", |row| row.factor_rms),
            ("outlines' error, levels of 255", |row| row.outline_levels),
        ];
        let mut panels = Vec::new();
        for &recording in &recordings {
            for (name, value) in metrics {
                let here = || rows.iter().filter(move |row| row.recording == recording);
                let measured = || {
                    here().filter_map(move |row| Some((row, [row.frame_median_ms?, value(row)])))
                };
                let measured_somewhere =
                    |technique: &&str| rows.iter().any(|row| row.technique == **technique);
                let series = TECHNIQUES.iter().enumerate();
                let series = series.filter(|(_, technique)| measured_somewhere(technique));
                let series = series.map(|(look, &technique)| Series {
                    name: technique.to_owned(),
                    look,
                    joined: false,
                    points: measured()
                        .filter(|(row, _)| row.technique == technique)
                        .map(|(row, [x, y])| Point::named(x, y, &row.setting))
                        .collect(),
                });
                let rule = |technique: &str| {
                    let row = here().find(|row| row.technique == technique);
                    row.map(|row| Rule {
                        upright: false,
                        at: value(row),
                        label: technique.to_owned(),
                    })
                };
                panels.push(FigurePanel {
                    title: format!("{recording}: {name}"),
                    x: Axis::log("time per frame, ms"),
                    y: Axis::log(name),
                    series: series.collect(),
                    rules: [rule(TRUTH), rule(BARE)].into_iter().flatten().collect(),
                    front: pareto_front(measured().map(|(_, at)| at)),
                });
            }
        }
        Figure {
            title: "Shadows: what a frame costs and how far it is from the truth".to_owned(),
            reading: "The lower and the farther left the better. Labels: the qualities, or how far silhouettes may move.".to_owned(),
            columns: metrics.len(),
            panel_size: [520.0, 380.0],
            panels,
        }
    }
}

fn row(
    recording: &str,
    technique: &str,
    setting: &str,
    shots: &Shots,
    drawn: &[Drawn],
) -> Result<ShadowsRow> {
    let errors = shots.errors(drawn)?;
    let of = |of| rounded(mean(&errors, of));
    Ok(ShadowsRow {
        recording: recording.to_owned(),
        technique: technique.to_owned(),
        setting: setting.to_owned(),
        frame_median_ms: None,
        residual_real: of(|e| e.residual_real),
        residual_virtual: of(|e| e.residual_virtual),
        change_real: of(|e| e.change_real),
        factor_rms: of(|e| e.factor),
        wrong_shadow_pct: mean_wrong_pct(&errors).map(rounded),
        outline_levels: of(|e| e.outline_levels),
    })
}

/// The best that anything could draw into the recorded video: the true change, and the true factor.
fn with_truth(shots: &Shots, drawn: &[Drawn]) -> Vec<Drawn> {
    let frames = shots.shots.iter().zip(drawn);
    frames
        .map(|(shot, drawn)| {
            let width = shots.size_px()[0] as usize;
            let change = shot.truth.with.minus(&shot.truth.without);
            let out = LinearPicture::from_rgba(width, &drawn.bare).plus(&change);
            let mut with_truth = drawn.clone();
            with_truth.out = out
                .pixels
                .iter()
                .flat_map(|p| [p[0], p[1], p[2], 255.0].map(|level| level.round() as u8))
                .collect();
            let factor = &shot.truth.factor.pixels;
            with_truth.layers.gain = factor.iter().map(|f| f.map(|part| part as f32)).collect();
            let shadows = with_truth.layers.shadow.iter_mut();
            for (bits, mask) in shadows.zip(&shot.truth.mask) {
                bits.clone_from(mask);
            }
            with_truth
        })
        .collect()
}

/// The video as it is.
fn without_anything(mut drawn: Drawn) -> Drawn {
    drawn.out.clone_from(&drawn.bare);
    drawn.layers.gain.fill([1.0; 3]);
    drawn.layers.shadow.iter_mut().for_each(|bits| bits.fill(0));
    drawn
}
