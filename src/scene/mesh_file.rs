//! Reads OBJ meshes with their MTL materials. Textures are not read, a polygon is cut into a fan (so it should be
//! convex), and Kd is taken as it stands: linear reflectance.

use std::cell::RefCell;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::error::SceneError;
use super::gltf;
use super::material_libraries::libraries;
use super::named_files::FileKind;
use super::obj_scan::{ScanError, ScannedObj, scan_mtl, scan_obj};
use super::plain_file::{self, MOST_MESH, MOST_TEXT};
use super::reader::Value;
use crate::geometry::mesh::{Mesh, MeshReport, RawTriangle};
use crate::light::Material;
use crate::light::texture::Texture;

/// Diffuse reflectance where neither the scene nor a mesh's MTL file gives one.
pub const DEFAULT_ALBEDO: f64 = 0.5;

/// A mesh, what was done to it, and its materials (never none).
#[derive(Debug)]
pub struct LoadedMesh {
    pub mesh: Mesh,
    pub report: MeshReport,
    pub materials: Vec<Material>,
    /// For each of them whether a file gives it.
    pub is_given: Vec<bool>,
    /// What the materials' maps name.
    pub textures: Vec<Arc<Texture>>,
    /// What of the file is passed over or taken for something else, one sentence each.
    pub notes: Vec<String>,
}

/// Where a mesh's normals come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Normals {
    /// From the triangles alone.
    Flat,
    /// From the file, and where it has none made within a crease angle.
    GivenOrMade { crease_rad: f64 },
}

/// The axis of a file that points upwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Up {
    /// As glTF has it; it becomes the scene's z.
    Y,
    /// As the scene has it.
    Z,
}

/// Smoothest surface that is kept apart from a mirror.
pub const LEAST_ROUGHNESS: f64 = 0.01;

/// Reads the mesh that a scene's value names.
pub fn load(value: &Value, kind: FileKind, normals: Normals) -> Result<LoadedMesh, SceneError> {
    let path = value.existing_path(kind)?;
    let bytes = plain_file::read(&path, MOST_MESH)
        .map_err(|error| value.error(format!("the mesh cannot be read: {error}")))?;
    if gltf::is_gltf(&path, &bytes) {
        let note_read = |path: &Path| value.note_consulted(path);
        return gltf::load(&path, &bytes, (normals, Up::Y), &note_read)
            .map_err(|error| of_scene(error, value));
    }
    // Only names and comments may be in another encoding, and nothing depends on them.
    let note_read = |path: &Path| value.note_consulted(path);
    read(&path, &String::from_utf8_lossy(&bytes), normals, &note_read)
        .map_err(|error| of_scene(error, value))
}

/// A mesh's error with the place that names the mesh.
fn of_scene(mut error: SceneError, value: &Value) -> SceneError {
    error.message += &format!(" (a mesh of {})", value.location());
    error
}

/// `note_read` is told of every file that is looked for besides.
fn read(
    path: &Path,
    text: &str,
    normals: Normals,
    note_read: &dyn Fn(&Path),
) -> Result<LoadedMesh, SceneError> {
    let misread = |ScanError { span, message }| SceneError::at(path, text, span, message);
    if text.trim().is_empty() {
        return Err(SceneError::of_file(
            path,
            "the file is empty; an OBJ mesh is expected",
        ));
    }
    let scanned = scan_obj(text).map_err(misread)?;
    if scanned.corner_has_normal.is_empty() {
        return Err(SceneError::of_file(
            path,
            "no faces; an OBJ mesh with f records is expected",
        ));
    }
    let (models, mtl_materials) = read_with_tobj(path, &scanned, note_read)?;

    let mut builder = Builder::default();
    for model in &models {
        builder.add(
            &model.mesh,
            &scanned.corner_has_normal,
            &mtl_materials,
            normals,
        );
    }
    let crease_rad = match normals {
        Normals::Flat => 0.0,
        Normals::GivenOrMade { crease_rad } => crease_rad,
    };
    let (mesh, report) = Mesh::weld(&builder.positions, &builder.triangles, crease_rad);
    if mesh.triangles.is_empty() {
        return Err(SceneError::of_file(
            path,
            "no triangle has an area; an OBJ mesh is expected",
        ));
    }
    Ok(LoadedMesh {
        mesh,
        report,
        materials: builder.materials,
        is_given: builder.is_given,
        textures: Vec::new(),
        notes: Vec::new(),
    })
}

fn read_with_tobj(
    path: &Path,
    scanned: &ScannedObj,
    note_read: &dyn Fn(&Path),
) -> Result<(Vec<tobj::Model>, Vec<tobj::Material>), SceneError> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let mtl_error = RefCell::new(None);
    let folder = path.parent().unwrap_or(Path::new(""));
    let load_mtl = |names: &Path| {
        let (mut materials, mut numbers) = tobj::load_mtl_buf(&mut Cursor::new(""))?;
        for library in libraries(folder, &names.to_string_lossy()) {
            note_read(&library);
            match checked_mtl(&library) {
                Ok(text) => {
                    let (more, names) = tobj::load_mtl_buf(&mut Cursor::new(text))?;
                    let known = materials.len();
                    numbers.extend(
                        names
                            .into_iter()
                            .map(|(name, number)| (name, known + number)),
                    );
                    materials.extend(more);
                }
                Err(error) => {
                    mtl_error.borrow_mut().get_or_insert(error);
                }
            }
        }
        Ok((materials, numbers))
    };
    let loaded = tobj::load_obj_buf(&mut Cursor::new(&scanned.text), &options, load_mtl);
    if let Some(error) = mtl_error.into_inner() {
        return Err(error);
    }
    let (models, materials) =
        loaded.map_err(|error| SceneError::of_file(path, format!("not a mesh: {error}")))?;
    let materials = materials
        .map_err(|error| SceneError::of_file(path, format!("a material file of it: {error}")))?;
    Ok((models, materials))
}

/// An MTL file's text; empty where there is no such file, for meshes often travel without.
fn checked_mtl(path: &PathBuf) -> Result<String, SceneError> {
    let bytes = match plain_file::read(path, MOST_TEXT) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(String::new()),
        Err(error) => {
            return Err(SceneError::of_file(
                path,
                format!("the material file cannot be read: {error}"),
            ));
        }
    };
    let text = String::from_utf8_lossy(&bytes).into_owned();
    match scan_mtl(&text) {
        Ok(()) => Ok(text),
        Err(ScanError { span, message }) => Err(SceneError::at(path, &text, span, message)),
    }
}

/// Puts tobj's models, one for each run of a material, back together.
#[derive(Default)]
struct Builder {
    positions: Vec<Vec3>,
    triangles: Vec<RawTriangle>,
    materials: Vec<Material>,
    /// tobj's number of each of `materials`.
    material_ids: Vec<Option<usize>>,
    is_given: Vec<bool>,
}

impl Builder {
    fn add(
        &mut self,
        mesh: &tobj::Mesh,
        corner_has_normal: &[[bool; 3]],
        mtl_materials: &[tobj::Material],
        normals: Normals,
    ) {
        if mesh.indices.is_empty() {
            return;
        }
        let material = self.material(mesh.material_id, mtl_materials);
        let first = self.positions.len() as u32;
        self.positions
            .extend(mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        for (number, corners) in mesh.indices.chunks_exact(3).enumerate() {
            let has_normal = corner_has_normal
                .get(self.triangles.len())
                .copied()
                .unwrap_or_default();
            let given = |corner: usize| {
                if normals == Normals::Flat || !has_normal[corner] {
                    return None;
                }
                let index = *mesh.normal_indices.get(3 * number + corner)? as usize;
                mesh.normals
                    .get(3 * index..3 * index + 3)
                    .map(Vec3::from_slice)
            };
            self.triangles.push(RawTriangle {
                vertices: [corners[0], corners[1], corners[2]].map(|corner| first + corner),
                normals: std::array::from_fn(given),
                material,
            });
        }
    }

    fn material(&mut self, id: Option<usize>, mtl_materials: &[tobj::Material]) -> u32 {
        let known = self.material_ids.iter().position(|known| *known == id);
        let index = known.unwrap_or_else(|| {
            self.material_ids.push(id);
            let mtl = id.and_then(|id| mtl_materials.get(id));
            self.is_given.push(mtl.is_some());
            self.materials.push(material(mtl));
            self.materials.len() - 1
        });
        index as u32
    }
}

/// The material that an MTL file describes. Its gloss comes from `Pr` (squared, as is usual) or else from `Ns`, unless
/// `Ks` is black: roughness² = 2 / (Ns + 2), which gives Blinn's lobe and GGX's the same width.
fn material(mtl: Option<&tobj::Material>) -> Material {
    let albedo = mtl
        .and_then(|mtl| mtl.diffuse)
        .map(|kd| DVec3::from_array(kd.map(f64::from)));
    let roughness = mtl.and_then(|mtl| {
        let pr = mtl
            .unknown_param
            .get("Pr")
            .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
        let shiny = mtl
            .specular
            .is_none_or(|ks| ks.iter().any(|&channel| channel > 0.0));
        let ns = mtl
            .shininess
            .filter(|_| shiny)
            .map(|ns| (2.0 / (f64::from(ns) + 2.0)).sqrt());
        pr.map(|pr| pr * pr).or(ns)
    });
    Material {
        roughness: roughness.map(|roughness| roughness.clamp(LEAST_ROUGHNESS, 1.0)),
        ..Material::matt(albedo.unwrap_or(DVec3::splat(DEFAULT_ALBEDO)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::SIDES;

    const SMOOTH: Normals = Normals::GivenOrMade { crease_rad: 0.5 };

    fn failure(text: &str) -> String {
        read(Path::new("bad.obj"), text, SMOOTH, &|_| ())
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn normals_come_from_the_file_where_it_has_them() {
        let text =
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0 3 4\nvn 0 0 0\nf 1//1 2//2 3\nf 2 4 3//-2\n";
        let loaded = read(Path::new("a.obj"), text, SMOOTH, &|_| ()).unwrap();
        let given = Vec3::new(0.0, 0.6, 0.8);
        assert_eq!(
            loaded.mesh.corner_normals,
            [[given, Vec3::Z, Vec3::Z], [Vec3::Z, Vec3::Z, given]]
        );
        assert_eq!(loaded.materials, [Material::matt(DVec3::splat(0.5))]);
        let flat = read(Path::new("a.obj"), text, Normals::Flat, &|_| ()).unwrap();
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
        let loaded = read(Path::new("box.obj"), &text, SMOOTH, &|_| ()).unwrap();
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
        assert!(
            failure("v 0 0 0\nv 1 0 0\nv 0 NaN 0\nf 1 2 3\n")
                .starts_with("bad.obj:3:5: v: NaN is not a finite number")
        );
    }

    #[test]
    fn materials_come_from_the_mtl_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        let mtl = folder.path().join("a.mtl");
        let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl matt\nf 1 2 3\nusemtl shiny\nf 1 4 2\nusemtl none\nf 1 3 4\n";
        let plain = Material::matt(DVec3::splat(0.5));
        assert_eq!(
            read(&path, text, SMOOTH, &|_| ()).unwrap().materials,
            [plain],
            "a missing file is no mistake"
        );

        std::fs::write(
            &mtl,
            "newmtl matt\nKd .25 .5 1\nKs 0 0 0\nNs 96\nnewmtl shiny\nKs 1 1 1\nNs 98\n",
        )
        .unwrap();
        let loaded = read(&path, text, SMOOTH, &|_| ()).unwrap();
        assert_eq!(loaded.mesh.triangle_materials, [0, 1, 2]);
        assert_eq!(
            loaded.materials[0],
            Material::matt(DVec3::new(0.25, 0.5, 1.0))
        );
        assert!((loaded.materials[1].roughness.unwrap() - 0.02_f64.sqrt()).abs() < 1e-6);
        assert_eq!(loaded.materials[2], plain);

        std::fs::write(&mtl, "newmtl matt\nKd .25 .5\n").unwrap();
        let message = read(&path, text, SMOOTH, &|_| ()).unwrap_err().to_string();
        assert!(
            message.contains("a.mtl:2:1: Kd: 2 numbers; 3 are expected"),
            "{message}"
        );
    }
}
