//! The technique that draws a renderer's shadows, with all that it alone needs.

use super::super::accumulated::Accumulated;
use super::super::background::Background;
use super::super::combined::Combined;
use super::super::direct::Direct;
use super::super::environment::{Environment, things_lit_by_corners};
use super::super::final_gather::FinalGather;
use super::super::gpu::Gpu;
use super::super::gpu_scene::GpuScene;
use super::super::indirect::lit_by_surroundings;
use super::super::known_levels::{KnownLevels, finer_meshes};
use super::super::light_kind::LightKind;
use super::super::light_piece::LitBy;
use super::super::precomputation::Precomputation;
use super::super::shafts::{Shafts, ShaftsAlone};
use super::super::surfaces::First;
use super::super::technique::TechniquePasses;
use crate::geometry::camera::Intrinsics;
use crate::scene::{Scene, SceneLight, ShadowTechnique, Shortcut};

/// A renderer's technique.
pub(super) enum ChosenTechnique {
    /// One light and one sample, shaded straight into the picture.
    Direct(Direct),
    /// Several lights or samples, added up.
    Accumulated(Accumulated),
    /// A room's light.
    Shafts(Box<ShaftsAlone>),
    /// Broad light of a room or an environment, and compact lights.
    Combined(Box<Combined>),
}

impl ChosenTechnique {
    /// Coarser versions of a scene's meshes, and finer ones where its technique asks for them.
    pub fn known_levels(scene: &Scene, precomputation: &dyn Precomputation) -> KnownLevels {
        let finer = match (scene.chosen_technique().0, &scene.probe) {
            (ShadowTechnique::Environment, Some(_)) => {
                finer_meshes(things_lit_by_corners(scene), precomputation)
            }
            (ShadowTechnique::Volumes, _) => {
                finer_meshes(lit_by_surroundings(scene), precomputation)
            }
            (ShadowTechnique::Environment, None)
            | (ShadowTechnique::Shafts | ShadowTechnique::Both, _) => Vec::new(),
        };
        KnownLevels::new(scene, finer, precomputation)
    }

    /// The technique of a scene, and the scene as it draws it.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        intrinsics: Intrinsics,
        background: &Background,
        known: KnownLevels,
        precomputation: &dyn Precomputation,
    ) -> (Self, GpuScene) {
        match (scene.chosen_technique().0, &scene.probe) {
            (ShadowTechnique::Shafts | ShadowTechnique::Both, Some(probe)) => {
                let gpu_scene = GpuScene::new(gpu, scene, intrinsics, LitBy::Room, known);
                let kinds = gpu_scene.kinds;
                let shafts = Shafts::new(gpu, scene, probe, kinds, precomputation);
                let technique = match gpu_scene.light_count() {
                    0 => {
                        let alone = ShaftsAlone::new(gpu, scene, background, shafts);
                        Self::Shafts(Box::new(alone))
                    }
                    _ => {
                        let (samples, first) = (scene.shadows.samples, First::DepthAlone);
                        let compact = Accumulated::new(gpu, background, samples, kinds, first);
                        Self::Combined(Box::new(Combined::new(compact, Box::new(shafts))))
                    }
                };
                (technique, gpu_scene)
            }
            (ShadowTechnique::Environment, Some(probe)) => {
                let gpu_scene = GpuScene::new(gpu, scene, intrinsics, LitBy::Room, known);
                let (samples, kinds) = (scene.shadows.samples, gpu_scene.kinds);
                let broad = Environment::new(gpu, scene, probe, &gpu_scene, precomputation);
                let compact = Accumulated::new(gpu, background, samples, kinds, First::DepthAlone);
                let combined = Combined::new(compact, Box::new(broad));
                (Self::Combined(Box::new(combined)), gpu_scene)
            }
            // (No scene that was read has shafts or an environment without a probe.)
            (ShadowTechnique::Volumes, _)
            | (
                ShadowTechnique::Shafts | ShadowTechnique::Both | ShadowTechnique::Environment,
                None,
            ) => {
                let gpu_scene = GpuScene::new(gpu, scene, intrinsics, LitBy::Lights, known);
                let (samples, kinds) = (scene.shadows.samples, gpu_scene.kinds);
                // (A lamp that moves along may be lost, and one of some size has soft shadows.)
                let is_plain = |light: &SceneLight| light.anchor == 0 && !light.light.has_size();
                let final_gather = FinalGather::of_ambient(gpu, scene);
                let is_direct = samples == 1
                    && final_gather.is_none()
                    && !scene.shadows.without.has(Shortcut::Direct);
                let technique = match &scene.lights[..] {
                    [one] if is_direct && is_plain(one) => {
                        let light = LightKind::of(&one.light);
                        Self::Direct(Direct::new(gpu, background, kinds, light))
                    }
                    _ => {
                        let first = First::Ambient;
                        let lights = Accumulated::new(gpu, background, samples, kinds, first);
                        Self::Accumulated(lights.with_final_gather(final_gather))
                    }
                };
                (technique, gpu_scene)
            }
        }
    }

    /// Its steps.
    pub fn passes(&self) -> &dyn TechniquePasses {
        match self {
            Self::Direct(direct) => direct,
            Self::Accumulated(accumulated) => accumulated,
            Self::Shafts(shafts) => shafts.as_ref(),
            Self::Combined(combined) => combined.as_ref(),
        }
    }

    /// Its steps that change it.
    pub fn passes_mut(&mut self) -> &mut dyn TechniquePasses {
        match self {
            Self::Direct(direct) => direct,
            Self::Accumulated(accumulated) => accumulated,
            Self::Shafts(shafts) => shafts.as_mut(),
            Self::Combined(combined) => combined.as_mut(),
        }
    }
}
