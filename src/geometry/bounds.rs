//! Boxes along the axes.

use glam::{DAffine3, DVec3};

/// A box along the axes of its space, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The smallest coordinates.
    pub low: DVec3,
    /// The largest coordinates.
    pub high: DVec3,
}

impl Bounds {
    /// The smallest box around points; `None` without any.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Option<Self> {
        points
            .into_iter()
            .fold(None, |bounds: Option<Self>, point| {
                let Self { low, high } = bounds.unwrap_or(Self {
                    low: point,
                    high: point,
                });
                Some(Self {
                    low: low.min(point),
                    high: high.max(point),
                })
            })
    }

    /// The box with its sides moved outwards.
    pub fn grown(&self, by_m: f64) -> Self {
        Self {
            low: self.low - by_m,
            high: self.high + by_m,
        }
    }

    /// Whether no point is in both.
    pub fn is_apart_from(&self, other: &Self) -> bool {
        self.low.cmpgt(other.high).any() || self.high.cmplt(other.low).any()
    }

    /// Whether a point lies in it or on its sides.
    pub fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.low).all() && point.cmple(self.high).all()
    }

    /// How far off a point is; 0 inside.
    pub fn distance(&self, point: DVec3) -> f64 {
        point.distance(point.clamp(self.low, self.high))
    }

    /// The box's eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        let pick = |bit: usize, low: f64, high: f64| if bit == 0 { low } else { high };
        std::array::from_fn(|corner| {
            DVec3::new(
                pick(corner & 1, self.low.x, self.high.x),
                pick(corner >> 1 & 1, self.low.y, self.high.y),
                pick(corner >> 2 & 1, self.low.z, self.high.z),
            )
        })
    }
}

/// All points on one side of a plane: `dot(inward, point) >= offset_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// Unit normal of the plane.
    pub inward: DVec3,
    /// Metres.
    pub offset_m: f64,
}

impl HalfSpace {
    /// How far inside the plane a point is, metres.
    pub fn depth_of(&self, point: DVec3) -> f64 {
        self.inward.dot(point) - self.offset_m
    }

    /// The box around this one in another space, which is turned and moved against this one.
    pub fn in_space(&self, here_from_there: &DAffine3) -> Self {
        Self {
            inward: here_from_there.matrix3.transpose() * self.inward,
            offset_m: self.offset_m - self.inward.dot(here_from_there.translation),
        }
    }
}
