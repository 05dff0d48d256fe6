//! The kinds of lights that shaders tell apart. What shades is built for one of them: what another would take, a driver may
//! work out for each pixel and throw away.

use crate::light::{Light, Shape};

/// What a light looks like to a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LightKind {
    /// A point, or one direction.
    Plain,
    /// A point with a cone.
    Spot,
    /// A sphere, or a disc of directions.
    Round,
    /// A rectangle.
    Rect,
}

impl LightKind {
    const ALL: [Self; 4] = [Self::Plain, Self::Spot, Self::Round, Self::Rect];

    pub fn of(light: &Light) -> Self {
        match light {
            Light::Point { shape, .. } => match shape {
                Shape::Point => Self::Plain,
                Shape::Spot { .. } => Self::Spot,
                Shape::Sphere { .. } => Self::Round,
                Shape::Rect(_) => Self::Rect,
            },
            Light::Directional { angle_rad, .. } => match *angle_rad > 0.0 {
                true => Self::Round,
                false => Self::Plain,
            },
        }
    }

    /// Its number in area_lights.wgsl.
    pub fn number(self) -> u8 {
        self as u8
    }

    /// The `override` of area_lights.wgsl that says it.
    pub fn constant(self) -> (&'static str, f64) {
        ("LIGHT_KIND", f64::from(self.number()))
    }
}

/// The kinds that some lights are of; plain ones are always among them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LightKinds {
    has: [bool; LightKind::ALL.len()],
}

impl FromIterator<LightKind> for LightKinds {
    fn from_iter<I: IntoIterator<Item = LightKind>>(kinds: I) -> Self {
        let mut has = [false; LightKind::ALL.len()];
        has[LightKind::Plain as usize] = true;
        for kind in kinds {
            has[kind as usize] = true;
        }
        Self { has }
    }
}

/// One of something for each of some kinds.
pub(super) struct ByLightKind<T> {
    plain: T,
    others: Vec<(LightKind, T)>,
}

impl<T> ByLightKind<T> {
    pub fn new(kinds: LightKinds, make: impl Fn(LightKind) -> T) -> Self {
        let others = LightKind::ALL.into_iter().skip(1);
        Self {
            plain: make(LightKind::Plain),
            others: others
                .filter(|kind| kinds.has[*kind as usize])
                .map(|kind| (kind, make(kind)))
                .collect(),
        }
    }

    pub fn of(&self, kind: LightKind) -> &T {
        let mut others = self.others.iter();
        others
            .find(|(other, _)| *other == kind)
            .map_or(&self.plain, |(_, made)| made)
    }
}
