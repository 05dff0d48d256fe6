//! The meshes that a scene names, of whatever format, as the renderer takes them: turned upright, in metres, welded.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3, Vec3};

use super::animation::{Animation, WantedAnimation};
use super::error::SceneError;
use super::in_its_place::in_place_of;
use super::kept_pictures::KeptPictures;
use super::loading::LoadStage;
use super::mask_cut::cut_masks;
use super::mesh_format::MeshFormat;
use super::model_cache::ModelCache;
use super::named_files::FileKind;
use super::obj::files::named_file;
use super::plain_file::{self, MOST_MESH};
use super::raw_model::{ClipInfo, RawModel};
use super::reader::Value;
use super::{gltf, obj, ply, texture_file};
use crate::geometry::bounds::Bounds;
use crate::geometry::mesh::{Mesh, MeshReport};
use crate::geometry::rig::posed::MeshPoser;
use crate::light::Material;
use crate::light::material::{Coverage, Map};
use crate::light::texture::Texture;

mod stl;

/// A mesh, what was done to it, and its materials (never none).
#[derive(Debug, Clone)]
pub struct LoadedMesh {
    /// Its triangles, welded.
    pub mesh: Arc<Mesh>,
    /// What was done to it.
    pub report: MeshReport,
    /// What it is made of.
    pub materials: Vec<Material>,
    /// What the file calls them; empty where it has no name.
    pub material_names: Vec<String>,
    /// For each of them whether a file gives it.
    pub is_given: Vec<bool>,
    /// What the materials' maps name.
    pub textures: Vec<Arc<Texture>>,
    /// What of the file is passed over or taken for something else, one sentence each.
    pub notes: Vec<String>,
    /// The animations that its file has.
    pub clips: Vec<ClipInfo>,
    /// The one that plays.
    pub animation: Option<Animation>,
}

/// Where a mesh's normals come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Normals {
    /// From the triangles alone.
    Flat,
    /// From the file, and where it has none made within a crease angle.
    GivenOrMade {
        /// The largest angle between faces that look like one surface.
        crease_rad: f64,
    },
}

choices! {
    /// Which of a file's axes points up; its other axes follow by a turn about x.
    pub enum Up, "axis" {
        /// As glTF has it, and most programs write OBJ.
        Y = "y",
        /// As this program has it, and CAD programs.
        Z = "z",
    }
}

/// How a mesh's file is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshReading {
    /// Where its normals come from.
    pub normals: Normals,
    /// Which of its axes points up; `None`: as its format has it.
    pub up: Option<Up>,
    /// What its longest side is scaled to, metres; `None`: its numbers are metres.
    pub fit_m: Option<f64>,
    /// Whether its corners keep their texture coordinates though no picture of its own asks for them.
    pub keeps_coordinates: bool,
}

impl MeshReading {
    /// As the file has it.
    pub const fn plain(normals: Normals) -> Self {
        Self {
            normals,
            up: None,
            fit_m: None,
            keeps_coordinates: false,
        }
    }
}

/// Reads the mesh that a scene's value names, with what moves it where something is to play.
pub fn load(
    value: &Value,
    kind: FileKind,
    reading: MeshReading,
    wanted: Option<&WantedAnimation>,
) -> Result<LoadedMesh, SceneError> {
    let path = value.existing_path(kind)?;
    let Some(models) = value.models() else {
        let note_read = |file: &Path| value.note_consulted(file);
        return read_named(value, &path, (reading, wanted), &note_read);
    };
    let how = format!("{reading:?} {:?}", wanted.map(WantedAnimation::in_words));
    if let Some((loaded, files)) = models.get::<LoadedMesh>(&path, &how) {
        files.iter().for_each(|file| value.note_consulted(file));
        return Ok((*loaded).clone());
    }
    let loaded = models.keep(&path, &how, || {
        let besides: RefCell<Vec<PathBuf>> = RefCell::default();
        let note_read = |file: &Path| {
            value.note_consulted(file);
            besides.borrow_mut().push(file.to_owned());
        };
        let loaded = read_named(value, &path, (reading, wanted), &note_read)?;
        Ok((loaded, besides.into_inner()))
    })?;
    Ok((*loaded).clone())
}

/// Reads the mesh of a file that a scene's value names.
fn read_named(
    value: &Value,
    path: &Path,
    how: (MeshReading, Option<&WantedAnimation>),
    note_read: &dyn Fn(&Path),
) -> Result<LoadedMesh, SceneError> {
    let loading = value.models().and_then(ModelCache::loading);
    let enter = |stage: LoadStage| match loading.is_none_or(|loading| loading.enter(path, stage)) {
        true => Ok(()),
        false => Err(SceneError::of_file(path, "its reading was given up")),
    };
    enter(LoadStage::Reading)?;
    let bytes = plain_file::read(path, MOST_MESH)
        .map_err(|error| value.error(format!("the mesh cannot be read: {error}")))?;
    read(path, bytes, how, (note_read, &enter)).map_err(|mut error| {
        error.message += &format!(" (a mesh of {})", value.location());
        error
    })
}

/// Told of what comes next; an error where nobody waits for it any more.
type EnterStage<'a> = &'a dyn Fn(LoadStage) -> Result<(), SceneError>;

/// `note_read` is told of every file that is looked for besides.
fn read(
    path: &Path,
    bytes: Vec<u8>,
    (reading, wanted): (MeshReading, Option<&WantedAnimation>),
    (note_read, enter): (&dyn Fn(&Path), EnterStage<'_>),
) -> Result<LoadedMesh, SceneError> {
    enter(LoadStage::Unpacking)?;
    let format = match MeshContent::of(path, &bytes) {
        MeshContent::Mesh(format) => format,
        MeshContent::Other(what) => {
            let allowed = MeshFormat::all_names();
            let message = format!("{what} is not read; allowed: {allowed}");
            return Err(SceneError::of_file(path, message));
        }
        MeshContent::InItsPlace(what) => {
            let what = match what.contains("archive") {
                true => "an archive (a ZIP file, 3MF, USDZ or what was downloaded): unpack it",
                false => what,
            };
            let expected = MeshFormat::all_names();
            let message = format!("{what}; a mesh is expected: {expected}");
            return Err(SceneError::of_file(path, message));
        }
    };
    let choose = |clips: &[ClipInfo]| wanted.map(|wanted| wanted.choose(clips)).transpose();
    let mut model = match format {
        MeshFormat::Gltf => gltf::read(path, &bytes, note_read, &choose)?,
        MeshFormat::Obj => obj::read(path, &bytes, note_read)?,
        MeshFormat::Stl => stl::read(path, &bytes)?,
        MeshFormat::Ply => {
            let (mut model, named) = ply::read(path, &bytes)?;
            add_pictures(&mut model, path, &named, note_read);
            model
        }
    };
    drop(bytes);
    enter(LoadStage::Joining)?;
    cut_masks(&mut model, path)?;
    note_coverage(&mut model, path, reading.normals);
    let up = reading.up.unwrap_or(Up::of(format));
    let scale = place(&mut model, path, up, reading.fit_m)?;
    let number = choose(&model.clips)?;
    let motion = model.motion.take();
    let clips = std::mem::take(&mut model.clips);
    let together = motion.as_ref().map(|motion| &motion.together[..]);
    let looks = match reading.keeps_coordinates {
        true => Kept::All,
        false => Kept::Needed,
    };
    let mut loaded = welded_as(model, (reading.normals, looks), together)
        .ok_or_else(|| SceneError::of_file(path, "no triangle has an area; a mesh is expected"))?;
    loaded.clips = clips;
    if let Some(((wanted, number), motion)) = wanted.zip(number).zip(motion) {
        let object_from_scene = DMat4::from_mat3(up.turn() * scale);
        let crease_rad = reading.normals.crease_rad();
        let rig = (motion.rig, motion.clip);
        let poser = MeshPoser::new(rig, &loaded.mesh, object_from_scene, crease_rad);
        loaded.animation = Some(wanted.playing(number, poser));
    }
    enter(LoadStage::Ready)?;
    Ok(loaded)
}

/// A model's mesh; `None` where no triangle has an area.
pub fn welded(model: RawModel, normals: Normals) -> Option<LoadedMesh> {
    welded_as(model, (normals, Kept::Needed), None)
}

/// What to say of so many triangles that memory may not do for them.
fn too_many(triangles: usize) -> Option<String> {
    const MANY: usize = 1_000_000;
    /// Measured: some 2 kB of memory for each that is drawn and casts shadows.
    const BYTES_EACH: f64 = 2e3;
    let gigabytes = triangles as f64 * BYTES_EACH / 1e9;
    (triangles > MANY).then(|| {
        format!(
            "its {:.1} million triangles take some {gigabytes:.0} GB of memory to draw; on a table a coarser version looks the same",
            triangles as f64 / 1e6
        )
    })
}

/// What corners keep of texture coordinates and colours.
#[derive(Clone, Copy, PartialEq)]
enum Kept {
    /// What their materials ask for.
    Needed,
    /// All.
    All,
}

/// The same of a model that moves, given for each position the number of those that are one place, always.
fn welded_as(
    mut model: RawModel,
    (normals, kept): (Normals, Kept),
    together: Option<&[u32]>,
) -> Option<LoadedMesh> {
    if normals == Normals::Flat {
        let triangles = model.triangles.iter_mut();
        triangles.for_each(|triangle| triangle.normals = [None; 3]);
    }
    let crease_rad = normals.crease_rad();
    // Corners need texture coordinates for pictures alone.
    let is_plain = kept == Kept::Needed
        && model
            .materials
            .iter()
            .all(|it| it.material.maps.used().next().is_none())
        && model
            .looks
            .looks
            .iter()
            .all(|look| look.color == glam::Vec4::ONE);
    let (positions, triangles) = (&model.positions, &model.triangles);
    let (mesh, report) = match together {
        Some(together) => {
            let looks = &model.looks;
            let (mesh, report) =
                Mesh::weld_moving(positions, triangles, looks, together, crease_rad);
            match is_plain {
                true => (mesh.without_looks(), report),
                false => (mesh, report),
            }
        }
        None => {
            if is_plain {
                model.looks = Default::default();
            }
            Mesh::weld_with_looks(positions, triangles, &model.looks, crease_rad)
        }
    };
    let mut notes = model.notes.told();
    notes.extend(too_many(mesh.triangles.len()));
    let materials = || model.materials.iter();
    (!mesh.triangles.is_empty()).then(|| LoadedMesh {
        mesh: Arc::new(mesh),
        report,
        materials: materials().map(|given| given.material).collect(),
        material_names: materials().map(|given| given.name.clone()).collect(),
        is_given: materials().map(|given| given.is_given).collect(),
        textures: model.textures,
        notes,
        clips: Vec::new(),
        animation: None,
    })
}

/// What a mesh's file is, by its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshContent {
    /// One that is read.
    Mesh(MeshFormat),
    /// One that is not read, in words.
    Other(&'static str),
    /// No model, in words, with what to do.
    InItsPlace(&'static str),
}

impl MeshContent {
    /// Tells by the bytes, and where they do not by the name.
    pub fn of(path: &Path, bytes: &[u8]) -> Self {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let has_name_of = |format: MeshFormat| {
            let mut own = format.extensions().iter();
            own.any(|own| extension == *own)
        };
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(512)]);
        let head = head.trim_start_matches('\u{feff}').trim_start();
        if let Some(what) = in_place_of(bytes) {
            Self::InItsPlace(what)
        } else if bytes.starts_with(b"glTF")
            || head.starts_with('{')
            || has_name_of(MeshFormat::Gltf)
        {
            Self::Mesh(MeshFormat::Gltf)
        } else if ply::is_ply(bytes) {
            Self::Mesh(MeshFormat::Ply)
        } else if stl::is_binary(bytes) || stl::is_text(bytes) || has_name_of(MeshFormat::Stl) {
            Self::Mesh(MeshFormat::Stl)
        } else if head.starts_with("Kaydara FBX") || head.starts_with("; FBX") {
            Self::Other("an FBX file")
        } else if is_picture(bytes) {
            Self::Other("a picture")
        } else if bytes.starts_with(b"MM\0") || extension == "3ds" {
            Self::Other("a 3DS file")
        } else if bytes.starts_with(b"DRACO") {
            Self::Other("a Draco file")
        } else if extension == "mtl" {
            Self::Other("a library of materials, beside the .obj that is meant,")
        } else if [
            "dxf", "max", "c4d", "skp", "ma", "mb", "lwo", "x3d", "iges", "igs", "splat",
        ]
        .iter()
        .any(|other| extension == *other)
        {
            Self::Other("a file of this kind")
        } else if head.starts_with("BLENDER") {
            Self::Other("a Blender file")
        } else if head.starts_with('<') {
            Self::Other("an XML file (COLLADA, X3D)")
        } else if head.starts_with("OFF") {
            Self::Other("an OFF file")
        } else if head.starts_with("PXR-USDC") || head.starts_with("#usda") {
            Self::Other("a USD file")
        } else if head.starts_with("ISO-10303") {
            Self::Other("a STEP file")
        } else if head.starts_with("#VRML") {
            Self::Other("a VRML file")
        } else {
            Self::Mesh(MeshFormat::Obj)
        }
    }
}

fn is_picture(bytes: &[u8]) -> bool {
    use image::ImageFormat::{Bmp, Gif, Jpeg, Png, Tiff, WebP};
    let format = image::guess_format(bytes);
    format.is_ok_and(|format| [Bmp, Gif, Jpeg, Png, Tiff, WebP].contains(&format))
}

/// Tells what becomes of materials that let light through.
fn note_coverage(model: &mut RawModel, path: &Path, normals: Normals) {
    let mut materials = model.materials.iter();
    if normals == Normals::Flat && materials.any(|given| given.material.coverage == Coverage::Blend)
    {
        let note = "what is half transparent hides as if it were opaque: a phantom is there or not";
        model.notes.add_of(path, note);
    }
}

impl Normals {
    /// The largest angle between faces that look like one surface.
    fn crease_rad(self) -> f64 {
        match self {
            Self::Flat => 0.0,
            Self::GivenOrMade { crease_rad } => crease_rad,
        }
    }
}

impl Up {
    /// What points up in files of a format, unless the scene says it.
    fn of(format: MeshFormat) -> Self {
        match format {
            MeshFormat::Gltf => Self::Y,
            MeshFormat::Obj | MeshFormat::Ply | MeshFormat::Stl => Self::Z,
        }
    }

    /// From a file's axes to the mesh's.
    fn turn(self) -> DMat3 {
        match self {
            Self::Y => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
            Self::Z => DMat3::IDENTITY,
        }
    }
}

/// Turns a model upright and scales it, by the factor that it returns.
fn place(model: &mut RawModel, path: &Path, up: Up, fit_m: Option<f64>) -> Result<f64, SceneError> {
    let upright = |vector: Vec3| match up {
        Up::Y => Vec3::new(vector.x, -vector.z, vector.y),
        Up::Z => vector,
    };
    for position in &mut model.positions {
        *position = upright(*position);
    }
    for normal in model.triangles.iter_mut().flat_map(|it| &mut it.normals) {
        *normal = normal.map(upright);
    }
    for look in &mut model.looks.looks {
        look.tangent = upright(look.tangent.truncate()).extend(look.tangent.w);
    }
    let Some(fit_m) = fit_m else { return Ok(1.0) };
    let vertices = (model.triangles.iter()).flat_map(|triangle| triangle.vertices);
    let corners = vertices.map(|vertex| model.positions[vertex as usize].as_dvec3());
    let size = Bounds::around(corners).map(|bounds| bounds.high - bounds.low);
    let longest = size.map_or(0.0, DVec3::max_element);
    if longest <= 0.0 {
        let message = "no triangle has an area; a mesh is expected";
        return Err(SceneError::of_file(path, message));
    }
    let scale = fit_m / longest;
    for position in &mut model.positions {
        *position = (position.as_dvec3() * scale).as_vec3();
    }
    Ok(scale)
}

/// The pictures that a PLY file names: that of a number is of the material of that number.
fn add_pictures(
    model: &mut RawModel,
    path: &Path,
    named: &[(String, usize)],
    note_read: &dyn Fn(&Path),
) {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut kept = KeptPictures::default();
    for ((name, line), given) in named.iter().zip(&mut model.materials) {
        let picture = named_file(folder, name);
        note_read(&picture.clone().unwrap_or_else(|| folder.join(name)));
        let texture = match &picture {
            Some(picture) => texture_file::read(picture),
            None => Err("is not there".to_owned()),
        };
        match texture {
            Ok(texture) => {
                given.material.maps.color = Some(Map::of(kept.keep(texture)));
                given.material.albedo = DVec3::ONE;
                given.is_given = true;
            }
            Err(message) => {
                let message = format!("line {line}: the picture \"{name}\" {message}; not used");
                model.notes.add_of(path, message);
            }
        }
    }
    if let Some(told) = kept.told() {
        model.notes.add_of(path, told);
    }
    model.textures = kept.into_pictures();
}

#[cfg(test)]
mod tests;
