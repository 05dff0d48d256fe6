//! What a renderer works out before its first frame and what takes seconds: somebody may know it already.

use crate::environment::finer::{Cuts, cuts};
use crate::environment::self_occlusion::{OwnSpace, OwnSurface, SelfOcclusion};
use crate::geometry::levels::{Level, levels};
use crate::geometry::mesh::Mesh;
use crate::shafts::room::Room;
use crate::shafts::room_transport::RoomTransport;

/// Gives what takes long.
pub trait Precomputation {
    /// A room's transport of light.
    fn transport(&self, room: &Room<'_>) -> RoomTransport {
        room.transport()
    }

    /// Whether somebody still waits for the renderer.
    fn goes_on(&self) -> bool {
        true
    }

    /// Coarser versions of a mesh.
    fn levels(&self, mesh: &Mesh) -> Vec<Level> {
        levels(mesh)
    }

    /// Where a mesh is made finer for what it hides from itself.
    fn cuts(&self, mesh: &Mesh, space: &OwnSpace) -> Cuts {
        cuts(mesh, space, &|| true).unwrap_or_default()
    }

    /// What a thing hides from itself, for each of its points.
    fn self_occlusions(&self, surface: &OwnSurface) -> Vec<SelfOcclusion> {
        surface.self_occlusions()
    }
}

/// Works all of it out.
#[derive(Debug, Clone, Copy)]
pub struct Afresh;

impl Precomputation for Afresh {}
