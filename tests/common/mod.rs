//! What several tests need: scenes from the stability rows, a device, and masks held against exact ones.
#![allow(dead_code)] // Each test binary uses its own part.

pub mod composite;
pub mod degenerate;
#[cfg(target_os = "linux")]
pub mod gpu_faults;
pub mod judge;
pub mod near_edges;
pub mod photographs;
pub mod prints;
pub mod random;
pub mod remembered;
pub mod rigs;
pub mod shapes;
pub mod sheets;
#[cfg(unix)]
pub mod signals;
pub mod waiting;

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DMat3, DVec3, Vec3};
use gnomon::app::chart::known_scene::{AMBIENT, KnownScene, PlacedMesh, world_of};
use gnomon::app::truth::ray_cast::{Triangle, View, World};
use gnomon::capture::Frame;
use gnomon::geometry::camera::Intrinsics;
use gnomon::geometry::mesh::{Mesh, MeshReport};
use gnomon::light::{Light, Material};
use gnomon::render::{Gpu, Layers, REAL, Renderer, Shown, VIRTUAL};
use gnomon::scene::{Anchor, Bounces, Object, Scene, ShadowSettings, ShapeKind, Technique};

use remembered::Remembered;
use shapes::Soup;

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
pub const GREY: Material = Material::matt(DVec3::splat(0.5));

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
        ..Mesh::default()
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
        shape: ShapeKind::Mesh,
        mesh: Arc::new(mesh),
        mesh_report: MeshReport::default(),
        materials: vec![Material::matt(albedo)],
        material_names: Vec::new(),
        textures: Vec::new(),
        notes: Vec::new(),
        anchor: 0,
        motion: None,
        clips: Vec::new(),
        animation: None,
        anchor_from_object: world_from_object,
        casts: true,
        visible: true,
    }
}

/// A square table top of a half side in the plane z = 0 that casts no shadow.
pub fn table_top(half_m: f32, albedo: DVec3) -> Object {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let positions = corners.map(|[x, y]| Vec3::new(x, y, 0.0) * half_m).to_vec();
    let mesh = flat_mesh(positions, vec![[0, 1, 2], [0, 2, 3]]);
    Object {
        casts: false,
        ..object("table", mesh, albedo, DAffine3::IDENTITY)
    }
}

/// A scene of four samples whose world is the only anchor; real surfaces get no light but of the lights, and all of the ambient.
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
        lights: lights.into_iter().map(Into::into).collect(),
        ambient_radiance: DVec3::splat(ambient),
        bounces: Bounces::Auto,
        shadows: ShadowSettings {
            technique: Technique::Auto,
            samples: 4,
            ambient_samples: 0,
            ..ShadowSettings::default()
        },
        ..Scene::default()
    }
}

/// A thing of a stage, as its file has it.
#[derive(Debug, Clone)]
pub struct Thing {
    pub shape: Shape,
    /// Rotation and translation.
    pub anchor_from_thing: DAffine3,
    /// As the scene file gives it, before the rotation.
    pub scale: DVec3,
    pub casts: bool,
    pub visible: bool,
    /// Diffuse reflectance.
    pub albedo: f64,
    /// Whether a virtual thing's triangles stay flat where the file has no normals.
    pub faceted: bool,
}

/// Where a thing's triangles come from.
#[derive(Debug, Clone)]
pub enum Shape {
    File(PathBuf),
    Made(Soup),
}

impl Thing {
    pub fn new(shape: Shape) -> Self {
        Self {
            shape,
            anchor_from_thing: DAffine3::IDENTITY,
            scale: DVec3::ONE,
            casts: true,
            visible: true,
            albedo: 0.5,
            faceted: false,
        }
    }

    pub fn made(soup: Soup) -> Self {
        Self::new(Shape::Made(soup))
    }

    /// A mesh of `tests/stability`.
    pub fn file(name: &str) -> Self {
        Self::new(Shape::File(project_file("tests/stability").join(name)))
    }

    pub fn at(self, place_m: [f64; 3]) -> Self {
        self.placed(DAffine3::from_translation(DVec3::from_array(place_m)))
    }

    pub fn placed(self, anchor_from_thing: DAffine3) -> Self {
        Self {
            anchor_from_thing,
            ..self
        }
    }

    pub fn scaled(self, scale: DVec3) -> Self {
        Self { scale, ..self }
    }

    pub fn without_shadow(self) -> Self {
        Self {
            casts: false,
            ..self
        }
    }

    pub fn of_albedo(self, albedo: f64) -> Self {
        Self { albedo, ..self }
    }

    pub fn faceted(self) -> Self {
        Self {
            faceted: true,
            ..self
        }
    }

    /// Its raw triangles in the world; the renderer's vertices are single precision on their anchor, and the oracle
    /// judges its visibility, not its rounding.
    fn triangles(&self, role: u8, thing: usize, world_from_anchor: &DAffine3) -> Vec<Triangle> {
        let scaled = DAffine3::from_scale(self.scale);
        let anchor_from_object = self.anchor_from_thing * scaled;
        let place = |position: Vec3| {
            let on_anchor = anchor_from_object.transform_point3(position.as_dvec3());
            world_from_anchor.transform_point3(on_anchor.as_vec3().as_dvec3())
        };
        let read;
        let (positions, triangles) = match &self.shape {
            Shape::Made(soup) => (&soup.positions, &soup.triangles),
            Shape::File(path) => {
                read = read_obj(path);
                (&read.positions, &read.triangles)
            }
        };
        let corners = |t: &[u32; 3]| t.map(|index| place(positions[index as usize]));
        triangles
            .iter()
            .map(|triangle| Triangle {
                role,
                thing,
                casts: self.casts,
                corners: corners(triangle),
            })
            .collect()
    }
}

/// A scene read as users get theirs, with the same triangles as the files have them for the oracle.
pub struct Stage {
    pub scene: Scene,
    pub world: World,
    /// Where the second anchor lies, which carries the virtual things; `None` where the world does.
    pub world_from_card: Option<DAffine3>,
    pub phantoms: Vec<Thing>,
    pub virtuals: Vec<Thing>,
    /// What the file said of each thing's place: its scale.
    scales: Vec<DAffine3>,
}

impl Stage {
    /// Writes meshes and scene file, and reads them back.
    pub fn new(
        phantoms: &[Thing],
        virtuals: &[Thing],
        world_from_card: Option<DAffine3>,
        lights: Vec<Light>,
        ambient_radiance: DVec3,
    ) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut toml = String::from(
            "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"table\"\n\
             markers = [{ id = 0, size_m = 0.045, center_m = [0, 0] }]\n\
             [[marker]]\nname = \"card\"\nid = 1\nsize_m = 0.045\n",
        );
        let virtual_anchor = match world_from_card {
            Some(_) => "card",
            None => "table",
        };
        for (kind, anchor, things) in [
            ("phantom", "table", phantoms),
            ("virtual", virtual_anchor, virtuals),
        ] {
            for (index, thing) in things.iter().enumerate() {
                let path = match &thing.shape {
                    Shape::File(path) => path.clone(),
                    Shape::Made(soup) => {
                        let path = folder.path().join(format!("{kind}{index}.obj"));
                        std::fs::write(&path, soup.to_obj()).expect("a mesh");
                        path
                    }
                };
                let (path, casts, albedo) = (path.display(), thing.casts, thing.albedo);
                let [x, y, z] = thing.scale.to_array();
                let crease = match thing.faceted && kind == "virtual" {
                    true => "smooth_deg = 0\n",
                    false => "",
                };
                toml += &format!(
                    "[[{kind}]]\nname = \"{kind} {index}\"\nmesh = \"{path}\"\non = \"{anchor}\"\n\
                     scale = [{x:?}, {y:?}, {z:?}]\ncasts = {casts}\n\
                     material = {{ albedo = {albedo:?} }}\n{crease}"
                );
            }
        }
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, toml).expect("a scene file");
        let mut scene = Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
        scene.lights = lights.into_iter().map(Into::into).collect();
        scene.ambient_radiance = ambient_radiance;
        scene.shadows.ambient_samples = 0;
        let objects = scene.phantoms.iter().chain(&scene.virtuals);
        let scales = objects.map(|object| object.anchor_from_object).collect();
        let mut stage = Self {
            scene,
            world: World::new(Vec::new()),
            world_from_card,
            phantoms: phantoms.to_vec(),
            virtuals: virtuals.to_vec(),
            scales,
        };
        stage.place();
        stage
    }

    /// One whose meshes are its own truth, all in the world, none of them bent smoothly.
    pub fn of_scene(scene: Scene) -> Self {
        let stand_in = Thing::made(Soup::default()).faceted();
        Self {
            world: world_of(&scene),
            world_from_card: None,
            phantoms: vec![stand_in.clone(); scene.phantoms.len()],
            virtuals: vec![stand_in; scene.virtuals.len()],
            scales: Vec::new(),
            scene,
        }
    }

    /// Takes over where its things are now, and which are to be seen.
    pub fn place(&mut self) {
        let things = || self.phantoms.iter().chain(&self.virtuals);
        let objects = self
            .scene
            .phantoms
            .iter_mut()
            .chain(&mut self.scene.virtuals);
        for ((object, thing), scale) in objects.zip(things()).zip(&self.scales) {
            object.anchor_from_object = thing.anchor_from_thing * *scale;
            object.visible = thing.visible;
        }
        let card = self.world_from_card.unwrap_or(DAffine3::IDENTITY);
        let of = |role: u8, things: &[Thing], world_from_anchor: &DAffine3| -> Vec<Triangle> {
            let seen = things.iter().enumerate().filter(|(_, thing)| thing.visible);
            seen.flat_map(|(index, thing)| thing.triangles(role, index, world_from_anchor))
                .collect()
        };
        let real = of(REAL, &self.phantoms, &DAffine3::IDENTITY);
        let seeming = of(VIRTUAL, &self.virtuals, &card);
        self.world = World::new([real, seeming].concat());
    }

    /// Its video is white: what is left of it is the gain.
    pub fn renderer(&self, intrinsics: Intrinsics) -> Renderer {
        self.renderer_of(self.scene.shadows, intrinsics)
    }

    /// One that makes its shadows otherwise.
    pub fn renderer_of(&self, shadows: ShadowSettings, intrinsics: Intrinsics) -> Renderer {
        let scene = Scene {
            shadows,
            ..self.scene.clone()
        };
        let renderer = Renderer::with_precomputation(gpu(), &scene, intrinsics, &Remembered);
        let mut renderer = renderer.expect("a renderer");
        let frame = frame_of(intrinsics.size_px, |_| 255);
        renderer.upload(&frame).expect("an uploaded frame");
        renderer
    }

    /// For each anchor.
    pub fn poses(&self, camera_from_world: DAffine3) -> Vec<Option<DAffine3>> {
        let card = self.world_from_card.map(|card| camera_from_world * card);
        let poses = [Some(camera_from_world), card];
        poses[..self.scene.anchors.len()].to_vec()
    }

    /// The composite.
    pub fn picture(&self, renderer: &mut Renderer, camera_from_world: DAffine3) -> Picture {
        renderer.draw(&self.poses(camera_from_world), Shown::Composite);
        Picture::new(renderer.read_picture().expect("a picture"))
    }

    /// The composite and its layers.
    pub fn shoot(&self, renderer: &mut Renderer, camera_from_world: DAffine3) -> (Picture, Layers) {
        let picture = self.picture(renderer, camera_from_world);
        (picture, renderer.layers().expect("layers"))
    }
}

/// A row of `tests/stability`: a scene, its camera, and the exact mask.
pub struct StabilityRow {
    pub stage: Stage,
    pub view: View,
    /// As the README there defines it: id + 4 · bits.
    pub exact: Vec<u8>,
}

/// Reads `FOLDER/NAME.json` and its exact mask.
pub fn stability_row(folder: &Path, name: &str) -> StabilityRow {
    let known = KnownScene::read(folder, name).expect("a row");
    let things = |placed: &[PlacedMesh]| -> Vec<Thing> {
        let thing = |placed: &PlacedMesh| {
            Thing::new(Shape::File(placed.mesh.clone())).placed(placed.world_from_object)
        };
        placed.iter().map(thing).collect()
    };
    StabilityRow {
        stage: Stage::new(
            &things(&known.phantoms),
            &things(&known.virtuals),
            None,
            known.lights,
            DVec3::splat(AMBIENT),
        ),
        view: View {
            intrinsics: known.intrinsics,
            camera_from_world: known.camera_from_world,
        },
        exact: known.exact,
    }
}

/// OpenCV's camera at `eye` that looks at `target`, the world's z up.
pub fn look_at(eye: DVec3, target: DVec3) -> DAffine3 {
    look_with_up(eye, target, DVec3::Z)
}

/// The same with any direction up.
pub fn look_with_up(eye: DVec3, target: DVec3, up: DVec3) -> DAffine3 {
    let forward = (target - eye).normalize();
    let right = forward.cross(up).normalize();
    let world_from_camera = DAffine3::from_mat3_translation(
        DMat3::from_cols(right, forward.cross(right), forward),
        eye,
    );
    world_from_camera.inverse()
}

pub fn grey_frame(size_px: [u32; 2]) -> Frame {
    frame_of(size_px, |_| 128)
}

/// A frame whose bytes are a function of their index.
pub fn frame_of(size_px: [u32; 2], level: impl FnMut(usize) -> u8) -> Frame {
    let bytes = 0..(4 * size_px[0] * size_px[1]) as usize;
    Frame {
        index: 0,
        time_secs: 0.0,
        size_px,
        rgba: bytes.map(level).collect(),
    }
}

/// A composite. Over a white video a real pixel is its gain, and a virtual one its radiance.
pub struct Picture {
    /// sRGB-encoded, four bytes a pixel.
    pub rgba: Vec<u8>,
}

impl Picture {
    pub fn new(rgba: Vec<u8>) -> Self {
        Self { rgba }
    }

    pub fn pixel(&self, index: usize) -> [u8; 3] {
        std::array::from_fn(|channel| self.rgba[4 * index + channel])
    }

    /// Linear, 0 to 1.
    pub fn linear(&self, index: usize) -> DVec3 {
        let level = |level: u8| linear_of_level(f64::from(level));
        DVec3::from_array(self.pixel(index).map(level))
    }
}

/// IEC 61966-2-1, also between levels.
pub fn linear_of_level(level: f64) -> f64 {
    let encoded = level / 255.0;
    if encoded <= 0.040_45 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

pub fn sun(direction: [f64; 3], irradiance: [f64; 3]) -> Light {
    Light::directional(
        DVec3::from_array(direction).normalize(),
        DVec3::from_array(irradiance),
    )
}

pub fn lamp(position_m: [f64; 3], intensity: [f64; 3]) -> Light {
    Light::point(DVec3::from_array(position_m), DVec3::from_array(intensity))
}
