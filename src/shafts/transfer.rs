//! What each patch sends to each receiver vertex (Gibson et al. 2003, section 5): form factor times visibility.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::ray_caster::RayCaster;

use super::form_factor::form_factor;
use super::light_of_room::START_OFFSET_M;
use super::patches::{PatchVertex, RoomPatches};
use super::points::points_on;

/// Rays for a patch that covers much of the hemisphere, and for one that hardly shows.
const MOST_RAYS: f32 = 16.0;
const LEAST_RAYS: f32 = 2.0;
/// Rays for each unit of the form factor.
const RAYS_PER_FORM_FACTOR: f32 = 4000.0;
/// Vertices look from this part of the way to their patches' middle, metres at most: a corner in a corner sees nothing.
const INSET_M: f32 = 5e-4;

/// Visible form factors from receiver vertices to senders.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Transfers {
    sender_count: usize,
    /// Row by row, a row for each vertex.
    form_factors: Vec<f32>,
}

impl Transfers {
    /// For each vertex of `patches` and each patch of `senders` (indices of patches, in the order that counts).
    pub fn new(patches: &RoomPatches, senders: &[u32], caster: &RayCaster) -> Self {
        let sender_corners: Vec<([Vec3; 3], Vec3)> = senders
            .iter()
            .map(|&sender| {
                let patch = &patches.patches[sender as usize];
                (patches.corners(patch), patches.normal(patch))
            })
            .collect();
        let insets = insets(patches);
        let vertices = patches.vertices.par_iter().zip(&insets);
        let form_factors = vertices.flat_map_iter(|(vertex, inset)| {
            let PatchVertex { position, normal } = *vertex;
            let start = position + *inset + normal * START_OFFSET_M;
            let row = sender_corners.iter();
            row.map(move |(corners, sender_normal)| {
                visible_form_factor(start, normal, *corners, *sender_normal, caster)
            })
        });
        Self {
            sender_count: senders.len(),
            form_factors: form_factors.collect(),
        }
    }

    /// Those of one vertex, in the senders' order.
    pub fn row(&self, vertex: usize) -> &[f32] {
        &self.form_factors[vertex * self.sender_count..(vertex + 1) * self.sender_count]
    }
}

/// From each vertex a little towards the middle of its patches.
fn insets(patches: &RoomPatches) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; patches.vertices.len()];
    for patch in &patches.patches {
        let center = patches.center(patch);
        for &vertex in &patch.vertices {
            sums[vertex as usize] += center - patches.vertices[vertex as usize].position;
        }
    }
    let inset = |sum: Vec3| (sum * 0.05).clamp_length_max(INSET_M);
    sums.into_iter().map(inset).collect()
}

fn visible_form_factor(
    start: Vec3,
    normal: Vec3,
    corners: [Vec3; 3],
    sender_normal: Vec3,
    caster: &RayCaster,
) -> f32 {
    let above = corners
        .iter()
        .any(|corner| (corner - start).dot(normal) > 0.0);
    if !above || sender_normal.dot(start - corners[0]) <= 0.0 {
        return 0.0;
    }
    let whole = form_factor(start, normal, corners);
    if whole < 1e-9 {
        return 0.0;
    }
    let rays = (whole * RAYS_PER_FORM_FACTOR).clamp(LEAST_RAYS, MOST_RAYS) as usize;
    let (mut counted, mut seen) = (0, 0);
    for point in points_on(corners, rays) {
        let way = point - start;
        if way.dot(normal) > 0.0 {
            counted += 1;
            seen += u32::from(!caster.is_hidden(start, way, 1.0 - 1e-4));
        }
    }
    if counted == 0 {
        return 0.0;
    }
    whole * seen as f32 / counted as f32
}

/// Irradiance of a vertex whose form factors come in the order of the senders' radiances.
pub fn irradiance(row: &[f32], radiances: &[Vec3]) -> Vec3 {
    let parts = row.iter().zip(radiances);
    parts
        .map(|(&part, &radiance)| radiance * part)
        .sum::<Vec3>()
        * PI
}
