//! Boards whose markers are in a file of apriltag_ros, as people write them.

use std::fs;

use glam::DVec3;
use gnomon::scene::{Scene, SceneError};

use super::project;

/// As the package's own example looks: lists in brackets over several lines, comments, keys left out, numbers with zeros
/// before them, commas at the end.
const TAGS: &str = "\
# # Definitions of tags to detect
standalone_tags:
  [
    {id: 20, size: 0.05},  # a lone one
  ]
tag_bundles:
  [
    {
      name: 'cube',
      layout:
        [
          {id: 007, size: 0.04, x: 0.0000, y: 0.0000, z: 0.05, qw: 1.0000, qx: 0.0, qy: 0.0, qz: 0.0},
          {id: 1, size: 0.04, y: -0.05, qw: 1, qx: 1},
          # {id: 2, size: 0.04, x: 0.3},
          {id: 3, size: 0.03},
        ]
    },
    {
      layout: [
        {id: 4,
         size: 0.1, x: -0.2}
      ]
    }
  ]
";

fn load(tags: &str, keys: &str) -> Result<Scene, SceneError> {
    let project = project();
    fs::write(project.path().join("config/tags.yaml"), tags).unwrap();
    let text = format!(
        "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"cube\"\nbundle = \"tags.yaml\"\n{keys}"
    );
    super::load_in(&project, &text)
}

#[test]
fn a_bundle_is_a_board_in_space() {
    let scene = load(TAGS, "bundle_name = \"cube\"").unwrap();
    let markers = &scene.anchors[0].markers;
    let ids: Vec<u32> = markers.iter().map(|marker| marker.id).collect();
    assert_eq!(ids, [7, 1, 3]);
    assert_eq!(markers[0].center_m(), DVec3::new(0.0, 0.0, 0.05));
    assert_eq!(markers[2].size_m, 0.03);
    assert!(markers[2].is_in_plane());
    // A quarter about x, whatever the quaternion's length: the print looks to -y.
    let normal = markers[1].normal();
    assert!(normal.abs_diff_eq(DVec3::NEG_Y, 1e-12), "{normal}");
    assert!(!scene.anchors[0].is_flat());
    let scene = load(TAGS, "bundle_name = \"bundle_1\"").unwrap();
    assert_eq!(
        scene.anchors[0].markers[0].center_m(),
        DVec3::new(-0.2, 0.0, 0.0)
    );
}

#[test]
fn mistakes_in_bundles_are_pointed_out() {
    let bundle = |tags: &str| format!("tag_bundles: [{{name: c, layout: [\n{tags}]}}]\n");
    let cases: [(String, &str, &[&str]); 14] = [
        (
            TAGS.into(),
            "",
            &["a.toml:5:", "has 2 bundles", "allowed: cube, bundle_1"],
        ),
        (
            TAGS.into(),
            "bundle_name = \"cub\"",
            &["a.toml:6:", "did you mean \"cube\""],
        ),
        (bundle("{id: 1}"), "", &["tags.yaml:2:", "size is missing"]),
        (bundle("{size: 1}"), "", &["tags.yaml:2:", "id is missing"]),
        (
            bundle("{id: 1.5, size: 1}"),
            "",
            &["tags.yaml:2:6", "id:", "586"],
        ),
        (bundle("{id: 600, size: 1}"), "", &["tags.yaml:2:", "586"]),
        (
            bundle("{id: 1, size: 40mm}"),
            "",
            &["tags.yaml:2:15", "size: not a number"],
        ),
        (
            bundle("{id: 1, size: -1}"),
            "",
            &["tags.yaml:2:15", "0.0001 to 100"],
        ),
        (
            bundle("{id: 1, size: 1, x: .nan}"),
            "",
            &["tags.yaml:2:21", "x:"],
        ),
        (
            bundle("{id: 1, size: 1, qw: 0}"),
            "",
            &["tags.yaml:2:", "no turn"],
        ),
        (
            bundle("{id: 1, size: 1, roll: 3}"),
            "",
            &["tags.yaml:2:", "roll: unknown key"],
        ),
        (
            bundle("{id: 1, size: 1},\n{id: 1, size: 1}"),
            "",
            &["tags.yaml:3:", "taken by \"cube\"", "line 2"],
        ),
        (bundle(""), "", &["tags.yaml:1:", "at least one tag"]),
        (
            "standalone_tags: [{id: 1, size: 1}]\n".into(),
            "",
            &["tags.yaml", "tag_bundles", "[[marker]]"],
        ),
    ];
    for (tags, keys, parts) in cases {
        let message = load(&tags, keys).expect_err(&tags).to_string();
        for part in parts {
            assert!(message.contains(part), "{tags}\n{message}\nlacks {part}");
        }
    }
    for (tags, part) in [
        ("{", "line"),
        ("tag_bundles: 3", "a list"),
        ("", "no bundle"),
    ] {
        let message = load(tags, "").unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_bundle_and_a_list_are_not_both() {
    let both = load(
        TAGS,
        "markers = [{ id = 9, size_m = 0.1, center_m = [0, 0] }]",
    );
    let message = both.unwrap_err().to_string();
    assert!(message.contains("one of the two"), "{message}");
    let lone = super::load("[[board]]\nname = \"b\"\nbundle_name = \"c\"\n");
    let message = lone.unwrap_err().to_string();
    assert!(message.contains("give the file"), "{message}");
    let neither = super::load("[[board]]\nname = \"b\"\n")
        .unwrap_err()
        .to_string();
    assert!(neither.contains("missing markers"), "{neither}");
}

#[test]
fn markers_of_a_board_stand_in_space_with_three_numbers() {
    let scene = super::load(
        "[[board]]\nname = \"box\"\nmarkers = [\n\
         { id = 5, size_m = 0.04, center_m = [0, 0, 0.05] },\n\
         { id = 6, size_m = 0.04, center_m = [0.05, 0, 0], rotation_deg = [90, 0, 90] },\n\
         { id = 7, size_m = 0.04, center_m = [0, 0.2, 0.05], rotation_deg = 30 },\n]\n",
    );
    let scene = scene.unwrap();
    let markers = &scene.anchors[1].markers;
    assert_eq!(markers[0].center_m(), DVec3::new(0.0, 0.0, 0.05));
    assert!(markers[1].normal().abs_diff_eq(DVec3::X, 1e-12));
    assert!(
        markers[1]
            .rotation_deg()
            .abs_diff_eq(DVec3::new(90.0, 0.0, 90.0), 1e-9)
    );
    assert!((markers[2].rotation_rad().to_degrees() - 30.0).abs() < 1e-9);
    for (center, turn, part) in [
        ("[0]", "0", "1 entries"),
        ("[0, 0, 0, 0]", "0", "4 entries"),
        ("[0, 0, 1e3]", "0", "-100 to 100"),
        ("[0, 0]", "[0, 0]", "2 entries"),
        ("[0, 0]", "\"x\"", "number"),
    ] {
        let text = format!(
            "[[board]]\nname = \"b\"\nmarkers = [{{ id = 5, size_m = 0.04, center_m = {center}, rotation_deg = {turn} }}]\n"
        );
        let message = super::load(&text).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_damaged_bundle_is_read_or_refused_and_never_worse() {
    let keys = "bundle_name = \"cube\"";
    for end in (0..TAGS.len()).step_by(7) {
        let _ = load(&TAGS[..end], keys);
    }
    for (at, _) in TAGS.char_indices().step_by(5) {
        for odd in [
            "-", "[", "}", ":", "\u{e9}", "\t", "&a", "*a", "\"", "9e999", "\r",
        ] {
            let text = format!("{}{odd}{}", &TAGS[..at], &TAGS[at + 1..]);
            if let Err(error) = load(&text, keys) {
                assert!(!error.to_string().is_empty());
            }
        }
    }
    let deep = format!("tag_bundles: {}{}", "[".repeat(5000), "]".repeat(5000));
    let message = load(&deep, keys).unwrap_err().to_string();
    assert!(message.contains("tags.yaml: line 1"), "{message}");
}
