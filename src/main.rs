//! The command line: one match from a command to its job.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail};
use clap::{Args, Parser, Subcommand};

use gnomon::app::check;
use gnomon::app::layer_files::Layer;
use gnomon::app::replay::{Request, replay};
use gnomon::scene::Scene;

/// Virtual things on a real table, lit and shadowed as if they stood there.
#[derive(Parser)]
#[command(version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Plays a recording with the scene's virtual things in it.
    #[command(
        after_help = "Example:\n  gnomon replay config/lamp.toml --out out/lamp.mp4 --sheet out/lamp.png"
    )]
    Replay(ReplayArgs),
    /// Reads a scene, says what is wrong with it or what is in it.
    #[command(after_help = "Example:\n  gnomon check config/lamp.toml")]
    Check {
        /// Scene file (TOML)
        scene: PathBuf,
    },
}

#[derive(Args)]
struct ReplayArgs {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Video (.mp4, .mov: H.264; .mkv, .avi: lossless FFV1), or a folder for PNGs named by frame
    #[arg(long, value_name = "FILE|DIR")]
    out: Option<PathBuf>,
    /// Layers to write beside the PNGs
    #[arg(long, value_name = "LAYER,…", value_delimiter = ',')]
    layers: Vec<Layer>,
    /// Draw these frames alone, by their index in the recording
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    frames: Option<Vec<u32>>,
    /// Show no virtual thing: the undistorted video alone
    #[arg(long)]
    bare: bool,
    /// Write the poses of all anchors (CSV)
    #[arg(long, value_name = "FILE")]
    poses: Option<PathBuf>,
    /// Take the poses from such a file instead of tracking
    #[arg(long, value_name = "FILE")]
    poses_from: Option<PathBuf>,
    /// Write times per stage, frames, adapter and memory (JSON)
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// Write small pictures of the whole replay on one sheet (PNG)
    #[arg(long, value_name = "FILE")]
    sheet: Option<PathBuf>,
    /// Graphics adapter, by a part of its name; the fastest kind without this
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("gnomon: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> Result<()> {
    match cli.command {
        Command::Replay(args) => run_replay(args),
        Command::Check { scene } => {
            print!("{}", check::summary(&Scene::load(&scene)?));
            Ok(())
        }
    }
}

fn run_replay(args: ReplayArgs) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))
        .context("cannot listen for interrupts")?;
    let request = Request {
        scene: args.scene,
        out: args.out,
        layers: args.layers.into_iter().collect(),
        frames: args.frames.map(BTreeSet::from_iter),
        bare: args.bare,
        poses: args.poses,
        poses_from: args.poses_from,
        stats: args.stats,
        sheet: args.sheet,
        adapter: args.adapter,
    };
    let report = replay(&request, &stop)?;
    eprintln!("{} frames, {} drawn", report.frames, report.drawn);
    if report.world_lost > 0 {
        eprintln!(
            "the world's anchor was not found in {} of them; there the video is shown alone",
            report.world_lost
        );
    }
    if let Some(error_px) = report.reprojection_px.filter(|&error_px| error_px > 1.0) {
        eprintln!(
            "markers lie {error_px:.1} px (median) from where their poses put them: the calibration or the markers' \
             sizes and places in the scene are wrong"
        );
    }
    if report.interrupted {
        bail!("interrupted; what was done until then is whole");
    }
    if !report.notices.is_empty() {
        bail!(
            "the recording is damaged; all good frames were done: {}",
            report.notices.join("; ")
        );
    }
    Ok(())
}
