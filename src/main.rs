//! One match from a command to its job; exit status and messages.

mod command_line;

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail};
use clap::{CommandFactory as _, Parser};

use gnomon::app::chart::{self, chart};
use gnomon::app::files::new_file::is_stdout;
use gnomon::app::files::unfinished::exit_without_traces;
use gnomon::app::jobs::board::{self, board};
use gnomon::app::jobs::calibrate;
use gnomon::app::jobs::cameras;
use gnomon::app::jobs::check;
use gnomon::app::jobs::check::first_look::first_look;
use gnomon::app::jobs::markers::{self, MarkerSheet, Paper};
use gnomon::app::jobs::probe;
use gnomon::app::jobs::record;
use gnomon::app::jobs::replay::{self, replay};
use gnomon::app::jobs::track::{self, is_scene, track};
use gnomon::app::live;
use gnomon::app::stages::report::Report;
use gnomon::app::talk;
use gnomon::capture::children::end_all;
use gnomon::capture::live::is_live;
use gnomon::scene::format::MARKER;
use gnomon::scene::{CameraSettings, Scene};
use gnomon::tracking::mapping::{MapSettings, ShapeWanted};

use command_line::{
    BoardArgs, CalibrateArgs, ChartArgs, Cli, Command, LiveArgs, MarkersArgs, PageSize, ProbeArgs,
    ProbeKindArg, RecordArgs, RecordingArgs, ReplayArgs, Shape, Sizes, TrackArgs,
};

/// As shells have it for Ctrl-C.
const INTERRUPTED: i32 = 130;

fn main() -> ExitCode {
    #[cfg(target_os = "linux")]
    leave_out_device_selection();
    #[cfg(unix)]
    outlive_limits_on_files();
    let done = run(Cli::try_parse().unwrap_or_else(|error| leave_misused(&error)));
    end_all();
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            talk::say(format_args!("gnomon: {error:#}"));
            ExitCode::FAILURE
        }
    }
}

/// Says how the command is used and ends the program; a file in a command's place is told as such.
fn leave_misused(error: &clap::Error) -> ! {
    let named = std::env::args_os()
        .nth(1)
        .filter(|_| error.kind() == clap::error::ErrorKind::InvalidSubcommand);
    match named.filter(|named| Path::new(named).exists()) {
        Some(file) => {
            talk::say(format_args!(
                "gnomon: {} is a file, not a command: gnomon live, replay and check take a scene, gnomon track, board, \
                 calibrate and record a recording, gnomon probe pictures (gnomon --help)",
                Path::new(&file).display()
            ));
            std::process::exit(error.exit_code())
        }
        None => leave_told(error),
    }
}

/// Prints what clap has to say and ends the program; help that could not be written was not given.
fn leave_told(error: &clap::Error) -> ! {
    let written = error.print().and_then(|()| std::io::stdout().flush());
    match written {
        Err(failed) if failed.kind() != std::io::ErrorKind::BrokenPipe => {
            talk::say(format_args!("gnomon: stdout: {failed}"));
            std::process::exit(1)
        }
        _ => std::process::exit(error.exit_code()),
    }
}

fn run(cli: Cli) -> Result<()> {
    match cli.command {
        Command::Live(args) => run_live(args),
        Command::Replay(args) => run_replay(args),
        Command::Track(args) => run_track(args),
        Command::Board(args) => run_board(args),
        Command::Calibrate(args) => run_calibrate(args),
        Command::Markers(args) => run_markers(args),
        Command::Record(args) => run_record(args),
        Command::Probe(args) => run_probe(args),
        Command::Cameras => {
            talk::give(&cameras::cameras()?);
            Ok(())
        }
        Command::Chart(args) => run_chart(args),
        Command::Check { scene } => {
            let scene = Scene::load(&scene)?;
            talk::give(&check::summary(&scene));
            let look = first_look(&scene)?;
            for warning in &look.warnings {
                talk::give(&check::warning_line(warning));
            }
            look.never_found.map_or(Ok(()), |told| bail!("{told}"))
        }
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "gnomon", &mut script);
            hand_out(&script)
        }
        Command::Manual { command } => give_manual(command.as_deref()),
    }
}

/// A page of the manual in roff: the program's, or a command's.
fn give_manual(name: Option<&str>) -> Result<()> {
    let mut program = Cli::command();
    program.build();
    let page = match name {
        None => program,
        Some(name) => {
            let named = |command: &&clap::Command| command.get_name() == name;
            let found = program.get_subcommands().find(named).cloned();
            let page = found.with_context(|| {
                format!("no command is called {name}; `gnomon --help` lists them")
            })?;
            page.display_name(format!("gnomon-{name}"))
        }
    };
    let mut roff = Vec::new();
    clap_mangen::Man::new(page).render(&mut roff)?;
    hand_out(&roff)
}

fn hand_out(bytes: &[u8]) -> Result<()> {
    talk::hand_out(&String::from_utf8_lossy(bytes)).context("stdout")
}

/// Starts the program again without Mesa's layer that asks the desktop for its favourite card: where there is no desktop it
/// complains on stderr, whatever comes of the job, and gnomon chooses the adapter itself.
#[cfg(target_os = "linux")]
fn leave_out_device_selection() {
    use std::os::unix::process::CommandExt as _;
    const SWITCH: &str = "NODEVICE_SELECT";
    let desktop = std::env::var_os("XDG_RUNTIME_DIR");
    let has_desktop = desktop.is_some_and(|folder| Path::new(&folder).is_absolute());
    if has_desktop || std::env::var_os(SWITCH).is_some() {
        return;
    }
    let Ok(program) = std::env::current_exe() else {
        return;
    };
    let mut words = std::env::args_os();
    let name = words.next().unwrap_or_default();
    // Comes back only where it cannot be started; then this one goes on, with the complaint.
    let _ = std::process::Command::new(program)
        .arg0(name)
        .args(words)
        .env(SWITCH, "1")
        .exec();
}

/// Lets writing beyond a limit on the size of files (`ulimit -f`) fail with an error, as on a full disk: the signal ends only who
/// does not listen to it. Programs that run for a job do not, and their status says so.
#[cfg(unix)]
fn outlive_limits_on_files() {
    // Where nobody can listen, the limit ends the program.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

fn run_live(args: LiveArgs) -> Result<()> {
    let stop = interrupts()?;
    let input = if is_scene(&args.source) {
        args.recording.refuse_beside(&args.source)?;
        live::LiveStart::Scene(args.source)
    } else {
        live::LiveStart::Camera(camera_of(&args.source, &args.recording)?)
    };
    let request = live::LiveRequest {
        input,
        out: args.out,
        adapter: args.adapter,
    };
    live::live(&request, &stop)
}

fn run_replay(args: ReplayArgs) -> Result<()> {
    let stop = interrupts()?;
    let request = replay::ReplayRequest {
        replacing: args.force.replacing(),
        scene: args.scene,
        out: args.out,
        layers: args.layers.into_iter().collect(),
        frames: args.frames.map(BTreeSet::from_iter),
        bare: args.bare,
        poses: args.poses,
        poses_from: args.poses_from,
        stats: args.stats,
        sheet: args.sheet,
        without: args.without.into_iter().collect(),
        adapter: args.adapter,
    };
    conclude(&replay(&request, &stop)?)
}

fn run_chart(args: ChartArgs) -> Result<()> {
    let stop = interrupts()?;
    let out = match args.quick {
        true => "charts/quick",
        false => "charts",
    };
    let request = chart::ChartRequest {
        replacing: args.force.replacing(),
        out: args.out.unwrap_or_else(|| out.into()),
        only: args.only,
        quick: args.quick,
        sessions: args.sessions,
        adapter: args.adapter,
    };
    talk::say(chart(&request, &stop)?);
    Ok(())
}

fn run_track(args: TrackArgs) -> Result<()> {
    let stop = interrupts()?;
    let request = track::TrackRequest {
        replacing: args.force.replacing(),
        input: track_input(&args)?,
        poses: args.poses,
        markers: args.markers,
        stats: args.stats,
    };
    conclude(&track(&request, &stop)?)
}

fn run_markers(args: MarkersArgs) -> Result<()> {
    end_at_interrupt()?;
    let family = args.family.family()?;
    // Each kind of sheet requires its sizes (`requires` above).
    let mm = |size: Option<f64>| size.unwrap_or(f64::NAN);
    let sheet = match (args.board, args.ids) {
        (Some([columns, rows]), _) => MarkerSheet::Board {
            family,
            first_id: args.first_id,
            rows,
            columns,
            size_mm: mm(args.size_mm),
            gap_mm: mm(args.gap_mm),
            name: args.name,
        },
        _ if args.cube.is_some() => MarkerSheet::Cube {
            family,
            first_id: args.first_id,
            edge_mm: mm(args.cube),
            size_mm: mm(args.size_mm),
            name: args.name,
        },
        (_, Some(ids)) => MarkerSheet::Lone {
            family,
            ids,
            size_mm: mm(args.size_mm),
        },
        _ => MarkerSheet::Target(args.target.target()?),
    };
    let written = markers::markers(&markers::MarkersRequest {
        replacing: args.force.replacing(),
        out: args.out,
        sheet,
        paper: match args.page {
            PageSize::A4 => Paper::A4,
            PageSize::A3 => Paper::A3,
            PageSize::Letter => Paper::Letter,
        },
        landscape: args.landscape,
        dpi: args.dpi,
    })?;
    for path in written {
        talk::say(path.display());
    }
    Ok(())
}

fn run_calibrate(args: CalibrateArgs) -> Result<()> {
    let stop = interrupts()?;
    let live = |source: &String| is_live(source);
    let watch = (args.watch || args.source.iter().any(live)).then(|| calibrate::Watch {
        wanted: args.wanted.wanted(),
        adapter: args.adapter,
    });
    let request = calibrate::CalibrateRequest {
        replacing: args.force.replacing(),
        watch,
        sources: args.source,
        target: args.target.target()?,
        mirror: args.mirror,
        out: args.out,
        coverage: args.coverage,
    };
    let done = calibrate::calibrate(&request, &stop)?;
    // Where the calibration itself goes to stdout, the rest is talk.
    match is_stdout(&request.out) {
        true => talk::say_lines(&done.summary),
        false => talk::give(&done.summary),
    }
    for warning in &done.warnings {
        talk::say(format_args!("warning: {warning}"));
    }
    if !done.notices.is_empty() {
        bail!(
            "a recording is damaged; its good frames were used: {}",
            done.notices.join("; ")
        );
    }
    Ok(())
}

fn run_board(args: BoardArgs) -> Result<()> {
    let stop = interrupts()?;
    let input = if is_scene(&args.from) {
        args.recording.refuse_beside(&args.from)?;
        board::BoardInput::Scene(args.from.clone())
    } else {
        board::BoardInput::Recording {
            camera: camera_of(&args.from, &args.recording)?,
            decimation: args.recording.decimation(),
        }
    };
    if !(0.0..=1e4).contains(&args.plane_tolerance_mm) {
        bail!(
            "--plane-tolerance-mm {}: out of range; allowed: 0 to 10000 mm",
            args.plane_tolerance_mm
        );
    }
    let request = board::BoardRequest {
        replacing: args.force.replacing(),
        input,
        family: args.family.family()?,
        map: MapSettings {
            size_m: size_m(args.size_mm)?,
            gauge: args.gauge,
            learns_sizes: args.sizes == Sizes::Estimate,
            plane_tolerance_m: args.plane_tolerance_mm * 1e-3,
            shape: match args.shape {
                Shape::Seen => ShapeWanted::AsSeen,
                Shape::Flat => ShapeWanted::Flat,
                Shape::Space => ShapeWanted::Space,
            },
        },
        distance: args.distance,
        name: args.name,
        out: args.out,
    };
    board(&request, &stop)
}

fn run_record(args: RecordArgs) -> Result<()> {
    let stop = interrupts()?;
    let input = if is_scene(&args.source) {
        args.recording.refuse_beside(&args.source)?;
        record::RecordInput::Scene(args.source)
    } else {
        record::RecordInput::Camera(camera_of(&args.source, &args.recording)?)
    };
    let request = record::RecordRequest {
        replacing: args.force.replacing(),
        input,
        out: args.out,
        seconds: args.seconds,
    };
    talk::say(record::record(&request, &stop)?);
    Ok(())
}

fn run_probe(args: ProbeArgs) -> Result<()> {
    end_at_interrupt()?;
    let request = probe::ProbeRequest {
        replacing: args.force.replacing(),
        pictures: args.pictures,
        exposures: args.exposures,
        kind: match args.kind {
            ProbeKindArg::Ball => probe::ProbePictureKind::Ball,
            ProbeKindArg::Angular => probe::ProbePictureKind::Angular,
            ProbeKindArg::Panorama => probe::ProbePictureKind::Panorama,
        },
        crop: args.crop,
        ball_distance_radii: args.ball_distance.unwrap_or(f64::INFINITY),
        ball_reflectance: args.reflectance,
        turn_tilt_roll_deg: [args.turn_deg, args.tilt_deg, args.roll_deg],
        align: args.align,
        response: args.response,
        save_response: args.save_response,
        white_at: args.white_at,
        width_px: args.width_px,
        out: args.out,
        preview: args.preview,
    };
    let told = probe::probe(&request)?;
    for remark in &told.remarks {
        talk::say(remark);
    }
    // Where the response goes to stdout, the rest is talk.
    match request.save_response.as_deref().is_some_and(is_stdout) {
        true => talk::say_lines(&told.lights),
        false => talk::give(&told.lights),
    }
    Ok(())
}

fn track_input(args: &TrackArgs) -> Result<track::TrackInput> {
    if is_scene(&args.source) {
        args.recording.refuse_beside(&args.source)?;
        if args.anchors.is_some() || args.size_mm.is_some() {
            bail!(
                "{} is a scene, which says itself what is tracked; --anchors and --size-mm go with a recording",
                args.source.display()
            );
        }
        return Ok(track::TrackInput::Scene(args.source.clone()));
    }
    let camera = camera_of(&args.source, &args.recording)?;
    match (&args.anchors, args.size_mm) {
        (Some(_), _) if args.recording.decimation.is_some() => {
            bail!("--anchors takes the scene's [tracking]; --decimation does not go with it")
        }
        (Some(scene), _) => Ok(track::TrackInput::RecordingWithScene(camera, scene.clone())),
        (None, Some(size_mm)) => Ok(track::TrackInput::LoneMarkers {
            camera,
            family: args.family.family()?,
            size_m: size_m(size_mm)?,
            decimation: args.recording.decimation(),
        }),
        (None, None) => bail!(
            "what is tracked in {}? Give --anchors SCENE, or --size-mm MM for markers each on its own",
            args.source.display()
        ),
    }
}

fn camera_of(source: &Path, args: &RecordingArgs) -> Result<CameraSettings> {
    let source = source
        .to_str()
        .with_context(|| format!("the path {} is not UTF-8 text", source.display()))?;
    Ok(CameraSettings {
        source: source.to_owned(),
        calibration: args.calibration.clone(),
        mirror: args.mirror,
        wanted: args.wanted.wanted(),
    })
}

fn size_m(size_mm: f64) -> Result<f64> {
    let millimetres = MARKER.size_m.takes.scaled(1e3, "mm");
    match millimetres.check(size_mm) {
        Ok(size_mm) => Ok(size_mm * 1e-3),
        // (The largest numbers have three hundred digits.)
        Err(refusal) if size_mm.abs() >= 1e15 => bail!("--size-mm {size_mm:e}: {refusal}"),
        Err(refusal) => bail!("--size-mm {size_mm}: {refusal}"),
    }
}

/// What an interrupt sets. A second one does not wait for a job that cannot end, as one that writes to a pipe which nobody
/// reads.
fn interrupts() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    let set = move || {
        if asked.swap(true, Ordering::Relaxed) {
            exit_without_traces(INTERRUPTED);
        }
    };
    ctrlc::set_handler(set).context("cannot listen for interrupts")?;
    Ok(stop)
}

/// An interrupt ends a job that is done in a moment, or has nothing to keep.
fn end_at_interrupt() -> Result<()> {
    ctrlc::set_handler(|| exit_without_traces(INTERRUPTED)).context("cannot listen for interrupts")
}

/// Says what was done.
fn conclude(report: &Report) -> Result<()> {
    talk::say(&report.done);
    for remark in &report.remarks {
        talk::say(remark);
    }
    report.conclude()
}
