//! Pictures held against path-traced truth at true poses, so that drawing is judged apart from tracking: roles, the
//! virtual bit of the shadow, what the virtual things change on real pixels, their own shading, and that nothing else
//! changes at all. Definitions as in the reference's compare.py (5 x 5 box filter, masks eroded by as much).

mod common;

use std::path::{Path, PathBuf};

use common::{gpu, project_file};
use gnomon::app::truth::{Errors, Truth, compare, draw, key_frames};
use gnomon::capture::load_calibration;
use gnomon::geometry::camera::Intrinsics;
use gnomon::render::Renderer;
use gnomon::scene::Scene;

/// All key frames of a recording, drawn and compared.
fn errors_of(folder: &Path, name: &str, intrinsics: Intrinsics) -> Vec<Errors> {
    let scene =
        Scene::load(&project_file(&format!("config/{name}.toml"))).expect("the scene of the demo");
    let mut renderer = Renderer::new(gpu(), &scene, intrinsics).expect("a renderer");
    let keys = key_frames(folder, &scene.anchors).expect("key frames");
    let errors = keys.iter().map(|(frame, poses)| {
        let drawn = draw(&mut renderer, frame, poses).expect("a drawn frame");
        let truth = Truth::open(folder, frame.index).expect("the truth");
        compare(frame.index, &truth, &drawn).expect("errors")
    });
    errors.collect()
}

fn hold(folder: &Path, name: &str) {
    let calibration = project_file(&format!("recordings/{name}/camera.toml"));
    let intrinsics = load_calibration(&calibration).expect("the calibration");
    let found = errors_of(folder, name, intrinsics);
    for errors in &found {
        eprintln!("{}: {errors:?}", folder.display());
    }
    assert!(found.len() >= 2, "{} has key frames", folder.display());
    for e in &found {
        assert!(e.role_pct <= 0.5, "{name}: roles: {e:?}");
        let shadow = e.shadow.expect("the lamp's mask");
        assert!(
            shadow.wrong_pct <= 0.05 && shadow.far == 0,
            "{name}: shadow mask: {e:?}"
        );
        assert!(e.change_real <= 0.15, "{name}: shadow: {e:?}");
        assert!(e.residual_virtual <= 0.15, "{name}: shading: {e:?}");
        assert!(
            e.untouched_wrong == 0 && e.untouched_pct > 50.0,
            "{name}: what nothing virtual touches: {e:?}"
        );
    }
}

/// The original session, larger than what ships; told of and passed over where it is not there.
fn hold_original(name: &str) {
    let folder: PathBuf = project_file("../shared/sessions").join(name);
    if folder.is_dir() {
        hold(&folder, name);
    } else {
        eprintln!("skipped: {} is not there", folder.display());
    }
}

#[test]
fn lamp() {
    hold(&project_file("recordings/lamp"), "lamp");
}

#[test]
fn hand() {
    hold(&project_file("recordings/hand"), "hand");
}

#[test]
fn original_lamp() {
    hold_original("lamp");
}

#[test]
fn original_hand() {
    hold_original("hand");
}
