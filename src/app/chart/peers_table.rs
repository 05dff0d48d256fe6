//! The table that shadow programs are compared on, with a caster that turns in every frame: a plane, a box, a lamp.

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};

use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::cuboid;
use crate::geometry::mesh::{Mesh, RawTriangle};
use crate::light::{Light, Material};
use crate::scene::{Anchor, Bounces, Object, Scene, ShadowSettings, ShapeKind};

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
        distortion: Distortion::NONE,
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
pub struct PeersStage {
    /// Phantoms on the first anchor, each virtual thing on one of its own.
    pub scene: Scene,
    /// Of the camera.
    pub intrinsics: Intrinsics,
    /// Of the anchors after the world's, metres in world space.
    centers_m: Vec<DVec3>,
}

impl PeersStage {
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
                .map(|&position_m| {
                    let intensity = DVec3::splat(0.7 / lights_m.len() as f64);
                    Light::point(position_m, intensity).into()
                })
                .collect(),
            ambient_radiance: DVec3::splat(0.05),
            bounces: Bounces::Auto,
            shadows: ShadowSettings {
                samples,
                ambient_samples: 0,
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

    /// `camera_from_anchor` of all anchors, from where the peers look.
    pub fn poses(&self, frame: usize) -> Vec<Option<DAffine3>> {
        self.poses_from(camera_from_world(), frame)
    }

    /// The same from anywhere.
    pub fn poses_from(&self, camera_from_world: DAffine3, frame: usize) -> Vec<Option<DAffine3>> {
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
        shape: ShapeKind::Mesh,
        mesh: Arc::new(mesh),
        mesh_report,
        materials: vec![Material::matt(albedo)],
        material_names: Vec::new(),
        textures: Vec::new(),
        notes: Vec::new(),
        anchor,
        motion: None,
        clips: Vec::new(),
        animation: None,
        anchor_from_object: DAffine3::from_translation(position_m),
        casts: true,
        visible: true,
    }
}

/// A mesh as the program's own loader makes it where the file has no normals.
pub fn mesh(positions: &[Vec3], triangles: impl IntoIterator<Item = [u32; 3]>) -> Mesh {
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
    let (corners, triangles) = cuboid::cuboid(Vec3::ZERO, Vec3::ONE);
    let placed = |unit: Vec3| unit * Vec3::new(0.06, 0.06, 0.08) - Vec3::new(0.03, 0.03, 0.0);
    let corners: Vec<Vec3> = corners.into_iter().map(placed).collect();
    mesh(&corners, triangles)
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
