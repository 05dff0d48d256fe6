//! Boxes along the axes.

use glam::DVec3;

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

    /// Whether a point lies in it or on its sides.
    pub fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.low).all() && point.cmple(self.high).all()
    }

    /// Its eight corners.
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
