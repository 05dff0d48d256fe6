//! A scene that goes with a recording: it plays the recording's own folder, and all that it names lies there too.
//!
//! What a scene or a mesh names may be somebody else's doing, so no name of theirs is ever written to: copies have names
//! of our own, and what named the originals names the copies.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use toml_edit::{DocumentMut, Item, Table, Value};

use crate::app::files::new_file::sync_folder;
use crate::scene::format::{CAMERA, CAMERA_SECTION};
use crate::scene::gltf::copies::with_files_named;
use crate::scene::mesh_file::MeshContent;
use crate::scene::mesh_format::FilesBeside;
use crate::scene::obj::libraries::{with_libraries_named, with_maps_named};
use crate::scene::plain_file::{self, MOST_MESH};
use crate::scene::ply::with_pictures_named;
use crate::scene::{FileKind, NamedFile, Scene};

/// The name of the scene in its folder.
pub const SCENE_NAME: &str = "scene.toml";
/// The folder in a session's folder for what its scene names, by what that is; `None` for what holds for the camera alone.
pub fn copy_folder(kind: FileKind) -> Option<&'static str> {
    match kind {
        FileKind::Recording | FileKind::Calibration => None,
        FileKind::Mesh => Some("models"),
        FileKind::RoomMesh => Some("room"),
        FileKind::Probe => Some("probe"),
        FileKind::Picture => Some("pictures"),
        FileKind::Dictionary => Some("markers"),
        FileKind::Bundles => Some("bundles"),
    }
}

/// All of these folders.
pub fn copy_folders() -> impl Iterator<Item = &'static str> {
    FileKind::ALL.into_iter().filter_map(copy_folder)
}

/// Keys that hold for the camera alone: the session carries the calibration itself, and its frames come as they were
/// turned and chosen.
fn keys_of_the_camera() -> impl Iterator<Item = &'static str> {
    let names = CAMERA_SECTION.keys().map(|key| key.name());
    names.filter(|name| *name != CAMERA.source.name)
}

/// Copies a scene file into a session's folder with all that it names, and reads the copy again.
///
/// # Errors
/// A file that cannot be read or written, or is there already; a scene that cannot be read, before or after.
pub fn copy_scene(scene: &Path, session: &Path) -> Result<()> {
    let text = Scene::read_text(scene)?;
    let reading = Scene::read(scene, &text);
    reading.scene?;
    let mut copies = Copies {
        session,
        known: BTreeMap::new(),
    };
    let mut copied = text.clone();
    // From the end, so that the places before stay where they are.
    for named in reading.named.iter().rev() {
        if let Some(name) = copies.name_of(named)? {
            copied.replace_range(named.span.clone(), &Value::from(name).to_string());
        }
    }
    let mut document: DocumentMut = copied
        .parse()
        .with_context(|| format!("{}: not TOML", scene.display()))?;
    play_own_folder(&mut document);
    let path = session.join(SCENE_NAME);
    write_new(&path, document.to_string().as_bytes())?;
    Scene::load(&path).context("the scene's copy is not what the scene was")?;
    Ok(())
}

/// Lets the scene play the folder that it lies in. Comments of settings that go stay.
fn play_own_folder(document: &mut DocumentMut) {
    let Some(camera) = document.get_mut(CAMERA_SECTION.name) else {
        return;
    };
    if let Some(source) = camera
        .get_mut(CAMERA.source.name)
        .and_then(Item::as_value_mut)
    {
        let decor = source.decor().clone();
        *source = Value::from(".");
        *source.decor_mut() = decor;
    }
    let comments: Vec<String> = keys_of_the_camera()
        .filter_map(|key| comments_of(camera.as_table()?, key))
        .collect();
    if let Some(camera) = camera.as_table_like_mut() {
        for key in keys_of_the_camera() {
            camera.remove(key);
        }
        if let Some(mut source) = camera.key_mut(CAMERA.source.name)
            && !comments.is_empty()
        {
            let decor = source.leaf_decor_mut();
            let before = decor.prefix().and_then(|prefix| prefix.as_str());
            let before = before.unwrap_or_default().to_owned();
            decor.set_prefix(comments.concat() + &before);
        }
    }
}

/// The comments above a key and behind its value, as lines of their own.
fn comments_of(table: &Table, key: &str) -> Option<String> {
    let above = table.key(key)?.leaf_decor().prefix()?.as_str()?;
    let behind = table.get(key)?.as_value()?.decor().suffix();
    let behind = behind
        .and_then(|suffix| suffix.as_str())
        .unwrap_or_default();
    let comments = above.lines().chain(behind.lines());
    let comments: String = comments
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .map(|line| format!("{line}\n"))
        .collect();
    (!comments.is_empty()).then_some(comments)
}

/// The files that were copied, and what they are called now.
struct Copies<'a> {
    session: &'a Path,
    known: BTreeMap<(FileKind, PathBuf), String>,
}

impl Copies<'_> {
    /// Copies a file unless that is done already; its name from the session's folder on. `None` for what holds for the
    /// camera alone.
    fn name_of(&mut self, named: &NamedFile) -> Result<Option<String>> {
        let file = named.path.canonicalize();
        let file = file.with_context(|| named.path.display().to_string())?;
        let key = (named.kind, file);
        if let Some(name) = self.known.get(&key) {
            return Ok(Some(name.clone()));
        }
        let of_kind = self.known.keys().filter(|(kind, _)| *kind == named.kind);
        let number = of_kind.count() + 1;
        let Some(folder) = copy_folder(named.kind) else {
            return Ok(None);
        };
        let own_name = format!("{folder}/{number}");
        let name = match named.kind {
            FileKind::Mesh | FileKind::RoomMesh => self.copy_mesh(&named.path, &own_name)?,
            FileKind::Probe => {
                let bytes = read(&named.path)?;
                // Whoever reads it goes by its content.
                let extension = if bytes.starts_with(b"#?") {
                    "hdr"
                } else {
                    "exr"
                };
                self.put(format!("{own_name}.{extension}"), &bytes)?
            }
            FileKind::Picture => {
                let name = format!("{own_name}{}", needed_extension(&named.path));
                self.put(name, &read(&named.path)?)?
            }
            FileKind::Dictionary => self.put(format!("{own_name}.yml"), &read(&named.path)?)?,
            FileKind::Bundles => self.put(format!("{own_name}.yaml"), &read(&named.path)?)?,
            FileKind::Recording | FileKind::Calibration => return Ok(None),
        };
        self.known.insert(key, name.clone());
        Ok(Some(name))
    }

    /// Copies a glTF file with its buffers and pictures into a folder of its own.
    fn copy_gltf(&self, mesh: &Path, bytes: &[u8], folder: &str) -> Result<String> {
        let parts = OwnNames::default();
        let with_own_names = with_files_named(mesh, bytes, |part| {
            let (number, is_new) = parts.number(part);
            let name = format!("part-{number}");
            if is_new {
                self.put(format!("{folder}/{name}"), &read(part)?)?;
            }
            Ok::<_, anyhow::Error>(name)
        })?;
        let extension = match bytes.starts_with(b"glTF") {
            true => "glb",
            false => "gltf",
        };
        self.put(format!("{folder}/mesh.{extension}"), &with_own_names)
    }

    /// Copies a mesh with its materials and their pictures into a folder of its own.
    fn copy_mesh(&self, mesh: &Path, folder: &str) -> Result<String> {
        let bytes = read(mesh)?;
        let format = match MeshContent::of(mesh, &bytes) {
            MeshContent::Mesh(format) => format,
            MeshContent::Other(what) | MeshContent::InItsPlace(what) => {
                bail!("{}: {what} is not copied", mesh.display())
            }
        };
        let with_own_names = match format.files_beside() {
            FilesBeside::None => bytes,
            FilesBeside::Parts => return self.copy_gltf(mesh, &bytes, folder),
            FilesBeside::Libraries => self.copy_libraries(mesh, &bytes, folder)?,
            FilesBeside::Pictures => {
                let pictures = OwnNames::default();
                with_pictures_named(mesh, &bytes, |picture| {
                    self.copy_picture(picture, folder, &pictures)
                })?
            }
        };
        let extension = format.extensions()[0];
        self.put(format!("{folder}/mesh.{extension}"), &with_own_names)
    }

    /// Copies an OBJ file's libraries and their pictures; the file as it names the copies.
    fn copy_libraries(&self, mesh: &Path, bytes: &[u8], folder: &str) -> Result<Vec<u8>> {
        let (libraries, pictures) = (OwnNames::default(), OwnNames::default());
        with_libraries_named(mesh, bytes, |library| {
            let (number, is_new) = libraries.number(library);
            let name = format!("material-{number}.mtl");
            if is_new {
                let text = with_maps_named(library, &read(library)?, |picture| {
                    self.copy_picture(picture, folder, &pictures)
                })?;
                self.put(format!("{folder}/{name}"), &text)?;
            }
            Ok(name)
        })
    }

    /// Copies a picture unless that is done already; its name in the mesh's folder.
    fn copy_picture(&self, picture: &Path, folder: &str, pictures: &OwnNames) -> Result<String> {
        let (number, is_new) = pictures.number(picture);
        let name = format!("picture-{number}{}", needed_extension(picture));
        if is_new {
            self.put(format!("{folder}/{name}"), &read(picture)?)?;
        }
        Ok(name)
    }

    fn put(&self, name: String, bytes: &[u8]) -> Result<String> {
        write_new(&self.session.join(&name), bytes)?;
        Ok(name)
    }
}

/// What a copied picture's name has to end in for it to be read again: TGA alone is known by its name.
fn needed_extension(picture: &Path) -> &'static str {
    let extension = picture.extension();
    match extension.is_some_and(|it| it.eq_ignore_ascii_case("tga")) {
        true => ".tga",
        false => "",
    }
}

/// Files in the order in which they were named.
#[derive(Default)]
struct OwnNames(RefCell<Vec<PathBuf>>);

impl OwnNames {
    /// A file's number, from 1, and whether it has it only now.
    fn number(&self, file: &Path) -> (usize, bool) {
        let mut files = self.0.borrow_mut();
        match files.iter().position(|known| known == file) {
            Some(known) => (known + 1, false),
            None => {
                files.push(file.to_owned());
                (files.len(), true)
            }
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>> {
    plain_file::read(path, MOST_MESH).with_context(|| format!("{}: cannot be read", path.display()))
}

/// Writes a file that must not be there: a session's folder is a new one.
fn write_new(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = || format!("{}: cannot be written", path.display());
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).with_context(failed)?;
    }
    let mut file = File::create_new(path).with_context(failed)?;
    file.write_all(bytes).with_context(failed)?;
    file.sync_all().with_context(failed)?;
    sync_folder(path.parent());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::format::SECTIONS;

    fn config(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("config")
            .join(name)
    }

    #[test]
    fn a_copied_scene_is_the_same_but_for_its_camera() {
        // The second one has a probe and a room.
        for (name, comment) in [("lamp.toml", "# the mean of its wood"), ("room.toml", "#")] {
            let folder = tempfile::tempdir().unwrap();
            let original = config(name);
            copy_scene(&original, folder.path()).unwrap();
            let (copy, original) = (
                Scene::load(&folder.path().join(SCENE_NAME)).unwrap(),
                Scene::load(&original).unwrap(),
            );
            let source = Path::new(&copy.camera.source).canonicalize().unwrap();
            assert_eq!(source, folder.path().canonicalize().unwrap());
            assert!(!copy.phantoms.is_empty() && !copy.virtuals.is_empty());
            let same = |what: &str, copy: String, original: String| {
                assert!(copy == original, "{name}: {what}");
            };
            let debug = |value: &dyn std::fmt::Debug| format!("{value:?}");
            same("phantoms", debug(&copy.phantoms), debug(&original.phantoms));
            same("virtuals", debug(&copy.virtuals), debug(&original.virtuals));
            same("anchors", debug(&copy.anchors), debug(&original.anchors));
            let light = |scene: &Scene| {
                let probe = scene.probe.as_ref();
                probe.map(|it| format!("{:?} {:?}", it.probe, it.room))
            };
            assert!(light(&copy) == light(&original), "{name}: the probe");
            let text = fs::read_to_string(folder.path().join(SCENE_NAME)).unwrap();
            assert!(text.contains(comment), "comments stay");
        }
    }

    /// Whatever key names a file, by its entry: none may be left behind.
    #[test]
    fn files_of_every_key_are_copied() {
        let folder = tempfile::tempdir().unwrap();
        let home = folder.path().join("home");
        fs::create_dir_all(&home).unwrap();
        let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        for name in ["phantom", "virtual", "floor", "wall", "shelf"] {
            fs::write(home.join(name).with_extension("obj"), mesh).unwrap();
        }
        let codes =
            "nmarkers: 2\nmarkersize: 3\nmarker_0: \"110100000\"\nmarker_1: \"111001011\"\n";
        for name in ["board.yml", "marker.yml", "lens.toml"] {
            fs::write(home.join(name), codes).unwrap();
        }
        let tags = "tag_bundles: [{layout: [{id: 0, size: 0.04}]}]\n";
        fs::write(home.join("tags.yaml"), tags).unwrap();
        let probe = config("../recordings/room/probe.hdr");
        fs::copy(probe, home.join("probe.hdr")).unwrap();
        let cloth = image::RgbImage::new(2, 2);
        cloth.save(home.join("cloth.png")).unwrap();
        fs::create_dir(home.join("take")).unwrap();
        let text = "[camera]\nsource = \"take\"\ncalibration = \"lens.toml\"\n[tracking]\ndetector = \"aruco\"\n\
            [[board]]\nname = \"b\"\nfamily = \"board.yml\"\nbundle = \"tags.yaml\"\n\
            [[marker]]\nname = \"m\"\nfamily = \"marker.yml\"\nid = 1\nsize_m = 0.04\n\
            [table]\nrect_m = [0, 0, 1, 1]\nalbedo_texture = \"cloth.png\"\n\
            [[phantom]]\nname = \"p\"\nmesh = \"phantom.obj\"\n[[virtual]]\nname = \"v\"\nmesh = \"virtual.obj\"\n\
            [probe]\nimage = \"probe.hdr\"\nroom = [\"floor.obj\", \"wall.obj\"]\n[[room]]\nmesh = \"shelf.obj\"\n";
        let scene = home.join("scene.toml");
        fs::write(&scene, text).unwrap();

        // The scene has every key that names a file.
        let document: toml::Table = text.parse().unwrap();
        for section in SECTIONS.iter() {
            for key in section.keys().filter(|key| key.file().is_some()) {
                let table = match document.get(section.name) {
                    Some(toml::Value::Array(tables)) => tables[0].as_table(),
                    Some(table) => table.as_table(),
                    None => None,
                };
                let has = table.is_some_and(|table| table.contains_key(key.name()));
                assert!(has, "{}.{} names a file", section.name, key.name());
            }
        }

        let session = folder.path().join("session");
        fs::create_dir(&session).unwrap();
        copy_scene(&scene, &session).unwrap();
        fs::remove_dir_all(&home).unwrap();
        let copy = Scene::load(&session.join(SCENE_NAME)).unwrap();
        assert_eq!((copy.anchors.len(), copy.phantoms.len()), (2, 2));
        assert_eq!(copy.probe.map(|probe| probe.room.len()), Some(3));
        // Folders that an older session is known by.
        let mut folders: Vec<&str> = copy_folders().collect();
        folders.sort_unstable();
        assert_eq!(
            folders,
            ["bundles", "markers", "models", "pictures", "probe", "room"]
        );
    }

    #[test]
    fn things_without_a_file_are_copied_by_their_text() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("a.toml");
        let text = "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.04\n[[phantom]]\nname = \"book\"\n\
                    box_m = [0.15, 0.21, 0.03]  # closed\n[[virtual]]\nname = \"mug\"\nrevolved = { profile_m = [[0.03, 0], [0.04, 0.1]] }\n\
                    path = [{ time_s = 0 }, { time_s = 2, position_m = [0.1, 0, 0] }]\n";
        fs::write(&scene, text).unwrap();
        let session = tempfile::tempdir().unwrap();
        copy_scene(&scene, session.path()).unwrap();
        let path = session.path().join(SCENE_NAME);
        let written = fs::read_to_string(&path).unwrap();
        assert_eq!(written, text.replace("\"webcam:0\"", "\".\""));
        let [copy, original] = [&path, &scene].map(|path| Scene::load(path).unwrap());
        let things = |scene: &Scene| format!("{:?} {:?}", scene.phantoms, scene.virtuals);
        assert!(things(&copy) == things(&original));
    }

    #[test]
    fn what_holds_for_the_camera_alone_is_left_out_but_for_its_comments() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("a.toml");
        let text = "[camera]\n# the desk's\nsource = \"webcam:0\"  # on the arm\n# left for right\nmirror = true  # yes\n\
                    size_px = [640, 480]\nfps = 30\nformat = \"YUYV\"\n# the card\n[[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.04\n";
        fs::write(&scene, text).unwrap();
        let session = tempfile::tempdir().unwrap();
        copy_scene(&scene, session.path()).unwrap();
        let path = session.path().join(SCENE_NAME);
        let copy = Scene::load(&path).unwrap();
        assert!(!copy.camera.mirror);
        assert_eq!(copy.camera.wanted, crate::scene::WantedFormat::default());
        let written = fs::read_to_string(path).unwrap();
        for comment in [
            "# the desk's",
            "# on the arm",
            "# left for right",
            "# yes",
            "# the card",
        ] {
            assert!(written.contains(comment), "{comment}: {written}");
        }
    }

    #[test]
    fn a_picture_that_a_scene_lays_on_its_table_goes_along() {
        let folder = tempfile::tempdir().unwrap();
        let picture = |name: &str, grey: u8| {
            let picture = image::RgbImage::from_pixel(2, 1, image::Rgb([grey; 3]));
            picture.save(folder.path().join(name)).unwrap();
        };
        picture("cloth.png", 188);
        picture("a sheet.tga", 255);
        let scene = folder.path().join("scene.toml");
        let text = "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 0\nsize_m = 0.05\n\
                    [table]\nrect_m = [0, 0, 1, 1]\nalbedo_texture = \"cloth.png\"  # linen\n\
                    [[phantom]]\nname = \"p\"\nrect_m = [0.2, 0.3]\nmaterial = { albedo_texture = \"a sheet.tga\" }\n";
        fs::write(&scene, text).unwrap();
        let session = folder.path().join("session");
        fs::create_dir(&session).unwrap();
        copy_scene(&scene, &session).unwrap();
        fs::remove_file(folder.path().join("cloth.png")).unwrap();
        fs::remove_file(folder.path().join("a sheet.tga")).unwrap();
        let copied = session.join(SCENE_NAME);
        let copy = Scene::load(&copied).unwrap();
        let albedos = copy.phantoms.iter().map(|phantom| phantom.albedo(0).x);
        let percent: Vec<f64> = albedos.map(|albedo| (albedo * 100.0).round()).collect();
        assert_eq!(percent, [50.0, 100.0]);
        assert!(fs::read_to_string(&copied).unwrap().contains("# linen"));
    }

    #[test]
    fn nothing_is_written_where_a_scene_or_a_mesh_says() {
        let folder = tempfile::tempdir().unwrap();
        let home = folder.path().join("home");
        let models = home.join("deep/models");
        fs::create_dir_all(&models).unwrap();
        let profile = home.join(".profile");
        fs::write(&profile, "newmtl a\nKd .1 .2 .3\n").unwrap();
        fs::write(models.join("b.mtl"), "newmtl b\nKd .4 .5 .6\n").unwrap();
        let mesh = format!(
            "# mine\nmtllib ../../.profile b.mtl\nmtllib {}\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
             usemtl a\nf 1 2 3\nusemtl b\nf 1 4 2\n",
            profile.display()
        );
        fs::write(models.join("odd.name"), mesh).unwrap();
        let scene = home.join("scene.toml");
        let text = "camera = { source = \"webcam:0\", mirror = true }\nmarker = [{ name = \"m\", id = 1, size_m = 0.04 }]\n\
                    [[virtual]]\nname = \"t\"\nmesh = 'deep/models/odd.name'  # a tetrahedron\n\
                    [[virtual]]\nname = \"u\"\nmesh = \"deep/../deep/models/odd.name\"\n";
        fs::write(&scene, text).unwrap();
        let session = folder.path().join("outer/session");
        fs::create_dir_all(&session).unwrap();
        copy_scene(&scene, &session).unwrap();

        let mut found = Vec::new();
        let mut waiting = vec![folder.path().to_owned()];
        while let Some(next) = waiting.pop() {
            for entry in fs::read_dir(next).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    waiting.push(path);
                } else {
                    let name = path.strip_prefix(folder.path()).unwrap();
                    found.push(name.to_str().unwrap().to_owned());
                }
            }
        }
        found.sort();
        let expected = [
            "home/.profile",
            "home/deep/models/b.mtl",
            "home/deep/models/odd.name",
            "home/scene.toml",
            "outer/session/models/1/material-1.mtl",
            "outer/session/models/1/material-2.mtl",
            "outer/session/models/1/material-3.mtl",
            "outer/session/models/1/mesh.obj",
            "outer/session/scene.toml",
        ];
        assert_eq!(found, expected, "one copy of a mesh");
        assert!(fs::read_to_string(&profile).unwrap().contains(".1 .2 .3"));
        // The originals are not asked for again.
        fs::remove_dir_all(&home).unwrap();
        let copy = Scene::load(&session.join(SCENE_NAME)).unwrap();
        let albedos: Vec<f64> = (copy.virtuals[0].materials.iter())
            .map(|material| material.albedo.x)
            .collect();
        assert_eq!(albedos, [0.1, 0.4]);
        let text = fs::read_to_string(session.join(SCENE_NAME)).unwrap();
        assert!(text.contains("# a tetrahedron") && !text.contains("odd.name"));
    }
}
