//! Boxes and balls around patches and things.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// An axis-aligned box in the world, metres, in the precision of what it is compared with: a room's patches and things.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// Around points; without any, one that holds nothing.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        let empty = Self {
            min: Vec3::MAX,
            max: Vec3::MIN,
        };
        points.into_iter().fold(empty, |bounds, point| Self {
            min: bounds.min.min(point),
            max: bounds.max.max(point),
        })
    }

    /// Whether both have a point in common.
    pub fn touches(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && self.max.cmpge(other.min).all()
    }

    /// How far the two are apart; 0 where they touch.
    pub fn distance(&self, other: &Self) -> f32 {
        let apart = (self.min - other.max).max(other.min - self.max);
        apart.max(Vec3::ZERO).length()
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f32 {
        self.min.distance(self.max)
    }

    /// Its eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|index| {
            let pick = |axis: usize| match index >> axis & 1 {
                0 => self.min[axis],
                _ => self.max[axis],
            };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }
}

/// A ball in the world, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Its middle.
    pub center: Vec3,
    /// Its radius.
    pub radius: f32,
}
