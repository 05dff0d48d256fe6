//! What a frame costs with shadow volumes made anew: draw and wait, no video going up and no picture coming back.
//!
//! The four scenes of `../shared/peers`, whose caster turns in every frame as it does there. How the cost grows with
//! triangles, lights, casters and pixels tells `gnomon chart --only scaling`.

mod common;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use clap::Parser;
use glam::DVec3;
use gnomon::capture::Frame;
use gnomon::render::{Gpu, Renderer, Shown};
use gnomon::scene::{Shortcut, Shortcuts};

use common::{Csv, Times, at_least_one, read_obj, shared_folder};
use gnomon::app::chart::peers_table::{
    LIGHT_M, PeersStage, SIZE_PX, TORUS_CENTER_M, WARM_UP_FRAMES, torus,
};

/// Times frames with shadow volumes.
#[derive(Parser)]
struct Options {
    /// Frames that count, after the warm-up
    #[arg(long, default_value = "100", value_parser = at_least_one)]
    frames: usize,
    /// Samples per pixel, 1 or 4
    #[arg(long, default_value_t = 1, value_parser = samples)]
    samples: u32,
    /// One of the four scenes alone
    #[arg(long)]
    scene: Option<String>,
    /// Part of the adapter's name
    #[arg(long)]
    adapter: Option<String>,
    /// Where to write the figures
    #[arg(long)]
    csv: Option<PathBuf>,
    /// What each shortcut saves: frames without it against frames with all, turn by turn
    #[arg(long)]
    shortcuts: bool,
    /// What `cargo bench` adds
    #[arg(long, hide = true)]
    bench: bool,
}

fn samples(written: &str) -> Result<u32, String> {
    match written {
        "1" => Ok(1),
        "4" => Ok(4),
        _ => Err("allowed: 1, 4".to_owned()),
    }
}

/// What is timed.
struct Case {
    name: &'static str,
    stage: PeersStage,
}

fn main() -> Result<()> {
    let options = Options::parse();
    let gpu = Arc::new(Gpu::open(options.adapter.as_deref())?);
    println!("{}", gpu.description());
    let cases = four_scenes(options.scene.as_deref(), options.samples)?;
    if options.shortcuts {
        return time_shortcuts(&gpu, cases, options.frames, options.csv);
    }
    let mut csv = Csv::new(
        options.csv,
        "scene,triangles,lights,casters,width,height,samples,median_ms,p10_ms,p90_ms",
    );
    println!(
        "{:24} {:>9} {:>9} {:>7} {:>7} {:>8} {:>8} {:>9} {:>12}",
        "frame, ms",
        "triangles",
        "median",
        "p10",
        "p90",
        "draw",
        "wait",
        "gpu light",
        "gpu picture"
    );
    for Case { name, stage } in cases {
        let frame = time(&gpu, &stage, options.frames)?;
        let [width, height] = stage.intrinsics.size_px;
        let total = frame.total;
        println!(
            "{:24} {:9} {:9.2} {:7.2} {:7.2} {:8.2} {:8.2} {:>9} {:>12}",
            name,
            stage.triangles(),
            total.median_ms,
            total.p10_ms,
            total.p90_ms,
            frame.draw.median_ms,
            frame.wait.median_ms,
            told(frame.gpu_light),
            told(frame.gpu_picture),
        );
        csv.row(&[
            &name,
            &stage.triangles(),
            &stage.scene.lights.len(),
            &stage.scene.virtuals.len(),
            &width,
            &height,
            &stage.scene.shadows.samples,
            &total.median_ms,
            &total.p10_ms,
            &total.p90_ms,
        ]);
    }
    csv.finish()
}

/// A median where there is one.
fn told(times: Option<Times>) -> String {
    times.map_or_else(|| "-".to_owned(), |times| format!("{:.2}", times.median_ms))
}

/// The scenes of the peers, with their models where those are.
fn four_scenes(only: Option<&str>, samples: u32) -> Result<Vec<Case>> {
    let on_table = |x, y, z| DVec3::new(x, y, z);
    let all = [
        (
            "torus2500",
            "stability/torus2500.obj",
            TORUS_CENTER_M,
            2_500,
        ),
        (
            "bunny5k",
            "models/scaled/bl.obj",
            on_table(0.08, -0.02, -0.025),
            5_000,
        ),
        (
            "nefertiti10k",
            "models/scaled/nf.obj",
            on_table(0.08, -0.02, 0.08),
            10_000,
        ),
        ("torus40k", "models/torus40000.obj", TORUS_CENTER_M, 40_000),
    ];
    let names = all.map(|(name, ..)| name);
    if let Some(wanted) = only {
        anyhow::ensure!(
            names.contains(&wanted),
            "no scene \"{wanted}\"; there are: {}",
            names.join(", ")
        );
    }
    let shared = shared_folder();
    let with_models = all
        .iter()
        .all(|(_, model, ..)| shared.join(model).is_file());
    if !with_models {
        println!(
            "no models in {}: each is a torus of as many triangles",
            shared.display()
        );
    }
    let chosen = all
        .into_iter()
        .filter(|(name, ..)| only.is_none_or(|wanted| wanted == *name));
    chosen
        .map(|(name, model, center_m, triangles)| {
            let caster = if with_models {
                (read_obj(&shared.join(model))?, center_m)
            } else {
                (torus(triangles, 1.0), TORUS_CENTER_M)
            };
            Ok(Case {
                name,
                stage: PeersStage::new(vec![caster], &[LIGHT_M], SIZE_PX, samples),
            })
        })
        .collect()
}

/// Frames without each shortcut against frames with all of them, in turns, so that both see the same machine; with a caster
/// that turns, and with one that stands still.
fn time_shortcuts(
    gpu: &Arc<Gpu>,
    cases: Vec<Case>,
    frames: usize,
    csv: Option<PathBuf>,
) -> Result<()> {
    let mut csv = Csv::new(csv, "scene,samples,caster,without,median_ms,times_as_long");
    for Case { name, mut stage } in cases {
        let samples = stage.scene.shadows.samples;
        let switches = [("none", Shortcuts::NONE)]
            .into_iter()
            .chain(Shortcut::BY_NAME.map(|(name, one)| (name, Shortcuts::NONE.with(one, true))));
        let switches: Vec<_> = switches.chain([("all", Shortcuts::ALL)]).collect();
        let mut renderers = Vec::new();
        for &(_, without) in &switches {
            stage.scene.shadows.without = without;
            renderers.push(renderer(gpu, &stage)?);
        }
        for (caster, moves) in [("turns", true), ("rests", false)] {
            let mut times_ms = vec![Vec::with_capacity(frames); switches.len()];
            for frame in 0..WARM_UP_FRAMES + frames {
                let poses = stage.poses(if moves { frame } else { 0 });
                for (renderer, times_ms) in renderers.iter_mut().zip(&mut times_ms) {
                    let begun = Instant::now();
                    renderer.draw(&poses, Shown::Composite);
                    renderer.wait()?;
                    if frame >= WARM_UP_FRAMES {
                        times_ms.push(1e3 * begun.elapsed().as_secs_f64());
                    }
                }
            }
            let medians: Vec<f64> = times_ms
                .into_iter()
                .map(|t| Times::of(t).median_ms)
                .collect();
            for ((without, _), median_ms) in switches.iter().zip(&medians) {
                let ratio = median_ms / medians[0];
                println!(
                    "{name:14} {samples} samples, {caster}: without {without:10} {median_ms:7.2} ms, {ratio:.2} times"
                );
                csv.row(&[
                    &name,
                    &samples,
                    &caster,
                    without,
                    &format!("{median_ms:.3}"),
                    &format!("{ratio:.3}"),
                ]);
            }
        }
    }
    csv.finish()
}

/// A renderer with its picture.
fn renderer(gpu: &Arc<Gpu>, stage: &PeersStage) -> Result<Renderer> {
    let mut renderer = Renderer::new(Arc::clone(gpu), &stage.scene, stage.intrinsics)?;
    let size_px = stage.intrinsics.size_px;
    renderer.upload(&Frame {
        index: 0,
        time_secs: 0.0,
        size_px,
        rgba: vec![128; 4 * (size_px[0] * size_px[1]) as usize],
    })?;
    Ok(renderer)
}

/// A frame from the call to the last pixel, and its parts; what the GPU's own timestamps tell, where it has them.
struct FrameTimes {
    total: Times,
    draw: Times,
    wait: Times,
    gpu_light: Option<Times>,
    gpu_picture: Option<Times>,
}

fn time(gpu: &Arc<Gpu>, stage: &PeersStage, frames: usize) -> Result<FrameTimes> {
    let mut renderer = renderer(gpu, stage)?;
    let mut host_ms = [(); 3].map(|()| Vec::with_capacity(frames));
    let mut gpu_ms = [(); 2].map(|()| Vec::with_capacity(frames));
    for frame in 0..WARM_UP_FRAMES + frames {
        let poses = stage.poses(frame);
        let begun = Instant::now();
        renderer.draw(&poses, Shown::Composite);
        let drawn = begun.elapsed();
        renderer.wait()?;
        let total = begun.elapsed();
        let gpu_times = renderer.gpu_times()?;
        if frame >= WARM_UP_FRAMES {
            for (column, duration) in host_ms.iter_mut().zip([total, drawn, total - drawn]) {
                column.push(1e3 * duration.as_secs_f64());
            }
            for (column, ms) in gpu_ms
                .iter_mut()
                .zip([gpu_times.shadows_ms, gpu_times.composite_ms])
            {
                column.extend(ms);
            }
        }
    }
    let [total, draw, wait] = host_ms.map(Times::of);
    let [gpu_light, gpu_picture] =
        gpu_ms.map(|column| (!column.is_empty()).then(|| Times::of(column)));
    Ok(FrameTimes {
        total,
        draw,
        wait,
        gpu_light,
        gpu_picture,
    })
}
