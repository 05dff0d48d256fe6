//! In which units, from which pixel on and for which size a file of another program's has its numbers.

use super::tests::{lamp, load, message};
use super::*;

fn loaded(text: &str) -> Intrinsics {
    load("a.json", text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn is_near(found: DVec2, expected: [f64; 2]) -> bool {
    found.distance(DVec2::from_array(expected)) < 1e-9
}

/// OpenSfM's and OpenDroneMap's units are the picture's longer side, from its middle.
#[test]
fn opensfms_cameras_are_converted() {
    let camera = |kind: &str, rest: &str| {
        format!(
            r#"{{"v2 a camera": {{"projection_type": "{kind}", "width": 640, "height": 480, {rest}}}}}"#
        )
    };
    let four = r#""focal_x": 0.9375, "focal_y": 1.0, "c_x": 0.01, "c_y": -0.02"#;
    let found = loaded(&camera(
        "brown",
        &format!(r#"{four}, "k1": 0.1, "k2": 0.2, "p1": 0.3, "p2": 0.4, "k3": 0.5"#),
    ));
    assert_eq!(found.size_px, [640, 480]);
    assert!(is_near(found.focal_px, [600.0, 640.0]), "{found:?}");
    assert!(is_near(found.center_px, [325.9, 226.7]), "{found:?}");
    assert_eq!(
        found.distortion,
        Distortion::Polynomial([0.1, 0.2, 0.3, 0.4, 0.5])
    );
    let plain = loaded(&camera(
        "perspective",
        r#""focal": 0.9375, "k1": 0.1, "k2": 0.2"#,
    ));
    assert!(is_near(plain.focal_px, [600.0; 2]) && is_near(plain.center_px, [319.5, 239.5]));
    assert_eq!(
        plain.distortion,
        Distortion::Polynomial([0.1, 0.2, 0.0, 0.0, 0.0])
    );
    let fisheye = loaded(&camera("fisheye", r#""focal": 0.5, "k1": 0.1, "k2": 0.2"#));
    assert_eq!(
        fisheye.distortion,
        Distortion::Fisheye([0.1, 0.2, 0.0, 0.0])
    );
    // Others name theirs alike, and have pixels.
    let in_pixels = r#""focal_x": 615, "focal_y": 613, "cx": 321.4, "cy": 238.2"#;
    let in_pixels = loaded(&camera("brown", in_pixels));
    assert_eq!(in_pixels.center_px, lamp().center_px);
    let inner = format!(
        r#"{{"cameras": {}, "shots": {{}}}}"#,
        camera("radial", four)
    );
    assert!(is_near(loaded(&inner).center_px, [325.9, 226.7]));
    for (kind, rest, part) in [
        (
            "fisheye62",
            four,
            "OpenSfM's model 'fisheye62' is not supported",
        ),
        ("dual", r#""focal": 0.9"#, "'dual' is not supported"),
        ("brown", r#""focal_x": 0.9"#, "focal_y is missing"),
    ] {
        let said = message("a.json", &camera(kind, rest));
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn lengths_in_other_units_than_pixels_are_refused() {
    let letters = |f: [f64; 2], c: [f64; 2]| {
        format!(
            r#"{{"width": 640, "height": 480, "fx": {}, "fy": {}, "cx": {}, "cy": {}, "k1": 0.1}}"#,
            f[0], f[1], c[0], c[1]
        )
    };
    let matrix = |f: [f64; 2], c: [f64; 2]| {
        format!(
            r#"{{"width": 640, "height": 480, "K": [[{}, 0, {}], [0, {}, {}], [0, 0, 1]], "dist": []}}"#,
            f[0], c[0], f[1], c[1]
        )
    };
    for (f, c, part) in [
        ([0.9375, 1.25], [0.5, 0.5], "they look normalised"),
        ([0.9375, 0.9375], [0.001, -0.002], "they look normalised"),
        ([4.2, 4.2], [3.2, 2.4], "they look like millimetres"),
        ([60.0, 60.0], [320.0, 240.0], "they look like millimetres"),
        (
            [600.0, 600.0],
            [0.5, 0.5],
            "the principal point looks normalised",
        ),
    ] {
        for text in [letters(f, c), matrix(f, c)] {
            let said = message("a.json", &text);
            assert!(
                said.contains(part) && said.contains("must be in pixels of a picture of 640 x 480"),
                "{said}"
            );
        }
    }
    let wide = loaded(&letters([65.0, 65.0], [320.0, 240.0]));
    assert_eq!(wide.focal_px, DVec2::splat(65.0));
}

/// Of a camera for depth and one for colour the numbers beside the focal length are meant.
#[test]
fn the_size_is_that_beside_the_focal_length() {
    let color = r#""color": {"w": 1280, "h": 960, "fx": 1200, "fy": 1210, "cx": 640, "cy": 480}"#;
    let two = format!(r#"{{"depth": {{"width": 640, "height": 480, "cx": 1, "cy": 2}}, {color}}}"#);
    let found = loaded(&two);
    assert_eq!(found.size_px, [1280, 960]);
    assert_eq!(found.center_px, DVec2::new(640.0, 480.0));
    let sizeless = two.replace(r#""w": 1280, "h": 960, "#, "");
    let larger = sizeless.replace(r#"{"depth"#, r#"{"width": 1280, "height": 960, "depth"#);
    assert_eq!(loaded(&larger).size_px, [1280, 960]);
    let third = sizeless.replace(
        r#"{"depth"#,
        r#"{"a": {"width": 800, "height": 600}, "depth"#,
    );
    let said = message("a.json", &third);
    assert!(said.contains("neither beside the focal length"), "{said}");
}

#[test]
fn two_sizes_that_contradict_each_other_are_refused() {
    let letters = r#""fx": 600, "fy": 600, "cx": 320, "cy": 240"#;
    let matrix = r#""K": [600, 0, 320, 0, 600, 240, 0, 0, 1]"#;
    for camera in [letters, matrix] {
        let with = |pair: &str| {
            format!(
                r#"{{"width": 640, "height": 480, "image_size": {pair}, {camera}, "dist": []}}"#
            )
        };
        let said = message("a.json", &with("[1280, 960]"));
        assert!(said.contains("width and image_size contradict"), "{said}");
        assert_eq!(loaded(&with("[640, 480]")).size_px, [640, 480]);
        let short = format!(r#"{{"w": 640, "h": 480, {camera}}}"#);
        assert_eq!(loaded(&short).size_px, [640, 480]);
        let pair = format!(r#"{{"imageResolution": [640, 480], {camera}}}"#);
        assert_eq!(loaded(&pair).size_px, [640, 480]);
    }
}

/// MATLAB has rows before columns, in sizes and matrices, and counts pixels from 1.
#[test]
fn matlabs_conventions_are_followed() {
    let lens =
        r#""RadialDistortion": [0.08, -0.19, 0.05], "TangentialDistortion": [0.0008, -0.0005]"#;
    let old = format!(
        r#"{{{lens}, "ImageSize": [480, 640], "IntrinsicMatrix": [[615, 0, 0], [0, 613, 0], [322.4, 239.2, 1]],
        "EstimateSkew": false, "NumRadialDistortionCoefficients": 3}}"#
    );
    let new = format!(
        r#"{{"FocalLength": [615, 613], "PrincipalPoint": [322.4, 239.2], "ImageSize": [480, 640], {lens}, "Skew": 0,
        "K": [[615, 0, 322.4], [0, 613, 239.2], [0, 0, 1]]}}"#
    );
    for text in [&old, &new, &format!(r#"{{"cameraParams": {old}}}"#)] {
        let found = loaded(text);
        assert!(is_near(found.center_px, [321.4, 238.2]), "{found:?}");
        let center_px = lamp().center_px;
        assert_eq!(Intrinsics { center_px, ..found }, lamp());
    }
    let skew = new.replace(r#""Skew": 0"#, r#""Skew": 3"#);
    assert!(message("a.json", &skew).contains("Skew must be 0, not 3"));
    // Others' keys are near, and their conventions are not MATLAB's.
    let open3d = r#"{"width": 640, "height": 480, "intrinsic_matrix": [615, 0, 0, 0, 613, 0, 321.4, 238.2, 1],
        "radial_distortion": [0.08, -0.19, 0.05], "tangential_distortion": [0.0008, -0.0005]}"#;
    assert_eq!(loaded(open3d), lamp());
}

/// NeRF's `transforms.json` has COLMAP's numbers, which are from the picture's corner.
#[test]
fn nerfs_count_from_the_pictures_corner() {
    let lens = r#""camera_model": "OPENCV", "k1": 0.08, "k2": -0.19, "p1": 0.0008, "p2": -0.0005"#;
    let camera = r#""fl_x": 615, "fl_y": 613, "cx": 321.9, "cy": 238.7"#;
    let flat = format!(
        r#"{{{lens}, {camera}, "w": 640, "h": 480, "frames": [{{"file_path": "a.png"}}]}}"#
    );
    // Some have each frame's own.
    let frames = format!(
        r#"{{{lens}, "w": 640, "h": 480, "frames": [{{"file_path": "a.png", {camera}}}, {{"file_path": "b.png", {camera}}}]}}"#
    );
    for text in [flat, frames] {
        let found = loaded(&text);
        assert!(is_near(found.center_px, [321.4, 238.2]), "{found:?}");
        assert_eq!(found.focal_px, lamp().focal_px);
        assert_eq!(
            found.distortion,
            Distortion::Polynomial([0.08, -0.19, 0.0008, -0.0005, 0.0])
        );
    }
}

/// Programs whose cameras lie in lists, in pairs or under plain names.
#[test]
fn further_programs_cameras_are_found() {
    let five = "[0.08, -0.19, 0.0008, -0.0005, 0.05]";
    let matrix = "[[615, 0, 321.4], [0, 613, 238.2], [0, 0, 1]]";
    let anipose = format!(
        r#"{{"cam_0": {{"name": "cam_0", "size": [640, 480], "matrix": {matrix}, "distortions": {five}, "rotation": [0, 0, 0]}},
        "metadata": {{"error": 0.4}}}}"#
    );
    let depthai = format!(
        r#"{{"cameraData": [[2, {{"cameraType": 0, "distortionCoeff": {five}, "width": 640, "height": 480,
        "intrinsicMatrix": {matrix}}}]]}}"#
    );
    let basalt = r#"{"value0": {"T_imu_cam": [{"px": 0}], "resolution": [[640, 480]], "intrinsics": [{"camera_type":
        "pinhole-radtan8", "intrinsics": {"fx": 615, "fy": 613, "cx": 321.4, "cy": 238.2, "k1": 0.08, "k2": -0.19, "p1": 0.0008,
        "p2": -0.0005, "k3": 0.05, "k4": 0, "k5": 0, "k6": 0}}]}}"#;
    let mrcal = r#"{"lensmodel": "LENSMODEL_OPENCV5", "extrinsics": [0, 0, 0, 0, 0, 0], "imagersize": [640, 480],
        "intrinsics": [615, 613, 321.4, 238.2, 0.08, -0.19, 0.0008, -0.0005, 0.05]}"#;
    for text in [&anipose, &depthai, basalt, mrcal] {
        assert_eq!(loaded(text), lamp(), "{text}");
    }
    let kb4 = basalt.replace("pinhole-radtan8", "kb4");
    let kb4 = kb4
        .replace(r#""p1": 0.0008,"#, "")
        .replace(r#""p2": -0.0005,"#, "");
    let Distortion::Fisheye(four) = loaded(&kb4).distortion else {
        panic!("no fisheye");
    };
    assert_eq!(four, [0.08, -0.19, 0.05, 0.0]);
    for (text, part) in [
        (basalt.replace("pinhole-radtan8", "ds"), "the model 'ds'"),
        (
            anipose.replace("\"name\"", "\"fisheye\": true, \"name\""),
            "a fisheye has 4",
        ),
        (
            mrcal.replace("OPENCV5", "CAHVOR"),
            "'LENSMODEL_CAHVOR' is not supported",
        ),
    ] {
        let said = message("a.json", &text);
        assert!(said.contains(part), "{said}");
    }
    // What is no camera of anything known is said to be none, not a broken matrix.
    let sfm_data = r#"{"intrinsics": [{"key": 0, "value": {"ptr_wrapper": {"data": {"focal_length": 600}}}}]}"#;
    let said = message("a.json", sfm_data);
    assert!(said.contains("no camera is in it"), "{said}");
}

/// ROS's keys for cut pictures under other programs' spelling.
#[test]
fn binned_pictures_are_refused() {
    let matrix = r#""K": [600, 0, 320, 0, 600, 240, 0, 0, 1]"#;
    let text = format!(r#"{{"width": 640, "height": 480, {matrix}, "D": [], "binningX": 2}}"#);
    let said = message("a.json", &text);
    assert!(said.contains("binningX says"), "{said}");
}
