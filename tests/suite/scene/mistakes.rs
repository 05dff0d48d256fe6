//! Where each mistake in a scene is pointed out, and what is said to be allowed.

use super::{HEAD, load_in, project};

struct Mistake {
    /// A text of [`HEAD`] and what stands in its place.
    change: (&'static str, &'static str),
    added: &'static str,
    line: usize,
    column: usize,
    parts: &'static [&'static str],
}

const fn added(
    added: &'static str,
    line: usize,
    column: usize,
    parts: &'static [&'static str],
) -> Mistake {
    Mistake {
        change: ("", ""),
        added,
        line,
        column,
        parts,
    }
}

const fn changed(
    from: &'static str,
    to: &'static str,
    line: usize,
    column: usize,
    parts: &'static [&'static str],
) -> Mistake {
    Mistake {
        change: (from, to),
        added: "",
        line,
        column,
        parts,
    }
}

// A table is read by rows.
#[rustfmt::skip]
const MISTAKES: &[Mistake] = &[
    // The file itself
    added("[light\n", 6, 7, &["not TOML", "unclosed table"]),
    added("x = \n", 6, 5, &["not TOML"]),
    added("x = .5\n", 6, 5, &["not TOML", "digits before and after its point, as in 0.5"]),
    added("x = [5., 1]\n", 6, 8, &["not TOML", "digits before and after its point, as in 0.5"]),
    changed("name = \"table\"", "name = \"table\"\nname = \"top\"", 5, 1, &["not TOML", "duplicate key"]),
    // What is no plain file is neither read without end nor waited for
    added("[[phantom]]\nname = \"p\"\nmesh = \"/dev/zero\"\n", 8, 8, &["phantom.mesh", "not a plain file"]),
    added("[probe]\nimage = \"/dev/zero\"\n", 7, 9, &["probe.image", "/dev/zero", "not a plain file"]),
    // Things that move
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\nturn_deg_per_s = \"fast\"\n", 9, 18, &["turn_deg_per_s", "a number"]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\nturn_deg_per_s = [0, 90]\n", 9, 18, &["turn_deg_per_s", "3 numbers"]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\npath = []\n", 9, 8, &["path", "at least one place"]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\npath = [{ position_m = [0, 0, 0] }]\n", 9, 9, &["the time in seconds is expected"]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\npath = [{ time_s = 1 }, { time_s = 1 }]\n", 9, 25, &["the place before it has time_s = 1; allowed: a later time"]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\npath_end = \"loop\"\n", 9, 12, &["path_end", "stay, repeat, return"]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\npath_end = \"stay\"\n", 9, 12, &["path_end", "along with path"]),
    // Shapes
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\nbox_m = [1, 1, 1]\n", 9, 9, &["virtual.box_m = [1, 1, 1]: the thing has a shape, mesh; allowed: one of mesh, box_m"]),
    added("[[phantom]]\nname = \"p\"\nsphere_m = 1\ncone_m = [1, 1]\n", 8, 12, &["sphere_m = 1: the thing has a shape, cone_m"]),
    added("[[phantom]]\nname = \"p\"\nsphere_m = 1\nfit_m = 0.1\n", 9, 9, &["fit_m = 0.1: it is of a mesh's file", "sphere_m; allowed: rotation_deg and scale"]),
    added("[[virtual]]\nname = \"v\"\nbox_m = [1, 1]\n", 8, 9, &["box_m = [1, 1]: [x, y, z] or [x0, y0, z0, x1, y1, z1] in metres are expected"]),
    added("[[virtual]]\nname = \"v\"\nbox_m = [1, 0, 1]\n", 8, 13, &["box_m = 0: out of range; allowed: above 0, up to 100000 m"]),
    added("[[virtual]]\nname = \"v\"\nbox_m = [0, 0, 0, 1, -1, 1]\n", 8, 9, &["no volume", "y0 < y1"]),
    added("[[virtual]]\nname = \"v\"\nbox_m = 1\n", 8, 9, &["an array of numbers is expected, this is an integer"]),
    added("[[virtual]]\nname = \"v\"\ncylinder_m = [0.1]\n", 8, 14, &["1 entries; 2 numbers in brackets are expected"]),
    added("[[virtual]]\nname = \"v\"\nsphere_m = -1\n", 8, 12, &["out of range; allowed: above 0"]),
    added("[[virtual]]\nname = \"v\"\nrect_m = [1, 2, 3]\n", 8, 10, &["[x, y] or [x0, y0, x1, y1] in metres are expected"]),
    added("[[virtual]]\nname = \"v\"\nrect_m = [1, 0, 0, 1]\n", 8, 10, &["no area", "x0 < x1"]),
    added("[[virtual]]\nname = \"v\"\nprism = { outline_m = [[0, 0], [1, 0], [0, 1]] }\n", 8, 9, &["prism.height_m: missing; a length in metres"]),
    added("[[virtual]]\nname = \"v\"\nprism = { height_m = 1, outline = [] }\n", 8, 25, &["prism.outline: unknown key; did you mean \"outline_m\"?"]),
    added("[[virtual]]\nname = \"v\"\nprism = { height_m = 1, outline_m = [[0, 0], [1, 1], [1, 0], [0, 1]] }\n", 8, 54, &[
        "prism.outline_m = [1, 0]: the side that begins here meets the one that begins at [0, 0]; allowed: sides that neither touch nor cross",
    ]),
    added("[[virtual]]\nname = \"v\"\nprism = { height_m = 1, outline_m = [[0, 0], [1, 1], [1, 1]] }\n", 8, 54, &["the place before it is the same"]),
    added("[[virtual]]\nname = \"v\"\nprism = { height_m = 1, outline_m = [[0, 0], [1, 1]] }\n", 8, 37, &["too few different places; allowed: 3 or more"]),
    added("[[virtual]]\nname = \"v\"\nprism = { height_m = 1, outline_m = [[0, 0], [1, 1, 1]] }\n", 8, 46, &["two numbers in brackets are expected"]),
    added("[[virtual]]\nname = \"v\"\nrevolved = { profile_m = [[0, 0], [-1, 1]] }\n", 8, 36, &["profile_m = -1: out of range; allowed: 0 to 100000 m"]),
    added("[[virtual]]\nname = \"v\"\nrevolved = { profile_m = [[2, 0], [1, 1], [2, 2], [3, 1]] }\n", 8, 51, &["the side that begins here meets the one that begins at [2, 0]"]),
    added("[[virtual]]\nname = \"v\"\nrevolved = { profile_m = [[0, 0]] }\n", 8, 26, &["too few different places; allowed: 2 or more"]),
    // Unknown keys and tables
    added("[[lihgt]]\n", 6, 3, &["lihgt: unknown key", "did you mean \"light\"?", "allowed: camera, tracking, board"]),
    changed("source", "sourc", 2, 1, &["camera.sourc: unknown key", "did you mean \"source\"?", "calibration"]),
    changed("size_m", "size", 5, 22, &["board.markers.size: unknown key", "allowed: id, size_m, center_m, rotation_deg"]),
    added("[tracking]\nzzz = 1\n", 7, 1, &["tracking.zzz: unknown key; allowed: detector, decimation"]),
    added("[[virtual]]\nname = \"v\"\nbox = [1, 1, 1]\n", 8, 1, &["virtual.box: unknown key", "box_m, cylinder_m"]),
    added("[[phantom]]\nname = \"p\"\nsmooth_deg = 3\n", 8, 1, &["phantom.smooth_deg: unknown key"]),
    // Missing ones
    changed("[camera]\nsource = \"webcam:0\"", "\n", 1, 1, &["camera: missing", "source"]),
    changed("name = \"table\"\n", "", 3, 1, &["board.name: missing", "a name in quotes"]),
    changed("id = 0, ", "", 5, 12, &["board.markers.id: missing"]),
    added("[[marker]]\nname = \"m\"\nid = 1\n", 6, 1, &["marker.size_m: missing", "metres"]),
    added("[[light]]\nkind = \"point\"\nintensity = 1\n", 6, 1, &["light.position_m: missing"]),
    added("[[light]]\nposition_m = [0, 0, 1]\n", 6, 1, &["light.kind: missing", "directional"]),
    added("[[phantom]]\nname = \"p\"\n", 6, 1, &[
        "\"p\": no shape; one of mesh, box_m, cylinder_m, cone_m, sphere_m, rect_m, prism, revolved is expected",
    ]),
    added("[table]\nheight_m = 1\n", 6, 1, &["table.rect_m: missing"]),
    // Wrong types
    changed("\"webcam:0\"", "5", 2, 10, &["camera.source = 5: a text in quotes is expected, this is an integer"]),
    changed("[[board]]", "[board]", 3, 1, &["board: may occur more than once: write [[board]]"]),
    added("[[ambient]]\n", 6, 1, &["ambient", "a table is expected, this is an array"]),
    added("[ambient]\nradiance = \"dim\"\n", 7, 12, &["ambient.radiance = \"dim\": a number or 3 numbers in brackets"]),
    added("[[phantom]]\nname = \"p\"\nposition_m = [0, 0]\n", 8, 14, &["2 entries; 3 numbers in brackets are expected"]),
    added("[tracking]\nrefine_edges = 1\n", 7, 16, &["true or false is expected"]),
    // Names of things
    added("[[marker]]\nname = \"m\"\nfamily = \"tag36h12\"\n", 8, 10, &[
        "marker.family = \"tag36h12\": unknown family; did you mean \"tag36h11\"? allowed: tag16h5, ",
    ]),
    added("[tracking]\ndetector = \"apriltag\"\n[[marker]]\nname = \"m\"\nfamily = \"DICT_4X4_50\"\n", 10, 10, &["libapriltag", "leave out tracking.detector"]),
    changed("name = \"table\"", "name = \"table\"\nborder_cells = 3", 5, 16, &["board.border_cells = 3: out of range; allowed: 1 to 2"]),
    added("[[phantom]]\nname = \"p\"\non = \"tabel\"\n", 8, 6, &[
        "phantom.on = \"tabel\": no board or marker has this name; did you mean \"table\"? allowed: table",
    ]),
    added("[[phantom]]\nname = \"p\"\nmesh = \"models/none.obj\"\n", 8, 8, &[
        "phantom.mesh = \"models/none.obj\": no such file",
        "config/models/none.obj and ",
    ]),
    changed("\"webcam:0\"", "\"recordings/x\"", 2, 10, &["camera.source", "config/recordings/x and "]),
    changed("\"webcam:0\"", "\"webcam:\"", 2, 10, &["which webcam?", "webcam:1", "a part of its name"]),
    changed("\"webcam:0\"", "\"webcam:0\"\nsize_px = [640.5, 480]", 3, 11, &["camera.size_px", "two whole numbers"]),
    changed("\"webcam:0\"", "\"webcam:0\"\nfps = 0", 3, 7, &["camera.fps = 0: out of range; allowed: 1 to 1000"]),
    changed("\"webcam:0\"", "\"webcam:0\"\nformat = \"YUV\"", 3, 10, &["unknown format", "did you mean \"YUYV\"?", "MJPEG"]),
    added("[[marker]]\nname = \"table\"\nid = 1\nsize_m = 1\n", 7, 8, &["the name is taken on line 4"]),
    added("[table]\nrect_m = [0, 0, 1, 1]\n[[virtual]]\nname = \"table\"\n", 9, 8, &["the name is taken on line 6"]),
    added("[[marker]]\nname = \"a, b\"\n", 7, 8, &["not a name"]),
    added("[[light]]\nkind = \"pont\"\n", 7, 8, &["unknown kind of light; did you mean \"point\"? allowed: point, directional"]),
    added("[[light]]\nkind = \"directional\"\nposition_m = [0, 0, 1]\n", 8, 1, &["light.position_m: of a light of kind point or spot or sphere or rect, and not directional; allowed: kind, on, direction"]),
    added("[[light]]\nkind = \"point\"\nradius_m = 0.1\n", 8, 1, &["light.radius_m: of a light of kind sphere, and not point; allowed: kind, on, position_m, intensity"]),
    added("[tracking]\ndetector = \"apriltags\"\n", 7, 12, &["did you mean \"apriltag\"?"]),
    // Numbers
    changed("0.045", "-0.045", 5, 31, &["board.markers.size_m = -0.045: out of range; allowed: 0.0001 to 100 m"]),
    changed("[0, 0]", "[0, nan]", 5, 53, &["center_m = nan: not a finite number"]),
    changed("[0, 0]", "[1e999, 0]", 5, 50, &["not a finite number"]),
    changed("id = 0", "id = 587", 5, 19, &["out of range; allowed: 0 to 586 (the ids of tag36h11)"]),
    changed("id = 0", "id = -1", 5, 19, &["out of range; allowed: 0 to 586"]),
    changed("id = 0", "id = 0.5", 5, 19, &["a whole number is expected, this is a float"]),
    changed("[{ id = 0, size_m = 0.045, center_m = [0, 0] }]", "[]", 5, 11, &["at least one marker"]),
    added("[[marker]]\nname = \"m\"\nid = 0\nsize_m = 1\n", 8, 6, &["marker 0 of tag36h11 is taken by \"table\" on line 5"]),
    added("[[virtual]]\nname = \"v\"\nscale = 0\n", 8, 9, &["virtual.scale = 0: out of range"]),
    added("[[virtual]]\nname = \"v\"\nscale = [1, -nan, 1]\n", 8, 13, &["not a finite number"]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\nmaterial = { albedo = 1.2 }\n", 9, 23, &[
        "virtual.material.albedo = 1.2: out of range; allowed: 0 to 1",
    ]),
    added("[[virtual]]\nname = \"v\"\nmesh = \"models/cube.obj\"\nmaterial = { roughness = 0 }\n", 9, 26, &[
        "out of range; allowed: above 0, up to 1",
    ]),
    added("[[light]]\nkind = \"point\"\nposition_m = [0, 0, 1]\nintensity = [1, -1, 1]\n", 9, 17, &["out of range"]),
    added("[[light]]\nkind = \"directional\"\ndirection = [0, 0, 0]\nirradiance = 1\n", 8, 13, &["no direction"]),
    added("[table]\nrect_m = [1, 0, 0, 1]\n", 7, 10, &["no area", "x0 < x1"]),
    added("[tracking]\ndecimation = 0.5\n", 7, 14, &["allowed: 1 to 8"]),
    // Shadows
    added("[shadows]\ntechnique = \"shafts\"\n", 7, 13, &["the scene has no [probe]", "allowed: auto, volumes"]),
    added("[shadows]\ntechnique = \"environment\"\n", 7, 13, &["the scene has no [probe]", "auto, volumes"]),
    added("[shadows]\nsources = 0\n", 7, 11, &["1 to 4096"]),
    added("[shadows]\nsources = \"most\"\n", 7, 11, &["a number of sources", "\"all\""]),
    added("[shadows]\nmap_px = 100\n", 7, 10, &["a side of maps", "64, 128"]),
    added("[shadows]\ndifference = \"minus\"\n", 7, 14, &["way to take light away", "ratio, subtract"]),
    added("[shadows]\ncompositing = \"hdr\"\n", 7, 15, &["way to composite", "float, ldr"]),
    added("[shadows]\ndifference = \"ratio\"\ncompositing = \"ldr\"\n", 8, 15, &["difference is of float compositing"]),
    added("[shadows]\nsource_power = 0\n", 7, 16, &["above 0, up to 1"]),
    added("[shadows]\nsamples = 2\n", 7, 11, &["allowed: 1, 4"]),
    added("[shadows]\nquality = \"best\"\n", 7, 11, &["quality", "allowed: fast, balanced, accurate"]),
    added("[shadows]\nmax_silhouette_error_px = -1\n", 7, 27, &["out of range; allowed: 0 to 100 px"]),
    added("[shadows]\nmax_silhouette_error_px = \"half\"\n", 7, 27, &["a number is expected"]),
    added("[shadows]\nframe_budget_ms = 0\n", 7, 19, &["allowed: above 0, up to 1000000 ms"]),
    added("[probe]\nimage = \"missing.hdr\"\n", 7, 9, &["missing.hdr"]),
    added("[probe]\nposition_m = [0, 0, 0]\n", 6, 1, &["image", "linear radiance"]),
    added("[[room]]\nbox_m = [0, 0, 0, 1, 1, 1]\n", 6, 1, &["there is none", "[probe]"]),
];

#[test]
fn each_mistake_has_its_place_and_says_what_is_allowed() {
    let project = project();
    let mut failures = Vec::new();
    for Mistake {
        change: (from, to),
        added,
        line,
        column,
        parts,
    } in MISTAKES
    {
        assert!(HEAD.contains(from));
        let text = format!("{}{added}", HEAD.replacen(from, to, 1));
        let error = load_in(&project, &text)
            .map_or_else(|error| error.to_string(), |_| "accepted".to_owned());
        let first_line = error.lines().next().unwrap();
        let place = format!(
            "{}:{line}:{column}: ",
            project.path().join("config/a.toml").display()
        );
        let right =
            first_line.starts_with(&place) && parts.iter().all(|part| first_line.contains(part));
        if !right || error.lines().count() != 3 || !error.contains('^') {
            failures.push(format!(
                "{text}\nexpected {line}:{column} {parts:?}, got\n{error}\n"
            ));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn a_probe_turns_with_a_marker_that_is_there_and_not_with_a_room() {
    let project = project();
    let probe = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/room/probe.hdr");
    std::fs::copy(probe, project.path().join("probe.hdr")).unwrap();
    let dial =
        "[[marker]]\nname = \"dial\"\nid = 9\nsize_m = 0.04\n[probe]\nimage = \"probe.hdr\"\n";
    let loaded = |more: &str| load_in(&project, &format!("{HEAD}{dial}{more}"));
    let scene = loaded("on = \"dial\"\n").unwrap();
    assert_eq!(scene.probe.unwrap().anchor, 1);
    assert_eq!(loaded("").unwrap().probe.unwrap().anchor, 0);
    for (more, told) in [
        ("on = \"dail\"\n", "did you mean \"dial\"?"),
        (
            "on = \"dial\"\n[[room]]\nbox_m = [-1, -1, -1, 1, 1, 1]\n",
            "probe.on = \"dial\": light of a room stays where the room is",
        ),
        (
            "on = \"dial\"\n[shadows]\ntechnique = \"shafts\"\n",
            "which shafts cannot follow; allowed: auto, environment",
        ),
    ] {
        let error = loaded(more).unwrap_err().to_string();
        assert!(error.contains(told) && error.contains('^'), "{error}");
    }
}
