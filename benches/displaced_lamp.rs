//! What phantoms beside their real things do to the picture of `lamp`: house and tin moved, turned or not there at all,
//! at true poses against the path-traced truth (the session in `../shared` where it is there, else the recording that
//! ships). `displacement` holds a cleaner scene against itself; this one has what a camera would have seen.
//!
//! Each figure is the mean over the frames and, where phantoms are moved or turned, over four directions in the table's
//! plane or both senses about their own upright axes. Columns:
//! - `what`, `amount_mm_or_deg`: what was done to both phantoms, millimetres or degrees; 1 where they are left out
//! - `wrong_shadow_pct`: pixels whose bit "a virtual thing hides the light" is wrong, percent of the real ones that face it
//! - `factor_rms`: root mean square error of the gain on real pixels that the truth darkens, more than 2 pixels inside and
//!   after the 5 x 5 box filter that the truth's own factor has
//! - `rim_px`: real pixels of a frame within 6 pixels of a real thing's outline whose gain differs from that of the exact
//!   phantoms by more than 0.1 in any channel
//! - `residual_real`: root mean square of picture - truth over that of bare video - truth, where the truth changes

mod common;
#[path = "../tests/common/mod.rs"]
mod test_common;

use std::path::PathBuf;

use anyhow::Result;
use clap::Parser;
use glam::{DAffine3, DVec3};
use gnomon::capture::{Frame, load_calibration};
use gnomon::geometry::camera::Intrinsics;
use gnomon::render::{Layers, Renderer};
use gnomon::scene::Scene;

use common::{Csv, shared_folder};
use test_common::ray_cast::REAL;
use test_common::truth::{Drawn, Truth, around, compare, draw, edges, key_frames};
use test_common::{gpu, project_file};

/// How far from an outline a pixel still belongs to the rim, pixels.
const RIM_REACH_PX: i64 = 6;
/// Gains that differ by more are counted.
const VISIBLE_GAIN: f32 = 0.1;
/// The phantoms that are not the table's.
const STANDING: [&str; 2] = ["house", "tin"];

/// Charts the error of the shadow on `lamp` against the displacement of its phantoms.
#[derive(Parser)]
struct Options {
    /// Where to write the figures
    #[arg(long)]
    csv: Option<PathBuf>,
    /// What `cargo bench` adds
    #[arg(long, hide = true)]
    bench: bool,
}

struct Shot {
    frame: Frame,
    camera_from_anchor: Vec<Option<DAffine3>>,
    truth: Truth,
}

/// What is done to the phantoms.
#[derive(Clone, Copy)]
enum Change {
    Moved { by_m: DVec3 },
    Turned { by_rad: f64 },
    LeftOut,
}

/// The figures of a row, in the order of their columns.
type Errors = [f64; 4];

fn main() -> Result<()> {
    let options = Options::parse();
    println!("{}", gpu().description());
    let ships = project_file("recordings/lamp");
    let session = shared_folder().join("sessions/lamp");
    let folder = if session.is_dir() { &session } else { &ships };
    let intrinsics = load_calibration(&ships.join("camera.toml"))?;
    let scene = Scene::load(&project_file("config/lamp.toml"))?;
    let shots: Vec<Shot> = key_frames(folder, scene.anchors.len())
        .into_iter()
        .map(|(frame, camera_from_anchor)| Shot {
            truth: Truth::open(folder, frame.index),
            frame,
            camera_from_anchor,
        })
        .collect();
    println!("{}: {} frames", folder.display(), shots.len());

    let drawn = |change| draw_all(&scene, intrinsics, &shots, change);
    let exact = drawn(Change::Moved { by_m: DVec3::ZERO })?;
    let rims: Vec<Vec<bool>> = exact
        .iter()
        .zip(&drawn(Change::LeftOut)?)
        .map(|(exact, bare_table)| rim(&exact.layers, &bare_table.layers, intrinsics.size_px))
        .collect();
    let mut csv = Csv::new(
        options.csv,
        "what,amount_mm_or_deg,wrong_shadow_pct,factor_rms,rim_px,residual_real",
    );
    println!(
        "{:10} {:>7} {:>16} {:>10} {:>7} {:>13}",
        "phantoms", "amount", "wrong shadow, %", "factor rms", "rim px", "residual real"
    );
    for (what, amount, changes) in rows() {
        let mut sum = [0.0; 4];
        for &change in &changes {
            for (index, drawn) in drawn(change)?.iter().enumerate() {
                let errors = errors(&shots[index], drawn, &exact[index].layers, &rims[index]);
                sum = std::array::from_fn(|column| sum[column] + errors[column]);
            }
        }
        let [wrong_pct, factor_rms, rim_px, residual] =
            sum.map(|sum| sum / (changes.len() * shots.len()) as f64);
        println!(
            "{what:10} {amount:7} {wrong_pct:16.4} {factor_rms:10.4} {rim_px:7.1} {residual:13.4}"
        );
        csv.row(&[&what, &amount, &wrong_pct, &factor_rms, &rim_px, &residual]);
    }
    csv.finish()
}

/// What was done, by how much, and the changes that it is the mean of.
fn rows() -> Vec<(&'static str, f64, Vec<Change>)> {
    let directions = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y];
    let mut rows = vec![("moved", 0.0, vec![Change::Moved { by_m: DVec3::ZERO }])];
    for mm in [0.5, 1.0, 2.0, 5.0] {
        let moved = directions.map(|direction| Change::Moved {
            by_m: 1e-3 * mm * direction,
        });
        rows.push(("moved", mm, moved.to_vec()));
    }
    for degrees in [0.25, 0.5, 1.0] {
        let turned = [1.0, -1.0].map(|sense: f64| Change::Turned {
            by_rad: (sense * degrees).to_radians(),
        });
        rows.push(("turned", degrees, turned.to_vec()));
    }
    rows.push(("left out", 1.0, vec![Change::LeftOut]));
    rows
}

/// All frames with changed phantoms.
fn draw_all(
    scene: &Scene,
    intrinsics: Intrinsics,
    shots: &[Shot],
    change: Change,
) -> Result<Vec<Drawn>> {
    let mut scene = scene.clone();
    let stands = |name: &str| STANDING.contains(&name);
    if let Change::LeftOut = change {
        scene.phantoms.retain(|phantom| !stands(&phantom.name));
    }
    for phantom in &mut scene.phantoms {
        if !stands(&phantom.name) {
            continue;
        }
        let anchor_from_object = phantom.anchor_from_object;
        phantom.anchor_from_object = match change {
            Change::Moved { by_m } => DAffine3::from_translation(by_m) * anchor_from_object,
            Change::Turned { by_rad } => anchor_from_object * DAffine3::from_rotation_z(by_rad),
            Change::LeftOut => anchor_from_object,
        };
    }
    let mut renderer = Renderer::new(gpu(), &scene, intrinsics)?;
    let drawn = shots
        .iter()
        .map(|shot| draw(&mut renderer, &shot.frame, &shot.camera_from_anchor));
    Ok(drawn.collect())
}

fn errors(shot: &Shot, drawn: &Drawn, exact: &Layers, rim: &[bool]) -> Errors {
    let against_truth = compare(shot.frame.index, &shot.truth, drawn);
    let differs = |[gain, exact]: [&[f32; 3]; 2]| {
        (0..3).any(|channel| (gain[channel] - exact[channel]).abs() > VISIBLE_GAIN)
    };
    let rim_px = (0..rim.len())
        .filter(|&i| rim[i] && differs([&drawn.layers.gain[i], &exact.gain[i]]))
        .count();
    [
        against_truth.wrong_pct,
        against_truth.factor,
        rim_px as f64,
        against_truth.residual_real,
    ]
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
