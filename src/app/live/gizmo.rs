//! Handles on what is selected, and what dragging one does, as geometry: what the pointer's ray meets.

use glam::{DVec2, DVec3};

use crate::app::authoring::{Edit, ThingPlace};
use crate::geometry::light_placing::PosedCamera;
use crate::light::Light;

/// Length of an arrow in the picture, pixels.
const ARROW_PX: f64 = 70.0;
/// A pointer this near to a handle has it, pixels.
const REACH_PX: f64 = 12.0;
/// Directions in which distant light travels are shown on a sphere of this radius around the world's origin, metres.
pub const SPHERE_M: f64 = 0.3;
/// Points of a ring.
const RING: usize = 48;

/// A handle that can be dragged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handle {
    /// Along x, y or z of the anchor.
    Axis(usize),
    /// In the plane across z.
    Plane,
    /// About z.
    Turn,
    /// Larger or smaller.
    Scale,
    /// On a sphere around the world's origin.
    Sphere,
}

/// The selected thing or light, in the numbers of the scene.
#[derive(Debug, Clone, PartialEq)]
pub enum GizmoTarget {
    /// A phantom or a virtual thing.
    Thing {
        /// Its name.
        name: String,
        /// Where it stands.
        place: ThingPlace,
    },
    /// A light.
    Light {
        /// Its place in the scene.
        index: usize,
        /// The light.
        light: Light,
    },
}

/// The handles of a target, as a camera sees them. The sight's world is the space of the target's anchor.
pub struct Gizmo<'a> {
    target: &'a GizmoTarget,
    sight: &'a PosedCamera,
    origin_m: DVec3,
    origin_px: DVec2,
    arrow_m: f64,
}

/// A handle that is held.
#[derive(Debug, Clone, PartialEq)]
pub struct Drag {
    handle: Handle,
    target: GizmoTarget,
    /// What the pointer's ray met first: a place in the anchor's space; for scale the distance in the picture, pixels.
    start: DVec3,
}

impl<'a> Gizmo<'a> {
    /// `None` where the target is behind the camera.
    pub fn new(target: &'a GizmoTarget, sight: &'a PosedCamera) -> Option<Self> {
        let origin_m = target.origin_m();
        let origin_px = sight.pixel(origin_m)?;
        let depth_m = sight.camera_from_world.transform_point3(origin_m).z;
        Some(Self {
            target,
            sight,
            origin_m,
            origin_px,
            arrow_m: ARROW_PX * depth_m / sight.intrinsics.focal_px.x,
        })
    }

    /// Where the target itself is in the picture.
    pub fn origin_px(&self) -> DVec2 {
        self.origin_px
    }

    /// The handles that there are, each as a line in the picture.
    pub fn handles(&self) -> Vec<(Handle, Vec<DVec2>)> {
        let all: &[Handle] = match self.target {
            GizmoTarget::Thing {
                place: ThingPlace::TableTop { .. },
                ..
            } => &[Handle::Axis(2)],
            GizmoTarget::Thing { .. } => &[
                Handle::Axis(0),
                Handle::Axis(1),
                Handle::Axis(2),
                Handle::Plane,
                Handle::Turn,
                Handle::Scale,
            ],
            GizmoTarget::Light {
                light: Light::Point { .. },
                ..
            } => &[
                Handle::Axis(0),
                Handle::Axis(1),
                Handle::Axis(2),
                Handle::Plane,
                Handle::Sphere,
            ],
            GizmoTarget::Light { .. } => &[Handle::Sphere],
        };
        all.iter()
            .filter_map(|&handle| {
                let line: Option<Vec<DVec2>> = self
                    .line_m(handle)
                    .into_iter()
                    .map(|point_m| self.sight.pixel(point_m))
                    .collect();
                Some((handle, line?))
            })
            .collect()
    }

    /// Takes the handle under the pointer, if any.
    pub fn grab(&self, pointer_px: DVec2) -> Option<Drag> {
        let distance = |line: &[DVec2]| {
            let ends = line.windows(2);
            let to_edge = |ends: &[DVec2]| distance_to_segment(pointer_px, ends[0], ends[1]);
            let single = line.first().map(|point| point.distance(pointer_px));
            ends.map(to_edge)
                .chain(single)
                .fold(f64::INFINITY, f64::min)
        };
        // Arrows begin at the middle, which is others'.
        let off_middle = |line: &[DVec2]| match line {
            [from, to] => distance_to_segment(pointer_px, from.lerp(*to, 0.35), *to),
            _ => distance(line),
        };
        let handles = self.handles();
        let (handle, _) = handles
            .iter()
            .map(|(handle, line)| (*handle, off_middle(line)))
            .filter(|(_, off_px)| *off_px <= REACH_PX)
            .min_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let start = place(handle, self.target, self.sight, pointer_px)?;
        Some(Drag {
            handle,
            target: self.target.clone(),
            start,
        })
    }

    fn line_m(&self, handle: Handle) -> Vec<DVec3> {
        let (origin_m, length_m) = (self.origin_m, self.arrow_m);
        match handle {
            Handle::Axis(axis) => vec![origin_m, origin_m + length_m * DVec3::AXES[axis]],
            Handle::Plane => {
                let corner = |x: f64, y: f64| origin_m + 0.32 * length_m * DVec3::new(x, y, 0.0);
                vec![
                    corner(0.35, 0.35),
                    corner(1.0, 0.35),
                    corner(1.0, 1.0),
                    corner(0.35, 1.0),
                    corner(0.35, 0.35),
                ]
            }
            Handle::Turn => (0..=RING)
                .map(|step| {
                    let angle = std::f64::consts::TAU * step as f64 / RING as f64;
                    origin_m + 0.75 * length_m * DVec3::new(angle.cos(), angle.sin(), 0.0)
                })
                .collect(),
            Handle::Scale => {
                vec![origin_m - 0.6 * length_m * DVec3::new(1.0, 1.0, 0.0).normalize()]
            }
            Handle::Sphere => vec![origin_m],
        }
    }
}

impl GizmoTarget {
    fn origin_m(&self) -> DVec3 {
        match self {
            Self::Thing { place, .. } => place.placement().position_m,
            Self::Light { light, .. } => light_place_m(light),
        }
    }
}

/// Where a light is shown, in the world.
pub fn light_place_m(light: &Light) -> DVec3 {
    match light {
        Light::Point { position_m, .. } => *position_m,
        Light::Directional { direction, .. } => -SPHERE_M * *direction,
    }
}

impl Drag {
    /// What the pointer makes of the target now; `None` where its ray meets nothing.
    pub fn edit(&self, sight: &PosedCamera, pointer_px: DVec2) -> Option<Edit> {
        let here = place(self.handle, &self.target, sight, pointer_px)?;
        Some(match &self.target {
            GizmoTarget::Thing { name, place } => {
                let mut placement = place.placement();
                match self.handle {
                    Handle::Axis(_) | Handle::Plane => placement.position_m += here - self.start,
                    Handle::Turn => {
                        let angle = |point: DVec3| {
                            let arm = point - self.target.origin_m();
                            arm.y.atan2(arm.x)
                        };
                        let turned_deg = (angle(here) - angle(self.start)).to_degrees();
                        let z_deg = placement.rotation_deg.z + turned_deg;
                        placement.rotation_deg.z = (z_deg + 180.0).rem_euclid(360.0) - 180.0;
                    }
                    Handle::Scale => {
                        placement.scale *= (here.x / self.start.x).clamp(0.01, 100.0);
                    }
                    Handle::Sphere => return None,
                }
                Edit::Place {
                    thing: name.clone(),
                    placement,
                }
            }
            GizmoTarget::Light { index, light } => {
                let mut light = *light;
                match (&mut light, self.handle) {
                    (Light::Point { position_m, .. }, Handle::Sphere) => *position_m = here,
                    (Light::Point { position_m, .. }, _) => *position_m += here - self.start,
                    (Light::Directional { direction, .. }, _) => *direction = -here.normalize(),
                }
                Edit::Light {
                    index: *index,
                    light,
                }
            }
        })
    }
}

/// Where a pointer's ray meets what a handle moves along.
fn place(
    handle: Handle,
    target: &GizmoTarget,
    sight: &PosedCamera,
    pointer_px: DVec2,
) -> Option<DVec3> {
    let origin_m = target.origin_m();
    let (eye_m, direction) = sight.ray(pointer_px);
    match handle {
        Handle::Axis(axis) => {
            let axis = DVec3::AXES[axis];
            // The point of the axis that is nearest to the ray.
            let between = origin_m - eye_m;
            let along = axis.dot(direction);
            let denominator = 1.0 - along * along;
            (denominator > 1e-4).then(|| {
                let t = (along * direction.dot(between) - axis.dot(between)) / denominator;
                origin_m + t * axis
            })
        }
        Handle::Plane | Handle::Turn => {
            let t = (origin_m.z - eye_m.z) / direction.z;
            // Towards the horizon a pixel would be metres.
            (direction.z.abs() > 0.03 && t > 0.0).then(|| eye_m + t * direction)
        }
        Handle::Scale => {
            let origin_px = sight.pixel(origin_m)?;
            Some(DVec3::X * pointer_px.distance(origin_px).max(1.0))
        }
        Handle::Sphere => {
            let radius_m = origin_m.length();
            let nearest = -eye_m.dot(direction);
            let off_m = (eye_m + nearest * direction).length();
            let reach_m = (radius_m * radius_m - off_m * off_m).max(0.0).sqrt();
            // Of the two places on the ray the one on the side where the target is now.
            let places = [nearest - reach_m, nearest + reach_m].map(|t| eye_m + t * direction);
            let near = |place: &DVec3| (*place - origin_m).length();
            let place = match near(&places[0]) <= near(&places[1]) {
                true => places[0],
                false => places[1],
            };
            // A light under the table would light nothing.
            let place = place.with_z(place.z.max(0.0));
            (place.length() > 1e-9).then(|| place.normalize() * radius_m)
        }
    }
}

fn distance_to_segment(point: DVec2, from: DVec2, to: DVec2) -> f64 {
    let along = to - from;
    let t = ((point - from).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    (from + t * along).distance(point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::{Distortion, Intrinsics};
    use crate::light::Shape;
    use crate::scene::Placement;
    use glam::{DAffine3, DMat3};

    /// A camera 0.8 m away that looks down on the origin from the front.
    fn sight() -> PosedCamera {
        let eye_m = DVec3::new(0.1, -0.6, 0.5);
        let forward = -eye_m.normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let world_from_camera = DAffine3 {
            matrix3: DMat3::from_cols(right, forward.cross(right), forward),
            translation: eye_m,
        };
        PosedCamera {
            intrinsics: Intrinsics {
                size_px: [640, 480],
                focal_px: DVec2::splat(600.0),
                center_px: DVec2::new(319.5, 239.5),
                distortion: Distortion::NONE,
            },
            camera_from_world: world_from_camera.inverse(),
        }
    }

    fn thing() -> GizmoTarget {
        GizmoTarget::Thing {
            name: "torus".to_owned(),
            place: ThingPlace::Free(Placement {
                position_m: DVec3::new(0.02, 0.03, 0.04),
                rotation_deg: DVec3::new(70.0, 0.0, 170.0),
                scale: DVec3::splat(2.0),
            }),
        }
    }

    fn dragged(target: &GizmoTarget, handle: Handle, to_m: DVec3) -> Edit {
        let sight = sight();
        let gizmo = Gizmo::new(target, &sight).unwrap();
        let handles = gizmo.handles();
        let (_, line) = handles.iter().find(|(found, _)| *found == handle).unwrap();
        let grabbed_px = line[line.len() / 2];
        let start = place(handle, target, &sight, grabbed_px).unwrap();
        let drag = Drag {
            handle,
            target: target.clone(),
            start,
        };
        drag.edit(&sight, sight.pixel(start + to_m).unwrap())
            .unwrap()
    }

    #[test]
    fn a_thing_follows_the_pointer_along_its_handle() {
        for (handle, moved_m) in [
            (Handle::Axis(0), DVec3::new(0.05, 0.0, 0.0)),
            (Handle::Axis(1), DVec3::new(0.0, -0.04, 0.0)),
            (Handle::Axis(2), DVec3::new(0.0, 0.0, 0.03)),
            (Handle::Plane, DVec3::new(-0.03, 0.02, 0.0)),
        ] {
            let Edit::Place { thing, placement } = dragged(&thing(), handle, moved_m) else {
                panic!("no placement");
            };
            assert_eq!(thing, "torus");
            let expected_m = DVec3::new(0.02, 0.03, 0.04) + moved_m;
            assert!(
                placement.position_m.abs_diff_eq(expected_m, 1e-9),
                "{handle:?}: {placement:?}"
            );
            assert_eq!(placement.scale, DVec3::splat(2.0));
        }
    }

    #[test]
    fn turning_and_scaling_stay_in_range() {
        let target = thing();
        let sight = sight();
        let origin_m = target.origin_m();
        let drag = Drag {
            handle: Handle::Turn,
            target: target.clone(),
            start: origin_m + DVec3::X * 0.1,
        };
        let quarter_px = sight.pixel(origin_m + DVec3::Y * 0.07).unwrap();
        let Some(Edit::Place { placement, .. }) = drag.edit(&sight, quarter_px) else {
            panic!("no placement");
        };
        assert!(
            (placement.rotation_deg.z - -100.0).abs() < 1e-9,
            "{placement:?}"
        );
        let drag = Drag {
            handle: Handle::Scale,
            target: target.clone(),
            start: DVec3::X * 40.0,
        };
        let far_px = sight.pixel(origin_m).unwrap() + DVec2::new(0.0, 60.0);
        let Some(Edit::Place { placement, .. }) = drag.edit(&sight, far_px) else {
            panic!("no placement");
        };
        assert!(placement.scale.abs_diff_eq(DVec3::splat(3.0), 1e-9));
    }

    #[test]
    fn lights_move_on_their_sphere_and_stay_above_the_table() {
        let position_m = DVec3::new(-0.26, 0.24, 0.46);
        let light = Light::Point {
            position_m,
            intensity: DVec3::ONE,
            shape: Shape::Point,
        };
        let target = GizmoTarget::Light { index: 1, light };
        let sight = sight();
        let start = position_m;
        let drag = Drag {
            handle: Handle::Sphere,
            target,
            start,
        };
        for pointer_px in [
            DVec2::new(100.0, 20.0),
            DVec2::new(600.0, 470.0),
            DVec2::splat(-900.0),
        ] {
            let Some(Edit::Light {
                index: 1,
                light:
                    Light::Point {
                        position_m: moved_m,
                        ..
                    },
            }) = drag.edit(&sight, pointer_px)
            else {
                panic!("no light");
            };
            assert!((moved_m.length() - position_m.length()).abs() < 1e-9);
            assert!(moved_m.z >= 0.0);
        }
        let target = GizmoTarget::Light {
            index: 0,
            light: Light::Directional {
                direction: DVec3::NEG_Z,
                irradiance: DVec3::ONE,
                angle_rad: 0.0,
            },
        };
        let gizmo = Gizmo::new(&target, &sight).unwrap();
        let drag = gizmo.grab(gizmo.origin_px()).unwrap();
        let to_m = DVec3::new(0.2, 0.0, 0.05).normalize() * SPHERE_M;
        let Some(Edit::Light {
            light: Light::Directional { direction, .. },
            ..
        }) = drag.edit(&sight, sight.pixel(to_m).unwrap())
        else {
            panic!("no light");
        };
        assert!((direction.length() - 1.0).abs() < 1e-12);
        assert!(direction.x < -0.5, "it comes from the right: {direction}");
    }

    #[test]
    fn the_nearest_handle_is_taken_and_none_from_afar() {
        let (target, sight) = (thing(), sight());
        let gizmo = Gizmo::new(&target, &sight).unwrap();
        for (handle, line) in gizmo.handles() {
            // The end of an arrow, a point of the ring away from the arrows, a corner.
            let at = match handle {
                Handle::Turn => line[RING * 5 / 16],
                _ => line[line.len() / 2],
            };
            assert_eq!(gizmo.grab(at).unwrap().handle, handle);
        }
        assert!(
            gizmo
                .grab(gizmo.origin_px() + DVec2::new(300.0, 0.0))
                .is_none()
        );
    }

    #[test]
    fn the_table_s_top_is_moved_up_and_down_alone() {
        let target = GizmoTarget::Thing {
            name: "table".to_owned(),
            place: ThingPlace::TableTop { height_m: 0.02 },
        };
        let sight = sight();
        let gizmo = Gizmo::new(&target, &sight).unwrap();
        let handles: Vec<Handle> = gizmo.handles().iter().map(|(handle, _)| *handle).collect();
        assert_eq!(handles, [Handle::Axis(2)]);
        let Edit::Place { placement, .. } = dragged(&target, Handle::Axis(2), DVec3::Z * 0.01)
        else {
            panic!("no place");
        };
        let DVec3 { x, y, z } = placement.position_m;
        assert!(
            x == 0.0 && y == 0.0 && (z - 0.03).abs() < 1e-4,
            "{placement:?}"
        );
    }
}
