//! The composite held against rays in double precision, pixel by pixel.
//!
//! Drawn over a white video the picture is, in linear light, `gain` on real surfaces and radiance on virtual ones. What
//! it has to be is made of *states*, one for each sample: what a ray there sees, and which lights reach that. A pixel is
//! right if the states at its samples explain it within [`TOLERANCE`]; an edge that passes a sample close by may have the
//! state beyond it instead, and how far away that is found is measured.
//!
//! On edges the pixel is also held against its area. A camera averages light over a pixel: where a real shadow's edge
//! passes, the recorded pixel is `albedo / π · mean(reaching)`, and with the virtual things there it would have been
//! `albedo / π · mean(reaching − taken)`. So the gain of an area is `Σ (reaching − taken) / Σ reaching`, which is what the
//! renderer makes of its samples, and not the mean of the places' gains: that would leave a bright seam along the real shadow.
//! It is taken over the real surfaces that are seen in the composite, as far as nobody knows what virtual ones cover, and
//! counts by their part of the pixel.

use glam::{DAffine3, DVec2, DVec3};
use gnomon::app::truth::FACES_AWAY;
use gnomon::app::truth::ray_cast::{Exact, GRAZES, SeenSurface, View, World, pixels};
use gnomon::geometry::mesh::Mesh;
use gnomon::light::{Light, irradiance};
use gnomon::render::{Layers, REAL, REAL_HIDES, VIRTUAL, VIRTUAL_HIDES};
use std::f64::consts::PI;

use super::near_edges::{self, SAMPLES_PX};
use super::{Picture, Stage};

/// Linear; half a level of white is 0.0045 of it.
pub const TOLERANCE: f64 = 0.02;

/// Distances from a sample within which an edge is looked for, pixels. Corners are snapped to 1/256 px.
pub const RINGS_PX: [f64; 7] = [0.004, 0.01, 0.03, 0.1, 0.25, 0.5, 0.75];
const PLACES_IN_RING: usize = 24;
/// Rays along each side of a pixel for its area's average.
const AREA_SIDE: usize = 8;
/// So many wrong pixels are looked into; the rest of them are counted.
const ENOUGH: usize = 12;

/// What is seen at a place and which lights reach it.
#[derive(Debug, Clone, Copy)]
pub struct State {
    pub surface: Option<SeenSurface>,
    /// Lights that reach a real surface in the video, or a virtual one past all casters.
    pub arriving: u32,
    /// Those of them that virtual things take from a real surface.
    pub taken: u32,
    /// A light that is nearly in the surface's plane.
    grazes: bool,
}

impl State {
    /// With each light's bits.
    fn new(surface: Option<SeenSurface>, bits: impl Iterator<Item = u8>) -> Self {
        let mut state = Self {
            surface,
            arriving: 0,
            taken: 0,
            grazes: false,
        };
        for (index, bits) in bits.enumerate().filter(|_| surface.is_some()) {
            state.grazes |= bits & GRAZES != 0;
            if bits & (FACES_AWAY | REAL_HIDES) != 0 {
                continue;
            }
            let (real, hidden) = (state.role() == REAL, bits & VIRTUAL_HIDES != 0);
            state.arriving |= u32::from(real || !hidden) << index;
            state.taken |= u32::from(real && hidden) << index;
        }
        state
    }

    fn role(&self) -> u8 {
        self.surface.map_or(0, |surface| surface.role)
    }

    /// Whether nothing but the place differs.
    fn is_like(&self, other: &Self) -> bool {
        let normals = self.surface.zip(other.surface);
        self.role() == other.role()
            && (self.arriving, self.taken) == (other.arriving, other.taken)
            && self.thing() == other.thing()
            && normals.is_none_or(|(one, other)| one.normal.dot(other.normal) > 0.999_99)
    }

    fn thing(&self) -> usize {
        self.surface.map_or(usize::MAX, |surface| surface.thing)
    }
}

/// What a scene must look like from a camera.
pub struct Expected<'a> {
    world: &'a World,
    view: View,
    world_from_camera: DAffine3,
    lights: Vec<Light>,
    /// Irradiance from all around.
    ambient: DVec3,
    /// Of the virtual things.
    albedos: Vec<DVec3>,
    /// For each of them whether its normals are those of its triangles. Of others no more is known than what bounds them:
    /// what no light gives, and what all lights would that shine straight on them.
    faceted: Vec<bool>,
    /// Radiance that virtual surfaces get beyond what is known, at most, for each unit of albedo: in the world they get the
    /// light that their surroundings throw back, which a table of harmonics or rays knows and this does not.
    unknown: f64,
    samples: usize,
    /// At each pixel's centre.
    centers: Vec<State>,
}

/// How a picture differs from what it must be.
#[derive(Debug, Default, Clone)]
pub struct Verdict {
    /// Pixels that were judged.
    pub judged: usize,
    /// Those that a virtual thing changes.
    pub changed: usize,
    /// Pixels that no state within [`RINGS_PX`] explains.
    pub wrong: usize,
    /// What the first of them are.
    pub first: Vec<String>,
    /// How many pixels needed an edge within each of [`RINGS_PX`].
    pub snapped: [usize; RINGS_PX.len()],
    /// Pixels that none explains, where an edge passes a sample within the snapping.
    pub thin: usize,
    /// Differences from the area's average on pixels with edges in them, found and as the samples' exact states have it.
    pub edges: Differences,
    pub pattern: Differences,
}

/// Of some pixels.
#[derive(Debug, Default, Clone, Copy)]
pub struct Differences {
    pub count: usize,
    pub sum_of_squares: f64,
    pub most: f64,
}

impl Differences {
    pub fn add(&mut self, difference: f64) {
        self.count += 1;
        self.sum_of_squares += difference * difference;
        self.most = self.most.max(difference.abs());
    }

    pub fn join(&mut self, other: &Self) {
        self.count += other.count;
        self.sum_of_squares += other.sum_of_squares;
        self.most = self.most.max(other.most);
    }

    pub fn rms(&self) -> f64 {
        (self.sum_of_squares / self.count.max(1) as f64).sqrt()
    }
}

impl Verdict {
    pub fn join(&mut self, other: &Self) {
        self.judged += other.judged;
        self.changed += other.changed;
        self.wrong += other.wrong;
        self.first.extend(other.first.iter().cloned());
        self.thin += other.thin;
        for (sum, count) in self.snapped.iter_mut().zip(other.snapped) {
            *sum += count;
        }
        self.edges.join(&other.edges);
        self.pattern.join(&other.pattern);
    }

    pub fn summary(&self) -> String {
        format!(
            "{} judged, {} changed, {} wrong, snapped {:?}, thin {}, edges {} rms {:.4} most {:.3} (pattern rms {:.4} most {:.3})",
            self.judged,
            self.changed,
            self.wrong,
            self.snapped,
            self.thin,
            self.edges.count,
            self.edges.rms(),
            self.edges.most,
            self.pattern.rms(),
            self.pattern.most,
        )
    }
}

/// Least and most that a pixel may be.
#[derive(Debug, Clone, Copy)]
struct Range {
    low: DVec3,
    high: DVec3,
}

impl Range {
    const ZERO: Self = Self {
        low: DVec3::ZERO,
        high: DVec3::ZERO,
    };

    fn holds(&self, found: DVec3) -> bool {
        found.cmpge(self.low - TOLERANCE).all() && found.cmple(self.high + TOLERANCE).all()
    }

    fn union(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }
}

/// Gain of real surfaces: how much of the light that reaches them is left. What is shaded at one place has the least of
/// both there, and the most of both.
fn gain_range(reaching: Range, taken: Range, at_one_place: bool) -> Range {
    let gain = |taken: DVec3, reaching: DVec3| {
        let left = (reaching - taken).max(DVec3::ZERO) / reaching;
        DVec3::select(taken.cmpgt(DVec3::ZERO), left, DVec3::ONE)
    };
    if !at_one_place {
        return Range {
            low: gain(taken.high, reaching.low),
            high: gain(taken.low, reaching.high),
        };
    }
    let ends = [
        gain(taken.low, reaching.low),
        gain(taken.high, reaching.high),
    ];
    Range {
        low: ends[0].min(ends[1]),
        high: ends[0].max(ends[1]),
    }
}

/// What a light gives a surface that faces it.
fn straight_on(light: &Light, point: DVec3) -> DVec3 {
    let towards = match *light {
        Light::Point { position_m, .. } => position_m - point,
        Light::Directional { direction, .. } => -direction,
    };
    irradiance(light, point, towards.normalize_or_zero())
}

fn is_faceted(mesh: &Mesh) -> bool {
    let triangles = mesh.triangles.iter().zip(&mesh.corner_normals);
    triangles.into_iter().all(|(corners, normals)| {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize].as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        normals.iter().all(|corner| corner.distance(normal) < 1e-4)
    })
}

fn is_close_to_virtual(stage: &Stage) -> bool {
    const CLOSE_M: f64 = 0.1;
    let mut seeming = stage
        .world
        .triangles
        .iter()
        .filter(|triangle| triangle.role == VIRTUAL);
    seeming.any(|triangle| {
        stage.scene.lights.iter().any(|light| match &light.light {
            Light::Point { position_m, .. } => {
                let [a, b, c] = triangle.corners;
                let places = [a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
                places
                    .iter()
                    .any(|place| place.distance(*position_m) < CLOSE_M)
            }
            Light::Directional { .. } => false,
        })
    })
}

impl<'a> Expected<'a> {
    pub fn new(stage: &'a Stage, view: View) -> Self {
        let lights = stage.scene.world_lights();
        let exact = stage.world.cast(&lights, &view, 0.0);
        Self::of_exact(stage, view, &exact)
    }

    /// The same, where its rays have been cast.
    pub fn of_exact(stage: &'a Stage, view: View, exact: &Exact) -> Self {
        let of_world = stage.world_from_card.is_none();
        let ambient = stage.scene.ambient_radiance;
        Self {
            world: &stage.world,
            view,
            world_from_camera: view.camera_from_world.inverse(),
            lights: stage.scene.world_lights(),
            ambient: ambient * PI,
            albedos: (stage.scene.virtuals.iter())
                .map(|object| object.materials[0].albedo)
                .collect(),
            faceted: stage
                .scene
                .virtuals
                .iter()
                .map(|object| is_faceted(&object.mesh))
                .collect(),
            unknown: match of_world {
                false => 0.0,
                // A spot that a light close by makes bright may throw any light back.
                true if is_close_to_virtual(stage) => 1e6,
                true => ambient.max_element() + 0.3,
            },
            samples: stage.scene.shadows.samples as usize,
            centers: (exact.surfaces.iter().enumerate())
                .map(|(index, surface)| {
                    State::new(*surface, exact.bits.iter().map(|bits| bits[index]))
                })
                .collect(),
        }
    }

    /// The same drawn with another number of samples.
    pub fn with_samples(mut self, samples: u32) -> Self {
        self.samples = samples as usize;
        self
    }

    /// What is seen at a place, and which lights reach it.
    pub fn state(&self, place: DVec2) -> State {
        let surface = self.world.look(&self.view, place);
        let bits = surface.iter().flat_map(|surface| {
            let bits_of = |light: &Light| self.world.bits(surface, light, 0.0);
            self.lights.iter().map(bits_of)
        });
        State::new(surface, bits)
    }

    /// The composite of a pixel whose samples have these states, shaded where the pixel's centre is.
    fn composite(&self, states: &[State], center: DVec2) -> Range {
        self.shaded(states, &|_| vec![center])
    }

    /// The least and most of it, wherever in the pixel the renderer shades. With several samples each triangle's, and of
    /// those the ones that the stencil lets pass, are shaded together, somewhere in their middle.
    fn range(&self, center: DVec2, states: &[State]) -> Range {
        if self.samples == 1 {
            return self.composite(states, center);
        }
        let of_samples = SAMPLES_PX.map(|sample| center + DVec2::from_array(sample));
        let anywhere = [&[center], &of_samples[..]].concat();
        let triangle = |state: &State| state.surface.map(|surface| surface.triangle);
        let whole = states
            .iter()
            .all(|state| state.is_like(&states[0]) && triangle(state) == triangle(&states[0]));
        match whole {
            true => anywhere
                .iter()
                .fold(self.composite(states, center), |range, place| {
                    range.union(self.composite(states, *place))
                }),
            false => self.shaded(states, &|_| anywhere.clone()),
        }
    }

    /// Each sample's state shaded at any of some places, what is taken from a surface apart from what reaches it.
    fn shaded(&self, states: &[State], places: &dyn Fn(usize) -> Vec<DVec2>) -> Range {
        let (mut reaching, mut taken, mut added) = (Range::ZERO, Range::ZERO, Range::ZERO);
        let (mut modelled, mut open) = (0.0, 0.0);
        for (index, state) in states.iter().enumerate() {
            let Some(surface) = state.surface else {
                open += 1.0;
                continue;
            };
            let points = places(index);
            let points: Vec<DVec3> = points
                .iter()
                .map(|place| self.on_plane(&surface, *place))
                .collect();
            if surface.role == VIRTUAL {
                let radiance = self.virtual_radiance(&surface, state.arriving, &points);
                added.low += radiance.low;
                added.high += radiance.high;
            } else {
                let reaches = self.light_sum(state.arriving, &points, surface.normal);
                let takes = self.light_sum(state.taken, &points, surface.normal);
                reaching.low += self.ambient + reaches.low;
                reaching.high += self.ambient + reaches.high;
                taken.low += takes.low;
                taken.high += takes.high;
                modelled += 1.0;
            }
        }
        let at_one_place = states.iter().all(|state| state.is_like(&states[0]));
        let gains = gain_range(reaching, taken, at_one_place);
        let weight = 1.0 / states.len() as f64;
        Range {
            low: ((gains.low * modelled + open + added.low) * weight).min(DVec3::ONE),
            high: ((gains.high * modelled + open + added.high) * weight).min(DVec3::ONE),
        }
    }

    /// What some lights give a surface together, at any of some points of its plane.
    fn light_sum(&self, lights: u32, points: &[DVec3], normal: DVec3) -> Range {
        let reaches = |index: &usize| lights >> index & 1 == 1;
        let at = |point: &DVec3| -> DVec3 {
            let given = |index: usize| irradiance(&self.lights[index], *point, normal);
            (0..self.lights.len()).filter(reaches).map(given).sum()
        };
        let sums = points.iter().map(at);
        let ranges = sums.map(|sum| Range {
            low: sum,
            high: sum,
        });
        ranges.reduce(Range::union).unwrap_or(Range::ZERO)
    }

    /// What a virtual surface sends to the camera, at any of some points of its plane.
    fn virtual_radiance(&self, surface: &SeenSurface, arriving: u32, points: &[DVec3]) -> Range {
        let albedo = self.albedos[surface.thing];
        let least = if self.unknown > 0.0 { 0.0 } else { 1.0 };
        let unlit = self.ambient * albedo / PI;
        let mut radiance = Range {
            low: unlit * least,
            high: unlit + self.unknown * albedo,
        };
        if points.len() > 1 && self.is_edge_on(points) {
            radiance.high += 1.0;
        } else if self.faceted[surface.thing] {
            let lights = self.light_sum(arriving, points, surface.normal);
            radiance.low += lights.low * albedo / PI;
            radiance.high += lights.high * albedo / PI;
        } else {
            let straight = self.lights.iter().map(|light| {
                points.iter().fold(DVec3::ZERO, |most, point| {
                    most.max(straight_on(light, *point))
                })
            });
            radiance.high += straight.sum::<DVec3>() * albedo / PI;
        }
        radiance
    }

    /// Whether the depth changes so much from a pixel to the next that those points are anywhere.
    fn is_edge_on(&self, points: &[DVec3]) -> bool {
        let to_camera = &self.view.camera_from_world;
        let depths = points
            .iter()
            .map(|point| to_camera.transform_point3(*point).z);
        let (low, high) = depths.fold((f64::MAX, 0.0_f64), |(low, high), depth_m| {
            (low.min(depth_m), high.max(depth_m))
        });
        high > 1.3 * low
    }

    /// Where a ray at a place would meet the plane of a surface.
    fn on_plane(&self, surface: &SeenSurface, place: DVec2) -> DVec3 {
        let eye = self.world_from_camera.translation;
        let plane = self.view.intrinsics.plane_from_pixel(place);
        let direction = self.world_from_camera.transform_vector3(plane.extend(1.0));
        let along = surface.normal.dot(surface.point - eye) / surface.normal.dot(direction);
        // Seen edge-on the plane may be behind the camera there.
        let along = if along.is_finite() && along > 0.0 {
            along
        } else {
            1e3
        };
        eye + direction * along
    }

    /// Whether a part of the triangle lies behind the camera: there the driver cuts it.
    fn reaches_behind(&self, surface: &SeenSurface) -> bool {
        let corners = self.world.triangles[surface.triangle].corners;
        let to_camera = &self.view.camera_from_world;
        corners
            .iter()
            .any(|corner| to_camera.transform_point3(*corner).z <= 0.0)
    }

    fn is_touched(&self, state: &State) -> bool {
        let Some(surface) = state.surface else {
            return false;
        };
        surface.role == VIRTUAL || state.taken != 0
    }

    fn is_any_touched(&self, states: &[State]) -> bool {
        states.iter().any(|state| self.is_touched(state))
    }

    fn sample_states(&self, center: DVec2) -> Vec<State> {
        let places = self.sample_places(center);
        places.iter().map(|place| self.state(*place)).collect()
    }

    fn sample_places(&self, center: DVec2) -> Vec<DVec2> {
        match self.samples {
            1 => vec![center],
            _ => SAMPLES_PX
                .iter()
                .map(|sample| center + DVec2::from_array(*sample))
                .collect(),
        }
    }

    /// Whether the centres of the pixels around it have the state of its own.
    pub fn is_uniform(&self, index: usize) -> bool {
        let size_px = self.view.intrinsics.size_px;
        let center = &self.centers[index];
        near_edges::is_uniform(size_px, index, |_, other| {
            center.is_like(&self.centers[other])
        })
    }

    /// Holds a picture over white, and the same over a video that must stay where nothing virtual is.
    pub fn judge(&self, picture: &Picture, over_noise: Option<(&Picture, &[u8])>) -> Verdict {
        let mut verdict = Verdict::default();
        for (index, center) in pixels(self.view.intrinsics.size_px) {
            self.judge_pixel(index, center, picture, over_noise, &mut verdict);
        }
        verdict
    }

    fn judge_pixel(
        &self,
        index: usize,
        center: DVec2,
        picture: &Picture,
        over_noise: Option<(&Picture, &[u8])>,
        verdict: &mut Verdict,
    ) {
        let state = &self.centers[index];
        let uniform = self.is_uniform(index);
        if state.grazes && uniform {
            return;
        }
        let found = picture.linear(index);
        let is_white = picture.pixel(index) == [255; 3];
        let stays = over_noise.is_none_or(|(noisy, video)| {
            noisy.rgba[4 * index..4 * index + 3] == video[4 * index..4 * index + 3]
        });
        // Most pixels are alike all over.
        if uniform {
            let touched = self.is_touched(state);
            let explained = match touched {
                true => self.composite(&[*state], center).holds(found),
                false => is_white && stays,
            };
            if explained {
                verdict.judged += 1;
                verdict.changed += usize::from(touched);
                return;
            }
        }
        let states: Vec<State> = if uniform {
            vec![*state; self.samples]
        } else {
            self.sample_states(center)
        };
        if states.iter().any(|state| state.grazes) {
            return;
        }
        verdict.judged += 1;
        verdict.changed += usize::from(self.is_any_touched(&states));
        if !uniform {
            self.measure_edge(center, &states, found, index, verdict);
        }
        let explained = |states: &[State]| {
            self.range(center, states).holds(found)
                && (self.is_any_touched(states) || is_white && stays)
        };
        if explained(&states) {
            return;
        }
        let states = self.sample_states(center);
        if explained(&states) {
            return;
        }
        self.look_into(index, center, &states, found, stays, verdict);
    }

    /// Finds what an unexplained pixel may be, or why it is wrong.
    fn look_into(
        &self,
        index: usize,
        center: DVec2,
        states: &[State],
        found: DVec3,
        stays: bool,
        verdict: &mut Verdict,
    ) {
        if verdict.wrong >= ENOUGH {
            verdict.wrong += 1;
            return;
        }
        let touched = self.is_any_touched(states);
        if let Some(ring) = self.nearest_explanation(center, states, found, touched) {
            verdict.snapped[ring] += 1;
            return;
        }
        if self.is_snapped(index, center) && self.is_possible(center, states, found) {
            verdict.thin += 1;
            return;
        }
        verdict.wrong += 1;
        let range = self.range(center, states);
        let seen: Vec<String> = states.iter().map(|state| self.described(state)).collect();
        let away = if self.is_uniform(index) {
            ", away from edges"
        } else {
            ""
        };
        verdict.first.push(format!(
            "pixel {center}: found {found:.3} (stays: {stays}) for {:.3} to {:.3}; {}{away}",
            range.low,
            range.high,
            seen.join(" | "),
        ));
    }

    /// A state in words, for whoever looks for the mistake.
    fn described(&self, state: &State) -> String {
        let Some(surface) = state.surface else {
            return "nothing".to_owned();
        };
        let kind = if surface.role == REAL {
            "real"
        } else {
            "virtual"
        };
        format!(
            "{kind} {} triangle {}{} at {:.5} normal {:.4} arriving {:b} taken {:b}",
            surface.thing,
            surface.triangle,
            if self.reaches_behind(&surface) {
                " (reaching behind the camera)"
            } else {
                ""
            },
            surface.point,
            surface.normal,
            state.arriving,
            state.taken,
        )
    }

    /// Pixels away from edges where the layers say something else than the picture: what is there, which lights reach it, and
    /// what is left of the video. For the first of them what that is.
    pub fn disagreements(&self, picture: &Picture, layers: &Layers) -> (usize, Option<String>) {
        let (mut count, mut first) = (0, None);
        for (index, center) in pixels(self.view.intrinsics.size_px) {
            let state = self.centers[index];
            if state.grazes || !self.is_uniform(index) {
                continue;
            }
            let found = picture.linear(index);
            // What the layers say, with the exact place to shade.
            let mut told = State {
                arriving: 0,
                taken: 0,
                ..state
            };
            for (light, bits) in layers.shadow.iter().enumerate() {
                let (real, seeming) = (
                    bits[index] & REAL_HIDES != 0,
                    bits[index] & VIRTUAL_HIDES != 0,
                );
                let arrives = !real && (state.role() == REAL || !seeming);
                told.arriving |= u32::from(arrives) << light;
                told.taken |= u32::from(arrives && seeming && state.role() == REAL) << light;
            }
            let gain = DVec3::from_array(layers.gain[index].map(f64::from));
            let gain_differs = state.role() == REAL && (gain - found).abs().max_element() > 0.01;
            let states = vec![told; self.samples];
            let bits_differ = state.role() == REAL
                && !state.is_like(&told)
                && !self.range(center, &states).holds(found);
            if layers.role[index] != state.role() || gain_differs || bits_differ {
                // What is thinner than a pixel shows at no centre.
                let places = self.sample_places(center);
                let whole = places
                    .iter()
                    .all(|place| self.state(*place).is_like(&state));
                // Layers are told at the centre, which need be no sample's place.
                if !whole || self.is_snapped(index, center) || self.is_on_edge(center) {
                    continue;
                }
                count += 1;
                first.get_or_insert_with(|| {
                    let role = layers.role[index];
                    format!(
                        "pixel {center}: picture {found:.3}, gain {gain:.3}, role {role}, {told:?}"
                    )
                });
            }
        }
        (count, first)
    }

    fn measure_edge(
        &self,
        center: DVec2,
        states: &[State],
        found: DVec3,
        index: usize,
        verdict: &mut Verdict,
    ) {
        // A part of them tells enough.
        if !index.is_multiple_of(5) {
            return;
        }
        let area = self.area(center, AREA_SIDE);
        let differ = area[1..].iter().any(|state| !state.is_like(&area[0]));
        let is_known = |state: &State| {
            !state.grazes
                && state.surface.is_none_or(|surface| {
                    surface.role == REAL || self.unknown == 0.0 && self.faceted[surface.thing]
                })
        };
        if !differ || !area.iter().all(is_known) {
            return;
        }
        let average = |states: &[State]| self.composite(states, center).low;
        let of_area = average(&area);
        verdict.edges.add((found - of_area).abs().max_element());
        let pattern = average(states) - of_area;
        verdict.pattern.add(pattern.abs().max_element());
    }

    /// Whether a pixel is no darker than any light and shadow could make its samples: what is thinner than the snapping is
    /// there for no ray, but it is one of the scene's things.
    fn is_possible(&self, center: DVec2, states: &[State], found: DVec3) -> bool {
        let unlit = |albedo: &DVec3| self.ambient * *albedo / PI;
        let of_virtual = self.albedos.iter().map(unlit).reduce(DVec3::min);
        let darkest = states.iter().map(|state| {
            let dark = State {
                arriving: state.arriving * u32::from(state.role() == REAL),
                taken: state.arriving * u32::from(state.role() == REAL),
                ..*state
            };
            let alone = self.range(center, &[dark]).low;
            of_virtual.map_or(alone, |unlit| alone.min(unlit))
        });
        let least = darkest.sum::<DVec3>() / states.len() as f64;
        found.cmpge(least - TOLERANCE).all()
    }

    /// Whether an edge passes a sample of a pixel so closely that snapping alone decides between two pictures of it.
    pub fn is_snapped(&self, index: usize, center: DVec2) -> bool {
        let places = self.sample_places(center);
        self.centers[index].grazes || places.iter().any(|place| self.is_on_edge(*place))
    }

    fn is_on_edge(&self, place: DVec2) -> bool {
        let mut lights = self.lights.iter();
        lights.any(|light| near_edges::is_on_edge(self.world, &self.view, place, light))
    }

    /// How far from a pixel's samples, pixels, there is what explains its value: 0 where their own states do; `None` if
    /// nothing does.
    pub fn explained_within(&self, index: usize, picture: &Picture) -> Option<f64> {
        let width = self.view.intrinsics.size_px[0] as usize;
        let center = DVec2::new((index % width) as f64, (index / width) as f64);
        let found = picture.linear(index);
        let states = self.sample_states(center);
        let touched = self.is_any_touched(&states);
        let is_white = picture.pixel(index) == [255; 3];
        if self.range(center, &states).holds(found) && (touched || is_white)
            || states.iter().any(|state| state.grazes)
        {
            return Some(0.0);
        }
        let ring = self.nearest_explanation(center, &states, found, touched);
        let radius_px = ring.map(|ring| RINGS_PX[ring]);
        radius_px.or_else(|| self.is_snapped(index, center).then_some(RINGS_PX[0]))
    }

    /// States all over a pixel.
    pub fn area(&self, center: DVec2, side: usize) -> Vec<State> {
        (0..side * side)
            .map(|step| {
                let cell = DVec2::new((step % side) as f64, (step / side) as f64);
                self.state(center + (cell + 0.5) / side as f64 - 0.5)
            })
            .collect()
    }

    /// Mean radiance of some states where real things have this albedo: what an ideal camera records.
    pub fn radiance(&self, states: &[State], real_albedo: f64) -> DVec3 {
        let of_state = |state: &State| {
            let Some(surface) = state.surface else {
                return DVec3::ZERO;
            };
            let albedo = match surface.role {
                VIRTUAL => self.albedos[surface.thing],
                _ => DVec3::splat(real_albedo),
            };
            let left = state.arriving & !state.taken;
            let lights = (0..self.lights.len()).filter(|index| left >> index & 1 == 1);
            let given =
                lights.map(|index| irradiance(&self.lights[index], surface.point, surface.normal));
            (self.ambient + given.sum::<DVec3>()) * albedo / PI
        };
        states.iter().map(of_state).sum::<DVec3>() / states.len() as f64
    }

    /// The smallest of [`RINGS_PX`] around the samples in which states are found that explain a pixel.
    fn nearest_explanation(
        &self,
        center: DVec2,
        states: &[State],
        found: DVec3,
        touched: bool,
    ) -> Option<usize> {
        let places = self.sample_places(center);
        let mut choices: Vec<Vec<State>> = states.iter().map(|state| vec![*state]).collect();
        let mut touched = touched;
        for (ring, radius_px) in RINGS_PX.iter().enumerate() {
            let mut more = false;
            for (place, choices) in places.iter().zip(&mut choices) {
                for step in 0..PLACES_IN_RING {
                    let turn = (step as f64 + 0.37 * ring as f64) / PLACES_IN_RING as f64;
                    let towards = DVec2::from_angle(turn * 2.0 * PI);
                    let state = self.state(place + towards * *radius_px);
                    if !choices.iter().any(|known| known.is_like(&state)) {
                        touched |= self.is_touched(&state) || state.grazes;
                        choices.push(state);
                        more = true;
                    }
                }
            }
            if more && touched && self.any_explains(center, &choices, found) {
                return Some(ring);
            }
        }
        None
    }

    fn any_explains(&self, center: DVec2, choices: &[Vec<State>], found: DVec3) -> bool {
        let count: usize = choices.iter().map(Vec::len).product();
        let combination = |mut number: usize| -> Vec<State> {
            let chosen = choices.iter().map(|states| {
                let state = states[number % states.len()];
                number /= states.len();
                state
            });
            chosen.collect()
        };
        let combinations = (0..count.min(20_000)).map(combination);
        combinations
            .into_iter()
            .any(|states| self.range(center, &states).holds(found))
    }
}
