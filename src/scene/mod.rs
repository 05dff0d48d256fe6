//! A scene: what is tracked, what is real, what is virtual, what lights them; one TOML file, parsed into types that cannot be wrong.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};

use crate::geometry::mesh::{Mesh, MeshReport};
use crate::light::probe::Probe;
use crate::light::texture::Texture;
use crate::light::{Light, Material};
pub use crate::shafts::difference::Difference;

// Its macros are used below.
#[macro_use]
pub mod schema;

mod anchors;
mod animation;
mod bundle;
mod camera;
mod compact;
mod dictionary;
mod error;
mod faces;
mod family;
mod file_stamp;
pub mod format;
pub mod gltf;
pub mod in_its_place;
mod kept_pictures;
mod laid_picture;
mod lights;
mod load;
mod loading;
mod mask_cut;
pub mod mesh_file;
pub mod mesh_format;
mod mip_36h12;
mod model_cache;
mod motion;
mod named_files;
mod not_a_scene;
pub mod notes;
pub mod obj;
mod objects;
mod placement;
pub mod plain_file;
pub mod ply;
mod probe;
pub mod probe_file;
mod quality;
pub mod radiance_file;
mod ranges;
pub mod raw_model;
mod reader;
mod reference;
mod shadows;
mod shapes;
mod shortcuts;
mod texture_file;
pub mod tiff_header;
mod tracking;
mod transport;
mod vertex_colors;
pub mod yaml;

pub use animation::Animation;
pub use camera::{CameraSettings, PixelFormat, WantedFormat};
pub use compact::{ProbeLight, ProbeLightKind, SplitLight};
pub use dictionary::Dictionary;
pub use error::{SceneError, TextPlace, suggestion};
pub use faces::Face;
pub use family::{Codes, Drawing, Family, Ink};
pub use file_stamp::FileStamp;
pub use lights::{Bounces, SceneLight, unit_direction};
pub use load::Reading;
pub use loading::{LoadStage, Loading};
pub use model_cache::ModelCache;
pub use motion::{Motion, PathEnd, Station};
pub use named_files::{FileKind, NamedFile};
pub use placement::Placement;
pub use quality::Quality;
pub use ranges::{Digits, Numbers, Whole};
pub use raw_model::ClipInfo;
pub use reference::reference;
pub use shadows::{
    EnvironmentMethod, EnvironmentSettings, Grouping, ShadowChange, ShadowSettings,
    ShadowTechnique, ShaftSettings, Technique, VolumeCounting,
};
pub use shapes::ShapeKind;
pub use shortcuts::{Shortcut, Shortcuts};
pub use tracking::{ArucoRefinement, DetectorKind, SearchArea, TrackingSettings};

/// What one scene file says, checked.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Where the pictures come from.
    pub camera: CameraSettings,
    /// How the anchors are found.
    pub tracking: TrackingSettings,
    /// Boards first, then lone markers; the first is the world.
    pub anchors: Vec<Anchor>,
    /// Coarse models of real things.
    pub phantoms: Vec<Object>,
    /// What the picture alone shows.
    pub virtuals: Vec<Object>,
    /// What shines.
    pub lights: Vec<SceneLight>,
    /// Radiance of the constant surrounding light, linear RGB.
    pub ambient_radiance: DVec3,
    /// How often light is followed that things reflect on to real surfaces.
    pub bounces: Bounces,
    /// The light that a probe saw, and the room that sent it.
    pub probe: Option<ProbeScene>,
    /// How shadows are made.
    pub shadows: ShadowSettings,
}

impl Scene {
    /// The same camera, anchors and lights with nothing there, and no probe.
    pub fn without_things(&self) -> Self {
        Self {
            phantoms: Vec::new(),
            virtuals: Vec::new(),
            probe: None,
            ..self.clone()
        }
    }

    /// The families of all markers, as often as they have some.
    pub fn families(&self) -> Vec<Family> {
        let markers = self.anchors.iter().flat_map(|anchor| &anchor.markers);
        markers.map(|marker| marker.family).collect()
    }

    /// The lights that stand in the world, in world space.
    pub fn world_lights(&self) -> Vec<Light> {
        let standing = self.lights.iter().filter(|light| light.anchor == 0);
        standing.map(|light| light.light).collect()
    }
}

/// A marker in its anchor's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// Its family or dictionary.
    pub family: Family,
    /// Its number in the family.
    pub id: u32,
    /// Side of the black square, metres.
    pub size_m: f64,
    /// A turn and a shift, metres. The marker's own frame: origin at its centre, x right, y up as printed, z towards
    /// whoever reads it.
    pub anchor_from_marker: DAffine3,
}

impl Marker {
    /// A marker in the middle of its anchor's frame.
    pub fn alone(family: Family, id: u32, size_m: f64) -> Self {
        Self {
            family,
            id,
            size_m,
            anchor_from_marker: DAffine3::IDENTITY,
        }
    }

    /// The marker in its anchor's plane z = 0, its centre at `center_m` (metres), turned counter-clockwise by
    /// `rotation_rad` (radians).
    #[must_use]
    pub fn in_plane(self, center_m: DVec2, rotation_rad: f64) -> Self {
        Self {
            anchor_from_marker: DAffine3 {
                matrix3: DMat3::from_rotation_z(rotation_rad),
                translation: center_m.extend(0.0),
            },
            ..self
        }
    }

    /// Its centre in the anchor's frame, metres.
    pub fn center_m(&self) -> DVec3 {
        self.anchor_from_marker.translation
    }

    /// The unit vector of the anchor's frame out of its printed side.
    pub fn normal(&self) -> DVec3 {
        self.anchor_from_marker.matrix3.z_axis
    }

    /// The counter-clockwise turn in the anchor's plane of a marker that faces up, radians.
    pub fn rotation_rad(&self) -> f64 {
        let x = self.anchor_from_marker.matrix3.x_axis;
        x.y.atan2(x.x)
    }

    /// Its turns about x, then y, then z of the anchor's frame, degrees.
    pub fn rotation_deg(&self) -> DVec3 {
        placement::turns_deg(&self.anchor_from_marker.matrix3)
    }

    /// Whether it lies in its anchor's plane z = 0 and faces up, but for what a file's last decimal leaves.
    pub fn is_in_plane(&self) -> bool {
        const EVEN: f64 = 1e-9;
        self.center_m().z.abs() < EVEN && self.normal().abs_diff_eq(DVec3::Z, EVEN)
    }

    /// Its corners in the anchor's frame, metres: top left, top right, bottom right, bottom left as printed.
    pub fn corners_m(&self) -> [DVec3; 4] {
        let half_m = self.size_m / 2.0;
        [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, y)| {
            let corner_m = DVec3::new(x, y, 0.0) * half_m;
            self.anchor_from_marker.transform_point3(corner_m)
        })
    }

    /// Its size and its distance from the anchor's origin made larger by a factor.
    #[must_use]
    pub fn stretched(mut self, factor: f64) -> Self {
        self.size_m *= factor;
        self.anchor_from_marker.translation *= factor;
        self
    }
}

/// A board of markers or a lone marker, with its own frame. That of what is flat has x right, y up as printed, z towards the
/// viewer; that of a board in space is whatever its markers are placed in.
#[derive(Debug, Clone, PartialEq)]
pub struct Anchor {
    /// Its name, unique in the scene.
    pub name: String,
    /// Its markers; a lone one lies at the origin.
    pub markers: Vec<Marker>,
}

impl Anchor {
    /// A marker alone, in a frame of its own.
    pub fn lone(name: String, family: Family, id: u32, size_m: f64) -> Self {
        Self {
            name,
            markers: vec![Marker::alone(family, id, size_m)],
        }
    }

    /// Whether all of its markers lie in one plane, wherever that is, and face the same way.
    pub fn is_flat(&self) -> bool {
        Face::all_of(&self.markers).len() < 2
    }
}

/// A phantom or a virtual thing.
#[derive(Debug, Clone)]
pub struct Object {
    /// Its name, unique among the things.
    pub name: String,
    /// What its mesh was made from.
    pub shape: ShapeKind,
    /// Its triangles are counter-clockwise seen from outside *in the anchor's frame*: where `anchor_from_object` mirrors,
    /// they are turned round against the file's. Copies of a scene share it: a model may be large, and each edit is one.
    pub mesh: Arc<Mesh>,
    /// What was found and mended when the mesh was read.
    pub mesh_report: MeshReport,
    /// As many as `mesh.triangle_materials` names; never empty.
    pub materials: Vec<Material>,
    /// What its file calls them; empty texts where it does not, or no texts.
    pub material_names: Vec<String>,
    /// What the materials' maps name.
    pub textures: Vec<Arc<Texture>>,
    /// What of its file is passed over or taken for something else, one sentence each.
    pub notes: Vec<String>,
    /// The animations that its file has.
    pub clips: Vec<ClipInfo>,
    /// The one that plays. What it makes of `mesh` at a time, [`Object::take_shape`] says.
    pub animation: Option<Animation>,
    /// The node that it stands still on: an anchor, or, beyond the anchors, one that moves with it
    /// ([`Scene::camera_from_nodes`]).
    pub anchor: usize,
    /// How it moves by itself.
    pub motion: Option<Motion>,
    /// Placement with rotation and scale; its determinant is never 0.
    pub anchor_from_object: DAffine3,
    /// Whether it takes light away from others.
    pub casts: bool,
    /// Whether it is there at all: what is hidden neither shows, nor catches shadows, nor casts any.
    pub visible: bool,
}

impl Object {
    /// Whether it is the top of the table, which is there but casts no shadow.
    pub fn is_table(&self) -> bool {
        self.name == objects::TABLE_SECTION.name && !self.casts
    }

    /// What it stands or moves on: index into [`Scene::anchors`].
    pub fn stands_on(&self) -> usize {
        self.motion
            .as_ref()
            .map_or(self.anchor, |motion| motion.anchor)
    }
}

/// The light that a probe saw, and the room that sent it.
#[derive(Debug, Clone)]
pub struct ProbeScene {
    /// The probe's file.
    pub image: PathBuf,
    /// What it saw.
    pub probe: Probe,
    /// What its file says that is passed over or taken for something else, one sentence each.
    pub notes: Vec<String>,
    /// Index into [`Scene::anchors`] of the anchor that all of its light turns with.
    pub anchor: usize,
    /// Where it was taken, in the world, metres.
    pub position_m: DVec3,
    /// Display white over the probe's unit of radiance.
    pub exposure: f64,
    /// What is around the table, in the world.
    pub room: Vec<RoomPiece>,
    /// Whether the scene says nothing of a room: `room` is then a box far away.
    pub is_far: bool,
}

/// A part of the room.
#[derive(Debug, Clone)]
pub struct RoomPiece {
    /// Triangles, counter-clockwise seen from the side that is lit, metres, each with its diffuse reflectance if that is
    /// given.
    pub triangles: Vec<([Vec3; 3], Option<Vec3>)>,
    /// Whether they bound a volume.
    pub is_closed: bool,
}
