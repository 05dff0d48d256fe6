//! What the environment's shaders read.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat3, DVec4, Mat4, Vec3, Vec4};

use crate::environment::glossy::EnvironmentMatrix;
use crate::environment::occlusion_map::OcclusionMap;
use crate::environment::reflected::DiscNode;
use crate::environment::self_occlusion::{VISIBILITIES, VISIBILITY_DEGREE};
use crate::environment::thing::Thing;
use crate::light::harmonics::basis;
use crate::light::regions::Region;

use super::super::tables::{with_word, words};

/// A frame's part of group 2: the twin of `EnvironmentFrame` in environment.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct EnvironmentFrame {
    pub world_from_camera: Mat4,
    pub region_count: u32,
    pub caster_count: u32,
    pub real_caster_count: u32,
    pub disc_count: u32,
}

/// Two texels.
pub(super) fn region_texels(region: &Region) -> [[u32; 4]; 2] {
    [
        words(region.toward.as_vec3().extend(region.width() as f32)),
        words(region.irradiance.as_vec3().extend(region.spread as f32)),
    ]
}

/// Five texels.
pub(super) fn map_texels(map: &OcclusionMap) -> [[u32; 4]; 5] {
    let [u, v, depth] = map.tile_from_world.map(words);
    let (corner, side) = (map.tile_corner, map.tile_side);
    [
        u,
        v,
        depth,
        words(Vec4::new(corner.x, corner.y, side.x, side.y)),
        with_word(
            Vec3::new(map.texels_per_m, map.range_m, map.tile_px),
            map.thing,
        ),
    ]
}

/// Five texels.
pub(super) fn disc_texels(node: &DiscNode) -> [[u32; 4]; 5] {
    let disc = &node.whole;
    [
        words(disc.surfel.position.extend(disc.surfel.area)),
        with_word(disc.surfel.normal, disc.open as u32),
        with_word(disc.without, (disc.open >> 32) as u32),
        words((disc.without - disc.with).extend(0.0)),
        [node.radius.to_bits(), node.next, 0, 0],
    ]
}

/// For a thing its middle and the number of its group, and for each region the harmonics in its direction as the thing sees it: turning the thing
/// turns them. `anchor_from_own` says how its anchor is turned from it, `open` which regions the table leaves open.
pub(super) fn receiver_texels(
    (thing, group): (Option<&Thing>, u32),
    anchor_from_own: DMat3,
    world_from_anchor: &[Option<DAffine3>],
    regions: &[Region],
    open: &[bool],
) -> Vec<[u32; 4]> {
    let placed = thing.and_then(|thing| Some((thing, world_from_anchor[thing.anchor]?)));
    let Some((thing, pose)) = placed else {
        return vec![[0; 4]; 1 + VISIBILITIES / 4 * regions.len()];
    };
    let center = pose.transform_point3(thing.ball.center.as_dvec3());
    let mut texels = vec![words(center.as_vec3().extend(group as f32))];
    let turn = (pose.matrix3 * anchor_from_own).transpose();
    for (region, &is_open) in regions.iter().zip(open) {
        let basis = basis((turn * region.toward).normalize(), VISIBILITY_DEGREE);
        let scale = f64::from(u8::from(is_open));
        let rows = basis.as_chunks::<4>().0.iter();
        texels.extend(rows.map(|row| words(DVec4::from_array(*row).as_vec4() * scale as f32)));
    }
    texels
}

/// For each thing what the environment makes of its visibility, a texel for each entry; `world_from_own` says how it stands.
pub(super) fn gloss_texels(
    matrix: &EnvironmentMatrix,
    world_from_own: impl Iterator<Item = Option<DMat3>>,
) -> Vec<[u32; 4]> {
    let mut texels = Vec::new();
    for turn in world_from_own {
        match turn {
            Some(turn) => {
                let entries = matrix.seen_by(turn);
                let entries = entries.as_flattened().iter();
                texels.extend(entries.map(|entry| words(entry.as_vec3().extend(0.0))));
            }
            None => texels.extend([[0; 4]; VISIBILITIES * VISIBILITIES]),
        }
    }
    texels
}

/// The contents of a batch's buffer of self-occlusion.
pub(super) fn occlusion_corners(thing_of: &[u32], visibilities: &[[f32; VISIBILITIES]]) -> Vec<u8> {
    let mut contents = Vec::new();
    for (visibility, thing) in visibilities.iter().zip(thing_of) {
        contents.extend_from_slice(bytemuck::bytes_of(visibility));
        contents.extend_from_slice(bytemuck::bytes_of(thing));
    }
    contents
}
