//! Scenes: what a good one becomes, and where each mistake is pointed out.

mod bundles;
mod meshes;
mod mistakes;
mod models;
mod mutations;
mod shapes;

use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::Path;

use glam::{DVec3, Vec3};
use gnomon::app::jobs::check::summary;
use gnomon::geometry::mesh::Mesh;
use gnomon::light::{Light, Material};
use gnomon::scene::{
    ArucoRefinement, Codes, DetectorKind, Family, Object, Quality, Scene, SceneError,
    ShadowSettings, ShaftSettings, Shortcuts, Technique, VolumeCounting,
};
use tempfile::TempDir;

/// Five lines that are a scene; what a test adds begins on line 6.
const HEAD: &str = "[camera]
source = \"webcam:0\"
[[board]]
name = \"table\"
markers = [{ id = 0, size_m = 0.045, center_m = [0, 0] }]
";

/// A cube from the origin to (1, 1, 1).
const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1
f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

/// A project with a `config/`, and a cube in `models/`.
fn project() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("config")).unwrap();
    fs::create_dir_all(folder.path().join("models")).unwrap();
    fs::write(folder.path().join("models/cube.obj"), CUBE).unwrap();
    folder
}

fn load_in(project: &TempDir, text: &str) -> Result<Scene, SceneError> {
    let path = project.path().join("config/a.toml");
    fs::write(&path, text).unwrap();
    Scene::load(&path)
}

fn load(added: &str) -> Result<Scene, SceneError> {
    load_in(&project(), &format!("{HEAD}{added}"))
}

fn in_anchor(object: &Object) -> Mesh {
    let mut mesh = Mesh::clone(&object.mesh);
    for position in &mut mesh.positions {
        *position = object
            .anchor_from_object
            .transform_point3(position.as_dvec3())
            .as_vec3();
    }
    mesh
}

#[test]
fn files_that_are_no_scene_are_one_message() {
    let project = project();
    let missing = Scene::load(&project.path().join("none.toml")).unwrap_err();
    assert!(
        missing
            .to_string()
            .contains("none.toml: the scene cannot be read: "),
        "{missing}"
    );
    assert!(Scene::load(project.path()).is_err());
    let path = project.path().join("latin.toml");
    fs::write(&path, b"[camera]\nsource = \"\xe9\"\n").unwrap();
    let message = Scene::load(&path).unwrap_err().to_string();
    assert!(message.contains("latin.toml:2:11: not UTF-8"), "{message}");
    let empty = Scene::parse(Path::new("e.toml"), "")
        .unwrap_err()
        .to_string();
    assert!(empty.starts_with("e.toml:1:1: camera: missing"), "{empty}");
    let untracked = Scene::parse(Path::new("e.toml"), "[camera]\nsource = \"webcam:0\"\n")
        .unwrap_err()
        .to_string();
    assert!(
        untracked.contains("a [[board]] or a [[marker]] is expected"),
        "{untracked}"
    );
}

#[test]
fn a_bad_mesh_names_its_own_line_and_the_scene_s() {
    let project = project();
    let write =
        |name: &str, text: &str| fs::write(project.path().join("models").join(name), text).unwrap();
    write("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    write("empty.obj", "");
    write("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
    for (name, part) in [
        (
            "far.obj",
            "models/far.obj:4:7: f: vertex 9 does not exist; the file has 3 (a mesh of ",
        ),
        (
            "empty.obj",
            "models/empty.obj: the file is empty; a mesh is expected (a mesh of ",
        ),
        (
            "nan.obj",
            "models/nan.obj:2:1: v: no place, and a face needs it; allowed: three finite numbers",
        ),
    ] {
        let text = format!("{HEAD}[[virtual]]\nname = \"v\"\nmesh = \"models/{name}\"\n");
        let message = load_in(&project, &text).unwrap_err().to_string();
        assert!(
            message.contains(part) && message.contains("a.toml:8:8)"),
            "{message}"
        );
    }
}

#[test]
fn a_small_scene_has_the_defaults() {
    let scene = load("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\n").unwrap();
    assert_eq!(scene.camera.source, "webcam:0");
    assert_eq!(scene.camera.calibration, None);
    assert_eq!(scene.tracking, Default::default());
    assert_eq!(
        scene.shadows,
        ShadowSettings {
            environment: Default::default(),
            without: Shortcuts::NONE,
            quality: None,
            technique: Technique::Auto,
            samples: 4,
            light_samples: 64,
            ambient_samples: 256,
            reflection_samples: 16,
            counting: VolumeCounting::Auto,
            max_silhouette_error_px: 0.5,
            compact_penumbra_px: 12.0,
            frame_budget_ms: None,
            shafts: Default::default(),
        }
    );
    assert_eq!(
        scene.chosen_technique().0,
        gnomon::scene::ShadowTechnique::Volumes
    );
    assert_eq!(scene.ambient_radiance, DVec3::ZERO);
    assert_eq!((scene.phantoms.len(), scene.lights.len()), (0, 0));
    assert_eq!(scene.anchors[0].markers[0].family, Family::TAG36H11);
    let object = &scene.virtuals[0];
    assert_eq!(
        (object.anchor, object.casts, object.mesh_report.closed),
        (0, true, true)
    );
    assert_eq!(object.materials, [Material::matt(DVec3::splat(0.5))]);
    assert_eq!(object.anchor_from_object, glam::DAffine3::IDENTITY);
}

/// A scene that says another value than the default for most of what it can say.
const EVERY_KEY: &str = "[camera]
source = \"take\"
calibration = \"lens.toml\"
[tracking]
detector = \"aruco\"
decimation = 1.5
blur_px = 0.5
refine_edges = false
aruco_refinement = \"contour\"
corrected_bits = 0
min_margin = 7
threads = 2
[[marker]]
name = \"card\"
family = \"DICT_4X4_50\"
border_cells = 2
id = 0x11
size_m = 0.036
[[board]]
name = \"board\"
markers = [{ id = 17, size_m = 0.04, center_m = [0.1, -0.2], rotation_deg = 90 }]
[[virtual]]
name = \"v\"
mesh = \"models/cube.obj\"
on = \"card\"
position_m = [1, 2, 3]
rotation_deg = [90, 0, 90]
scale = [2, 1, 1]
material = { albedo = [0.1, 0.2, 0.3], roughness = 0.4 }
casts = false
[table]
rect_m = [-1, -2, 1, 2]
height_m = -0.5
albedo = 0.25
[[light]]
kind = \"directional\"
direction = [0, 0, -1e-200]
irradiance = 2
[ambient]
radiance = 0.5
[shadows]
quality = \"accurate\"
technique = \"volumes\"
samples = 1
counting = \"depth-fail\"
frame_budget_ms = 16
";

/// [`EVERY_KEY`] as it is read, and the project that it lies in.
fn scene_of_every_key() -> (TempDir, Scene) {
    let project = project();
    fs::create_dir(project.path().join("take")).unwrap();
    fs::write(project.path().join("config/lens.toml"), "").unwrap();
    let scene = load_in(&project, EVERY_KEY).unwrap();
    (project, scene)
}

#[test]
fn every_key_of_camera_and_tracking_arrives() {
    let (project, scene) = scene_of_every_key();
    assert!(Path::new(&scene.camera.source).is_absolute() && scene.camera.source.ends_with("take"));
    assert_eq!(
        scene.camera.calibration,
        Some(project.path().join("config/lens.toml"))
    );
    let tracking = &scene.tracking;
    assert_eq!(
        (tracking.detector, tracking.aruco_refinement),
        (DetectorKind::Aruco, ArucoRefinement::Contour)
    );
    assert_eq!(
        (tracking.decimation, tracking.blur_px, tracking.min_margin),
        (1.5, 0.5, 7.0)
    );
    assert_eq!(
        (
            tracking.refine_edges,
            tracking.corrected_bits,
            tracking.threads
        ),
        (false, 0, 2)
    );
}

#[test]
fn every_key_of_anchors_arrives() {
    let (_project, scene) = scene_of_every_key();
    let names: Vec<&str> = scene
        .anchors
        .iter()
        .map(|anchor| anchor.name.as_str())
        .collect();
    assert_eq!(names, ["board", "card"], "boards come first");
    assert!((scene.anchors[0].markers[0].rotation_rad() - FRAC_PI_2).abs() < 1e-12);
    assert_eq!(
        scene.anchors[1].markers[0].family,
        Family::of(Codes::Aruco {
            cells: 4,
            count: 50
        })
        .with_border(2)
        .unwrap()
    );
    assert_eq!(scene.anchors[1].markers[0].id, 17);
}

#[test]
fn every_key_of_things_and_the_table_arrives() {
    let (_project, scene) = scene_of_every_key();
    let object = &scene.virtuals[0];
    assert_eq!((object.anchor, object.casts), (1, false));
    assert_eq!(
        object.materials,
        [Material {
            roughness: Some(0.4),
            ..Material::matt(DVec3::new(0.1, 0.2, 0.3))
        }]
    );
    // Scaled to (2, 1, 1), turned about x to (2, -1, 1), about z to (1, 2, 1), moved.
    let moved = object.anchor_from_object.transform_point3(DVec3::ONE);
    assert!(
        (moved - DVec3::new(2.0, 4.0, 4.0)).length() < 1e-12,
        "{moved}"
    );
    let table = &scene.phantoms[0];
    assert_eq!(
        (table.name.as_str(), table.anchor, table.casts),
        ("table", 0, false)
    );
    assert_eq!(table.materials[0].albedo, DVec3::splat(0.25));
    assert_eq!(
        table.anchor_from_object.translation,
        DVec3::new(0.0, 0.0, -0.5)
    );
    assert!(
        table
            .mesh
            .corner_normals
            .iter()
            .flatten()
            .all(|normal| *normal == Vec3::Z)
    );
    assert_eq!(table.mesh_report.open_edges, 4);
}

#[test]
fn every_key_of_lights_and_shadows_arrives() {
    let (_project, scene) = scene_of_every_key();
    assert_eq!(
        scene.world_lights(),
        [Light::Directional {
            direction: -DVec3::Z,
            irradiance: DVec3::splat(2.0),
            angle_rad: 0.0
        }]
    );
    assert_eq!(scene.ambient_radiance, DVec3::splat(0.5));
    assert_eq!(
        scene.shadows,
        ShadowSettings {
            environment: Default::default(),
            without: Shortcuts::NONE,
            quality: Some(Quality::Accurate),
            technique: Technique::Volumes,
            samples: 1,
            light_samples: 256,
            ambient_samples: 512,
            reflection_samples: 32,
            counting: VolumeCounting::DepthFail,
            max_silhouette_error_px: 0.0,
            compact_penumbra_px: 12.0,
            frame_budget_ms: Some(16.0),
            // All of them: what this quality means.
            shafts: ShaftSettings {
                sources: None,
                ..ShaftSettings::default()
            },
        }
    );
}

#[test]
fn a_quality_is_told_by_the_settings_that_it_means() {
    let settings = |shadows: &str| load(&format!("[shadows]\n{shadows}\n")).unwrap().shadows;
    let meant = [
        ("fast", 1, 2.0, Some(10)),
        ("balanced", 4, 0.5, Some(50)),
        ("accurate", 4, 0.0, None),
    ];
    for (name, samples, error_px, sources) in meant {
        let found = settings(&format!("quality = {name:?}"));
        let told = (found.samples, found.max_silhouette_error_px);
        assert_eq!(told, (samples, error_px), "{name}");
        assert_eq!(found.shafts.sources, sources, "{name}");
        assert_eq!(found.quality.map(Quality::name), Some(name));
        // What is said beside it goes before it.
        let other = settings(&format!("quality = {name:?}\nmax_silhouette_error_px = 7"));
        let told = (other.samples, other.max_silhouette_error_px);
        assert_eq!(told, (samples, 7.0), "{name}");
    }
    let balanced = Quality::Balanced.shadows();
    let unsaid = ShadowSettings {
        quality: Some(Quality::Balanced),
        ..ShadowSettings::default()
    };
    assert_eq!(balanced, unsaid);
}

#[test]
fn a_mirrored_thing_keeps_its_outside_outside() {
    for (scale, volume) in [
        ("1", 1.0),
        ("-2", 8.0),
        ("[1, -1, 3]", 3.0),
        ("[-1, -1, 1]", 1.0),
    ] {
        let added = format!(
            "[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\nrotation_deg = [10, 20, 30]\nscale = {scale}\n"
        );
        let object = &load(&added).unwrap().virtuals[0];
        let placed = in_anchor(object);
        assert!(placed.closed_and_consistent());
        assert!(
            (placed.signed_volume_m3() - volume).abs() < 1e-5,
            "{scale}: {}",
            placed.signed_volume_m3()
        );
        // Normals, carried by the inverse transpose, still point out of the triangles.
        let carry = object.anchor_from_object.matrix3.inverse().transpose();
        for (triangle, normals) in placed.triangles.iter().zip(&placed.corner_normals) {
            let [a, b, c] = triangle.map(|index| placed.positions[index as usize]);
            let outward = (b - a).cross(c - a).normalize();
            for normal in normals {
                let carried = (carry * normal.as_dvec3()).normalize().as_vec3();
                assert!(carried.dot(outward) > 0.999, "{scale}");
            }
        }
    }
}

#[test]
fn up_to_sixteen_lights() {
    let light = "[[light]]\nkind = \"point\"\nposition_m = [0, 0, 1]\nintensity = 1\n";
    assert_eq!(load(&light.repeat(16)).unwrap().lights.len(), 16);
    let message = load(&light.repeat(17)).unwrap_err().to_string();
    assert!(
        message.contains("a.toml:70:1: light: too many; allowed: up to 16"),
        "{message}"
    );
}

#[test]
fn the_scenes_of_this_project_load() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let reference = Scene::load(&root.join("config/reference.toml")).unwrap();
    assert_eq!(
        reference.tracking,
        Default::default(),
        "the reference shows the defaults"
    );
    assert_eq!(reference.shadows, ShadowSettings::default());

    // Without the recordings, which may not be there: a copy of the scenes and meshes beside empty folders.
    let copy = tempfile::tempdir().unwrap();
    for folder in ["config", "models", "recordings/lamp", "recordings/hand"] {
        fs::create_dir_all(copy.path().join(folder)).unwrap();
    }
    for folder in ["config", "models"] {
        for entry in fs::read_dir(root.join(folder)).unwrap() {
            let entry = entry.unwrap();
            fs::copy(
                entry.path(),
                copy.path().join(folder).join(entry.file_name()),
            )
            .unwrap();
        }
    }
    let lamp = Scene::load(&copy.path().join("config/lamp.toml")).unwrap();
    let phantoms: Vec<&str> = lamp
        .phantoms
        .iter()
        .map(|object| object.name.as_str())
        .collect();
    assert_eq!(phantoms, ["table", "paper", "house", "tin"]);
    // The torus's axis as the session's own matrix has it.
    let axis = lamp.virtuals[0].anchor_from_object.matrix3.z_axis;
    let known = DVec3::new(0.5389855446957562, -0.7697511313200571, 0.3420201433256688);
    assert!((axis - known).length() < 1e-12);
    assert!(lamp.virtuals[0].mesh_report.closed && lamp.phantoms[2].mesh_report.closed);

    let hand = Scene::load(&copy.path().join("config/hand.toml")).unwrap();
    assert_eq!(
        (hand.anchors.len(), hand.phantoms.len(), hand.virtuals.len()),
        (2, 4, 2)
    );
    let sphere = &hand.virtuals[0];
    for (triangle, normals) in sphere
        .mesh
        .triangles
        .iter()
        .zip(&sphere.mesh.corner_normals)
    {
        for (&corner, normal) in triangle.iter().zip(normals) {
            let radius = sphere.mesh.positions[corner as usize];
            assert!(normal.angle_between(radius) < 0.01, "{normal} at {radius}");
        }
    }

    let text = summary(&hand);
    for part in [
        "tracked      table  6 markers  tag36h11  id 0-5  44 mm  the world\n",
        "             card   1 marker   tag36h11  id 17   36 mm\n",
        "casts no shadow",
        "technique    volumes: the scene has no probe\n",
        "lights       0  point  at [-0.22, -0.25, 0.42] m  intensity [0.85, 0.8, 0.7]\n",
    ] {
        assert!(text.contains(part), "{text}");
    }
    println!("{text}");
}

#[test]
fn the_summary_survives_odd_scenes() {
    let mut scene = load("").unwrap();
    assert!(summary(&scene).contains("virtuals     none\n"));
    scene.anchors.clear();
    let added = "[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\nscale = -1\n";
    scene.virtuals = load(added).unwrap().virtuals;
    scene.virtuals[0].anchor = 9;
    scene.anchors.push(gnomon::scene::Anchor {
        name: "bare".to_owned(),
        markers: Vec::new(),
    });
    let text = summary(&scene);
    assert!(
        text.contains("on nothing") && text.contains("mirrored"),
        "{text}"
    );
}

#[test]
fn a_family_may_be_a_file_beside_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let dictionary = folder.path().join("own.yml");
    let codes = "nmarkers: 2\nmarkersize: 3\nmarker_0: \"110100000\"\nmarker_1: \"111001011\"\n";
    std::fs::write(&dictionary, codes).expect("a written file");
    let scene = |detector: &str, family: &str, id: u32| {
        let text = format!(
            "[camera]\nsource = \".\"\n[tracking]\ndetector = \"{detector}\"\n[[marker]]\nname = \"card\"\n\
             family = \"{family}\"\nid = {id}\nsize_m = 0.04\n[ambient]\nradiance = [1, 1, 1]\n"
        );
        Scene::parse(&folder.path().join("scene.toml"), &text)
    };
    let read = scene("aruco", "own.yml", 1).expect("a scene");
    let family = read.anchors[0].markers[0].family;
    assert_eq!((family.id_count(), family.cells_across()), (2, 5));
    for (detector, name, id, message) in [
        ("aruco", "own.yml", 2, "own.yml"),
        ("aruco", "other.yml", 0, "other.yml"),
        ("apriltag", "own.yml", 0, "leave out tracking.detector"),
    ] {
        let error = scene(detector, name, id)
            .expect_err("a mistake")
            .to_string();
        assert!(
            error.contains("scene.toml:") && error.contains(message),
            "{error}"
        );
    }
    std::fs::write(&dictionary, codes.replace("111001011", "111")).expect("a written file");
    let error = scene("aruco", "own.yml", 1)
        .expect_err("a mistake")
        .to_string();
    assert!(error.contains("own.yml:4:1: marker_1: 9 digits"), "{error}");
}
