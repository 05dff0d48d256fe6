//! Maps of what a thing hides of the light of a region (Tamura et al. 2005, section 4.2.2), as values: which tile of an atlas
//! each has, and how the region looks at the thing.

use bytemuck::{Pod, Zeroable};
use glam::{Affine3, Mat4, Vec2, Vec3, Vec4};

use crate::light::regions::Region;
use crate::shafts::bounding::Ball;
use crate::shafts::shadow_atlas::Tiling;

use super::placed::PlacedThing;

/// Penumbras reach at most this many times a thing's size beyond its outline in a map.
const WIDEST_MARGIN: f32 = 2.0;

/// A thing's map for a region, as the shaders read it: the twin of `OcclusionMap` in occlusion_maps.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct OcclusionMap {
    /// World to u, v and depth, a row each: u and v run from 0 to 1 over the tile, depth from 0 where the thing begins, metres
    /// away from the light.
    pub tile_from_world: [Vec4; 3],
    /// The same from the thing's anchor.
    pub tile_from_anchor: [Vec4; 3],
    /// Where the tile begins, in parts of the atlas.
    pub tile_corner: Vec2,
    /// Its side, in parts of the atlas.
    pub tile_side: Vec2,
    /// Texels of a metre.
    pub texels_per_m: f32,
    /// How deep the thing is, metres.
    pub range_m: f32,
    /// Side of the tile, texels.
    pub tile_px: f32,
    /// Number of the thing in the lower 16 bits, then that of its group, from 1 on, and in the highest bit whether it is the first
    /// of it; where a group is drawn as one, [`A_GROUP`].
    pub thing: u32,
}

/// Whose map that of a group is: no thing's.
pub const A_GROUP: u32 = 0xffff;
/// Bits of [`OcclusionMap::thing`] before those of the group.
const GROUP_SHIFT: u32 = 16;
/// The bit of the first of a group.
const FIRST_OF_GROUP: u32 = 1 << 31;

impl OcclusionMap {
    /// Of a thing that is nowhere.
    pub const NOWHERE: Self = Self {
        // (Every place lies beside the tile.)
        tile_from_world: [Vec4::NEG_W, Vec4::NEG_W, Vec4::ZERO],
        tile_from_anchor: [Vec4::NEG_W, Vec4::NEG_W, Vec4::ZERO],
        tile_corner: Vec2::ZERO,
        tile_side: Vec2::ZERO,
        texels_per_m: 0.0,
        range_m: 0.0,
        tile_px: 1.0,
        thing: A_GROUP,
    };

    /// Of a thing and a region, in the tile of a number; `reach_m` is how far behind the thing receivers can be.
    pub fn new(
        placed: &PlacedThing<'_>,
        region: &Region,
        reach_m: f32,
        tile: (&Tiling, u32),
        thing: u32,
    ) -> Self {
        let ball = Ball {
            center: placed
                .world_from_anchor
                .transform_point3(placed.thing.ball.center),
            ..placed.thing.ball
        };
        Self::around(&ball, region, reach_m, tile, thing).drawn_from(&placed.world_from_anchor)
    }

    /// The same as it is drawn from an anchor's space.
    pub fn drawn_from(self, world_from_anchor: &Affine3) -> Self {
        // A row times a matrix is the transposed matrix times it.
        let world_from_anchor = Mat4::from(*world_from_anchor).transpose();
        Self {
            tile_from_anchor: self.tile_from_world.map(|row| world_from_anchor * row),
            ..self
        }
    }

    /// The same of a thing in a group, by its number from 0 on.
    pub fn in_group(self, group: usize, is_first: bool) -> Self {
        let first = if is_first { FIRST_OF_GROUP } else { 0 };
        Self {
            thing: self.thing | (group as u32 + 1) << GROUP_SHIFT | first,
            ..self
        }
    }

    /// Of what is in a ball in the world.
    pub fn around(
        ball: &Ball,
        region: &Region,
        reach_m: f32,
        (tiling, index): (&Tiling, u32),
        thing: u32,
    ) -> Self {
        let center = ball.center;
        let radius = ball.radius.max(1e-6);
        let along = -region.toward.as_vec3();
        let (right, down) = along.any_orthonormal_pair();
        let margin = region.width() as f32 * reach_m;
        let half = radius + margin.min(WIDEST_MARGIN * radius);
        let row = |direction: Vec3, scale: f32, offset: f32| {
            (direction * scale).extend(offset - direction.dot(center) * scale)
        };
        let tile_from_world = [
            row(right, 0.5 / half, 0.5),
            row(down, 0.5 / half, 0.5),
            row(along, 1.0, radius),
        ];
        let [width, height] = tiling.size_px().map(|side| side as f32);
        let [x, y] = tiling.corner_px(index).map(|place| place as f32);
        let side = tiling.tile_px as f32;
        Self {
            tile_from_anchor: tile_from_world,
            tile_from_world,
            tile_corner: Vec2::new(x / width, y / height),
            tile_side: Vec2::new(side / width, side / height),
            texels_per_m: side / (2.0 * half),
            range_m: 2.0 * radius,
            tile_px: side,
            thing,
        }
    }
}
