//! Shadow volumes: the space that a mesh hides from a light, as a closed surface reaching to infinity
//! (Crow 1977; Everitt & Kilgard 2002, section 3; Kim, Kim & Turk 2008 for meshes that are not closed).
//!
//! The volume of one triangle is its cap turned to the light, the same cap cast to infinity, and three sides. A mesh's
//! volume is the sum over the triangles that cast; sides that two of them share cancel, so only edges with a net
//! *signed multiplicity* keep a side. The sum is closed whichever triangles cast, and counts at each point how many of
//! them lie between it and the light.

use glam::{DVec3, Vec3, Vec4};

use super::bounds::Bounds;
use super::soup::{by_edge, edge_uses, unbalanced_edges};

/// Where a light is, in the mesh's own space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightPlace {
    /// A point, metres.
    Point(DVec3),
    /// Unit direction in which distant light travels.
    Along(DVec3),
}

impl LightPlace {
    /// As a homogeneous point: a distant light lies at infinity against its direction.
    pub fn homogeneous(self) -> (DVec3, f64) {
        match self {
            Self::Point(position) => (position, 1.0),
            Self::Along(direction) => (-direction, 0.0),
        }
    }
}

/// Which triangles of a mesh cast.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Those facing the light. Enough if each directed edge has its opposite and both light and camera are outside:
    /// along the way from the light to a point that the camera sees, as many triangles are entered as left.
    Facing,
    /// All of them. Right for any soup, light and camera.
    All,
}

/// Closer than this to edge-on, as the sine of the angle, a triangle hides nothing that a pixel could show.
const EDGE_ON: f64 = 1e-6;

/// Closer than this to edge-on as an eye sees it, as the sine of the angle, rounding to parts of a pixel may turn a
/// triangle over.
pub const EDGE_ON_TO_EYE: f64 = 0.1;

/// A mesh prepared for casting shadows: welded triangles, their planes, and which triangles meet at each edge.
#[derive(Debug, Clone)]
pub struct Caster {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Unit normal and offset of each triangle: `dot(normal, p) = offset` on it.
    planes: Vec<(DVec3, f64)>,
    /// Edges that two triangles pass, one each way.
    paired_edges: Vec<PairedEdge>,
    /// All other edges.
    odd_edges: Vec<OddEdge>,
    bounds: Option<Bounds>,
    /// Whether each edge is passed as often one way as the other, so that a way that enters the mesh leaves it again.
    closed: bool,
}

/// An edge that one triangle passes from the first vertex to the second, and one other the other way.
#[derive(Debug, Clone, Copy)]
struct PairedEdge {
    ends: [u32; 2],
    forward: u32,
    backward: u32,
}

/// An edge with any triangles about it, and whether each passes it from the first vertex to the second.
#[derive(Debug, Clone)]
struct OddEdge {
    ends: [u32; 2],
    triangles: Vec<(u32, bool)>,
}

/// A triangle that casts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct CastingTriangle {
    triangle: u32,
    /// 1: as it is wound; -1: turned over.
    sign: i8,
}

/// Triangles that cast for one light, and the edges that bound them as the light sees them.
#[derive(Debug, Clone)]
pub struct Silhouette {
    /// What casts.
    casting: Vec<CastingTriangle>,
    /// Edges in the direction in which the casting triangles pass them, each as often as its multiplicity.
    edges: Vec<[u32; 2]>,
}

/// A part of what casts for one light.
#[derive(Debug, Clone)]
pub struct VolumePart {
    /// What casts in it.
    pub silhouette: Silhouette,
    /// No point lies in more of its volumes, one in another.
    pub layers: u32,
    /// Whether it must be counted before all others and apart from those that are not: where it counts nothing, no other
    /// part, of this caster or another, counts less than nothing.
    pub counted_apart: bool,
}

/// What it costs to count something apart, in edges.
const KEEPING_IN_EDGES: usize = 100;

impl Caster {
    /// Prepares a mesh whose equal positions share one index. Any soup of triangles will do.
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let uses = edge_uses(triangles.iter().copied());
        let closed = !triangles.is_empty() && unbalanced_edges(&uses) == 0;
        let mut paired_edges = Vec::with_capacity(uses.len() / 2);
        let mut odd_edges = Vec::new();
        for around in by_edge(&uses) {
            let ends = around[0].ends();
            match around {
                [one, other] if one.forward != other.forward => {
                    let (forward, backward) = match one.forward {
                        true => (one.triangle, other.triangle),
                        false => (other.triangle, one.triangle),
                    };
                    paired_edges.push(PairedEdge {
                        ends,
                        forward,
                        backward,
                    });
                }
                _ => odd_edges.push(OddEdge {
                    ends,
                    triangles: around
                        .iter()
                        .map(|used| (used.triangle, used.forward))
                        .collect(),
                }),
            }
        }
        let planes = planes(&positions, &triangles, &paired_edges);
        Self {
            bounds: Bounds::around(positions.iter().map(|position| position.as_dvec3())),
            positions,
            triangles,
            planes,
            paired_edges,
            odd_edges,
            closed,
        }
    }

    /// Moves its vertices: the same triangles between other places.
    pub fn set_positions(&mut self, positions: Vec<Vec3>) {
        self.planes = planes(&positions, &self.triangles, &self.paired_edges);
        self.bounds = Bounds::around(positions.iter().map(|position| position.as_dvec3()));
        self.positions = positions;
    }

    /// The box around it, metres; `None` without triangles.
    pub fn bounds(&self) -> Option<&Bounds> {
        self.bounds.as_ref()
    }

    /// The fewest triangles that are known to cast the right shadow for an eye at `eye`, which sees the scene.
    pub fn casting(&self, light: LightPlace, eye: DVec3) -> Casting {
        let outside = |point: DVec3, margin_m: f64| {
            let near = |bounds: Bounds| bounds.grown(margin_m).contains(point);
            !self.bounds.is_some_and(near)
        };
        let lit_from_outside = match light {
            // On the surface some triangles are seen edge-on, and those that face the light are not all that hide it.
            LightPlace::Point(point) => outside(point, 2.0 * self.edge_on(light)),
            LightPlace::Along(_) => true,
        };
        if self.closed && lit_from_outside && outside(eye, 0.0) {
            Casting::Facing
        } else {
            Casting::All
        }
    }

    /// Homogeneous vertices that [`Caster::side_indices`] and [`Caster::cap_indices`] point to: the mesh's own
    /// (w = 1), and each again (w = 0), to be cast away from the light: to infinity, or as far as matters.
    pub fn volume_vertices(&self) -> Vec<Vec4> {
        let near = self.positions.iter().map(|position| position.extend(1.0));
        let far = self.positions.iter().map(|position| position.extend(0.0));
        near.chain(far).collect()
    }

    /// What casts for a light, as few sides as it takes, in parts of which no point lies in more than `most` (at least 1)
    /// volumes, one in another. A point is in the shadow if it lies in any part's volume.
    ///
    /// Where all triangles cast, the outline between those that face the light and those that do not counts twice. In a
    /// mesh that is nearly closed it is cheaper to count those that face it, and apart from that how many more do not:
    /// that number changes at open edges alone. Both are 0 where nothing hides the light, and only there.
    pub fn parts(&self, light: LightPlace, casting: Casting, most: u32) -> Vec<VolumePart> {
        let facing = self.silhouette(light, [1, 0]);
        let whole = match casting {
            Casting::Facing => facing,
            Casting::All => {
                let all = self.silhouette(light, [1, -1]);
                let surplus = self.silhouette(light, [-1, -1]);
                if facing.edges.len() + surplus.edges.len() + KEEPING_IN_EDGES < all.edges.len() {
                    let mut parts = self.shallow(light, facing, most, true);
                    parts.extend(self.shallow(light, surplus, most, false));
                    return parts;
                }
                all
            }
        };
        self.shallow(light, whole, most, false)
    }

    /// The edges of the outline that a light sees, in the mesh's own space: where its shadow begins.
    pub fn outline_edges(&self, light: LightPlace) -> Vec<[Vec3; 2]> {
        let edges = self.silhouette(light, [1, 0]).edges;
        let ends = |edge: [u32; 2]| edge.map(|index| self.positions[index as usize]);
        edges.into_iter().map(ends).collect()
    }

    /// A light no higher above a triangle's plane than this sees it edge-on, or lies on it: metres, or the sine of the angle
    /// for a distant light.
    fn edge_on(&self, light: LightPlace) -> f64 {
        match (light, &self.bounds) {
            (LightPlace::Point(light), Some(bounds)) => {
                let away = (bounds.low - light).abs().max((bounds.high - light).abs());
                EDGE_ON * away.length()
            }
            _ => EDGE_ON,
        }
    }

    /// How far above each triangle's plane the light is, as the sine of the angle for a distant one; exactly 0 where it
    /// sees the triangle edge-on.
    fn light_heights(&self, light: LightPlace) -> impl Iterator<Item = f64> {
        let (light_point, light_weight) = light.homogeneous();
        let edge_on = self.edge_on(light);
        self.planes.iter().map(move |(normal, offset)| {
            let height = normal.dot(light_point) - offset * light_weight;
            if height.abs() > edge_on { height } else { 0.0 }
        })
    }

    /// How the triangles that face the light cast, and how those do that are turned away, with their outline.
    fn silhouette(&self, light: LightPlace, [facing, turned_away]: [i8; 2]) -> Silhouette {
        let signs = self.light_heights(light).map(|height| {
            if height > 0.0 {
                facing
            } else if height < 0.0 {
                turned_away
            } else {
                0
            }
        });
        let casting = (0..).zip(signs).filter(|(_, sign)| *sign != 0);
        let casting = casting.map(|(triangle, sign)| CastingTriangle { triangle, sign });
        self.outline(casting.collect())
    }

    /// What bounds triangles that cast.
    fn outline(&self, casting: Vec<CastingTriangle>) -> Silhouette {
        let mut signs = vec![0_i8; self.triangles.len()];
        for CastingTriangle { triangle, sign } in &casting {
            signs[*triangle as usize] = *sign;
        }
        let mut edges = Vec::new();
        let mut push = |[a, b]: [u32; 2], multiplicity: i32| {
            let edge = if multiplicity > 0 { [a, b] } else { [b, a] };
            edges.extend((0..multiplicity.unsigned_abs()).map(|_| edge));
        };
        for edge in &self.paired_edges {
            let multiplicity =
                i32::from(signs[edge.forward as usize]) - i32::from(signs[edge.backward as usize]);
            if multiplicity != 0 {
                push(edge.ends, multiplicity);
            }
        }
        for edge in &self.odd_edges {
            let net = |&(triangle, forward): &(u32, bool)| {
                let sign = i32::from(signs[triangle as usize]);
                if forward { sign } else { -sign }
            };
            push(edge.ends, edge.triangles.iter().map(net).sum());
        }
        Silhouette { casting, edges }
    }

    /// Triangles of the volume's sides, counter-clockwise seen from outside it.
    pub fn side_indices(&self, silhouette: &Silhouette) -> Vec<u32> {
        let far = self.positions.len() as u32;
        let mut indices = Vec::with_capacity(6 * silhouette.edges.len());
        for &[from, to] in &silhouette.edges {
            // The caps run from `from` to `to`; the side must run back.
            indices.extend([to, from, far + from, to, far + from, far + to]);
        }
        indices
    }

    /// Triangles of the volume's caps: first the near ones that cast as they are wound, and all far ones,
    /// counter-clockwise seen from outside the volume; then the near ones that cast turned over, clockwise.
    ///
    /// The near caps are the mesh's own triangles with their own vertex order, for only so they surely cover the same
    /// pixels at the same depths as the mesh does.
    pub fn cap_indices(&self, silhouette: &Silhouette) -> [Vec<u32>; 2] {
        let far = self.positions.len() as u32;
        let mut outward = Vec::with_capacity(6 * silhouette.casting.len());
        let mut turned = Vec::new();
        for CastingTriangle { triangle, sign } in &silhouette.casting {
            let [a, b, c] = self.triangles[*triangle as usize];
            if *sign > 0 {
                outward.extend([a, b, c, far + a, far + c, far + b]);
            } else {
                turned.extend([a, b, c]);
                outward.extend([far + a, far + b, far + c]);
            }
        }
        [outward, turned]
    }

    /// Sorts the triangles by what the light can give to the side of them that an eye sees: at `eye`, or anywhere outside
    /// of a closed mesh. Smooth shading goes by `corner_normals`, where there are any.
    pub fn lit_triangles(
        &self,
        light: LightPlace,
        eye: Option<DVec3>,
        corner_normals: Option<&[[Vec3; 3]]>,
    ) -> LitTriangles {
        let (light_point, light_weight) = light.homogeneous();
        let (light_point, light_weight) = (light_point.as_vec3(), light_weight as f32);
        let smoothly_lit = |triangle: usize, side: f32| {
            let normals = corner_normals.map(|normals| normals[triangle]);
            let corners = normals.iter().flatten().zip(self.triangles[triangle]);
            corners.into_iter().any(|(normal, vertex)| {
                let place = self.positions[vertex as usize];
                side * normal.dot(light_point - place * light_weight) > 0.0
            })
        };
        let mut sorted = LitTriangles::default();
        for (triangle, height) in self.light_heights(light).enumerate() {
            let (normal, offset) = self.planes[triangle];
            let seen_from_inside = eye.is_some_and(|eye| {
                let corner = self.positions[self.triangles[triangle][0] as usize].as_dvec3();
                (normal.dot(eye) - offset) < -EDGE_ON_TO_EYE * (eye - corner).length()
            });
            let side = match eye {
                Some(eye) if normal.dot(eye) < offset => -1.0,
                _ => 1.0,
            };
            let sides = if side * height > 0.0 {
                &mut sorted.facing
            } else if smoothly_lit(triangle, side as f32) {
                &mut sorted.terminator
            } else {
                &mut sorted.back_facing
            };
            match seen_from_inside {
                true => sides.inner.push(triangle),
                false => sides.outer.push(triangle),
            }
        }
        sorted
    }
}

/// Triangles by the side of them that an eye sees.
#[derive(Debug, Clone, Default)]
pub struct SeenTriangles {
    /// Triangles that the camera may see from outside.
    pub outer: Vec<usize>,
    /// Triangles that the camera surely sees from inside.
    pub inner: Vec<usize>,
}

/// The triangles of a mesh, by what a light can give to their visible side.
#[derive(Debug, Clone, Default)]
pub struct LitTriangles {
    /// They face it: lit where nothing hides it.
    pub facing: SeenTriangles,
    /// They are turned away, so that they lie in their own shadow, but some of their corners' normals face it: smooth
    /// shading lights them up to the line where the normals turn away.
    pub terminator: SeenTriangles,
    /// All others: never lit.
    pub back_facing: SeenTriangles,
}

impl Caster {
    /// Cuts what casts into parts of no more than `most` layers, each half of what was more.
    fn shallow(
        &self,
        light: LightPlace,
        silhouette: Silhouette,
        most: u32,
        counted_apart: bool,
    ) -> Vec<VolumePart> {
        let layers = self.most_layers(light, &silhouette, most);
        if layers <= most {
            return vec![VolumePart {
                silhouette,
                layers,
                counted_apart,
            }];
        }
        let mut first = silhouette.casting;
        let second = first.split_off(first.len().div_ceil(2));
        [first, second]
            .into_iter()
            .flat_map(|half| self.shallow(light, self.outline(half), most, counted_apart))
            .collect()
    }
}

/// A triangle whose height is a smaller part than this of its longest edge has no orientation that rounding left whole.
const NEEDLE: f64 = 1e-5;

/// Planes of the triangles. A triangle without area has none; it takes that of a neighbour, so that it casts with it
/// and no slit opens between.
fn planes(positions: &[Vec3], triangles: &[[u32; 3]], edges: &[PairedEdge]) -> Vec<(DVec3, f64)> {
    let mut planes: Vec<(DVec3, f64)> = triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|index| positions[index as usize].as_dvec3());
            let across = (b - a).cross(c - a);
            let longest = (b - a).length().max((c - a).length()).max((c - b).length());
            let normal = match across.length() > NEEDLE * longest * longest {
                true => across.normalize(),
                false => DVec3::ZERO,
            };
            (normal, normal.dot(a))
        })
        .collect();
    let length = |[a, b]: [u32; 2]| positions[a as usize].distance(positions[b as usize]);
    let is_flat = |plane: &(DVec3, f64)| plane.0 == DVec3::ZERO;
    if !planes.iter().any(is_flat) {
        return planes;
    }
    // The longest edge first: it is the one that the slit would run along.
    let mut longest_first: Vec<&PairedEdge> = edges.iter().collect();
    longest_first.sort_by(|a, b| length(b.ends).total_cmp(&length(a.ends)));
    for edge in longest_first {
        let [forward, backward] = [edge.forward as usize, edge.backward as usize];
        match (is_flat(&planes[forward]), is_flat(&planes[backward])) {
            (true, false) => planes[forward] = planes[backward],
            (false, true) => planes[backward] = planes[forward],
            _ => {}
        }
    }
    planes
}

mod layers;
#[cfg(test)]
mod tests;
