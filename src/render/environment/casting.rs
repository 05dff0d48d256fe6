//! The maps of what things hide, and what they are drawn from.
//! Reads the things that cast. Writes the atlas.

use std::ops::Range;

use glam::Vec3;

use crate::environment::distant_light::DistantLight;
use crate::environment::occlusion_map::OcclusionMap;
use crate::environment::placed::PlacedScene;
use crate::environment::thing::Thing;
use crate::shafts::shadow_atlas::Tiling;

use super::super::gpu::Gpu;
use super::super::map_atlas::MapAtlas;
use super::super::passes::Passes;

/// One map for each caster and region.
pub(super) struct Casting {
    /// The numbers of those that cast, the real ones first.
    pub casters: Vec<usize>,
    /// Triangles of all casters, each in its anchor's space, and which are whose.
    triangles: wgpu::Buffer,
    ranges: Vec<Range<u32>>,
    region_count: usize,
    tiling: Tiling,
    pub atlas: MapAtlas,
}

impl Casting {
    /// Of things by their numbers; maps are `map_px` wide where all fit.
    pub fn new(gpu: &Gpu, things: &[Option<Thing>], region_count: usize, map_px: u32) -> Self {
        let casting = things.iter().enumerate().filter_map(|(number, thing)| {
            let thing = thing.as_ref().filter(|thing| thing.casts)?;
            Some((number, thing))
        });
        let mut triangles: Vec<[Vec3; 3]> = Vec::new();
        let mut casters = Vec::new();
        let mut ranges = Vec::new();
        for (number, thing) in casting {
            let first = 3 * triangles.len() as u32;
            triangles.extend(&thing.triangles);
            ranges.push(first..3 * triangles.len() as u32);
            casters.push(number);
        }
        let largest_px = gpu.device.limits().max_texture_dimension_2d;
        let tiling = Tiling::new(casters.len() * region_count, map_px, largest_px);
        Self {
            casters,
            triangles: gpu.buffer(
                "environment's casters",
                bytemuck::cast_slice(&triangles),
                wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            ),
            ranges,
            region_count,
            atlas: MapAtlas::new(gpu, tiling, "occlusion_maps.wgsl"),
            tiling,
        }
    }

    /// Takes the shape that a thing has now, by its number.
    pub fn deform(&self, gpu: &Gpu, number: usize, thing: &Thing) {
        let caster = self.casters.iter().position(|&caster| caster == number);
        let Some(range) = caster.and_then(|caster| self.ranges.get(caster)) else {
            return;
        };
        let corners = thing.triangles.as_flattened();
        // (Always as many: nothing is left out of what changes its shape.)
        if corners.len() == range.len() {
            let offset = u64::from(range.start) * size_of::<Vec3>() as u64;
            gpu.queue
                .write_buffer(&self.triangles, offset, bytemuck::cast_slice(corners));
        }
    }

    /// For each caster and region its map.
    pub fn maps(&self, scene: &PlacedScene<'_>, distant: &DistantLight) -> Vec<OcclusionMap> {
        let reach_m = scene.reach_m();
        let mut maps = Vec::new();
        for &caster in &self.casters {
            let placed = scene.position(caster);
            for region in &distant.regions {
                let index = maps.len() as u32;
                maps.push(match placed {
                    Some(placed) => OcclusionMap::new(
                        &scene.things[placed],
                        region,
                        reach_m,
                        (&self.tiling, index),
                        caster as u32,
                    ),
                    None => OcclusionMap::NOWHERE,
                });
            }
        }
        maps
    }

    /// Draws all maps.
    pub fn draw(&self, gpu: &Gpu, passes: &mut Passes<'_>, maps: &wgpu::Buffer) {
        let count = (self.casters.len() * self.region_count) as u32;
        self.atlas
            .draw(gpu, passes, maps, count, &self.triangles, |tile| {
                self.ranges[tile as usize / self.region_count].clone()
            });
    }
}
