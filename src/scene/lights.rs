//! Reads `[[light]]` and `[ambient]`.

use glam::DVec3;

use super::error::SceneError;
use super::reader::{Numbers, Table};
use crate::light::Light;

/// As many as the shadow masks have room for.
const MOST_LIGHTS: usize = 16;
const POWER: Numbers = Numbers::between(0.0, 1e9, "");
/// Where things and lights may stand.
pub const POSITION: Numbers = Numbers::between(-1e5, 1e5, "m");

#[derive(Clone, Copy)]
enum Kind {
    Point,
    Directional,
}

pub fn lights(root: &Table) -> Result<Vec<Light>, SceneError> {
    let tables = root.tables(
        "light",
        &["kind", "position_m", "intensity", "direction", "irradiance"],
    )?;
    if let Some(extra) = tables.get(MOST_LIGHTS) {
        return Err(extra.error(format!(
            "light: too many; allowed: up to {MOST_LIGHTS} lights"
        )));
    }
    tables.iter().map(light).collect()
}

fn light(table: &Table) -> Result<Light, SceneError> {
    let kinds = [("point", Kind::Point), ("directional", Kind::Directional)];
    let kind = table.required("kind", "\"point\" or \"directional\" is expected")?;
    match kind.one_of("kind of light", &kinds)? {
        Kind::Point => {
            table.allow(&["kind", "position_m", "intensity"])?;
            let position = table.required("position_m", "three numbers in metres are expected")?;
            let intensity = table.required(
                "intensity",
                "a number or three (W/sr, linear RGB) are expected",
            )?;
            Ok(Light::Point {
                position_m: DVec3::from_array(position.numbers(&POSITION)?),
                intensity: intensity.splat_or_vector(&POWER)?,
            })
        }
        Kind::Directional => {
            table.allow(&["kind", "direction", "irradiance"])?;
            let what = "three numbers are expected: the way that the light travels";
            let direction = table.required("direction", what)?;
            let written =
                DVec3::from_array(direction.numbers(&Numbers::between(f64::MIN, f64::MAX, ""))?);
            let unit = unit_direction(written);
            if unit == DVec3::ZERO {
                return Err(direction.error("no direction; allowed: any length but zero"));
            }
            let irradiance = table.required(
                "irradiance",
                "a number or three (W/m², linear RGB) are expected",
            )?;
            Ok(Light::Directional {
                direction: unit,
                irradiance: irradiance.splat_or_vector(&POWER)?,
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
    let Some(ambient) = root.table("ambient", &["radiance"])? else {
        return Ok(DVec3::ZERO);
    };
    ambient
        .optional("radiance")
        .map_or(Ok(DVec3::ZERO), |value| value.splat_or_vector(&POWER))
}
