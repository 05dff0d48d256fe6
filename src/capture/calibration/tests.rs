//! Files of every kind, and broken ones.

use super::*;

const OWN: &str = "size_px = [640, 480]\nfocal_px = [615, 613.0]\ncenter_px = [321.4, 238.2]\ndistortion = [0.08, -0.19, 0.0008, -0.0005, 0.05]\n";

pub(super) fn load(name: &str, text: &str) -> Result<Intrinsics, CalibrationError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    load_calibration(&path)
}

pub(super) fn message(name: &str, text: &str) -> String {
    load(name, text).unwrap_err().to_string()
}

pub(super) fn lamp() -> Intrinsics {
    Intrinsics {
        size_px: [640, 480],
        focal_px: DVec2::new(615.0, 613.0),
        center_px: DVec2::new(321.4, 238.2),
        distortion: Distortion::Polynomial([0.08, -0.19, 0.0008, -0.0005, 0.05]),
    }
}

#[test]
fn every_format_gives_the_same_camera() {
    let own_json = r#"{"size_px": [640, 480], "focal_px": [615, 613], "center_px": [321.4, 238.2],
        "distortion": [0.08, -0.19, 0.0008, -0.0005, 0.05]}"#;
    let session = r#"{"about": "a table", "camera": {"size": [640, 480], "fps": 30,
        "K": {"fx": 615.0, "fy": 613.0, "cx": 321.4, "cy": 238.2}, "dist": [0.08, -0.19, 0.0008, -0.0005, 0.05]}}"#;
    let opencv_yaml = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   \
        cols: 3\n   dt: d\n   data: [ 615., 0., 3.214e+02, 0., 613.,\n       238.2, 0., 0., 1. ]\n\
        distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   \
        data: [ 0.08, -0.19, 0.0008, -0.0005, 0.05 ]\n";
    let opencv_json = r#"{"image_width": 640, "image_height": 480,
        "Camera_Matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
            "data": [615.0, 0.0, 321.4, 0.0, 613.0, 238.2, 0.0, 0.0, 1.0]},
        "Distortion_Coefficients": {"type_id": "opencv-matrix", "rows": 1, "cols": 8, "dt": "d",
            "data": [0.08, -0.19, 0.0008, -0.0005, 0.05, 0.0, 0.0, 0.0]}}"#;
    let opencv_xml = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>640</image_width>\n\
        <image_height>480</image_height>\n<K type_id=\"opencv-matrix\">\n<rows>3</rows><cols>3</cols><dt>d</dt>\
        <data>615. 0. 321.4 0. 613. 238.2 0. 0. 1.</data></K>\n<distCoeffs type_id=\"opencv-matrix\">\
        <rows>1</rows><cols>5</cols><dt>d</dt><data>0.08 -0.19 0.0008 -0.0005 0.05</data></distCoeffs>\n\
        </opencv_storage>\n";
    let ros = "image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [615, 0, 321.4, 0, 613, 238.2, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  \
        rows: 1\n  cols: 5\n  data: [0.08, -0.19, 0.0008, -0.0005, 0.05]\nprojection_matrix:\n  rows: 3\n  cols: 4\n  \
        data: [615, 0, 321.4, 0, 0, 613, 238.2, 0, 0, 0, 1, 0]\n";
    for (name, text) in [
        ("a.toml", OWN),
        ("a.json", own_json),
        ("session.json", session),
        ("a.yml", opencv_yaml),
        ("b.json", opencv_json),
        ("a.xml", opencv_xml),
        ("ros.yaml", ros),
    ] {
        let found = load(name, text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(found, lamp(), "{name}");
    }
}

#[test]
fn missing_coefficients_are_zero_and_further_ones_another_model() {
    let four = OWN.replace(", 0.05]", "]");
    assert_eq!(
        load("a.toml", &four).unwrap().distortion,
        Distortion::Polynomial([0.08, -0.19, 0.0008, -0.0005, 0.0])
    );
    let eight = OWN.replace("0.05]", "0.05, 0, 0.3, 0]");
    let mut expected = [0.0; 14];
    expected[..7].copy_from_slice(&[0.08, -0.19, 0.0008, -0.0005, 0.05, 0.0, 0.3]);
    let found = load("a.toml", &eight).unwrap().distortion;
    assert_eq!(found, Distortion::Rational(expected));
    let fifteen = OWN.replace("0.05]", "0.05, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]");
    assert!(message("a.toml", &fifteen).contains("15 coefficients"));
}

#[test]
fn what_no_camera_has_is_refused() {
    for (from, to, expected) in [
        ("615", "0", "greater than 0"),
        ("615", "-615", "greater than 0"),
        ("615", "nan", "finite"),
        ("321.4", "inf", "finite"),
        ("321.4", "3214", "far from"),
        ("640", "0", "whole numbers"),
        ("640", "640.5", "whole numbers"),
        (
            "[615, 613.0]",
            "[615]",
            "focal_px must be two finite numbers",
        ),
        ("focal_px", "focal", "unknown key 'focal'"),
        (
            "focal_px = [615, 613.0]\n",
            "",
            "focal_px = [x, y] is missing",
        ),
        (
            "size_px = [640, 480]\n",
            "",
            "does not say for which picture size",
        ),
        ("center_px = [", "center_px = ", "line 3"),
    ] {
        let text = message("a.toml", &OWN.replace(from, to));
        assert!(
            text.contains(expected) && text.contains("a.toml"),
            "{from} → {to}: {text}"
        );
    }
}

/// Photographs' calibrations from OpenCV's tutorials.
#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/real")]
fn opencvs_tutorial_calibrations_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/real/opencv_tutorial");
    let (charuco, params) = (
        folder.join("tutorial_camera_charuco.yml"),
        folder.join("tutorial_camera_params.yml"),
    );
    let found = load_calibration(&charuco).unwrap();
    assert_eq!(found.size_px, [640, 480]);
    assert_eq!(
        (found.focal_px.x, found.distortion.coefficients()[4]),
        (452.510_722_196_376_7, 2.954_258_940_681_008)
    );
    assert!(matches!(
        load_calibration(&params),
        Err(CalibrationError::NoSize { .. })
    ));
    assert_eq!(
        load_calibration_for(&params, [640, 480], "it")
            .unwrap()
            .center_px
            .y,
        260.908
    );
}

/// Examples of OpenCV's write matrix and coefficients alone.
#[test]
fn without_a_size_the_frames_have_it_where_the_principal_point_is_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let among = |text: &str, frame_px| {
        let path = folder.path().join("a.toml");
        std::fs::write(&path, text).unwrap();
        load_calibration_among(&path, frame_px).map_err(|error| error.to_string())
    };
    let sizeless = OWN.replace("size_px = [640, 480]\n", "");
    assert_eq!(among(OWN, [640, 480]), Ok((lamp(), vec![])));
    assert_eq!(
        among(&sizeless, [640, 480]),
        Ok((lamp(), vec![Assumed::Size]))
    );
    for other_px in [[1280, 720], [320, 240], [640, 360], [800, 600]] {
        let message = among(&sizeless, other_px).unwrap_err();
        let [width, height] = other_px;
        let expected = format!("principal point at (321, 238) that is hardly {width} x {height}");
        assert!(message.contains(&expected), "{message}");
    }
}

#[test]
fn what_is_written_is_read_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.toml");
    let camera = Intrinsics {
        size_px: [1280, 720],
        focal_px: DVec2::new(2701.1 / 3.0, 901.0),
        center_px: DVec2::new(639.5, -1e-12),
        distortion: Distortion::Polynomial([0.1 + 0.2, -0.19, 1.0 / 3e9, 0.0, 5e-324]),
    };
    std::fs::write(&path, calibration_text(&camera)).unwrap();
    assert_eq!(load_calibration(&path).unwrap(), camera);
}

const ROS: &str = "image_width: 640\nimage_height: 480\nK: [615, 0, 321.4, 0, 613, 238.2, 0, 0, 1]\n\
    D: [0.08, -0.19, 0.0008, -0.0005, 0.05]\n";

/// The files of `../shared/cases/calibration`.
#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/cases")]
fn files_of_other_programs_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases/calibration");
    let load = |name: &str| load_calibration(&folder.join(name)).unwrap();
    for name in [
        "pyyaml_block.yaml",
        "ros1_echo.yaml",
        "ros2_echo.yaml",
        "ros_bom.yaml",
    ] {
        assert_eq!(load(name), lamp(), "{name}");
    }
    let kalibr = load("camchain.yaml");
    assert_eq!(kalibr.size_px, [752, 480]);
    assert_eq!(kalibr.center_px, DVec2::new(367.215, 248.375));
    assert_eq!(
        kalibr.distortion,
        Distortion::Polynomial([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0])
    );
    let photonvision = load("photonvision.json");
    assert_eq!(photonvision.size_px, [1600, 1200]);
    assert_eq!(photonvision.focal_px.x, 894.6473376999364);
    assert_eq!(
        photonvision.distortion.coefficients()[4],
        0.14767766830679485
    );
    let fisheye = load("cv_tutorial_fisheye.yml");
    assert_eq!(
        fisheye.distortion,
        Distortion::Fisheye([-1.3e-2, 2.1e-2, -1.9e-2, 5e-3])
    );
}

#[test]
fn the_model_is_obeyed_or_refused() {
    let with = |line: &str| load("a.yaml", &format!("{ROS}{line}"));
    let four = ROS.replace(", 0.05]", "]");
    let fisheye = Distortion::Fisheye([0.08, -0.19, 0.0008, -0.0005]);
    for line in [
        "distortion_model: equidistant",
        "distortion_model: fisheye",
        "Distortion_Model: EQUIDISTANT",
        "fisheye_model: 1",
        "fisheye_model: true",
    ] {
        let found = load("a.yaml", &format!("{four}{line}\n"));
        assert_eq!(found.unwrap().distortion, fisheye, "{line}");
    }
    for line in [
        "",
        "fisheye_model: 0",
        "distortion_model: plumb_bob",
        "distortion_model: ''",
    ] {
        assert_eq!(with(line).unwrap(), lamp(), "{line}");
    }
    for (line, expected) in [
        (
            "distortion_model: weird",
            "the model 'weird' is not supported",
        ),
        ("distortion_model: [1]", "must be a name"),
        ("distortion_model: 3", "must be a name"),
        ("fisheye_model: 2", "fisheye_model must be 0 or 1, not 2"),
        ("fisheye_model: maybe", "fisheye_model must be 0 or 1"),
        ("fisheye_model: 1", "a fisheye has 4 coefficients"),
        ("xi: 1.2", "omnidirectional"),
        ("camera_model: omni", "the model 'omni' is not supported"),
        (
            "fisheye_model: 1\ndistortion_model: plumb_bob",
            "contradicts",
        ),
        ("binning_x: 2", "binning_x"),
        ("roi: {x_offset: 16, y_offset: 0}", "roi"),
    ] {
        let text = with(line).unwrap_err().to_string();
        assert!(text.contains(expected), "{line}: {text}");
    }
}

#[test]
fn colmaps_cameras_are_read() {
    let head = "# Camera list with one line of data per camera:\r\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\r\n";
    let load_one = |line: &str| load("cameras.txt", &format!("{head}{line}\r\n"));
    let found = load_one("1 OPENCV 640 480 615 613 321.9 238.7 0.08 -0.19 0.0008 -0.0005").unwrap();
    assert!(found.center_px.distance(lamp().center_px) < 1e-12);
    assert_eq!(found.focal_px, lamp().focal_px);
    let polynomial = |k1, k2| Distortion::Polynomial([k1, k2, 0.0, 0.0, 0.0]);
    for (line, expected) in [
        ("SIMPLE_PINHOLE 640 480 615 320 240", Distortion::NONE),
        ("PINHOLE 640 480 615 613 320 240", Distortion::NONE),
        (
            "SIMPLE_RADIAL 640 480 615 320 240 0.1",
            polynomial(0.1, 0.0),
        ),
        ("RADIAL 640 480 615 320 240 0.1 0.2", polynomial(0.1, 0.2)),
        (
            "OPENCV_FISHEYE 640 480 285 285 320 240 1e-2 0.2 0.3 0.4",
            Distortion::Fisheye([0.01, 0.2, 0.3, 0.4]),
        ),
        (
            "FULL_OPENCV 640 480 615 613 320 240 1 2 3 4 5 6 7 8",
            Distortion::Rational([
                1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
            ]),
        ),
    ] {
        assert_eq!(
            load_one(&format!("7 {line}")).unwrap().distortion,
            expected,
            "{line}"
        );
    }
    for (line, expected) in [
        (
            "1 FOV 640 480 1 1 1 1 1",
            "line 3: the camera model 'FOV' is not supported",
        ),
        (
            "1 PINHOLE 640 480 615 613 320",
            "PINHOLE has fx, fy, cx, cy, not 3 numbers",
        ),
        ("1 PINHOLE 640", "CAMERA_ID MODEL WIDTH HEIGHT"),
        (
            "500 500 320 240 0.01 -0.1 0 0",
            "as size_px, focal_px, center_px and distortion",
        ),
        ("1 PINHOLE 640 480 615 613 320 x", "'x' is no number"),
        ("", "there is no camera in it"),
    ] {
        let text = load_one(line).unwrap_err().to_string();
        assert!(text.contains(expected), "{line}: {text}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.txt");
    let two = "1 PINHOLE 640 480 615 613 320 240\n2 PINHOLE 1280 720 900 900 640 360\n";
    std::fs::write(&path, two).unwrap();
    let found = load_calibration_for(&path, [1280, 720], "it").unwrap();
    assert_eq!(found.focal_px.x, 900.0);
    assert!(
        load_calibration(&path)
            .unwrap_err()
            .to_string()
            .contains("2 cameras (1, 2)")
    );
}

#[test]
fn kalibrs_and_calib_ios_models_are_read() {
    let chain = "cam0:\n  camera_model: pinhole\n  distortion_model: equidistant\n  \
        distortion_coeffs: [0.1, 0.2, 0.3, 0.4]\n  intrinsics: [458, 457, 367, 248]\n  resolution: [752, 480]\n  \
        T_cam_imu:\n  - [1, 0, 0, 0]\n";
    let found = load("camchain.yaml", chain).unwrap();
    assert_eq!(found.distortion, Distortion::Fisheye([0.1, 0.2, 0.3, 0.4]));
    let omni = chain.replace("camera_model: pinhole", "camera_model: omni");
    let text = message("camchain.yaml", &omni);
    assert!(
        text.contains("cam0: camera_model: the model 'omni' is not supported"),
        "{text}"
    );
    let calib_io = r#"{"Calibration": {"cameras": [{"model": {"polymorphic_name": "libCalib::CameraModelOpenCV",
        "ptr_wrapper": {"valid": 1, "data": {"parameters": {"f": {"val": 1000.0, "state": 2}, "ar": {"val": 1.01},
        "cx": {"val": 640.5}, "cy": {"val": 360.5}, "k1": {"val": 0.1}, "k4": {"val": 0.2}, "tauX": {"val": 0.01}},
        "CameraModelCRT": {"CameraModelBase": {"imageSize": {"width": 1280, "height": 720}}}}}}}]}}"#;
    let found = load("calib.json", calib_io).unwrap();
    assert_eq!(
        (found.size_px, found.focal_px),
        ([1280, 720], DVec2::new(1000.0, 1010.0))
    );
    let mut expected = [0.0; 14];
    (expected[0], expected[5], expected[12]) = (0.1, 0.2, 0.01);
    assert_eq!(found.distortion, Distortion::Rational(expected));
    let other = calib_io.replace("ModelOpenCV", "ModelDoubleSphere");
    assert!(message("calib.json", &other).contains("CameraModelDoubleSphere' is not supported"));
}

/// What crashed OpenCV's reader, and what asks for more memory than there is.
#[test]
fn hostile_files_are_refused() {
    let deep = |open: &str| open.repeat(50_000);
    let mut laughs = "a0: &a0 [1, 1]\n".to_owned();
    for k in 1..40 {
        laughs += &format!("a{k}: &a{k} [*a{}, *a{}]\n", k - 1, k - 1);
    }
    for (name, text) in [
        ("a.yaml", format!("K: {}", deep("["))),
        ("a.yaml", format!("K: {}", deep("{a: "))),
        ("a.yaml", deep("- ")),
        ("a.yaml", laughs),
        ("a.yaml", String::new()),
        ("a.yaml", "K: [1, 2".to_owned()),
        ("a.yaml", "K: 1\nK: 2\n".to_owned()),
        ("a.yaml", "camera_matrix: [1, 2\n\tx: }".to_owned()),
        (
            "a.xml",
            "<?xml version=\"1.0\"?><opencv_storage><camera".to_owned(),
        ),
        ("a.xml", deep("<a>")),
        (
            "a.xml",
            "<!DOCTYPE a [<!ENTITY b \"c\">]><a>&b;</a>".to_owned(),
        ),
        ("a.json", deep("[")),
        ("a.toml", format!("a = {}", deep("["))),
    ] {
        let text = message(name, &text);
        assert!(text.contains(name) && text.len() < 1000, "{text}");
    }
    assert!(message("a.json", "{").contains("line 1 column"));
    assert!(
        message("a.yaml", "K: 1\nK: 2\n").contains("line 2 column 1: the key 'K' is there twice")
    );
    assert!(message("a.bin", OWN).contains("a calibration is a .toml"));
}

#[test]
fn every_lens_is_written_and_read_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.toml");
    for distortion in [
        Distortion::Rational(std::array::from_fn(|k| 0.1 / (k + 1) as f64)),
        Distortion::Fisheye([0.1, -0.2, 1.0 / 3.0, 0.0]),
        Distortion::NONE,
    ] {
        let camera = Intrinsics {
            distortion,
            ..lamp()
        };
        std::fs::write(&path, calibration_text(&camera)).unwrap();
        assert_eq!(load_calibration(&path).unwrap(), camera);
    }
}

#[test]
fn the_frames_size_must_be_the_calibrations() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.toml");
    std::fs::write(&path, OWN).unwrap();
    assert_eq!(
        load_calibration_for(&path, [640, 480], "lamp").unwrap(),
        lamp()
    );
    let text = load_calibration_for(&path, [1280, 720], "lamp")
        .unwrap_err()
        .to_string();
    assert!(
        text.starts_with(
            "lamp has frames of 1280 x 720 pixels, but its calibration is for 640 x 480"
        ),
        "{text}"
    );
    std::fs::write(&path, OWN.replace("size_px = [640, 480]\n", "")).unwrap();
    assert_eq!(
        load_calibration_for(&path, [1280, 720], "lamp")
            .unwrap()
            .size_px,
        [1280, 720]
    );
}

/// The same camera, four coefficients, as programs that nobody here uses write it.
#[test]
fn other_programs_write_the_same_camera() {
    let euroc = "sensor_type: camera\nrate_hz: 20\nresolution: [640, 480]\ncamera_model: pinhole\n\
        intrinsics: [615.0, 613.0, 321.4, 238.2] #fu, fv, cu, cv\ndistortion_model: radial-tangential\n\
        distortion_coefficients: [0.08, -0.19, 0.0008, -0.0005]\n";
    let orb_slam = "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 615.0\nCamera.fy: 613.0\nCamera.cx: 321.4\n\
        Camera.cy: 238.2\nCamera.k1: 0.08\nCamera.k2: -0.19\nCamera.p1: 0.0008\nCamera.p2: -0.0005\n\
        Camera.width: 640\nCamera.height: 480\nCamera.fps: 30.0\n";
    let vins = "%YAML:1.0\n---\nmodel_type: PINHOLE\nimage_width: 640\nimage_height: 480\ndistortion_parameters:\n   \
        k1: 0.08\n   k2: -0.19\n   p1: 0.0008\n   p2: -0.0005\nprojection_parameters:\n   fx: 615.0\n   fy: 613.0\n   \
        cx: 321.4\n   cy: 238.2\n";
    let realsense = r#"{"width": 640, "height": 480, "fx": 615, "fy": 613, "ppx": 321.4, "ppy": 238.2,
        "model": "Brown Conrady", "coeffs": [0.08, -0.19, 0.0008, -0.0005, 0]}"#;
    let quoted = "image_width: \"640\"\nimage_height: '480'\ncamera_matrix: &k [['615', 0, 321.4], [0, 613, 238.2], [0, 0, 1]]\n\
        dist_coeff: [[0.08, -0.19, 0.0008, -0.0005]]\nagain: *k\n";
    let nested = r#"{"image_width": 640, "image_height": 480, "calibration": {"left": {"mtx":
        [[615, 0, 321.4], [0, 613, 238.2], [0, 0, 1]], "dist": [[0.08, -0.19, 0.0008, -0.0005]]}}}"#;
    let columns = r#"{"width": 640, "height": 480, "intrinsic_matrix": [615, 0, 0, 0, 613, 0, 321.4, 238.2, 1],
        "distortion": [0.08, -0.19, 0.0008, -0.0005]}"#;
    let size_matrix = "%YAML:1.0\n---\nintrinsic: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 615., 0., 321.4, \
        0., 613., 238.2, 0., 0., 1. ]\ndistCoeffs: !!opencv-matrix\n   rows: 1\n   cols: 4\n   dt: d\n   data: [ 0.08, -0.19, \
        0.0008, -0.0005 ]\nimageSize: !!opencv-matrix\n   rows: 2\n   cols: 1\n   dt: d\n   data: [ 640., 480. ]\n";
    let ost = "# oST version 5.0 parameters\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n[narrow_stereo]\n\ncamera matrix\n\
        615.0 0.0 321.4\n0.0 613.0 238.2\n0.0 0.0 1.0\n\ndistortion\n0.08 -0.19 0.0008 -0.0005 0.0\n\nrectification\n\
        1 0 0\n0 1 0\n0 0 1\n\nprojection\n615 0 321 0\n0 613 238 0\n0 0 1 0\n";
    let mut expected = lamp();
    expected.distortion = Distortion::Polynomial([0.08, -0.19, 0.0008, -0.0005, 0.0]);
    for (name, text) in [
        ("sensor.yaml", euroc),
        ("orb.yaml", orb_slam),
        ("vins.yaml", vins),
        ("realsense.json", realsense),
        ("quoted.yaml", quoted),
        ("nested.json", nested),
        ("open3d.json", columns),
        ("size.yml", size_matrix),
        ("ost.txt", ost),
        ("no_extension", euroc),
    ] {
        let found = load(name, text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(found, expected, "{name}");
    }
    // No UTF-8 (Latin-1), and UTF-16 as Windows' editors save it.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.yaml");
    let latin1 = [b"# Kamera f\xfcr innen\n", euroc.as_bytes()].concat();
    let utf16 = "\u{feff}".encode_utf16().chain(euroc.encode_utf16());
    for bytes in [latin1, utf16.flat_map(u16::to_le_bytes).collect()] {
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(load_calibration(&path).unwrap(), expected);
    }
}

#[test]
fn what_only_looks_like_a_camera_is_refused_by_name() {
    let inverse = r#"{"width": 640, "height": 480, "fx": 615, "fy": 613, "ppx": 321.4, "ppy": 238.2,
        "model": "Inverse Brown Conrady", "coeffs": [0.08, -0.19, 0, 0, 0]}"#;
    for (name, text, part) in [
        ("a.json", inverse, "Inverse Brown Conrady"),
        (
            "a.yaml",
            "Camera1.fx: 1\nCamera2.fx: 1\nCamera1.fy: 1\n",
            "several fx",
        ),
        (
            "a.yaml",
            "fx: 1\nfy: x\ncx: 1\ncy: 1\n",
            "fy must be a finite number",
        ),
        (
            "a.yaml",
            "model_type: MEI\nfx: 1\nfy: 1\ncx: 1\ncy: 1\n",
            "'MEI' is not supported",
        ),
        (
            "a.yaml",
            "camera_matrix: [.nan, 0, 0, 0, 1, 0, 0, 0, 1]\n",
            "3 x 3 finite numbers",
        ),
        ("a.yaml", "other: 1\n", "this file has other"),
        ("a.npz", "PK\u{3}\u{4}", "a.npz: "),
        ("a.zip", "PK\u{3}\u{4}", "an archive"),
        (
            "a.txt",
            "700 0 320\n0 700 240\n0 0 2\n",
            "of text files COLMAP's cameras.txt",
        ),
        ("a.txt", "R: 1 0 0 0 1 0 0 0 1\n", "of text files"),
        ("a.npy", "NUMPY\0", "a calibration is a .toml"),
        ("a.yaml", "<!DOCTYPE html><html>", "a page of the web"),
    ] {
        let said = message(name, text);
        assert!(said.contains(part), "{text}: {said}");
    }
    let without = inverse.replace("0.08, -0.19", "0, 0");
    assert_eq!(
        load("a.json", &without).unwrap().distortion,
        Distortion::NONE
    );
}

/// Of two cameras of different sizes frames of a known size tell which is meant.
#[test]
fn the_frames_tell_the_camera() {
    let camera = |name: &str, f: u32, size: &str| {
        format!(
            "{name}:\n  camera_model: pinhole\n  intrinsics: [{f}, {f}, 300, 200]\n  distortion_model: none\n  \
             distortion_coeffs: []\n  resolution: {size}\n"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camchain.yaml");
    let two = camera("cam0", 600, "[640, 480]") + &camera("cam1", 900, "[1280, 720]");
    std::fs::write(&path, two).unwrap();
    for (size_px, focal) in [([640, 480], 600.0), ([1280, 720], 900.0)] {
        assert_eq!(
            load_calibration_among(&path, size_px).unwrap().0.focal_px.x,
            focal
        );
    }
    let none = load_calibration_among(&path, [320, 240])
        .unwrap_err()
        .to_string();
    assert!(none.contains("2 cameras (cam0, cam1)"), "{none}");
}

/// The same camera with its coefficients under other names, in other tables and as text.
#[test]
fn coefficients_are_read_under_any_of_their_names() {
    let letters = "image_width: 640\nimage_height: 480\nfx: 615\nfy: 613\ncx: 321.4\ncy: 238.2\n";
    let matrix =
        "image_width: 640\nimage_height: 480\nmtx: [[615, 0, 321.4], [0, 613, 238.2], [0, 0, 1]]\n";
    let list = "[0.08, -0.19, 0.0008, -0.0005, 0.05]";
    for camera in [letters, matrix] {
        for lens in [
            format!("distortion_coefficients: {list}\n"),
            format!("dist_coeff: {{rows: 1, cols: 5, data: {list}}}\n"),
            "dist: \"0.08 -0.19 0.0008 -0.0005 0.05\"\n".to_owned(),
            format!("dist: \"{list}\"\n"),
            "radial_distortion: [0.08, -0.19, 0.05]\ntangential-distortion: [0.0008, -0.0005]\n"
                .to_owned(),
            "Radial: [0.08, -0.19, 0.05]\nTangential: [0.0008, -0.0005]\n".to_owned(),
            "k1: 0.08\nk2: -0.19\np1: 0.0008\np2: -0.0005\nk3: 0.05\n".to_owned(),
            "distortion: {k1: 0.08, k2: -0.19, p1: 0.0008, p2: -0.0005, k3: 0.05}\n".to_owned(),
            format!("distortion_parameters: {list}\n"),
            format!("dist_coefs: [{list}]\n"),
            format!("distortionVector: {list}\n"),
            format!("distortions: {list}\n"),
        ] {
            let found = load("a.yaml", &format!("{camera}{lens}"));
            assert_eq!(found.unwrap(), lamp(), "{camera}{lens}");
        }
    }
    let photonvision = r#"{"resolution": {"width": 640, "height": 480}, "lensmodel": "LENSMODEL_OPENCV",
        "cameraIntrinsics": {"rows": 3, "cols": 3, "type": 6, "data": [615, 0, 321.4, 0, 613, 238.2, 0, 0, 1]},
        "cameraExtrinsics": {"rows": 1, "cols": 5, "type": 6, "data": [0.08, -0.19, 0.0008, -0.0005, 0.05]}}"#;
    assert_eq!(load("a.json", photonvision).unwrap(), lamp());
}

/// Coefficients that are not read are never taken for none without a word.
#[test]
fn a_lens_that_is_not_understood_is_refused_by_name() {
    let matrix =
        "image_width: 640\nimage_height: 480\nK: [615, 0, 321.4, 0, 613, 238.2, 0, 0, 1]\n";
    for (lens, part) in [
        (
            "distortion_coeficients: [0.1, 0, 0, 0]\n",
            "distortion_coeficients is not understood; allowed: distortion_coefficients,",
        ),
        ("distortion_model: plumb_bob\n", "coefficients are missing"),
        (
            "distortion_model: plumb_bob\ndistortion_coefficients:\n",
            "distortion_coefficients is empty",
        ),
        (
            "distortion_coefficients:\n",
            "distortion_coefficients is empty",
        ),
        (
            "D: {rows: 1, cols: 5, data: [0.1, 0, 0]}\n",
            "1 x 5 numbers",
        ),
        (
            "D: [0.1, 0, 0]\n",
            "3 coefficients; 4, 5, 8, 12 or 14 are supported",
        ),
        (
            "distortion_model: rational_polynomial\nD: [0.1, 0, 0, 0, 0, 1]\n",
            "6 coefficients; 4, 5, 8, 12 or 14 are supported",
        ),
        ("distortion: strong\n", "distortion must be a list"),
        ("radial: [1, 2, 3, 4]\n", "at most 3 numbers"),
    ] {
        let said = message("a.yaml", &format!("{matrix}{lens}"));
        assert!(said.contains(part), "{lens}: {said}");
    }
    // What has none is said to have none.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.yaml");
    for (lens, assumed) in [
        ("", vec![Assumed::NoDistortion]),
        ("min_distance: 3\n", vec![Assumed::NoDistortion]),
        ("undistorted: true\n", vec![Assumed::NoDistortion]),
        ("D: []\n", vec![]),
        ("distortion_model: none\nD: [0, 0, 0]\n", vec![]),
    ] {
        std::fs::write(&path, format!("{matrix}{lens}")).unwrap();
        let (found, said) = load_calibration_among(&path, [640, 480]).unwrap();
        assert_eq!(
            (found.distortion, said),
            (Distortion::NONE, assumed),
            "{lens}"
        );
    }
}

/// Whatever key names a model, and in which table about the camera, it is followed or refused.
#[test]
fn the_model_is_found_under_any_of_its_names() {
    let camera = r#""image_width": 640, "image_height": 480, "camera_matrix": [[615, 0, 321.4], [0, 613, 238.2], [0, 0, 1]],
        "dist": [0.08, -0.19, 0.0008, -0.0005]"#;
    let letters = r#""w": 640, "h": 480, "fx": 615, "fy": 613, "cx": 321.4, "cy": 238.2, "dist": [0.08, -0.19, 0.0008, -0.0005]"#;
    let fisheye = Distortion::Fisheye([0.08, -0.19, 0.0008, -0.0005]);
    for camera in [camera, letters] {
        for text in [
            format!(r#"{{{camera}, "lens_model": "fisheye"}}"#),
            format!(r#"{{{camera}, "projection_model": "KANNALA_BRANDT"}}"#),
            format!(r#"{{"model": "fisheye", "cam": {{{camera}}}}}"#),
            format!(r#"{{"cam": {{{camera}, "model": "fisheye"}}}}"#),
            format!(r#"{{"fisheye": true, "about": 3, "cams": [{{{camera}}}]}}"#),
        ] {
            let found = load("a.json", &text).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!(found.distortion, fisheye, "{text}");
        }
        for key in ["lensmodel", "projection_model", "distortion_type"] {
            let said = message(
                "a.json",
                &format!(r#"{{{camera}, "{key}": "LENSMODEL_STEREOGRAPHIC"}}"#),
            );
            let part = format!("{key}: the model 'LENSMODEL_STEREOGRAPHIC' is not supported");
            assert!(said.contains(&part), "{said}");
        }
    }
    // What another table calls a model is none of the lens.
    let device = format!(r#"{{{letters}, "device": {{"model": "D435", "type": "usb"}}}}"#);
    assert!(matches!(
        load("a.json", &device).unwrap().distortion,
        Distortion::Polynomial(_)
    ));
}

/// calib.io's library names a kind of camera once and numbers it from then on.
#[test]
fn calib_ios_second_camera_is_of_the_first_ones_kind() {
    let camera = |kind: &str, f: u32, width: u32| {
        format!(
            r#"{{"model": {{{kind}, "ptr_wrapper": {{"id": 1, "data": {{"parameters": {{"f": {{"val": {f}}},
            "cx": {{"val": 320}}, "cy": {{"val": 240}}, "k1": {{"val": 0.1}}}}, "CameraModelCRT": {{"CameraModelBase":
            {{"imageSize": {{"width": {width}, "height": 480}}}}}}}}}}}}}}"#
        )
    };
    let first =
        r#""polymorphic_id": 2147483649, "polymorphic_name": "libCalib::CameraModelOpenCV""#;
    let two = |second: &str| {
        let cameras = [camera(first, 600, 640), camera(second, 700, 800)].join(", ");
        format!(r#"{{"Calibration": {{"cameras": [{cameras}]}}}}"#)
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.json");
    std::fs::write(&path, two(r#""polymorphic_id": 1"#)).unwrap();
    for (size_px, focal) in [([640, 480], 600.0), ([800, 480], 700.0)] {
        let found = load_calibration_among(&path, size_px).unwrap().0;
        assert_eq!(found.focal_px.x, focal);
    }
    let said = message("a.json", &two(r#""polymorphic_id": 2"#));
    assert!(said.contains("'none' is not supported"), "{said}");
}

/// A comment parts no matrix, and of two matrices under one name none is taken.
#[test]
fn comments_and_keys_that_are_there_twice() {
    let matrix = |f: u32, data: &str| {
        format!(
            "<K><rows>3</rows><cols>3</cols><data>{data}{f} 0 320 0 {f}<!-- fy --> 240 0 0 1</data></K>"
        )
    };
    let file = |matrices: &str| {
        format!(
            "<opencv_storage><image_width>640</image_width><image_height>480</image_height>{matrices}</opencv_storage>"
        )
    };
    let found = load("a.xml", &file(&matrix(600, "<!-- fx -->\n"))).unwrap();
    assert_eq!(found.focal_px, DVec2::splat(600.0));
    let json =
        r#"{"width": 640, "K": [600, 0, 320, 0, 600, 240, 0, 0, 1], "in": {"K": 1, "K": 2}}"#;
    for (name, text) in [
        ("a.xml", file(&(matrix(600, "") + &matrix(700, "")))),
        ("a.json", json.to_owned()),
        ("a.yaml", "K: 1\nK: 2\n".to_owned()),
    ] {
        let said = message(name, &text);
        assert!(said.contains("the key 'K' is there twice"), "{said}");
    }
}
