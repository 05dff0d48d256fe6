//! What a frame costs with shadow volumes made anew: draw and wait, no video going up and no picture coming back.
//!
//! Without `--sweep` the four scenes of `../shared/peers`, whose caster turns in every frame as it does there; with it
//! how the cost grows with triangles, lights, casters, pixels and samples.

mod common;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use clap::Parser;
use glam::DVec3;
use gnomon::capture::Frame;
use gnomon::render::{Gpu, Renderer, Shown};

use common::{
    Csv, LIGHT_M, SIZE_PX, Stage, TORUS_CENTER_M, Times, WARM_UP_FRAMES, at_least_one, read_obj,
    shared_folder, torus,
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
    #[arg(long, conflicts_with = "sweep")]
    scene: Option<String>,
    /// Part of the adapter's name
    #[arg(long)]
    adapter: Option<String>,
    /// How the cost grows with what there is, in place of the four scenes
    #[arg(long)]
    sweep: bool,
    /// Where to write the figures
    #[arg(long)]
    csv: Option<PathBuf>,
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

/// What is timed, and what in it was varied.
struct Case {
    what: &'static str,
    value: String,
    stage: Stage,
}

fn main() -> Result<()> {
    let options = Options::parse();
    let gpu = Arc::new(Gpu::open(options.adapter.as_deref())?);
    println!("{}", gpu.description());
    let cases = if options.sweep {
        sweep(options.samples)
    } else {
        four_scenes(options.scene.as_deref(), options.samples)?
    };
    let mut csv = Csv::new(
        options.csv,
        "what,value,triangles,lights,casters,width,height,samples,median_ms,p10_ms,p90_ms,wrong_pct",
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
    for Case { what, value, stage } in cases {
        let frame = time(&gpu, &stage, options.frames)?;
        let [width, height] = stage.intrinsics.size_px;
        let total = frame.total;
        println!(
            "{:24} {:9} {:9.2} {:7.2} {:7.2} {:8.2} {:8.2} {:>9} {:>12}",
            format!("{what} {value}"),
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
            &what,
            &value,
            &stage.triangles(),
            &stage.scene.lights.len(),
            &stage.scene.virtuals.len(),
            &width,
            &height,
            &stage.scene.shadows.samples,
            &total.median_ms,
            &total.p10_ms,
            &total.p90_ms,
            &wrong_pct(&gpu, &stage)?,
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
                what: "scene",
                value: name.to_owned(),
                stage: Stage::new(vec![caster], &[LIGHT_M], SIZE_PX, samples),
            })
        })
        .collect()
}

/// The torus of 2,500 triangles over the table, one thing varied at a time.
fn sweep(samples: u32) -> Vec<Case> {
    const TRIANGLES: usize = 2_500;
    const DETAILED_TRIANGLES: usize = 40_000;
    let one = |triangles| vec![(torus(triangles, 1.0), TORUS_CENTER_M)];
    let case = |what, value: String, stage| Case { what, value, stage };
    let mut cases = Vec::new();
    for triangles in [100, 300, 1_000, 3_000, 10_000, 30_000, 100_000] {
        let stage = Stage::new(one(triangles), &[LIGHT_M], SIZE_PX, samples);
        cases.push(case("triangles", stage.triangles().to_string(), stage));
    }
    for lights in 1..=8 {
        // A ring at the lamp's height, which it is the first of.
        let places: Vec<DVec3> = (0..lights)
            .map(|index| glam::DQuat::from_rotation_z(index as f64 * 0.7) * LIGHT_M)
            .collect();
        let stage = Stage::new(one(TRIANGLES), &places, SIZE_PX, samples);
        cases.push(case("lights", lights.to_string(), stage));
    }
    for casters in [1, 2, 4, 8, 16, 32] {
        let small = torus(TRIANGLES, 0.4);
        let grid = (0..casters).map(|index| {
            let (column, row) = (index % 8, index / 8);
            let place = DVec3::new(
                -0.21 + 0.06 * f64::from(column),
                -0.09 + 0.06 * f64::from(row),
                0.04,
            );
            (small.clone(), place)
        });
        let stage = Stage::new(grid.collect(), &[LIGHT_M], SIZE_PX, samples);
        cases.push(case("casters", casters.to_string(), stage));
    }
    for size_px in [
        [320, 240],
        [640, 480],
        [960, 720],
        [1280, 720],
        [1920, 1080],
    ] {
        let stage = Stage::new(one(TRIANGLES), &[LIGHT_M], size_px, samples);
        cases.push(case("pixels", (size_px[0] * size_px[1]).to_string(), stage));
    }
    // The same with all triangles and with ever less detail: what it saves, and what of the shadow it moves.
    for error_px in [0.0, 0.25, 0.5, 1.0, 2.0, 4.0] {
        let mut stage = Stage::new(one(DETAILED_TRIANGLES), &[LIGHT_M], SIZE_PX, samples);
        stage.scene.shadows.max_silhouette_error_px = error_px;
        cases.push(case("silhouette_error_px", error_px.to_string(), stage));
    }
    for samples in [1, 4] {
        let stage = Stage::new(one(TRIANGLES), &[LIGHT_M], SIZE_PX, samples);
        cases.push(case("samples", samples.to_string(), stage));
    }
    cases
}

/// Real pixels, in percent, whose shadow is another than with all triangles; the mean of some poses.
fn wrong_pct(gpu: &Arc<Gpu>, stage: &Stage) -> Result<f64> {
    const POSES: usize = 8;
    if stage.scene.shadows.max_silhouette_error_px == 0.0 {
        return Ok(0.0);
    }
    const REAL: u8 = 100;
    let masks = |max_silhouette_error_px| -> Result<Vec<(u8, u8)>> {
        let mut scene = stage.scene.clone();
        scene.shadows.max_silhouette_error_px = max_silhouette_error_px;
        let mut renderer = Renderer::new(Arc::clone(gpu), &scene, stage.intrinsics)?;
        let mut masks = Vec::new();
        for pose in 0..POSES {
            renderer.draw(&stage.poses(15 * pose), Shown::Composite);
            let layers = renderer.layers()?;
            let roles = layers.role.into_iter().cycle();
            masks.extend(roles.zip(layers.shadow.concat()));
        }
        Ok(masks)
    };
    let (ours, exact) = (
        masks(stage.scene.shadows.max_silhouette_error_px)?,
        masks(0.0)?,
    );
    let pairs = ours.iter().zip(&exact);
    let real = pairs.filter(|((role, _), (exactly, _))| *role == REAL && *exactly == REAL);
    let (mut wrong, mut all) = (0, 0);
    for ((_, one), (_, other)) in real {
        wrong += usize::from(one != other);
        all += 1;
    }
    Ok(100.0 * wrong as f64 / all.max(1) as f64)
}

/// A frame from the call to the last pixel, and its parts; what the GPU's own timestamps tell, where it has them.
struct FrameTimes {
    total: Times,
    draw: Times,
    wait: Times,
    gpu_light: Option<Times>,
    gpu_picture: Option<Times>,
}

fn time(gpu: &Arc<Gpu>, stage: &Stage, frames: usize) -> Result<FrameTimes> {
    let mut renderer = Renderer::new(Arc::clone(gpu), &stage.scene, stage.intrinsics)?;
    let size_px = stage.intrinsics.size_px;
    renderer.upload(&Frame {
        index: 0,
        time_secs: 0.0,
        size_px,
        rgba: vec![128; 4 * (size_px[0] * size_px[1]) as usize],
    })?;
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
