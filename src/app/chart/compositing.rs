//! Compositing: the three ways to take what is hidden of a room's light out of the video, against the truth; and what the
//! paper's own way makes of sources that are hidden otherwise than it takes for granted.

use std::f32::consts::PI;
use std::path::PathBuf;

use anyhow::{Context as _, Result};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::family::Chart;
use super::figure::{Axis, Figure, FigurePanel, Point, Series};
use super::lab::Lab;
use super::measured::rounded;
use super::shots::{Shots, mean};
use crate::app::precomputed;
use crate::scene::{Difference, Scene};
use crate::shafts::intensity_transfers::{encoded, intensity_transfers};
use crate::shafts::luminance;
use crate::shafts::room_transport::RoomTransport;

/// The chart.
pub struct Compositing;

/// One way at one number of sources: those that get a shadow each, or those that are hidden.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CompositingRow {
    unit: String,
    way: String,
    sources: usize,
    /// How many times too bright surfaces are said to be.
    albedo: f64,
    /// Of the level that a vertex gets, against the exact one.
    error_levels: Option<f64>,
    factor_rms: Option<f64>,
    change_real: Option<f64>,
    residual_virtual: Option<f64>,
}

const SETS: &str = "sets";
/// Reflectances that are said to be so many times what they are.
const ALBEDO: &str = "albedo";
/// The recording with a probe.
const ROOM: &str = "room";
const WAYS: [(&str, Difference); 3] = [
    ("ratio", Difference::Ratio),
    ("subtract", Difference::Subtract),
    ("ldr", Difference::Encoded),
];
const SOURCES: [u32; 5] = [10, 20, 50, 100, 200];
const ALBEDOS: [f64; 5] = [0.6, 0.8, 1.0, 1.1, 1.2];
const AT_SOURCES: u32 = 50;
/// Sources of which some are hidden, as in the paper's figure 3.
const OF: usize = 50;
/// How many of them are in the first of the two sets.
const IN_FIRST: [usize; 3] = [25, 38, 50];
/// The part of a vertex's light that they are drawn from, the brightest first: the paper's source set.
const SOURCE_POWER: f32 = 0.7;
/// Vertices that the experiment is made at.
const VERTICES: usize = 4;

impl Chart for Compositing {
    const NAME: &'static str = "compositing";
    const FAMILY: &'static str = "shadows";
    const SHOWS: &'static str = "How what virtual things hide of a room's light is taken out of the video, at true poses \
        against the path-traced truth: as a part of the pixel's linear light (*ratio*), as radiance in linear light \
        (*subtract*), or from the encoded levels (*ldr*, Gibson et al. 2003, section 7.1). Left the paper's figure 3: 50 \
        sources drawn by lot, some of them hidden at random, and how far the level is off that the intensity transfers \
        lead to, for sets of 25 and 25, 38 and 12, and one of all 50; at four vertices of the room. Right the room again, \
        with all real reflectances said to be brighter or darker than they are.";
    type Row = CompositingRow;

    fn inputs(&self, lab: &Lab<'_>) -> Result<Vec<PathBuf>> {
        let room = lab.recording(ROOM)?;
        Ok(vec![room.folder, room.scene])
    }

    fn units(&self, lab: &Lab<'_>) -> Result<Vec<String>> {
        let units: &[&str] = match lab.quick {
            true => &[SETS, ROOM],
            false => &[SETS, ROOM, ALBEDO],
        };
        Ok(units.iter().map(|unit| (*unit).to_owned()).collect())
    }

    fn measure(&self, lab: &Lab<'_>, unit: &str) -> Result<Option<Vec<CompositingRow>>> {
        let recording = lab.recording(ROOM)?;
        let scene = recording.load_scene()?;
        if unit == SETS {
            return sets(&scene, if lab.quick { 200 } else { 10_000 }).map(Some);
        }
        let shots = Shots::of(lab, &recording, &scene)?;
        // For a look the cheapest do.
        let most = if lab.quick { 2 } else { usize::MAX };
        let settings: Vec<(u32, f64)> = match unit {
            ALBEDO => ALBEDOS.map(|albedo| (AT_SOURCES, albedo)).to_vec(),
            _ => SOURCES.map(|sources| (sources, 1.0)).to_vec(),
        };
        let mut rows = Vec::new();
        for (way, difference) in WAYS {
            for &(sources, albedo) in settings.iter().take(most) {
                if lab.is_stopped() {
                    return Ok(None);
                }
                let mut scene = said_to_reflect(&scene, albedo);
                scene.shadows.shafts.difference = difference;
                scene.shadows.shafts.sources = Some(sources);
                let errors = shots.errors(&shots.draw(&lab.gpu()?, &scene)?)?;
                let of = |of| Some(rounded(mean(&errors, of)));
                rows.push(CompositingRow {
                    unit: unit.to_owned(),
                    way: way.to_owned(),
                    sources: sources as usize,
                    albedo,
                    error_levels: None,
                    factor_rms: of(|errors| errors.factor),
                    change_real: of(|errors| errors.change_real),
                    residual_virtual: of(|errors| errors.residual_virtual),
                });
            }
        }
        Ok(Some(rows))
    }

    fn figure(&self, rows: &[CompositingRow]) -> Figure {
        type Metric = (&'static str, fn(&CompositingRow) -> Option<f64>);
        let at = |row: &CompositingRow| match row.unit.as_str() {
            ALBEDO => row.albedo,
            _ => row.sources as f64,
        };
        let panel = |title: &str, x: Axis, unit: &str, ways: &[String], metric: Metric| {
            let (name, value) = metric;
            let series = ways.iter().enumerate().map(|(look, way)| Series {
                name: way.clone(),
                // Sets and ways are no kin: a colour is the one or the other.
                look: if unit == SETS {
                    look + WAYS.len()
                } else {
                    look
                },
                joined: true,
                points: rows
                    .iter()
                    .filter(|row| row.unit == unit && row.way == *way)
                    .filter_map(|row| Some(Point::named(at(row), value(row)?, "")))
                    .collect(),
            });
            FigurePanel {
                title: title.to_owned(),
                x,
                y: Axis::from_zero(name),
                series: series.collect(),
                ..FigurePanel::default()
            }
        };
        let sets = IN_FIRST.map(set_name);
        let ways = WAYS.map(|(name, _)| name.to_owned());
        let metrics: [Metric; 2] = [
            ("error of the factor, rms", |row| row.factor_rms),
            ("error of the change", |row| row.change_real),
        ];
        let mut panels = vec![panel(
            "intensity transfers: sets of sources",
            Axis::from_zero("sources hidden, of 50"),
            SETS,
            &sets,
            ("error, levels of 255, rms", |row| row.error_levels),
        )];
        panels.extend(metrics.map(|metric| {
            let x = Axis::log("sources with a shadow each");
            panel(&format!("room: {}", metric.0), x, ROOM, &ways, metric)
        }));
        let albedo = Axis {
            label: "said reflectances / true ones".to_owned(),
            ..Axis::default()
        };
        let title = format!("room, {AT_SOURCES} sources, reflectances off");
        if rows.iter().any(|row| row.unit == ALBEDO) {
            panels.push(panel(&title, albedo, ALBEDO, &ways, metrics[1]));
        }
        Figure {
            title: "How hidden light is taken out of the video".to_owned(),
            reading: "The lower the better.".to_owned(),
            columns: panels.len(),
            panel_size: [380.0, 320.0],
            panels,
        }
    }
}

/// The scene with all that is real said to reflect so many times what it does.
fn said_to_reflect(scene: &Scene, albedo: f64) -> Scene {
    let mut scene = scene.clone();
    let phantoms = scene.phantoms.iter_mut();
    for material in phantoms.flat_map(|phantom| &mut phantom.materials) {
        material.albedo = (material.albedo * albedo).min(DVec3::ONE);
    }
    let parts = scene.probe.iter_mut().flat_map(|probe| &mut probe.room);
    for (_, said) in parts.flat_map(|part| &mut part.triangles) {
        *said = said.map(|said| (said * albedo as f32).min(Vec3::ONE));
    }
    scene
}

fn set_name(in_first: usize) -> String {
    match OF - in_first {
        0 => format!("one set of {OF}"),
        rest => format!("sets of {in_first} and {rest}"),
    }
}

/// Gibson et al. 2003, figure 3.
fn sets(scene: &Scene, trials: usize) -> Result<Vec<CompositingRow>> {
    let probe = scene.probe.as_ref().context("the room has a probe")?;
    let room = scene.room(probe);
    let room = precomputed::ready_room(&room).transport;
    let mut random = fastrand::Rng::with_seed(3);
    let vertices = vertices_near(&room, scene);
    let mut rows = Vec::new();
    for in_first in IN_FIRST {
        for hidden in (0..=OF).step_by(5) {
            let mut squared = 0.0;
            for trial in 0..trials {
                let (radiance, sources) = lit(&room, vertices[trial % vertices.len()], &mut random);
                squared += squared_error(radiance, &sources, hidden, in_first, &mut random);
            }
            let rms = (squared / trials as f64).sqrt();
            rows.push(CompositingRow {
                unit: SETS.to_owned(),
                way: set_name(in_first),
                sources: hidden,
                albedo: 1.0,
                error_levels: Some(rounded(255.0 * rms)),
                factor_rms: None,
                change_real: None,
                residual_virtual: None,
            });
        }
    }
    Ok(rows)
}

/// The vertices nearest to where the virtual things stand.
fn vertices_near(room: &RoomTransport, scene: &Scene) -> Vec<usize> {
    let places = scene
        .virtuals
        .iter()
        .map(|thing| thing.anchor_from_object.translation.as_vec3());
    let middle = places.clone().sum::<Vec3>() / places.count().max(1) as f32;
    let vertices = &room.patches.vertices;
    let mut nearest: Vec<usize> = (0..vertices.len()).collect();
    let distance = |&vertex: &usize| vertices[vertex].position.distance_squared(middle);
    nearest.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.truncate(VERTICES);
    nearest
}

/// A vertex's radiance as a grey surface, at half the camera's range, and that of some of its sources, those that send most
/// first.
fn lit(room: &RoomTransport, vertex: usize, random: &mut fastrand::Rng) -> (Vec3, Vec<Vec3>) {
    let irradiance = room.irradiance[vertex];
    let scale = 0.5 / luminance(irradiance);
    let row = room.transfers.row(vertex);
    let each = row.iter().zip(&room.source_radiance);
    let mut given: Vec<Vec3> = each
        .map(|(&part, &radiance)| radiance * (PI * part * scale))
        .collect();
    let brightest_first = |a: &Vec3, b: &Vec3| luminance(*b).total_cmp(&luminance(*a));
    given.sort_by(brightest_first);
    let mut rest = SOURCE_POWER * given.iter().map(|given| luminance(*given)).sum::<f32>();
    let enough = given.iter().position(|given| {
        rest -= luminance(*given);
        rest <= 0.0
    });
    given.truncate(enough.map_or(OF, |last| last + 1).max(OF));
    let mut sources = random.choose_multiple(given, OF);
    sources.sort_by(brightest_first);
    (irradiance * scale, sources)
}

/// Of one channel, over all three, when so many sources are hidden.
fn squared_error(
    radiance: Vec3,
    sources: &[Vec3],
    hidden: usize,
    in_first: usize,
    random: &mut fastrand::Rng,
) -> f64 {
    let by_lot = |count: usize, random: &mut fastrand::Rng| {
        let mut drawn = vec![false; sources.len()];
        drawn.iter_mut().take(count).for_each(|is| *is = true);
        random.shuffle(&mut drawn);
        drawn
    };
    let sets = by_lot(in_first, random);
    let is_hidden = by_lot(hidden, random);
    let in_sets = sets.iter().map(|&first| usize::from(!first));
    let transfers = intensity_transfers::<2>(radiance, in_sets.zip(sources.iter().copied()));
    let sum = |what: &[Vec3]| -> Vec3 {
        let hidden = what.iter().zip(&is_hidden);
        hidden
            .filter(|(_, is_hidden)| **is_hidden)
            .map(|(what, _)| *what)
            .sum()
    };
    let level = encoded(radiance) - sum(&transfers);
    let off = level - encoded(radiance - sum(sources));
    f64::from(off.length_squared()) / 3.0
}
