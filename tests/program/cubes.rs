//! A cube of markers from its pictures to the composite: its layout learnt, the cube tracked and drawn upon, the scene checked
//! and recorded.

use std::f64::consts::PI;
use std::path::Path;

use assert_cmd::Command;
use glam::{DAffine3, DQuat, DVec3};
use gnomon::app::truth::sheets::{Light, cube, with_noise};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::geometry::pose::{pose_from_rodrigues, rotation_between};
use gnomon::scene::Scene;

const CAMERA: Intrinsics = Intrinsics {
    size_px: [640, 480],
    focal_px: glam::DVec2::new(615.0, 615.0),
    center_px: glam::DVec2::new(319.5, 239.5),
    distortion: Distortion::NONE,
};

const CALIBRATION: &str = "size_px = [640, 480]\nfocal_px = [615.0, 615.0]\ncenter_px = [319.5, 239.5]\n\
                           distortion = [0, 0, 0, 0, 0]\n";

/// The cube as apriltag_ros describes it: its edge is 0.08 m, its markers' sides half of that.
const TAGS: &str = "tag_bundles:
  - name: cube
    layout:
      - {id: 0, size: 0.04, z: 0.04}
      - {id: 1, size: 0.04, y: -0.04, qw: 0.70710678, qx: 0.70710678}
      - {id: 2, size: 0.04, x: 0.04, qw: 0.70710678, qy: 0.70710678}
      - {id: 3, size: 0.04, y: 0.04, qw: 0.70710678, qx: -0.70710678}
      - {id: 4, size: 0.04, x: -0.04, qw: 0.70710678, qy: -0.70710678}
      - {id: 5, size: 0.04, z: -0.04, qw: 0, qx: 1}
";

const SCENE: &str = "[camera]
source = \"frames\"
calibration = \"camera.toml\"

[[board]]
name = \"cube\"
bundle = \"tags.yaml\"

[[phantom]]
name = \"cardboard\"
box_m = [-0.04, -0.04, -0.04, 0.04, 0.04, 0.04]
material = { albedo = 0.8 }

[[virtual]]
name = \"ball\"
sphere_m = 0.02
position_m = [0, 0, 0.06]
material = { albedo = [0.8, 0.2, 0.1] }

[[light]]
kind = \"point\"
position_m = [0.3, -0.3, 0.5]
intensity = [0.3, 0.3, 0.3]

[ambient]
radiance = [0.1, 0.1, 0.1]
";

/// A hand turns it: half a turn in two dozen pictures, about an axis that turns itself.
fn pose(frame: u32) -> DAffine3 {
    let share = f64::from(frame) / 24.0;
    DAffine3::from_rotation_translation(
        DQuat::from_rotation_x(2.0 + 1.2 * share) * DQuat::from_rotation_y(PI * share),
        DVec3::new(0.04 * share - 0.02, 0.01, 0.4),
    )
}

fn project(frames: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("frames")).expect("a folder");
    for k in 0..frames {
        let light = Light::of_boards(&CAMERA, &[(&cube(), pose(k))]);
        let frame = with_noise(&light.frame(0.0), 1.5, u64::from(k));
        let [width, height] = frame.size_px;
        let picture = image::RgbaImage::from_raw(width, height, frame.rgba).expect("a picture");
        let path = at("frames").join(format!("{k:03}.png"));
        image::DynamicImage::from(picture)
            .to_rgb8()
            .save(path)
            .expect("a file");
    }
    for (name, text) in [
        ("camera.toml", CALIBRATION),
        ("tags.yaml", TAGS),
        ("scene.toml", SCENE),
    ] {
        std::fs::write(at(name), text).expect("a file");
    }
    folder
}

/// What a run says on stdout and stderr.
fn gnomon(folder: &Path, arguments: &str) -> (String, String) {
    let output = Command::cargo_bin("gnomon")
        .expect("the program")
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .expect("a run");
    let [out, said] =
        [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(output.status.success(), "{arguments}: {said}");
    (out, said)
}

/// Each frame's pose in a file of poses.
fn poses_of(text: &str) -> Vec<(String, Option<DAffine3>)> {
    text.lines()
        .skip(1)
        .map(|line| {
            let row: Vec<&str> = line.split(',').collect();
            let number = |k: usize| row[k].parse::<f64>().ok();
            let vector = |k| Some(DVec3::new(number(k)?, number(k + 1)?, number(k + 2)?));
            let pose = vector(5).zip(vector(8));
            (
                row[3].to_owned(),
                pose.map(|(shift_m, turn)| pose_from_rodrigues(shift_m, turn)),
            )
        })
        .collect()
}

#[test]
fn a_cube_is_replayed_with_what_stands_on_it() {
    const FRAMES: u32 = 24;
    let folder = project(FRAMES);
    let (_, said) = gnomon(
        folder.path(),
        "replay scene.toml --out out --poses poses.csv",
    );
    let text = std::fs::read_to_string(folder.path().join("poses.csv")).expect("poses");
    let poses = poses_of(&text);
    assert_eq!(poses.len(), FRAMES as usize, "{said}");
    for (k, (status, found)) in poses.iter().enumerate() {
        let truth = pose(k as u32);
        let found = found.unwrap_or_else(|| panic!("frame {k}: {status}"));
        let turn_deg = rotation_between(&found, &truth).to_degrees();
        let shift_m = found.translation.distance(truth.translation);
        assert_eq!(status, "tracked", "frame {k}");
        assert!(
            turn_deg < 0.5 && shift_m < 1e-3,
            "frame {k}: {turn_deg}°, {shift_m} m"
        );
    }
    // The ball is there where the cube's top does not hide it, and nowhere else: its middle is red when it is nearer than
    // the cardboard.
    let mut shown = 0;
    for k in 0..FRAMES {
        let picture = image::open(folder.path().join(format!("out/{k:06}.png")))
            .expect("a picture")
            .to_rgb8();
        let center_m = pose(k).transform_point3(DVec3::new(0.0, 0.0, 0.06));
        let pixel = CAMERA.pixel_of(center_m).expect("in front").round();
        let [red, green, blue] = picture.get_pixel(pixel.x as u32, pixel.y as u32).0;
        let is_red = f64::from(red) > 1.5 * f64::from(green.max(blue));
        let top = pose(k).transform_vector3(DVec3::Z);
        // Well before the top's plane, or behind it.
        match top.dot(center_m.normalize()) {
            facing if facing < -0.3 => assert!(is_red, "frame {k}: {red} {green} {blue}"),
            facing if facing > 0.6 => assert!(!is_red, "frame {k}: {red} {green} {blue}"),
            _ => {}
        }
        shown += u32::from(is_red);
    }
    assert!((4..FRAMES).contains(&shown), "{shown} of {FRAMES}");
}

#[test]
fn the_layout_of_a_filmed_cube_is_learnt_checked_and_recorded() {
    // Long enough that each face is seen beside another.
    let folder = project(40);
    let (_, said) = gnomon(
        folder.path(),
        "board --from frames --calibration camera.toml --size-mm 40 --name cube --out cube.toml",
    );
    assert!(said.contains("in space; its frame is marker 0's"), "{said}");
    let block = std::fs::read_to_string(folder.path().join("cube.toml")).expect("a block");
    let learnt = SCENE.replace(
        "[[board]]\nname = \"cube\"\nbundle = \"tags.yaml\"\n",
        &block,
    );
    let learnt = Scene::parse(&folder.path().join("learnt.toml"), &learnt).expect("a scene");
    // The gauge's frame is the cube's, moved to the top.
    for learnt in &learnt.anchors[0].markers {
        let known = &cube()[learnt.id as usize];
        let corners = learnt.corners_m().into_iter().zip(known.corners_m());
        let off_m = corners.map(|(found, known)| (found + DVec3::Z * 0.04).distance(known));
        let worst_m = off_m.fold(0.0, f64::max);
        assert!(worst_m < 3e-4, "{}: {worst_m} m", learnt.id);
    }
    assert_eq!(learnt.anchors[0].markers.len(), 6);

    let (told, _) = gnomon(folder.path(), "check scene.toml");
    assert!(told.contains("in space, 6 planes"), "{told}");
    gnomon(folder.path(), "record scene.toml --out session");
    let (told, _) = gnomon(folder.path(), "check session/scene.toml");
    assert!(told.contains("in space, 6 planes"), "{told}");
    assert!(folder.path().join("session/bundles/1.yaml").exists());
}
