//! Cuts out of triangles what lies outside of a region of their surface, as where a picture's opacity ends: from then on the
//! shape itself ends there, in the picture as in every shadow.
//!
//! Triangles that the region's edge passes are halved at their longest edges until each piece is fine enough for the edge to
//! be straight in it, and their neighbours along with them, so that no corner comes to lie on another's edge (Rivara 1984,
//! "Algorithms for refining triangular grids"). Then each piece is cut where the edge crosses its sides.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::bounds::Bounds;
use super::looks::{CornerLook, RawLooks};
use super::soup::RawTriangle;

/// A part of a surface.
pub trait Region {
    /// How far inside a place is, in any measure: below 0 it is outside.
    fn inside(&self, look: &CornerLook) -> f64;

    /// What can be said of a whole triangle, given its corners.
    fn extent(&self, corners: [&CornerLook; 3]) -> Extent;

    /// Whether the region's edge is straight within a triangle, as far as matters.
    fn is_fine(&self, corners: [&CornerLook; 3]) -> bool;
}

/// How much of a triangle is in a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// All of it.
    Whole,
    /// Nothing of it.
    Nothing,
    /// It may be that the edge passes through it.
    Part,
}

/// Triangles that were cut.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CutTriangles {
    /// Positions, those given first.
    pub positions: Vec<Vec3>,
    /// What is left.
    pub triangles: Vec<RawTriangle>,
    /// What its corners have.
    pub looks: RawLooks,
    /// Whether there were too many pieces for the edge to be followed as finely as it should be.
    pub is_coarse: bool,
}

/// Pieces shorter than this part of the whole are fine enough: where a thing is as wide as a picture they are a pixel long, and
/// off their curve by much less.
const FINEST: f64 = 1.0 / 1024.0;

/// Cuts triangles to the region that their material has, if it has one (by its index); `most` pieces are made at most, but for
/// what neighbours need. Positions are one where they are in one place and, if `together` is not empty, have one number there.
///
/// # Panics
/// If a triangle names a position or a look that is not there, or has none.
pub fn cut<'a>(
    (positions, together): (&[Vec3], &[u32]),
    triangles: &[RawTriangle],
    looks: &RawLooks,
    region_of: impl Fn(u32) -> Option<&'a dyn Region>,
    most: usize,
) -> CutTriangles {
    let mut cutter = Cutter::new(positions, together, looks);
    let pieces = cutter.pieces(triangles, looks);
    let (pieces, is_coarse) = cutter.refined(pieces, &region_of, most);
    let mut left = Vec::with_capacity(pieces.len());
    for piece in pieces {
        match region_of(piece.material) {
            Some(region) if piece.extent != Some(Extent::Whole) => {
                cutter.cut_piece(&piece, region, &mut left);
            }
            _ => left.push(piece),
        }
    }
    CutTriangles {
        positions: cutter.places.iter().map(|place| place.as_vec3()).collect(),
        triangles: left.iter().map(Piece::raw).collect(),
        looks: RawLooks {
            looks: cutter.looks,
            corners: left.iter().map(|piece| piece.looks).collect(),
        },
        is_coarse,
    }
}

/// A triangle on its way.
#[derive(Debug, Clone, Copy)]
struct Piece {
    places: [u32; 3],
    looks: [u32; 3],
    normals: [Option<Vec3>; 3],
    material: u32,
    /// What is known of it; `None`: nothing yet.
    extent: Option<Extent>,
}

impl Piece {
    fn raw(&self) -> RawTriangle {
        RawTriangle {
            vertices: self.places,
            normals: self.normals,
            material: self.material,
        }
    }

    /// A corner.
    fn corner(&self, number: usize) -> Corner {
        Corner {
            place: self.places[number],
            look: self.looks[number],
            normal: self.normals[number],
        }
    }

    /// The same surface between other corners.
    fn with_corners(&self, corners: [Corner; 3]) -> Self {
        Self {
            places: corners.map(|corner| corner.place),
            looks: corners.map(|corner| corner.look),
            normals: corners.map(|corner| corner.normal),
            ..*self
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Corner {
    place: u32,
    look: u32,
    normal: Option<Vec3>,
}

/// Two indices, the smaller first: an edge, whichever way it is passed.
type Edge = (u32, u32);

fn edge(a: u32, b: u32) -> Edge {
    (a.min(b), a.max(b))
}

/// Places and looks, and those that were made between them.
struct Cutter {
    places: Vec<DVec3>,
    /// For each place the first that is the same: neighbours need not share their corners' numbers.
    same: Vec<u32>,
    looks: Vec<CornerLook>,
    /// On an edge of places, where it was halved.
    middles: HashMap<Edge, u32>,
    /// On an edge of places, where it was cut, and how far from its first end.
    cuts: HashMap<Edge, (u32, f64)>,
    /// Between two looks, by the part that the second has (as bits) and whose edge it is.
    between: HashMap<(Edge, u64), u32>,
    finest_m: f64,
}

impl Cutter {
    fn new(positions: &[Vec3], together: &[u32], looks: &RawLooks) -> Self {
        let places: Vec<DVec3> = positions.iter().map(|place| place.as_dvec3()).collect();
        let mut first = HashMap::new();
        let same = (places.iter().zip(0..))
            // (A sum with 0 makes one of both zeros.)
            .map(|(place, index)| {
                let bits = (*place + DVec3::ZERO).to_array().map(f64::to_bits);
                let number = together.get(index as usize).copied();
                *first.entry((bits, number)).or_insert(index)
            })
            .collect();
        let size = Bounds::around(places.iter().copied())
            .map_or(0.0, |bounds| (bounds.high - bounds.low).max_element());
        Self {
            finest_m: size * FINEST,
            places,
            same,
            looks: looks.looks.clone(),
            middles: HashMap::new(),
            cuts: HashMap::new(),
            between: HashMap::new(),
        }
    }

    /// Given triangles, at places that neighbours share.
    fn pieces(&self, triangles: &[RawTriangle], looks: &RawLooks) -> Vec<Piece> {
        triangles
            .iter()
            .zip(&looks.corners)
            .map(|(triangle, &looks)| Piece {
                places: triangle.vertices.map(|vertex| self.same[vertex as usize]),
                looks,
                normals: triangle.normals,
                material: triangle.material,
                extent: None,
            })
            .collect()
    }

    /// Pieces of which the region's edge is straight in each, and whether that takes more than `most`.
    fn refined<'a>(
        &mut self,
        mut pieces: Vec<Piece>,
        region_of: &impl Fn(u32) -> Option<&'a dyn Region>,
        most: usize,
    ) -> (Vec<Piece>, bool) {
        let mut is_coarse = false;
        loop {
            let (before, halved) = (pieces.len(), std::mem::take(&mut pieces));
            let mut splits = 0;
            for mut piece in halved {
                let has_room = before + splits < most;
                let is_wished = self.looks_closer(&mut piece, region_of);
                is_coarse |= is_wished && !has_room;
                if is_wished && has_room || self.is_halved_beside(&piece) {
                    pieces.extend(self.halved(&piece));
                    splits += 1;
                } else {
                    pieces.push(piece);
                }
            }
            if splits == 0 {
                return (pieces, is_coarse);
            }
        }
    }

    /// Finds out what of a piece is in its region; whether it is to be halved for that.
    fn looks_closer<'a>(
        &self,
        piece: &mut Piece,
        region_of: &impl Fn(u32) -> Option<&'a dyn Region>,
    ) -> bool {
        let Some(region) = region_of(piece.material) else {
            return false;
        };
        let corners = piece.looks.map(|look| &self.looks[look as usize]);
        let extent = *piece.extent.get_or_insert_with(|| region.extent(corners));
        let is_small = self.length_m(piece, self.longest(piece)) <= self.finest_m;
        extent == Extent::Part && !is_small && !region.is_fine(corners)
    }

    fn is_halved_beside(&self, piece: &Piece) -> bool {
        let [a, b, c] = piece.places;
        let edges = [edge(a, b), edge(b, c), edge(c, a)];
        edges.iter().any(|edge| self.middles.contains_key(edge))
    }

    /// The edge from this corner to the next is the longest; of two of one length both neighbours take the same.
    fn longest(&self, piece: &Piece) -> usize {
        let key = |number: usize| {
            let next = (number + 1) % 3;
            let edge = edge(piece.places[number], piece.places[next]);
            (self.length_of(edge), edge)
        };
        let longer = |a: &usize, b: &usize| {
            let ((a, edge_a), (b, edge_b)) = (key(*a), key(*b));
            a.total_cmp(&b).then(edge_a.cmp(&edge_b))
        };
        (0..3).max_by(longer).unwrap_or(0)
    }

    fn length_m(&self, piece: &Piece, number: usize) -> f64 {
        let next = (number + 1) % 3;
        self.length_of(edge(piece.places[number], piece.places[next]))
    }

    fn length_of(&self, (a, b): Edge) -> f64 {
        self.places[a as usize].distance(self.places[b as usize])
    }

    /// Both halves.
    fn halved(&mut self, piece: &Piece) -> [Piece; 2] {
        let first = self.longest(piece);
        let [a, b, c] = [0, 1, 2].map(|step| piece.corner((first + step) % 3));
        let key = edge(a.place, b.place);
        let place = match self.middles.get(&key) {
            Some(&place) => place,
            None => {
                let place = self.place_between(key, 0.5);
                self.middles.insert(key, place);
                place
            }
        };
        let middle = self.corner_between([a, b], 0.5, place);
        // What is known of the whole holds of its halves.
        let half = Piece {
            extent: piece.extent.filter(|extent| *extent != Extent::Part),
            ..*piece
        };
        [[a, middle, c], [middle, b, c]].map(|corners| half.with_corners(corners))
    }

    fn place_between(&mut self, (a, b): Edge, share: f64) -> u32 {
        let place = self.places[a as usize].lerp(self.places[b as usize], share);
        self.places.push(place);
        self.places.len() as u32 - 1
    }

    /// The corner between two, of which `share` of the way is gone from the first.
    fn corner_between(&mut self, [a, b]: [Corner; 2], share: f64, place: u32) -> Corner {
        // As seen from the look of the smaller number, so that both neighbours get one.
        let from_smaller = if a.look <= b.look { share } else { 1.0 - share };
        let key = edge(a.look, b.look);
        let look = match self.between.get(&(key, from_smaller.to_bits())) {
            Some(&look) => look,
            None => {
                let look = self.look_at(key, from_smaller);
                self.looks.push(look);
                let index = self.looks.len() as u32 - 1;
                self.between.insert((key, from_smaller.to_bits()), index);
                index
            }
        };
        let normal = a.normal.zip(b.normal);
        let normal = normal.map(|(a, b)| {
            a.normalize_or_zero()
                .lerp(b.normalize_or_zero(), share as f32)
        });
        Corner {
            place,
            look,
            normal,
        }
    }

    fn look_at(&self, (a, b): Edge, share: f64) -> CornerLook {
        let [a, b] = [a, b].map(|look| &self.looks[look as usize]);
        let share = share as f32;
        CornerLook::blended([a, b, b], [1.0 - share, share, 0.0])
    }

    /// Adds what of a piece is inside, where the edge is straight in it.
    fn cut_piece(&mut self, piece: &Piece, region: &dyn Region, left: &mut Vec<Piece>) {
        if piece.extent == Some(Extent::Nothing) {
            return;
        }
        let is_inside = piece
            .looks
            .map(|look| region.inside(&self.looks[look as usize]) >= 0.0);
        let count = is_inside.iter().filter(|inside| **inside).count();
        if count == 3 {
            left.push(*piece);
        }
        if count == 0 || count == 3 {
            return;
        }
        // The corner that is on its own side alone.
        let alone = (0..3).find(|&corner| is_inside[corner] == (count == 1));
        let alone = alone.unwrap_or(0);
        let [a, b, c] = [0, 1, 2].map(|step| piece.corner((alone + step) % 3));
        let (ab, ac) = (self.crossing([a, b], region), self.crossing([a, c], region));
        if count == 1 {
            left.push(piece.with_corners([a, ab, ac]));
        } else {
            left.push(piece.with_corners([ab, b, c]));
            left.push(piece.with_corners([ab, c, ac]));
        }
    }

    /// Where the region's edge crosses a piece's.
    fn crossing(&mut self, [a, b]: [Corner; 2], region: &dyn Region) -> Corner {
        let key = edge(a.place, b.place);
        let is_turned = a.place != key.0;
        let [low, high] = if is_turned { [b, a] } else { [a, b] };
        let (place, share) = match self.cuts.get(&key) {
            Some(&found) => found,
            None => {
                let share = self.share_of_crossing([low.look, high.look], region);
                let place = self.place_between(key, share);
                self.cuts.insert(key, (place, share));
                (place, share)
            }
        };
        self.corner_between([low, high], share, place)
    }

    /// How far from the first look the edge is, by bisection.
    fn share_of_crossing(&self, [first, second]: [u32; 2], region: &dyn Region) -> f64 {
        /// So much finer than the piece that nobody sees the rest.
        const STEPS: u32 = 12;
        let [first, second] = [first, second].map(|look| &self.looks[look as usize]);
        let starts_inside = region.inside(first) >= 0.0;
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..STEPS {
            let middle: f64 = 0.5 * (low + high);
            let share = middle as f32;
            let look = CornerLook::blended([first, second, second], [1.0 - share, share, 0.0]);
            match (region.inside(&look) >= 0.0) == starts_inside {
                true => low = middle,
                false => high = middle,
            }
        }
        0.5 * (low + high)
    }
}

#[cfg(test)]
mod tests;
