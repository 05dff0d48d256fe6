//! Compiles the libapriltag shim against the installed header and tells which OpenCV module holds ArUco.

use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(aruco_in_contrib)");
    build_apriltag_shim();
    if aruco_is_in_contrib() {
        println!("cargo::rustc-cfg=aruco_in_contrib");
    }
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
