//! What `gnomon check` tells of meshes from hell, and of lights in them.

use std::fs;

use gnomon::app::jobs::check::summary;
use gnomon::app::scene_warnings::warnings;

use super::{CUBE, HEAD, load_in, project};

/// The rows of one virtual thing in the summary.
fn told(obj: &str, added: &str) -> String {
    let project = project();
    fs::write(project.path().join("models/cube.obj"), obj).unwrap();
    let text = format!("{HEAD}[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\n{added}");
    let text = summary(&load_in(&project, &text).unwrap());
    let from = text.find("virtuals").unwrap();
    let to = text.find("lights").unwrap();
    text[from..to].to_owned()
}

const CLOSED: &str = "virtuals     v  on table  1 m x 1 m x 1 m  12 triangles, closed: silhouettes of one orientation  casts\n";
const GREY: &str = "                albedo [0.5, 0.5, 0.5], 1 kB";

#[test]
fn a_good_mesh_is_two_lines() {
    assert_eq!(told(CUBE, ""), format!("{CLOSED}{GREY}\n"));
    let mute = told(CUBE, "casts = false\n");
    assert!(
        mute.contains("12 triangles, closed  casts no shadow\n"),
        "{mute}"
    );
}

#[test]
fn an_open_mesh_names_its_method() {
    let open = CUBE.replace("f 2 4 8 6\n", "");
    assert_eq!(
        told(&open, ""),
        format!(
            "virtuals     v  on table  1 m x 1 m x 1 m  10 triangles, 4 open edges: signed edge multiplicity  casts\n\
             {GREY}\n"
        )
    );
}

#[test]
fn what_was_mended_is_told_below() {
    for (obj, note) in [
        (format!("{CUBE}f 2 4 8 6\n"), "dropped 2 duplicates"),
        (format!("{CUBE}f 6 8 4 2\n"), "dropped 2 duplicates"),
        (format!("{CUBE}f 1 2 2\n"), "dropped 1 without area"),
        (CUBE.replace("f 1 3 4 2", "f 2 4 3 1"), "turned 2 triangles"),
        (
            CUBE.replace("f 1 3 4 2", "v 0 1e-7 0\nf 9 3 4 2"),
            "merged 1 vertex",
        ),
    ] {
        let told = told(&obj, "");
        assert_eq!(told, format!("{CLOSED}{GREY}, {note}\n"), "{obj}");
    }
}

#[test]
fn a_cut_at_a_vertex_on_an_edge_is_told() {
    // The front is split at the middle of its lower edge, the bottom is not.
    let front = "v 0.5 0 0\nf 9 2 6\nf 9 6 5\nf 9 5 1";
    let obj = CUBE.replace("f 1 2 6 5", front);
    let told = told(&obj, "");
    assert!(
        told.contains("14 triangles, closed: ") && told.contains(", 1 cut at vertices on edges\n"),
        "{told}"
    );
}

#[test]
fn a_light_inside_a_closed_caster_is_warned_of() {
    let project = project();
    let scene = |object: &str, light: &str| {
        let text = format!(
            "{HEAD}[[marker]]\nname = \"card\"\nid = 1\nsize_m = 0.04\n[[phantom]]\nname = \"box\"\n\
             mesh = \"models/cube.obj\"\n{object}[[light]]\nkind = \"directional\"\ndirection = [0, 0, -1]\n\
             irradiance = 1\n[[light]]\nkind = \"point\"\nintensity = 1\nposition_m = {light}\n"
        );
        load_in(&project, &text).unwrap()
    };
    let warned = "light 1 is inside \"box\": everything outside of it is in its shadow";
    let moved = "position_m = [0, 0, 2]\nrotation_deg = [0, 0, 45]\nscale = [1, 1, -1]\n";
    for (object, light, expected) in [
        ("", "[0.5, 0.5, 0.5]", true),
        ("", "[0.5, 0.5, 1.5]", false),
        (moved, "[0, 0.7, 1.5]", true),
        // At 0.7 it would lie exactly on a side, which is warned of by itself.
        (moved, "[0.71, 0.7, 1.5]", false),
        (moved, "[0, 0.7, 2.5]", false),
        ("casts = false\n", "[0.5, 0.5, 0.5]", false),
        // Where the card is, no file says.
        ("on = \"card\"\n", "[0.5, 0.5, 0.5]", false),
    ] {
        let scene = scene(object, light);
        let found = warnings(&scene);
        assert_eq!(
            found,
            vec![warned; usize::from(expected)],
            "{object}{light}"
        );
        let line = format!("warning      {warned}\n");
        assert_eq!(summary(&scene).contains(&line), expected);
    }
}

#[test]
fn a_lamp_in_millimetres_and_light_from_behind_are_doubted() {
    let project = project();
    let card = "[[marker]]\nname = \"card\"\nid = 1\nsize_m = 0.04\n";
    let point = |place: &str| format!("kind = \"point\"\nintensity = 0.4\nposition_m = {place}\n");
    let sun = |way: &str| format!("kind = \"directional\"\nirradiance = 1\ndirection = {way}\n");
    let aimed = |kind: &str, own: &str, way: &str| {
        format!(
            "kind = \"{kind}\"\nintensity = 0.4\nposition_m = [0, 0, 0.5]\ndirection = {way}\n{own}\n"
        )
    };
    let behind = "comes from behind the markers";
    let past = "shines past everything";
    for (light, says) in [
        (point("[300, 200, 500]"), Some("was [0.3, 0.2, 0.5] meant?")),
        (point("[0.3, 0.2, 0.5]"), None),
        // A floodlight.
        (point("[30, 20, 50]").replace("0.4", "4e4"), None),
        (point("[0.3, 0.2, -0.5]"), Some(behind)),
        (sun("[0.3, 0.2, 0.5]"), Some(behind)),
        (sun("[0.3, 0.2, -0.5]"), None),
        (aimed("spot", "outer_deg = 20", "[0, 0, 1]"), Some(past)),
        (aimed("spot", "outer_deg = 20", "[0, 0, -1]"), None),
        (
            aimed("rect", "size_m = [0.3, 0.3]", "[0, 0, 1]"),
            Some(past),
        ),
        (aimed("rect", "size_m = [0.3, 0.3]", "[0.3, 0, -1]"), None),
        // Which side of a card the light is on, no file says.
        (format!("{}on = \"card\"\n", sun("[0.3, 0.2, 0.5]")), None),
    ] {
        let scene = load_in(&project, &format!("{HEAD}{card}[[light]]\n{light}")).unwrap();
        let found = warnings(&scene);
        assert_eq!(
            found.len(),
            usize::from(says.is_some()),
            "{light}: {found:?}"
        );
        assert!(
            found.iter().all(|found| found.contains(says.unwrap())),
            "{found:?}"
        );
    }
    // Of a cube there is no behind.
    let cube = "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"cube\"\nmarkers = [\
                { id = 0, size_m = 0.045, center_m = [0, 0, 0.03] }, \
                { id = 1, size_m = 0.045, center_m = [0.03, 0, 0], rotation_deg = [0, 90, 0] }]\n";
    let scene = load_in(&project, &format!("{cube}[[light]]\n{}", sun("[0, 0, 1]"))).unwrap();
    assert_eq!(warnings(&scene), Vec::<String>::new());
}
