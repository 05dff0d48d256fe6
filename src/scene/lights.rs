//! `[[light]]` and `[ambient]`: what shines.

use glam::DVec3;

use super::error::SceneError;
use super::placement::POSITION;
use super::ranges::{Digits, Numbers};
use super::reader::Table;
use super::schema::key::Missing::Is;
use super::schema::section::{Example, Section, Times};
use super::schema::values::Vectors;
use crate::light::Light;

/// As many as the shadow masks have room for.
const MOST_LIGHTS: usize = 16;
const POWER: Numbers = Numbers::between(0.0, 1e9);
/// Of any length but zero; written to 0.01° of a unit vector.
const DIRECTION: Numbers = Numbers::between(f64::MIN, f64::MAX).digits(Digits::Decimals(4));

choices! {
    /// What a light is.
    pub enum LightKind, "kind of light" {
        /// It shines from a point to all sides.
        Point = "point",
        /// It comes from infinitely far away.
        Directional = "directional",
    }
}

keys! {
    /// What all lights have.
    pub static LIGHT: LightKeys;
    required {
        /// What it is.
        kind: LightKind => "\"point\" or \"directional\" is expected";
    }
}

keys! {
    /// What points have.
    pub static POINT_LIGHT: PointLightKeys;
    required {
        /// Where it stands in the world.
        position_m: DVec3, Vectors::three(POSITION) => "three numbers in metres are expected";
        /// Radiant intensity, W/sr up to the camera's exposure, linear RGB.
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
}

keys! {
    /// Keys of `[ambient]`.
    pub static AMBIENT: AmbientKeys;

    /// Radiance from everywhere, W/(m² sr) up to the camera's exposure, linear RGB.
    radiance: DVec3, Vectors::one_or_three(POWER) => Is(DVec3::ZERO);
}

/// `[[light]]` of either kind, as it may be before its kind is known.
pub static LIGHT_SECTION: Section = Section {
    name: "light",
    says: "Lights, up to 16 in all.",
    times: Times::Any,
    groups: &[
        LightKeys::ALL,
        PointLightKeys::ALL,
        DirectionalLightKeys::ALL,
    ],
    shown: &[],
    is_aside: false,
};

/// `[[light]]`, a point.
pub static POINT_LIGHT_SECTION: Section = Section {
    name: "light",
    says: "Light from a point; up to 16 lights in all, default none.",
    times: Times::Any,
    groups: &[LightKeys::ALL, PointLightKeys::ALL],
    shown: &[
        ("kind", Example::Live("\"point\"")),
        ("position_m", Example::Live("[-0.26, 0.24, 0.46]")),
        ("intensity", Example::Live("[1.15, 1.06, 0.9]")),
    ],
    is_aside: false,
};

/// `[[light]]`, from infinitely far away.
pub static DIRECTIONAL_LIGHT_SECTION: Section = Section {
    name: "light",
    says: "Light from infinitely far away.",
    times: Times::Any,
    groups: &[LightKeys::ALL, DirectionalLightKeys::ALL],
    shown: &[
        ("kind", Example::Live("\"directional\"")),
        ("direction", Example::Live("[0.3, -0.2, -1.0]")),
        ("irradiance", Example::Live("0.4")),
    ],
    is_aside: false,
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
pub fn lights(root: &Table) -> Result<Vec<Light>, SceneError> {
    let tables = LIGHT_SECTION.tables(root)?;
    if let Some(extra) = tables.get(MOST_LIGHTS) {
        return Err(extra.error(format!(
            "light: too many; allowed: up to {MOST_LIGHTS} lights"
        )));
    }
    tables.iter().map(light).collect()
}

fn light(table: &Table) -> Result<Light, SceneError> {
    match LIGHT.kind.read(table)? {
        LightKind::Point => {
            table.allow(&POINT_LIGHT_SECTION.names())?;
            Ok(Light::Point {
                position_m: POINT_LIGHT.position_m.read(table)?,
                intensity: POINT_LIGHT.intensity.read(table)?,
            })
        }
        LightKind::Directional => {
            table.allow(&DIRECTIONAL_LIGHT_SECTION.names())?;
            let direction = unit_direction(DIRECTIONAL_LIGHT.direction.read(table)?);
            if direction == DVec3::ZERO {
                let value = DIRECTIONAL_LIGHT.direction.require(table)?;
                return Err(value.error("no direction; allowed: any length but zero"));
            }
            Ok(Light::Directional {
                direction,
                irradiance: DIRECTIONAL_LIGHT.irradiance.read(table)?,
            })
        }
    }
}

/// A direction of unit length from one of any length; zero where it has none. Scaled first, so that neither tiny nor
/// huge numbers vanish in the squares.
pub fn unit_direction(written: DVec3) -> DVec3 {
    (written / written.abs().max_element()).normalize_or_zero()
}

/// The radiance of the constant surrounding light; none where the scene has no `[ambient]`.
pub fn ambient_radiance(root: &Table) -> Result<DVec3, SceneError> {
    match AMBIENT_SECTION.table(root)? {
        Some(ambient) => AMBIENT.radiance.read(&ambient),
        None => Ok(*AMBIENT.radiance.default()),
    }
}
