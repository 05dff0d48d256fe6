//! A scene: what is tracked, what is real, what is virtual, what lights them; one TOML file, parsed into types that cannot be wrong.

use std::path::PathBuf;

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3, Vec3};

use crate::geometry::mesh::{Mesh, MeshReport};
use crate::light::probe::Probe;
use crate::light::{Light, Material};
pub use crate::shafts::difference::Difference;

mod anchors;
mod dictionary;
mod error;
mod family;
mod lights;
mod load;
pub mod material_libraries;
mod mesh_file;
mod named_files;
mod obj_scan;
mod objects;
mod probe;
pub mod probe_file;
pub mod radiance_file;
mod reader;
mod settings;
mod shortcuts;
mod transport;

pub use dictionary::Dictionary;
pub use error::{Place, SceneError};
pub use family::{Codes, Family};
pub use lights::unit_direction;
pub use load::Reading;
pub use named_files::{FileKind, NamedFile};
pub use reader::{NAMES, is_name};
pub use shortcuts::{Shortcut, Shortcuts};

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
    /// Lights in world space.
    pub lights: Vec<Light>,
    /// Radiance of the constant surrounding light, linear RGB.
    pub ambient_radiance: DVec3,
    /// The light that a probe saw, and the room that sent it.
    pub probe: Option<ProbeScene>,
    /// How shadows are made.
    pub shadows: ShadowSettings,
}

/// Where the pictures come from.
#[derive(Debug, Clone, Default)]
pub struct CameraSettings {
    /// As the file says, a path made absolute against the scene file's folder.
    pub source: String,
    /// `None`: what the recording itself carries.
    pub calibration: Option<PathBuf>,
    /// Whether the pictures come mirrored and are turned back first.
    pub mirror: bool,
    /// What a webcam is asked for.
    pub wanted: WantedFormat,
}

/// What a webcam is asked for; what is `None` is chosen by itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WantedFormat {
    /// Width and height, pixels.
    pub size_px: Option<[u32; 2]>,
    /// Pictures per second.
    pub fps: Option<u32>,
    /// How the pixels come.
    pub pixels: Option<PixelFormat>,
}

/// How a webcam sends its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelFormat {
    /// A JPEG each.
    Mjpeg,
    /// 4:2:2, brightness and colour in turn.
    Yuyv,
    /// 4:2:0, a plane of brightness and one of colour.
    Nv12,
    /// Brightness alone.
    Grey,
    /// 8-bit red, green, blue.
    Rgb,
    /// 8-bit blue, green, red.
    Bgr,
}

impl PixelFormat {
    /// All of them, by the names that files and the command line use.
    pub const BY_NAME: [(&str, Self); 6] = [
        ("MJPEG", Self::Mjpeg),
        ("YUYV", Self::Yuyv),
        ("NV12", Self::Nv12),
        ("GREY", Self::Grey),
        ("RGB", Self::Rgb),
        ("BGR", Self::Bgr),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::BY_NAME
            .iter()
            .find(|(_, format)| *format == self)
            .map_or("", |(name, _)| name)
    }
}

/// Which library finds the markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DetectorKind {
    /// libapriltag: AprilTag's families alone.
    AprilTag,
    /// OpenCV's ArUco: every family.
    Aruco,
}

/// Where the corners of OpenCV's detector are refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArucoRefinement {
    /// As the contour's polygon gives them.
    None,
    /// By the saddle of the gradient in a window (`cornerSubPix`).
    Subpixel,
    /// By lines fitted to the contour.
    Contour,
    /// By AprilTag's own edge fit: slow.
    AprilTag,
}

/// How markers are found.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackingSettings {
    /// The library.
    pub detector: DetectorKind,
    /// libapriltag: factor by which the picture is shrunk for the search; 1 is full resolution.
    pub decimation: f64,
    /// libapriltag: standard deviation of the blur before the search, pixels.
    pub blur_px: f64,
    /// Fit the edges of what decodes at full resolution, in linear light.
    pub refine_edges: bool,
    /// libapriltag: let the library fit the edges of whatever is square before it decodes.
    pub library_edges: bool,
    /// OpenCV's ArUco: corner refinement.
    pub aruco_refinement: ArucoRefinement,
    /// Bits that may be corrected in a marker's code.
    pub corrected_bits: u32,
    /// libapriltag: detections with a smaller decision margin are dropped.
    pub min_margin: f64,
    /// libapriltag: threads of the search.
    pub threads: u32,
    /// Where markers are looked for.
    pub search: Search,
    /// Poses from all pixels around the markers' edges, not from a detector's corners alone.
    pub pose_from_pixels: bool,
    /// Smooth poses over time: what rests stays where it is to the bit, what moves is not held back.
    pub filter: bool,
}

/// Where markers are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Search {
    /// Where they must be by now; in the whole picture now and then, and whenever an anchor is missing.
    Near,
    /// In the whole picture of every frame.
    Full,
}

impl Default for TrackingSettings {
    fn default() -> Self {
        Self {
            detector: DetectorKind::AprilTag,
            decimation: 2.0,
            blur_px: 0.0,
            refine_edges: true,
            library_edges: false,
            aruco_refinement: ArucoRefinement::Contour,
            corrected_bits: 1,
            min_margin: 20.0,
            threads: 1,
            search: Search::Near,
            pose_from_pixels: true,
            filter: true,
        }
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
    /// Its centre in the anchor's frame, metres.
    pub center_m: DVec2,
    /// Counter-clockwise turn in the board's plane, radians.
    pub rotation_rad: f64,
}

/// A board of markers or a lone marker, with its own frame (x right, y up as printed, z towards the viewer).
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
            markers: vec![Marker {
                family,
                id,
                size_m,
                center_m: DVec2::ZERO,
                rotation_rad: 0.0,
            }],
        }
    }
}

/// A phantom or a virtual thing.
#[derive(Debug, Clone)]
pub struct Object {
    /// Its name, unique among the things.
    pub name: String,
    /// Its triangles are counter-clockwise seen from outside *in the anchor's frame*: where `anchor_from_object` mirrors,
    /// they are turned round against the file's.
    pub mesh: Mesh,
    /// What was found and mended when the mesh was read.
    pub mesh_report: MeshReport,
    /// As many as `mesh.triangle_materials` names; never empty.
    pub materials: Vec<Material>,
    /// Index into [`Scene::anchors`].
    pub anchor: usize,
    /// Placement with rotation and scale; its determinant is never 0.
    pub anchor_from_object: DAffine3,
    /// Whether it takes light away from others.
    pub casts: bool,
    /// Whether it is there at all: what is hidden neither shows, nor catches shadows, nor casts any.
    pub visible: bool,
}

/// Where a thing stands, as a scene file says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Of the object's origin in the anchor's frame, metres.
    pub position_m: DVec3,
    /// Turns about x, then y, then z of that frame, degrees.
    pub rotation_deg: DVec3,
    /// Before the turn; negative mirrors, no component is 0.
    pub scale: DVec3,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            position_m: DVec3::ZERO,
            rotation_deg: DVec3::ZERO,
            scale: DVec3::ONE,
        }
    }
}

impl Placement {
    /// Scale, then turn about x, then y, then z, then move.
    pub fn anchor_from_object(&self) -> DAffine3 {
        let [x, y, z] = self.rotation_deg.to_array().map(f64::to_radians);
        let rotation =
            DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x);
        DAffine3 {
            matrix3: DMat3::from_quat(rotation) * DMat3::from_diagonal(self.scale),
            translation: self.position_m,
        }
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

/// How shadows are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Technique {
    /// What the scene's lights call for.
    Auto,
    /// Shadow volumes (Haller, Drab & Hartmann 2003).
    Volumes,
    /// Soft shadows of a probe's light in a room (Gibson, Cook, Howard & Hubbold 2003).
    Shafts,
}

impl Technique {
    /// All of them, by the names that files use.
    pub const BY_NAME: [(&str, Self); 3] = [
        ("auto", Self::Auto),
        ("volumes", Self::Volumes),
        ("shafts", Self::Shafts),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        let found = Self::BY_NAME.iter().find(|(_, known)| *known == self);
        found.map_or("", |(name, _)| name)
    }
}

/// What makes a scene's shadows: a [`Technique`] that is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShadowTechnique {
    /// Shadow volumes.
    Volumes,
    /// Soft shadows of a probe's light in a room.
    Shafts,
}

impl ShadowTechnique {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Volumes => Technique::Volumes.name(),
            Self::Shafts => Technique::Shafts.name(),
        }
    }
}

/// How shadow volumes are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counting {
    /// Depth-pass where it is known to be right, depth-fail elsewhere: the same picture for less.
    Auto,
    /// Depth-fail everywhere.
    DepthFail,
}

impl Counting {
    /// All of them, by the names that files use.
    pub const BY_NAME: [(&str, Self); 2] = [("auto", Self::Auto), ("depth-fail", Self::DepthFail)];
}

/// A place on the measured front of speed against accuracy (`charts/shadows.csv`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quality {
    /// The least time at which no shadow is visibly elsewhere.
    Fast,
    /// Smooth outlines; things as coarse as no eye can see.
    Balanced,
    /// Nothing is left out.
    Accurate,
}

impl Quality {
    /// All of them, by the names that files use.
    pub const BY_NAME: [(&str, Self); 3] = [
        ("fast", Self::Fast),
        ("balanced", Self::Balanced),
        ("accurate", Self::Accurate),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::BY_NAME
            .iter()
            .find(|(_, quality)| *quality == self)
            .map_or("", |(name, _)| name)
    }

    /// What it means where nothing else is said.
    pub fn shadows(self) -> ShadowSettings {
        let balanced = ShaftSettings::default().sources;
        let (samples, max_silhouette_error_px, sources) = match self {
            Self::Fast => (1, 2.0, Some(10)),
            Self::Balanced => (4, 0.5, balanced),
            Self::Accurate => (4, 0.0, None),
        };
        ShadowSettings {
            quality: Some(self),
            samples,
            max_silhouette_error_px,
            shafts: ShaftSettings {
                sources,
                ..ShaftSettings::default()
            },
            ..ShadowSettings::default()
        }
    }
}

/// How shadows are made and how finely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowSettings {
    /// What the others were taken from where the file does not say them; `None`: from nothing, but the defaults.
    pub quality: Option<Quality>,
    /// The technique that is asked for.
    pub technique: Technique,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    /// How volumes are counted.
    pub counting: Counting,
    /// By less than this many pixels a coarser version of a thing may move its silhouette, as the camera and the lights
    /// see it; 0: things are never made coarser.
    pub max_silhouette_error_px: f64,
    /// What a frame may take, milliseconds; `None`: no limit is asked for.
    pub frame_budget_ms: Option<f64>,
    /// What technique shafts alone is asked for.
    pub shafts: ShaftSettings,
    /// Shortcuts that technique volumes is not to take; no key of a scene file.
    pub without: Shortcuts,
}

/// How finely shafts make soft shadows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShaftSettings {
    /// Sources, each with a shadow of its own: n of Gibson et al. 2003; `None`: every one that is hidden.
    pub sources: Option<u32>,
    /// Patches that the room is cut into, about.
    pub patches: u32,
    /// Part of all power that the sources send out, the brightest first.
    pub source_power: f64,
    /// Patches in a leaf of the receivers' octree.
    pub receivers_per_leaf: u32,
    /// Shafts that bring every vertex less than this part of its light are cut no further.
    pub least_part: f64,
    /// Side of a source's shadow map, pixels.
    pub map_px: u32,
    /// How what is hidden is taken out of the video.
    pub difference: Difference,
}

impl Default for ShaftSettings {
    fn default() -> Self {
        Self {
            sources: Some(50),
            patches: 1500,
            source_power: 1.0,
            receivers_per_leaf: 8,
            least_part: 0.02,
            map_px: 256,
            difference: Difference::Ratio,
        }
    }
}

impl Default for ShadowSettings {
    fn default() -> Self {
        Self {
            quality: None,
            technique: Technique::Auto,
            samples: 4,
            counting: Counting::Auto,
            max_silhouette_error_px: 0.5,
            frame_budget_ms: None,
            shafts: ShaftSettings::default(),
            without: Shortcuts::NONE,
        }
    }
}

impl Scene {
    /// The technique that makes this scene's shadows, and why.
    pub fn chosen_technique(&self) -> (ShadowTechnique, &'static str) {
        match self.shadows.technique {
            Technique::Auto => match &self.probe {
                None => (ShadowTechnique::Volumes, "the scene has no probe"),
                Some(probe) if probe.is_far => {
                    let reason = "the scene has a probe; without a room its light comes from afar";
                    (ShadowTechnique::Shafts, reason)
                }
                Some(_) => (ShadowTechnique::Shafts, "the scene has a probe and a room"),
            },
            Technique::Shafts => (ShadowTechnique::Shafts, "the scene asks for it"),
            Technique::Volumes => (ShadowTechnique::Volumes, "the scene asks for it"),
        }
    }
}
