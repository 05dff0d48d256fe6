//! What a person can change in a scene, and what becomes of the scene before it is written.

use glam::DVec3;

use crate::light::Light;
use crate::scene::{Object, Placement, Scene, ShadowChange};

/// One change of a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Edit {
    /// Another place, direction, strength or size of a light; its kind may change, what it stands on does not.
    Light {
        /// Index into [`Scene::lights`].
        index: usize,
        /// What it becomes, in the space of what it stands on.
        light: Light,
    },
    /// One more light, in the world.
    AddLight(Light),
    /// A light less, by its index into [`Scene::lights`].
    RemoveLight(usize),
    /// Radiance of the surrounding light, linear RGB.
    Ambient(DVec3),
    /// Where a phantom or a virtual thing stands.
    Place {
        /// Its name.
        thing: String,
        /// Where it comes to stand.
        placement: Placement,
    },
    /// Whether a phantom or a virtual thing is there.
    Show {
        /// Its name.
        thing: String,
        /// Whether it is.
        visible: bool,
    },
    /// How shadows are made.
    Shadows(ShadowChange),
    /// A marker printed larger or smaller than the scene says; a board is stretched as a whole.
    AnchorSize {
        /// Its name.
        anchor: String,
        /// Side of its (first) marker's black square, metres.
        size_m: f64,
    },
    /// One more virtual thing.
    AddVirtual(NewVirtual),
    /// A virtual thing less, by its name.
    RemoveVirtual(String),
}

/// A virtual thing that the scene does not have yet.
#[derive(Debug, Clone, PartialEq)]
pub struct NewVirtual {
    /// A name that no other thing has.
    pub name: String,
    /// Its OBJ file, as it is to be written.
    pub mesh: String,
    /// Name of the anchor that it stands on.
    pub on: String,
    /// Where it stands.
    pub placement: Placement,
}

impl Edit {
    /// What was done, for a menu or a message.
    pub fn label(&self) -> String {
        match self {
            Self::Light { index, .. } => format!("change light {index}"),
            Self::AddLight(_) => "add a light".to_owned(),
            Self::RemoveLight(index) => format!("remove light {index}"),
            Self::Ambient(_) => "change the ambient light".to_owned(),
            Self::Place { thing, .. } => format!("place \"{thing}\""),
            Self::Show { thing, visible } => {
                format!("{} \"{thing}\"", if *visible { "show" } else { "hide" })
            }
            Self::Shadows(_) => "change how shadows are made".to_owned(),
            Self::AnchorSize { anchor, .. } => format!("resize \"{anchor}\""),
            Self::AddVirtual(new) => format!("add \"{}\"", new.name),
            Self::RemoveVirtual(name) => format!("remove \"{name}\""),
        }
    }

    /// Makes the change in a scene in memory, as long as it lasts (a drag). False where only reading the written scene
    /// tells what it gives, or the scene has no such thing.
    pub fn show_in(&self, scene: &mut Scene) -> bool {
        match self {
            Self::Light { index, light } => match scene.lights.get_mut(*index) {
                Some(shown) => shown.light = *light,
                None => return false,
            },
            Self::AddLight(light) => scene.lights.push((*light).into()),
            Self::RemoveLight(index) if *index < scene.lights.len() => {
                scene.lights.remove(*index);
            }
            Self::Ambient(radiance) => scene.ambient_radiance = *radiance,
            Self::Place { thing, placement } => match thing_of(scene, thing) {
                Some(object) => place(object, placement),
                None => return false,
            },
            Self::Show { thing, visible } => match thing_of(scene, thing) {
                Some(object) => object.visible = *visible,
                None => return false,
            },
            Self::Shadows(change) => scene.shadows = change.made_in(scene.shadows),
            Self::AnchorSize { anchor, size_m } => {
                let found = scene.anchors.iter_mut().find(|found| found.name == *anchor);
                let Some(markers) = found.map(|found| &mut found.markers) else {
                    return false;
                };
                let Some(stretch) = markers.first().map(|first| size_m / first.size_m) else {
                    return false;
                };
                for marker in markers {
                    *marker = marker.stretched(stretch);
                }
            }
            Self::RemoveVirtual(name) if scene.virtuals.iter().any(|thing| thing.name == *name) => {
                scene.virtuals.retain(|thing| thing.name != *name);
            }
            Self::RemoveLight(_) | Self::RemoveVirtual(_) | Self::AddVirtual(_) => return false,
        }
        true
    }
}

fn thing_of<'a>(scene: &'a mut Scene, name: &str) -> Option<&'a mut Object> {
    let mut things = scene.phantoms.iter_mut().chain(&mut scene.virtuals);
    things.find(|thing| thing.name == name)
}

/// A placement that begins or ends to mirror turns the triangles round, so that their outside stays outside.
fn place(object: &mut Object, placement: &Placement) {
    let placed = placement.anchor_from_object();
    if placed.matrix3.determinant() * object.anchor_from_object.matrix3.determinant() < 0.0 {
        object.mesh = std::mem::take(&mut object.mesh).with_winding_reversed();
    }
    object.anchor_from_object = placed;
}
