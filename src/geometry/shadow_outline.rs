//! Points of the outlines of cast shadows, as a camera sees them: each with the point of the caster that draws it.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::light_placing::{Facet, FarLight, PosedCamera};
use super::ray_caster::RayCaster;

/// Things that stand in the world, with what is needed to follow rays among them.
pub struct StandingThings {
    /// Corners, metres, counter-clockwise seen from outside.
    triangles: Vec<[DVec3; 3]>,
    /// The thing that each triangle belongs to.
    thing_of: Vec<usize>,
    all: RayCaster,
    casters: RayCaster,
    /// The edges of casters.
    edges: Vec<CasterEdge>,
}

/// An edge of a caster.
struct CasterEdge {
    ends: [DVec3; 2],
    /// The triangles on its two sides.
    sides: [usize; 2],
}

/// What a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    /// The thing's index.
    pub thing: usize,
    /// The triangle's index, counted through all things.
    pub triangle: usize,
    /// Where, with the normal on the ray's side.
    pub facet: Facet,
}

/// A point of a shadow's outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlinePoint {
    /// The point of the caster's silhouette that draws it, metres.
    pub caster_m: DVec3,
    /// The surface that it falls on, at the very point.
    pub receiver: Facet,
    /// The triangle that it falls on, counted through all things.
    pub receiving: usize,
    /// Unit vector in that surface, across the outline into the light.
    pub into_light: DVec3,
}

/// How far rays start from where they would meet what they start on.
const START_OFFSET_M: f64 = 1e-5;

impl StandingThings {
    /// Prepares things: each its triangles in the world, and whether it casts.
    pub fn new(things: &[(Vec<[DVec3; 3]>, bool)]) -> Self {
        let mut triangles = Vec::new();
        let mut thing_of = Vec::new();
        let mut edges: HashMap<[[u64; 3]; 2], (CasterEdge, usize)> = HashMap::new();
        for (thing, (own, casts)) in things.iter().enumerate() {
            for corners in own {
                let triangle = triangles.len();
                triangles.push(*corners);
                thing_of.push(thing);
                for side in 0..3 {
                    let ends = [corners[side], corners[(side + 1) % 3]];
                    let mut key = ends.map(|end| end.to_array().map(f64::to_bits));
                    key.sort_unstable();
                    if *casts {
                        let edge = edges.entry(key).or_insert((
                            CasterEdge {
                                ends,
                                sides: [triangle; 2],
                            },
                            0,
                        ));
                        edge.0.sides[1] = triangle;
                        edge.1 += 1;
                    }
                }
            }
        }
        let mut edges: Vec<CasterEdge> = edges
            .into_values()
            .filter(|(_, uses)| *uses == 2)
            .map(|(edge, _)| edge)
            .collect();
        edges.sort_by_key(|edge| edge.sides);
        let single = |triangle: &[DVec3; 3]| triangle.map(|corner| corner.as_vec3());
        let all: Vec<[Vec3; 3]> = triangles.iter().map(single).collect();
        let casts: Vec<bool> = things.iter().map(|(_, casts)| *casts).collect();
        let casting = all
            .iter()
            .zip(&thing_of)
            .filter(|(_, thing)| casts[**thing]);
        let casting: Vec<[Vec3; 3]> = casting.map(|(triangle, _)| *triangle).collect();
        Self {
            all: RayCaster::new(&all),
            casters: RayCaster::new(&casting),
            triangles,
            thing_of,
            edges,
        }
    }

    /// The first thing that a ray meets.
    pub fn first_met(&self, start_m: DVec3, direction: DVec3) -> Option<Met> {
        let hit = self
            .all
            .first_hit(start_m.as_vec3(), direction.as_vec3(), f32::INFINITY)?;
        let outward = self.normal(hit.triangle);
        let facing = outward.dot(direction) <= 0.0;
        let normal = if facing { outward } else { -outward };
        // In double precision, on the triangle's own plane.
        let [corner, ..] = self.triangles[hit.triangle];
        let distance = normal.dot(corner - start_m) / normal.dot(direction);
        Some(Met {
            thing: self.thing_of[hit.triangle],
            triangle: hit.triangle,
            facet: Facet {
                point_m: start_m + direction * distance,
                normal,
            },
        })
    }

    /// Whether a caster stands between a point of a surface and a light.
    pub fn in_shadow(&self, place: &Facet, light: &FarLight) -> bool {
        let way = light.way_from(place.point_m);
        let start_m = place.point_m + place.normal * (10.0 * START_OFFSET_M);
        // The way's length is the light's distance in units of itself.
        let reach = match light.inverse_distance > 0.0 {
            true => 1.0 / light.inverse_distance,
            false => f64::INFINITY,
        };
        self.casters
            .is_hidden(start_m.as_vec3(), way.as_vec3(), reach as f32)
    }

    /// Points of the outlines that the camera sees of the casters' shadows, some `spacing_m` apart on the casters, and
    /// at least `clear_m` from where another outline crosses.
    pub fn outline(
        &self,
        camera: &PosedCamera,
        light: &FarLight,
        spacing_m: f64,
        clear_m: f64,
    ) -> Vec<OutlinePoint> {
        let mut points = Vec::new();
        for edge in &self.edges {
            let lit = edge.sides.map(|side| {
                let normal = self.normal(side);
                normal.dot(light.way_from(self.triangles[side][0])) > 0.0
            });
            if lit[0] == lit[1] {
                continue;
            }
            let [from, to] = edge.ends;
            let count = ((to - from).length() / spacing_m).ceil().clamp(1.0, 1e4) as usize;
            for step in 0..count {
                let caster_m = from.lerp(to, (step as f64 + 0.5) / count as f64);
                let caster = self.thing_of[edge.sides[0]];
                points.extend(self.outline_point(
                    camera,
                    light,
                    (caster, caster_m, to - from),
                    clear_m,
                ));
            }
        }
        points
    }

    fn outline_point(
        &self,
        camera: &PosedCamera,
        light: &FarLight,
        (caster, caster_m, edge): (usize, DVec3, DVec3),
        clear_m: f64,
    ) -> Option<OutlinePoint> {
        let away = -light.way_from(caster_m).normalize();
        let met = self.first_met(caster_m + away * (100.0 * START_OFFSET_M), away)?;
        if met.thing == caster {
            return None;
        }
        let Facet { point_m, normal } = met.facet;
        let across = normal
            .cross(edge.cross(away).cross(normal))
            .normalize_or_zero();
        let beside = |by_m: f64| Facet {
            point_m: point_m + across * by_m,
            normal,
        };
        let [behind, ahead] = [-clear_m, clear_m].map(|by_m| {
            // All the way to there, or another outline lies between.
            let near = self.in_shadow(&beside(0.1 * by_m), light);
            let middle = self.in_shadow(&beside(0.5 * by_m), light);
            let far = self.in_shadow(&beside(by_m), light);
            (near == middle && middle == far).then_some(far)
        });
        let (behind, ahead) = (behind?, ahead?);
        if behind == ahead || !self.sees(camera, &met.facet) {
            return None;
        }
        Some(OutlinePoint {
            caster_m,
            receiver: met.facet,
            receiving: met.triangle,
            into_light: if behind { across } else { -across },
        })
    }

    /// Whether the camera sees a point of a surface.
    pub fn sees(&self, camera: &PosedCamera, place: &Facet) -> bool {
        let Some(pixel) = camera.pixel(place.point_m) else {
            return false;
        };
        let (eye_m, direction) = camera.ray(pixel);
        let tolerance_m = 1e-4 + 1e-3 * (place.point_m - eye_m).length();
        self.first_met(eye_m, direction)
            .is_some_and(|met| (met.facet.point_m - place.point_m).length() < tolerance_m)
    }

    fn normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.triangles[triangle];
        (b - a).cross(c - a).normalize_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::{Distortion, Intrinsics};
    use glam::{DAffine3, DMat3, DVec2};

    fn square(half_m: f64, z_m: f64) -> [[DVec3; 3]; 2] {
        let corner = |x: f64, y: f64| DVec3::new(x * half_m, y * half_m, z_m);
        let [a, b, c, d] =
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner(x, y));
        [[a, b, c], [a, c, d]]
    }

    fn slab(half_m: f64, low_m: f64, high_m: f64) -> Vec<[DVec3; 3]> {
        let mut triangles = square(half_m, high_m).to_vec();
        triangles.extend(square(half_m, low_m).map(|[a, b, c]| [a, c, b]));
        let ring = |z: f64| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| DVec3::new(x * half_m, y * half_m, z))
        };
        let (low, high) = (ring(low_m), ring(high_m));
        for side in 0..4 {
            let next = (side + 1) % 4;
            triangles.push([low[side], low[next], high[next]]);
            triangles.push([low[side], high[next], high[side]]);
        }
        triangles
    }

    /// A lamp over the middle: the shadow of a square slab is the square that its upper side draws.
    #[test]
    fn the_outline_of_a_slab_is_a_square_of_known_size() {
        let (half_m, high_m, lamp_m) = (0.05, 0.1, 0.5);
        let standing = StandingThings::new(&[
            (square(1.0, 0.0).to_vec(), false),
            (slab(half_m, 0.08, high_m), true),
        ]);
        let light = FarLight {
            center_m: DVec3::ZERO,
            towards: DVec3::Z,
            inverse_distance: 1.0 / lamp_m,
        };
        // From the side, below the slab: it hides nothing of its shadow but what lies behind it.
        let eye_m = DVec3::new(0.0, -0.6, 0.6);
        let forward = -eye_m.normalize();
        let down = forward.cross(DVec3::X);
        let camera_from_world = DAffine3 {
            matrix3: DMat3::from_cols(DVec3::X, down, forward).transpose(),
            translation: DVec3::ZERO,
        } * DAffine3::from_translation(-eye_m);
        let camera = PosedCamera {
            intrinsics: Intrinsics {
                size_px: [640, 480],
                focal_px: DVec2::splat(600.0),
                center_px: DVec2::new(320.0, 240.0),
                distortion: Distortion::NONE,
            },
            camera_from_world,
        };
        let outline = standing.outline(&camera, &light, 0.002, 0.004);
        assert!(outline.len() > 60, "{} points", outline.len());
        let side_m = half_m * lamp_m / (lamp_m - high_m);
        for point in &outline {
            let place_m = point.receiver.point_m;
            let off_m = place_m.truncate().abs().max_element() - side_m;
            assert!(place_m.z.abs() < 1e-9 && off_m.abs() < 1e-6, "{point:?}");
            assert!(point.into_light.dot(place_m) > 0.0 && point.into_light.z.abs() < 1e-9);
            assert!((point.into_light.abs().max_element() - 1.0).abs() < 1e-9);
            assert!((point.caster_m.z - high_m).abs() < 1e-12);
            assert!(point.receiving < 2);
        }
        let inside = |x_m: f64| Facet {
            point_m: DVec3::new(x_m, 0.0, 0.0),
            normal: DVec3::Z,
        };
        assert!(standing.in_shadow(&inside(side_m - 1e-4), &light));
        assert!(!standing.in_shadow(&inside(side_m + 1e-4), &light));
        // Nothing stands between a place and a lamp that is nearer than the slab.
        let low = FarLight {
            inverse_distance: 1.0 / 0.05,
            ..light
        };
        assert!(!standing.in_shadow(&inside(0.0), &low));
    }
}
