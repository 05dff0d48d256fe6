//! The window: the camera's picture, the target in it, where it has not yet been, and what to do.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Result, anyhow};
use eframe::egui::{
    Align2, CentralPanel, Color32, ColorImage, Context, FontId, Frame, Key, Painter, Pos2, Rect,
    Shape, Stroke, TextureHandle, TextureOptions, Ui, Vec2, ViewportCommand,
};

use super::Held;
use super::advice::{advice, balance, refusal};
use super::watcher::{ViewsStanding, Watcher, WatcherOrder};
use crate::app::window::ContextWaker;
use crate::app::window::fit::PictureFit;
use crate::app::window::lasting::Content;
use crate::app::window::notices::{CameraState, Notices, Weight};
use crate::calibration::{Coverage, Moment, Target};
use crate::capture::live::Now;
use crate::render::Gpu;

/// The window looks at the world at least this often, even when no picture comes.
const PULSE: Duration = Duration::from_millis(200);
/// Where a corner was never seen.
const LACKING: Color32 = Color32::from_rgba_premultiplied(66, 24, 16, 66);
const TAKEN: Color32 = Color32::from_rgb(90, 220, 110);
const MOVES: Color32 = Color32::from_rgb(250, 200, 60);
const KNOWN: Color32 = Color32::from_rgb(120, 190, 250);
const TROUBLE: Color32 = Color32::from_rgb(255, 190, 90);
/// Around lines of text, points.
const MARGIN: f32 = 8.0;
const KEYS: &str = "Space take · Backspace drop the last · Enter finish · Esc give up";

/// The end of a calibration window.
pub enum Ending {
    /// There are views to calibrate with.
    Enough(Box<Held>),
    /// Somebody gave up.
    GivenUp,
    /// It could not go on.
    Failed(anyhow::Error),
}

/// The state of a calibration window.
pub struct CalibrationWindow {
    /// `None` once it has ended.
    watcher: Option<Watcher>,
    target: Target,
    picture: Option<(TextureHandle, [u32; 2])>,
    standing: Option<ViewsStanding>,
    notices: Notices,
    now: Now,
    shared: Shown,
}

/// What the window and whoever opened it share.
pub struct Shown {
    /// Closes the window.
    pub stop: Arc<AtomicBool>,
    /// How it ended.
    pub ending: Arc<Mutex<Option<Ending>>>,
    /// Wakes the window.
    pub waker: ContextWaker,
}

impl CalibrationWindow {
    /// A window on a camera.
    pub fn new(watcher: Watcher, target: Target, now: Now, shared: Shown) -> Self {
        Self {
            watcher: Some(watcher),
            target,
            picture: None,
            standing: None,
            notices: Notices::new(),
            now,
            shared,
        }
    }

    fn end(&mut self, ctx: &Context, ending: Ending) {
        let ending_of_window = &self.shared.ending;
        let mut place = ending_of_window
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        place.get_or_insert(ending);
        ctx.send_viewport_cmd(ViewportCommand::Close);
    }

    /// Takes what the threads have.
    fn step(&mut self, ctx: &Context) {
        let Some(watcher) = &self.watcher else {
            return;
        };
        let now_secs = (self.now)();
        while let Some(event) = watcher.next_event() {
            self.notices.take(now_secs, &event);
        }
        if let Some(frame) = watcher.frame() {
            let size = frame.size_px.map(|side| side as usize);
            let image = ColorImage::from_rgba_unmultiplied(size, &frame.rgba);
            match &mut self.picture {
                Some((texture, size_px)) => {
                    texture.set(image, TextureOptions::LINEAR);
                    *size_px = frame.size_px;
                }
                None => {
                    let texture = ctx.load_texture("camera", image, TextureOptions::LINEAR);
                    self.picture = Some((texture, frame.size_px));
                }
            }
        }
        if let Some(standing) = watcher.standing() {
            self.notices.tracking = standing.passed_over.map(|[width, height]| {
                format!("the camera sends {width} x {height} now; a calibration is for one size")
            });
            self.standing = Some(standing);
        }
        if watcher.has_failed() {
            self.finish(ctx);
        } else if let CameraState::Failed(reason) = &self.notices.camera {
            let error = anyhow!("{reason}");
            self.end(ctx, Ending::Failed(error));
        }
    }

    fn finish(&mut self, ctx: &Context) {
        if let Some(watcher) = self.watcher.take() {
            let ending = match watcher.finish() {
                Ok(held) => Ending::Enough(Box::new(held)),
                Err(error) => Ending::Failed(error),
            };
            self.end(ctx, ending);
        }
    }

    fn keys(&mut self, ctx: &Context) {
        let pressed = |key| ctx.input(|input| input.key_pressed(key));
        if pressed(Key::Escape) {
            self.end(ctx, Ending::GivenUp);
        }
        if pressed(Key::Enter) {
            match refusal(self.standing.as_ref()) {
                None => self.finish(ctx),
                Some(reason) => self.notices.tell((self.now)(), Weight::Trouble, reason),
            }
        }
        if let Some(watcher) = &self.watcher {
            if pressed(Key::Space) {
                watcher.order(WatcherOrder::Take);
            }
            if pressed(Key::Backspace) {
                watcher.order(WatcherOrder::DropLast);
            }
        }
    }

    fn show(&self, ui: &Ui) {
        let area = ui.max_rect();
        let painter = ui.painter();
        let Some((texture, size_px)) = &self.picture else {
            let text = "Waiting for the first picture …";
            let font = FontId::proportional(18.0);
            painter.text(
                area.center(),
                Align2::CENTER_CENTER,
                text,
                font,
                Color32::LIGHT_GRAY,
            );
            return;
        };
        let (says, balance) = match &self.standing {
            Some(standing) => (advice(standing, &self.target), balance(standing)),
            None => Default::default(),
        };
        let foot = painter.layout(
            format!("{balance}\n{KEYS}"),
            FontId::proportional(14.0),
            Color32::WHITE,
            text_width(area),
        );
        let foot_top = area.bottom() - foot.size().y - 2.0 * MARGIN;
        let foot_at = Pos2::new(area.left() + MARGIN, foot_top + MARGIN);
        painter.galley(foot_at, foot, Color32::WHITE);
        let mut top = line(painter, area, area.top(), &says, (20.0, Color32::WHITE));
        // Between the two.
        let rest = Rect::from_x_y_ranges(area.x_range(), top..=foot_top.max(top));
        let fit = PictureFit::within(rest, *size_px);
        let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        painter.image(texture.id(), fit.rect, whole, Color32::WHITE);
        // What was found in a picture of another size lies elsewhere in this one.
        let standing = self.standing.as_ref();
        if let Some(standing) = standing.filter(|standing| standing.size_px == *size_px) {
            let painter = ui.painter_at(fit.rect);
            if let Some(coverage) = &standing.coverage {
                tint(&painter, &fit, coverage);
            }
            outline(&painter, &fit, standing);
        }
        for (weight, text) in self.notices.shown((self.now)()) {
            let color = match weight {
                Weight::Done => Color32::WHITE,
                Weight::Trouble => TROUBLE,
            };
            top = line(painter, area, top, &text, (15.0, color));
        }
    }
}

/// A line of text across the window, as many rows as it takes; where the next one begins.
fn line(painter: &Painter, area: Rect, top: f32, text: &str, (size, color): (f32, Color32)) -> f32 {
    let font = FontId::proportional(size);
    let galley = painter.layout(text.to_owned(), font, color, text_width(area));
    let bottom = top + galley.size().y + 2.0 * MARGIN;
    let place = Rect::from_min_max(Pos2::new(area.left(), top), Pos2::new(area.right(), bottom));
    painter.rect_filled(place, 0.0, Color32::from_black_alpha(190));
    painter.galley(place.min + Vec2::splat(MARGIN), galley, color);
    bottom
}

fn text_width(area: Rect) -> f32 {
    (area.width() - 2.0 * MARGIN).max(40.0)
}

/// The parts of the picture in which no view has a corner.
fn tint(painter: &Painter, fit: &PictureFit, coverage: &Coverage) {
    let cell = fit.rect.size() / Vec2::new(coverage.columns as f32, coverage.rows as f32);
    for (k, &views) in coverage.views.iter().enumerate() {
        let place = Vec2::new((k % coverage.columns) as f32, (k / coverage.columns) as f32);
        if views == 0 {
            let rect = Rect::from_min_size(fit.rect.min + place * cell, cell);
            painter.rect_filled(rect, 0.0, LACKING);
        }
    }
}

fn outline(painter: &Painter, fit: &PictureFit, standing: &ViewsStanding) {
    let color = match standing.moment {
        Some(Moment::Taken) => TAKEN,
        Some(Moment::Moves) => MOVES,
        _ => KNOWN,
    };
    if let Some((outline_px, corners_px)) = &standing.target_px {
        let corners = outline_px.map(|pixel| fit.place_of(pixel)).to_vec();
        painter.add(Shape::closed_line(corners, Stroke::new(2.5, color)));
        for &pixel in corners_px {
            painter.circle_filled(fit.place_of(pixel), 3.5, color);
        }
    }
}

impl Content for CalibrationWindow {
    fn renew(&mut self, _: &Arc<Gpu>, creation: &eframe::CreationContext<'_>) -> Result<()> {
        // Its texture is gone with the device.
        self.picture = None;
        self.shared.waker.set(&creation.egui_ctx);
        Ok(())
    }

    fn logic(&mut self, ctx: &Context) {
        ctx.request_repaint_after(PULSE);
        if self.shared.stop.load(Ordering::Relaxed) {
            self.end(ctx, Ending::GivenUp);
        }
        self.step(ctx);
    }

    fn ui(&mut self, ui: &mut Ui) {
        self.keys(&ui.ctx().clone());
        CentralPanel::default()
            .frame(Frame::NONE)
            .show(ui, |ui| self.show(ui));
    }
}
