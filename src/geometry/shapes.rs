//! Boxes, balls, outlines pulled up and profiles turned about an axis, as triangles.
//!
//! What is round lies within 1 - cos(π/96) of its radius, a fifth of a pixel where it is as high as a picture of 720 lines.
//! What is smaller in the picture gets coarser versions from `levels.rs`.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec3};

use super::cuboid::cuboid;
use super::polygon::PolygonCutter;
use super::soup::RawTriangle;

/// Chords of a circle.
pub const SIDES: u32 = 96;
/// Parts that each edge of an icosahedron is cut into for a ball, whose triangles then lie as close to it as chords to a circle: the
/// largest ones, amid a face, have a circumradius of 0.764 of the ball's radius over this number.
const CUTS: u32 = 24;

/// A shape that needs no file.
#[derive(Debug, Clone, PartialEq)]
pub enum BasicShape {
    /// A box along the axes.
    Cuboid {
        /// Where all coordinates are least, metres.
        low: DVec3,
        /// Where all are largest, metres.
        high: DVec3,
    },
    /// A ball whose lowest point is the origin.
    Ball {
        /// Its radius, metres.
        radius_m: f64,
    },
    /// A flat rectangle at z = 0 that faces +z.
    Rectangle {
        /// Its corner where both coordinates are least, metres.
        low: DVec2,
        /// Its corner where both are largest, metres.
        high: DVec2,
    },
    /// What lies above an outline.
    Prism {
        /// At z = 0.
        outline: Outline,
        /// How far up it goes, metres.
        height_m: f64,
    },
    /// What a profile sweeps when it is turned about z.
    Revolved(Profile),
}

/// Triangles before they are welded.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ShapeTriangles {
    /// Metres.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise seen from outside; with normals where the surface is round.
    pub triangles: Vec<RawTriangle>,
}

/// A polygon that neither touches nor crosses itself, counter-clockwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline(Vec<DVec2>);

/// A polygon of radii and heights, counter-clockwise with the radius to the right; no radius is negative.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile(Vec<DVec2>);

/// Why a list of places bounds nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutlineFault {
    /// There are too few of them.
    TooFew,
    /// A place is the one before, by its index.
    Twice(usize),
    /// Two sides meet beside their common end, by the indices of the places that they begin at, the lower one first.
    Meeting([usize; 2]),
}

impl Outline {
    /// Whichever way round the places are; the first may be there again as the last.
    ///
    /// # Errors
    /// What keeps them from bounding an area.
    pub fn new(places: &[DVec2]) -> Result<Self, OutlineFault> {
        let is_told_twice = places.len() > 1 && places.first() == places.last();
        let places = &places[..places.len() - usize::from(is_told_twice)];
        counter_clockwise(places).map(Self)
    }
}

impl Profile {
    /// Of radii and heights. Where the last place is the first they go around a ring; else both ends are joined to the axis by
    /// flat discs, unless they lie on it.
    ///
    /// # Errors
    /// What keeps them from bounding a volume; a disc counts as the side that begins at the last place.
    pub fn new(places: &[DVec2]) -> Result<Self, OutlineFault> {
        let (Some(first), Some(last)) = (places.first(), places.last()) else {
            return Err(OutlineFault::TooFew);
        };
        let mut around = places.to_vec();
        if places.len() > 1 && first == last {
            around.pop();
        } else {
            let on_axis = |place: &DVec2| DVec2::new(0.0, place.y);
            around.extend((last.x != 0.0).then(|| on_axis(last)));
            around.extend((first.x != 0.0).then(|| on_axis(first)));
        }
        let of_places = |index: usize| index.min(places.len() - 1);
        let polygon = counter_clockwise(&around).map_err(|fault| match fault {
            OutlineFault::TooFew => OutlineFault::TooFew,
            OutlineFault::Twice(index) => OutlineFault::Twice(of_places(index)),
            OutlineFault::Meeting(sides) => OutlineFault::Meeting(sides.map(of_places)),
        });
        polygon.map(Self)
    }

    /// That of a cylinder or of a cone that stands on z = 0, with the radii of its bottom and of its top.
    pub fn between_discs(bottom_m: f64, top_m: f64, height_m: f64) -> Result<Self, OutlineFault> {
        Self::new(&[DVec2::new(bottom_m, 0.0), DVec2::new(top_m, height_m)])
    }
}

impl BasicShape {
    /// Its triangles. Sides of an outline or of a profile that meet at up to `crease_rad` look like one surface, as the faces of
    /// a mesh without normals do; what is round about an axis or a point always does.
    pub fn triangles(&self, crease_rad: f64) -> ShapeTriangles {
        match self {
            Self::Cuboid { low, high } => {
                let (positions, triangles) = cuboid(low.as_vec3(), high.as_vec3());
                without_normals(positions, triangles)
            }
            Self::Ball { radius_m } => ball(*radius_m),
            Self::Rectangle { low, high } => {
                let corners = [
                    *low,
                    DVec2::new(high.x, low.y),
                    *high,
                    DVec2::new(low.x, high.y),
                ];
                let positions = corners.map(|corner| corner.as_vec2().extend(0.0));
                without_normals(positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
            }
            Self::Prism { outline, height_m } => prism(&outline.0, *height_m),
            Self::Revolved(profile) => revolved(&profile.0, crease_rad),
        }
    }
}

fn without_normals(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> ShapeTriangles {
    let triangles = triangles.into_iter().map(|vertices| RawTriangle {
        vertices,
        normals: [None; 3],
        material: 0,
    });
    ShapeTriangles {
        positions,
        triangles: triangles.collect(),
    }
}

fn with_normals(corners: [(u32, DVec3); 3]) -> RawTriangle {
    RawTriangle {
        vertices: corners.map(|(vertex, _)| vertex),
        normals: corners.map(|(_, normal)| Some(normal.as_vec3())),
        material: 0,
    }
}

/// An icosahedron's faces, cut and blown up.
fn ball(radius_m: f64) -> ShapeTriangles {
    let mut shape = ShapeTriangles::default();
    let mut known = HashMap::new();
    for corners in icosahedron() {
        let mut place = |right: u32, up: u32| {
            let parts = [CUTS - right - up, right, up].map(f64::from);
            // Added in pairs, so that faces get the very same places along a common edge: there one of the three is 0.
            let [a, b, c] = [0, 1, 2].map(|corner: usize| corners[corner] * parts[corner]);
            let normal = (a + b + c).normalize();
            let position = ((normal + DVec3::Z) * radius_m).as_vec3() + Vec3::ZERO;
            let vertex = *known
                .entry(position.to_array().map(f32::to_bits))
                .or_insert_with(|| {
                    shape.positions.push(position);
                    shape.positions.len() as u32 - 1
                });
            (vertex, normal)
        };
        for (right, up) in (0..CUTS).flat_map(|right| (0..CUTS - right).map(move |up| (right, up)))
        {
            let [a, b, c] = [place(right, up), place(right + 1, up), place(right, up + 1)];
            shape.triangles.push(with_normals([a, b, c]));
            if right + up + 2 <= CUTS {
                let opposite = place(right + 1, up + 1);
                shape.triangles.push(with_normals([b, opposite, c]));
            }
        }
    }
    shape
}

/// Faces of the icosahedron in the unit sphere with a corner at each pole, counter-clockwise seen from outside.
fn icosahedron() -> Vec<[DVec3; 3]> {
    let ring = |z: f64, offset: f64| {
        (0..5).map(move |step| {
            let direction = DVec2::from_angle((f64::from(step) + offset) * TAU / 5.0);
            (direction * (1.0 - z * z).sqrt()).extend(z)
        })
    };
    let height = 0.2_f64.sqrt();
    let upper: Vec<DVec3> = ring(height, 0.0).collect();
    let lower: Vec<DVec3> = ring(-height, 0.5).collect();
    (0..5)
        .flat_map(|step| {
            let next = (step + 1) % 5;
            [
                [DVec3::Z, upper[step], upper[next]],
                [upper[step], lower[step], upper[next]],
                [lower[step], lower[next], upper[next]],
                [DVec3::NEG_Z, lower[next], lower[step]],
            ]
        })
        .collect()
}

fn prism(outline: &[DVec2], height_m: f64) -> ShapeTriangles {
    let level = |z: f64| outline.iter().map(move |place| place.extend(z).as_vec3());
    let bottom: Vec<Vec3> = level(0.0).collect();
    let mut cuts = Vec::new();
    PolygonCutter::default().triangles(&bottom, &mut cuts);
    let count = outline.len() as u32;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for [a, b, c] in cuts {
        triangles.push([a, c, b]);
        triangles.push([a, b, c].map(|corner| count + corner));
    }
    for one in 0..count {
        let next = (one + 1) % count;
        triangles.push([one, next, count + next]);
        triangles.push([one, count + next, count + one]);
    }
    without_normals(
        bottom.into_iter().chain(level(height_m)).collect(),
        triangles,
    )
}

/// Where a place of a profile is once it is turned.
struct Ring {
    first_vertex: u32,
    is_on_axis: bool,
}

impl Ring {
    fn vertex(&self, side: u32) -> u32 {
        match self.is_on_axis {
            true => self.first_vertex,
            false => self.first_vertex + side % SIDES,
        }
    }
}

fn revolved(profile: &[DVec2], crease_rad: f64) -> ShapeTriangles {
    let direction = |sides: f64| DVec2::from_angle(sides * TAU / f64::from(SIDES));
    let directions: Vec<DVec2> = (0..SIDES).map(|side| direction(side.into())).collect();
    let mut shape = ShapeTriangles::default();
    let mut rings = Vec::new();
    for place in profile {
        let is_on_axis = place.x == 0.0;
        rings.push(Ring {
            first_vertex: shape.positions.len() as u32,
            is_on_axis,
        });
        let around = &directions[..if is_on_axis { 1 } else { directions.len() }];
        let positions = around.iter().map(|&way| (way * place.x).extend(place.y));
        shape
            .positions
            .extend(positions.map(|place| place.as_vec3()));
    }
    let count = profile.len();
    // Outwards, in the plane of radius and height; a side on the axis sweeps nothing.
    let normals: Vec<Option<DVec2>> = (0..count)
        .map(|side| {
            let (from, to) = (profile[side], profile[(side + 1) % count]);
            let way = (to - from).normalize_or_zero();
            (from.x != 0.0 || to.x != 0.0).then(|| DVec2::new(way.y, -way.x))
        })
        .collect();
    let looks_smooth = |one: DVec2, other: DVec2| one.dot(other) > crease_rad.cos() - 1e-9;
    // The normal of a side at a place that it shares with another, which over the axis is its own mirror image.
    let at_end = |own: DVec2, place: usize, other: usize| {
        let other = match rings[place].is_on_axis {
            true => Some(DVec2::new(-own.x, own.y)),
            false => normals[other],
        };
        let smooth = other.filter(|other| looks_smooth(own, *other));
        smooth.map_or(own, |other| (own + other).normalize_or(own))
    };
    for (from, normal) in normals.iter().enumerate() {
        let Some(own) = *normal else { continue };
        let to = (from + 1) % count;
        let start = (&rings[from], at_end(own, from, (from + count - 1) % count));
        let end = (&rings[to], at_end(own, to, to));
        for side in 0..SIDES {
            let corner = |(ring, normal): (&Ring, DVec2), on: u32| {
                let facing = match ring.is_on_axis {
                    true => direction(f64::from(side) + 0.5),
                    false => directions[(on % SIDES) as usize],
                };
                (ring.vertex(on), (facing * normal.x).extend(normal.y))
            };
            if !start.0.is_on_axis {
                let corners = [(start, side), (start, side + 1), (end, side + 1)];
                let corners = corners.map(|(ring, on)| corner(ring, on));
                shape.triangles.push(with_normals(corners));
            }
            if !end.0.is_on_axis {
                let corners = [(start, side), (end, side + 1), (end, side)];
                let corners = corners.map(|(ring, on)| corner(ring, on));
                shape.triangles.push(with_normals(corners));
            }
        }
    }
    shape
}

/// A polygon's places counter-clockwise, if it neither touches nor crosses itself.
fn counter_clockwise(places: &[DVec2]) -> Result<Vec<DVec2>, OutlineFault> {
    let count = places.len();
    if count < 3 {
        return Err(OutlineFault::TooFew);
    }
    let next = |index: usize| (index + 1) % count;
    if let Some(index) = (0..count).find(|&index| places[index] == places[next(index)]) {
        return Err(OutlineFault::Twice(index.max(next(index))));
    }
    let side = |index: usize| [places[index], places[next(index)]];
    for one in 0..count {
        let goes_back = {
            let ([from, at], [_, to]) = (side(one), side(next(one)));
            turn(from, at, to) == 0.0 && (at - from).dot(to - at) < 0.0
        };
        if goes_back {
            let (one, other) = (one, next(one));
            return Err(OutlineFault::Meeting([one.min(other), one.max(other)]));
        }
        let others = one + 2..count;
        let mut apart = others.filter(|&other| next(other) != one);
        if let Some(other) = apart.find(|&other| meet(side(one), side(other))) {
            return Err(OutlineFault::Meeting([one, other]));
        }
    }
    let mut polygon = places.to_vec();
    let twice_area: f64 = (0..count)
        .map(|index| (places[index] - places[0]).perp_dot(places[next(index)] - places[0]))
        .sum();
    if twice_area < 0.0 {
        polygon.reverse();
    }
    Ok(polygon)
}

/// Positive where a way turns left, 0 where it goes straight on or back.
fn turn(from: DVec2, at: DVec2, to: DVec2) -> f64 {
    (at - from).perp_dot(to - from)
}

/// Whether two lines have a point in common, their ends included.
fn meet([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> bool {
    let is_apart = a.max(b).cmplt(c.min(d)).any() || c.max(d).cmplt(a.min(b)).any();
    if is_apart {
        return false;
    }
    // What is left has boxes in common, so that lines on one line meet.
    let is_between =
        |one: f64, other: f64| one == 0.0 || other == 0.0 || (one < 0.0) != (other < 0.0);
    is_between(turn(a, b, c), turn(a, b, d)) && is_between(turn(c, d, a), turn(c, d, b))
}

#[cfg(test)]
mod tests;
