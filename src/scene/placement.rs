//! Where things stand: keys that several tables have.

use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};

use super::error::SceneError;
use super::ranges::{Digits, Numbers};
use super::reader::Table;
use super::schema::key::Missing::Is;
use super::schema::values::Vectors;

/// Where things and lights may stand; written to 0.1 mm.
pub const POSITION: Numbers = Numbers::between(-1e5, 1e5)
    .unit("m")
    .digits(Digits::Decimals(4));
/// Angles of any number of turns; written to 0.01°.
pub const ANGLE: Numbers = Numbers::between(-1e6, 1e6)
    .unit("degrees")
    .digits(Digits::Decimals(2));
const SCALE: Numbers = Numbers::of_size(1e-6, 1e6);

keys! {
    /// Keys of whatever is placed.
    pub static PLACEMENT: PlacementKeys;

    /// Of the object's origin in the frame that it stands in.
    position_m: DVec3, Vectors::three(POSITION) => Is(DVec3::ZERO);
    /// Turns about x, then y, then z of that frame, counter-clockwise.
    rotation_deg: DVec3, Vectors::three(ANGLE) => Is(DVec3::ZERO);
    /// Before the turn.
    scale: DVec3, Vectors::one_or_three(SCALE) => Is(DVec3::ONE);
}

/// Where a thing stands, as a scene file says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Of the object's origin in the anchor's frame, metres.
    pub position_m: DVec3,
    /// Turns about x, then y, then z of that frame, degrees.
    pub rotation_deg: DVec3,
    /// Before the turn; negative mirrors, no component is 0.
    pub scale: DVec3,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            position_m: *PLACEMENT.position_m.default(),
            rotation_deg: *PLACEMENT.rotation_deg.default(),
            scale: *PLACEMENT.scale.default(),
        }
    }
}

impl Placement {
    /// Scale, then turn about x, then y, then z, then move.
    pub fn anchor_from_object(&self) -> DAffine3 {
        DAffine3 {
            matrix3: DMat3::from_quat(turn(self.rotation_deg)) * DMat3::from_diagonal(self.scale),
            translation: self.position_m,
        }
    }
}

/// The turn that `rotation_deg` means: about x, then y, then z.
pub fn turn(rotation_deg: DVec3) -> DQuat {
    let [x, y, z] = rotation_deg.to_array().map(f64::to_radians);
    DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
}

/// The turns about x, then y, then z that come to a rotation, degrees: what [`turn`] is the way back from.
pub fn turns_deg(rotation: &DMat3) -> DVec3 {
    let (z, y, x) = DQuat::from_mat3(rotation).to_euler(EulerRot::ZYX);
    DVec3::new(x, y, z).map(f64::to_degrees)
}

/// Reads it.
pub fn placement(table: &Table) -> Result<Placement, SceneError> {
    Ok(Placement {
        position_m: PLACEMENT.position_m.read(table)?,
        rotation_deg: PLACEMENT.rotation_deg.read(table)?,
        scale: PLACEMENT.scale.read(table)?,
    })
}
