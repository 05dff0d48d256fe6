//! What phantoms that stand beside their real things do to the shadow: moved, turned, or not there at all. Each figure is
//! the mean over the frames and, where a phantom is moved or turned, over the four directions in the table's plane or
//! both senses about its own upright axis; all phantoms but the table's move alike.
//!
//! `lamp` is held against the path-traced truth at true poses (the session in `../shared` where it is there, else the
//! recording that ships), `double_shadow` against its exact mask and the gain of the exact phantom. Columns:
//! - `what`: the scene, and what was done to its phantoms (moved: millimetres, turned: degrees, left out: 1)
//! - `amount_mm_or_deg`: by how much
//! - `wrong_shadow_pct`: pixels whose bit "a virtual thing hides the light" is wrong, percent of the real pixels that face it
//! - `factor_rms`: root mean square error of the gain on real pixels that the truth darkens; on `lamp` after the truth's
//!   own 5 x 5 box filter, and more than 2 pixels inside
//! - `rim_px`: pixels in a frame within 6 pixels of a real thing's outline whose gain differs from that of the exact
//!   phantom by more than 0.1 in any channel
//! - `residual_real`: root mean square of picture - truth over that of the bare video - truth, on real pixels that the
//!   truth changes; empty where there is no video

#[path = "../tests/common/mod.rs"]
mod common;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Parser;
use glam::{DAffine3, DVec3};
use gnomon::capture::{Frame, load_calibration};
use gnomon::geometry::camera::Intrinsics;
use gnomon::render::{Layers, Renderer};
use gnomon::scene::Scene;

use common::ray_cast::{FACES_AWAY, REAL, VIRTUAL_HIDES};
use common::truth::{Drawn, Truth, around, compare, draw, edges, key_frames};
use common::{StabilityRow, gpu, grey_frame, project_file, stability_row};

/// How far from an outline a pixel still belongs to the rim, pixels.
const RIM_REACH_PX: i64 = 6;
/// Differences of the gain from there on are counted.
const VISIBLE_GAIN: f64 = 0.1;

/// Charts the shadow's error against the displacement of phantoms.
#[derive(Parser)]
struct Options {
    /// Where to write the figures
    #[arg(long)]
    csv: Option<PathBuf>,
    /// What `cargo bench` adds
    #[arg(long, hide = true)]
    bench: bool,
}

/// A scene with its frames, and which of its phantoms are not the table.
struct Case {
    name: &'static str,
    scene: Scene,
    moving: &'static [&'static str],
    intrinsics: Intrinsics,
    shots: Vec<Shot>,
}

struct Shot {
    frame: Frame,
    camera_from_anchor: Vec<Option<DAffine3>>,
    reference: Reference,
}

/// What a frame is held against.
enum Reference {
    Traced(Box<Truth>),
    /// As `tests/stability` has it: id + 4 · bits.
    ExactMask(Vec<u8>),
}

/// What is done to the phantoms.
#[derive(Clone, Copy)]
enum Change {
    Moved(DVec3),
    Turned(f64),
    LeftOut,
}

#[derive(Default)]
struct Errors {
    wrong_shadow_pct: f64,
    factor_rms: f64,
    rim_px: f64,
    residual_real: Option<f64>,
}

fn main() -> Result<()> {
    let options = Options::parse();
    println!("{}", gpu().description());
    let header = "what,amount_mm_or_deg,wrong_shadow_pct,factor_rms,rim_px,residual_real";
    let mut csv = format!("{header}\n");
    println!("{}", header.replace(',', "  "));
    for case in [lamp()?, double_shadow()] {
        let exact = case.drawn(Change::Moved(DVec3::ZERO))?;
        let bare_table = case.drawn(Change::LeftOut)?;
        let rims: Vec<Vec<bool>> = exact
            .iter()
            .zip(&bare_table)
            .map(|(exact, bare_table)| {
                rim(&exact.layers, &bare_table.layers, case.intrinsics.size_px)
            })
            .collect();
        for (what, amount, changes) in rows() {
            let mut all = Vec::new();
            for change in changes {
                let drawn = case.drawn(change)?;
                for (index, (shot, drawn)) in case.shots.iter().zip(&drawn).enumerate() {
                    all.push(shot.errors(drawn, &exact[index].layers, &rims[index]));
                }
            }
            let mean = Errors::mean(&all);
            let residual = mean
                .residual_real
                .map_or(String::new(), |residual| format!("{residual:.4}"));
            let row = format!(
                "{} {what},{amount},{:.4},{:.4},{:.1},{residual}",
                case.name, mean.wrong_shadow_pct, mean.factor_rms, mean.rim_px
            );
            println!("{}", row.replace(',', "  "));
            writeln!(csv, "{row}")?;
        }
    }
    match options.csv {
        Some(path) => std::fs::write(&path, csv).with_context(|| path.display().to_string()),
        None => Ok(()),
    }
}

/// What was done, by how much, and the changes that it is the mean of.
fn rows() -> Vec<(&'static str, f64, Vec<Change>)> {
    let directions = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y];
    let mut rows = vec![("moved", 0.0, vec![Change::Moved(DVec3::ZERO)])];
    for mm in [0.5, 1.0, 2.0, 5.0] {
        let moved = directions.map(|direction| Change::Moved(1e-3 * mm * direction));
        rows.push(("moved", mm, moved.to_vec()));
    }
    for degrees in [0.25, 0.5, 1.0] {
        let turned = [1.0, -1.0].map(|sense: f64| Change::Turned((sense * degrees).to_radians()));
        rows.push(("turned", degrees, turned.to_vec()));
    }
    rows.push(("left out", 1.0, vec![Change::LeftOut]));
    rows
}

fn lamp() -> Result<Case> {
    let ships = project_file("recordings/lamp");
    let session = project_file("../shared/sessions/lamp");
    let folder = if session.is_dir() { &session } else { &ships };
    println!("lamp: {}", folder.display());
    let scene = Scene::load(&project_file("config/lamp.toml"))?;
    let shots =
        key_frames(folder, scene.anchors.len())
            .into_iter()
            .map(|(frame, camera_from_anchor)| Shot {
                reference: Reference::Traced(Box::new(Truth::open(folder, frame.index))),
                frame,
                camera_from_anchor,
            });
    Ok(Case {
        name: "lamp",
        moving: &["house", "tin"],
        intrinsics: load_calibration(&ships.join("camera.toml"))?,
        shots: shots.collect(),
        scene,
    })
}

fn double_shadow() -> Case {
    let folder: &Path = &project_file("tests/stability");
    let StabilityRow { stage, view, exact } = stability_row(folder, "double_shadow");
    let shot = Shot {
        frame: grey_frame(view.intrinsics.size_px),
        camera_from_anchor: stage.poses(view.camera_from_world).to_vec(),
        reference: Reference::ExactMask(exact),
    };
    Case {
        name: "double_shadow",
        scene: stage.scene,
        // Phantom 0 is its table.
        moving: &["phantom 1"],
        intrinsics: view.intrinsics,
        shots: vec![shot],
    }
}

impl Case {
    /// All frames with changed phantoms.
    fn drawn(&self, change: Change) -> Result<Vec<Drawn>> {
        let mut scene = self.scene.clone();
        let moves = |name: &str| self.moving.contains(&name);
        if let Change::LeftOut = change {
            scene.phantoms.retain(|phantom| !moves(&phantom.name));
        }
        for phantom in &mut scene.phantoms {
            if !moves(&phantom.name) {
                continue;
            }
            let anchor_from_object = phantom.anchor_from_object;
            phantom.anchor_from_object = match change {
                Change::Moved(by_m) => DAffine3::from_translation(by_m) * anchor_from_object,
                Change::Turned(by) => anchor_from_object * DAffine3::from_rotation_z(by),
                Change::LeftOut => anchor_from_object,
            };
        }
        let mut renderer = Renderer::new(gpu(), &scene, self.intrinsics)?;
        let drawn = self
            .shots
            .iter()
            .map(|shot| draw(&mut renderer, &shot.frame, &shot.camera_from_anchor));
        Ok(drawn.collect())
    }
}

impl Shot {
    fn errors(&self, drawn: &Drawn, exact: &Layers, rim: &[bool]) -> Errors {
        let differences = drawn
            .layers
            .gain
            .iter()
            .zip(&exact.gain)
            .map(|(gain, exact)| {
                std::array::from_fn::<f64, 3, _>(|channel| {
                    f64::from(gain[channel] - exact[channel])
                })
            });
        let rim_px = differences
            .clone()
            .zip(rim)
            .filter(|(difference, inside)| {
                **inside && difference.iter().any(|value| value.abs() > VISIBLE_GAIN)
            })
            .count() as f64;
        match &self.reference {
            Reference::Traced(truth) => {
                let errors = compare(self.frame.index, truth, drawn);
                Errors {
                    wrong_shadow_pct: errors.wrong_pct,
                    factor_rms: errors.factor,
                    rim_px,
                    residual_real: Some(errors.residual_real),
                }
            }
            Reference::ExactMask(mask) => {
                let bits = &drawn.layers.shadow[0];
                let lit = mask.iter().zip(bits).filter(|&(&mask, _)| {
                    let (id, exact_bits) = (mask & 3, mask >> 2);
                    id == 1 && exact_bits & FACES_AWAY == 0
                });
                let wrong = lit
                    .clone()
                    .filter(|&(&mask, &bits)| (mask >> 2 ^ bits) & VIRTUAL_HIDES != 0)
                    .count();
                let darkened =
                    differences
                        .zip(&exact.gain)
                        .zip(&exact.role)
                        .filter(|((_, gain), role)| {
                            **role == REAL && f64::from(gain.iter().sum::<f32>()) / 3.0 < 0.995
                        });
                let squares: Vec<f64> = darkened
                    .flat_map(|((difference, _), _)| difference.map(|value| value * value))
                    .collect();
                Errors {
                    wrong_shadow_pct: 100.0 * wrong as f64 / lit.count() as f64,
                    factor_rms: (squares.iter().sum::<f64>() / squares.len() as f64).sqrt(),
                    rim_px,
                    residual_real: None,
                }
            }
        }
    }
}

impl Errors {
    fn mean(all: &[Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        let residuals: Option<Vec<f64>> = all.iter().map(|errors| errors.residual_real).collect();
        Self {
            wrong_shadow_pct: mean(|errors| errors.wrong_shadow_pct),
            factor_rms: mean(|errors| errors.factor_rms),
            rim_px: mean(|errors| errors.rim_px),
            residual_real: residuals
                .map(|residuals| residuals.iter().sum::<f64>() / residuals.len() as f64),
        }
    }
}

/// Real pixels near the outline of what stands on the table: there it is nearer than the table alone.
fn rim(exact: &Layers, bare_table: &Layers, size_px: [u32; 2]) -> Vec<bool> {
    let width = size_px[0] as usize;
    let stands: Vec<u8> = (0..exact.role.len())
        .map(|i| u8::from(exact.role[i] == REAL && exact.depth_m[i] != bare_table.depth_m[i]))
        .collect();
    let outline = edges(&stands, width);
    (0..outline.len())
        .map(|i| {
            let near = |i| around(i, RIM_REACH_PX, width, outline.len()).any(|near| outline[near]);
            exact.role[i] == REAL && near(i)
        })
        .collect()
}
