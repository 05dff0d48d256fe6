//! The scene's format as a whole: its sections, and every entry by its name.

use super::schema::section::Section;

pub use super::anchors::{
    ANCHOR_NAME, BOARD, BOARD_MARKER_SECTION, BOARD_SECTION, CENTER, MARKER, MARKER_SECTION,
    ON_BOARD, PRINTED,
};
pub use super::animation::{ANIMATION, AnimationKeys};
pub use super::camera::{CAMERA, CAMERA_SECTION};
pub use super::lights::{
    AIMED_LIGHT, AMBIENT, AMBIENT_SECTION, DIRECTIONAL_LIGHT, DIRECTIONAL_LIGHT_SECTION, LIGHT,
    LIGHT_SECTION, LightKind, POINT_LIGHT, POINT_LIGHT_SECTION, RECT_LIGHT, RECT_LIGHT_SECTION,
    SPHERE_LIGHT, SPHERE_LIGHT_SECTION, SPOT_LIGHT, SPOT_LIGHT_SECTION,
};
pub use super::motion::{MOTION, STATION, STATION_SECTION};
pub use super::objects::{
    MATERIAL, MATERIAL_SECTION, PHANTOM_SECTION, STANDING, TABLE, TABLE_SECTION, THING, THING_NAME,
    VIRTUAL, VIRTUAL_SECTION,
};
pub use super::placement::{PLACEMENT, PlacementKeys};
pub use super::probe::{PROBE, PROBE_SECTION, ROOM, ROOM_SECTION, ROOM_SURFACE};
pub use super::schema::section::AnyKey;
pub use super::shadows::{
    DIFFERENCE, ENVIRONMENT, ENVIRONMENT_SECTION, SHADOWS, SHADOWS_SECTION, SHAFTS,
};
pub use super::shapes::{PRISM, PRISM_SECTION, REVOLVED, REVOLVED_SECTION, SHAPE, ShapeKeys};
pub use super::tracking::{TRACKING, TRACKING_SECTION};

/// What may stand at the outermost level, in the reference's order; a light of each kind.
pub const SECTIONS: [&Section; 17] = [
    &CAMERA_SECTION,
    &TRACKING_SECTION,
    &BOARD_SECTION,
    &MARKER_SECTION,
    &PHANTOM_SECTION,
    &VIRTUAL_SECTION,
    &POINT_LIGHT_SECTION,
    &DIRECTIONAL_LIGHT_SECTION,
    &SPOT_LIGHT_SECTION,
    &SPHERE_LIGHT_SECTION,
    &RECT_LIGHT_SECTION,
    &AMBIENT_SECTION,
    &TABLE_SECTION,
    &SHADOWS_SECTION,
    &ENVIRONMENT_SECTION,
    &PROBE_SECTION,
    &ROOM_SECTION,
];

/// The names of the sections, each once.
pub fn section_names() -> Vec<&'static str> {
    let mut names: Vec<&str> = SECTIONS.iter().map(|section| section.name).collect();
    names.dedup();
    names
}
