//! What a person can change in a scene, and what becomes of the scene before it is written.

use std::sync::Arc;

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
    /// One more phantom or virtual thing.
    AddThing(NewThing),
    /// One more that is like another: all that the file says of that, under another name and at another place.
    Duplicate {
        /// Name of what is there.
        thing: String,
        /// A name that no other thing has.
        name: String,
        /// Where the new one stands, metres in the space of what both stand on.
        position_m: DVec3,
    },
    /// Another name of a phantom or a virtual thing.
    Rename {
        /// What it is called now.
        thing: String,
        /// A name that no other thing has.
        name: String,
    },
    /// What a phantom or a virtual thing is made of, in place of what its file says.
    Material {
        /// Its name.
        thing: String,
        /// Diffuse reflectance, linear RGB, 0 to 1; `None`: as it is.
        albedo: Option<DVec3>,
        /// Of a GGX layer over it; `None`: as it is.
        roughness: Option<f64>,
        /// Part that is metal; `None`: as it is.
        metallic: Option<f64>,
    },
    /// What plays of a thing's model; how fast and how often go with what played before.
    Animate {
        /// Its name.
        thing: String,
        /// The animation's name, or its number where it has none; `None`: its rest pose.
        animation: Option<AnimationName>,
    },
    /// A phantom or a virtual thing less, by its name.
    RemoveThing(String),
}

/// How a scene names an animation of a model's file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AnimationName {
    /// By its name there.
    Named(String),
    /// By its number there, counted from 0.
    Numbered(usize),
}

/// A phantom or a virtual thing that the scene does not have yet.
#[derive(Debug, Clone, PartialEq)]
pub struct NewThing {
    /// Whether it is a phantom: a real thing that only lets light and shadow know of it.
    pub is_real: bool,
    /// A name that no other thing has.
    pub name: String,
    /// Its shape.
    pub form: NewForm,
    /// Name of the anchor that it stands on.
    pub on: String,
    /// Where it stands.
    pub placement: Placement,
}

/// The shape of a new thing, metres.
#[derive(Debug, Clone, PartialEq)]
pub enum NewForm {
    /// A model's file.
    Mesh {
        /// As it is to be written: from the scene's own folder, or a whole path.
        file: String,
        /// What its longest side is scaled to; `None`: its numbers are metres.
        fit_m: Option<f64>,
    },
    /// A box of these sides.
    Box(DVec3),
    /// A cylinder: its radius and its height.
    Cylinder(f64, f64),
    /// A cone: its radius and its height.
    Cone(f64, f64),
    /// A ball: its radius.
    Sphere(f64),
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
            Self::AddThing(new) => format!("add \"{}\"", new.name),
            Self::Duplicate { thing, .. } => format!("duplicate \"{thing}\""),
            Self::Rename { thing, name } => format!("rename \"{thing}\" to \"{name}\""),
            Self::Material { thing, .. } => format!("paint \"{thing}\""),
            Self::Animate { thing, .. } => format!("play \"{thing}\" otherwise"),
            Self::RemoveThing(name) => format!("remove \"{name}\""),
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
            Self::RemoveThing(name) if thing_of(scene, name).is_some() => {
                scene.phantoms.retain(|thing| thing.name != *name);
                scene.virtuals.retain(|thing| thing.name != *name);
            }
            Self::Rename { thing, name } => match thing_of(scene, thing) {
                Some(object) => object.name.clone_from(name),
                None => return false,
            },
            Self::Material {
                thing,
                albedo,
                roughness,
                metallic,
            } => match thing_of(scene, thing) {
                Some(object) => {
                    for material in &mut object.materials {
                        material.albedo = albedo.unwrap_or(material.albedo);
                        material.roughness = roughness.or(material.roughness);
                        material.metallic = metallic.unwrap_or(material.metallic);
                    }
                }
                None => return false,
            },
            Self::RemoveLight(_)
            | Self::RemoveThing(_)
            | Self::AddThing(_)
            | Self::Animate { .. }
            | Self::Duplicate { .. } => return false,
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
        let mesh = Arc::unwrap_or_clone(std::mem::take(&mut object.mesh));
        object.mesh = Arc::new(mesh.with_winding_reversed());
    }
    object.anchor_from_object = placed;
}
