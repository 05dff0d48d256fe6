//! The command line: one match from a command to its job.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail};
use clap::{Args, Parser, Subcommand};

use gnomon::app::chart::{self, chart};
use gnomon::app::check;
use gnomon::app::first_look::first_look;
use gnomon::app::layer_files::Layer;
use gnomon::app::replay::{self, replay};
use gnomon::app::report::Report;
use gnomon::app::track::{self, is_scene, track};
use gnomon::scene::{CameraSettings, Family, Scene};

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
    /// Finds where the markers are in a recording, without drawing: poses as a file. Needs no GPU.
    #[command(
        after_help = "Example:\n  gnomon track config/lamp.toml --poses out/lamp.csv\n  gnomon track walk.mp4 \
                      --calibration camera.toml --size-mm 40 --poses out/walk.csv"
    )]
    Track(TrackArgs),
    /// Reads a scene, says what is wrong with it or what is in it.
    #[command(after_help = "Example:\n  gnomon check config/lamp.toml")]
    Check {
        /// Scene file (TOML)
        scene: PathBuf,
    },
    /// Measures speed against accuracy on this machine, and draws it.
    #[command(
        after_help = "Example:\n  gnomon chart --quick --only tracking --out out/charts\n\nIt runs in the project's folder. \
                      What has been measured is not measured again by the same program from the same recordings: after \
                      an interrupt it goes on where it was."
    )]
    Chart(ChartArgs),
}

#[derive(Args)]
struct ChartArgs {
    /// Folder for the charts
    #[arg(long, value_name = "DIR", default_value = "charts")]
    out: PathBuf,
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', help = format!("Make these alone: {}", chart::names().join(", ")))]
    only: Vec<String>,
    /// Fewer rounds: rougher times in a tenth of the time
    #[arg(long)]
    quick: bool,
    /// Track the sessions of this folder too
    #[arg(long, value_name = "DIR")]
    sessions: Option<PathBuf>,
    /// Graphics adapter, by a part of its name; the fastest kind without this
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
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

#[derive(Args)]
struct TrackArgs {
    /// Scene file (.toml), session, video, picture or folder of pictures
    source: PathBuf,
    #[command(flatten)]
    recording: RecordingArgs,
    /// Track the anchors of this scene, with its settings, in another recording
    #[arg(long, value_name = "SCENE")]
    anchors: Option<PathBuf>,
    /// Track every marker that is seen, each on its own: the side of their black squares
    #[arg(long, value_name = "MM", conflicts_with = "anchors")]
    size_mm: Option<f64>,
    #[command(flatten)]
    family: FamilyArgs,
    /// Write the poses (CSV)
    #[arg(long, value_name = "FILE")]
    poses: Option<PathBuf>,
    /// Write every marker that the detector sees, with its corners (CSV)
    #[arg(long, value_name = "FILE")]
    markers: Option<PathBuf>,
    /// Write times per stage, frames and memory (JSON)
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
}

/// A recording that no scene describes.
#[derive(Args)]
struct RecordingArgs {
    /// Calibration of the camera; without it the one that the recording carries
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// The camera mirrors its pictures: turn them back first
    #[arg(long)]
    mirror: bool,
}

/// Markers that no scene describes.
#[derive(Args)]
struct FamilyArgs {
    /// Family of the markers: tag16h5, tag25h9, tag36h10, tag36h11, DICT_4X4_50, …
    #[arg(long, value_name = "NAME", default_value = "tag36h11", value_parser = family_of)]
    family: Family,
    /// Width of the markers' black border, cells: 1, or 2 as on Kalibr's AprilGrids
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..=2))]
    border_cells: u32,
    /// libapriltag searches pictures shrunk by this; 1 finds smaller markers
    #[arg(long, value_name = "FACTOR", default_value = "2")]
    decimation: f64,
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
        Command::Track(args) => run_track(args),
        Command::Chart(args) => run_chart(args),
        Command::Check { scene } => {
            let scene = Scene::load(&scene)?;
            print!("{}", check::summary(&scene));
            if let Some(warning) = first_look(&scene) {
                print!("{}", check::warning_line(&warning));
            }
            Ok(())
        }
    }
}

fn run_replay(args: ReplayArgs) -> Result<()> {
    let stop = interrupts()?;
    let request = replay::Request {
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
    conclude(&replay(&request, &stop)?)
}

fn run_chart(args: ChartArgs) -> Result<()> {
    let stop = interrupts()?;
    let request = chart::Request {
        out: args.out,
        only: args.only,
        quick: args.quick,
        sessions: args.sessions,
        adapter: args.adapter,
    };
    eprintln!("{}", chart(&request, &stop)?);
    Ok(())
}

fn run_track(args: TrackArgs) -> Result<()> {
    let stop = interrupts()?;
    let request = track::Request {
        input: track_input(&args)?,
        poses: args.poses,
        markers: args.markers,
        stats: args.stats,
    };
    conclude(&track(&request, &stop)?)
}

fn track_input(args: &TrackArgs) -> Result<track::Input> {
    if is_scene(&args.source) {
        let RecordingArgs {
            calibration,
            mirror,
        } = &args.recording;
        if calibration.is_some() || *mirror || args.anchors.is_some() || args.size_mm.is_some() {
            bail!(
                "{} is a scene, which says itself what is tracked in what; --calibration, --mirror, --anchors and \
                 --size-mm go with a recording",
                args.source.display()
            );
        }
        return Ok(track::Input::Scene(args.source.clone()));
    }
    let camera = camera_of(&args.source, &args.recording)?;
    match (&args.anchors, args.size_mm) {
        (Some(scene), _) => Ok(track::Input::RecordingWithScene(camera, scene.clone())),
        (None, Some(size_mm)) => Ok(track::Input::LoneMarkers {
            camera,
            family: args.family.family()?,
            size_m: size_m(size_mm)?,
            decimation: args.family.decimation,
        }),
        (None, None) => bail!(
            "what is tracked in {}? Give --anchors SCENE, or --size-mm MM for markers each on its own",
            args.source.display()
        ),
    }
}

impl FamilyArgs {
    fn family(&self) -> Result<Family> {
        self.family.with_border(self.border_cells).with_context(|| {
            format!(
                "--border-cells {}: no marker is printed so",
                self.border_cells
            )
        })
    }
}

fn family_of(name: &str) -> Result<Family, String> {
    Family::from_name(name).ok_or_else(|| {
        let known: Vec<&str> = Family::all_names().collect();
        format!("unknown family; allowed: {}", known.join(", "))
    })
}

fn camera_of(source: &Path, args: &RecordingArgs) -> Result<CameraSettings> {
    let source = source
        .to_str()
        .with_context(|| format!("the path {} is not UTF-8 text", source.display()))?;
    Ok(CameraSettings {
        source: source.to_owned(),
        calibration: args.calibration.clone(),
        mirror: args.mirror,
    })
}

fn size_m(size_mm: f64) -> Result<f64> {
    if !(0.1..=1e5).contains(&size_mm) {
        bail!("--size-mm {size_mm}: out of range; allowed: 0.1 to 100000 mm");
    }
    Ok(size_mm * 1e-3)
}

/// What an interrupt sets.
fn interrupts() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))
        .context("cannot listen for interrupts")?;
    Ok(stop)
}

/// Says what was done.
fn conclude(report: &Report) -> Result<()> {
    eprintln!("{}", report.done);
    for remark in &report.remarks {
        eprintln!("{remark}");
    }
    report.conclude()
}
