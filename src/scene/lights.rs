//! `[[light]]` and `[ambient]`: what shines.

use glam::{DVec2, DVec3};

use super::error::SceneError;
use super::objects::{STANDING, StandingKeys, anchor_index};
use super::placement::POSITION;
use super::ranges::{Digits, Numbers};
use super::reader::Table;
use super::schema::choice::Choice as _;
use super::schema::key::Missing::Is;
use super::schema::key::{Key, NewKey, Required, new_key};
use super::schema::section::{Example, Section, Times};
use super::schema::values::Vectors;
use super::{Anchor, Scene};
use crate::light::bounce::FurtherLight;
use crate::light::{Light, Rect, Shape};

/// As many as the shadow masks have room for.
const MOST_LIGHTS: usize = 16;
const POWER: Numbers = Numbers::between(0.0, 1e9);
/// Of any length but zero; written to 0.01° of a unit vector.
const DIRECTION: Numbers = Numbers::between(f64::MIN, f64::MAX).digits(Digits::Decimals(4));

/// Lengths of what shines.
const EXTENT: Numbers = Numbers::above(0.0, 1e4).unit("m");
const CONE: Numbers = Numbers::above(0.0, 90.0)
    .unit("degrees")
    .digits(Digits::Decimals(2));

choices! {
    /// What a light is.
    pub enum LightKind, "kind of light" {
        /// It shines from a point to all sides.
        Point = "point",
        /// It comes from infinitely far away: the sun.
        Directional = "directional",
        /// It shines from a point within a cone.
        Spot = "spot",
        /// A sphere shines: a frosted bulb.
        Sphere = "sphere",
        /// One side of a rectangle shines: a panel, a window.
        Rect = "rect",
    }
}

/// A light of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneLight {
    /// Index into [`Scene::anchors`] of the anchor that it stands on and moves with.
    ///
    /// [`Scene::anchors`]: super::Scene::anchors
    pub anchor: usize,
    /// The light in that anchor's space.
    pub light: Light,
}

impl From<Light> for SceneLight {
    /// The light where it stands in the world.
    fn from(light: Light) -> Self {
        Self { anchor: 0, light }
    }
}

keys! {
    /// What all lights have.
    pub static LIGHT: LightKeys;
    required {
        /// What it is.
        kind: LightKind => "\"point\", \"directional\", \"spot\", \"sphere\" or \"rect\" is expected";
    }
}

keys! {
    /// What lights at a place have.
    pub static POINT_LIGHT: PointLightKeys;
    required {
        /// Where it stands, its middle.
        position_m: DVec3, Vectors::three(POSITION) => "three numbers in metres are expected";
        /// Radiant intensity, W/sr up to the camera's exposure, linear RGB: of a spot and a rectangle straight ahead, of a
        /// sphere as it is from afar, so that a larger one of the same intensity gives the same light.
        intensity: DVec3, Vectors::one_or_three(POWER) => "a number or three (W/sr, linear RGB) are expected";
    }
}

keys! {
    /// What comes from infinitely far away has.
    pub static DIRECTIONAL_LIGHT: DirectionalLightKeys;
    required {
        /// The way that the light travels, of any length but zero.
        direction: DVec3, Vectors::three(DIRECTION) => "three numbers are expected: the way that the light travels";
        /// Irradiance on a plane across it, W/m² up to the camera's exposure, linear RGB.
        irradiance: DVec3, Vectors::one_or_three(POWER) => "a number or three (W/m², linear RGB) are expected";
    }
    /// Width of the disc that it comes from, as it is seen; the sun's is 0.53. 0: its shadows are sharp.
    angle_deg: f64, Numbers::between(0.0, 90.0).unit("degrees").digits(Digits::Decimals(2)) => Is(0.0);
}

keys! {
    /// What is turned some way has.
    pub static AIMED_LIGHT: AimedLightKeys;
    required {
        /// The way that it shines straight ahead, of any length but zero.
        direction: DVec3, Vectors::three(DIRECTION) => "three numbers are expected: the way that it shines";
    }
}

keys! {
    /// What spots have.
    pub static SPOT_LIGHT: SpotLightKeys;
    required {
        /// Angle to the axis from which on there is no light.
        outer_deg: f64, CONE => "an angle in degrees is expected: from the axis to where its light ends";
    }
    /// Angle to the axis up to which the light is whole; less than outer_deg.
    inner_deg: f64, Numbers::between(0.0, 90.0).unit("degrees").digits(Digits::Decimals(2)) => Is(0.0);
}

keys! {
    /// What spheres have.
    pub static SPHERE_LIGHT: SphereLightKeys;
    required {
        /// Its radius.
        radius_m: f64, EXTENT => "a length in metres is expected";
    }
}

keys! {
    /// What rectangles have.
    pub static RECT_LIGHT: RectLightKeys;
    required {
        /// Its width and its height.
        size_m: [f64; 2], EXTENT => "two lengths in metres are expected: width and height";
    }
    /// The way that its height goes, but for what of it lies along the direction; where all of it does, y stands for it.
    up: DVec3, Vectors::three(DIRECTION) => Is(DVec3::Z);
}

choices! {
    /// How often light is followed that things reflect on to real surfaces.
    pub enum Bounces, "number of bounces" {
        /// Twice where nothing moves to anything else, estimated elsewhere.
        Auto = "auto",
        /// Once; where it is reflected the ambient light counts as if nothing hid it, which stands for light that goes on.
        Estimated = "estimated",
        /// Once, and no more.
        Once = "once",
        /// Twice, the second time by few rays; what goes on from there is estimated.
        Twice = "twice",
    }
}

impl Scene {
    /// How far light from around is followed beyond what a ray ends on.
    pub fn further_light(&self) -> FurtherLight {
        match (self.bounces, self.moves()) {
            (Bounces::Estimated, _) | (Bounces::Auto, true) => FurtherLight::Estimated,
            (Bounces::Once, _) => FurtherLight::None,
            (Bounces::Twice, _) | (Bounces::Auto, false) => FurtherLight::Bounce,
        }
    }
}

impl Default for Bounces {
    fn default() -> Self {
        *AMBIENT.bounces.default()
    }
}

keys! {
    /// Keys of `[ambient]`.
    pub static AMBIENT: AmbientKeys;

    /// Radiance from everywhere, W/(m² sr) up to the camera's exposure, linear RGB.
    radiance: DVec3, Vectors::one_or_three(POWER) => Is(DVec3::ZERO);
    /// How often light that things reflect is followed (`ambient_samples` of `[shadows]` are the rays).
    bounces: Bounces => Is(Bounces::Auto);
}

/// `[[light]]` of any kind, as it may be before its kind is known.
pub static LIGHT_SECTION: Section = Section {
    name: "light",
    says: "Lights, up to 16 in all.",
    times: Times::Any,
    groups: &[
        LightKeys::ALL,
        StandingKeys::ALL,
        PointLightKeys::ALL,
        DirectionalLightKeys::ALL,
        AimedLightKeys::ALL,
        SpotLightKeys::ALL,
        SphereLightKeys::ALL,
        RectLightKeys::ALL,
    ],
    shown: &[],
    is_aside: false,
};

/// `[[light]]`, a point.
static POINT_LIGHT_SECTION: Section = Section {
    name: "light",
    says: "Light from a point; up to 16 lights in all, default none.",
    times: Times::Any,
    groups: &[LightKeys::ALL, StandingKeys::ALL, PointLightKeys::ALL],
    shown: &[
        ("kind", Example::Live("\"point\"")),
        ("on", Example::Live("\"table\"")),
        ("position_m", Example::Live("[-0.26, 0.24, 0.46]")),
        ("intensity", Example::Live("[1.15, 1.06, 0.9]")),
    ],
    is_aside: false,
};

/// `[[light]]`, from infinitely far away.
static DIRECTIONAL_LIGHT_SECTION: Section = Section {
    name: "light",
    says: "Light from infinitely far away.",
    times: Times::Any,
    groups: &[LightKeys::ALL, StandingKeys::ALL, DirectionalLightKeys::ALL],
    shown: &[
        ("kind", Example::Live("\"directional\"")),
        ("on", Example::Aside("\"table\"")),
        ("direction", Example::Live("[0.3, -0.2, -1.0]")),
        ("irradiance", Example::Live("0.4")),
        ("angle_deg", Example::Live("0.53")),
    ],
    is_aside: false,
};

/// `[[light]]`, a spot.
static SPOT_LIGHT_SECTION: Section = Section {
    name: "light",
    says: "Light from a point within a cone; between the two angles it fades as lamps of glTF do.",
    times: Times::Any,
    groups: &[
        LightKeys::ALL,
        StandingKeys::ALL,
        PointLightKeys::ALL,
        AimedLightKeys::ALL,
        SpotLightKeys::ALL,
    ],
    shown: &[
        ("kind", Example::Live("\"spot\"")),
        ("on", Example::Aside("\"table\"")),
        ("position_m", Example::Live("[0.3, 0.1, 0.6]")),
        ("intensity", Example::Live("0.3")),
        ("direction", Example::Live("[-0.3, -0.1, -0.6]")),
        ("outer_deg", Example::Live("30")),
        ("inner_deg", Example::Live("20")),
    ],
    is_aside: false,
};

/// `[[light]]`, a sphere.
static SPHERE_LIGHT_SECTION: Section = Section {
    name: "light",
    says: "A sphere that shines to all sides.",
    times: Times::Any,
    groups: &[
        LightKeys::ALL,
        StandingKeys::ALL,
        PointLightKeys::ALL,
        SphereLightKeys::ALL,
    ],
    shown: &[
        ("kind", Example::Live("\"sphere\"")),
        ("on", Example::Aside("\"table\"")),
        ("position_m", Example::Live("[0.2, 0.3, 0.5]")),
        ("intensity", Example::Live("0.2")),
        ("radius_m", Example::Live("0.04")),
    ],
    is_aside: false,
};

/// `[[light]]`, a rectangle.
static RECT_LIGHT_SECTION: Section = Section {
    name: "light",
    says: "A rectangle that shines to one side.",
    times: Times::Any,
    groups: &[
        LightKeys::ALL,
        StandingKeys::ALL,
        PointLightKeys::ALL,
        AimedLightKeys::ALL,
        RectLightKeys::ALL,
    ],
    shown: &[
        ("kind", Example::Live("\"rect\"")),
        ("on", Example::Aside("\"table\"")),
        ("position_m", Example::Live("[-1.2, 0.0, 0.9]")),
        ("intensity", Example::Live("0.6")),
        ("direction", Example::Live("[1, 0, -0.5]")),
        ("size_m", Example::Live("[0.8, 1.2]")),
    ],
    is_aside: false,
};

/// `[[light]]` of each kind.
pub const LIGHT_SECTIONS: [&Section; LightKind::BY_NAME.len()] = {
    let mut sections = [&LIGHT_SECTION; LightKind::BY_NAME.len()];
    let mut index = 0;
    while index < sections.len() {
        sections[index] = LightKind::BY_NAME[index].1.section();
        index += 1;
    }
    sections
};

/// `[ambient]`.
pub static AMBIENT_SECTION: Section = Section {
    name: "ambient",
    says: "Light from all around.",
    times: Times::UpToOnce,
    groups: &[AmbientKeys::ALL],
    shown: &[("radiance", Example::Live("[0.1, 0.11, 0.13]"))],
    is_aside: false,
};

/// Reads the lights.
pub fn lights(root: &Table, anchors: &[Anchor]) -> Result<Vec<SceneLight>, SceneError> {
    let tables = LIGHT_SECTION.tables(root)?;
    if let Some(extra) = tables.get(MOST_LIGHTS) {
        return Err(extra.error(format!(
            "light: too many; allowed: up to {MOST_LIGHTS} lights"
        )));
    }
    let read = |table: &Table| {
        let kind = LIGHT.kind.read(table)?;
        table.allow_or(&kind.section().names(), |key| kind.of_others(key))?;
        let on = STANDING.on.value(table);
        Ok(SceneLight {
            anchor: on.map_or(Ok(0), |on| anchor_index(&on, anchors))?,
            light: light(table, kind)?,
        })
    };
    tables.iter().map(read).collect()
}

impl LightKind {
    /// The table of a light of this kind.
    pub const fn section(self) -> &'static Section {
        match self {
            Self::Point => &POINT_LIGHT_SECTION,
            Self::Directional => &DIRECTIONAL_LIGHT_SECTION,
            Self::Spot => &SPOT_LIGHT_SECTION,
            Self::Sphere => &SPHERE_LIGHT_SECTION,
            Self::Rect => &RECT_LIGHT_SECTION,
        }
    }

    /// What there is to say of a key that lights of other kinds have; `None` where none has it.
    fn of_others(self, key: &str) -> Option<String> {
        let has_it = |(_, kind): &&(&str, Self)| kind.section().names().contains(&key);
        let words = Self::WORDS.iter().filter(has_it).map(|(word, _)| *word);
        let words: Vec<&str> = words.collect();
        let of = words.join(" or ");
        (!words.is_empty()).then(|| format!("of a light of kind {of}, and not {}", self.word()))
    }

    /// The kind of a light.
    pub fn of(light: &Light) -> Self {
        match light {
            Light::Directional { .. } => Self::Directional,
            Light::Point { shape, .. } => match shape {
                Shape::Point => Self::Point,
                Shape::Spot { .. } => Self::Spot,
                Shape::Sphere { .. } => Self::Sphere,
                Shape::Rect(_) => Self::Rect,
            },
        }
    }

    /// A light of this kind where and as strong as another is, as far as kinds have that in common.
    pub fn like(self, light: &Light) -> Light {
        let (position_m, intensity, down) = match *light {
            Light::Point {
                position_m,
                intensity,
                ..
            } => (position_m, intensity, unit_direction(-position_m)),
            // From half a metre away, as bright at the origin.
            Light::Directional {
                direction,
                irradiance,
                ..
            } => (-0.5 * direction, 0.25 * irradiance, direction),
        };
        let direction = match down == DVec3::ZERO {
            true => DVec3::NEG_Z,
            false => down,
        };
        let shape = match self {
            Self::Directional => {
                return Light::directional(
                    direction,
                    intensity / position_m.length_squared().max(1e-4),
                );
            }
            Self::Point => Shape::Point,
            Self::Spot => Shape::Spot {
                direction,
                inner_rad: 20_f64.to_radians(),
                outer_rad: 30_f64.to_radians(),
            },
            Self::Sphere => Shape::Sphere { radius_m: 0.04 },
            Self::Rect => Shape::Rect(Rect::upright(direction, DVec3::Z, DVec2::splat(0.3))),
        };
        Light::Point {
            position_m,
            intensity,
            shape,
        }
    }
}

fn light(table: &Table, kind: LightKind) -> Result<Light, SceneError> {
    let shape = match kind {
        LightKind::Directional => {
            return Ok(Light::Directional {
                direction: direction(table, &DIRECTIONAL_LIGHT.direction)?,
                irradiance: DIRECTIONAL_LIGHT.irradiance.read(table)?,
                angle_rad: DIRECTIONAL_LIGHT.angle_deg.read(table)?.to_radians(),
            });
        }
        LightKind::Point => Shape::Point,
        LightKind::Spot => spot(table)?,
        LightKind::Sphere => Shape::Sphere {
            radius_m: SPHERE_LIGHT.radius_m.read(table)?,
        },
        LightKind::Rect => {
            let facing = direction(table, &AIMED_LIGHT.direction)?;
            let [width, height] = RECT_LIGHT.size_m.read(table)?;
            let up = RECT_LIGHT.up.read(table)?;
            Shape::Rect(Rect::upright(facing, up, DVec2::new(width, height)))
        }
    };
    Ok(Light::Point {
        position_m: POINT_LIGHT.position_m.read(table)?,
        intensity: POINT_LIGHT.intensity.read(table)?,
        shape,
    })
}

fn spot(table: &Table) -> Result<Shape, SceneError> {
    let outer_deg = SPOT_LIGHT.outer_deg.read(table)?;
    let inner_deg = SPOT_LIGHT.inner_deg.read(table)?;
    if inner_deg >= outer_deg {
        let inner = SPOT_LIGHT.inner_deg.value(table);
        let message = format!("not inside outer_deg; allowed: 0 to less than {outer_deg} degrees");
        return Err(inner.map_or_else(
            || table.error(message.clone()),
            |it| it.error(message.clone()),
        ));
    }
    Ok(Shape::Spot {
        direction: direction(table, &AIMED_LIGHT.direction)?,
        inner_rad: inner_deg.to_radians(),
        outer_rad: outer_deg.to_radians(),
    })
}

fn direction(table: &Table, key: &Key<DVec3, Required>) -> Result<DVec3, SceneError> {
    let direction = unit_direction(key.read(table)?);
    match direction == DVec3::ZERO {
        true => Err(key
            .require(table)?
            .error("no direction; allowed: any length but zero")),
        false => Ok(direction),
    }
}

/// The keys of a light: three that all have, then those of its size.
pub fn light_keys(light: &Light) -> Vec<NewKey> {
    let kind = new_key(&LIGHT.kind, &LightKind::of(light));
    match light {
        Light::Point {
            position_m,
            intensity,
            shape,
        } => {
            let mut keys = vec![
                kind,
                new_key(&POINT_LIGHT.position_m, position_m),
                new_key(&POINT_LIGHT.intensity, intensity),
            ];
            keys.extend(shape_keys(shape));
            keys
        }
        Light::Directional {
            direction,
            irradiance,
            angle_rad,
        } => {
            let width = new_key(&DIRECTIONAL_LIGHT.angle_deg, &angle_rad.to_degrees());
            let mut keys = vec![
                kind,
                new_key(&DIRECTIONAL_LIGHT.direction, direction),
                new_key(&DIRECTIONAL_LIGHT.irradiance, irradiance),
            ];
            keys.extend((*angle_rad > 0.0).then_some(width));
            keys
        }
    }
}

fn shape_keys(shape: &Shape) -> Vec<NewKey> {
    match shape {
        Shape::Point => Vec::new(),
        Shape::Spot {
            direction,
            inner_rad,
            outer_rad,
        } => vec![
            new_key(&AIMED_LIGHT.direction, direction),
            new_key(&SPOT_LIGHT.outer_deg, &outer_rad.to_degrees()),
            new_key(&SPOT_LIGHT.inner_deg, &inner_rad.to_degrees()),
        ],
        Shape::Sphere { radius_m } => vec![new_key(&SPHERE_LIGHT.radius_m, radius_m)],
        Shape::Rect(rect) => vec![
            new_key(&AIMED_LIGHT.direction, &rect.facing),
            new_key(&RECT_LIGHT.size_m, &rect.size_m.to_array()),
            new_key(&RECT_LIGHT.up, &rect.up()),
        ],
    }
}

/// Changes the numbers of a shape, each by its name; whether it has changed one.
pub trait ShapeKnobs {
    /// A unit direction.
    fn direction(&mut self, name: &str, direction: &mut DVec3) -> bool;
    /// An angle, which has to be allowed in degrees.
    fn angle(&mut self, name: &str, angle_rad: &mut f64, allowed: &Numbers) -> bool;
    /// A length, changed by small steps.
    fn length(&mut self, name: &str, length_m: &mut f64, step_m: f64, allowed: &Numbers) -> bool;
}

/// Gives all numbers of a shape to what may change them; whether one has changed.
pub fn turn_shape(shape: &mut Shape, knobs: &mut dyn ShapeKnobs) -> bool {
    match shape {
        Shape::Point => false,
        Shape::Spot {
            direction,
            inner_rad,
            outer_rad,
        } => {
            let turned = knobs.direction("towards", direction);
            let outer = knobs.angle("outer", outer_rad, &SPOT_LIGHT.outer_deg.takes);
            let mut inside = SPOT_LIGHT.inner_deg.takes;
            inside.most = (outer_rad.to_degrees() - 0.01).max(0.0);
            *inner_rad = inner_rad.min(inside.most.to_radians());
            knobs.angle("inner", inner_rad, &inside) || outer || turned
        }
        Shape::Sphere { radius_m } => {
            knobs.length("radius", radius_m, 0.001, &SPHERE_LIGHT.radius_m.takes)
        }
        Shape::Rect(rect) => {
            let mut facing = rect.facing;
            let turned = knobs.direction("towards", &mut facing);
            let size = &RECT_LIGHT.size_m.takes;
            let wider = knobs.length("width", &mut rect.size_m.x, 0.005, size);
            let higher = knobs.length("height", &mut rect.size_m.y, 0.005, size);
            if turned {
                *rect = Rect::upright(facing, rect.up(), rect.size_m);
            }
            turned || wider || higher
        }
    }
}

/// A direction of unit length from one of any length; zero where it has none. Scaled first, so that neither tiny nor
/// huge numbers vanish in the squares.
pub fn unit_direction(written: DVec3) -> DVec3 {
    (written / written.abs().max_element()).normalize_or_zero()
}

/// The radiance of the constant surrounding light, none where the scene has no `[ambient]`, and how often light is followed.
pub fn ambient(root: &Table) -> Result<(DVec3, Bounces), SceneError> {
    match AMBIENT_SECTION.table(root)? {
        Some(ambient) => Ok((
            AMBIENT.radiance.read(&ambient)?,
            AMBIENT.bounces.read(&ambient)?,
        )),
        None => Ok((*AMBIENT.radiance.default(), *AMBIENT.bounces.default())),
    }
}
