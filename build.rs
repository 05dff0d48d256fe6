//! Compiles the libapriltag shim against the installed header, lists the shaders, tells which OpenCV module holds ArUco, and
//! which tests have what they need.

use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(aruco_in_contrib)");
    build_apriltag_shim();
    if aruco_is_in_contrib() {
        println!("cargo::rustc-cfg=aruco_in_contrib");
    }
    list_shaders();
    tell_what_tests_have();
}

/// The structs of libapriltag differ between its releases, so the C compiler reads them from the installed header.
fn build_apriltag_shim() {
    let shim = "src/tracking/apriltag_shim.c";
    println!("cargo::rerun-if-changed={shim}");
    let library = pkg_config::Config::new()
        .cargo_metadata(false)
        .probe("apriltag")
        .unwrap_or_else(|error| {
            panic!("libapriltag was not found; on Debian: apt-get install libapriltag-dev\n{error}")
        });
    // Some installations name .../include/apriltag itself; the shim includes <apriltag/apriltag.h>.
    let parents = library
        .include_paths
        .iter()
        .filter(|path| path.ends_with("apriltag"))
        .filter_map(|path| path.parent().map(Path::to_path_buf))
        .collect::<Vec<PathBuf>>();
    cc::Build::new()
        .file(shim)
        .includes(&library.include_paths)
        .includes(&parents)
        .std("c11")
        .compile("gnomon_apriltag_shim");
    // After the shim, which needs it.
    for path in &library.link_paths {
        println!("cargo::rustc-link-search=native={}", path.display());
    }
    for name in &library.libs {
        println!("cargo::rustc-link-lib={name}");
    }
}

/// Writes an array of the names and texts of all files `shaders/*.wgsl`, sorted by name, for `src/render/shader.rs`.
fn list_shaders() {
    println!("cargo::rerun-if-changed=shaders");
    let from_cargo = |name| std::env::var_os(name).expect("cargo sets it");
    let folder = Path::new(&from_cargo("CARGO_MANIFEST_DIR")).join("shaders");
    let entries = std::fs::read_dir(&folder).expect("the shaders are there");
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.expect("the folder can be read").path())
        .filter(|path| path.extension().is_some_and(|it| it == "wgsl"))
        .collect();
    paths.sort();
    let mut text = String::from("[\n");
    for path in &paths {
        let name = path.file_name().unwrap_or_default();
        text += &format!("({name:?}, include_str!({path:?})),\n");
    }
    text += "]\n";
    let list = Path::new(&from_cargo("OUT_DIR")).join("shaders.rs");
    std::fs::write(list, text).expect("cargo's folder can be written");
}

/// OpenCV moved ArUco from the contrib module `aruco` to `objdetect` with 4.7.
fn aruco_is_in_contrib() -> bool {
    println!("cargo::rerun-if-env-changed=PKG_CONFIG_PATH");
    let mut opencv = pkg_config::Config::new();
    opencv.cargo_metadata(false).env_metadata(true);
    let Ok(library) = opencv.probe("opencv4") else {
        // Only OpenCV 5 and installations without pkg-config files come here.
        return false;
    };
    let mut parts = library
        .version
        .split('.')
        .map(|part| part.parse::<u32>().unwrap_or(0));
    let version = (parts.next().unwrap_or(0), parts.next().unwrap_or(0));
    version < (4, 7)
}

/// Tests of what is not there count as ignored, with the reason. `has_shared`: the recordings and photographs beside the
/// project, which are not shipped with it; `has_xvfb`: the programs that show a window without a screen and press its keys.
///
/// Only what is there is watched, as cargo builds anew each time for a path that is missing. What came later is seen once
/// this file is touched, which `scripts/setup tests` does when it has installed something.
fn tell_what_tests_have() {
    println!("cargo::rustc-check-cfg=cfg(has_shared)");
    println!("cargo::rustc-check-cfg=cfg(has_xvfb)");
    let shared = Path::new("../shared");
    let parts = ["sessions", "real", "stability", "models"];
    if parts.iter().all(|part| shared.join(part).is_dir()) {
        println!("cargo::rustc-cfg=has_shared");
        // The folders are large, and cargo would look at each file.
        watch_if_there(&shared.join("DESIGN.md"));
    }
    if let (Some(xvfb), Some(xdotool)) = (on_path("Xvfb"), on_path("xdotool")) {
        println!("cargo::rustc-cfg=has_xvfb");
        watch_if_there(&xvfb);
        watch_if_there(&xdotool);
    }
}

fn watch_if_there(path: &Path) {
    if path.exists() {
        println!("cargo::rerun-if-changed={}", path.display());
    }
}

fn on_path(program: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| path.is_file())
}
