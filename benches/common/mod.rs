//! What the benches share: the peers' table with its caster, the torus, and times told as median, p10 and p90.
#![allow(dead_code)] // Each bench uses its own part.

use std::f32::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};
use gnomon::geometry::camera::Intrinsics;
use gnomon::geometry::mesh::{Mesh, RawTriangle};
use gnomon::light::{Light, Material};
use gnomon::scene::{Anchor, Object, Scene, ShadowSettings};

/// Where the lamp of the peers' scenes stands, metres in world space.
pub const LIGHT_M: DVec3 = DVec3::new(-0.35, 0.15, 0.6);
/// Where their torus floats.
pub const TORUS_CENTER_M: DVec3 = DVec3::new(0.06, -0.02, 0.06);
/// Frames before the first that counts, as many as the peers leave out.
pub const WARM_UP_FRAMES: usize = 10;

/// The size that everything has if nothing else is said.
pub const SIZE_PX: [u32; 2] = [640, 480];

/// The peers' camera for a picture of any size: the field of view is kept by height.
pub fn intrinsics(size_px: [u32; 2]) -> Intrinsics {
    let [width, height] = size_px.map(f64::from);
    Intrinsics {
        size_px,
        focal_px: DVec2::splat(650.0 * height / 480.0),
        // There a pixel's centre is at .5.
        center_px: DVec2::new(width, height) / 2.0 - 0.5,
        distortion: [0.0; 5],
    }
}

/// Where the peers' camera stands: x right, y down, z forward.
pub fn camera_from_world() -> DAffine3 {
    let (eye, target) = (DVec3::new(0.05, -0.55, 0.4), DVec3::new(0.0, 0.0, 0.03));
    let forward = (target - eye).normalize();
    let right = forward.cross(DVec3::Z).normalize();
    let world_from_camera = DAffine3::from_mat3_translation(
        DMat3::from_cols(right, forward.cross(right), forward),
        eye,
    );
    world_from_camera.inverse()
}

/// How the peers turn their caster about its own origin.
pub fn turn(frame: usize) -> DMat3 {
    let degrees = |degrees: usize| (degrees as f64).to_radians();
    DMat3::from_rotation_z(degrees(3 * frame)) * DMat3::from_rotation_x(degrees(2 * frame))
}

/// A scene whose virtual things turn in every frame, each on an anchor of its own.
pub struct Stage {
    pub scene: Scene,
    pub intrinsics: Intrinsics,
    /// Of the anchors after the world's, metres in world space.
    centers_m: Vec<DVec3>,
}

impl Stage {
    /// The peers' table and box, which cast no shadow there either, and the turning casters at their places.
    pub fn new(
        casters: Vec<(Mesh, DVec3)>,
        lights_m: &[DVec3],
        size_px: [u32; 2],
        samples: u32,
    ) -> Self {
        let anchor = |name: String| Anchor {
            name,
            markers: Vec::new(),
        };
        let mut scene = Scene {
            anchors: vec![anchor("world".to_owned())],
            phantoms: vec![
                object("plane", plane(), DVec3::new(0.6, 0.55, 0.5), 0, DVec3::ZERO),
                object(
                    "box",
                    cuboid(),
                    DVec3::new(0.3, 0.5, 0.3),
                    0,
                    DVec3::new(-0.1, 0.02, 0.0),
                ),
            ],
            lights: lights_m
                .iter()
                .map(|&position_m| Light::Point {
                    position_m,
                    intensity: DVec3::splat(0.7 / lights_m.len() as f64),
                })
                .collect(),
            ambient_radiance: DVec3::splat(0.05),
            shadows: ShadowSettings {
                samples,
                ..ShadowSettings::default()
            },
            ..Scene::default()
        };
        scene
            .phantoms
            .iter_mut()
            .for_each(|phantom| phantom.casts = false);
        let mut centers_m = Vec::new();
        for (index, (mesh, center_m)) in (1..).zip(casters) {
            let name = format!("caster {index}");
            scene.anchors.push(anchor(name.clone()));
            scene.virtuals.push(object(
                &name,
                mesh,
                DVec3::new(0.8, 0.25, 0.2),
                index,
                DVec3::ZERO,
            ));
            centers_m.push(center_m);
        }
        Self {
            scene,
            intrinsics: intrinsics(size_px),
            centers_m,
        }
    }

    /// `camera_from_anchor` of all anchors.
    pub fn poses(&self, frame: usize) -> Vec<Option<DAffine3>> {
        let camera_from_world = camera_from_world();
        let turned = |&center_m: &DVec3| {
            Some(camera_from_world * DAffine3::from_mat3_translation(turn(frame), center_m))
        };
        std::iter::once(Some(camera_from_world))
            .chain(self.centers_m.iter().map(turned))
            .collect()
    }

    /// Triangles of one caster.
    pub fn triangles(&self) -> usize {
        self.scene
            .virtuals
            .first()
            .map_or(0, |caster| caster.mesh.triangles.len())
    }
}

fn object(name: &str, mesh: Mesh, albedo: DVec3, anchor: usize, position_m: DVec3) -> Object {
    let mesh_report = Default::default();
    Object {
        name: name.to_owned(),
        mesh,
        mesh_report,
        materials: vec![Material {
            albedo,
            roughness: None,
        }],
        anchor,
        anchor_from_object: DAffine3::from_translation(position_m),
        casts: true,
        visible: true,
    }
}

/// A mesh as the program's own loader makes it where the file has no normals.
fn mesh(positions: &[Vec3], triangles: impl IntoIterator<Item = [u32; 3]>) -> Mesh {
    let raw: Vec<RawTriangle> = triangles
        .into_iter()
        .map(|vertices| RawTriangle {
            vertices,
            normals: [None; 3],
            material: 0,
        })
        .collect();
    Mesh::weld(positions, &raw, 30_f64.to_radians()).0
}

fn plane() -> Mesh {
    let corner = |x, y| Vec3::new(x, y, 0.0);
    mesh(
        &[
            corner(-0.4, -0.4),
            corner(0.4, -0.4),
            corner(0.4, 0.4),
            corner(-0.4, 0.4),
        ],
        [[0, 1, 2], [0, 2, 3]],
    )
}

fn cuboid() -> Mesh {
    let corners: Vec<Vec3> = (0..8)
        .map(|corner| {
            Vec3::new(
                (corner & 1) as f32,
                (corner >> 1 & 1) as f32,
                (corner >> 2) as f32,
            )
        })
        .map(|unit| unit * Vec3::new(0.06, 0.06, 0.08) - Vec3::new(0.03, 0.03, 0.0))
        .collect();
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    mesh(
        &corners,
        sides
            .into_iter()
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]),
    )
}

/// A closed torus about z with radii 5 and 2 cm times `scale` and about as many triangles as asked for.
pub fn torus(triangles: usize, scale: f32) -> Mesh {
    let around = ((triangles as f64).sqrt().round() as u32).max(6);
    let across = (around / 2).max(3);
    let vertices: Vec<Vec3> = (0..around * across)
        .map(|index| {
            let angle = TAU * (index / across) as f32 / around as f32;
            let turn = TAU * (index % across) as f32 / across as f32;
            let radius = 0.05 + 0.02 * turn.cos();
            scale
                * Vec3::new(
                    radius * angle.cos(),
                    radius * angle.sin(),
                    0.02 * turn.sin(),
                )
        })
        .collect();
    let at = |i: u32, j: u32| i % around * across + j % across;
    let quads = (0..around * across).map(|index| (index / across, index % across));
    mesh(
        &vertices,
        quads.flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        }),
    )
}

/// A folder beside the project's, with the peers and their models; a clone alone has none.
pub fn shared_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared")
}

/// The triangles of an OBJ file, its normals made anew.
pub fn read_obj(path: &Path) -> Result<Mesh> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ..Default::default()
    };
    let (models, _) = tobj::load_obj(path, &options).with_context(|| path.display().to_string())?;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for model in models {
        let first = positions.len() as u32;
        positions.extend(model.mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        triangles.extend(
            model
                .mesh
                .indices
                .chunks_exact(3)
                .map(|corners| [0, 1, 2].map(|corner| first + corners[corner])),
        );
    }
    Ok(mesh(&positions, triangles))
}

/// What many frames took, milliseconds.
#[derive(Debug, Clone, Copy)]
pub struct Times {
    pub median_ms: f64,
    pub p10_ms: f64,
    pub p90_ms: f64,
}

impl Times {
    /// Of at least one frame.
    pub fn of(mut frames_ms: Vec<f64>) -> Self {
        frames_ms.sort_by(f64::total_cmp);
        let at = |tenths: usize| frames_ms[frames_ms.len() * tenths / 10];
        Self {
            median_ms: at(5),
            p10_ms: at(1),
            p90_ms: at(9),
        }
    }
}

/// How many frames, off the command line.
///
/// # Errors
/// Anything but a whole number above zero.
pub fn at_least_one(written: &str) -> Result<usize, String> {
    match written.parse() {
        Ok(frames) if frames > 0 => Ok(frames),
        _ => Err("allowed: 1, 2, …".to_owned()),
    }
}

/// Rows for a file, where one is asked for.
pub struct Csv {
    path: Option<PathBuf>,
    text: String,
}

impl Csv {
    pub fn new(path: Option<PathBuf>, header: &str) -> Self {
        Self {
            path,
            text: format!("{header}\n"),
        }
    }

    pub fn row(&mut self, fields: &[&dyn std::fmt::Display]) {
        for (index, field) in fields.iter().enumerate() {
            // Writing to a string cannot fail.
            let _ = write!(self.text, "{}{field}", if index == 0 { "" } else { "," });
        }
        self.text.push('\n');
    }

    pub fn finish(self) -> Result<()> {
        match self.path {
            Some(path) => {
                std::fs::write(&path, self.text).with_context(|| path.display().to_string())
            }
            None => Ok(()),
        }
    }
}
