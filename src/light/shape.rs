//! What a light at a place looks like: all that tells its shapes apart.

use std::f64::consts::PI;

use glam::{DAffine3, DVec2, DVec3};

use super::form_factor;
use super::pieces::{Onlooking, in_sphere, in_square};

/// What shines at a [`Light::Point`]'s place.
///
/// [`Light::Point`]: super::Light::Point
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A point, to all sides alike.
    Point,
    /// A point, within a cone.
    Spot {
        /// Unit direction of the axis.
        direction: DVec3,
        /// Angle to the axis up to which the light is whole, radians.
        inner_rad: f64,
        /// Angle to the axis from which on there is none, radians; more than `inner_rad`.
        outer_rad: f64,
    },
    /// A sphere of one radiance.
    Sphere {
        /// Metres.
        radius_m: f64,
    },
    /// One side of a rectangle of one radiance.
    Rect(Rect),
}

/// A rectangle that shines to one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Unit direction that it faces.
    pub facing: DVec3,
    /// Unit direction of its width, across `facing`.
    pub along: DVec3,
    /// Width and height, metres.
    pub size_m: DVec2,
}

impl Rect {
    /// A rectangle that faces a unit direction and whose height goes along `up`, but for what of that lies along `facing`; where
    /// all of it does, along y or else x. `size_m`: width and height.
    pub fn upright(facing: DVec3, up: DVec3, size_m: DVec2) -> Self {
        let ups = [up.normalize_or_zero(), DVec3::Y, DVec3::X];
        let sides = ups.map(|up| up.cross(facing));
        let along = sides.iter().find(|side| side.length() > 1e-6);
        Self {
            facing,
            along: along.map_or(DVec3::X, |side| side.normalize()),
            size_m,
        }
    }

    /// Unit direction of its height.
    pub fn up(&self) -> DVec3 {
        self.facing.cross(self.along)
    }

    /// Vectors from its middle to the middles of two of its sides, metres.
    pub fn half_sides_m(&self) -> [DVec3; 2] {
        [
            self.along * (0.5 * self.size_m.x),
            self.up() * (0.5 * self.size_m.y),
        ]
    }
}

/// A shape in the numbers by which shaders shade it; what it has not is zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ShapeFrame {
    /// Of a sphere, metres.
    pub radius_m: f64,
    /// Unit direction straight ahead.
    pub axis: DVec3,
    /// From its middle to those of two sides, metres; of a spot the numbers of [`spot_ramp`] in the first's x and y.
    pub half_sides_m: [DVec3; 2],
}

impl Shape {
    /// The same shape in another space, to which a rigid motion leads.
    pub fn moved(self, there_from_here: &DAffine3) -> Self {
        let turned = |way: DVec3| there_from_here.transform_vector3(way);
        match self {
            Self::Point | Self::Sphere { .. } => self,
            Self::Spot {
                direction,
                inner_rad,
                outer_rad,
            } => Self::Spot {
                direction: turned(direction),
                inner_rad,
                outer_rad,
            },
            Self::Rect(rect) => Self::Rect(Rect {
                facing: turned(rect.facing),
                along: turned(rect.along),
                ..rect
            }),
        }
    }

    /// Whether its shadows have soft edges.
    pub fn has_size(&self) -> bool {
        match self {
            Self::Point | Self::Spot { .. } => false,
            Self::Sphere { .. } | Self::Rect(_) => true,
        }
    }

    /// From its middle to its ends, metres; none of what has no size.
    pub fn half_extents_m(&self) -> Vec<DVec3> {
        match *self {
            Self::Point | Self::Spot { .. } => Vec::new(),
            Self::Sphere { radius_m } => DVec3::AXES.map(|axis| axis * radius_m).to_vec(),
            Self::Rect(rect) => {
                let [width, height] = rect.half_sides_m();
                vec![width, height, width + height, width - height]
            }
        }
    }

    /// One of `count` smaller ones that together are it, and where its middle lies from this one's, metres: see
    /// [`Light::pieces`].
    ///
    /// [`Light::pieces`]: super::Light::pieces
    pub fn piece(self, index: usize, count: usize, onlooking: Onlooking) -> (DVec3, Self) {
        let smaller = (1.0 / count as f64).sqrt();
        match self {
            Self::Point | Self::Spot { .. } => (DVec3::ZERO, self),
            Self::Sphere { radius_m } => {
                let aside_m = in_sphere(index, count, onlooking) * radius_m;
                let radius_m = radius_m * smaller;
                (aside_m, Self::Sphere { radius_m })
            }
            Self::Rect(rect) => {
                let [width, height] = rect.half_sides_m();
                let [across, up] = in_square(index, count);
                let aside_m = width * across + height * up;
                let size_m = rect.size_m * smaller;
                (aside_m, Self::Rect(Rect { size_m, ..rect }))
            }
        }
    }

    /// What shades it.
    pub fn frame(&self) -> ShapeFrame {
        match *self {
            Self::Point => ShapeFrame::default(),
            Self::Sphere { radius_m } => ShapeFrame {
                radius_m,
                ..ShapeFrame::default()
            },
            Self::Spot {
                direction,
                inner_rad,
                outer_rad,
            } => {
                let [scale, offset] = spot_ramp(inner_rad, outer_rad);
                ShapeFrame {
                    axis: direction,
                    half_sides_m: [DVec3::new(scale, offset, 0.0), DVec3::ZERO],
                    ..ShapeFrame::default()
                }
            }
            Self::Rect(rect) => ShapeFrame {
                axis: rect.facing,
                half_sides_m: rect.half_sides_m(),
                ..ShapeFrame::default()
            },
        }
    }

    /// Irradiance, of an intensity of 1, at a point with a unit normal from which its middle is `to_middle_m` away.
    pub(super) fn irradiance_per_intensity(&self, to_middle_m: DVec3, normal: DVec3) -> f64 {
        let distance_squared = to_middle_m.length_squared().max(1e-12);
        let to_light = to_middle_m / distance_squared.sqrt();
        let of_point = normal.dot(to_light).max(0.0) / distance_squared;
        match *self {
            Self::Point => of_point,
            Self::Spot { direction, .. } => of_point * spot_part(self, -to_light.dot(direction)),
            Self::Sphere { radius_m } => {
                let area = PI * radius_m * radius_m;
                let sine_squared = radius_m * radius_m / distance_squared;
                form_factor::disc(normal.dot(to_light), sine_squared) / area
            }
            Self::Rect(rect) => {
                form_factor::rect(&rect, to_middle_m, normal) / (rect.size_m.x * rect.size_m.y)
            }
        }
    }
}

/// Part of a spot's intensity at an angle to its axis, of which the cosine is given; 1 for what is no spot. As lamps of glTF
/// fall off (KHR_lights_punctual, "Inner and Outer Cone Angles").
pub fn spot_part(shape: &Shape, cosine: f64) -> f64 {
    let Shape::Spot {
        inner_rad,
        outer_rad,
        ..
    } = *shape
    else {
        return 1.0;
    };
    let [scale, offset] = spot_ramp(inner_rad, outer_rad);
    (cosine * scale + offset).clamp(0.0, 1.0).powi(2)
}

/// Factor and summand that make a number from 0 at the outer angle to 1 at the inner of a cosine.
pub fn spot_ramp(inner_rad: f64, outer_rad: f64) -> [f64; 2] {
    let scale = 1.0 / (inner_rad.cos() - outer_rad.cos()).max(1e-6);
    [scale, -outer_rad.cos() * scale]
}
