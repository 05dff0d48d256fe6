//! Keeps the floors of `ARCHITECTURE.md`: who may import whom, where the big libraries and the clock live.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// What can be typed: it stands on top of all, with `main.rs`.
const PROGRAM: &str = "command_line";

/// Lowest first; [`PROGRAM`] stands on top of them.
const FLOORS: [&str; 10] = [
    "geometry",
    "light",
    "shafts",
    "environment",
    "scene",
    "capture",
    "tracking",
    "calibration",
    "render",
    "app",
];

/// The groups of `app`, lowest first; the jobs stand on all of them.
const APP_GROUPS: [&str; 12] = [
    "stopwatch",
    "talk",
    "files",
    "disk_cache",
    "precomputed",
    "input",
    "recording",
    "stages",
    "scene_warnings",
    "authoring",
    "truth",
    "window",
];

/// The jobs that are folders of `app`; the others are modules of `app::jobs`.
const LARGE_JOBS: [&str; 2] = ["live", "chart"];

/// What has a window.
const WINDOWS: &[&str] = &["app/window/", "app/live/", "app/jobs/calibrate/watched/"];

/// A word of code, and the only places (below `src/`) where it may stand.
const HOMES: [(&str, &[&str]); 18] = [
    // The window shows a texture of the renderer's.
    ("wgpu", &["render/", "app/window/screen.rs"]),
    ("eframe", WINDOWS),
    ("egui", WINDOWS),
    ("egui_plot", &["app/live/"]),
    ("naga", &["render/"]),
    (
        "opencv",
        // The last one for its lettering alone.
        &[
            "capture/",
            "tracking/",
            "calibration/",
            "app/jobs/markers/png.rs",
        ],
    ),
    ("nokhwa", &["capture/"]),
    ("rfd", &["app/live/"]),
    ("v4l", &["capture/"]),
    ("yuv", &["capture/"]),
    ("zune_jpeg", &["capture/"]),
    // What is kept of rooms on disk.
    ("dirs", &["app/"]),
    ("postcard", &["app/"]),
    ("Instant", &["app/stopwatch.rs"]),
    ("SystemTime", &["app/stopwatch.rs"]),
    // Nothing is said where a closed stream would end the job.
    ("println", &[]),
    ("eprint", &[]),
    ("eprintln", &[]),
];

#[test]
fn imports_go_down() {
    let sources = sources();
    assert!(sources.len() > 10, "src/ was not found");
    let complaints: Vec<String> = sources
        .iter()
        .flat_map(|(file, text)| bad_imports(file, text))
        .collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

/// What two jobs need lies in a group below them, and charts alone know the truth.
#[test]
fn jobs_import_no_other_job() {
    let complaints: Vec<String> = sources()
        .iter()
        .flat_map(|(file, text)| bad_app_imports(file, text))
        .collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn neighbours_do_not_import_in_a_circle() {
    let circles = circles(&sources());
    assert!(circles.is_empty(), "\n{}", circles.join("\n"));
}

#[test]
fn libraries_and_the_clock_stay_at_home() {
    let complaints: Vec<String> = sources()
        .iter()
        .flat_map(|(file, text)| strays(file, text))
        .collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

/// Whatever else is written goes through `app/files/new_file.rs`: whole, beside its place, under a name that nobody foresees.
#[test]
fn files_are_written_in_few_places() {
    const WRITES: [&str; 7] = [
        "fs::write(",
        " File::create(",
        "(File::create(",
        "fs::File::create(",
        "fs::rename(",
        "fs::copy(",
        "OpenOptions::",
    ];
    const HOMES: [&str; 3] = [
        // Kept measurements: appended to, and begun anew.
        "app/chart/measured.rs",
        "app/recording/session_folder.rs",
        // A camera's device, to be read.
        "capture/live/webcam.rs",
    ];
    let complaints: Vec<String> = sources()
        .iter()
        .filter(|(file, _)| !HOMES.contains(&file.as_str()) && !file.ends_with("tests.rs"))
        .flat_map(|(file, text)| {
            let code = text.split("\n#[cfg(test)]").next().unwrap_or_default();
            let found = WRITES.iter().filter(|write| code.contains(**write));
            found.map(move |write| format!("src/{file}: `{write}` belongs in {HOMES:?} alone"))
        })
        .collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

/// The checks themselves catch what they are for.
mod the_checks {
    use super::*;

    fn bad(file: &str, text: &str) -> bool {
        !bad_imports(file, text).is_empty()
    }

    #[test]
    fn an_import_from_above_is_caught() {
        assert!(bad("geometry/mesh.rs", "use crate::render::Frame;"));
        assert!(bad("scene/mod.rs", "fn f() { crate::capture::load(); }"));
        assert!(bad(
            "capture/video.rs",
            "use crate::{geometry::camera, tracking::{Status}};"
        ));
        assert!(bad(
            "capture/video.rs",
            "use super::super::tracking::Status;"
        ));
        assert!(bad("capture/mod.rs", "use super::app;"));
        assert!(bad(
            "capture/mod.rs",
            "mod tests { use super::super::app; }"
        ));
        assert!(bad("capture/mod.rs", "use crate::*;"));
        assert!(
            bad("attic/mod.rs", "use crate::geometry;"),
            "a floor that nobody knows"
        );
    }

    #[test]
    fn an_import_from_below_is_not() {
        assert!(!bad(
            "tracking/mod.rs",
            "use crate::{geometry::{camera, app}, capture::Frame}; pub(crate) fn f() {}"
        ));
        assert!(!bad(
            "capture/video.rs",
            "use super::error::Notice; use crate::capture::Frame;"
        ));
        assert!(!bad("capture/mod.rs", "mod tests { use super::app; }"));
        assert!(!bad(
            "geometry/mod.rs",
            "//! Not `crate::app`.\nconst X: &str = \"crate::app\"; /* crate::app */"
        ));
        assert!(!bad(
            "geometry/mod.rs",
            "const X: &str = r#\"crate::app \" \"#; const Y: char = '\"'; // \" crate::app"
        ));
        assert!(!bad("main.rs", "use gnomon::app; use crate::cli;"));
    }

    #[test]
    fn a_job_that_knows_another_is_caught() {
        let bad = |file, text| !bad_app_imports(file, text).is_empty();
        for (file, text) in [
            ("app/jobs/replay/mod.rs", "use crate::app::jobs::track::X;"),
            ("app/jobs/board.rs", "use super::track::X;"),
            ("app/jobs/board.rs", "use crate::app::live::X;"),
            (
                "app/live/mod.rs",
                "fn f() { crate::app::jobs::check::f(); }",
            ),
            ("app/live/look.rs", "use crate::app::chart::X;"),
            ("app/jobs/check/mod.rs", "use crate::app::truth::X;"),
            ("app/window/fit.rs", "use crate::app::truth::X;"),
            ("app/stages/tally.rs", "use crate::app::jobs::track::X;"),
            ("app/files/output.rs", "use crate::app::stages::stats::X;"),
            ("app/attic.rs", "use crate::app::files::X;"),
            ("app/live/mod.rs", "use crate::app::attic::X;"),
            ("app/live/mod.rs", "use crate::app::*;"),
        ] {
            assert!(bad(file, text), "{file}: {text}");
        }
        for (file, text) in [
            ("app/jobs/replay/mod.rs", "use super::replay::sheet::X;"),
            ("app/jobs/replay/sheet.rs", "use super::X;"),
            ("app/live/mod.rs", "use crate::app::stages::stats::X;"),
            ("app/chart/lab.rs", "use crate::app::truth::X;"),
            ("app/stages/tally.rs", "use crate::app::files::X;"),
            ("app/mod.rs", "pub use jobs::track::X;"),
            ("main.rs", "use gnomon::app::jobs::track::X;"),
        ] {
            assert!(!bad(file, text), "{file}: {text}");
        }
    }

    #[test]
    fn a_circle_is_caught() {
        let files = |pairs: &[(&str, &str)]| {
            pairs
                .iter()
                .map(|(file, text)| (file.to_string(), text.to_string()))
                .collect()
        };
        let circle = files(&[
            ("app/a.rs", "use super::b::B;"),
            ("app/b.rs", "use crate::app::c::C;"),
            ("app/c/mod.rs", "use super::{d, a::A};"),
        ]);
        assert_eq!(circles(&circle), ["app::a → app::b → app::c → app::a"]);
        let chain = files(&[
            ("app/mod.rs", "use a::A;"),
            ("app/a.rs", "use super::b::B; use super::Frame;"),
            (
                "app/b.rs",
                "use super::Frame; mod tests { use super::super::a; }",
            ),
        ]);
        assert_eq!(circles(&chain), ["app::a → app::b → app::a"]);
    }

    #[test]
    fn a_stray_is_caught() {
        assert_eq!(strays("app/mod.rs", "use opencv::core::Mat;").len(), 1);
        assert_eq!(strays("shafts/casters.rs", "use wgpu::Buffer;").len(), 1);
        assert_eq!(
            strays("render/mod.rs", "let now = std::time::Instant::now();").len(),
            1
        );
        assert_eq!(
            strays("app/stopwatch.rs", "use std::time::Instant; // not opencv").len(),
            0
        );
        assert_eq!(
            strays("capture/video.rs", "use opencv::core::Mat;").len(),
            0
        );
    }
}

/// Paths below `src/`, with `/`, and their texts.
fn sources() -> BTreeMap<String, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = BTreeMap::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for path in entries(&folder) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let name = path
                    .strip_prefix(&root)
                    .expect("below src")
                    .to_string_lossy()
                    .replace('\\', "/");
                found.insert(
                    name,
                    fs::read_to_string(&path).expect("a source can be read"),
                );
            }
        }
    }
    found
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    entries
        .map(|entry| entry.expect("a folder can be listed").path())
        .collect()
}

fn bad_imports(file: &str, text: &str) -> Vec<String> {
    // The library's root names the floors, the program's stands on all of them.
    let Some((own, _)) = file.split_once('/') else {
        return Vec::new();
    };
    if own == PROGRAM {
        return Vec::new();
    }
    let Some(own_floor) = FLOORS.iter().position(|floor| *floor == own) else {
        return vec![format!(
            "src/{file}: '{own}' is no floor; tests/suite/architecture.rs and ARCHITECTURE.md list them"
        )];
    };
    imports(file, text)
        .into_iter()
        .filter_map(|import| {
            let target = import.first().map_or("", String::as_str);
            let floor = FLOORS.iter().position(|floor| *floor == target);
            let complaint = match floor {
                Some(floor) if floor <= own_floor => return None,
                Some(_) => format!("{own} stands below {target}"),
                None => format!("'{target}' is no floor"),
            };
            Some(format!(
                "src/{file}: crate::{}: {complaint}",
                import.join("::")
            ))
        })
        .collect()
}

/// A module's part of `app`.
#[derive(Clone, Copy, PartialEq)]
enum AppPart<'a> {
    /// `app` itself, and `app::jobs`, which only name what lies in them.
    List,
    /// By its place in [`APP_GROUPS`].
    Group(usize),
    /// By its name.
    Job(&'a str),
    /// What nobody has told a place.
    Unknown,
}

/// `None` for what does not lie in `app`.
fn app_part(module: &[String]) -> Option<AppPart<'_>> {
    let module: Vec<&str> = module.iter().map(String::as_str).collect();
    let group = |name: &str| APP_GROUPS.iter().position(|group| *group == name);
    Some(match module[..] {
        ["app"] | ["app", "jobs"] => AppPart::List,
        ["app", "jobs", job, ..] if job != "*" => AppPart::Job(job),
        ["app", job, ..] if LARGE_JOBS.contains(&job) => AppPart::Job(job),
        ["app", name, ..] => group(name).map_or(AppPart::Unknown, AppPart::Group),
        _ => return None,
    })
}

fn bad_app_imports(file: &str, text: &str) -> Vec<String> {
    let module = module_of(file);
    let Some(own) = app_part(&module) else {
        return Vec::new();
    };
    if own == AppPart::Unknown {
        return vec![format!(
            "src/{file}: no group of app; tests/architecture.rs lists them"
        )];
    }
    let truth = APP_GROUPS.iter().position(|group| *group == "truth");
    let knows_truth =
        own == AppPart::Job("chart") || matches!(own, AppPart::Group(at) if Some(at) == truth);
    imports(file, text)
        .into_iter()
        .filter_map(|import| {
            let complaint = match (own, app_part(&import)?) {
                (_, AppPart::Unknown) => "no group of app",
                (_, AppPart::Group(at)) if Some(at) == truth && !knows_truth => {
                    "charts alone know the truth"
                }
                (AppPart::Group(own), AppPart::Group(at)) if at > own => "stands above",
                (AppPart::Group(_), AppPart::Job(_)) => "jobs stand above",
                (AppPart::Job(own), AppPart::Job(other)) if own != other => "another job",
                _ => return None,
            };
            Some(format!(
                "src/{file}: crate::{}: {complaint}",
                import.join("::")
            ))
        })
        .collect()
}

/// Circles among modules of one floor. A parent and what lies in it may know each other.
fn circles(sources: &BTreeMap<String, String>) -> Vec<String> {
    let modules: BTreeSet<Vec<String>> = sources.keys().map(|file| module_of(file)).collect();
    let mut imported: BTreeMap<Vec<String>, BTreeSet<Vec<String>>> = BTreeMap::new();
    for (file, text) in sources {
        let module = module_of(file);
        for mut target in imports(file, text) {
            while !target.is_empty() && !modules.contains(&target) {
                target.pop();
            }
            if !module.starts_with(&target) && !target.starts_with(&module) {
                imported.entry(module.clone()).or_default().insert(target);
            }
        }
    }
    let mut found = BTreeSet::new();
    for start in imported.keys() {
        let mut ways = vec![vec![start.clone()]];
        let mut seen = BTreeSet::new();
        while let Some(way) = ways.pop() {
            for next in imported.get(&way[way.len() - 1]).into_iter().flatten() {
                let way = [way.as_slice(), std::slice::from_ref(next)].concat();
                // Each circle is told once, from its first module.
                if next == start && way.iter().min() == Some(start) {
                    found.insert(
                        way.iter()
                            .map(|module| module.join("::"))
                            .collect::<Vec<_>>()
                            .join(" → "),
                    );
                } else if seen.insert(next.clone()) {
                    ways.push(way);
                }
            }
        }
    }
    found.into_iter().collect()
}

fn strays(file: &str, text: &str) -> Vec<String> {
    let words = words(text);
    let at_home = |homes: &[&str]| homes.iter().any(|home| file.starts_with(home));
    HOMES
        .iter()
        .filter(|(word, homes)| !at_home(homes) && words.iter().any(|found| found == word))
        .map(|(word, homes)| format!("src/{file}: '{word}' belongs in {homes:?} alone"))
        .collect()
}

/// `capture/video.rs` is the module `[capture, video]`, `capture/mod.rs` is `[capture]`.
fn module_of(file: &str) -> Vec<String> {
    let path = file.trim_end_matches(".rs");
    let path = path.strip_suffix("/mod").unwrap_or(path);
    path.split('/')
        .filter(|part| !matches!(*part, "lib" | "main"))
        .map(str::to_owned)
        .collect()
}

/// All paths of the code that begin with `crate` or `super`, from the crate's root; `*` where everything is taken.
fn imports(file: &str, text: &str) -> Vec<Vec<String>> {
    let words = words(text);
    let mut module = module_of(file);
    let mut depth = 0;
    // Depths of the braces that belong to `mod name {`.
    let mut inline_modules: Vec<usize> = Vec::new();
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(word) = words.get(at) {
        let next = |ahead: usize| words.get(at + ahead).map_or("", String::as_str);
        match word.as_str() {
            "mod" if next(2) == "{" => {
                module.push(next(1).to_owned());
                inline_modules.push(depth);
                depth += 1;
                at += 2;
            }
            "{" => depth += 1,
            "}" => {
                depth -= 1;
                if inline_modules.last() == Some(&depth) {
                    inline_modules.pop();
                    module.pop();
                }
            }
            "crate" if next(1) == "::" => {
                at = follow(&words, at + 2, Vec::new(), &mut found);
                continue;
            }
            "crate" if next(1) == "as" => found.push(vec!["*".to_owned()]),
            "super" if next(1) == "::" => {
                let mut prefix = module.clone();
                while words.get(at).is_some_and(|word| word == "super") {
                    prefix.pop();
                    at += 2;
                }
                at = follow(&words, at, prefix, &mut found);
                continue;
            }
            _ => {}
        }
        at += 1;
    }
    found
}

/// Reads a path, or a group of paths, from `at` on behind `prefix`; gives where it ends.
fn follow(
    words: &[String],
    mut at: usize,
    prefix: Vec<String>,
    found: &mut Vec<Vec<String>>,
) -> usize {
    let word = |at: usize| words.get(at).map_or("", String::as_str);
    if word(at) == "{" {
        at += 1;
        while at < words.len() && word(at) != "}" {
            at = if word(at) == "," {
                at + 1
            } else {
                follow(words, at, prefix.clone(), found)
            };
        }
        return at + 1;
    }
    let mut path = prefix;
    path.push(word(at).to_owned());
    at += 1;
    while word(at) == "::" {
        let group = word(at + 1) == "{";
        if group {
            return follow(words, at + 1, path, found);
        }
        path.push(word(at + 1).to_owned());
        at += 2;
    }
    if word(at) == "as" {
        at += 2;
    }
    found.push(path);
    at
}

/// The code's identifiers, `::` and single signs, without comments, strings and characters.
fn words(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let is_word = |char: char| char.is_alphanumeric() || char == '_';
    let starts = |at: usize, what: &str| {
        what.chars()
            .enumerate()
            .all(|(ahead, char)| chars.get(at + ahead) == Some(&char))
    };
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(&char) = chars.get(at) {
        if starts(at, "//") {
            at += chars[at..].iter().take_while(|char| **char != '\n').count();
        } else if starts(at, "/*") {
            let mut depth = 0;
            loop {
                if starts(at, "/*") {
                    depth += 1;
                    at += 2;
                } else if starts(at, "*/") {
                    depth -= 1;
                    at += 2;
                } else {
                    at += 1;
                }
                if depth == 0 || at >= chars.len() {
                    break;
                }
            }
        } else if char == '"' {
            at += 1;
            while at < chars.len() && chars[at] != '"' {
                at += if chars[at] == '\\' { 2 } else { 1 };
            }
            at += 1;
        } else if let Some(hashes) = raw_string_hashes(&chars[at..]) {
            let end: String = std::iter::once('"')
                .chain("#".repeat(hashes).chars())
                .collect();
            at += chars[at..].iter().take_while(|char| **char != '"').count() + 1;
            while at < chars.len() && !starts(at, &end) {
                at += 1;
            }
            at += end.len();
        } else if char == '\'' {
            // 'x' and '\n' are characters, 'x without an end is a lifetime.
            match (chars.get(at + 1), chars.get(at + 2)) {
                (Some('\\'), _) => {
                    at += 3
                        + chars[at + 3..]
                            .iter()
                            .take_while(|char| **char != '\'')
                            .count()
                        + 1
                }
                (Some(_), Some('\'')) => at += 3,
                _ => at += 1,
            }
        } else if is_word(char) {
            let word: String = chars[at..]
                .iter()
                .take_while(|char| is_word(**char))
                .collect();
            at += word.chars().count();
            found.push(word);
        } else if starts(at, "::") {
            found.push("::".to_owned());
            at += 2;
        } else {
            if !char.is_whitespace() {
                found.push(char.to_string());
            }
            at += 1;
        }
    }
    found
}

/// How many `#` a raw string begins with; `None` where none begins.
fn raw_string_hashes(chars: &[char]) -> Option<usize> {
    let prefix = chars
        .iter()
        .take_while(|char| matches!(char, 'b' | 'r'))
        .count();
    let raw = (1..=2).contains(&prefix) && chars[prefix - 1] == 'r';
    let hashes = chars[prefix..]
        .iter()
        .take_while(|char| **char == '#')
        .count();
    (raw && chars.get(prefix + hashes) == Some(&'"')).then_some(hashes)
}
