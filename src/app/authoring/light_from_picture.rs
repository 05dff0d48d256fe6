//! The light of a picture, found from what it does: where shadows fall says where it stands, how dark they are says how
//! strong it is.
//!
//! A person shows tips of shadows with the vertices that cast them, a pixel or two off. From there the whole outlines
//! of the shadows are looked for in the picture, and the light is moved to where they fit (as Harris & Stennett 1990
//! track an object by its edges). What is known of other lights counts as surroundings.

use glam::{DAffine3, DVec2, DVec3};

use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::geometry::light_placing::{
    Facet, FarLight, LightFreedom, PlacedLight, PosedCamera, ShadowPair, Unplaced, place_light,
    refine,
};
use crate::geometry::robust::{deviation, tukey_weight};
use crate::geometry::shadow_outline::{OutlinePoint, StandingThings};
use crate::light::bounce::{FurtherLight, Reflector, Surroundings};
use crate::light::contrast::{ContrastSample, Strengths, strengths};
use crate::light::{Light, irradiance};
use crate::scene::{Marker, Scene};

/// How well people click, pixels.
const CLICK_SIGMA_PX: f64 = 1.5;
/// How far to both sides of an outline its edge is looked for, round by round, pixels.
const REACHES_PX: [f64; 6] = [12.0, 9.0, 7.0, 6.0, 5.0, 5.0];
/// Fewer edges than these move no light.
const LEAST_EDGES: usize = 12;
/// Outlines are sampled this many pixels apart, as the caster is seen.
const SPACING_PX: f64 = 2.0;
/// Part of its brightness that a surface must lose at a shadow's edge.
const LEAST_CONTRAST: f64 = 0.12;
/// Edges that lie closer along the picture than this to being seen edge-on are not measured: pixels per pixel.
const LEAST_SLANT: f64 = 0.2;
/// From an edge on that brightness is undisturbed by it, and up to where it is taken, pixels.
const PLATEAU_PX: [f64; 4] = [3.0, 4.0, 5.0, 6.0];
/// Rays for what surrounds a place.
const RAYS: usize = 256;
/// White around a print that nobody takes for the table, as part of the print's size.
const PRINT_MARGIN: f64 = 0.15;

/// A frame's real things, as its camera sees them.
pub struct PicturedThings {
    camera: PosedCamera,
    standing: StandingThings,
    /// All their triangles, in the standing's order.
    reflectors: Vec<Reflector>,
    vertices: Vec<PickedVertex>,
    prints: Vec<(DAffine3, Marker)>,
    /// Metres that a pixel spans at the world's origin.
    pixel_m: f64,
}

/// A vertex of a phantom that casts shadows.
#[derive(Debug, Clone, PartialEq)]
pub struct PickedVertex {
    /// The phantom's name.
    pub phantom: String,
    /// In the world, metres.
    pub world_m: DVec3,
    /// In the undistorted picture.
    pub pixel: DVec2,
}

/// A vertex, and the tip of the shadow that it casts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowClick {
    /// In the world, metres.
    pub vertex_m: DVec3,
    /// In the undistorted picture.
    pub shadow_px: DVec2,
}

/// A light that was found in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundLight {
    /// The light; its strength is 1 where the picture does not tell it.
    pub light: Light,
    /// By the clicks alone, how far off it may be: metres of a point light, radians of a directional one.
    pub click_sigma: f64,
    /// How far the clicks are off what the light casts, root mean square.
    pub click_rms_px: f64,
    /// Edges of shadows in the picture that it was fitted to; 0: the clicks alone place it.
    pub edges: usize,
    /// How far those are off what it casts, root mean square.
    pub edge_rms_px: f64,
    /// The light's and the surroundings' strength; `None` where too little of the shadows' edges is seen.
    pub strengths: Option<Strengths>,
}

/// Why no light is found.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LightNotFound {
    /// A click beside all phantoms.
    #[error("pair {0}: no phantom is there for a shadow to fall on; give the scene a [table]")]
    NoSurface(usize),
    /// The pairs fix no light.
    #[error(transparent)]
    Unplaced(#[from] Unplaced),
}

impl PicturedThings {
    /// What a scene's phantoms are in a frame where the nodes are there; `None` while the world is not seen.
    pub fn new(
        scene: &Scene,
        intrinsics: Intrinsics,
        camera_from_node: &[Option<DAffine3>],
    ) -> Option<Self> {
        let camera_from_world = camera_from_node.first().copied().flatten()?;
        let world_from_camera = camera_from_world.inverse();
        let camera = PosedCamera {
            intrinsics,
            camera_from_world,
        };
        let mut things = Vec::new();
        let mut reflectors = Vec::new();
        let mut vertices = Vec::new();
        for phantom in scene.phantoms.iter().filter(|phantom| phantom.visible) {
            let Some(camera_from_anchor) = camera_from_node.get(phantom.anchor).copied().flatten()
            else {
                continue;
            };
            let world_from_object =
                world_from_camera * camera_from_anchor * phantom.anchor_from_object;
            let positions: Vec<DVec3> = phantom
                .mesh
                .positions
                .iter()
                .map(|position| world_from_object.transform_point3(position.as_dvec3()))
                .collect();
            let corners = |triangle: &[u32; 3]| triangle.map(|index| positions[index as usize]);
            let triangles: Vec<[DVec3; 3]> = phantom.mesh.triangles.iter().map(corners).collect();
            reflectors.extend(
                triangles
                    .iter()
                    .enumerate()
                    .map(|(number, corners)| Reflector {
                        corners: corners.map(|corner| corner.as_vec3()),
                        albedo: phantom.albedo(number),
                    }),
            );
            things.push((triangles, phantom.casts));
            if phantom.casts {
                vertices.extend(positions.iter().filter_map(|&world_m| {
                    Some(PickedVertex {
                        phantom: phantom.name.clone(),
                        world_m,
                        pixel: camera.pixel(world_m)?,
                    })
                }));
            }
        }
        let anchors = scene.anchors.iter().zip(camera_from_node);
        let prints = anchors.filter_map(|(anchor, pose)| {
            let anchor_from_world = (world_from_camera * (*pose)?).inverse();
            Some(
                anchor
                    .markers
                    .iter()
                    .map(move |marker| (anchor_from_world, *marker)),
            )
        });
        Some(Self {
            camera,
            standing: StandingThings::new(&things),
            reflectors,
            vertices,
            prints: prints.flatten().collect(),
            pixel_m: camera_from_world.translation.length() / intrinsics.focal_px.x,
        })
    }

    /// The vertex that is seen nearest to an undistorted pixel, if it is within reach; of vertices at the same place in
    /// the picture the one in front.
    pub fn vertex_at(&self, pixel: DVec2, within_px: f64) -> Option<&PickedVertex> {
        const SAME_PX: f64 = 1.0;
        let off = |vertex: &PickedVertex| vertex.pixel.distance(pixel);
        let nearest = self
            .vertices
            .iter()
            .map(off)
            .filter(|&off_px| off_px <= within_px)
            .min_by(f64::total_cmp)?;
        let depth = |vertex: &PickedVertex| {
            self.camera
                .camera_from_world
                .transform_point3(vertex.world_m)
                .z
        };
        self.vertices
            .iter()
            .filter(|vertex| off(vertex) <= nearest + SAME_PX)
            .min_by(|a, b| depth(a).total_cmp(&depth(b)))
    }

    /// The surface that is seen at an undistorted pixel.
    pub fn surface_at(&self, pixel: DVec2) -> Option<Facet> {
        let (eye_m, direction) = self.camera.ray(pixel);
        Some(self.standing.first_met(eye_m, direction)?.facet)
    }

    /// Finds the light that casts shadows where they were clicked, and how strong it is, in the frame (as it came from
    /// the camera).
    ///
    /// # Errors
    /// Why the clicks fix no light.
    pub fn find_light(
        &self,
        frame: &Frame,
        clicks: &[ShadowClick],
        freedom: LightFreedom,
    ) -> Result<FoundLight, LightNotFound> {
        let mut pairs = Vec::new();
        for (index, click) in clicks.iter().enumerate() {
            let receiver = self.surface_at(click.shadow_px);
            pairs.push(ShadowPair {
                caster_m: click.vertex_m,
                receiver: receiver.ok_or(LightNotFound::NoSurface(index))?,
                shadow_px: click.shadow_px,
                along: None,
            });
        }
        let clicked = place_light(&self.camera, &pairs, freedom, CLICK_SIGMA_PX)?;
        let fitted = self.fit_outlines(frame, &clicked, freedom);
        let (placed, edges) = fitted
            .as_ref()
            .map_or((&clicked, 0), |(placed, edges)| (placed, *edges));
        let unit = light_of(&placed.light, DVec3::ONE);
        let strengths = self.strengths(frame, &placed.light, &unit);
        let click_sigma = clicked.position_covariance(CLICK_SIGMA_PX).map_or_else(
            || clicked.direction_sigma_rad(CLICK_SIGMA_PX),
            |covariance| (covariance.diagonal().element_sum()).sqrt(),
        );
        Ok(FoundLight {
            light: strengths.map_or(unit, |found| light_of(&placed.light, found.light)),
            click_sigma,
            click_rms_px: clicked.rms_px,
            edges,
            edge_rms_px: fitted.map_or(0.0, |(placed, _)| placed.rms_px),
            strengths,
        })
    }

    /// Moves a light to where the outlines of its shadows lie on edges of the picture; `None` where too few are seen.
    fn fit_outlines(
        &self,
        frame: &Frame,
        clicked: &PlacedLight,
        freedom: LightFreedom,
    ) -> Option<(PlacedLight, usize)> {
        let mut placed = *clicked;
        let mut edges = 0;
        for reach_px in REACHES_PX {
            let outline = self.outline(&placed.light);
            let pairs: Vec<ShadowPair> = outline
                .iter()
                .filter_map(|point| self.edge(frame, point, reach_px))
                .collect();
            if pairs.len() < LEAST_EDGES {
                return None;
            }
            let mut weights = vec![1.0; pairs.len()];
            for _ in 0..5 {
                placed = refine(&self.camera, &pairs, &weights, placed.light, freedom)?;
                weights = self.weights(&pairs, &placed.light)?;
            }
            edges = weights.iter().filter(|&&weight| weight > 0.0).count();
        }
        (edges >= LEAST_EDGES).then_some((placed, edges))
    }

    fn outline(&self, light: &FarLight) -> Vec<OutlinePoint> {
        let clear_m = PLATEAU_PX[3] * self.pixel_m;
        let spacing_m = SPACING_PX * self.pixel_m;
        self.standing
            .outline(&self.camera, light, spacing_m, clear_m)
    }

    /// Tukey's weights: what lies far off the others has no say.
    fn weights(&self, pairs: &[ShadowPair], light: &FarLight) -> Option<Vec<f64>> {
        const LEAST_SCALE_PX: f64 = 0.1;
        let mut off = Vec::with_capacity(pairs.len());
        for pair in pairs {
            let shadow_m = light.shadow_of(pair.caster_m, &pair.receiver)?;
            let off_px = self.camera.pixel(shadow_m)? - pair.shadow_px;
            off.push(off_px.dot(pair.along.unwrap_or_default()).abs());
        }
        let scale_px = deviation(off.iter().copied()).max(LEAST_SCALE_PX);
        let weight = |off_px: &f64| tukey_weight(*off_px, scale_px);
        Some(off.iter().map(weight).collect())
    }

    /// Where the picture has the edge that an outline predicts: the step from dark to light across it.
    fn edge(&self, frame: &Frame, point: &OutlinePoint, reach_px: f64) -> Option<ShadowPair> {
        const STEPS_PER_PX: f64 = 2.0;
        /// Steps on each side of the edge that belong to its own width.
        const WIDTH: usize = 2;
        /// Least steps of a side.
        const SIDE: usize = 4;
        let (middle_px, along) = self.across(point)?;
        if !self.is_plain(point, middle_px, along * reach_px) {
            return None;
        }
        let count = (2.0 * reach_px * STEPS_PER_PX) as usize;
        let offset_px = |step: f64| step / STEPS_PER_PX - reach_px;
        let profile: Vec<f64> = (0..=count)
            .map(|step| {
                let rgb = self.seen(frame, middle_px + along * offset_px(step as f64))?;
                Some(rgb.element_sum())
            })
            .collect::<Option<_>>()?;
        let mean = |side: &[f64]| side.iter().sum::<f64>() / side.len() as f64;
        let split = |step: usize| {
            let dark = &profile[..step - WIDTH];
            let light = &profile[step + WIDTH + 1..];
            (dark, light)
        };
        let gain = |step: &usize| {
            let (dark, light) = split(*step);
            let rise = (mean(light) - mean(dark)).max(0.0);
            rise * rise * (dark.len() * light.len()) as f64
        };
        let steps = SIDE + WIDTH..=count - SIDE - WIDTH;
        let best = steps.max_by(|a, b| gain(a).total_cmp(&gain(b)))?;
        let (dark, light) = split(best);
        // What is near the edge tells its levels; what is far may be another surface's pattern.
        let dark = &dark[dark.len().saturating_sub(3 * SIDE)..];
        let light = &light[..light.len().min(3 * SIDE)];
        let (low, high) = (mean(dark), mean(light));
        let spread = |side: &[f64], mean: f64| {
            (side.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / side.len() as f64)
                .sqrt()
        };
        if high - low < LEAST_CONTRAST * high
            || spread(dark, low).max(spread(light, high)) > 0.3 * (high - low)
        {
            return None;
        }
        let half = 0.5 * (low + high);
        let near = best - WIDTH - 1..best + WIDTH + 1;
        let crossing = near
            .filter(|&step| profile[step] < half && profile[step + 1] >= half)
            .min_by_key(|step| step.abs_diff(best))?;
        let share = (half - profile[crossing]) / (profile[crossing + 1] - profile[crossing]);
        Some(ShadowPair {
            caster_m: point.caster_m,
            receiver: point.receiver,
            shadow_px: middle_px + along * offset_px(crossing as f64 + share),
            along: Some(along),
        })
    }

    /// Where an outline's point is seen, and the unit way across the outline into the light.
    fn across(&self, point: &OutlinePoint) -> Option<(DVec2, DVec2)> {
        let place_m = point.receiver.point_m;
        let middle_px = self.camera.pixel(place_m)?;
        let lit_px = self
            .camera
            .pixel(place_m + point.into_light * self.pixel_m)?;
        let way = lit_px - middle_px;
        (way.length() > LEAST_SLANT).then(|| (middle_px, way.normalize()))
    }

    /// Whether from end to end the same surface is seen, and nothing is printed on it.
    fn is_plain(&self, point: &OutlinePoint, middle_px: DVec2, reach: DVec2) -> bool {
        let Facet { point_m, normal } = point.receiver;
        [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().all(|share| {
            self.surface_at(middle_px + reach * share)
                .is_some_and(|facet| {
                    let same = normal.dot(facet.point_m - point_m).abs() < 0.1 * self.pixel_m;
                    same && !self.is_printed(facet.point_m)
                })
        })
    }

    fn is_printed(&self, world_m: DVec3) -> bool {
        self.prints.iter().any(|(anchor_from_world, marker)| {
            let in_anchor_m = anchor_from_world.transform_point3(world_m);
            let in_print_m = marker
                .anchor_from_marker
                .inverse()
                .transform_point3(in_anchor_m);
            let half_m = marker.size_m * (0.5 + PRINT_MARGIN);
            in_print_m.z.abs() < 0.1 * marker.size_m
                && in_print_m.truncate().abs().max_element() < half_m
        })
    }

    /// Radiance at an undistorted pixel; `None` outside the picture.
    fn seen(&self, frame: &Frame, undistorted_px: DVec2) -> Option<DVec3> {
        let camera = &self.camera.intrinsics;
        let distorted = camera.distort(camera.plane_from_pixel(undistorted_px));
        frame.linear_rgb(camera.pixel_from_plane(distorted))
    }

    fn strengths(&self, frame: &Frame, light: &FarLight, unit: &Light) -> Option<Strengths> {
        /// Brighter, the camera may have clipped.
        const CLIPPED: f64 = 0.97;
        const DARK: f64 = 0.002;
        let mut seen = Vec::new();
        let mut places = Vec::new();
        for point in self.outline(light) {
            let Some((middle_px, along)) = self.across(&point) else {
                continue;
            };
            let has_edge = self.edge(frame, &point, REACHES_PX[5]).is_some();
            if !has_edge || !self.is_plain(&point, middle_px, along * PLATEAU_PX[3]) {
                continue;
            }
            let mean = |sign: f64| {
                let sum: Option<DVec3> = PLATEAU_PX
                    .iter()
                    .map(|off_px| self.seen(frame, middle_px + along * (sign * off_px)))
                    .sum();
                Some(sum? / PLATEAU_PX.len() as f64)
            };
            let middle_off_px = PLATEAU_PX.iter().sum::<f64>() / PLATEAU_PX.len() as f64;
            let place = |sign: f64| self.surface_at(middle_px + along * (sign * middle_off_px));
            let (Some(lit), Some(shaded)) = (mean(1.0), mean(-1.0)) else {
                continue;
            };
            let (Some(lit_place), Some(shaded_place)) = (place(1.0), place(-1.0)) else {
                continue;
            };
            if lit.max_element() > CLIPPED || shaded.min_element() < DARK {
                continue;
            }
            seen.push((lit, shaded, self.reflectors[point.receiving].albedo));
            places.extend([lit_place, shaded_place].map(|facet| (facet.point_m, facet.normal)));
        }
        let around = |lights: Vec<Light>, ambient: DVec3| {
            let reflectors = self.reflectors.clone();
            Surroundings::new(reflectors, lights, ambient, FurtherLight::Estimated)
                .gather(&places, RAYS * places.len())
                .irradiances(&[])
        };
        let of_light = around(vec![*unit], DVec3::ZERO);
        let of_ambient = around(Vec::new(), DVec3::ONE);
        let samples: Vec<ContrastSample> = seen
            .iter()
            .enumerate()
            .map(|(index, &(lit, shaded, albedo))| {
                let (at_lit, at_shaded) = (2 * index, 2 * index + 1);
                let (point_m, normal) = places[at_lit];
                ContrastSample {
                    lit,
                    shaded,
                    albedo,
                    of_light_lit: irradiance(unit, point_m, normal) + of_light[at_lit].as_dvec3(),
                    of_light_shaded: of_light[at_shaded].as_dvec3(),
                    of_ambient_lit: of_ambient[at_lit].as_dvec3(),
                    of_ambient_shaded: of_ambient[at_shaded].as_dvec3(),
                }
            })
            .collect();
        strengths(&samples)
    }
}

fn light_of(placed: &FarLight, strength: DVec3) -> Light {
    match placed.position_m() {
        Some(position_m) => Light::point(position_m, strength),
        None => Light::directional(-placed.towards, strength),
    }
}
