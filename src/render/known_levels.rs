//! Other versions of meshes, which take long to make: coarser ones that may be drawn in their place where that is not seen, and
//! finer ones that light which is worked out at corners asks for.

use std::sync::Arc;

use super::precomputation::Precomputation;
use crate::environment::finer;
use crate::environment::self_occlusion::OwnSpace;
use crate::geometry::levels::{Level, levels};
use crate::geometry::mesh::Mesh;
use crate::scene::{Object, Scene, Shortcut};

/// Each with the mesh that it is of.
#[derive(Default)]
pub(super) struct KnownLevels {
    coarser: Vec<(Arc<Mesh>, Vec<Level>)>,
    /// In place of their meshes, without coarser ones.
    finer: Vec<(Arc<Mesh>, Mesh)>,
}

impl KnownLevels {
    /// Of a scene of whose meshes some are drawn as finer ones.
    pub fn new(
        scene: &Scene,
        finer: Vec<(Arc<Mesh>, Mesh)>,
        precomputation: &dyn Precomputation,
    ) -> Self {
        let mut known = Self {
            finer,
            ..Self::default()
        };
        for object in scene.phantoms.iter().chain(&scene.virtuals) {
            let is_finer = position(&known.finer, &object.mesh).is_some();
            if object.visible && has_levels(scene, object) && !is_finer {
                known.coarser_than(&object.mesh, |mesh| precomputation.levels(mesh));
            }
        }
        known
    }

    /// What a thing's mesh is drawn as, and coarser versions of that, made where they are not known.
    pub fn of<'a>(&'a mut self, scene: &Scene, object: &'a Object) -> (&'a Mesh, &'a [Level]) {
        let mesh = &object.mesh;
        if let Some(index) = position(&self.finer, mesh) {
            return (&self.finer[index].1, &[]);
        }
        match has_levels(scene, object) {
            true => (mesh, self.coarser_than(mesh, levels)),
            false => (mesh, &[]),
        }
    }

    fn coarser_than(
        &mut self,
        mesh: &Arc<Mesh>,
        make: impl FnOnce(&Mesh) -> Vec<Level>,
    ) -> &[Level] {
        let index = position(&self.coarser, mesh).unwrap_or_else(|| {
            self.coarser.push((Arc::clone(mesh), make(mesh)));
            self.coarser.len() - 1
        });
        &self.coarser[index].1
    }

    /// What a mesh is drawn as, the finest first.
    pub fn drawn<'a>(&'a self, mesh: &'a Arc<Mesh>) -> impl Iterator<Item = &'a Mesh> {
        let finer = position(&self.finer, mesh).map(|index| &self.finer[index].1);
        let coarser = position(&self.coarser, mesh).filter(|_| finer.is_none());
        let levels = coarser.map_or(&[][..], |index| &self.coarser[index].1);
        std::iter::once(finer.unwrap_or(mesh)).chain(levels.iter().map(|level| &level.mesh))
    }
}

/// The meshes of things whose light is worked out at corners and that have too few of these, each with a finer one.
pub(super) fn finer_meshes<'a>(
    lit_by_corners: impl Iterator<Item = &'a Object>,
    precomputation: &dyn Precomputation,
) -> Vec<(Arc<Mesh>, Mesh)> {
    let mut finer: Vec<(Arc<Mesh>, Mesh)> = Vec::new();
    for object in lit_by_corners {
        let mesh = &object.mesh;
        if object.animation.is_some() || finer.iter().any(|(known, _)| known == mesh) {
            continue;
        }
        let cuts = precomputation.cuts(mesh, &OwnSpace::new(&object.anchor_from_object));
        if !cuts.is_empty() {
            finer.push((Arc::clone(mesh), finer::finer(mesh, &cuts)));
        }
    }
    finer
}

/// Whether coarser versions of a thing may be drawn. (How far one is off is measured in one shape.)
fn has_levels(scene: &Scene, object: &Object) -> bool {
    scene.shadows.max_silhouette_error_px > 0.0
        && object.animation.is_none()
        && !scene.shadows.without.has(Shortcut::Levels)
}

/// Where a mesh is in a list. (To compare large meshes takes longer than a frame.)
fn position<T>(known: &[(Arc<Mesh>, T)], mesh: &Arc<Mesh>) -> Option<usize> {
    let same = |(known, _): &(Arc<Mesh>, T)| Arc::ptr_eq(known, mesh);
    let like = |(known, _): &(Arc<Mesh>, T)| known == mesh;
    known
        .iter()
        .position(same)
        .or_else(|| known.iter().position(like))
}
