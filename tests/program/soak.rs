//! An hour's worth of frames through the live pipeline, as fast as they go: memory does not grow. `make soak`.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use gnomon::app::live::beginning::Opening;
use gnomon::app::live::command::SceneCommand;
use gnomon::app::live::session::LiveSession;
use gnomon::app::live::views::ViewMode;
use gnomon::app::live::window_state::WindowState;
use gnomon::app::stopwatch::Stopwatch;
use gnomon::render::Gpu;

/// An hour at 30 frames a second.
const FRAMES: u64 = 108_000;
/// Times that the scene is made anew before memory is looked at.
const WARM_UP: u32 = 15;
/// Memory is looked at so often.
const ROUNDS: u64 = 50;
/// What the parts of a program that come and go may leave, MiB.
const MOST_GROWTH_MIB: f64 = 12.0;
/// The clock runs so much faster that no frame is ever early.
const HASTE: f64 = 1e5;

#[test]
#[ignore = "minutes to an hour: make soak"]
fn an_hour_of_frames_leaves_memory_as_it_was() {
    let wanted = std::env::var("GNOMON_SOAK_FRAMES").map_or(FRAMES, |n| n.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lamp.toml");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("config/lamp.toml")).unwrap();
    let text = text
        .replace(
            "\"recordings/",
            &format!("\"{}/recordings/", root.display()),
        )
        .replace("\"models/", &format!("\"{}/models/", root.display()));
    std::fs::write(&path, text + "\n[shadows]\nsamples = 1\n").unwrap();

    let clock = Stopwatch::clock();
    let now = Arc::new(move || clock() * HASTE);
    let gpu = Arc::new(Gpu::open(None).unwrap());
    let opening = Opening::scene(&path).unwrap();
    let mut session = LiveSession::open(opening, gpu, folder.path(), true, (now, Arc::new(|| ())));
    let mut state = WindowState::new();
    let began = Instant::now();
    // Drivers and allocators keep some of what renderers leave: ever less, so that is first let settle.
    for _ in 0..WARM_UP {
        session.edit_scene(SceneCommand::EndPreview, &state);
        for view in [
            ViewMode::StencilCount,
            ViewMode::Gain,
            ViewMode::Phantoms,
            ViewMode::Composite,
        ] {
            state.view = view;
            show_one(&mut session, &state);
        }
        while !session.is_settled() {
            show_one(&mut session, &state);
        }
    }
    let (round, mut samples) = ((wanted / ROUNDS).max(1), Vec::new());
    for shown in 1..=wanted {
        // Now and then another view for a while, or the scene made anew.
        state.view = match shown % (5 * round) {
            0..20 => ViewMode::StencilCount,
            20..40 => ViewMode::Gain,
            40..60 => ViewMode::Phantoms,
            _ => ViewMode::Composite,
        };
        if shown % (5 * round) == 100 {
            session.edit_scene(SceneCommand::EndPreview, &state);
        }
        show_one(&mut session, &state);
        if shown.is_multiple_of(round) {
            let resident_mib = resident_mib();
            samples.push(resident_mib);
            let secs = began.elapsed().as_secs_f64();
            eprintln!("{shown} frames, {resident_mib:.1} MiB, {secs:.0} s");
        }
    }
    let (early, late) = samples.split_at(samples.len() / 2);
    let most = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
    let growth_mib = most(late) - most(early);
    let (captured, dropped) = session.frames();
    eprintln!(
        "{wanted} frames shown of {captured} ({dropped:?} dropped) in {:.0} s; {:.1} MiB at most in the first half, \
         {:.1} MiB in the second: {growth_mib:+.1} MiB",
        began.elapsed().as_secs_f64(),
        most(early),
        most(late)
    );
    assert!(
        growth_mib < MOST_GROWTH_MIB,
        "{growth_mib} MiB: {samples:?}"
    );
}

/// Moves the session on to its next frame.
fn show_one(session: &mut LiveSession, state: &WindowState) {
    while !session.step(state).unwrap() {
        std::thread::yield_now();
    }
    let now_secs = session.now_secs();
    session.was_shown(now_secs).unwrap();
}

/// Memory that is in use now, as Linux counts it.
fn resident_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find(|line| line.starts_with("VmRSS:"))
        .unwrap();
    let kib: f64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    kib / 1024.0
}
