use super::*;
use crate::geometry::cuboid::SIDES;

const SMOOTH: Normals = Normals::GivenOrMade { crease_rad: 0.5 };

fn read_text(path: &Path, text: &str, normals: Normals) -> Result<LoadedMesh, SceneError> {
    read(
        path,
        text.into(),
        (MeshReading::plain(normals), None),
        (&|_| (), &|_| Ok(())),
    )
}

fn failure(text: &str) -> String {
    let read = read_text(Path::new("bad.obj"), text, SMOOTH);
    read.unwrap_err().to_string()
}

#[test]
fn normals_come_from_the_file_where_it_has_them() {
    let text =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0 3 4\nvn 0 0 0\nf 1//1 2//2 3\nf 2 4 3//-2\n";
    let loaded = read_text(Path::new("a.obj"), text, SMOOTH).unwrap();
    let given = Vec3::new(0.0, 0.6, 0.8);
    assert_eq!(
        loaded.mesh.corner_normals,
        [[given, Vec3::Z, Vec3::Z], [Vec3::Z, Vec3::Z, given]]
    );
    assert_eq!(loaded.materials, [Material::matt(DVec3::splat(0.5))]);
    let flat = read_text(Path::new("a.obj"), text, Normals::Flat).unwrap();
    assert_eq!(flat.mesh.corner_normals, [[Vec3::Z; 3]; 2]);
}

#[test]
fn groups_and_loose_quads_weld_into_a_closed_box() {
    let mut text = String::new();
    for side in SIDES {
        for corner in side {
            text += &format!("v {} {} {}\n", corner & 1, corner >> 1 & 1, corner >> 2);
        }
        text += "g side\nf -4 -3 -2 -1\n";
    }
    let loaded = read_text(Path::new("box.obj"), &text, SMOOTH).unwrap();
    assert_eq!(
        loaded.report,
        MeshReport {
            merged_vertices: 16,
            components: 1,
            closed: true,
            ..MeshReport::default()
        }
    );
    assert!((loaded.mesh.signed_volume_m3() - 1.0).abs() < 1e-12);
}

#[test]
fn bad_meshes_say_what_is_expected() {
    assert!(failure(" \n").contains("bad.obj: the file is empty"));
    assert!(failure("v 0 0 0\n").contains("bad.obj: no faces"));
    assert!(failure("v 0 0 0\nf 1 1 1\n").contains("no triangle has an area"));
    let place = failure("v 0 0 0\nv 1 0 0\nv 0 NaN 0\nf 1 2 3\n");
    assert!(
        place.starts_with("bad.obj:3:1: v: no place, and a face needs it"),
        "{place}"
    );
    let fbx = failure("Kaydara FBX Binary  \0");
    let expected = "bad.obj: an FBX file is not read; allowed: glTF, OBJ, PLY, STL";
    assert_eq!(fbx, expected);
}

/// What has no surface is named.
#[test]
fn points_and_lines_are_told_as_such() {
    for (text, part) in [
        ("v 0 0 0\nv 1 0 0\n", "no faces: it is a cloud of points"),
        ("v 0 0 0\nv 1 0 0\nl 1 2\n", "no faces: it is made of lines"),
        (
            "v 0 0 0\nv 1 0 0\nl 1 2\np 1\n",
            "no faces: it is made of points and lines",
        ),
        ("g a\n", "no faces; a mesh is expected"),
    ] {
        assert!(failure(text).contains(part), "{text}");
    }
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

/// A picture where the file does not say how it lies, which is told and not torn.
#[test]
fn pictures_without_texture_coordinates_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let picture =
        image::RgbImage::from_fn(2, 2, |x, y| image::Rgb([200 * x as u8, 90 * y as u8, 9]));
    picture.save(folder.path().join("a.png")).unwrap();
    let library = "newmtl a\nmap_Kd -colorspace sRGB a.png\nnewmtl plain\nKd 1 0 0\n";
    std::fs::write(folder.path().join("a.mtl"), library).unwrap();
    let read = |vertices: &str, face: &str| {
        let text = format!("mtllib a.mtl\n{vertices}usemtl a\n{face}\nusemtl plain\nf 1 2 3\n");
        read_text(&path, &text, SMOOTH).unwrap()
    };
    let whole = read(SQUARE, "f 1/1 2/2 3/3 4/4");
    assert_eq!((whole.notes, whole.textures.len()), (vec![], 1));
    let note = "vt: texture coordinates of a picture that are not there or no numbers: faces there are of one colour";
    for (vertices, face, line) in [
        (&SQUARE[..32], "f 1 2 3 4", 7),
        (SQUARE, "f 1 2 3 4", 11),
        (SQUARE, "f 1/1 2/2 3/3 4", 11),
        (SQUARE, "f 1/0/0 2/0/0 3/0/0 4/0/0", 11),
        (SQUARE, "f 1/1 2/2 3/7 4/4", 11),
        (
            &SQUARE.replace("vt 1 1", "vt nan 1"),
            "f 1/1 2/2 3/3 4/4",
            11,
        ),
        (&SQUARE.replace("vt 1 1", "vt x 1"), "f 1/1 2/2 3/3 4/4", 11),
    ] {
        let loaded = read(vertices, face);
        assert_eq!(
            loaded.notes,
            [format!("{}:{line}: {note}", path.display())],
            "{face}"
        );
        for (corners, material) in loaded
            .mesh
            .corner_looks
            .iter()
            .zip(&loaded.mesh.triangle_materials)
        {
            let [a, b, c] = corners.map(|look| loaded.mesh.looks[look as usize].uv[0]);
            assert!(*material == 1 || (a == b && b == c), "{face}");
        }
    }
}

/// Polypaint in comments goes by the vertices, the mask in front of it for nothing.
#[test]
fn colors_of_zbrush_are_read() {
    let text = format!(
        "{}#MRGB ffff0000000000ff7f00ff00\n#MRGB 00ffffff\n#MRGB 00fff\n#End of MRGB block\nf 1 2 3 4\n",
        &SQUARE[..32]
    );
    let loaded = read_text(Path::new("a.obj"), &text, SMOOTH).unwrap();
    let note = "a.obj:7: #MRGB: not used; eight digits a vertex are expected";
    assert_eq!(loaded.notes, [note]);
    let expected = [[1., 0., 0.], [0., 0., 1.], [0., 1., 0.], [1., 1., 1.]];
    let corners = loaded.mesh.triangles.iter().zip(&loaded.mesh.corner_looks);
    for (vertices, looks) in corners {
        for (vertex, look) in vertices.iter().zip(looks) {
            let place = loaded.mesh.positions[*vertex as usize];
            let number = match [place.x, place.y] {
                [0., 0.] => 0,
                [1., 0.] => 1,
                [1., 1.] => 2,
                _ => 3,
            };
            let color = loaded.mesh.looks[*look as usize].color;
            assert_eq!(color.truncate().to_array(), expected[number]);
        }
    }
    assert_eq!(loaded.materials, [Material::matt(DVec3::ONE)]);
}

#[test]
fn materials_come_from_the_mtl_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let mtl = folder.path().join("a.mtl");
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl matt\nf 1 2 3\nusemtl shiny\nf 1 4 2\nusemtl none\nf 1 3 4\n";
    let plain = Material::matt(DVec3::splat(0.5));
    let loaded = read_text(&path, text, SMOOTH).unwrap();
    assert_eq!(loaded.materials, [plain], "a missing file is no mistake");
    let told = |notes: &[&str]| -> Vec<String> {
        let place = |note: &&str| format!("{}:{note}", path.display());
        notes.iter().map(place).collect()
    };
    assert_eq!(
        loaded.notes,
        told(&[
            "1: mtllib: no such file as \"a.mtl\"",
            "6: usemtl: there are no materials; it is grey (and 2 more such)"
        ])
    );

    std::fs::write(
        &mtl,
        "newmtl matt\nKd .25 .5 1\nKs 0 0 0\nNs 96\nnewmtl shiny\nKs 1 1 1\nNs 98\n",
    )
    .unwrap();
    let loaded = read_text(&path, text, SMOOTH).unwrap();
    assert_eq!(loaded.mesh.triangle_materials, [0, 1, 2]);
    assert_eq!(loaded.material_names, ["matt", "shiny", ""]);
    assert_eq!(
        loaded.materials[0],
        Material::matt(DVec3::new(0.25, 0.5, 1.0))
    );
    assert!((loaded.materials[1].roughness.unwrap() - 0.02_f64.sqrt()).abs() < 1e-6);
    assert_eq!(loaded.materials[2], plain);
    let note = "10: usemtl: no material \"none\" in a.mtl; it is grey";
    assert_eq!(loaded.notes, told(&[note]));
}

#[test]
fn models_are_turned_upright_and_fitted() {
    let text = "v 0 0 0\nv 100 0 0\nv 0 400 0\nv 0 0 20\nvn 0 1 0\nv 9 9 9999\nf 1//1 3//1 2//1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let read = |up, fit_m| {
        let reading = MeshReading {
            up,
            fit_m,
            ..MeshReading::plain(SMOOTH)
        };
        read(
            Path::new("a.obj"),
            text.into(),
            (reading, None),
            (&|_| (), &|_| Ok(())),
        )
        .unwrap()
        .mesh
    };
    assert_eq!(read(Some(Up::Z), None), read(None, None));
    let upright = read(Some(Up::Y), Some(0.2));
    let close = |place: [f32; 3]| {
        let place = Vec3::from_array(place);
        upright
            .positions
            .iter()
            .any(|position| position.distance(place) < 1e-7)
    };
    assert!(close([0., 0., 0.2]) && close([0.05, 0., 0.]) && close([0., -0.01, 0.]));
    assert!(upright.corner_normals[0].contains(&Vec3::Z));
    assert!(upright.signed_volume_m3() > 0.0);
}

#[test]
fn models_that_memory_may_not_do_for_are_told() {
    assert_eq!(too_many(1_000_000), None);
    let said = too_many(3_374_802).expect("a note");
    assert!(
        said.contains("3.4 million") && said.contains("7 GB"),
        "{said}"
    );
}
