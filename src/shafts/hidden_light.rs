//! What the casters hide of a room's light where they are, and what they reflect (Gibson et al. 2003, sections 6.1 and 8).

use glam::{Vec3, Vec4};
use half::f16;
use rayon::prelude::*;

use super::bounding::Aabb;
use super::casters::PlacedCasters;
use super::difference::{Given, Terms};
use super::patches::{PatchVertex, RoomPatch};
use super::receiver_patches::{ReceiverInputs, ReceiverPatches};
use super::room_transport::RoomTransport;
use super::selection::{LEAST_WEIGHT, Representative, WeighedSource, representatives};
use super::shadow_atlas::{MappedSource, Tiling};
use super::surfels::{GroupedSurfels, reflected_irradiance};

/// Penumbras are given room in the maps up to this many radii behind the casters.
const REACH: f32 = 4.0;
/// Sources that light the surfels.
const SOURCES_OF_BOUNCE: usize = 96;
/// Sources nearer to the casters' middle than so many of their radii are among them.
const NEAREST_SOURCE: f32 = 3.0;

/// What casters reflect makes a patch brighter by this factor at most.
const MOST_ADDED: f32 = 4.0;

/// The number of shadows that there may be, and the way to take them out of the video.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowOptions<'a> {
    /// Sources that get a shadow, at most; `None`: all.
    pub sources: Option<u32>,
    /// Side of a source's map, pixels.
    pub map_px: u32,
    /// Side of the largest atlas that can be drawn, pixels.
    pub largest_atlas_px: u32,
    /// In which terms light is taken out of the video.
    pub terms: Terms<'a>,
}

/// The part of a room's light that the casters hide where they are, and what they reflect.
pub struct HiddenLight {
    /// Where the sources have their maps.
    pub tiling: Tiling,
    /// The sources that have one.
    pub sources: Vec<MappedSource>,
    /// Light of each vertex without casters, in the terms in which it is taken out of the video.
    pub light: Vec<Vec4>,
    /// For each vertex what each source gives to it, packed: rows of as many as there are sources.
    pub transfers: Vec<[u32; 2]>,
    /// The patches that receive a shadow, or reflected light.
    pub receivers: ReceiverPatches,
    /// The casters' surfels and their light.
    pub surfels: GroupedSurfels,
}

impl HiddenLight {
    /// Of casters in a room.
    pub fn new(room: &RoomTransport, placed: &PlacedCasters, options: &ShadowOptions<'_>) -> Self {
        let affected = Affected::new(room, placed);
        let weighed = affected.weighed(room, placed);
        let (tiling, chosen, sources) = mapped_sources(room, placed, &affected, &weighed, options);
        let vertices = &affected.vertices;
        let vertex_light = vertices
            .iter()
            .map(|&vertex| room.irradiance[vertex as usize]);
        let given = Given {
            light: vertex_light.collect(),
            by_source: given(room, vertices, &chosen, &affected.may_be_hidden),
            source_count: chosen.len(),
        }
        .in_terms_of(options.terms, room, vertices);
        let transfers: Vec<[u32; 2]> = given.by_source.into_iter().map(packed).collect();
        let (surfels, lost_nearby) = reflected(room, placed, &affected, &weighed);
        let receivers = ReceiverInputs {
            room,
            casters: placed,
            vertices,
            sources: &sources,
            transfers: &transfers,
            surfels: &surfels,
            lost_nearby: &lost_nearby,
            terms: options.terms,
        }
        .receivers(&affected.patches);
        let light = given.light.into_iter();
        Self {
            tiling,
            sources,
            light: light.map(|light| light.extend(0.0)).collect(),
            transfers,
            receivers,
            surfels,
        }
    }
}

/// Sources, patches and vertices that the casters may change.
struct Affected {
    /// For each source whether they may hide it.
    may_be_hidden: Vec<bool>,
    /// The patches that may receive a shadow.
    patches: Vec<usize>,
    /// Their vertices, sorted.
    vertices: Vec<u32>,
}

impl Affected {
    fn new(room: &RoomTransport, placed: &PlacedCasters) -> Self {
        let marks = room.mark(&placed.boxes);
        let mut may_be_hidden = marks.sources(&room.sources);
        // Sources among the casters have no shadow map that could show them.
        let among = room.sources_within(placed.ball.center, NEAREST_SOURCE * placed.ball.radius);
        for &source in &among {
            may_be_hidden[source] = false;
        }
        let may_receive = marks.receivers(&room.receivers);
        let patches: Vec<usize> = (0..may_receive.len())
            .filter(|&patch| may_receive[patch])
            .collect();
        let mut vertices: Vec<u32> = patches
            .iter()
            .flat_map(|&patch| room.patches.patches[patch].vertices)
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        Self {
            may_be_hidden,
            patches,
            vertices,
        }
    }

    /// The sources as they weigh for the vertices. Shadows fall off with the square of the distance, and so does what a
    /// source counts for.
    fn weighed(&self, room: &RoomTransport, placed: &PlacedCasters) -> Vec<WeighedSource> {
        let shares: Vec<(u32, f32)> = self
            .vertices
            .iter()
            .map(|&vertex| {
                let place = room.patches.vertices[vertex as usize].position;
                let squared = place.distance_squared(placed.ball.center);
                (vertex, (squared + placed.ball.radius.powi(2)).recip())
            })
            .collect();
        room.weighed(&self.may_be_hidden, &shares)
    }

    /// Radiant intensity of a representative towards the casters, as the room lets it through.
    fn intensity(
        &self,
        room: &RoomTransport,
        placed: &PlacedCasters,
        one: &Representative,
    ) -> Vec3 {
        let center = placed.ball.center;
        room.intensity(one, &self.may_be_hidden, center)
            * room.let_through(one, &self.may_be_hidden, center)
    }
}

/// The sources that get a shadow, those left out that lie among the casters, and where their maps are.
fn mapped_sources(
    room: &RoomTransport,
    placed: &PlacedCasters,
    affected: &Affected,
    weighed: &[WeighedSource],
    options: &ShadowOptions<'_>,
) -> (Tiling, Vec<Representative>, Vec<MappedSource>) {
    let (ball, count) = (&placed.ball, options.sources);
    let count = count.map_or(usize::MAX, |count| count as usize);
    let mut chosen = representatives(&room.sources, weighed, count, LEAST_WEIGHT, ball.center);
    let tiling = Tiling::new(chosen.len(), options.map_px, options.largest_atlas_px);
    let reach_m = REACH * ball.radius;
    let mut sources: Vec<MappedSource> = Vec::new();
    chosen.retain(|one| {
        let intensity = affected.intensity(room, placed, one);
        let index = sources.len() as u32;
        let source = MappedSource::new(one, ball, reach_m, intensity, &tiling, index);
        sources.extend(source);
        source.is_some()
    });
    (tiling, chosen, sources)
}

/// The casters' surfels in the light that they get, and for each vertex the irradiance that it loses from patches among the
/// casters.
fn reflected(
    room: &RoomTransport,
    placed: &PlacedCasters,
    affected: &Affected,
    weighed: &[WeighedSource],
) -> (GroupedSurfels, Vec<Vec3>) {
    let center = placed.ball.center;
    let detailed = representatives(
        &room.sources,
        weighed,
        SOURCES_OF_BOUNCE,
        LEAST_WEIGHT,
        center,
    );
    let detailed: Vec<(Representative, Vec3)> = detailed
        .into_iter()
        .map(|one| (one, affected.intensity(room, placed, &one)))
        .collect();
    let among_m = NEAREST_SOURCE * placed.ball.radius;
    let left = room.left_by(&placed.caster, center, among_m);
    let surfels = placed.lit_surfels(room, &detailed, &left);
    let of_surfels = |patch: &RoomPatch| {
        let (place, normal) = (room.patches.center(patch), room.patches.normal(patch));
        reflected_irradiance(place, normal, surfels.seen_from(Aabb::around([place])))
    };
    let lit_once = with_added(room, &left, of_surfels);
    // What these send to each other then differs too.
    let lost = |patch: &RoomPatch| {
        let lost = patch.vertices.map(|vertex| room.lost_at(vertex, &lit_once));
        lost.into_iter().sum::<Vec3>() / 3.0
    };
    let lit_twice = with_added(room, &left, |patch| of_surfels(patch) - lost(patch));
    let lost_nearby = lost_nearby(room, &affected.vertices, &surfels, &lit_twice);
    (surfels, lost_nearby)
}

/// The parts that patches have left of their light, with irradiance that is added to it.
fn with_added(
    room: &RoomTransport,
    left: &[Option<Vec3>],
    added: impl Fn(&RoomPatch) -> Vec3 + Sync,
) -> Vec<Option<Vec3>> {
    let patches = left.par_iter().zip(&room.patches.patches);
    let part = |(left, patch): (&Option<Vec3>, &RoomPatch)| {
        let at_corners = patch
            .vertices
            .map(|vertex| room.irradiance[vertex as usize]);
        let before = at_corners.into_iter().sum::<Vec3>() / 3.0;
        let all = (*left)? + added(patch) / before.max(Vec3::splat(f32::MIN_POSITIVE));
        Some(all.clamp(Vec3::ZERO, Vec3::splat(MOST_ADDED)))
    };
    patches.map(part).collect()
}

/// For each vertex the irradiance that it loses from patches among the casters: what the casters' surfels cover, and what
/// their shadows took from patches around them.
fn lost_nearby(
    room: &RoomTransport,
    vertices: &[u32],
    surfels: &GroupedSurfels,
    left: &[Option<Vec3>],
) -> Vec<Vec3> {
    let hidden = |&vertex: &u32| {
        let PatchVertex { position, normal } = room.patches.vertices[vertex as usize];
        let seen = surfels.seen_from(Aabb::around([position]));
        room.hidden_among(position, normal, seen, left) + room.lost_at(vertex, left)
    };
    vertices.par_iter().map(hidden).collect()
}

/// For each vertex and each representative the irradiance that hidden sources would take.
fn given(
    room: &RoomTransport,
    vertices: &[u32],
    chosen: &[Representative],
    may_be_hidden: &[bool],
) -> Vec<Vec3> {
    let radiance: Vec<Vec3> = room
        .source_radiance
        .iter()
        .zip(may_be_hidden)
        .map(|(&radiance, &hidden)| match hidden {
            true => radiance * std::f32::consts::PI,
            false => Vec3::ZERO,
        })
        .collect();
    let given = vertices.par_iter().flat_map_iter(|&vertex| {
        let row = room.transfers.row(vertex as usize);
        chosen.iter().map(|one| {
            let sources = one.first as usize..one.last as usize;
            let arriving = row[sources.clone()].iter().zip(&radiance[sources]);
            arriving
                .map(|(&part, &radiance)| radiance * part)
                .sum::<Vec3>()
        })
    });
    given.collect()
}

/// Three halves in two words; what is too large for a half becomes the largest.
fn packed(color: Vec3) -> [u32; 2] {
    let half = |value: f32| u32::from(f16::from_f32(value.min(65_504.0)).to_bits());
    [half(color.x) | half(color.y) << 16, half(color.z)]
}
