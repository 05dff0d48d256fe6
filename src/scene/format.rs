//! The scene's format as a whole: its sections, and every entry by its name.

use std::sync::LazyLock;

use super::schema::section::Section;

pub use super::anchors::{
    ANCHOR_NAME, BOARD, BOARD_MARKER_SECTION, BOARD_SECTION, CENTER, MARKER, MARKER_SECTION,
    ON_BOARD, PRINTED,
};
pub use super::animation::{ANIMATION, AnimationKeys};
pub use super::camera::{CAMERA, CAMERA_SECTION};
pub use super::lights::{
    AMBIENT, AMBIENT_SECTION, DIRECTIONAL_LIGHT, LIGHT_SECTION, LIGHT_SECTIONS, LightKind,
    POINT_LIGHT, ShapeKnobs, light_keys, turn_shape,
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
pub static SECTIONS: LazyLock<Vec<&Section>> = LazyLock::new(|| {
    let before = [
        &CAMERA_SECTION,
        &TRACKING_SECTION,
        &BOARD_SECTION,
        &MARKER_SECTION,
        &PHANTOM_SECTION,
        &VIRTUAL_SECTION,
    ];
    let after = [
        &AMBIENT_SECTION,
        &TABLE_SECTION,
        &SHADOWS_SECTION,
        &ENVIRONMENT_SECTION,
        &PROBE_SECTION,
        &ROOM_SECTION,
    ];
    [&before[..], &LIGHT_SECTIONS, &after].concat()
});

/// The names of the sections, each once.
pub fn section_names() -> Vec<&'static str> {
    let mut names: Vec<&str> = SECTIONS.iter().map(|section| section.name).collect();
    names.dedup();
    names
}
