//! Pictures held against path-traced truth at true poses, so that drawing is judged apart from tracking: roles, the
//! virtual bit of the shadow, what the virtual things change on real pixels, their own shading, and that nothing else
//! changes at all. Definitions as in the reference's compare.py (5 x 5 box filter, masks eroded by as much).

use std::path::{Path, PathBuf};

use crate::common::{gpu, project_file};
use gnomon::app::truth::{Errors, Truth, compare, draw, key_frames};
use gnomon::capture::load_calibration;
use gnomon::scene::Scene;

fn scene_of(name: &str) -> Scene {
    Scene::load(&project_file(&format!("config/{name}.toml"))).expect("the scene of the demo")
}

/// All key frames of a recording, drawn and compared.
fn errors_of(folder: &Path, scene: &Scene, name: &str) -> Vec<Errors> {
    let calibration = project_file(&format!("recordings/{name}/camera.toml"));
    let intrinsics = load_calibration(&calibration).expect("the calibration");
    let mut renderer =
        gnomon::app::precomputed::renderer(gpu(), scene, intrinsics).expect("a renderer");
    let keys = key_frames(folder, &scene.anchors).expect("key frames");
    let errors = keys.iter().map(|(frame, poses)| {
        let drawn = draw(&mut renderer, frame, poses).expect("a drawn frame");
        let truth = Truth::open(folder, frame.index).expect("the truth");
        compare(frame.index, &truth, &drawn).expect("errors")
    });
    let errors: Vec<Errors> = errors.collect();
    assert!(errors.len() >= 2, "{} has key frames", folder.display());
    for errors in &errors {
        eprintln!("{}: {errors:?}", folder.display());
    }
    errors
}

fn hold(folder: &Path, name: &str) {
    for e in &errors_of(folder, &scene_of(name), name) {
        assert!(e.role_pct <= 0.5, "{name}: roles: {e:?}");
        let shadow = e.shadow.expect("the lamp's mask");
        assert!(
            shadow.wrong_pct <= 0.05 && shadow.far == 0,
            "{name}: shadow mask: {e:?}"
        );
        assert!(e.change_real <= 0.04, "{name}: shadow: {e:?}");
        assert!(e.residual_virtual <= 0.15, "{name}: shading: {e:?}");
        assert!(
            e.untouched_wrong == 0 && e.untouched_pct > 50.0,
            "{name}: what nothing virtual touches: {e:?}"
        );
    }
}

/// Soft shadows of a room's light. What representatives of all sources err by at most, by their number: the change of real
/// pixels, and the shadow's factor, for which a third is allowed beyond what sums over so many sources leave when each is
/// traced exactly.
fn hold_room(folder: &Path) {
    for (sources, change_real, factor) in [
        (Some(10), 0.28, 0.04),
        (Some(50), 0.13, 0.016),
        (None, 0.10, 0.007),
    ] {
        let mut scene = scene_of("room");
        scene.shadows.shafts.sources = sources;
        for e in &errors_of(folder, &scene, "room") {
            assert!(e.role_pct <= 0.5, "{sources:?}: roles: {e:?}");
            assert!(e.change_real <= change_real, "{sources:?}: shadow: {e:?}");
            assert!(e.factor <= factor * 4.0 / 3.0, "{sources:?}: factor: {e:?}");
            assert!(e.residual_virtual <= 0.2, "{sources:?}: shading: {e:?}");
            // Faint shadows reach everywhere, but they are faint.
            assert!(
                e.alone_wrong_pct <= 0.05 && e.untouched_wrong == 0,
                "{sources:?}: what nothing virtual touches: {e:?}"
            );
        }
    }
}

/// The original session, larger than what ships.
fn original(name: &str) -> PathBuf {
    project_file("../shared/sessions").join(name)
}

#[test]
fn lamp() {
    hold(&project_file("recordings/lamp"), "lamp");
}

#[test]
fn hand() {
    hold(&project_file("recordings/hand"), "hand");
}

/// Soft edges, ambient light and what things reflect, to be as near as that: the shadow, and the virtual things' shading.
fn hold_soft(name: &str, change_real: f64, residual_virtual: f64) {
    let folder = project_file("recordings").join(name);
    for e in &errors_of(&folder, &scene_of(name), name) {
        assert!(e.role_pct <= 0.5, "{name}: roles: {e:?}");
        assert!(
            e.change_real <= change_real && e.factor_by_light <= 0.02,
            "{name}: shadow: {e:?}"
        );
        assert!(
            e.residual_virtual <= residual_virtual,
            "{name}: shading: {e:?}"
        );
        assert!(e.untouched_wrong == 0, "{name}: untouched: {e:?}");
    }
}

#[test]
fn bulb() {
    hold_soft("bulb", 0.05, 0.05);
}

#[test]
fn window() {
    hold_soft("window", 0.05, 0.05);
}

/// Several large lamps in a probe.
#[test]
fn studio() {
    let folder = project_file("recordings/studio");
    let errors = errors_of(&folder, &scene_of("studio"), "studio");
    let mean = |of: fn(&Errors) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
    let (change, shading) = (mean(|e| e.change_real), mean(|e| e.residual_virtual));
    assert!(change <= 0.07 && shading <= 0.05, "{change} {shading}");
    for e in &errors {
        assert!(e.role_pct <= 0.5 && e.factor <= 0.012, "{e:?}");
        assert!(e.untouched_wrong == 0, "{e:?}");
    }
}

#[test]
fn sky() {
    hold_soft("sky", 0.08, 0.1);
}

#[test]
fn room() {
    hold_room(&project_file("recordings/room"));
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/sessions")]
fn original_room() {
    hold_room(&original("room"));
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/sessions")]
fn original_lamp() {
    hold(&original("lamp"), "lamp");
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/sessions")]
fn original_hand() {
    hold(&original("hand"), "hand");
}
