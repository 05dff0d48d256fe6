//! The light around where virtual things may be (Greger et al. 1998, Gibson et al. 2003, section 9): radiance in spherical
//! harmonics on a grid, real occluders included; of bright patches what each point sees of them, for a lamp lights a ball with a
//! terminator that few harmonics have not. The paper has harmonics to the second degree; a room's dim half still shows what these
//! leave out, which is up to 2.4 % of irradiance in a photographed studio.

use std::f32::consts::PI;

use glam::{UVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::ray_caster::RayCaster;

use super::bounding::Aabb;
use super::bright_patches::BrightPatches;
use super::patches::RoomPatches;
use super::points::points_on;
use super::solid_angle::solid_angle;
use crate::light::harmonics::{cosine_lobe, count, sphere, write_basis};

/// Rays from each point of the grid to all sides, if patches were so small that each met another one: a patch is looked at along
/// as many as its solid angle has room for, ...
const RAYS: f32 = 4096.0;
/// ... and along some at least, which tell whether all of it is seen.
const LEAST_RAYS_OF_A_PATCH: usize = 3;
const MOST_RAYS_OF_A_PATCH: usize = 64;
/// Rays to all sides that tell whether a point lies within something, and how much is seen of what is hidden in part.
const SURVEYING_RAYS: usize = 1024;
/// They correct what points on patches say by this factor at most.
const MOST_SCALED: f32 = 2.0;
/// Part of the way to a patch within which something hides it.
const REACH: f32 = 1.0 - 1e-4;
/// Degree of the harmonics.
const DEGREE: usize = 4;
/// How many there are.
const HARMONICS: usize = count(DEGREE);
/// Points of the grid along one axis at most.
const MOST_POINTS: u32 = 16;
/// Part of those that may meet backs of patches; a point where more do lies within something.
const MOST_BACKS: f32 = 0.25;

/// The grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IrradianceVolume {
    bounds: Aabb,
    points: UVec3,
    bright: BrightPatches,
    /// x fastest; `None` within things.
    gathered: Vec<Option<Gathered>>,
}

/// The light at a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Gathered {
    /// Of all but the bright patches: irradiance in harmonics of the way that a surface faces.
    rest: Vec<Vec3>,
    /// The part that is seen of each bright patch.
    seen: Vec<f32>,
}

impl IrradianceVolume {
    /// Gathers light in a box at points about `spacing_m` apart; `caster` holds the patches' triangles, which send out
    /// `radiance`, the `bright` ones among them.
    pub fn new(
        bounds: Aabb,
        spacing_m: f32,
        patches: &RoomPatches,
        caster: &RayCaster,
        radiance: &[Vec3],
        bright: BrightPatches,
    ) -> Self {
        let points = ((bounds.max - bounds.min) / spacing_m).ceil().as_uvec3() + 1;
        let points = points.clamp(UVec3::splat(2), UVec3::splat(MOST_POINTS));
        let mut volume = Self {
            bounds,
            points,
            bright,
            gathered: Vec::new(),
        };
        volume.gathered = (0..points.element_product())
            .into_par_iter()
            .map(|index| {
                let sending = (patches, radiance, &volume.bright);
                gathered(volume.point(index), caster, sending)
            })
            .collect();
        volume
    }

    /// The patches that are told from the others.
    pub fn bright(&self) -> &BrightPatches {
        &self.bright
    }

    fn point(&self, index: u32) -> Vec3 {
        let place = UVec3::new(
            index % self.points.x,
            index / self.points.x % self.points.y,
            index / (self.points.x * self.points.y),
        );
        self.bounds.min
            + (self.bounds.max - self.bounds.min) * place.as_vec3() / (self.points - 1).as_vec3()
    }

    /// Whether all of a box lies within.
    pub fn holds(&self, bounds: &Aabb) -> bool {
        let holds = |corner: Vec3| {
            self.bounds.min.cmple(corner).all() && self.bounds.max.cmpge(corner).all()
        };
        holds(bounds.min) && holds(bounds.max)
    }

    /// Irradiance of a place with a unit normal, between the points of the grid; beyond it the light of its edge.
    pub fn irradiance(&self, place: Vec3, normal: Vec3) -> Vec3 {
        let around = self.around(place);
        let whole: f32 = around.iter().map(|(_, share)| share).sum();
        if whole <= 0.0 {
            return Vec3::ZERO;
        }
        let mut facing = [0.0; HARMONICS];
        write_basis(normal.as_dvec3(), DEGREE, &mut facing);
        let mut rest = Vec3::ZERO;
        for (gathered, share) in &around {
            let parts = gathered.rest.iter().zip(&facing);
            let irradiance: Vec3 = parts.map(|(&part, &value)| part * value as f32).sum();
            rest += irradiance * (share / whole);
        }
        let mut sent = Vec3::ZERO;
        for (index, bright) in self.bright.patches.iter().enumerate() {
            let seen: f32 = around
                .iter()
                .map(|(gathered, share)| gathered.seen[index] * share)
                .sum();
            if seen > 0.0 {
                sent += bright.radiance * (bright.form_factor(place, normal) * seen / whole);
            }
        }
        rest.max(Vec3::ZERO) + sent * PI
    }

    /// The points of the grid around a place, as far as they lie in no thing, and what each of them counts.
    fn around(&self, place: Vec3) -> Vec<(&Gathered, f32)> {
        let size = (self.bounds.max - self.bounds.min).max(Vec3::splat(1e-6));
        let cells = (self.points - 1).as_vec3();
        let at = ((place - self.bounds.min) / size * cells).clamp(Vec3::ZERO, cells);
        let low = at.floor().min(cells - 1.0).max(Vec3::ZERO);
        let part = at - low;
        let corner = |corner: u32| {
            let step = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let place = low.as_uvec3() + step;
            let index = (place.z * self.points.y + place.y) * self.points.x + place.x;
            let share: f32 = (0..3)
                .map(|axis| match step[axis] {
                    0 => 1.0 - part[axis],
                    _ => part[axis],
                })
                .product();
            let gathered = self.gathered[index as usize].as_ref()?;
            Some((gathered, share.max(1e-6)))
        };
        (0..8).filter_map(corner).collect()
    }
}

/// The light at a point; `None` within things. `sending` is what patches send out, the bright ones among them.
fn gathered(
    point: Vec3,
    caster: &RayCaster,
    (patches, radiance, bright): (&RoomPatches, &[Vec3], &BrightPatches),
) -> Option<Gathered> {
    let mut whole = Received::default();
    let mut in_part = Received::default();
    let mut is_seen_in_part = vec![false; patches.patches.len()];
    for (index, patch) in patches.patches.iter().enumerate() {
        let is_back = patches.normal(patch).dot(point - patches.center(patch)) <= 0.0;
        if bright.has(index) || is_back {
            continue;
        }
        let parts = seen_parts(point, patches.corners(patch), caster);
        is_seen_in_part[index] = parts.are_all == Some(false);
        let received = if is_seen_in_part[index] {
            &mut in_part
        } else {
            &mut whole
        };
        received.add(&parts.seen, radiance[index]);
    }
    // Few points tell badly which part of a patch is seen; rays to all sides tell how much all such parts are together.
    let (mut backs, mut met_in_part) = (0, 0);
    for direction in sphere(SURVEYING_RAYS) {
        let direction = direction.as_vec3();
        if let Some(hit) = caster.first_hit(point, direction, f32::INFINITY) {
            let patch = &patches.patches[hit.triangle];
            let is_back = patches.normal(patch).dot(direction) > 0.0;
            backs += usize::from(is_back);
            met_in_part += usize::from(!is_back && is_seen_in_part[hit.triangle]);
        }
    }
    if backs as f32 > MOST_BACKS * SURVEYING_RAYS as f32 {
        return None;
    }
    let met_sr = 4.0 * PI * met_in_part as f32 / SURVEYING_RAYS as f32;
    let scale = met_sr / in_part.solid_angle_sr.max(f32::MIN_POSITIVE);
    let scale = scale.clamp(MOST_SCALED.recip(), MOST_SCALED);
    let sums = whole.harmonics.iter().zip(&in_part.harmonics);
    let mut rest: Vec<Vec3> = sums.map(|(&whole, &part)| whole + part * scale).collect();
    for l in 0..=DEGREE {
        for coefficient in &mut rest[l * l..(l + 1) * (l + 1)] {
            *coefficient *= cosine_lobe(l) as f32;
        }
    }
    Some(Gathered {
        rest,
        seen: bright.seen_from(point, caster),
    })
}

/// Radiance that arrives, in harmonics.
#[derive(Default)]
struct Received {
    harmonics: [Vec3; HARMONICS],
    solid_angle_sr: f32,
}

impl Received {
    /// Adds one radiance from several directions with their solid angles.
    fn add(&mut self, from: &[(Vec3, f32)], radiance: Vec3) {
        let mut values = [0.0; HARMONICS];
        for &(direction, solid_angle_sr) in from {
            self.solid_angle_sr += solid_angle_sr;
            write_basis(direction.as_dvec3(), DEGREE, &mut values);
            let arriving = radiance * solid_angle_sr;
            for (sum, value) in self.harmonics.iter_mut().zip(values) {
                *sum += arriving * value as f32;
            }
        }
    }
}

/// Parts of a triangle.
struct SeenParts {
    /// Unit directions to those that nothing hides, and their solid angles.
    seen: Vec<(Vec3, f32)>,
    /// Whether these are all; `None` where they are none.
    are_all: Option<bool>,
}

/// The parts of a triangle that nothing hides; all parts' solid angles together are the triangle's, so that no light is lost or
/// found between them.
fn seen_parts(point: Vec3, corners: [Vec3; 3], caster: &RayCaster) -> SeenParts {
    let whole_sr = solid_angle(corners.map(|corner| corner - point)) as f32;
    let rays = (whole_sr * RAYS / (4.0 * PI)).ceil() as usize;
    let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let ways: Vec<Vec3> = points_on(
        corners,
        rays.clamp(LEAST_RAYS_OF_A_PATCH, MOST_RAYS_OF_A_PATCH),
    )
    .map(|on_it| on_it - point)
    .collect();
    // What parts of one area are seen under.
    let share = |way: Vec3| across.dot(way).abs() / way.length().powi(3).max(1e-30);
    let shares: f32 = ways.iter().copied().map(share).sum();
    let scale = whole_sr / shares.max(1e-30);
    let seen: Vec<(Vec3, f32)> = ways
        .iter()
        .filter(|&&way| !caster.is_hidden(point, way, REACH))
        .map(|&way| (way.normalize_or_zero(), share(way) * scale))
        .collect();
    let are_all = (!seen.is_empty()).then_some(seen.len() == ways.len());
    SeenParts { seen, are_all }
}
