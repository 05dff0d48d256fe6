//! What several tests need: scenes from the stability rows, a device, and masks held against exact ones.
#![allow(dead_code)] // Each test binary uses its own part.

pub mod ray_cast;

use std::path::Path;
use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DMat3, DMat4, DVec2, DVec3, Vec3};
use gnomon::geometry::camera::Intrinsics;
use gnomon::geometry::mesh::{Mesh, MeshReport};
use gnomon::light::{Light, Material};
use gnomon::render::Gpu;
use gnomon::scene::{Anchor, Object, Scene, ShadowSettings, Technique};
use serde_json::Value;

/// One device for all tests of a binary.
pub fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    Arc::clone(GPU.get_or_init(|| Arc::new(Gpu::open(None).expect("a Vulkan driver"))))
}

/// A file of the project.
pub fn project_file(path: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The material of things whose colour does not matter.
pub const GREY: Material = Material {
    albedo: DVec3::splat(0.5),
    roughness: None,
};

/// A mesh with flat normals and one material.
pub fn flat_mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    let corner_normals = triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|index| positions[index as usize]);
            [(b - a).cross(c - a).normalize_or_zero(); 3]
        })
        .collect();
    let triangle_materials = vec![0; triangles.len()];
    Mesh {
        positions,
        triangles,
        corner_normals,
        triangle_materials,
    }
}

/// A mesh from the `v` and `f` lines of an OBJ file.
pub fn read_obj(path: &Path) -> Mesh {
    let (models, _) = tobj::load_obj(
        path,
        &tobj::LoadOptions {
            triangulate: true,
            ..Default::default()
        },
    )
    .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for model in models {
        let first = positions.len() as u32;
        positions.extend(model.mesh.positions.chunks(3).map(Vec3::from_slice));
        triangles.extend(
            model
                .mesh
                .indices
                .chunks(3)
                .map(|t| [first + t[0], first + t[1], first + t[2]]),
        );
    }
    flat_mesh(positions, triangles)
}

/// An object on the world's anchor.
pub fn object(name: &str, mesh: Mesh, albedo: DVec3, world_from_object: DAffine3) -> Object {
    Object {
        name: name.to_owned(),
        mesh,
        mesh_report: MeshReport::default(),
        materials: vec![Material {
            albedo,
            roughness: None,
        }],
        anchor: 0,
        anchor_from_object: world_from_object,
        casts: true,
    }
}

/// A scene of four samples whose world is the only anchor.
pub fn scene(
    phantoms: Vec<Object>,
    virtuals: Vec<Object>,
    lights: Vec<Light>,
    ambient: f64,
) -> Scene {
    Scene {
        anchors: vec![Anchor {
            name: "world".to_owned(),
            markers: Vec::new(),
        }],
        phantoms,
        virtuals,
        lights,
        ambient_radiance: DVec3::splat(ambient),
        shadows: ShadowSettings {
            technique: Technique::Auto,
            samples: 4,
            ..ShadowSettings::default()
        },
        ..Scene::default()
    }
}

/// A row of `tests/stability`: a scene, its camera, and the exact mask.
pub struct StabilityRow {
    pub scene: Scene,
    pub intrinsics: Intrinsics,
    pub camera_from_world: DAffine3,
    /// As the README there defines it: id + 4 · bits.
    pub exact: Vec<u8>,
}

/// Reads `FOLDER/NAME.json` and its exact mask.
pub fn stability_row(folder: &Path, name: &str) -> StabilityRow {
    let text = std::fs::read_to_string(folder.join(format!("{name}.json"))).expect("a row");
    let row: Value = serde_json::from_str(&text).expect("JSON");
    let k = |i: usize, j: usize| row["camera"]["K"][i][j].as_f64().expect("K");
    let intrinsics = Intrinsics {
        size_px: [
            row["width"].as_u64().expect("width") as u32,
            row["height"].as_u64().expect("height") as u32,
        ],
        focal_px: DVec2::new(k(0, 0), k(1, 1)),
        // There a pixel's centre is at .5.
        center_px: DVec2::new(k(0, 2), k(1, 2)) - 0.5,
        distortion: [0.0; 5],
    };
    let objects = |key: &str| {
        let list = row[key].as_array().expect("objects");
        list.iter()
            .enumerate()
            .map(|(index, o)| {
                let obj = folder.join(o["obj"].as_str().expect("obj"));
                let pose = o.get("transform").map_or(DAffine3::IDENTITY, affine);
                object(
                    &format!("{key} {index}"),
                    read_obj(&obj),
                    vector(&o["albedo"]),
                    pose,
                )
            })
            .collect()
    };
    let lights = row["lights"]
        .as_array()
        .expect("lights")
        .iter()
        .map(|l| Light::Point {
            position_m: vector(&l["position"]),
            intensity: vector(&l["intensity"]),
        })
        .collect();
    let exact = image::open(folder.join(format!("{name}_exact.png")))
        .expect("the exact mask")
        .to_luma8();
    StabilityRow {
        scene: scene(objects("phantoms"), objects("virtuals"), lights, 0.05),
        intrinsics,
        camera_from_world: affine(&row["camera"]["world_to_camera"]),
        exact: exact.into_raw(),
    }
}

/// An affine map from a row-major 4x4 matrix.
pub fn affine(matrix: &Value) -> DAffine3 {
    let at = |i: usize, j: usize| matrix[i][j].as_f64().expect("a matrix");
    let transposed = DMat4::from_cols_array(&std::array::from_fn(|index| at(index % 4, index / 4)));
    DAffine3 {
        matrix3: DMat3::from_mat4(transposed),
        translation: transposed.w_axis.truncate(),
    }
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|index| {
        value[index].as_f64().expect("a vector")
    }))
}
