//! The maps of what things hide, and what they are drawn from.
//! Reads the things that cast. Writes the atlas.

use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::environment::distant_light::DistantLight;
use crate::environment::groups::groups;
use crate::environment::occlusion_map::{A_GROUP, OcclusionMap};
use crate::environment::placed::PlacedScene;
use crate::environment::thing::Thing;
use crate::geometry::bounds::Bounds;
use crate::scene::EnvironmentSettings;
use crate::shafts::bounding::Ball;
use crate::shafts::shadow_atlas::Tiling;

use super::super::gpu::Gpu;
use super::super::map_atlas::{MapAtlas, MapDraw};
use super::super::passes::Passes;

/// The maps of things where they are.
pub(super) struct Maps {
    /// One for each caster and region, then one for each group and region.
    pub all: Vec<OcclusionMap>,
    /// How members of groups are drawn into their groups' maps: numbers of casters and of tiles.
    members: Vec<(usize, u32, OcclusionMap)>,
    /// For each thing the number of its group, from 1 on, or 0.
    pub group_of: Vec<u32>,
}

/// One map for each caster and region, and for each group of casters.
pub(super) struct Casting {
    /// The numbers of those that cast, the real ones first.
    pub casters: Vec<usize>,
    /// Triangles of all casters, each in its anchor's space, and which are whose.
    triangles: wgpu::Buffer,
    ranges: Vec<Range<u32>>,
    region_count: usize,
    /// Whether casters near each other have a map together.
    is_grouped: bool,
    tiling: Tiling,
    pub atlas: MapAtlas,
}

impl Casting {
    /// Of things by their numbers; maps are `map_px` wide where all fit.
    pub fn new(
        gpu: &Gpu,
        things: &[Option<Thing>],
        region_count: usize,
        settings: &EnvironmentSettings,
    ) -> Self {
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
        let is_grouped = settings.is_grouped();
        // (A group has two members at least.)
        let most_groups = if is_grouped { casters.len() / 2 } else { 0 };
        let tiles = (casters.len() + most_groups) * region_count;
        let tiling = Tiling::new(tiles, settings.map_px, largest_px);
        Self {
            casters,
            triangles: gpu.buffer(
                "environment's casters",
                bytemuck::cast_slice(&triangles),
                wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            ),
            ranges,
            region_count,
            is_grouped,
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

    /// The maps of `thing_count` things, of which some cast.
    pub fn maps(
        &self,
        scene: &PlacedScene<'_>,
        distant: &DistantLight,
        thing_count: usize,
    ) -> Maps {
        let reach_m = scene.reach_m();
        let mut maps = Maps {
            all: Vec::new(),
            members: Vec::new(),
            group_of: vec![0; thing_count],
        };
        for &caster in &self.casters {
            let placed = scene.position(caster);
            for region in &distant.regions {
                let index = maps.all.len() as u32;
                maps.all.push(match placed {
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
        if self.is_grouped {
            self.add_groups(scene, distant, reach_m, &mut maps);
        }
        maps
    }

    /// Adds the maps of groups: a plane through the group's middle stands for all of it.
    fn add_groups(
        &self,
        scene: &PlacedScene<'_>,
        distant: &DistantLight,
        reach_m: f32,
        maps: &mut Maps,
    ) {
        let placed = |caster: usize| {
            let placed = scene.position(self.casters[caster])?;
            Some(&scene.things[placed])
        };
        let boxes = (0..self.casters.len()).map(|caster| {
            let placed = placed(caster)?;
            Some((placed.bounds(), placed.thing.is_real))
        });
        let boxes: Vec<Option<(Bounds, bool)>> = boxes.collect();
        for (group, members) in groups(&boxes).iter().enumerate() {
            let bounds = members.iter().filter_map(|&member| boxes[member]);
            let [low, high] = bounds.fold([DVec3::MAX, DVec3::MIN], |[low, high], (bounds, _)| {
                [low.min(bounds.low), high.max(bounds.high)]
            });
            let ball = Ball {
                center: (0.5 * (low + high)).as_vec3(),
                radius: (0.5 * (high - low).length()) as f32,
            };
            for (place, &member) in members.iter().enumerate() {
                maps.group_of[self.casters[member]] = group as u32 + 1;
                let first = member * self.region_count;
                for map in &mut maps.all[first..first + self.region_count] {
                    *map = map.in_group(group, place == 0);
                }
            }
            for region in &distant.regions {
                let tile = maps.all.len() as u32;
                let map =
                    OcclusionMap::around(&ball, region, reach_m, (&self.tiling, tile), A_GROUP);
                maps.all.push(map);
                let drawn = members.iter().filter_map(|&member| {
                    let pose = &placed(member)?.world_from_anchor;
                    Some((member, tile, map.drawn_from(pose)))
                });
                maps.members.extend(drawn);
            }
        }
    }

    /// How all maps are drawn: what their shader reads, and the draws.
    pub fn draws(&self, maps: &Maps) -> (Vec<OcclusionMap>, Vec<MapDraw>) {
        let own = self.casters.len() * self.region_count;
        let mut seen_by = maps.all[..own].to_vec();
        let mut draws: Vec<MapDraw> = (0..own)
            .map(|tile| MapDraw {
                tile: tile as u32,
                seen_by: tile as u32,
                corners: self.ranges[tile / self.region_count].clone(),
            })
            .collect();
        for &(member, tile, map) in &maps.members {
            draws.push(MapDraw {
                tile,
                seen_by: seen_by.len() as u32,
                corners: self.ranges[member].clone(),
            });
            seen_by.push(map);
        }
        (seen_by, draws)
    }

    /// Draws all maps.
    pub fn draw(
        &self,
        gpu: &Gpu,
        passes: &mut Passes<'_>,
        seen_by: &wgpu::Buffer,
        draws: &[MapDraw],
    ) {
        let draws = draws.iter().cloned();
        self.atlas
            .draw(gpu, passes, seen_by, &self.triangles, draws);
    }
}
