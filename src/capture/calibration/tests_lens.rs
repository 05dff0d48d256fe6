//! Which lens a file of another program's means: its model and its coefficients, wherever they stand.

use super::tests::{lamp, load, message};
use super::*;

const SIZE: &str = "width: 640\nheight: 480\n";
const LETTERS: &str = "fx: 615\nfy: 613\ncx: 321.4\ncy: 238.2\n";
const MATRIX: &str = "K: [615, 0, 321.4, 0, 613, 238.2, 0, 0, 1]\n";
const FISHEYE: Distortion = Distortion::Fisheye([0.02, 0.01, -0.003, 0.001]);
const FOUR: &str = "[0.02, 0.01, -0.003, 0.001]";

fn lens(text: &str) -> Distortion {
    let found = load("a.yaml", text).unwrap_or_else(|error| panic!("{text}: {error}"));
    assert_eq!(found.focal_px, lamp().focal_px, "{text}");
    found.distortion
}

fn is_refused(text: &str, part: &str) {
    let said = message("a.yaml", text);
    assert!(said.contains(part), "{text}: {said}");
}

/// A text within a table.
fn inside(table: &str, text: &str) -> String {
    let lines = text.lines().map(|line| format!("  {line}\n"));
    format!("{table}:\n{}", lines.collect::<String>())
}

#[test]
fn whatever_key_names_a_fisheye_is_followed() {
    for line in [
        "type: fisheye",
        "camera_type: fisheye",
        "model_type: KANNALA_BRANDT",
        "projection: fisheye",
        "lens: fisheye",
        "cam_model: kb4",
        "calibration_model: equidistant",
        "dist_model: fisheye",
        "use_fisheye: true",
        "cameraType: 1",
    ] {
        for camera in [LETTERS, MATRIX] {
            let camera = format!("{SIZE}{camera}D: {FOUR}\n");
            assert_eq!(lens(&format!("{camera}{line}\n")), FISHEYE, "{line}");
            assert_eq!(
                lens(&inside("cam0", &format!("{camera}{line}\n"))),
                FISHEYE,
                "{line}"
            );
            assert_eq!(
                lens(&format!("{line}\n{}", inside("cam0", &camera))),
                FISHEYE,
                "{line}"
            );
        }
    }
    // DepthAI writes 14 numbers of every camera.
    let many = "D: [0.02, 0.01, -0.003, 0.001, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n";
    assert_eq!(
        lens(&format!("{SIZE}{MATRIX}{many}cameraType: 1\n")),
        FISHEYE
    );
}

#[test]
fn whatever_key_names_a_model_that_is_not_supported_is_refused() {
    for (line, part) in [
        ("type: ds", "type: the model 'ds' is not supported"),
        ("camera_type: omni", "camera_type: the model 'omni'"),
        (
            "some_projection: Double Sphere",
            "the model 'Double Sphere'",
        ),
        ("lens: equisolid fisheye", "the model 'equisolid fisheye'"),
        ("dist_model: weird", "dist_model: the model 'weird'"),
        ("model_type: eucm", "the model 'eucm'"),
        ("cameraType: 2", "must be 0 (perspective) or 1 (fisheye)"),
        ("mirror_parameters: {xi: 0.9}", "omnidirectional"),
        ("use_fisheye: 3", "use_fisheye must be 0 or 1"),
    ] {
        for camera in [LETTERS, MATRIX] {
            let camera = format!("{SIZE}{camera}D: {FOUR}\n");
            is_refused(&format!("{camera}{line}\n"), part);
            is_refused(&inside("cam0", &format!("{camera}{line}\n")), part);
            is_refused(&format!("{line}\n{}", inside("cam0", &camera)), part);
        }
    }
}

/// What speaks of something else than the lens changes nothing.
#[test]
fn other_types_and_models_are_passed_over() {
    let pinhole = Distortion::Polynomial([0.02, 0.01, -0.003, 0.001, 0.0]);
    for line in [
        "sensor_type: camera",
        "sensor_model: OmniVision OV9281",
        "cameraType: 0",
        "projection: [1, 2, 3]",
        "lens: {model: Canon 50 mm, aperture: 1.8}",
        "lens: Canon",
        "device: {model: D435, type: usb}",
        "use_fisheye: false",
        "skew: 0",
        "alpha: 1",
    ] {
        for camera in [LETTERS, MATRIX] {
            let text = format!("{SIZE}{camera}D: {FOUR}\n{line}\n");
            assert_eq!(lens(&text), pinhole, "{text}");
        }
    }
    let usb = format!("type: usb\n{SIZE}{MATRIX}D: {FOUR}\n");
    assert_eq!(lens(&usb), pinhole);
}

/// A table of a lens's with a model and a list in it.
#[test]
fn parameters_of_a_lens_are_its_coefficients() {
    let row = "intrinsics: [615, 613, 321.4, 238.2]\n";
    let column = "intrinsics: {rows: 4, cols: 1, data: [615, 613, 321.4, 238.2]}\n";
    let matrix = format!("{{rows: 4, cols: 1, data: {FOUR}}}");
    for camera in [row, column, LETTERS, MATRIX] {
        for table in [
            format!("distortion: {{type: equidistant, parameters: {FOUR}}}\n"),
            format!("distortion: {{model: fisheye, params: {matrix}}}\n"),
            "lens: {type: fisheye, k1: 0.02, k2: 0.01, k3: -0.003, k4: 0.001}\n".to_owned(),
            format!("lens: {{distortion: {{model: equidistant, coefficients: {FOUR}}}}}\n"),
        ] {
            let camera = format!("{SIZE}{camera}{table}");
            assert_eq!(lens(&camera), FISHEYE, "{camera}");
            assert_eq!(lens(&inside("cam0", &camera)), FISHEYE, "{camera}");
        }
    }
    let radtan = format!("{SIZE}{row}distortion: {{model: radtan, parameters: [1, 2, 3, 4]}}\n");
    assert_eq!(
        lens(&radtan),
        Distortion::Polynomial([1.0, 2.0, 3.0, 4.0, 0.0])
    );
    let camera = format!("{SIZE}{row}");
    is_refused(
        &format!("{camera}distortion: {{type: omni, parameters: {FOUR}}}\n"),
        "type: the model 'omni'",
    );
    is_refused(
        &format!("{camera}distortion: {{type: equidistant}}\n"),
        "coefficients are missing",
    );
    is_refused(
        &format!("{camera}distortion: {{numbers: {FOUR}}}\n"),
        "numbers is not understood",
    );
}

/// The lens stands in another table than the camera.
#[test]
fn coefficients_beside_the_cameras_table_are_taken() {
    let list = "[0.08, -0.19, 0.0008, -0.0005, 0.05]";
    for camera in [LETTERS, MATRIX] {
        for lens in [
            format!("distortion: {list}\n"),
            format!("distortion: {{coefficients: {list}}}\n"),
            format!("lens: {{dist: {list}}}\n"),
            "k1: 0.08\nk2: -0.19\np1: 0.0008\np2: -0.0005\nk3: 0.05\n".to_owned(),
            "lens: {k1: 0.08, k2: -0.19, p1: 0.0008, p2: -0.0005, k3: 0.05}\n".to_owned(),
        ] {
            for text in [
                format!("{SIZE}{lens}{}", inside("camera", camera)),
                format!(
                    "{SIZE}{lens}cams: [{{id: 3}}]\n{}",
                    inside("intrinsics", &inside("a", camera))
                ),
            ] {
                let found = load("a.yaml", &text).unwrap_or_else(|error| panic!("{text}: {error}"));
                assert_eq!(found, lamp(), "{text}");
            }
        }
    }
    // Its own coefficients come first.
    let own = format!("{SIZE}{MATRIX}dist: {list}\n");
    let text = format!("dist: [1, 2, 3, 4]\n{}", inside("camera", &own));
    assert_eq!(load("a.yaml", &text).unwrap(), lamp());
}

/// Before a lens is taken to have no distortion the whole file is looked at.
#[test]
fn signs_of_a_lens_are_never_passed_over() {
    for camera in [LETTERS, MATRIX] {
        let camera = format!("{SIZE}{camera}");
        for (line, part) in [
            (
                "alpha: 0.6\nbeta: 1.1",
                "alpha belongs to the extended unified",
            ),
            ("w: 0.92", "w belongs to the FOV model"),
            (
                "left: {left_distortion: {coefficients: [1, 2, 3, 4]}}",
                "coefficients speaks of a lens",
            ),
            ("other: {k1: 0.1}", "k1"),
            (
                "other: [{radial_coefs: [0.1]}]",
                "radial_coefs speaks of a lens",
            ),
            (
                "about: {at: {lens_model: fisheye}}",
                "lens_model speaks of a lens",
            ),
        ] {
            let text = format!("{camera}{line}\n");
            // (By letters the coefficients of any table are the camera's.)
            if !(text.contains("fx") && (line.contains("{k1") || line.contains("left"))) {
                is_refused(&text, part);
            }
        }
        for line in [
            "alpha: 0",
            "other: {k1: 0}",
            "other: {undistorted: true, focus_distance: [1]}",
        ] {
            let text = format!("{camera}{line}\n");
            assert_eq!(lens(&text), Distortion::NONE, "{text}");
        }
        // A fisheye without terms is one.
        let none = format!("{camera}camera_model: OPENCV_FISHEYE\n");
        assert_eq!(lens(&none), Distortion::Fisheye([0.0; 4]));
    }
}

#[test]
fn letters_that_no_lens_has_together_are_refused() {
    let four = "k1: 0.02\nk2: 0.01\nk3: -0.003\nk4: 0.001\n";
    for camera in [LETTERS, MATRIX] {
        let camera = format!("{SIZE}{camera}");
        is_refused(&format!("{camera}{four}"), "add model = \"fisheye\"");
        assert_eq!(lens(&format!("{camera}{four}model: fisheye\n")), FISHEYE);
        let tangential = format!("{camera}{four}p1: 0\np2: 0\n");
        assert!(matches!(lens(&tangential), Distortion::Rational(_)));
        for (more, part) in [
            ("p1: 0.1", "there is a p1 of 0.1 too"),
            ("k5: 0.1", "there is a k5 of 0.1 too"),
        ] {
            is_refused(&format!("{camera}{four}{more}\nmodel: fisheye\n"), part);
        }
    }
}

#[test]
fn coefficients_that_contradict_each_other_are_refused() {
    for camera in [LETTERS, MATRIX] {
        let camera = format!("{SIZE}{camera}");
        is_refused(
            &format!("{camera}D: [1, 2, 3, 4]\ndist: [1, 2, 3, 5]\n"),
            "dist and D contradict each other",
        );
        is_refused(
            &format!("{camera}k1: 0.1\ndistortion: {{k1: 0.2}}\n"),
            "k1 is there twice",
        );
        let same = format!("{camera}D: [0.02, 0.01, -0.003, 0.001, 0]\ndist: {FOUR}\n");
        assert!(matches!(lens(&same), Distortion::Polynomial(_)));
    }
}

#[test]
fn skew_is_refused_however_it_is_written() {
    let row = "intrinsics: [615, 613, 321.4, 238.2]\n";
    for camera in [LETTERS, MATRIX, row] {
        let text = format!("{SIZE}{camera}skew: 12.5\n");
        is_refused(&text, "skew must be 0, not 12.5");
    }
}
