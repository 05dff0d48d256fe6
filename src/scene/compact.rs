//! Which of a scene's light is compact, so that its shadows have outlines, and which is broad.

use std::borrow::Cow;

use glam::DVec3;

use super::shadows::OutlinedLights;
use super::{ProbeScene, Scene, SceneLight};
use crate::geometry::bounds::Bounds;
use crate::geometry::ray_caster::RayCaster;
use crate::light::brightest::{BrightRegion, bright_regions};
use crate::light::compact::{TakenLight, take, width_rad};
use crate::light::probe::Probe;
use crate::light::{Light, REC_709, Shape, irradiance};

/// Probes have pixels of less than 3 degrees at least: what is asked of one direction in each would else be asked of too few.
const LEAST_PX: [usize; 2] = [128, 64];
/// Lights of a probe that are looked at, the strongest first.
const MOST_FOUND: usize = 8;
/// Things fill so many pixels of the picture, for what the camera could see of their shadows.
const SEEN_PX: f64 = 320.0;
/// The probe's lamp may lie so far beside a light of the scene and still be the same, radians.
const SAME_PLACE_RAD: f64 = 0.045;
/// Its irradiance may be so many times the light's, or as many times less.
const SAME_POWER: f64 = 3.0;

/// A light that stands out of the probe, and what became of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeLight {
    /// Unit direction towards it, from where the probe was taken.
    pub direction: DVec3,
    /// Its width as a disc, radians.
    pub width_rad: f64,
    /// Part of the power from all directions.
    pub share: f64,
    /// Width of the edges that shadows from it may have in the picture, pixels.
    pub penumbra_px: f64,
    /// What it is taken for.
    pub kind: ProbeLightKind,
}

/// What a light of a probe is taken for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProbeLightKind {
    /// A light of its own, with outlines.
    Compact,
    /// A part of the broad rest.
    Broad,
    /// What a light of the scene gives already: its pixels are taken out.
    SameAs {
        /// Index among the scene's lights.
        light: usize,
        /// Angle between the two, radians.
        beside_rad: f64,
        /// Its irradiance at the probe over the light's.
        ratio: f64,
    },
}

/// A scene's light: compact lights, and a probe of the rest.
#[derive(Debug, Clone)]
pub struct SplitLight<'a> {
    /// In the world: the scene's own lights, then those found in the probe.
    pub compact: Vec<SceneLight>,
    /// The probe without them.
    pub rest: Cow<'a, Probe>,
    /// All that stands out of the probe.
    pub found: Vec<ProbeLight>,
}

impl Scene {
    /// The compact lights of a scene in which they are drawn beside a probe, and the probe's rest; with another technique all of
    /// the probe.
    pub fn split_light<'a>(&self, scene: &'a ProbeScene) -> SplitLight<'a> {
        let mut split = SplitLight {
            compact: Vec::new(),
            rest: scene.probe.at_least(LEAST_PX),
            found: Vec::new(),
        };
        if !self.chosen_technique().0.has_compact_and_broad() {
            return split;
        }
        split.compact.extend(&self.lights);
        let mut walls = None;
        for region in bright_regions(&split.rest, MOST_FOUND) {
            let width_rad = width_rad(&region);
            let penumbra_px = self.penumbra_px(width_rad);
            let same = self.same_light(scene, &region);
            let kind = match same {
                Some(same) => same,
                None if self.is_below_table(scene, region.light.direction) => ProbeLightKind::Broad,
                None if penumbra_px < self.shadows.compact_penumbra_px => ProbeLightKind::Compact,
                None => ProbeLightKind::Broad,
            };
            if kind != ProbeLightKind::Broad {
                let taken = take(split.rest.to_mut(), &region);
                if kind == ProbeLightKind::Compact {
                    let walls = walls.get_or_insert_with(|| walls_of(scene));
                    let light = placed(&taken, scene, walls);
                    let anchor = scene.anchor;
                    split.compact.push(SceneLight { anchor, light });
                }
            }
            split.found.push(ProbeLight {
                direction: region.light.direction,
                width_rad,
                share: region.light.share,
                penumbra_px,
                kind,
            });
        }
        split
    }

    /// The lights that cast shadow volumes.
    pub fn outlined_lights(&self) -> Vec<SceneLight> {
        match (self.chosen_technique().0.outlined_lights(), &self.probe) {
            (OutlinedLights::None, _) => Vec::new(),
            (OutlinedLights::Compact, Some(probe)) => self.split_light(probe).compact,
            (OutlinedLights::Lamps, _) | (OutlinedLights::Compact, None) => self.lights.clone(),
        }
    }

    /// Whether light from a direction of a probe comes from below the table, which stands in its way but casts no volumes. (Where
    /// a probe that turns with a marker has its below is not known.)
    fn is_below_table(&self, scene: &ProbeScene, toward: DVec3) -> bool {
        let mut phantoms = self.phantoms.iter();
        let has_table =
            phantoms.any(|thing| thing.anchor == 0 && thing.visible && thing.is_table());
        scene.anchor == 0 && has_table && toward.z < 0.0
    }

    /// Width of the edges of shadows from a light of some width (radians), as a camera sees them that is near enough for all
    /// things to fill half of a small picture: at most as far below what casts them as the lowest thing that is seen. (A thing that
    /// moves counts as if it stood in the world: its marker lies on the table.)
    fn penumbra_px(&self, width_rad: f64) -> f64 {
        let things = self.phantoms.iter().chain(&self.virtuals);
        let seen = things.filter(|thing| thing.visible);
        let bounds = seen
            .clone()
            .filter(|thing| thing.casts)
            .filter_map(|thing| thing.bounds_in_anchor());
        let Some(around) = bounds.reduce(|a, b| Bounds {
            low: a.low.min(b.low),
            high: a.high.max(b.high),
        }) else {
            return 0.0;
        };
        let all = seen.filter_map(|thing| thing.bounds_in_anchor());
        let lowest_m = all.map(|bounds| bounds.low.z).fold(around.low.z, f64::min);
        let size = (around.high - around.low).with_z(around.high.z - lowest_m);
        2.0 * (width_rad / 2.0).min(1.5).tan() * size.z / size.length().max(1e-9) * SEEN_PX
    }

    /// The light of the scene that a bright part of the probe shows.
    fn same_light(&self, scene: &ProbeScene, region: &BrightRegion) -> Option<ProbeLightKind> {
        let reach_rad = SAME_PLACE_RAD + width_rad(region) / 2.0;
        // (What stands on another anchor moves against the probe, which was taken once.)
        let numbered = self.lights.iter().enumerate();
        let numbered = numbered.filter(|(_, light)| light.anchor == scene.anchor);
        let candidates = numbered.filter_map(|(index, SceneLight { light, .. })| {
            let toward = match *light {
                Light::Point { position_m, .. } => (position_m - scene.position_m).normalize(),
                Light::Directional { direction, .. } => -direction,
            };
            let beside_rad = toward.angle_between(region.light.direction);
            let given = irradiance(light, scene.position_m, toward).dot(REC_709);
            let ratio = region.light.irradiance.dot(REC_709) * scene.exposure / given.max(1e-30);
            let is_same =
                beside_rad < reach_rad && (SAME_POWER.recip()..=SAME_POWER).contains(&ratio);
            is_same.then_some((beside_rad, index, ratio))
        });
        let (beside_rad, light, ratio) = candidates.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(ProbeLightKind::SameAs {
            light,
            beside_rad,
            ratio,
        })
    }
}

/// The room's parts as light from the probe meets them.
fn walls_of(scene: &ProbeScene) -> RayCaster {
    let pieces = scene.room.iter().flat_map(|piece| &piece.triangles);
    let corners: Vec<_> = pieces.map(|(corners, _)| *corners).collect();
    RayCaster::new(&corners)
}

/// A light where it shines from: on the room's wall, or from afar.
fn placed(taken: &TakenLight, scene: &ProbeScene, walls: &RayCaster) -> Light {
    let irradiance = taken.irradiance * scene.exposure;
    let origin = scene.position_m.as_vec3();
    let hit = match scene.is_far {
        true => None,
        false => walls.first_hit(origin, taken.direction.as_vec3(), f32::INFINITY),
    };
    match hit {
        Some(hit) => {
            let distance_m = f64::from(hit.distance);
            Light::Point {
                position_m: scene.position_m + taken.direction * distance_m,
                intensity: irradiance * distance_m * distance_m,
                shape: Shape::Sphere {
                    radius_m: distance_m * (taken.width_rad / 2.0).sin(),
                },
            }
        }
        None => Light::Directional {
            direction: -taken.direction,
            irradiance,
            angle_rad: taken.width_rad,
        },
    }
}
