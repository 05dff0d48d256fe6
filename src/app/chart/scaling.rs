//! Scaling: how what a frame costs grows with what there is. The values of one sweep are drawn in turn.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result};
use glam::{DAffine3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series, power_law};
use super::lab::Lab;
use super::measured::rounded;
use super::peers_table::{
    self, LIGHT_M, PeersStage, SIZE_PX, TORUS_CENTER_M, WARM_UP_FRAMES, torus,
};
use super::shots::{Shots, grey_frame};
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::geometry::camera::Intrinsics;
use crate::light::{Light, Shape};
use crate::render::{Gpu, Renderer, Shown};
use crate::scene::Scene;

/// The chart.
pub struct Scaling;

/// A stage of one size.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ScalingRow {
    varied: String,
    value: f64,
    samples: u32,
    frame_median_ms: f64,
    frame_p90_ms: f64,
    gpu_memory_mib: Option<f64>,
}

/// Of the caster where its size is not varied.
const TRIANGLES: usize = 2_500;
const UNITS: [&str; 7] = [
    "triangles",
    "lights",
    RADIUS,
    "casters",
    "pixels",
    SOURCES,
    MODELS,
];
const SWEEPS: [&str; 8] = [
    "triangles",
    "lights",
    RADIUS,
    "casters",
    "pixels",
    SOURCES,
    STANDING,
    WALKING,
];
/// Of a lamp that is a sphere.
const RADIUS: &str = "lamp's radius, mm";
const SOURCES: &str = "sources";
/// Models that have an animation, of so many triangles: as they stand, and as they walk.
const MODELS: &str = "models";
const STANDING: &str = "triangles that stand";
const WALKING: &str = "triangles that walk";
/// Their files, which not everybody has, and what plays.
const WALKERS: [(&str, &str); 2] = [("Fox.glb", "\"Walk\""), ("CesiumMan.glb", "0")];
const MODELS_FOLDER: &str = "../shared/models/gltf";
/// Frames a second of what walks.
const FRAME_RATE: f64 = 30.0;
/// Where shafts are drawn.
const ROOM: &str = "room";
const SOURCE_COUNTS: [u32; 7] = [1, 3, 10, 20, 50, 100, 200];
const QUICK_SOURCE_COUNTS: [u32; 3] = [1, 5, 25];

/// A drawn scene with its camera and its poses.
struct Setup {
    scene: Scene,
    intrinsics: Intrinsics,
    /// By frame.
    poses: Box<dyn Fn(usize) -> Vec<Option<DAffine3>>>,
}

/// The stages of one unit: what is varied, its value, and what is drawn.
type Stages = Vec<(&'static str, f64, Setup)>;

/// Models that have an animation, over a table under one lamp, as they stand and as they walk; none where their files are not.
fn walkers(samples: u32) -> Result<Stages> {
    let mut stages = Vec::new();
    for (file, clip) in WALKERS {
        let path = Path::new(MODELS_FOLDER).join(file);
        if !path.is_file() {
            continue;
        }
        for (varied, animation) in [
            (STANDING, String::new()),
            (WALKING, format!("animation = {clip}")),
        ] {
            let text = format!(
                "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"table\"\n\
                 markers = [{{ id = 0, size_m = 0.045, center_m = [0, 0] }}]\n\
                 [table]\nrect_m = [-0.4, -0.4, 0.4, 0.4]\n\
                 [[virtual]]\nname = \"it\"\nmesh = '{}'\nfit_m = 0.15\n{animation}\n\
                 [[light]]\nkind = \"point\"\nposition_m = [{}, {}, {}]\nintensity = 0.7\n\
                 [ambient]\nradiance = 0.05\n[shadows]\nsamples = {samples}\nambient_samples = 0\n",
                path.display(),
                LIGHT_M.x,
                LIGHT_M.y,
                LIGHT_M.z
            );
            let place = std::env::current_dir().context("the current folder")?;
            let scene = Scene::parse(&place.join("walking.toml"), &text)?;
            let triangles = scene
                .virtuals
                .iter()
                .map(|thing| thing.mesh.triangles.len());
            let value = triangles.sum::<usize>() as f64;
            let nodes = scene.node_count();
            let setup = Setup {
                scene,
                intrinsics: peers_table::intrinsics(SIZE_PX),
                poses: Box::new(move |_| vec![Some(peers_table::camera_from_world()); nodes]),
            };
            stages.push((varied, value, setup));
        }
    }
    Ok(stages)
}

impl From<PeersStage> for Setup {
    fn from(stage: PeersStage) -> Self {
        Self {
            scene: stage.scene.clone(),
            intrinsics: stage.intrinsics,
            poses: Box::new(move |frame| stage.poses(frame)),
        }
    }
}

/// The room that ships with rising numbers of sources; none where there is no such recording.
fn rooms(lab: &Lab<'_>, samples: u32) -> Result<Vec<(f64, Setup)>> {
    if !lab.recording_names()?.iter().any(|name| name == ROOM) {
        return Ok(Vec::new());
    }
    let recording = lab.recording(ROOM)?;
    let scene = recording.load_scene()?;
    let shots = Shots::of(lab, &recording, &scene)?;
    let counts: &[u32] = match lab.quick {
        true => &QUICK_SOURCE_COUNTS,
        false => &SOURCE_COUNTS,
    };
    let setup = |&count: &u32| {
        let mut scene = scene.clone();
        scene.shadows.samples = samples;
        scene.shadows.shafts.sources = Some(count);
        let poses = shots.shots[0].camera_from_anchor.clone();
        let setup = Setup {
            scene,
            intrinsics: shots.intrinsics,
            poses: Box::new(move |_| poses.clone()),
        };
        (f64::from(count), setup)
    };
    Ok(counts.iter().map(setup).collect())
}

/// The sizes of a sweep with their stages: the peers' torus over the table, one thing varied.
fn sweep(lab: &Lab<'_>, varied: &str, samples: u32) -> Vec<(f64, PeersStage)> {
    let one = |triangles| vec![(torus(triangles, 1.0), TORUS_CENTER_M)];
    let sizes: &[u32] = match varied {
        "triangles" if lab.quick => &[100, 300, 1_000, 3_000, 10_000],
        "triangles" => &[100, 300, 1_000, 3_000, 10_000, 30_000, 100_000],
        "lights" => &[1, 2, 3, 4, 6, 8],
        RADIUS => &[1, 2, 5, 10, 20, 40, 80],
        "casters" => &[1, 2, 4, 8, 16, 32],
        _ => &[240, 480, 720, 960, 1_080],
    };
    let sizes = sizes.iter().step_by(lab.step());
    let stage = |&size: &u32| match varied {
        "triangles" => {
            let stage = PeersStage::new(one(size as usize), &[LIGHT_M], SIZE_PX, samples);
            (stage.triangles() as f64, stage)
        }
        "lights" => {
            // A ring at the lamp's height, which it is the first of.
            let around = |index: u32| DQuat::from_rotation_z(f64::from(index) * 0.7) * LIGHT_M;
            let places: Vec<DVec3> = (0..size).map(around).collect();
            let stage = PeersStage::new(one(TRIANGLES), &places, SIZE_PX, samples);
            (f64::from(size), stage)
        }
        RADIUS => {
            let mut stage = PeersStage::new(one(TRIANGLES), &[LIGHT_M], SIZE_PX, samples);
            let radius_m = f64::from(size) / 1e3;
            for light in &mut stage.scene.lights {
                if let Light::Point { shape, .. } = &mut light.light {
                    *shape = Shape::Sphere { radius_m };
                }
            }
            (f64::from(size), stage)
        }
        "casters" => {
            let small = torus(TRIANGLES, 0.4);
            let grid = (0..size).map(|index| {
                let (column, row) = (f64::from(index % 8), f64::from(index / 8));
                let place = DVec3::new(-0.21 + 0.06 * column, -0.09 + 0.06 * row, 0.04);
                (small.clone(), place)
            });
            let stage = PeersStage::new(grid.collect(), &[LIGHT_M], SIZE_PX, samples);
            (f64::from(size), stage)
        }
        _ => {
            let size_px = [size * 4 / 3, size];
            let stage = PeersStage::new(one(TRIANGLES), &[LIGHT_M], size_px, samples);
            (f64::from(size_px[0]) * f64::from(size_px[1]), stage)
        }
    };
    sizes.map(stage).collect()
}

/// What a unit draws.
fn stages(lab: &Lab<'_>, unit: &str, samples: u32) -> Result<Stages> {
    let varied = SWEEPS.into_iter().find(|sweep| *sweep == unit);
    Ok(match varied {
        None => walkers(samples)?,
        Some(SOURCES) => (rooms(lab, samples)?.into_iter())
            .map(|(value, setup)| (SOURCES, value, setup))
            .collect(),
        Some(varied) => (sweep(lab, varied, samples).into_iter())
            .map(|(value, stage)| (varied, value, stage.into()))
            .collect(),
    })
}

impl Chart for Scaling {
    const NAME: &'static str = "scaling";
    const FAMILY: &'static str = "scaling";
    const SHOWS: &'static str = "How the time for a frame with shadow volumes made anew grows with triangles of the caster, \
        lights, the lamp's size, casters and pixels, one varied at a time: a torus of 2,500 triangles that turns over a table \
        under one lamp, a point, 640 x 480 pixels (casters: smaller ones). Drawn and waited for, without video going up or a picture coming \
        back. Sources: soft shadows by shafts in the room that ships, where nothing \
        moves but the camera. Triangles that stand and that walk: Khronos's Fox and CesiumMan without their animation, with \
        volumes kept, and with it, where each frame poses the mesh and makes its volumes anew. The number at a line is its slope, the exponent of growth over the upper half of its sizes. Memory is what \
        the graphics driver has given to the program.";
    type Row = ScalingRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let recordings = lab.recordings()?.into_iter();
        let rooms = recordings.filter(|recording| recording.name == ROOM);
        let models = WALKERS.map(|(file, _)| Path::new(MODELS_FOLDER).join(file));
        let models = models.into_iter().filter(|path| path.is_file());
        Ok(rooms
            .flat_map(|room| [room.folder, room.scene])
            .chain(models)
            .collect())
    }

    fn units(&self, _: &Lab<'_>) -> Result<Vec<String>> {
        Ok(UNITS.map(str::to_owned).to_vec())
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<ScalingRow>>> {
        let gpu = lab.gpu()?;
        let (warm_up, frames) = if lab.quick {
            (1, 3)
        } else {
            (WARM_UP_FRAMES, 40)
        };
        let mut rows = Vec::new();
        for samples in [1, 4] {
            let stages = stages(lab, unit, samples)?;
            let frames = if unit == SOURCES {
                frames / 4 + 1
            } else {
                frames
            };
            let benches = (stages.iter()).map(|(_, _, stage)| Bench::new(&gpu, stage));
            let mut benches = benches.collect::<Result<Vec<_>>>()?;
            for frame in 0..warm_up + frames {
                if lab.is_stopped() {
                    return Ok(None);
                }
                for (bench, (_, _, stage)) in benches.iter_mut().zip(&stages) {
                    let ms = bench.draw(stage, frame)?;
                    if frame >= warm_up {
                        bench.frames_ms.push(ms);
                    }
                }
            }
            for (bench, (varied, value, _)) in benches.iter().zip(&stages) {
                rows.push(ScalingRow {
                    varied: (*varied).to_owned(),
                    value: *value,
                    samples,
                    frame_median_ms: rounded(quantile(&bench.frames_ms, 0.5)),
                    frame_p90_ms: rounded(quantile(&bench.frames_ms, 0.9)),
                    gpu_memory_mib: bench.memory_mib.map(rounded),
                });
            }
        }
        Ok(Some(rows))
    }

    fn figure(&self, rows: &[ScalingRow]) -> Figure {
        type Metric = (&'static str, fn(&ScalingRow) -> Option<f64>);
        let metrics: [Metric; 2] = [
            ("time per frame, ms", |row| Some(row.frame_median_ms)),
            ("graphics memory, MiB", |row| row.gpu_memory_mib),
        ];
        let mut panels = Vec::new();
        for (name, value) in metrics {
            for varied in SWEEPS {
                let series = [1, 4].into_iter().enumerate().map(|(look, samples)| {
                    let here = rows
                        .iter()
                        .filter(|row| row.varied == varied && row.samples == samples);
                    let at: Vec<[f64; 2]> = here
                        .filter_map(|row| Some([row.value, value(row)?]))
                        .collect();
                    let slope = power_law(&at[at.len() / 2..]).map(|(exponent, _)| exponent);
                    let last = at.len().saturating_sub(1);
                    let points = at.iter().enumerate().map(|(index, &[x, y])| {
                        let told = slope.filter(|_| index == last);
                        let label = told.map_or(String::new(), |slope| format!("{slope:.2}"));
                        Point::named(x, y, &label)
                    });
                    Series {
                        name: format!("{samples} sample{}", if samples == 1 { "" } else { "s" }),
                        look,
                        joined: true,
                        points: points.collect(),
                    }
                });
                panels.push(FigurePanel {
                    title: varied.to_owned(),
                    x: Axis::log(varied),
                    y: Axis::log(name),
                    series: series.collect(),
                    ..FigurePanel::default()
                });
            }
        }
        Figure {
            title: "How the cost of shadows grows".to_owned(),
            reading: "Both axes are logarithmic; the number at a line's end is its slope: 1 grows in proportion.".to_owned(),
            columns: SWEEPS.len(),
            panel_size: [350.0, 300.0],
            panels,
        }
    }
}

/// A renderer and what its frames took.
struct Bench {
    renderer: Renderer,
    frames_ms: Vec<f64>,
    memory_mib: Option<f64>,
}

impl Bench {
    fn new(gpu: &Arc<Gpu>, stage: &Setup) -> Result<Self> {
        let before = gpu.allocated_bytes();
        let mut renderer = Renderer::new(Arc::clone(gpu), &stage.scene, stage.intrinsics)?;
        renderer.upload(&grey_frame(stage.intrinsics.size_px))?;
        renderer.draw(&(stage.poses)(0), Shown::Composite);
        renderer.wait().context("the first frame")?;
        let after = gpu.allocated_bytes();
        let grown = before.zip(after);
        Ok(Self {
            renderer,
            frames_ms: Vec::new(),
            memory_mib: grown
                .map(|(before, after)| after.saturating_sub(before) as f64 / 1024.0 / 1024.0),
        })
    }

    /// Milliseconds of a frame.
    fn draw(&mut self, stage: &Setup, frame: usize) -> Result<f64> {
        let poses = (stage.poses)(frame);
        let (waited, ms) = Stopwatch::time(|| {
            self.renderer.set_time(frame as f64 / FRAME_RATE);
            self.renderer.draw(&poses, Shown::Composite);
            self.renderer.wait()
        });
        waited?;
        Ok(ms)
    }
}
