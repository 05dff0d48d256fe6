//! What becomes of a shadow when a phantom is not quite where the real thing is: the torus's shadow across the edge of the
//! box, rendered with the box displaced, turned or left out, against the same with it in its place.

mod common;

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use clap::Parser;
use glam::{DAffine3, DQuat, DVec3};
use gnomon::capture::Frame;
use gnomon::render::{Gpu, Layers, Renderer, Shown};

use common::{Csv, SIZE_PX, Stage, torus};

/// Measures shadows of displaced phantoms.
#[derive(Parser)]
struct Options {
    /// Part of the adapter's name
    #[arg(long)]
    adapter: Option<String>,
    /// Where to write the figures
    #[arg(long)]
    csv: Option<PathBuf>,
    /// What `cargo bench` adds
    #[arg(long, hide = true)]
    bench: bool,
}

/// A lamp that throws the torus's shadow across the box.
const LAMP_M: DVec3 = DVec3::new(0.25, -0.05, 0.35);
/// Beside the box, on the lamp's side.
const TORUS_M: DVec3 = DVec3::new(0.0, 0.01, 0.1);
/// A factor this far off is a rim that the eye sees.
const VISIBLE: f64 = 0.1;

fn main() -> Result<()> {
    let options = Options::parse();
    let gpu = Arc::new(Gpu::open(options.adapter.as_deref())?);
    println!("{}", gpu.description());
    let exact = shoot(&gpu, Some(DAffine3::IDENTITY))?;
    let mut csv = Csv::new(
        options.csv,
        "what,amount,wrong_shadow_pct,factor_rms,rim_px",
    );
    println!(
        "{:18} {:>7} {:>17} {:>11} {:>7}",
        "phantom", "amount", "wrong shadow, %", "factor rms", "rim px"
    );
    let mut row = |what: &str, amount: f64, errors: &[Error]| {
        let mean =
            |of: fn(&Error) -> f64| errors.iter().map(of).sum::<f64>() / errors.len().max(1) as f64;
        let (wrong, rms, rim) = (
            mean(|error| error.wrong_pct),
            mean(|error| error.factor_rms),
            mean(|error| error.rim_px),
        );
        println!("{what:18} {amount:7} {wrong:17.3} {rms:11.4} {rim:7.0}");
        csv.row(&[&what, &amount, &wrong, &rms, &rim]);
    };
    for moved_mm in [0.0, 0.5, 1.0, 2.0, 5.0] {
        let ways = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y];
        let errors: Result<Vec<Error>> = ways
            .into_iter()
            .map(|way| {
                let moved = DAffine3::from_translation(way * moved_mm * 1e-3);
                Ok(error(&exact, &shoot(&gpu, Some(moved))?))
            })
            .collect();
        row("moved, mm", moved_mm, &errors?);
    }
    for turned_deg in [0.25_f64, 0.5, 1.0] {
        let errors: Result<Vec<Error>> = [1.0, -1.0]
            .into_iter()
            .map(|way| {
                let turn = DQuat::from_rotation_z(way * turned_deg.to_radians());
                Ok(error(
                    &exact,
                    &shoot(&gpu, Some(DAffine3::from_quat(turn)))?,
                ))
            })
            .collect();
        row("turned, degrees", turned_deg, &errors?);
    }
    row("left out", 1.0, &[error(&exact, &shoot(&gpu, None)?)]);
    csv.finish()
}

/// The layers with the box moved about its own place; `None` without it.
fn shoot(gpu: &Arc<Gpu>, moved: Option<DAffine3>) -> Result<Layers> {
    let mut stage = Stage::new(vec![(torus(2_500, 0.7), TORUS_M)], &[LAMP_M], SIZE_PX, 4);
    // The box is the last phantom. What the real one casts is in the video wherever the phantom stands.
    match (moved, stage.scene.phantoms.last_mut()) {
        (Some(moved), Some(cuboid)) => {
            cuboid.casts = true;
            let place = cuboid.anchor_from_object.translation;
            let (there, back) = (
                DAffine3::from_translation(place),
                DAffine3::from_translation(-place),
            );
            cuboid.anchor_from_object = there * moved * back * cuboid.anchor_from_object;
        }
        _ => {
            stage.scene.phantoms.pop();
        }
    }
    let mut renderer = Renderer::new(Arc::clone(gpu), &stage.scene, stage.intrinsics)?;
    renderer.upload(&Frame {
        index: 0,
        time_secs: 0.0,
        size_px: SIZE_PX,
        rgba: vec![128; 4 * (SIZE_PX[0] * SIZE_PX[1]) as usize],
    })?;
    renderer.draw(&stage.poses(0), Shown::Composite);
    Ok(renderer.layers()?)
}

/// How far a picture's shadow is off, on the pixels that are real in both.
struct Error {
    /// Part of the pixels whose bit of the virtual shadow is wrong.
    wrong_pct: f64,
    /// Of the gain where either picture has one.
    factor_rms: f64,
    /// Pixels whose gain is visibly off.
    rim_px: f64,
}

fn error(exact: &Layers, found: &Layers) -> Error {
    const REAL: u8 = 100;
    const VIRTUAL_HIDES: u8 = 2;
    let (mut real, mut wrong, mut touched, mut rim) = (0.0, 0.0, 0.0, 0.0);
    let mut squares = 0.0;
    for index in 0..exact.role.len() {
        if exact.role[index] != REAL || found.role[index] != REAL {
            continue;
        }
        real += 1.0;
        let differs = (exact.shadow[0][index] ^ found.shadow[0][index]) & VIRTUAL_HIDES != 0;
        wrong += f64::from(u8::from(differs));
        let gains = [exact.gain[index][1], found.gain[index][1]].map(f64::from);
        if gains != [1.0; 2] {
            let off = gains[0] - gains[1];
            touched += 1.0;
            squares += off * off;
            rim += f64::from(u8::from(off.abs() > VISIBLE));
        }
    }
    Error {
        wrong_pct: 100.0 * wrong / f64::max(real, 1.0),
        factor_rms: (squares / f64::max(touched, 1.0)).sqrt(),
        rim_px: rim,
    }
}
