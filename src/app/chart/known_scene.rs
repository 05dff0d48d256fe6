//! Scenes whose shadows are known exactly: one frame as JSON, and the mask that rays gave
//! (`tests/stability/README.md` defines both).

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use glam::{DAffine3, DVec2, DVec3};
use serde::Deserialize;
use serde_json::Value;

use crate::app::truth::affine;
use crate::app::truth::ray_cast::{Triangle, View, World};
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::light::{Light, Shape};
use crate::render::{REAL, VIRTUAL};
use crate::scene::{Object, Scene, plain_file};

/// A scene and its exact mask.
pub struct KnownScene {
    /// The real things.
    pub phantoms: Vec<PlacedMesh>,
    /// The virtual things.
    pub virtuals: Vec<PlacedMesh>,
    /// Its point light.
    pub lights: Vec<Light>,
    /// A pixel's integer coordinate is its centre, here as everywhere.
    pub intrinsics: Intrinsics,
    /// Where the camera stands.
    pub camera_from_world: DAffine3,
    /// id + 4 · bits for each pixel.
    pub exact: Vec<u8>,
}

/// A mesh at its place.
pub struct PlacedMesh {
    /// Its OBJ file.
    pub mesh: PathBuf,
    /// Rotation and translation.
    pub world_from_object: DAffine3,
}

/// Radiance of what little light comes from all around.
pub const AMBIENT: f64 = 0.05;

#[derive(Deserialize)]
struct File {
    width: u32,
    height: u32,
    camera: Camera,
    phantoms: Vec<ThingEntry>,
    virtuals: Vec<ThingEntry>,
    lights: Vec<Lamp>,
}

#[derive(Deserialize)]
struct Camera {
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    world_to_camera: Value,
}

#[derive(Deserialize)]
struct ThingEntry {
    obj: String,
    transform: Option<Value>,
}

#[derive(Deserialize)]
struct Lamp {
    position: [f64; 3],
    intensity: [f64; 3],
}

impl KnownScene {
    /// Reads `NAME.json` and `NAME_exact.png` of a folder.
    ///
    /// # Errors
    /// One of them is not there or not what it should be.
    pub fn read(folder: &Path, name: &str) -> Result<Self> {
        let path = folder.join(format!("{name}.json"));
        let text = plain_file::read_text(&path).with_context(|| path.display().to_string())?;
        let file: File = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        let place = |thing: &ThingEntry| {
            let transform = thing.transform.as_ref();
            let pose = transform.map_or(Ok(DAffine3::IDENTITY), affine);
            Ok(PlacedMesh {
                mesh: folder.join(&thing.obj),
                world_from_object: pose.with_context(|| path.display().to_string())?,
            })
        };
        let k = file.camera.k;
        let mask = folder.join(format!("{name}_exact.png"));
        let exact = image::open(&mask).with_context(|| mask.display().to_string())?;
        Ok(Self {
            phantoms: file.phantoms.iter().map(place).collect::<Result<_>>()?,
            virtuals: file.virtuals.iter().map(place).collect::<Result<_>>()?,
            lights: file
                .lights
                .iter()
                .map(|lamp| Light::Point {
                    position_m: DVec3::from_array(lamp.position),
                    intensity: DVec3::from_array(lamp.intensity),
                    shape: Shape::Point,
                })
                .collect(),
            intrinsics: Intrinsics {
                size_px: [file.width, file.height],
                focal_px: DVec2::new(k[0][0], k[1][1]),
                // There a pixel's centre is at .5.
                center_px: DVec2::new(k[0][2], k[1][2]) - 0.5,
                distortion: Distortion::NONE,
            },
            camera_from_world: affine(&file.camera.world_to_camera)
                .with_context(|| path.display().to_string())?,
            exact: exact.to_luma8().into_raw(),
        })
    }

    /// The scene as a scene file would have it, its meshes read and mended as users' are.
    ///
    /// # Errors
    /// A mesh that cannot be read.
    pub fn to_scene(&self) -> Result<Scene> {
        let mut toml = String::from(
            "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"table\"\n\
             markers = [{ id = 0, size_m = 0.045, center_m = [0, 0] }]\n",
        );
        for (kind, things) in [("phantom", &self.phantoms), ("virtual", &self.virtuals)] {
            for (index, thing) in things.iter().enumerate() {
                let mesh = std::path::absolute(&thing.mesh)?;
                toml += &format!(
                    "[[{kind}]]\nname = \"{kind} {index}\"\nmesh = {:?}\n",
                    mesh.display().to_string()
                );
            }
        }
        let mut scene = Scene::parse(Path::new("known scene"), &toml)?;
        let placed = self.phantoms.iter().chain(&self.virtuals);
        let objects = scene.phantoms.iter_mut().chain(&mut scene.virtuals);
        for (object, thing) in objects.zip(placed) {
            object.anchor_from_object = thing.world_from_object * object.anchor_from_object;
        }
        scene.lights = self.lights.iter().map(|&light| light.into()).collect();
        scene.ambient_radiance = DVec3::splat(AMBIENT);
        Ok(scene)
    }

    /// Its camera.
    pub fn view(&self) -> View {
        View {
            intrinsics: self.intrinsics,
            camera_from_world: self.camera_from_world,
        }
    }
}

/// The triangles of a scene whose things all stand in the world, for rays. Corners are single precision, as what is drawn.
pub fn world_of(scene: &Scene) -> World {
    let triangles_of = |thing: usize, object: &Object, role| {
        let corner = |index: u32| {
            let position = object.mesh.positions[index as usize].as_dvec3();
            let in_world = object.anchor_from_object.transform_point3(position);
            in_world.as_vec3().as_dvec3()
        };
        let triangle = |vertices: &[u32; 3]| Triangle {
            role,
            thing,
            casts: object.casts,
            corners: vertices.map(corner),
        };
        object.mesh.triangles.iter().map(triangle).collect()
    };
    let real = scene.phantoms.iter().map(|object| (object, REAL));
    let seeming = scene.virtuals.iter().map(|object| (object, VIRTUAL));
    let triangles = (real.enumerate())
        .chain(seeming.enumerate())
        .flat_map(|(thing, (object, role))| -> Vec<Triangle> { triangles_of(thing, object, role) });
    World::new(triangles.collect())
}
