//! The oracle of visibility: rays in double precision against the raw triangles, without any offset.

use super::comparison::FACES_AWAY;
use crate::geometry::camera::Intrinsics;
use crate::geometry::ray_caster::{BoxContent, RayCaster};
use crate::light::Light;
use crate::render::{REAL, REAL_HIDES, VIRTUAL, VIRTUAL_HIDES};
use glam::{DAffine3, DVec2, DVec3, Vec3};

/// The light passes along the surface: what hides it there is a matter of the last bits of single precision.
pub const GRAZES: u8 = 8;

/// Nothing is seen.
pub const NONE: u8 = 0;

/// The renderer draws nothing nearer, metres.
pub const NEAREST_M: f64 = 1e-3;
/// What lies within this of a surface is that surface, of which a mesh may have copies, metres.
const COINCIDENT_M: f64 = 1e-9;
/// Part of a point's coordinates that single precision may move it by: of two things that were placed in one plane by
/// different sums neither lies above the other.
const ROUNDING: f64 = 1e-7;
/// Sine of the angle up to which two triangles lie in one plane.
const PARALLEL: f64 = 1e-5;
/// A light no farther from a triangle's plane than this part of the way to its farthest corner and of its coordinates (or at
/// no larger sine to it, if it is distant) lies in it: it sees the triangle edge-on or lies on it, and the triangle hides
/// nothing.
const IN_THE_PLANE: f64 = 1e-7;
/// A virtual surface is seen as if it were nearer by this part, so that it wins where it lies in a real one,
const NEARER: f64 = 1.0 / 65_536.0;
/// and nearer by so much again than the virtual thing before it.
const NEARER_THAN_THE_LAST: f64 = 1.0 / 262_144.0;
/// Sine of the angle between light and surface below which the light grazes. Single precision puts a volume's side
/// off by some 2e-7 of its distance; on a surface at this angle that is 2e-4 of the distance, a tenth of a pixel of
/// the cameras here.
const GRAZING: f64 = 1e-3;

/// A triangle in the world.
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    /// [`REAL`] or [`VIRTUAL`].
    pub role: u8,
    /// Index of its thing among those of its role.
    pub thing: usize,
    /// Whether it takes light away from others.
    pub casts: bool,
    /// In the world, metres.
    pub corners: [DVec3; 3],
}

/// The surface that a ray meets first.
#[derive(Debug, Clone, Copy)]
pub struct SeenSurface {
    /// Of the triangle.
    pub role: u8,
    /// Its index.
    pub triangle: usize,
    /// And that of its thing among those of its role.
    pub thing: usize,
    /// Where the ray meets it, metres.
    pub point: DVec3,
    /// Of the triangle, towards where the ray came from.
    pub normal: DVec3,
    /// What lies within this of its plane is in the same place, metres.
    pub tie_m: f64,
}

/// A camera in the world.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Its lens.
    pub intrinsics: Intrinsics,
    /// Where it stands.
    pub camera_from_world: DAffine3,
}

/// The surfaces seen at each pixel's centre, rows from the top.
pub struct Exact {
    /// Width and height.
    pub size_px: [u32; 2],
    /// By pixel.
    pub surfaces: Vec<Option<SeenSurface>>,
    /// For each light and pixel.
    pub bits: Vec<Vec<u8>>,
}

/// Triangles ready to be hit.
pub struct World {
    /// All of them.
    pub triangles: Vec<Triangle>,
    most_nearness: f64,
    visible: BoxHierarchy,
    real_casters: BoxHierarchy,
    virtual_casters: BoxHierarchy,
}

impl World {
    /// Sorts triangles into boxes.
    pub fn new(triangles: Vec<Triangle>) -> Self {
        let where_ = |takes: &dyn Fn(&Triangle) -> bool| {
            let indices = (0..triangles.len()).filter(|&index| takes(&triangles[index]));
            BoxHierarchy::new(&triangles, &indices.collect::<Vec<_>>())
        };
        let things = triangles.iter().map(|triangle| triangle.thing + 1).max();
        Self {
            most_nearness: 1.0 + NEARER + things.unwrap_or(0) as f64 * NEARER_THAN_THE_LAST,
            visible: where_(&|_| true),
            real_casters: where_(&|t| t.casts && t.role == REAL),
            virtual_casters: where_(&|t| t.casts && t.role == VIRTUAL),
            triangles,
        }
    }

    /// What a pixel (or a place within one) sees.
    pub fn look(&self, view: &View, pixel: DVec2) -> Option<SeenSurface> {
        let world_from_camera = view.camera_from_world.inverse();
        let eye = world_from_camera.translation;
        let plane = view.intrinsics.plane_from_pixel(pixel);
        let direction = world_from_camera.transform_vector3(plane.extend(1.0));
        let ray = Ray {
            origin: eye,
            direction,
            near: NEAREST_M,
            reach: f64::INFINITY,
        };
        let (triangle, distance) = self.first_seen(&ray)?;
        let Triangle {
            role,
            thing,
            corners,
            ..
        } = self.triangles[triangle];
        let normal = plane_normal(&corners);
        let point = eye + direction * distance;
        Some(SeenSurface {
            role,
            triangle,
            thing,
            point,
            normal: if normal.dot(direction) > 0.0 {
                -normal
            } else {
                normal
            },
            tie_m: match role {
                VIRTUAL => (self.nearness(triangle) - 1.0) * distance * direction.length(),
                _ => ROUNDING * point.abs().max_element(),
            },
        })
    }

    /// How many times nearer than it is a triangle is seen.
    fn nearness(&self, triangle: usize) -> f64 {
        let Triangle { role, thing, .. } = self.triangles[triangle];
        match role {
            VIRTUAL => 1.0 + NEARER + thing as f64 * NEARER_THAN_THE_LAST,
            _ => 1.0,
        }
    }

    /// What is seen along a ray: the first triangle, but of several in one place the one that wins.
    fn first_seen(&self, ray: &Ray) -> Option<(usize, f64)> {
        let mut first: Option<(usize, f64)> = None;
        let mut seen_at = f64::INFINITY;
        self.visible
            .visit(&self.triangles, ray, |triangle, distance| {
                let seen = distance / self.nearness(triangle);
                if seen < seen_at {
                    seen_at = seen;
                    first = Some((triangle, distance));
                }
                Some(seen_at * self.most_nearness)
            });
        first
    }

    /// Who takes a light from a surface. `lift_m` moves the start of the ray off it along its normal: 0 is the truth;
    /// other renderers lift by some 0.1 mm against self-shadowing.
    pub fn bits(&self, surface: &SeenSurface, light: &Light, lift_m: f64) -> u8 {
        let start = surface.point + surface.normal * lift_m;
        let (to_light, reach) = match *light {
            Light::Point { position_m, .. } => (position_m - surface.point, 1.0),
            Light::Directional { direction, .. } => (-direction, f64::INFINITY),
        };
        let sine = surface.normal.dot(to_light.normalize());
        let ray = Ray {
            origin: start,
            direction: to_light,
            near: COINCIDENT_M / to_light.length(),
            reach,
        };
        let hides_nothing = |triangle: usize| {
            let corners = &self.triangles[triangle].corners;
            let normal = plane_normal(corners);
            // Of a triangle in the same plane it lies neither above nor below.
            triangle == surface.triangle
                || normal.cross(surface.normal).length() < PARALLEL
                    && surface.normal.dot(corners[0] - surface.point).abs() <= surface.tie_m
                || is_in_plane(light, corners, normal)
        };
        let hides = |casters: &BoxHierarchy| casters.is_hit(&self.triangles, &ray, &hides_nothing);
        let bit = |holds: bool, bit: u8| if holds { bit } else { 0 };
        bit(sine < 0.0, FACES_AWAY)
            | bit(sine.abs() < GRAZING, GRAZES)
            | bit(hides(&self.real_casters), REAL_HIDES)
            | bit(hides(&self.virtual_casters), VIRTUAL_HIDES)
    }

    /// A ray through each pixel's centre, and from what it meets one to each light.
    pub fn cast(&self, lights: &[Light], view: &View, lift_m: f64) -> Exact {
        let surfaces: Vec<Option<SeenSurface>> = pixels(view.intrinsics.size_px)
            .map(|(_, pixel)| self.look(view, pixel))
            .collect();
        let bits_of = |light: &Light| {
            let bits =
                |seen: &Option<SeenSurface>| seen.map_or(0, |s| self.bits(&s, light, lift_m));
            surfaces.iter().map(bits).collect()
        };
        Exact {
            size_px: view.intrinsics.size_px,
            bits: lights.iter().map(bits_of).collect(),
            surfaces,
        }
    }
}

fn plane_normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize()
}

fn is_in_plane(light: &Light, corners: &[DVec3; 3], normal: DVec3) -> bool {
    match *light {
        Light::Point { position_m, .. } => {
            let ways = corners.map(|corner| corner - position_m);
            let farthest_m = ways.iter().map(|way| way.length()).fold(0.0, f64::max);
            let size_m = farthest_m + position_m.abs().max_element();
            normal.dot(ways[0]).abs() <= IN_THE_PLANE * size_m
        }
        Light::Directional { direction, .. } => normal.dot(direction).abs() <= IN_THE_PLANE,
    }
}

/// Index and centre of each pixel.
pub fn pixels(size_px: [u32; 2]) -> impl Iterator<Item = (usize, DVec2)> {
    (0..size_px[0] * size_px[1]).map(move |index| {
        let (x, y) = (index % size_px[0], index / size_px[0]);
        (index as usize, DVec2::new(f64::from(x), f64::from(y)))
    })
}

impl Exact {
    /// What is seen at a pixel: [`REAL`], [`VIRTUAL`] or [`NONE`].
    pub fn role(&self, index: usize) -> u8 {
        self.surfaces[index].map_or(NONE, |surface| surface.role)
    }
}

/// A line from `origin + near · direction` to `origin + reach · direction`.
pub struct Ray {
    /// Where it comes from, metres.
    pub origin: DVec3,
    /// Of any length.
    pub direction: DVec3,
    /// Where it begins, in lengths of `direction`.
    pub near: f64,
    /// Where it ends, likewise.
    pub reach: f64,
}

impl Triangle {
    /// Distance in units of the ray's direction (Möller & Trumbore 1997).
    pub fn hit(&self, ray: &Ray) -> Option<f64> {
        let [a, b, c] = self.corners;
        let (first, second) = (b - a, c - a);
        let across = ray.direction.cross(second);
        let determinant = first.dot(across);
        let from_corner = ray.origin - a;
        let u = from_corner.dot(across) / determinant;
        // (A triangle without area gives no number, which is in no range.)
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let aside = from_corner.cross(first);
        let v = ray.direction.dot(aside) / determinant;
        if !(v >= 0.0 && u + v <= 1.0) {
            return None;
        }
        let distance = second.dot(aside) / determinant;
        (distance > ray.near && distance < ray.reach).then_some(distance)
    }
}

/// Boxes around triangles, in double precision. Which triangles share one is single precision's to say.
struct BoxHierarchy {
    /// Indices of triangles, in the order of the leaves.
    order: Vec<usize>,
    /// The first has all others in it.
    nodes: Vec<Node>,
}

struct Node {
    low: DVec3,
    high: DVec3,
    content: BoxContent,
}

impl BoxHierarchy {
    fn new(triangles: &[Triangle], indices: &[usize]) -> Self {
        let corners = indices.iter().map(|&index| triangles[index].corners);
        let single: Vec<[Vec3; 3]> = corners
            .map(|corners| corners.map(|corner| corner.as_vec3()))
            .collect();
        let tree = RayCaster::new(&single);
        let order: Vec<usize> = tree.triangle_order().map(|place| indices[place]).collect();
        let nodes = tree.boxes().map(|node| Node {
            low: DVec3::MAX,
            high: DVec3::MIN,
            content: node.content,
        });
        let mut nodes: Vec<Node> = nodes.collect();
        // Each box before those in it; so that backwards, what is in a box is known before it.
        let mut visited: Vec<usize> = (!nodes.is_empty()).then_some(0).into_iter().collect();
        let mut next = 0;
        while let Some(&index) = visited.get(next) {
            if let BoxContent::Boxes(first) = nodes[index].content {
                visited.extend([first, first + 1]);
            }
            next += 1;
        }
        for &index in visited.iter().rev() {
            let (low, high) = match nodes[index].content {
                BoxContent::Boxes(first) => {
                    let [one, other] = [&nodes[first], &nodes[first + 1]];
                    (one.low.min(other.low), one.high.max(other.high))
                }
                BoxContent::Triangles { first, count } => {
                    let inside = order[first..first + count].iter();
                    let corners = inside.flat_map(|&triangle| triangles[triangle].corners);
                    let (low, high) = corners
                        .fold((DVec3::MAX, DVec3::MIN), |(low, high), corner| {
                            (low.min(corner), high.max(corner))
                        });
                    // A flat box has no thickness to lose to rounding.
                    let slack = 1e-9 + 1e-12 * low.abs().max(high.abs()).max_element();
                    (low - slack, high + slack)
                }
            };
            (nodes[index].low, nodes[index].high) = (low, high);
        }
        Self { order, nodes }
    }

    /// Calls `found` with triangle and distance of each hit until it answers with the reach that is left, 0 to end.
    fn visit(
        &self,
        triangles: &[Triangle],
        ray: &Ray,
        mut found: impl FnMut(usize, f64) -> Option<f64>,
    ) {
        let mut reach = ray.reach;
        let inverse = ray.direction.recip();
        let mut open: Vec<usize> = (!self.nodes.is_empty()).then_some(0).into_iter().collect();
        while let Some(index) = open.pop() {
            let node = &self.nodes[index];
            let (mut enters, mut leaves) = (ray.near, reach);
            for axis in 0..3 {
                let near = (node.low[axis] - ray.origin[axis]) * inverse[axis];
                let far = (node.high[axis] - ray.origin[axis]) * inverse[axis];
                // No number (0 · ∞) bounds nothing: max and min pass over it.
                enters = enters.max(near.min(far));
                leaves = leaves.min(near.max(far));
            }
            // Beside a ray along an axis a box is left at minus infinity, from which no sum leads away.
            if enters > leaves * (1.0 + 1e-9) {
                continue;
            }
            match node.content {
                BoxContent::Boxes(first) => open.extend([first + 1, first]),
                BoxContent::Triangles { first, count } => {
                    for &triangle in &self.order[first..first + count] {
                        let shortened = triangles[triangle]
                            .hit(&Ray { reach, ..*ray })
                            .and_then(|distance| found(triangle, distance));
                        match shortened {
                            Some(0.0) => return,
                            Some(left) => reach = left,
                            None => {}
                        }
                    }
                }
            }
        }
    }

    fn first_hit(&self, triangles: &[Triangle], ray: &Ray) -> Option<(usize, f64)> {
        let mut first = None;
        self.visit(triangles, ray, |triangle, distance| {
            first = Some((triangle, distance));
            Some(distance)
        });
        first
    }

    /// Whether any triangle lies on it but those that are `left_out`.
    fn is_hit(&self, triangles: &[Triangle], ray: &Ray, left_out: &dyn Fn(usize) -> bool) -> bool {
        let mut hit = false;
        self.visit(triangles, ray, |triangle, _| {
            (!left_out(triangle)).then(|| {
                hit = true;
                0.0
            })
        });
        hit
    }
}

impl World {
    /// The first triangle on a ray and its distance in lengths of the ray's direction.
    pub fn first_hit(&self, ray: &Ray) -> Option<(usize, f64)> {
        self.visible.first_hit(&self.triangles, ray)
    }

    /// Whether a caster of a role lies on a ray.
    pub fn is_hidden(&self, ray: &Ray, role: u8) -> bool {
        let casters = match role {
            REAL => &self.real_casters,
            _ => &self.virtual_casters,
        };
        casters.is_hit(&self.triangles, ray, &|_| false)
    }
}
