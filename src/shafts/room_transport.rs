//! All that is worked out about a room before the first frame: its patches, their light, and who lights whom.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::bounds::Bounds;
use crate::geometry::ray_caster::RayCaster;
use crate::light::Light;
use crate::light::probe_power::ProbePower;

use super::bounding::Aabb;
use super::bright_patches::BrightPatches;
use super::hierarchy::{Arriving, Marks, ShaftHierarchy};
use super::irradiance_volume::IrradianceVolume;
pub use super::light_of_room::PatchLight;
use super::light_of_room::{REACH, compact_irradiance, hemisphere, light_of_room};
use super::luminance;
use super::patches::RoomPatches;
use super::points::points_on;
use super::receiver_tree::ReceiverTree;
use super::room::Room;
use super::selection::{Representative, WeighedSource, triangle_spread};
use super::source_tree::{PatchSource, SourceTree};
use super::surfels::{LitSurfel, Surfel};
use super::transfer::{Transfers, irradiance};

/// The transport of light in a room: who lights whom, and who may hide what.
#[derive(Serialize, Deserialize)]
pub struct RoomTransport {
    /// The room, the table and the phantoms.
    pub patches: RoomPatches,
    /// Light of each patch.
    pub light: Vec<PatchLight>,
    /// The sources.
    pub sources: SourceTree,
    /// Radiance of each source in the tree's order.
    pub source_radiance: Vec<Vec3>,
    /// Form factors of each vertex: the sources in the tree's order, then all other patches.
    pub transfers: Transfers,
    /// For each patch its place in the rows of `transfers`.
    pub sender_of_patch: Vec<u32>,
    /// All light of each vertex: irradiance.
    pub irradiance: Vec<Vec3>,
    /// The receivers.
    pub receivers: ReceiverTree,
    /// Who may hide what from whom.
    pub hierarchy: ShaftHierarchy,
    /// The light where virtual things may be.
    pub volume: IrradianceVolume,
    /// Lights that are drawn by themselves, beside what the probe saw.
    #[serde(skip)]
    pub compact: Vec<Light>,
    /// The patches' triangles.
    #[serde(skip, default = "no_triangles")]
    pub caster: RayCaster,
}

fn no_triangles() -> RayCaster {
    RayCaster::new(&[])
}

/// Spacing of the irradiance volume's grid, metres.
const VOLUME_SPACING_M: f32 = 0.06;
/// The margin that it has around where things stand.
const VOLUME_MARGIN_M: f64 = 0.15;

impl Room<'_> {
    /// Works its light out: seconds.
    pub fn transport(&self) -> RoomTransport {
        RoomTransport::new(self)
    }
}

/// What each vertex gets of each source, and of all light, as luminances.
fn arriving<'a>(
    rows: impl Iterator<Item = &'a [f32]>,
    source_radiance: &[Vec3],
    irradiance: &[Vec3],
) -> Arriving {
    let radiosities = source_radiance
        .iter()
        .map(|&radiance| luminance(radiance) * PI);
    let radiosities: Vec<f32> = radiosities.collect();
    Arriving::new(
        rows.map(|row| row.iter().zip(&radiosities).map(|(f, l)| f * l).collect()),
        irradiance.iter().map(|&light| luminance(light)).collect(),
    )
}

impl RoomTransport {
    /// Works a room out.
    pub fn new(room: &Room<'_>) -> Self {
        let Room {
            triangles,
            things,
            options,
            probe,
            compact,
            standing: _,
        } = room;
        let power = ProbePower::new(&probe.probe);
        let brightness = |place: Vec3, radius_m: f32| {
            let way = place.as_dvec3() - probe.position_m;
            let half_angle = f64::from(radius_m).atan2(way.length());
            power.mean_around(way, half_angle) as f32
        };
        let mean = power.mean() as f32 * probe.exposure;
        let mut focuses = things.to_vec();
        focuses.extend(Bounds::around([probe.position_m]));
        let patches = RoomPatches::new(triangles, options.patches, &focuses, brightness);
        let corners: Vec<[Vec3; 3]> = patches.patches.iter().map(|p| patches.corners(p)).collect();
        let caster = RayCaster::new(&corners);
        let light = light_of_room(&patches, &caster, probe, compact, mean);

        let power =
            |patch: usize| luminance(light[patch].radiance) * patches.area(&patches.patches[patch]);
        let (brightest, others) = source_set(&light, power, options.source_power);
        let sources = SourceTree::new(
            brightest
                .into_iter()
                .map(|patch| PatchSource {
                    patch: patch as u32,
                    corners: corners[patch],
                    power: power(patch),
                    luminance: luminance(light[patch].radiance),
                })
                .collect(),
        );
        let mut senders = sources.patches.clone();
        senders.extend(others.iter().map(|&patch| patch as u32));
        let sender_radiance: Vec<Vec3> = senders
            .iter()
            .map(|&patch| light[patch as usize].radiance)
            .collect();
        let transfers = Transfers::new(&patches, &senders, &caster);
        let mut sender_of_patch = vec![0; senders.len()];
        for (sender, &patch) in (0..).zip(&senders) {
            sender_of_patch[patch as usize] = sender;
        }
        let rows = || (0..patches.vertices.len()).map(|vertex| transfers.row(vertex));
        let irradiance: Vec<Vec3> = rows()
            .map(|row| irradiance(row, &sender_radiance))
            .collect();

        let source_count = sources.patches.len();
        let arriving = arriving(rows(), &sender_radiance[..source_count], &irradiance);
        let receivers = ReceiverTree::new(&patches, options.receivers_per_leaf);
        let hierarchy =
            ShaftHierarchy::new(&sources, &receivers, &arriving, options.least_part as f32);
        let radiance: Vec<Vec3> = light.iter().map(|light| light.radiance).collect();
        let bright = BrightPatches::new(&patches, &radiance, mean);
        let volume = volume_around(things, &patches, &caster, &radiance, bright);
        Self {
            source_radiance: sender_radiance[..source_count].to_vec(),
            patches,
            light,
            sources,
            transfers,
            sender_of_patch,
            irradiance,
            receivers,
            hierarchy,
            volume,
            compact: compact.clone(),
            caster,
        }
    }

    /// Whether what is in it is of one room: a file may say anything.
    pub fn is_consistent(&self) -> bool {
        let vertices = self.patches.vertices.len();
        let patches = self.patches.patches.len();
        let of_patches = [self.light.len(), self.sender_of_patch.len()];
        let mut corners = self.patches.patches.iter().flat_map(|patch| patch.vertices);
        of_patches == [patches; 2]
            && self.irradiance.len() == vertices
            && self.source_radiance.len() <= patches
            && corners.all(|vertex| (vertex as usize) < vertices)
    }

    /// Ready for rays again, after it was read.
    pub fn with_caster(self, compact: &[Light]) -> Self {
        let patches = self.patches.patches.iter();
        let corners: Vec<[Vec3; 3]> = patches.map(|patch| self.patches.corners(patch)).collect();
        Self {
            caster: RayCaster::new(&corners),
            compact: compact.to_vec(),
            ..self
        }
    }

    /// The light where other things are, or are now.
    pub fn gather_volume(&mut self, things: &[Bounds]) {
        let radiance: Vec<Vec3> = self.light.iter().map(|light| light.radiance).collect();
        let bright = self.volume.bright().clone();
        self.volume = volume_around(things, &self.patches, &self.caster, &radiance, bright);
    }

    /// Marks what things in boxes may hide, and which receivers may get their shadows.
    pub fn mark(&self, boxes: &[Aabb]) -> Marks {
        let mut marks = Marks::new(&self.sources, &self.receivers);
        for bounds in boxes {
            self.hierarchy.mark(bounds, &mut marks);
        }
        marks
    }

    /// The sources as they weigh for some vertices, each with what it counts among them; those that are not marked weigh
    /// nothing.
    pub fn weighed(&self, is_marked: &[bool], vertices: &[(u32, f32)]) -> Vec<WeighedSource> {
        let mut weights = vec![0.0_f32; is_marked.len()];
        for &(vertex, share) in vertices {
            let total = luminance(self.irradiance[vertex as usize]).max(1e-9) / share;
            let row = self.transfers.row(vertex as usize);
            for (weight, form_factor) in weights.iter_mut().zip(row) {
                *weight += form_factor / total;
            }
        }
        let count: f32 = vertices.iter().map(|(_, share)| share).sum();
        let count = count.max(f32::MIN_POSITIVE);
        let sources = self.sources.patches.iter().zip(is_marked);
        sources
            .zip(weights.iter().zip(&self.source_radiance))
            .map(|((&patch, &is_marked), (&weight, &radiance))| {
                let corners = self.patches.corners(&self.patches.patches[patch as usize]);
                WeighedSource {
                    center: corners.iter().sum::<Vec3>() / 3.0,
                    spread: triangle_spread(corners),
                    weight: match is_marked {
                        true => weight * luminance(radiance) * PI / count,
                        false => 0.0,
                    },
                }
            })
            .collect()
    }

    /// The sources, in the tree's order, whose middle lies within a ball.
    pub fn sources_within(&self, center: Vec3, radius: f32) -> Vec<usize> {
        let middle = |patch: u32| self.patches.center(&self.patches.patches[patch as usize]);
        let sources = self.sources.patches.iter().enumerate();
        sources
            .filter(|(_, patch)| middle(**patch).distance(center) < radius)
            .map(|(source, _)| source)
            .collect()
    }

    /// Irradiance of a place that surfels cover, from patches of which `left` knows the part of their light that the
    /// casters' shadows leave.
    pub fn hidden_among<'a>(
        &self,
        place: Vec3,
        normal: Vec3,
        surfels: impl IntoIterator<Item = &'a LitSurfel>,
        left: &[Option<Vec3>],
    ) -> Vec3 {
        let start = place + normal * SURFEL_OFFSET_M;
        let covered = |surfel: &LitSurfel| {
            let part = surfel.irradiance_part(place, normal);
            if part < LEAST_COVERED {
                return Vec3::ZERO;
            }
            match self.radiance_along(start, (surfel.surfel.position - start).normalize()) {
                Some((radiance, patch, _)) => radiance * part * left[patch].unwrap_or(Vec3::ZERO),
                None => Vec3::ZERO,
            }
        };
        surfels.into_iter().map(covered).sum()
    }

    /// For patches with their middle in a ball the part of their light that `caster` leaves them, `None` for others.
    pub fn left_by(&self, caster: &RayCaster, center: Vec3, radius: f32) -> Vec<Option<Vec3>> {
        let middle = |patch: usize| self.patches.center(&self.patches.patches[patch]);
        let left = |patch: usize| {
            let is_near = middle(patch).distance(center) < radius;
            is_near.then(|| Vec3::splat(self.left_on(patch, caster)))
        };
        let patches = (0..self.patches.patches.len()).into_par_iter();
        patches.map(left).collect()
    }

    /// The part of a patch's light that `caster` leaves: sources are tried as often as they bring it light.
    fn left_on(&self, patch: usize, caster: &RayCaster) -> f32 {
        let patch = &self.patches.patches[patch];
        let row = self.transfers.row(patch.vertices[0] as usize);
        let arriving = row.iter().zip(&self.source_radiance);
        let arriving: Vec<f32> = arriving
            .map(|(&part, &radiance)| luminance(radiance) * part)
            .collect();
        let all: f32 = arriving.iter().sum();
        if all <= 0.0 && self.compact.is_empty() {
            return 1.0;
        }
        let start = self.patches.center(patch) + self.patches.normal(patch) * SURFEL_OFFSET_M;
        let (mut sum, mut tried, mut hidden) = (0.0, 0, 0);
        for (source, arriving) in self.sources.patches.iter().zip(arriving) {
            sum += arriving;
            let due = (sum / all * DIMMING_RAYS as f32 + 0.5) as usize;
            if due > tried {
                let corners = self
                    .patches
                    .corners(&self.patches.patches[*source as usize]);
                for place in points_on(corners, due - tried) {
                    hidden += usize::from(caster.is_hidden(start, place - start, 1.0));
                }
                tried = due;
            }
        }
        let hidden = hidden as f32 / tried.max(1) as f32;
        // Lights of their own are hidden or not.
        let normal = self.patches.normal(patch);
        let in_room = |way: Vec3| self.caster.is_hidden(start, way, REACH);
        let in_both = |way: Vec3| in_room(way) || caster.is_hidden(start, way, REACH);
        let before = luminance(compact_irradiance(&self.compact, start, normal, in_room));
        let after = luminance(compact_irradiance(&self.compact, start, normal, in_both));
        let broad = all * PI;
        match broad + before > 0.0 {
            true => (broad * (1.0 - hidden) + after) / (broad + before),
            false => 1.0,
        }
    }

    /// Irradiance that a vertex loses with the light that patches lose.
    pub fn lost_at(&self, vertex: u32, left: &[Option<Vec3>]) -> Vec3 {
        let row = self.transfers.row(vertex as usize);
        let lost = |(patch, left): (usize, &Option<Vec3>)| {
            let part = 1.0 - (*left)?;
            Some(self.light[patch].radiance * part * row[self.sender_of_patch[patch] as usize])
        };
        left.iter().enumerate().filter_map(lost).sum::<Vec3>() * PI
    }

    /// Radiant intensity of a representative's marked sources towards a place.
    pub fn intensity(&self, one: &Representative, is_marked: &[bool], place: Vec3) -> Vec3 {
        let range = one.first as usize..one.last as usize;
        let sent = |source: usize| {
            let patch = &self.patches.patches[self.sources.patches[source] as usize];
            let way = place - self.patches.center(patch);
            let facing = self.patches.normal(patch).dot(way) / way.length().max(1e-9);
            self.source_radiance[source] * (self.patches.area(patch) * facing.max(0.0))
        };
        range.filter(|&source| is_marked[source]).map(sent).sum()
    }

    /// The part of a representative's light that the room lets through to a place.
    pub fn let_through(&self, one: &Representative, is_marked: &[bool], place: Vec3) -> f32 {
        let (mut all, mut seen) = (0.0, 0.0);
        for source in (one.first as usize..one.last as usize).filter(|&source| is_marked[source]) {
            let patch = &self.patches.patches[self.sources.patches[source] as usize];
            let (center, normal) = (self.patches.center(patch), self.patches.normal(patch));
            let start = center + normal * SURFEL_OFFSET_M;
            let sent = luminance(self.source_radiance[source]) * self.patches.area(patch);
            all += sent;
            if normal.dot(place - center) > 0.0 && !self.caster.is_hidden(start, place - start, 1.0)
            {
                seen += sent;
            }
        }
        seen / f32::max(all, f32::MIN_POSITIVE)
    }

    /// Radiance along a ray; none from backs, or where there is no room.
    pub fn radiance_along(&self, origin: Vec3, direction: Vec3) -> Option<(Vec3, usize, f32)> {
        let hit = self.caster.first_hit(origin, direction, f32::INFINITY)?;
        let patch = &self.patches.patches[hit.triangle];
        let is_front = self.patches.normal(patch).dot(direction) < 0.0;
        is_front.then_some((
            self.light[hit.triangle].radiance,
            hit.triangle,
            hit.distance,
        ))
    }
}

impl RoomTransport {
    /// Irradiance of a surfel past what `caster` and the room hide: the room's light there, and of it the part that is left of
    /// what representatives of sources give, with their radiant intensities, and of what `rays` meet of the patches of which
    /// `left` knows which part of their light the casters' shadows leave. (A ratio estimator, as that of Heitz, Hill & McGuire
    /// 2018: sources that are too weak to be told one by one are not lost.)
    pub fn light_on_surfel(
        &self,
        surfel: &Surfel,
        rays: usize,
        caster: &RayCaster,
        sources: &[(Representative, Vec3)],
        left: &[Option<Vec3>],
    ) -> Vec3 {
        let start = surfel.position + surfel.normal * SURFEL_OFFSET_M;
        // What of it there is at all comes from all of the room; sources and rays tell the part that the casters leave.
        let [mut whole, mut left_of_it] = [Vec3::ZERO; 2];
        let mut add = |light: Vec3, part: Vec3, way: Vec3, reach: f32| {
            whole += light;
            if !caster.is_hidden(start, way, reach) {
                left_of_it += light * part;
            }
        };
        for (source, intensity) in sources {
            let way = source.position - start;
            let facing = surfel.normal.dot(way);
            if facing > 0.0 && !self.caster.is_hidden(start, way, 0.99) {
                // Seen from among its sources, a representative is no point.
                let squared = way.length_squared() + source.spread_trace();
                let light = *intensity * (facing / (squared * way.length()));
                add(light, Vec3::ONE, way, 0.99);
            }
        }
        for direction in hemisphere(surfel.normal, rays) {
            let near = self.radiance_along(start, direction);
            if let Some((radiance, patch, distance)) = near
                && let Some(part) = left[patch]
            {
                add(radiance * (PI / rays as f32), part, direction, distance);
            }
        }
        let part = left_of_it / whole.max(Vec3::splat(f32::MIN_POSITIVE));
        let hides = |way: Vec3| {
            caster.is_hidden(start, way, REACH) || self.caster.is_hidden(start, way, REACH)
        };
        self.volume.irradiance(surfel.position, surfel.normal) * part
            + compact_irradiance(&self.compact, start, surfel.normal, hides)
    }
}

/// Rays that tell how much of a patch's light the casters hide.
const DIMMING_RAYS: usize = 48;
/// Surfels that cover less of a place's hemisphere (over π) hide nothing that shows.
const LEAST_COVERED: f32 = 1e-4;
/// The distance off a surfel at which rays start, metres: past the rounding of a simplified thing.
const SURFEL_OFFSET_M: f32 = 1e-4;

/// Patches by falling radiance until they have a part of all power, and the others (Gibson et al. 2003, section 4).
fn source_set(
    light: &[PatchLight],
    power: impl Fn(usize) -> f32,
    part: f64,
) -> (Vec<usize>, Vec<usize>) {
    let mut order: Vec<usize> = (0..light.len()).collect();
    let brightness = |&patch: &usize| luminance(light[patch].radiance);
    order.sort_by(|one, other| brightness(other).total_cmp(&brightness(one)));
    let all: f64 = order.iter().map(|&patch| f64::from(power(patch))).sum();
    let mut sum = 0.0;
    let enough = order.iter().take_while(|&&patch| {
        let before = sum;
        sum += f64::from(power(patch));
        before < part * all && power(patch) > 0.0
    });
    let others = order.split_off(enough.count());
    (order, others)
}

fn volume_around(
    things: &[Bounds],
    patches: &RoomPatches,
    caster: &RayCaster,
    radiance: &[Vec3],
    bright: BrightPatches,
) -> IrradianceVolume {
    let bounds = around(things, VOLUME_MARGIN_M);
    IrradianceVolume::new(bounds, VOLUME_SPACING_M, patches, caster, radiance, bright)
}

fn around(things: &[Bounds], margin_m: f64) -> Aabb {
    let corners = things.iter().flat_map(|bounds| {
        [bounds.low - margin_m, bounds.high + margin_m].map(|corner| corner.as_vec3())
    });
    let bounds = Aabb::around(corners);
    match bounds.min.cmple(bounds.max).all() {
        true => bounds,
        false => Aabb::around([Vec3::splat(-0.5), Vec3::splat(0.5)]),
    }
}
