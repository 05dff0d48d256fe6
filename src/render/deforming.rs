//! Things that change their shape from frame to frame, as values.

use crate::scene::{Object, Scene};

use super::anchor_geometry::Role;

/// A thing in the shape that it has now.
pub(super) struct DeformingThing {
    pub role: Role,
    /// Its number in the scene, phantoms first, and among those of its role.
    pub number: usize,
    pub index: usize,
    /// Number of its first material among those of its role.
    pub first_material: u32,
    pub object: Object,
    /// Whether the technique does not know its shape yet.
    pub is_news: bool,
}

/// Those of a scene.
pub(super) fn deforming(scene: &Scene) -> Vec<DeformingThing> {
    let mut found = Vec::new();
    let phantom_count = scene.phantoms.len();
    for (role, first_number, objects) in [
        (Role::Real, 0, &scene.phantoms),
        (Role::Virtual, phantom_count, &scene.virtuals),
    ] {
        let mut first_material = 0;
        for (index, object) in objects.iter().enumerate() {
            if object.animation.is_some() {
                found.push(DeformingThing {
                    role,
                    number: first_number + index,
                    index,
                    first_material,
                    object: object.clone(),
                    is_news: false,
                });
            }
            first_material += object.materials.len() as u32;
        }
    }
    found
}
