//! An environment's light: time per frame against how far the picture is from the truth, for each method and its numbers, in a
//! recording and on a table where a torus turns (Tamura et al. 2005, figures 6 and 7, table 1).

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::environment_gloss::GlossyThing;
use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series, pareto_front};
use super::lab::Lab;
use super::measured::rounded;
use super::peers_table::{PeersStage, TORUS_CENTER_M, torus};
use super::shots::{Shots, grey_frame, mean};
use crate::app::precomputed;
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::capture::linear::linear;
use crate::environment::self_occlusion::{OwnSpace, OwnSurface, SelfOcclusion};
use crate::geometry::camera::Intrinsics;
use crate::geometry::ray_caster::RayCaster;
use crate::light::Material;
use crate::light::probe::Probe;
use crate::light::regions::regions;
use crate::render::{REAL, Renderer, Shown};
use crate::scene::{EnvironmentMethod, ProbeScene, Scene, Technique};

/// The chart.
pub struct EnvironmentChart;

/// One way to draw one stage.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct EnvironmentRow {
    stage: String,
    method: String,
    regions: u32,
    map_px: u32,
    ambient_samples: u32,
    frame_median_ms: f64,
    /// Of recordings.
    change_real: Option<f64>,
    factor_rms: Option<f64>,
    residual_virtual: Option<f64>,
    /// Of turning things: against the sum over all of the probe's pixels.
    gain_rms: Option<f64>,
    /// Against the sum over the same regions, as lights without a size.
    gain_rms_of_regions: Option<f64>,
    /// Of glossy ones: what they mirror against rays over all of the probe, as a part of what they mirror.
    gloss_rms: Option<f64>,
    /// What the thing hides from itself: to work out, and to keep.
    precomputed_s: Option<f64>,
    precomputed_kb: Option<f64>,
}

/// The recording whose light comes from afar.
const SKY: &str = "sky";
/// As the paper has them: so many corners, matt or glossy.
const TURNING: [(&str, usize, bool); 4] = [
    ("2,400 corners, matt", 2_421, false),
    ("2,400 corners, glossy", 2_421, true),
    ("45,000 corners, matt", 44_856, false),
    ("45,000 corners, glossy", 44_856, true),
];
const REGIONS: [u32; 3] = [16, 32, 64];
const MAPS_PX: [u32; 3] = [32, 64, 128];
const SAMPLES: [u32; 3] = [64, 256, 1024];
/// Width and height of the paper's pictures.
const SIZE_PX: [u32; 2] = [512, 512];
/// Of the turning things' probe: few enough to sum all of its pixels up.
const PROBE_PX: [usize; 2] = [64, 32];
/// Every so many pixels the gain is held against the sums.
const LOOKED_AT: usize = 131;
/// And every so many what is mirrored.
const GLOSS_LOOKED_AT: usize = 37;

/// A method and its numbers.
struct Way {
    method: EnvironmentMethod,
    series: &'static str,
    regions: u32,
    map_px: u32,
    ambient_samples: u32,
}

impl Way {
    /// All of them.
    fn all(quick: bool) -> Vec<Self> {
        let mut ways = Vec::new();
        let mut add = |method, series, (regions, map_px, ambient_samples)| {
            ways.push(Self {
                method,
                series,
                regions,
                map_px,
                ambient_samples,
            });
        };
        for (regions, series) in REGIONS.into_iter().zip(MAPS) {
            for map_px in MAPS_PX {
                let numbers = (regions, map_px, 256);
                add(EnvironmentMethod::Maps, series, numbers);
            }
        }
        for regions in REGIONS {
            let numbers = (regions, 128, 256);
            add(EnvironmentMethod::Penumbrae, PENUMBRAE, numbers);
        }
        for samples in SAMPLES {
            let numbers = (64, 128, samples);
            add(EnvironmentMethod::Rays, RAYS, numbers);
        }
        if quick {
            ways.retain(|way| way.regions == 16 || way.ambient_samples == 64);
        }
        ways
    }

    /// A scene drawn this way.
    fn of(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.shadows.technique = Technique::Environment;
        scene.shadows.ambient_samples = self.ambient_samples;
        let environment = &mut scene.shadows.environment;
        environment.method = self.method;
        environment.regions = self.regions;
        environment.map_px = self.map_px;
        scene
    }

    fn row(&self, stage: &str, frames_ms: &[f64]) -> EnvironmentRow {
        EnvironmentRow {
            stage: stage.to_owned(),
            method: self.series.to_owned(),
            regions: self.regions,
            map_px: self.map_px,
            ambient_samples: self.ambient_samples,
            frame_median_ms: rounded(quantile(frames_ms, 0.5)),
            change_real: None,
            factor_rms: None,
            residual_virtual: None,
            gain_rms: None,
            gain_rms_of_regions: None,
            gloss_rms: None,
            precomputed_s: None,
            precomputed_kb: None,
        }
    }
}

const MAPS: [&str; 3] = ["maps, 16 regions", "maps, 32 regions", "maps, 64 regions"];
const PENUMBRAE: &str = "penumbrae";
const RAYS: &str = "rays";
const SERIES: [&str; 5] = [MAPS[0], MAPS[1], MAPS[2], PENUMBRAE, RAYS];

impl Chart for EnvironmentChart {
    const NAME: &'static str = "environment";
    const FAMILY: &'static str = "environment";
    const SHOWS: &'static str = "An environment's light by each method: the paper's maps (16, 32 and 64 regions; labels: the maps' \
        width), the same maps with a penumbra at each pixel (labels: regions), and rays (labels: samples). `sky`: the recording \
        under a low sun, against its path-traced truth. The others: a black torus that turns in every frame over a black table, \
        512 x 512 pixels, all light broad; the error of the gain against the sum over all of the probe's pixels by rays, and, \
        in the table alone, against the sum over the same regions. What the glossy ones mirror is held against GGX's lobe over all of \
        the probe by rays: maps are the paper's Phong lobe over 16 harmonics, all others GGX's over the filtered probe. `precomputed`: what the torus hides from itself.";
    type Row = EnvironmentRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let recordings = lab.recordings()?.into_iter();
        let sky = recordings.filter(|recording| recording.name == SKY);
        Ok(sky.flat_map(|sky| [sky.folder, sky.scene]).collect())
    }

    fn units(&self, lab: &Lab<'_>) -> Result<Vec<String>> {
        let names = lab.recording_names()?;
        let has_sky = names.iter().any(|name| name == SKY);
        let turning = TURNING.iter().map(|(name, _, _)| *name);
        let units = std::iter::once(SKY).chain(turning);
        // (All of them need its probe.)
        Ok(units.filter(|_| has_sky).map(str::to_owned).collect())
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<EnvironmentRow>>> {
        let recording = lab.recording(SKY)?;
        let scene = recording.load_scene()?;
        match TURNING.iter().find(|(name, _, _)| *name == unit) {
            Some(&(_, corners, is_glossy)) => {
                let probe = scene.probe.as_ref().context("the sky has a probe")?;
                Turning::new(corners, is_glossy, probe)?.measure(lab, unit)
            }
            None => {
                let shots = Shots::of(lab, &recording, &scene)?;
                measure_recording(lab, unit, &scene, &shots)
            }
        }
    }

    fn figure(&self, rows: &[EnvironmentRow]) -> Figure {
        type Metric = (&'static str, fn(&EnvironmentRow) -> Option<f64>);
        let of_recording: [Metric; 2] = [
            ("error of the change on real surfaces", |row| {
                row.change_real
            }),
            ("error of the virtual things' shading", |row| {
                row.residual_virtual
            }),
        ];
        let of_turning: [Metric; 1] = [("error of the gain, rms", |row| row.gain_rms)];
        let of_gloss: [Metric; 1] = [("error of what is mirrored", |row| row.gloss_rms)];
        let mut panels = Vec::new();
        let turning = TURNING.iter().flat_map(|(name, _, is_glossy)| {
            let gloss = is_glossy.then_some((*name, &of_gloss[..]));
            std::iter::once((*name, &of_turning[..])).chain(gloss)
        });
        for (stage, metrics) in std::iter::once((SKY, &of_recording[..])).chain(turning) {
            for &(name, value) in metrics {
                panels.push(panel(rows, stage, name, value));
            }
        }
        Figure {
            title: "An environment's light: what a frame costs and how far it is from the truth".to_owned(),
            reading: "The lower and the farther left the better. Labels: the maps' width, regions, or samples.".to_owned(),
            columns: 2,
            panel_size: [520.0, 340.0],
            panels,
        }
    }
}

fn panel(
    rows: &[EnvironmentRow],
    stage: &str,
    name: &str,
    value: fn(&EnvironmentRow) -> Option<f64>,
) -> FigurePanel {
    let here = || rows.iter().filter(|row| row.stage == stage);
    let at = |row: &EnvironmentRow| Some([row.frame_median_ms, value(row)?]);
    let label = |row: &EnvironmentRow| match row.method.as_str() {
        RAYS => row.ambient_samples,
        PENUMBRAE => row.regions,
        _ => row.map_px,
    };
    let series = SERIES.iter().enumerate().map(|(look, &method)| Series {
        name: method.to_owned(),
        look,
        joined: true,
        points: here()
            .filter(|row| row.method == method)
            .filter_map(|row| {
                let [x, y] = at(row)?;
                Some(Point::named(x, y, &label(row).to_string()))
            })
            .collect(),
    });
    FigurePanel {
        title: format!("{stage}: {name}"),
        x: Axis::log("time per frame, ms"),
        y: Axis::log(name),
        series: series.collect(),
        front: pareto_front(here().filter_map(at)),
        ..FigurePanel::default()
    }
}

/// A recording at its true poses.
fn measure_recording(
    lab: &Lab<'_>,
    stage: &str,
    scene: &Scene,
    shots: &Shots,
) -> Result<Option<Vec<EnvironmentRow>>> {
    let mut rows = Vec::new();
    for way in Way::all(lab.quick) {
        if lab.is_stopped() {
            return Ok(None);
        }
        let mut renderer = precomputed::renderer(lab.gpu()?, &way.of(scene), shots.intrinsics)?;
        let drawn = shots.draw_with(&mut renderer)?;
        let errors = shots.errors(&drawn)?;
        let mut frames_ms = Vec::new();
        for _ in 0..lab.rounds().min(2) {
            for shot in &shots.shots {
                renderer.upload(&shot.frame)?;
                frames_ms.push(frame_ms(&mut renderer, &shot.camera_from_anchor)?);
            }
        }
        rows.push(EnvironmentRow {
            change_real: Some(rounded(mean(&errors, |errors| errors.change_real))),
            factor_rms: Some(rounded(mean(&errors, |errors| errors.factor))),
            residual_virtual: Some(rounded(mean(&errors, |errors| errors.residual_virtual))),
            ..way.row(stage, &frames_ms)
        });
    }
    Ok(Some(rows))
}

fn frame_ms(renderer: &mut Renderer, poses: &[Option<glam::DAffine3>]) -> Result<f64> {
    let (waited, ms) = Stopwatch::time(|| {
        renderer.draw(poses, Shown::Composite);
        renderer.wait()
    });
    waited?;
    Ok(ms)
}

/// A torus that turns over a table under a probe.
struct Turning {
    stage: PeersStage,
    probe: Probe,
}

impl Turning {
    fn new(corners: usize, is_glossy: bool, sky: &ProbeScene) -> Result<Self> {
        let probe = sky.probe.resampled(PROBE_PX);
        // (A torus has twice as many triangles as corners.)
        let casters = vec![(torus(2 * corners, 1.0), TORUS_CENTER_M)];
        let mut stage = PeersStage::new(casters, &[], SIZE_PX, 4);
        let scene = &mut stage.scene;
        // The table alone, as black as the torus: the gain then is of what is hidden alone.
        scene.phantoms.truncate(1);
        for object in scene.phantoms.iter_mut().chain(&mut scene.virtuals) {
            object.materials = vec![Material::matt(DVec3::ZERO)];
        }
        if is_glossy {
            scene.virtuals[0].materials[0].roughness = Some(0.2);
        }
        scene.ambient_radiance = DVec3::ZERO;
        scene.shadows.compact_penumbra_px = 0.0;
        scene.probe = Some(ProbeScene {
            probe: probe.clone(),
            ..sky.clone()
        });
        Ok(Self { stage, probe })
    }

    fn measure(&self, lab: &Lab<'_>, name: &str) -> Result<Option<Vec<EnvironmentRow>>> {
        let frames = if lab.quick { 1 } else { 4 };
        let (precomputed_s, precomputed_kb) = self.precomputed();
        let mut all = None;
        let mut rows = Vec::new();
        for way in Way::all(lab.quick) {
            let scene = way.of(&self.stage.scene);
            let gpu = lab.gpu()?;
            let mut renderer =
                precomputed::renderer(Arc::clone(&gpu), &scene, self.stage.intrinsics)?;
            renderer.upload(&grey_frame(SIZE_PX))?;
            let mut frames_ms = Vec::new();
            for frame in 0..=frames {
                if lab.is_stopped() {
                    return Ok(None);
                }
                frames_ms.push(frame_ms(&mut renderer, &self.stage.poses(frames - frame))?);
            }
            let layers = renderer.layers()?;
            let gloss_rms = self.gloss_rms(&layers.role, &renderer.read_picture()?);
            let places = self.places(&layers.role);
            let all = all.get_or_insert_with(|| self.gains(&places, &pixels(&self.probe)));
            let of_regions = regions(&self.probe, way.regions as usize);
            let lights: Vec<(DVec3, f64)> = of_regions
                .iter()
                .map(|region| (region.toward, region.irradiance.y))
                .collect();
            let of_regions = self.gains(&places, &lights);
            let off = |exact: &[f64]| {
                let found = places
                    .iter()
                    .map(|&(index, _)| f64::from(layers.gain[index][1]));
                let squares = found
                    .zip(exact)
                    .map(|(found, exact)| (found - exact).powi(2));
                Some(rounded(
                    (squares.sum::<f64>() / exact.len().max(1) as f64).sqrt(),
                ))
            };
            rows.push(EnvironmentRow {
                gain_rms: off(all),
                gain_rms_of_regions: off(&of_regions),
                gloss_rms: gloss_rms.map(rounded),
                precomputed_s: Some(rounded(precomputed_s)),
                precomputed_kb: Some(rounded(precomputed_kb)),
                // (The first one makes what is made once.)
                ..way.row(name, &frames_ms[1..])
            });
        }
        Ok(Some(rows))
    }

    /// How far what the torus mirrors is off, as a part of it, root mean square; `None` where it is matt. (The table below it is
    /// mirrored as the probe has it, in the truth too.)
    fn gloss_rms(&self, role: &[u8], picture: &[u8]) -> Option<f64> {
        let stage = &self.stage;
        let torus = &stage.scene.virtuals[0];
        torus.materials[0].roughness?;
        let poses = stage.poses(0);
        let world_from_camera = poses[0]?.inverse();
        let thing = GlossyThing {
            object: torus,
            world_from_anchor: world_from_camera * poses[torus.anchor]?,
            intrinsics: stage.intrinsics,
            world_from_camera,
        };
        let exposure = stage.scene.probe.as_ref()?.exposure;
        let truth = thing.radiances(role, GLOSS_LOOKED_AT, &pixels(&self.probe));
        let [mut squares, mut whole] = [0.0; 2];
        for (index, radiance) in truth {
            // (What is brighter than white is white.)
            let radiance = (exposure * radiance).min(1.0);
            squares += (f64::from(linear(picture[4 * index + 1])) - radiance).powi(2);
            whole += radiance * radiance;
        }
        Some((squares / whole).sqrt())
    }

    /// What the torus hides from itself: seconds to work out, kB to keep.
    fn precomputed(&self) -> (f64, f64) {
        let torus = &self.stage.scene.virtuals[0];
        let space = OwnSpace::new(&torus.anchor_from_object);
        let surface = OwnSurface::new(&torus.mesh, std::iter::once(torus.mesh.as_ref()), &space);
        let (occlusions, ms) = Stopwatch::time(|| surface.self_occlusions());
        let bytes = occlusions.len() * size_of::<SelfOcclusion>();
        (ms / 1e3, bytes as f64 / 1e3)
    }

    /// Pixels that show the table, some of them, and the places that they show.
    fn places(&self, role: &[u8]) -> Vec<(usize, Vec3)> {
        let world_from_camera = self.stage.poses(0)[0].map(|pose| pose.inverse());
        let Intrinsics {
            focal_px,
            center_px,
            ..
        } = self.stage.intrinsics;
        let width = SIZE_PX[0] as usize;
        let place = |index: usize| {
            let world_from_camera = world_from_camera.filter(|_| role[index] == REAL)?;
            let pixel = DVec2::new((index % width) as f64, (index / width) as f64);
            let way = ((pixel - center_px) / focal_px).extend(1.0);
            let eye = world_from_camera.translation;
            let way = world_from_camera.transform_vector3(way);
            Some((index, (eye - way * (eye.z / way.z)).as_vec3()))
        };
        (0..role.len())
            .step_by(LOOKED_AT)
            .filter_map(place)
            .collect()
    }

    /// What the torus leaves at each place of light from directions (each with its irradiance across it), above the table.
    fn gains(&self, places: &[(usize, Vec3)], lights: &[(DVec3, f64)]) -> Vec<f64> {
        let stage = &self.stage;
        let poses = stage.poses(0);
        let torus = &stage.scene.virtuals[0];
        let placed = poses[0].zip(poses[torus.anchor]);
        let Some(world_from_anchor) = placed.map(|(world, anchor)| world.inverse() * anchor) else {
            return vec![1.0; places.len()];
        };
        let positions = torus.positions_in_anchor(&torus.mesh).into_iter();
        let positions: Vec<Vec3> = positions
            .map(|position| {
                world_from_anchor
                    .transform_point3(position.as_dvec3())
                    .as_vec3()
            })
            .collect();
        let triangles = torus.mesh.triangles.iter();
        let triangles: Vec<[Vec3; 3]> = triangles
            .map(|triangle| triangle.map(|index| positions[index as usize]))
            .collect();
        let caster = RayCaster::new(&triangles);
        let gain = |&(_, place): &(usize, Vec3)| {
            let (mut reaching, mut left) = (0.0, 0.0);
            for &(toward, irradiance) in lights.iter().filter(|(toward, _)| toward.z > 0.0) {
                let light = irradiance * toward.z;
                reaching += light;
                if !caster.is_hidden(place, toward.as_vec3(), f32::INFINITY) {
                    left += light;
                }
            }
            left / reaching
        };
        places.par_iter().map(gain).collect()
    }
}

/// A probe's pixels as lights; of a bright one as many as keep each below a share of all.
fn pixels(probe: &Probe) -> Vec<(DVec3, f64)> {
    const MOST_SHARE: f64 = 1e-3;
    let [width, _] = probe.size_px();
    let irradiance =
        |index: usize, pixel: &Vec3| f64::from(pixel.y) * probe.pixel_solid_angle(index / width);
    let pixels = || probe.pixels().iter().enumerate();
    let all: f64 = pixels()
        .map(|(index, pixel)| irradiance(index, pixel))
        .sum();
    let lights = |(index, pixel): (usize, &Vec3)| {
        let whole = irradiance(index, pixel);
        let side = (whole / (all * MOST_SHARE)).sqrt().ceil().max(1.0);
        let count = side as usize;
        let (row, column) = ((index / width) as f64, (index % width) as f64);
        let at = move |part: usize| (part as f64 + 0.5) / side;
        (0..count * count).map(move |part| {
            let direction = probe.direction(column + at(part % count), row + at(part / count));
            (direction, whole / (side * side))
        })
    };
    pixels().flat_map(lights).collect()
}
