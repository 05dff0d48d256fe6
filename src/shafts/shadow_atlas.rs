//! The sources' shadow maps as values: which tile of an atlas each has, and how it looks at the casters.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec2, Vec3, Vec4};

use super::bounding::Ball;
use super::selection::Representative;

/// Side of the largest atlas, pixels: 171 MiB with its levels and 64 of depth.
const LARGEST_ATLAS_PX: u32 = 4096;
/// Penumbras reach at most this many times the casters' size beyond their outline in a map.
const WIDEST_MARGIN: f32 = 2.0;

/// Tiles of one side in an atlas.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tiling {
    /// Side of a tile, pixels.
    pub tile_px: u32,
    columns: u32,
    rows: u32,
}

impl Tiling {
    /// Room for `count` tiles of `tile_px`, smaller ones where they would not fit.
    pub fn new(count: usize, tile_px: u32, largest_texture_px: u32) -> Self {
        let largest = LARGEST_ATLAS_PX.min(largest_texture_px);
        let count = count.max(1) as u32;
        let mut tile_px = tile_px.min(largest);
        while tile_px > 1 && (largest / tile_px).pow(2) < count {
            tile_px /= 2;
        }
        let columns = count.isqrt().max(count.div_ceil(largest / tile_px));
        let columns = columns.next_power_of_two().min(largest / tile_px);
        Self {
            tile_px,
            columns,
            rows: count.div_ceil(columns),
        }
    }

    /// Width and height of the atlas, pixels.
    pub fn size_px(&self) -> [u32; 2] {
        [self.columns * self.tile_px, self.rows * self.tile_px]
    }

    /// Where a tile begins, pixels.
    pub fn corner_px(&self, index: u32) -> [u32; 2] {
        [index % self.columns, index / self.columns].map(|place| place * self.tile_px)
    }

    /// Levels in which a tile has at least a texel.
    pub fn levels(&self) -> u32 {
        self.tile_px.ilog2() + 1
    }
}

/// A source with its shadow map, as the shaders read it: the twin of `MappedSource` in mapped_source.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MappedSource {
    /// World to the tile: (u w, v w, unused, w) with w the depth along the map's axis, metres.
    pub map_from_world: Mat4,
    /// Its middle.
    pub position: Vec3,
    /// Standard deviation of its light across the way to the casters.
    pub spread_m: f32,
    /// Radiant intensity towards the casters.
    pub intensity: Vec3,
    /// Texels of a tile per unit of tangent.
    pub focal_texels: f32,
    /// Where the tile begins, in parts of the atlas.
    pub tile_corner: Vec2,
    /// Its side, in parts of the atlas.
    pub tile_side: Vec2,
    /// Where casters begin, along the axis.
    pub near_m: f32,
    /// How far they reach from there.
    pub range_m: f32,
    /// Side of the tile, pixels.
    pub tile_px: f32,
    /// Nothing.
    pub padding: f32,
}

impl MappedSource {
    /// A representative with its tile; `None` where it lies among the casters. `reach_m` is how far behind the casters'
    /// middle receivers can be.
    pub fn new(
        chosen: &Representative,
        casters: &Ball,
        reach_m: f32,
        intensity: Vec3,
        tiling: &Tiling,
        index: u32,
    ) -> Option<Self> {
        let way = casters.center - chosen.position;
        let distance = way.length();
        if distance <= casters.radius * 1.1 {
            return None;
        }
        let axis = way / distance;
        let across = chosen.spread.x_axis.x + chosen.spread.y_axis.y + chosen.spread.z_axis.z
            - axis.dot(chosen.spread * axis);
        let spread_m = (across.max(0.0) / 2.0).sqrt();
        // Two standard deviations of the widest penumbra, as it lies in the casters' plane.
        let margin = 2.0 * spread_m * reach_m / (distance + reach_m);
        let radius = casters.radius + margin.min(WIDEST_MARGIN * casters.radius);
        // The ball's outline is a little wider than the ball.
        let tangent = radius / (distance * distance - casters.radius * casters.radius).sqrt();
        let (right, down) = axis.any_orthonormal_pair();
        let row = |direction: Vec3| direction.extend(-direction.dot(chosen.position));
        let depth = row(axis);
        let [u, v] = [right, down].map(|direction| row(direction) / (2.0 * tangent) + depth * 0.5);
        let near_m = distance - casters.radius;
        let [width, height] = tiling.size_px().map(|side| side as f32);
        let [x, y] = tiling.corner_px(index).map(|place| place as f32);
        let side = tiling.tile_px as f32;
        Some(Self {
            map_from_world: Mat4::from_cols(u, v, Vec4::ZERO, depth).transpose(),
            position: chosen.position,
            spread_m,
            intensity,
            focal_texels: side / (2.0 * tangent),
            tile_corner: Vec2::new(x / width, y / height),
            tile_side: Vec2::new(side / width, side / height),
            near_m,
            range_m: 2.0 * casters.radius,
            tile_px: side,
            padding: 0.0,
        })
    }

    /// Whether casters may hide the source from a triangle: whether it meets what the map shows.
    pub fn may_shade(&self, corners: [Vec3; 3]) -> bool {
        let placed = corners.map(|corner| self.map_from_world * corner.extend(1.0));
        if placed.iter().all(|corner| corner.w <= self.near_m) {
            return false;
        }
        // A triangle that reaches behind the source has no bounds in the map.
        if placed.iter().any(|corner| corner.w <= 1e-6) {
            return true;
        }
        let in_tile = placed.map(|corner| Vec2::new(corner.x, corner.y) / corner.w);
        let low = in_tile.into_iter().fold(Vec2::MAX, Vec2::min);
        let high = in_tile.into_iter().fold(Vec2::MIN, Vec2::max);
        low.cmple(Vec2::ONE).all() && high.cmpge(Vec2::ZERO).all()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Mat3;

    #[test]
    fn tiles_lie_apart_within_the_atlas() {
        for count in [1, 2, 10, 50, 64, 65, 300, 1000, 4096] {
            let tiling = Tiling::new(count, 256, 16_384);
            let [width, height] = tiling.size_px();
            assert!(width.max(height) <= LARGEST_ATLAS_PX, "{tiling:?}");
            let corners: std::collections::HashSet<_> = (0..count as u32)
                .map(|index| tiling.corner_px(index))
                .collect();
            assert_eq!(corners.len(), count);
            for [x, y] in corners {
                assert!(x + tiling.tile_px <= width && y + tiling.tile_px <= height);
            }
            assert_eq!(tiling.tile_px == 256, count <= 256);
        }
    }

    #[test]
    fn casters_lie_within_their_tile_and_its_depths() {
        let chosen = Representative {
            first: 0,
            last: 1,
            position: Vec3::new(1.0, -2.0, 1.5),
            spread: Mat3::from_diagonal(Vec3::new(0.04, 0.01, 0.0)),
            weight: 1.0,
        };
        let casters = Ball {
            center: Vec3::new(0.1, 0.0, 0.05),
            radius: 0.2,
        };
        let tiling = Tiling::new(4, 128, 4096);
        let source =
            MappedSource::new(&chosen, &casters, 0.3, Vec3::ONE, &tiling, 3).expect("outside");
        for direction in crate::shafts::surfels::cell_directions() {
            let point = casters.center + direction * casters.radius;
            let placed = source.map_from_world * point.extend(1.0);
            let (u, v) = (placed.x / placed.w, placed.y / placed.w);
            assert!(
                (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v),
                "{u} {v}"
            );
            let part = (placed.w - source.near_m) / source.range_m;
            assert!((-1e-5..=1.0 + 1e-5).contains(&part), "{part}");
        }
        let among = Representative {
            position: casters.center + Vec3::X * 0.15,
            ..chosen
        };
        assert!(MappedSource::new(&among, &casters, 0.3, Vec3::ONE, &tiling, 0).is_none());
    }
}
