//! What a person adds to a scene: a model's file or a shape, with a name that is free at a place that is free.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::app::authoring::{NewForm, NewThing};
use crate::scene::{Object, Placement, Scene};

/// A thing that somebody wants to have.
#[derive(Debug, Clone, PartialEq)]
pub struct WantedThing {
    /// Whether it is a phantom.
    pub is_real: bool,
    /// Its shape.
    pub shape: WantedShape,
    /// Name of the anchor that it is to stand on; `None`: the world.
    pub on: Option<String>,
}

/// The shape of a wanted thing.
#[derive(Debug, Clone, PartialEq)]
pub enum WantedShape {
    /// A model's file.
    Model(PathBuf),
    /// A box as large as a stack of notes.
    Box,
    /// A cylinder as large as a mug.
    Cylinder,
    /// A cone.
    Cone,
    /// A ball.
    Ball,
}

impl WantedShape {
    /// Those that need no file, with their names.
    pub const SHAPES: [(&'static str, Self); 4] = [
        ("box", Self::Box),
        ("cylinder", Self::Cylinder),
        ("cone", Self::Cone),
        ("ball", Self::Ball),
    ];

    fn name(&self) -> String {
        match self {
            Self::Model(path) => {
                allowed_name(&path.file_stem().unwrap_or_default().to_string_lossy())
            }
            shape => {
                let mut named = Self::SHAPES.iter().filter(|(_, named)| named == shape);
                named.next().map_or("thing", |(name, _)| name).to_owned()
            }
        }
    }

    /// As a scene in a folder has it.
    fn form(&self, folder: &Path) -> NewForm {
        match self {
            Self::Model(path) => NewForm::Mesh {
                file: file_from(folder, &named_file(folder, path)),
                fit_m: None,
            },
            Self::Box => NewForm::Box(DVec3::new(0.08, 0.06, 0.04)),
            Self::Cylinder => NewForm::Cylinder(0.04, 0.1),
            Self::Cone => NewForm::Cone(0.03, 0.08),
            Self::Ball => NewForm::Sphere(0.03),
        }
    }
}

impl WantedThing {
    /// What is added to a scene in a folder, under a name that is not `taken` either.
    pub fn in_scene(&self, scene: &Scene, folder: &Path, taken: impl Fn(&str) -> bool) -> NewThing {
        let on = self.on.clone().unwrap_or_else(|| {
            let world = scene.anchors.first();
            world.map_or_else(String::new, |world| world.name.clone())
        });
        let anchor = scene.anchors.iter().position(|anchor| anchor.name == on);
        NewThing {
            is_real: self.is_real,
            name: free_name(scene, &self.shape.name(), taken),
            form: self.shape.form(folder),
            placement: Placement {
                position_m: free_place(scene, anchor.unwrap_or(0), DVec3::ZERO),
                ..Placement::default()
            },
            on,
        }
    }
}

/// All things but the table, which has no place of its own.
fn things(scene: &Scene) -> impl Iterator<Item = &Object> {
    scene.phantoms.iter().chain(&scene.virtuals)
}

/// A name that a scene does not have yet and that is not `taken`: the wanted one, or with a number behind it.
pub fn free_name(scene: &Scene, wanted: &str, taken: impl Fn(&str) -> bool) -> String {
    let is_free = |name: &str| things(scene).all(|thing| thing.name != name) && !taken(name);
    let numbered = (2..).map(|number| format!("{wanted} {number}"));
    let mut names = std::iter::once(wanted.to_owned()).chain(numbered);
    names.find(|name| is_free(name)).unwrap_or_default()
}

/// What of a text a name may have.
pub fn allowed_name(text: &str) -> String {
    let allowed = |character: char| match character {
        ',' | ';' | '"' | '\'' | '\n' | '\r' => '_',
        other if other.is_control() => '_',
        other => other,
    };
    let name: String = text.chars().map(allowed).collect();
    match name.trim() {
        "" => "thing".to_owned(),
        name => name.to_owned(),
    }
}

/// A place on an anchor where nothing that casts shadows is, as near to `wanted` as there is one, metres.
pub fn free_place(scene: &Scene, anchor: usize, wanted: DVec3) -> DVec3 {
    const STEP_M: f64 = 0.06;
    const MOST_STEPS: i32 = 12;
    // (About half of what comes.)
    const MARGIN_M: f64 = 0.04;
    let there = things(scene).filter(|thing| thing.stands_on() == anchor && thing.casts);
    let boxes: Vec<_> = there.filter_map(Object::bounds_in_anchor).collect();
    let is_free = |place: &DVec3| {
        boxes.iter().all(|bounds| {
            let low = bounds.low.truncate() - MARGIN_M;
            let high = bounds.high.truncate() + MARGIN_M;
            let place = place.truncate();
            place.cmplt(low).any() || place.cmpgt(high).any()
        })
    };
    let side = -MOST_STEPS..=MOST_STEPS;
    let steps = side.clone().flat_map(|y| side.clone().map(move |x| (x, y)));
    let mut steps: Vec<(i32, i32)> = steps.collect();
    // (Of places as near to it the one on the right, then the one behind.)
    steps.sort_by_key(|&(x, y)| (x * x + y * y, -x, -y));
    let place =
        |&(x, y): &(i32, i32)| wanted + STEP_M * DVec3::new(f64::from(x), f64::from(y), 0.0);
    steps.iter().map(place).find(is_free).unwrap_or(wanted)
}

/// A file that somebody has named: from the current folder or, where it is not there, from the scene's.
pub fn named_file(folder: &Path, file: &Path) -> PathBuf {
    let in_folder = folder.join(file);
    match !file.exists() && in_folder.exists() {
        true => in_folder,
        false => file.to_owned(),
    }
}

/// How a scene in a folder names a file: from there if it lies there.
fn file_from(folder: &Path, file: &Path) -> String {
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let (folder, file) = (whole(folder), whole(file));
    file.strip_prefix(&folder)
        .unwrap_or(&file)
        .to_string_lossy()
        .into_owned()
}

/// Why a file that somebody chose or dropped is no model, as far as its name and place tell; `None`: it may be one.
pub fn no_model(file: &Path) -> Option<String> {
    let shown = file.display();
    if file.to_str().is_none() {
        return Some(format!(
            "{shown}: its name is not UTF-8 text, which a scene's file has to be; rename it"
        ));
    }
    if file.is_dir() {
        return Some(format!("{shown} is a folder; add the model's file in it"));
    }
    if !file.exists() {
        return Some(format!(
            "{shown}: no such file, neither here nor in the scene's folder"
        ));
    }
    let extension = file.extension().and_then(|extension| extension.to_str());
    match extension.unwrap_or_default().to_lowercase().as_str() {
        "toml" => Some(format!(
            "{shown} is no model; a scene is opened with gnomon live"
        )),
        "mp4" | "mov" | "mkv" | "avi" | "webm" | "m4v" => Some(format!(
            "{shown} is a video, no model; what is played is the scene's [camera] source"
        )),
        "mtl" | "bin" => Some(format!(
            "{shown} belongs to a model; add that one's own file (.obj, .gltf)"
        )),
        _ => None,
    }
}

/// What a model whose numbers cannot be metres on a table is scaled to: its longest side, metres. `None`: it may be so large.
pub fn fit_m(thing: &Object) -> Option<f64> {
    const LARGEST_M: f64 = 1.0;
    const SMALLEST_M: f64 = 0.002;
    const FITTING_M: f64 = 0.1;
    let bounds = thing.bounds_in_anchor()?;
    let longest_m = (bounds.high - bounds.low).max_element();
    (!(SMALLEST_M..=LARGEST_M).contains(&longest_m)).then_some(FITTING_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(things: &str) -> Scene {
        let text = format!(
            "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 0\nsize_m = 0.05\n{things}"
        );
        Scene::parse(Path::new("scene.toml"), &text).expect("a scene")
    }

    #[test]
    fn names_and_places_are_free() {
        let box_at_origin = "[[virtual]]\nname = \"box\"\nbox_m = [0.1, 0.1, 0.1]\n";
        let scene = scene(&format!(
            "{box_at_origin}[[phantom]]\nname = \"box 2\"\nsphere_m = 0.02\nposition_m = [0.12, 0, 0]\n"
        ));
        let wanted = WantedThing {
            is_real: false,
            shape: WantedShape::Box,
            on: None,
        };
        let new = wanted.in_scene(&scene, Path::new("/somewhere"), |_| false);
        assert_eq!((new.name.as_str(), new.on.as_str()), ("box 3", "m"));
        let taken = |name: &str| name == "box 3";
        let other = wanted.in_scene(&scene, Path::new("/somewhere"), taken);
        assert_eq!(other.name, "box 4");
        assert!(new.placement.position_m.distance(DVec3::Y * 0.12) < 1e-9);
        assert_eq!(allowed_name(" a,\"b\"; "), "a__b__");
        assert_eq!(allowed_name(" "), "thing");
        assert_eq!(
            file_from(Path::new("/a/b"), Path::new("/a/b/c/d.obj")),
            "c/d.obj"
        );
        assert_eq!(
            file_from(Path::new("/a/b"), Path::new("/a/x.obj")),
            "/a/x.obj"
        );
    }

    #[test]
    fn things_that_are_added_stay_near_and_none_stands_in_another() {
        let mut things = String::new();
        let mut places: Vec<DVec3> = Vec::new();
        for number in 0..9 {
            let place = free_place(&scene(&things), 0, DVec3::ZERO);
            assert!(
                places.iter().all(|it| it.distance(place) > 0.08),
                "{places:?}"
            );
            assert!(place.length() < 0.2, "{place}");
            let DVec3 { x, y, .. } = place;
            things += &format!(
                "[[virtual]]\nname = \"{number}\"\nsphere_m = 0.03\nposition_m = [{x}, {y}, 0]\n"
            );
            places.push(place);
        }
    }

    #[test]
    fn a_file_is_looked_for_here_and_beside_the_scene() {
        let folder = tempfile::tempdir().unwrap();
        let wheel = folder.path().join("wheel.obj");
        std::fs::write(&wheel, "").unwrap();
        assert_eq!(named_file(folder.path(), Path::new("wheel.obj")), wheel);
        let here = Path::new("Cargo.toml");
        assert_eq!(named_file(folder.path(), here), here);
        let told = no_model(&named_file(folder.path(), Path::new("none.obj")));
        assert!(told.unwrap().starts_with("none.obj: no such file"));
    }

    #[test]
    fn models_in_millimetres_and_houses_are_scaled() {
        let fit = |side: f64| {
            let scene = scene(&format!(
                "[[virtual]]\nname = \"t\"\nbox_m = [{side}, {side}, {side}]\n"
            ));
            fit_m(&scene.virtuals[0])
        };
        assert_eq!(fit(0.1), None);
        assert_eq!(fit(0.8), None);
        assert_eq!(fit(80.0), Some(0.1));
        assert_eq!(fit(0.001), Some(0.1));
    }
}
