//! Which things show what they mirror of what stands around them, and whether rays are followed for that (reflections.rs).

use crate::scene::{EnvironmentMethod, Object, Scene, ShadowTechnique};

/// Format of what is mirrored.
pub(super) const REFLECTIONS_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// A dielectric rougher than this shows nothing of what it mirrors: `ROUGHEST_DIELECTRIC` of reflections.wgsl.
pub(super) const ROUGHEST_DIELECTRIC: f64 = 0.5;

/// Whether rays are followed for a scene's glossy things.
pub(super) fn are_followed(scene: &Scene) -> bool {
    // (The paper's way of drawing gloss is there to be compared with.)
    let is_papers = scene.chosen_technique().0 == ShadowTechnique::Environment
        && scene.shadows.environment.method == EnvironmentMethod::Maps;
    scene.shadows.reflection_samples > 0 && !is_papers && scene.virtuals.iter().any(mirrors)
}

/// Whether a thing shows what it mirrors.
pub(super) fn mirrors(object: &Object) -> bool {
    let mut materials = object.materials.iter();
    materials.any(|material| {
        let roughness = material.layer_roughness();
        roughness
            .is_some_and(|roughness| roughness <= ROUGHEST_DIELECTRIC || material.metallic > 0.0)
    })
}
