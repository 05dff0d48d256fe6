//! Things that move in a room's light (Gibson et al. 2003, figure 7): lifted from the table their shadow lightens, and
//! beside a real thing they lose what light it hides.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use glam::DVec3;
use serde::Serialize;

use super::AnyChart;
use super::lab::Lab;
use super::measured::{rounded, to_csv};
use super::sheet::{ENLARGED, Sheet, SheetPart, changed_part};
use super::shots::Shots;
use crate::app::files::picture_files::{write_small_rgb_png, write_text};
use crate::app::stages::progress::Progress;
use crate::app::truth::{Drawn, LinearPicture, draw};
use crate::render::VIRTUAL;
use crate::scene::Scene;

const NAME: &str = "moved";
/// The recording with a probe.
const ROOM: &str = "room";

/// The pictures.
pub struct Moved;

/// One picture.
#[derive(Debug, Clone, Serialize)]
struct MovedRow {
    thing: String,
    x_m: f64,
    y_m: f64,
    z_m: f64,
    /// The least part of its light that a real pixel is left, green.
    darkest: f64,
    /// Mean level of the virtual pixels, green.
    virtual_level: f64,
}

/// How high the torus hangs over where it stands in the scene.
const HEIGHTS_M: [f64; 4] = [0.0, 0.02, 0.06, 0.15];
/// Where the ball stands: away from the house, and ever nearer to the side of it that the window does not light.
const BALL_M: [[f64; 3]; 4] = [
    [0.12, -0.06, 0.018],
    [0.06, -0.02, 0.018],
    [0.02, 0.01, 0.018],
    [0.01, 0.003, 0.018],
];

/// The states of the scene that are drawn: a thing alone, and where it is.
fn states(scene: &Scene) -> Vec<(&'static str, Vec<Scene>)> {
    let alone = |thing: &str, places: &[DVec3]| {
        let place = |&place: &DVec3| {
            let mut scene = scene.clone();
            scene.virtuals.retain(|other| other.name == thing);
            for object in &mut scene.virtuals {
                object.anchor_from_object.translation = place;
            }
            scene
        };
        places.iter().map(place).collect::<Vec<_>>()
    };
    let torus = scene.virtuals.iter().find(|thing| thing.name == "torus");
    let stands = torus.map_or(DVec3::ZERO, |torus| torus.anchor_from_object.translation);
    let lifted = HEIGHTS_M.map(|height_m| stands + height_m * DVec3::Z);
    vec![
        ("torus", alone("torus", &lifted)),
        ("ball", alone("ball", &BALL_M.map(DVec3::from_array))),
    ]
}

impl AnyChart for Moved {
    fn name(&self) -> &'static str {
        NAME
    }

    fn family(&self) -> &'static str {
        "shadows"
    }

    fn shows(&self) -> &'static str {
        "Things that move in the light of the room that ships, as in figure 7 of Gibson et al. 2003. Above: a torus lifted \
         from the table, with the least part of its light that any real pixel is left. Below: a ball that comes nearer to \
         the house's side that the window does not light, with the mean level of its pixels."
    }

    fn unit_count(&self, _: &Lab<'_>) -> Result<usize> {
        Ok(1)
    }

    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool> {
        progress.tell(NAME);
        let recording = lab.recording(ROOM)?;
        let scene = recording.load_scene()?;
        let shots = Shots::of(lab, &recording, &scene)?;
        let shot = shots.shots.first().context("a key frame")?;
        let width = shots.size_px()[0] as usize;
        let (mut rows, mut sheet) = (Vec::new(), Vec::new());
        for (thing, states) in states(&scene) {
            let mut drawn = Vec::new();
            // For a look the first and the last do.
            let step = if lab.quick { states.len() - 1 } else { 1 };
            let states: Vec<&Scene> = states.iter().step_by(step).collect();
            for scene in &states {
                if lab.is_stopped() {
                    return Ok(false);
                }
                let mut renderer = crate::app::precomputed::renderer(
                    Arc::clone(&lab.gpu()?),
                    scene,
                    shots.intrinsics,
                )?;
                drawn.push(draw(&mut renderer, &shot.frame, &shot.camera_from_anchor)?);
            }
            let changed = |drawn: &Drawn| {
                let bare = LinearPicture::from_rgba(width, &drawn.bare);
                changed_part(&LinearPicture::from_rgba(width, &drawn.out).minus(&bare))
            };
            let parts = drawn.iter().filter_map(changed);
            let whole = parts.reduce(|all: SheetPart, part| all.union(&part));
            let whole = whole.context("it is seen")?;
            let mut cells = Vec::new();
            for (scene, drawn) in states.iter().zip(&drawn) {
                let place = scene.virtuals[0].anchor_from_object.translation;
                let row = MovedRow {
                    thing: thing.to_owned(),
                    x_m: place.x,
                    y_m: place.y,
                    z_m: rounded(place.z),
                    darkest: rounded(darkest(drawn)),
                    virtual_level: rounded(virtual_level(drawn)),
                };
                let label = match thing {
                    "ball" => format!("mean level {:.0}", row.virtual_level),
                    _ => format!(
                        "{:.0} cm up: {:.2} of the light",
                        100.0 * (row.z_m - states[0].virtuals[0].anchor_from_object.translation.z),
                        row.darkest
                    ),
                };
                let picture = LinearPicture::from_rgba(width, &drawn.out);
                cells.push(whole.cut(label, &picture, |level| level));
                rows.push(row);
            }
            sheet.push(cells);
        }
        let (size_px, rgba) = Sheet {
            title: "Things that move in a room's light",
            reading: "Above: what is left of the light where the shadow is darkest. Below: the ball's brightness beside the house.",
            enlarged: ENLARGED,
            rows: sheet,
        }
        .paint()?;
        write_text(&out.join(format!("{NAME}.csv")), &to_csv(&rows, true)?)?;
        write_small_rgb_png(&out.join(format!("{NAME}.png")), size_px, &rgba)?;
        progress.advance();
        Ok(true)
    }
}

fn darkest(drawn: &Drawn) -> f64 {
    let pixels = drawn.layers.gain.iter().zip(&drawn.layers.role);
    let real = pixels.filter(|(_, role)| **role != VIRTUAL);
    f64::from(real.map(|(gain, _)| gain[1]).fold(1.0, f32::min))
}

fn virtual_level(drawn: &Drawn) -> f64 {
    let pixels = drawn.out.chunks_exact(4).zip(&drawn.layers.role);
    let levels = pixels.filter(|(_, role)| **role == VIRTUAL);
    let levels: Vec<f64> = levels.map(|(pixel, _)| f64::from(pixel[1])).collect();
    levels.iter().sum::<f64>() / levels.len().max(1) as f64
}
