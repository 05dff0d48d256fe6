//! `gnomon chart` as a user types it: what it writes, that it goes on where it was, and that an interrupt leaves whole
//! files.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

#[cfg(unix)]
use crate::common::signals::{self, Signal};

fn chart(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gnomon"));
    command
        .current_dir(folder)
        .arg("chart")
        .args(arguments)
        .stderr(Stdio::piped());
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn mistakes_are_told() {
    let unknown = chart(project(), &["--only", "shadow"]).output().unwrap();
    assert!(!unknown.status.success());
    let told = said(&unknown);
    assert!(told.contains("no such chart"), "{told}");
    assert!(told.contains("tracking, footage, shadows"), "{told}");

    let folder = tempfile::tempdir().unwrap();
    let elsewhere = chart(folder.path(), &["--only", "tracking", "--out", "out"]);
    let elsewhere = { elsewhere }.output().unwrap();
    assert!(!elsewhere.status.success());
    let told = said(&elsewhere);
    assert!(told.contains("project's own folder"), "{told}");
    assert!(!folder.path().join("out").exists());
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_what_was_measured_and_a_rerun_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let arguments = ["--quick", "--only", "stability", "--out", out];
    let measure = || chart(project(), &arguments);
    let kept = folder.path().join(".measured/stability.csv");
    let mut running = measure().spawn().unwrap();
    let started = Instant::now();
    let is_measured = |unit: &str| {
        let known = fs::read_to_string(&kept).unwrap_or_default();
        known
            .split_once(&format!("# {unit}\n"))
            .is_some_and(|(_, rest)| rest.contains("\n\n"))
    };
    while !is_measured("plain") {
        assert!(started.elapsed() < Duration::from_secs(120), "no unit yet");
        assert!(running.try_wait().unwrap().is_none(), "it ended by itself");
        std::thread::sleep(Duration::from_millis(5));
    }
    signals::send(Signal::INT, running.id()).unwrap();
    let ended = running.wait_with_output().unwrap();
    assert!(!ended.status.success());
    assert!(said(&ended).contains("interrupted"), "{}", said(&ended));
    assert!(!folder.path().join("stability.csv").exists());

    // What is known is taken as it stands, here with a value that nobody measures.
    let known = fs::read_to_string(&kept).unwrap();
    let head = "\n\n# plain\nplain,gnomon,";
    let end = known.find(head).expect("the first unit") + head.len();
    let rest = known[end..].find('\n').expect("its row") + end;
    let marked = format!("{}0.0007,0.000777,{}", &known[..end], &known[rest..]);
    assert_ne!(known, marked);
    fs::write(&kept, marked).unwrap();
    let again = measure().output().unwrap();
    assert!(again.status.success(), "{}", said(&again));
    let csv = fs::read_to_string(folder.path().join("stability.csv")).unwrap();
    assert!(csv.contains("plain,gnomon,0.0007,0.000777,"), "{csv}");
    assert!(
        csv.contains("virtual shadow on a real one,gnomon,"),
        "{csv}"
    );
    for file in [
        "stability.svg",
        "stability.png",
        "marker-view.csv",
        "README.md",
    ] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
}
