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
    assert!(
        fbx.contains("an FBX file is not read; allowed: glTF, OBJ, PLY, STL"),
        "{fbx}"
    );
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
