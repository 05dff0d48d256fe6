//! Reads `[[phantom]]`, `[[virtual]]` and `[table]`.

use std::collections::HashMap;

use glam::{DAffine3, DVec3, Vec3};

use super::anchors::{ANGLE, unique_name};
use super::error::{SceneError, suggestion};
use super::lights::POSITION;
use super::mesh_file::{self, DEFAULT_ALBEDO, LoadedMesh};
use super::named_files::FileKind;
use super::reader::{Numbers, Table, Value};
use super::{Anchor, Object, Placement};
use crate::geometry::mesh::{Mesh, RawTriangle};
use crate::light::Material;

pub const ALBEDO: Numbers = Numbers::between(0.0, 1.0, "");
const ROUGHNESS: Numbers = Numbers::above(0.0, 1.0, "");
const CREASE: Numbers = Numbers::between(0.0, 180.0, "degrees");
const DEFAULT_CREASE_DEG: f64 = 30.0;
/// Size of a scale's number; its sign is free.
const SCALE: Numbers = Numbers::between(1e-6, 1e6, "in size; a negative one mirrors");

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Phantom,
    Virtual,
}

/// The phantoms, the table top first, and the virtual things.
pub fn objects(root: &Table, anchors: &[Anchor]) -> Result<(Vec<Object>, Vec<Object>), SceneError> {
    const KEYS: [&str; 11] = [
        "name",
        "mesh",
        "rect_m",
        "on",
        "position_m",
        "rotation_deg",
        "scale",
        "material",
        "casts",
        "visible",
        "smooth_deg",
    ];
    let shape_keys = |without: &str| {
        KEYS.into_iter()
            .filter(|key| *key != without)
            .collect::<Vec<_>>()
    };
    let mut name_lines = HashMap::new();
    let mut phantoms = Vec::new();
    if let Some(table) = root.optional("table") {
        name_lines.insert("table".to_owned(), table.line());
        phantoms.push(table_top(&table)?);
    }
    for table in root.tables("phantom", &shape_keys("smooth_deg"))? {
        phantoms.push(object(&table, Kind::Phantom, anchors, &mut name_lines)?);
    }
    let mut virtuals = Vec::new();
    for table in root.tables("virtual", &shape_keys("rect_m"))? {
        virtuals.push(object(&table, Kind::Virtual, anchors, &mut name_lines)?);
    }
    Ok((phantoms, virtuals))
}

fn table_top(value: &Value) -> Result<Object, SceneError> {
    let table = value.table(&["rect_m", "height_m", "albedo", "visible"])?;
    let rect = table.required("rect_m", "[x0, y0, x1, y1] in metres is expected")?;
    let albedo = table
        .optional("albedo")
        .map(|value| value.splat_or_vector(&ALBEDO))
        .transpose()?;
    let height_m = table.number_or("height_m", 0.0, &POSITION)?;
    let LoadedMesh {
        mesh,
        report,
        materials,
        ..
    } = rectangle(&rect, albedo)?;
    Ok(Object {
        name: "table".to_owned(),
        mesh,
        mesh_report: report,
        materials,
        anchor: 0,
        anchor_from_object: DAffine3::from_translation(DVec3::Z * height_m),
        casts: false,
        visible: table.flag_or("visible", true)?,
    })
}

fn object(
    table: &Table,
    kind: Kind,
    anchors: &[Anchor],
    name_lines: &mut HashMap<String, usize>,
) -> Result<Object, SceneError> {
    let name = unique_name(table, name_lines)?;
    let anchor = table
        .optional("on")
        .map_or(Ok(0), |on| anchor_index(&on, anchors))?;
    let anchor_from_object = placement(table)?.anchor_from_object();
    let casts = table.flag_or("casts", true)?;
    let visible = table.flag_or("visible", true)?;
    let crease_deg = table.number_or("smooth_deg", DEFAULT_CREASE_DEG, &CREASE)?;
    let normals = match kind {
        // What a phantom's triangles catch and cast has to agree with how they face, so they are flat.
        Kind::Phantom => mesh_file::Normals::Flat,
        Kind::Virtual => mesh_file::Normals::GivenOrMade {
            crease_rad: crease_deg.to_radians(),
        },
    };
    let loaded = match (table.optional("mesh"), table.optional("rect_m")) {
        (Some(_), Some(rect)) => {
            return Err(rect.error("the thing has a mesh; allowed: mesh or rect_m, not both"));
        }
        (Some(mesh), None) => mesh_file::load(&mesh, FileKind::Mesh, normals)?,
        (None, Some(rect)) => rectangle(&rect, None)?,
        (None, None) if kind == Kind::Phantom => {
            return Err(table.error(format!("\"{name}\": no shape; mesh or rect_m is expected")));
        }
        (None, None) => return Err(table.error(format!("\"{name}\": no shape; mesh is expected"))),
    };
    let mut materials = loaded.materials;
    if let Some(material) = table.table("material", &["albedo", "roughness"])? {
        override_materials(&mut materials, &material)?;
    }
    // A mirror turns each triangle's winding; turning it back keeps the outside outside.
    let mirrored = anchor_from_object.matrix3.determinant() < 0.0;
    let mesh = if mirrored {
        loaded.mesh.with_winding_reversed()
    } else {
        loaded.mesh
    };
    Ok(Object {
        name,
        mesh,
        mesh_report: loaded.report,
        materials,
        anchor,
        anchor_from_object,
        casts,
        visible,
    })
}

fn anchor_index(on: &Value, anchors: &[Anchor]) -> Result<usize, SceneError> {
    let written = on.text()?;
    anchors
        .iter()
        .position(|anchor| anchor.name == written)
        .ok_or_else(|| {
            let names: Vec<&str> = anchors.iter().map(|anchor| anchor.name.as_str()).collect();
            on.error(format!(
                "no board or marker has this name{}",
                suggestion(written, &names)
            ))
        })
}

/// Where a thing stands.
pub fn placement(table: &Table) -> Result<Placement, SceneError> {
    let default = Placement::default();
    Ok(Placement {
        position_m: table.vector_or("position_m", default.position_m, &POSITION)?,
        rotation_deg: table.vector_or("rotation_deg", default.rotation_deg, &ANGLE)?,
        scale: table
            .optional("scale")
            .map_or(Ok(default.scale), |value| scale(&value))?,
    })
}

fn scale(value: &Value) -> Result<DVec3, SceneError> {
    let written = value.splat_or_vector(&Numbers::between(-SCALE.most, SCALE.most, ""))?;
    if written.abs().min_element() < SCALE.least {
        return Err(value.error(format!("out of range; allowed: {SCALE}")));
    }
    Ok(written)
}

/// Each key that the scene gives replaces that of every material of the mesh.
fn override_materials(materials: &mut [Material], table: &Table) -> Result<(), SceneError> {
    if let Some(value) = table.optional("albedo") {
        let albedo = value.splat_or_vector(&ALBEDO)?;
        materials
            .iter_mut()
            .for_each(|material| material.albedo = albedo);
    }
    if let Some(value) = table.optional("roughness") {
        let roughness = value.number(&ROUGHNESS)?;
        materials
            .iter_mut()
            .for_each(|material| material.roughness = Some(roughness));
    }
    Ok(())
}

/// A flat rectangle in the plane z = 0 that faces +z.
fn rectangle(value: &Value, albedo: Option<DVec3>) -> Result<LoadedMesh, SceneError> {
    let [x0, y0, x1, y1] = value
        .numbers::<4>(&POSITION)?
        .map(|coordinate| coordinate as f32);
    if x0 >= x1 || y0 >= y1 {
        return Err(value.error("no area; allowed: [x0, y0, x1, y1] with x0 < x1 and y0 < y1"));
    }
    let positions = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Vec3::new(x, y, 0.0));
    let triangles = [[0, 1, 2], [0, 2, 3]].map(|vertices| RawTriangle {
        vertices,
        normals: [None; 3],
        material: 0,
    });
    let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
    if mesh.triangles.len() < 2 {
        return Err(value.error(
            "too thin to have an area; allowed: [x0, y0, x1, y1] with x0 < x1 and y0 < y1",
        ));
    }
    let albedo = albedo.unwrap_or(DVec3::splat(DEFAULT_ALBEDO));
    Ok(LoadedMesh {
        mesh,
        report,
        materials: vec![Material {
            albedo,
            roughness: None,
        }],
        is_given: vec![true],
    })
}
