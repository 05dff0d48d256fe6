//! What lies over the picture: outlines, axes, lights, shadow edges and the handles of what is selected.

use std::borrow::Cow;

use eframe::egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Shape, Stroke, Vec2};
use glam::{DAffine3, DVec2, DVec3};

use super::command::Overlay;
use super::frame_tracker::TrackedPicture;
use super::gizmo::{Gizmo, GizmoTarget, Handle, light_place_m};
use super::selected_outline::SelectedOutline;
use super::shadow_clicks::ShadowClicks;
use super::shadow_lines::ShadowLines;
use super::views::ViewMode;
use super::window_state::WindowState;
use crate::app::window::fit::PictureFit;
use crate::geometry::light_placing::PosedCamera;
use crate::scene::Scene;
use crate::tracking::{Quad, Status};

const AXIS_COLOURS: [Color32; 3] = [
    Color32::from_rgb(230, 70, 60),
    Color32::from_rgb(90, 190, 70),
    Color32::from_rgb(70, 130, 240),
];
const SEEN: Color32 = Color32::from_rgb(80, 220, 120);
const REJECTED: Color32 = Color32::from_rgb(240, 130, 40);
const LIGHT: Color32 = Color32::from_rgb(255, 225, 120);
const REAL_EDGE: Color32 = Color32::from_rgb(90, 200, 255);
const VIRTUAL_EDGE: Color32 = Color32::from_rgb(255, 120, 200);
const GRIP: Color32 = Color32::from_rgb(255, 255, 255);

/// Marks drawn over a picture.
pub struct Overlays<'a> {
    /// Into the picture's place.
    pub painter: &'a Painter,
    /// Where that is.
    pub fit: PictureFit,
    /// What is seen there.
    pub picture: &'a TrackedPicture,
}

impl Overlays<'_> {
    /// Everything that `state` wants, without handles.
    pub fn draw(&self, state: &WindowState, scene: Option<&Scene>, shadow_lines: &mut ShadowLines) {
        if state.shows(Overlay::Rejected) {
            for quad in &self.picture.rejected {
                self.outline(quad, Stroke::new(1.0, REJECTED));
            }
        }
        if state.shows(Overlay::Outlines) {
            self.markers();
        }
        if let Some(scene) = scene {
            if matches!(state.view, ViewMode::Silhouettes | ViewMode::Volumes) {
                self.shadow_lines(scene, shadow_lines, state.view == ViewMode::Volumes);
            }
            if state.shows(Overlay::Lights) {
                self.lights(scene);
            }
        }
        if state.shows(Overlay::Axes) {
            self.axes();
        }
    }

    /// Markers that were seen, with their numbers.
    pub fn markers(&self) {
        for seen in &self.picture.detections {
            self.outline(&seen.corners_px, Stroke::new(2.0, SEEN));
            let middle = seen.corners_px.iter().sum::<DVec2>() / 4.0;
            let Some(place) = self.place_of_distorted(middle) else {
                continue;
            };
            self.label_on_ground(place, &seen.id.to_string(), SEEN);
        }
    }

    /// The outline of a thing.
    pub fn selected(&self, scene: &Scene, name: &str, outline: &mut SelectedOutline) {
        let mut things = scene.phantoms.iter().chain(&scene.virtuals);
        let thing = things.find(|thing| thing.name == name && thing.visible);
        let camera_from_node = self.picture.camera_from_nodes(scene);
        let placed = thing.and_then(|thing| Some((thing, camera_from_node[thing.anchor]?)));
        let Some((thing, camera_from_anchor)) = placed else {
            return;
        };
        let mut thing = Cow::Borrowed(thing);
        if thing.animation.is_some() {
            thing.to_mut().take_shape(self.picture.frame.time_secs);
        }
        for edge_m in outline.edges_m(&thing, &camera_from_anchor) {
            if let [Some(a), Some(b)] = edge_m.map(|end| self.place(&camera_from_anchor, end)) {
                self.painter.line_segment([a, b], Stroke::new(2.0, GRIP));
            }
        }
    }

    /// The handles of what is selected.
    pub fn handles(&self, target: &GizmoTarget, sight: &PosedCamera) {
        let Some(gizmo) = Gizmo::new(target, sight) else {
            return;
        };
        let origin = self.fit.place_of(gizmo.origin_px());
        self.painter.circle_filled(origin, 3.0, GRIP);
        for (handle, line) in gizmo.handles() {
            let points: Vec<Pos2> = line.iter().map(|&pixel| self.fit.place_of(pixel)).collect();
            let colour = match handle {
                Handle::Axis(axis) => AXIS_COLOURS[axis],
                Handle::Plane | Handle::Turn => GRIP,
                Handle::Scale => Color32::from_rgb(250, 200, 60),
                Handle::Sphere => LIGHT,
            };
            match (handle, points[..].as_ref()) {
                (Handle::Axis(_), [from, to]) => {
                    self.painter
                        .arrow(*from, *to - *from, Stroke::new(2.5, colour));
                }
                (_, [point]) => {
                    let size = Vec2::splat(9.0);
                    let square = Rect::from_center_size(*point, size);
                    match handle {
                        Handle::Sphere => _ = self.painter.circle_filled(*point, 6.0, colour),
                        _ => _ = self.painter.rect_filled(square, 1.0, colour),
                    }
                }
                _ => {
                    _ = self
                        .painter
                        .add(Shape::line(points, Stroke::new(2.0, colour)))
                }
            }
        }
    }

    /// Corners of real things and the shadows that were clicked.
    pub fn clicks(&self, clicks: &ShadowClicks) {
        let stroke = Stroke::new(2.0, LIGHT);
        for pair in clicks.pairs_px() {
            let [vertex, shadow] = pair.map(|pixel| self.fit.place_of(pixel));
            self.painter.line_segment([vertex, shadow], stroke);
            self.painter.circle_filled(vertex, 4.0, LIGHT);
            self.painter.circle_stroke(shadow, 5.0, stroke);
        }
        if let Some(vertex) = clicks.vertex() {
            let place = self.fit.place_of(vertex.pixel);
            self.painter.circle_filled(place, 5.0, LIGHT);
            self.label(place - Vec2::new(0.0, 16.0), &vertex.phantom, LIGHT);
        }
    }

    fn axes(&self) {
        let anchors = self.picture.anchors.iter().zip(&self.picture.poses);
        for (anchor, pose) in anchors {
            let Some(camera_from_anchor) = pose.camera_from_anchor else {
                continue;
            };
            let length_m = anchor.markers.first().map_or(0.05, |marker| marker.size_m);
            let place = |point_m| self.place(&camera_from_anchor, point_m);
            let Some(origin) = place(DVec3::ZERO) else {
                continue;
            };
            for (axis, colour) in DVec3::AXES.into_iter().zip(AXIS_COLOURS) {
                if let Some(tip) = place(axis * length_m) {
                    self.painter
                        .arrow(origin, tip - origin, Stroke::new(2.0, colour));
                }
            }
            let colour = match pose.status {
                Status::Tracked => SEEN,
                Status::Predicted | Status::Ambiguous | Status::Lost => REJECTED,
            };
            self.label(origin + Vec2::new(0.0, 14.0), &anchor.name, colour);
        }
    }

    fn lights(&self, scene: &Scene) {
        for (index, light) in scene.lights.iter().enumerate() {
            let pose = self.picture.poses.get(light.anchor);
            let Some(camera_from_anchor) = pose.and_then(|pose| pose.camera_from_anchor) else {
                continue;
            };
            let at_m = light_place_m(&light.light);
            let foot_m = at_m.with_z(0.0);
            let Some(place) = self.place(&camera_from_anchor, at_m) else {
                continue;
            };
            if let Some(foot) = self.place(&camera_from_anchor, foot_m) {
                let stroke = Stroke::new(1.0, LIGHT.gamma_multiply(0.6));
                self.painter
                    .extend(Shape::dashed_line(&[place, foot], stroke, 5.0, 4.0));
            }
            self.painter.circle_filled(place, 7.0, LIGHT);
            self.painter
                .circle_stroke(place, 8.0, Stroke::new(1.5, Color32::BLACK));
            self.label(
                place + Vec2::new(0.0, 18.0),
                &format!("light {index}"),
                LIGHT,
            );
        }
    }

    fn shadow_lines(&self, scene: &Scene, lines: &mut ShadowLines, with_sides: bool) {
        let camera_from_node = self.picture.camera_from_nodes(scene);
        let Some(camera_from_world) = camera_from_node.first().copied().flatten() else {
            return;
        };
        let world_from_camera = camera_from_world.inverse();
        let world_from_anchor: Vec<Option<DAffine3>> = camera_from_node
            .iter()
            .map(|pose| pose.map(|camera_from_node| world_from_camera * camera_from_node))
            .collect();
        let scene = scene.shaped_at(self.picture.frame.time_secs);
        for line in lines.lines(&scene, &world_from_anchor) {
            let Some(camera_from_anchor) = camera_from_node[line.anchor] else {
                continue;
            };
            let colour = match line.is_virtual {
                true => VIRTUAL_EDGE,
                false => REAL_EDGE,
            };
            let place = |point_m| self.place(&camera_from_anchor, point_m);
            let [Some(a), Some(b)] = line.edge_m.map(place) else {
                continue;
            };
            if let (true, [Some(far_a), Some(far_b)]) = (with_sides, line.shadow_m.map(place)) {
                let fill = colour.gamma_multiply(0.12);
                let side = vec![a, b, far_b, far_a];
                self.painter
                    .add(Shape::convex_polygon(side, fill, Stroke::NONE));
                let stroke = Stroke::new(1.0, colour.gamma_multiply(0.5));
                self.painter.line_segment([far_a, far_b], stroke);
            }
            self.painter.line_segment([a, b], Stroke::new(2.0, colour));
        }
    }

    fn outline(&self, quad: &Quad, stroke: Stroke) {
        let points: Option<Vec<Pos2>> = quad.iter().map(|&c| self.place_of_distorted(c)).collect();
        if let Some(points) = points {
            self.painter.add(Shape::closed_line(points, stroke));
        }
    }

    /// A label that is read on a marker's pattern, too.
    fn label_on_ground(&self, place: Pos2, text: &str, colour: Color32) {
        let font = FontId::proportional(14.0);
        let galley = self.painter.layout_no_wrap(text.to_owned(), font, colour);
        let ground = Rect::from_center_size(place, galley.size() + Vec2::new(8.0, 2.0));
        let dark = Color32::from_black_alpha(200);
        self.painter.rect_filled(ground, 3.0, dark);
        let corner = place - galley.size() / 2.0;
        self.painter.galley(corner, galley, colour);
    }

    fn label(&self, place: Pos2, text: &str, colour: Color32) {
        let font = FontId::proportional(14.0);
        for offset in [Vec2::new(1.0, 1.0), Vec2::new(-1.0, 0.0)] {
            let behind = place + offset;
            self.painter.text(
                behind,
                Align2::CENTER_CENTER,
                text,
                font.clone(),
                Color32::BLACK,
            );
        }
        self.painter
            .text(place, Align2::CENTER_CENTER, text, font, colour);
    }

    /// The picture is shown without distortion, markers are found with it.
    fn place_of_distorted(&self, pixel: DVec2) -> Option<Pos2> {
        let undistorted_px = self.picture.intrinsics.undistorted_pixel(pixel)?;
        Some(self.fit.place_of(undistorted_px))
    }

    fn place(&self, camera_from_anchor: &DAffine3, point_m: DVec3) -> Option<Pos2> {
        let sight = PosedCamera {
            intrinsics: self.picture.intrinsics,
            camera_from_world: *camera_from_anchor,
        };
        sight.pixel(point_m).map(|pixel| self.fit.place_of(pixel))
    }
}
