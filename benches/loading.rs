//! What it takes to read a model, from its file to a scene whose thing can be drawn: its triangles joined, open ones mended,
//! pictures decoded. `tools/bench_loading.sh` holds it against another crate.

mod common;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, ensure};
use clap::Parser;
use gnomon::scene::Scene;

use common::at_least_one;

/// Times the reading of a model.
#[derive(Parser)]
struct Options {
    /// A file of any format that a scene may name
    model: PathBuf,
    /// How often it is read
    #[arg(long, default_value = "5", value_parser = at_least_one)]
    rounds: usize,
    /// What `cargo bench` adds
    #[arg(long, hide = true)]
    bench: bool,
}

/// Prints what each round took, milliseconds, and the triangles.
fn main() -> Result<()> {
    let options = Options::parse();
    let model = std::fs::canonicalize(&options.model)?;
    // Nothing of this scene is opened but the model.
    let text = format!(
        "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"table\"\nid = 0\nsize_m = 0.04\n\
         [ambient]\nradiance = [1, 1, 1]\n[[virtual]]\nname = \"thing\"\nmesh = {:?}\non = \"table\"\n",
        model.display().to_string()
    );
    let place = std::env::temp_dir().join("loading.toml");
    for _ in 0..options.rounds {
        let begun = Instant::now();
        let scene = Scene::read(&place, &text).scene?;
        let ms = begun.elapsed().as_secs_f64() * 1000.0;
        ensure!(scene.virtuals.len() == 1, "the scene has one thing");
        println!("{ms:.3} {}", scene.virtuals[0].mesh.triangles.len());
    }
    Ok(())
}
