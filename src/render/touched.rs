//! Where in the picture virtual things and their shadows can be: the passes leave the rest alone.

use glam::{DAffine3, DVec3};

use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::{self, Bounds, PixelRect};
use crate::geometry::shadow_volume::LightPlace;
use crate::light::Light;

use super::anchor_geometry::{Extent, Role};

/// The pixels that virtual things and their shadows can reach; `None` if there are none.
pub(super) fn touched_by_virtual(
    extents: &[Extent],
    lights: &[Light],
    camera_from_anchor: &[Option<DAffine3>],
    intrinsics: &Intrinsics,
) -> Option<PixelRect> {
    let camera_from_world = (*camera_from_anchor.first()?)?;
    let world_from_camera = camera_from_world.inverse();
    let corners_in_world = |extent: &Extent| {
        let world_from_anchor = world_from_camera * camera_from_anchor[extent.anchor]?;
        Some(
            extent
                .bounds
                .corners()
                .map(|corner| world_from_anchor.transform_point3(corner)),
        )
    };
    let placed: Vec<(&Extent, [DVec3; 8])> = extents
        .iter()
        .filter_map(|extent| Some((extent, corners_in_world(extent)?)))
        .collect();
    let receivers = Bounds::around(placed.iter().flat_map(|(_, corners)| *corners))?;
    let mut touched = PixelRect {
        low: [0; 2],
        high: [0; 2],
    };
    for (extent, corners) in placed
        .iter()
        .filter(|(extent, _)| extent.role == Role::Virtual)
    {
        touched = touched.union(reach::covered(corners, &camera_from_world, intrinsics));
        for light in lights.iter().filter(|_| extent.casts) {
            let light = light_place(light, &DAffine3::IDENTITY);
            touched = touched.union(reach::shadowed(
                corners,
                light,
                &receivers,
                &camera_from_world,
                intrinsics,
            ));
        }
    }
    (!touched.is_empty()).then_some(touched)
}

/// A light as its shadow volumes see it from an anchor.
pub(super) fn light_place(light: &Light, anchor_from_world: &DAffine3) -> LightPlace {
    match *light {
        Light::Point { position_m, .. } => {
            LightPlace::Point(anchor_from_world.transform_point3(position_m))
        }
        Light::Directional { direction, .. } => {
            LightPlace::Along(anchor_from_world.transform_vector3(direction))
        }
    }
}
