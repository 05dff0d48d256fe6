//! The window: picture, panel, keys, notices. It shows what the live session has and takes commands to it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::Result;
use eframe::egui::{
    Align2, Area, CentralPanel, Color32, Context, FontId, Frame, Grid, Id, PointerButton, Pos2,
    ProgressBar, Rect, Response, RichText, ScrollArea, Sense, Ui, Vec2, ViewportCommand,
};
use glam::DAffine3;

use super::command::{
    Clicks, ClosingAnswer, Commands, LiveCommand, Overlay, SceneCommand, Selected, WindowCommand,
};
use super::gizmo::{Drag, Gizmo, GizmoTarget};
use super::keys::bindings;
use super::overlays::Overlays;
use super::panel::{Facts, Panel};
use super::selected_outline::SelectedOutline;
use super::selection::selected_at;
use super::session::LiveSession;
use super::shadow_lines::ShadowLines;
use super::window_state::WindowState;
use super::window_title;
use crate::app::talk;
use crate::app::window::ContextWaker;
use crate::app::window::event_loop::PassEnd;
use crate::app::window::fit::PictureFit;
use crate::app::window::lasting::Content;
use crate::app::window::notices::{CameraState, Weight};
use crate::app::window::screen::Screen;
use crate::geometry::light_placing::PosedCamera;
use crate::render::{Gpu, RenderError};
use crate::scene::SceneLight;

/// The window looks at the world at least this often, even when no frame comes.
const PULSE: Duration = Duration::from_millis(200);
/// What takes no longer is not told.
const LONG_AWAITED_MS: f64 = 1000.0;
const PANEL_WIDTH: f32 = 330.0;
/// Whatever it shows, the picture has the rest.
const MOST_PANEL_WIDTH: f32 = 480.0;
/// What the list of keys has around it.
const KEYS_MARGIN: f32 = 90.0;
const PROGRESS_WIDTH: f32 = 330.0;
const TROUBLE: Color32 = Color32::from_rgb(255, 190, 90);
const RECORDING: Color32 = Color32::from_rgb(235, 60, 50);

/// The error that ended the window before a person did.
pub type Failure = Arc<Mutex<Option<anyhow::Error>>>;

/// The end of the window, as far as it was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Closing {
    NotAsked,
    /// A person is asked what becomes of the scene that nobody has saved.
    Asked,
    /// That scene is to be gone.
    Discards,
}

/// All that the window and whoever opened it share.
pub struct WindowShared {
    /// Closes the window.
    pub stop: Arc<AtomicBool>,
    /// What goes wrong.
    pub failure: Failure,
    /// When the last pass ended.
    pub pass_end: PassEnd,
    /// Wakes the window.
    pub waker: ContextWaker,
}

/// The state of the live window.
pub struct LiveWindow {
    session: LiveSession,
    screen: Screen,
    state: WindowState,
    panel: Panel,
    shadow_lines: ShadowLines,
    outline: SelectedOutline,
    drag: Option<Drag>,
    adapter: String,
    shared: WindowShared,
    full_screen: bool,
    /// As it was set last.
    title: String,
    closing: Closing,
}

impl LiveWindow {
    /// A window on a live session.
    ///
    /// # Errors
    /// It does not draw on the session's device.
    pub fn new(
        session: LiveSession,
        shared: WindowShared,
        gpu: &Gpu,
        creation: &eframe::CreationContext<'_>,
    ) -> Result<Self> {
        shared.waker.set(&creation.egui_ctx);
        Ok(Self {
            session,
            screen: Screen::new(creation)?,
            adapter: gpu.description().to_owned(),
            shared,
            state: WindowState::new(),
            panel: Panel::default(),
            shadow_lines: ShadowLines::default(),
            outline: SelectedOutline::default(),
            drag: None,
            full_screen: false,
            title: String::new(),
            closing: Closing::NotAsked,
        })
    }

    fn run(&mut self, ctx: &Context, commands: Commands) {
        for command in commands {
            match command {
                LiveCommand::Scene(command) => self.session.edit_scene(command, &self.state),
                LiveCommand::Recording(command) => self.session.record(command),
                LiveCommand::Window(WindowCommand::Escape) if self.leaves_search() => {
                    let cancel = SceneCommand::Clicks(Clicks::Cancel);
                    self.session.edit_scene(cancel, &self.state);
                }
                LiveCommand::Window(command) => self.state.apply(&command),
                LiveCommand::Quit => ctx.send_viewport_cmd(ViewportCommand::Close),
                LiveCommand::Close(answer) => self.answer(ctx, answer),
            }
        }
        if let Some(command) = self.session.take_selection() {
            self.state.apply(&command);
        }
        if self.state.full_screen != self.full_screen {
            self.full_screen = self.state.full_screen;
            ctx.send_viewport_cmd(ViewportCommand::Fullscreen(self.full_screen));
        }
    }

    /// Whether a light is being found, with nothing over it: that is what Esc leaves.
    fn leaves_search(&self) -> bool {
        !self.state.keys && self.session.clicks().is_some()
    }

    /// Whether a person is asked before the window closes: not where somebody else ends the program.
    fn asks_before_closing(&self) -> bool {
        self.closing != Closing::Discards && self.session.is_unsaved() && !self.shared.ends()
    }

    fn answer(&mut self, ctx: &Context, answer: ClosingAnswer) {
        match answer {
            ClosingAnswer::Stay => {
                self.closing = Closing::NotAsked;
                return;
            }
            ClosingAnswer::Discard => self.closing = Closing::Discards,
            ClosingAnswer::Save(path) => {
                let save = SceneCommand::Save(path);
                self.session.edit_scene(save, &self.state);
                if self.session.is_unsaved() {
                    // A notice tells why.
                    return;
                }
                self.closing = Closing::NotAsked;
            }
        }
        ctx.send_viewport_cmd(ViewportCommand::Close);
    }

    fn side_panel(&mut self, ui: &mut Ui) -> Commands {
        let (session, state, adapter) = (&self.session, &self.state, &self.adapter);
        let document = session.document();
        let camera = match &session.notices.camera {
            CameraState::Opening => "The camera is being opened …".to_owned(),
            CameraState::Open(what) => what.clone(),
            CameraState::Failed(_) => "No camera".to_owned(),
            CameraState::Lost(_) => "The camera is gone".to_owned(),
            CameraState::Ended => "The recording has ended".to_owned(),
        };
        let place = |thing: &str| session.place(thing);
        let facts = Facts {
            scene: session.scene(),
            path: document.map(|document| document.path()),
            unsaved: session.is_unsaved(),
            place: &place,
            history: [
                document.and_then(|document| document.next_undo()),
                document.and_then(|document| document.next_redo()),
            ],
            picture: session.picture(),
            meters: &session.meters,
            now_secs: session.now_secs(),
            frames: session.frames(),
            camera: &camera,
            adapter,
            records: session.records(),
            reading: session.models_being_read().collect(),
            clicks: session
                .clicks()
                .map(|clicks| (clicks.pairs_px().len(), clicks.vertex().is_some())),
        };
        let panel = &mut self.panel;
        eframe::egui::Panel::right("panel")
            .default_size(PANEL_WIDTH)
            .max_size(MOST_PANEL_WIDTH)
            .show(ui, |ui| panel.show(ui, &facts, state))
            .inner
    }

    /// The picture in its place, with what lies over it.
    fn picture(&mut self, ui: &mut Ui) -> Option<LiveCommand> {
        let area = ui.max_rect();
        let Some((renderer, size_px, number)) = self.session.renderer() else {
            self.say_in_the_middle(ui, area);
            return None;
        };
        let texture = self.screen.texture(renderer, number);
        let fit = PictureFit::within(area, size_px);
        let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        ui.painter().image(texture, fit.rect, whole, Color32::WHITE);
        let response = ui.interact(fit.rect, Id::unique("picture"), Sense::click_and_drag());
        let command = self.point(&response, &fit);
        let Some(picture) = self.session.picture() else {
            return command;
        };
        let painter = ui.painter_at(fit.rect);
        let overlays = Overlays {
            painter: &painter,
            fit,
            picture,
        };
        let scene = self.session.scene();
        overlays.draw(&self.state, scene, &mut self.shadow_lines);
        if scene.is_none() {
            overlays.markers();
        }
        if let Some(clicks) = self.session.clicks() {
            overlays.clicks(clicks);
        } else if let Some((target, sight)) = self.target() {
            if let (Some(scene), Some(Selected::Thing(name))) = (scene, &self.state.selected) {
                overlays.selected(scene, name, &mut self.outline);
            }
            overlays.handles(&target, &sight);
        }
        command
    }

    /// What the pointer does in the picture: it drags a handle, or selects.
    fn point(&mut self, response: &Response, fit: &PictureFit) -> Option<LiveCommand> {
        let pointer = response.interact_pointer_pos()?;
        let pixel = fit.pixel(pointer);
        if self.session.clicks().is_some() {
            let clicked = response.clicked();
            return clicked.then(|| SceneCommand::Clicks(Clicks::At(pixel)).into());
        }
        let left = PointerButton::Primary;
        if response.drag_started_by(left) {
            let pressed = response.ctx.input(|input| input.pointer.press_origin());
            let at = pressed.map_or(pixel, |place| fit.pixel(place));
            self.drag = self
                .target()
                .and_then(|(target, sight)| Gizmo::new(&target, &sight)?.grab(at));
        }
        let edit = self.drag.as_ref().and_then(|drag| {
            let (_, sight) = self.target()?;
            drag.edit(&sight, pixel)
        });
        if response.drag_stopped_by(left) {
            return match (self.drag.take(), edit) {
                (Some(_), Some(edit)) => Some(SceneCommand::Commit(edit).into()),
                (Some(_), None) => Some(SceneCommand::EndPreview.into()),
                (None, _) => None,
            };
        }
        if let (true, Some(edit)) = (response.dragged_by(left), edit) {
            return Some(SceneCommand::Preview(edit).into());
        }
        if response.clicked_by(left)
            && let (Some(scene), Some(picture)) = (self.session.scene(), self.session.picture())
        {
            let can_move = |thing: &str| self.session.place(thing).is_some();
            let with_lights = self.state.shows(Overlay::Lights);
            let selected = selected_at(scene, picture, pixel, with_lights, can_move);
            return Some(WindowCommand::Select(selected).into());
        }
        None
    }

    /// What is selected, with the camera as its anchor sees it.
    fn target(&self) -> Option<(GizmoTarget, PosedCamera)> {
        let (scene, picture) = (self.session.scene()?, self.session.picture()?);
        let camera_from_node = picture.camera_from_nodes(scene);
        let (target, camera_from_frame) = match self.state.selected.as_ref()? {
            Selected::Thing(name) => {
                let mut things = scene.phantoms.iter().chain(&scene.virtuals);
                let thing = things.find(|thing| thing.name == *name)?;
                // Where it stands is edited in its anchor's axes, wherever it is by now.
                let time_s = picture.frame.time_secs;
                let moved_m = thing.motion.as_ref().map(|motion| motion.at(time_s).0);
                let frame = camera_from_node[thing.stands_on()]?
                    * DAffine3::from_translation(moved_m.unwrap_or_default());
                let place = self.session.place(name)?;
                let name = name.clone();
                (GizmoTarget::Thing { name, place }, frame)
            }
            Selected::Light(index) => {
                let SceneLight { anchor, light } = *scene.lights.get(*index)?;
                let index = *index;
                let frame = camera_from_node.get(anchor).copied()??;
                (GizmoTarget::Light { index, light }, frame)
            }
        };
        let sight = PosedCamera {
            intrinsics: picture.intrinsics,
            camera_from_world: camera_from_frame,
        };
        Some((target, sight))
    }

    fn say_in_the_middle(&self, ui: &Ui, area: Rect) {
        let text = match &self.session.notices.camera {
            // A notice tells why.
            CameraState::Failed(_) if self.session.looks_for_camera() => {
                "The camera is looked for: it is taken up as soon as it is there."
            }
            CameraState::Failed(_) => "There is no picture.",
            CameraState::Ended => "The recording has no pictures.",
            _ => "Waiting for the first picture …",
        }
        .to_owned();
        let painter = ui.painter();
        let wrap = (area.width() - 40.0).max(40.0);
        let galley = painter.layout(text, FontId::proportional(18.0), Color32::LIGHT_GRAY, wrap);
        let place = area.center() - galley.size() / 2.0;
        painter.galley(place, galley, Color32::LIGHT_GRAY);
    }

    /// What is told over the picture, each in its colour.
    fn told(&self) -> Vec<(Color32, String)> {
        let session = &self.session;
        let mut told = Vec::new();
        if session.clicks().is_some() {
            let text = "finding the light: the picture stands still; Esc leaves it";
            told.push((TROUBLE, text.to_owned()));
        } else if self.state.holds {
            told.push((TROUBLE, "held: the picture stands still".to_owned()));
        }
        let awaits_long = session.awaited_ms().is_some_and(|ms| ms >= LONG_AWAITED_MS);
        if awaits_long && session.preparing().is_none() {
            told.push((Color32::WHITE, "preparing the scene …".to_owned()));
        }
        for (recording, what) in session.records().into_iter().zip(["camera", "composite"]) {
            if recording {
                told.push((RECORDING, format!("recording the {what}")));
            }
        }
        if let Some(frames) = session.frames_being_written() {
            let frames = talk::counted(frames, "frame");
            told.push((Color32::WHITE, format!("writing {frames} …")));
        }
        let shown = session.notices.shown(session.now_secs());
        told.extend(shown.into_iter().map(|(weight, text)| match weight {
            Weight::Done => (Color32::WHITE, text),
            Weight::Trouble => (TROUBLE, text),
        }));
        told
    }

    fn notices(&self, ctx: &Context, area: Rect) {
        let (told, preparing) = (self.told(), self.session.preparing());
        if told.is_empty() && preparing.is_none() {
            return;
        }
        let place = area.left_top() + Vec2::splat(10.0);
        Area::new(Id::unique("notices"))
            .fixed_pos(place)
            .interactable(false)
            .show(ctx, |ui| {
                ui.set_max_width((area.width() - 20.0).clamp(60.0, 620.0));
                if let Some(part) = preparing {
                    let text = "working out what things hide from themselves";
                    ui.add(
                        ProgressBar::new(part)
                            .desired_width(PROGRESS_WIDTH)
                            .text(text),
                    );
                }
                for (colour, text) in told {
                    boxed(ui, RichText::new(text).color(colour));
                }
            });
    }

    /// Files that were dropped on the window; while they are held over it, it says what becomes of them.
    fn dropped(&self, ctx: &Context, area: Rect) -> Commands {
        let mut commands = Commands::default();
        let (hovers, dropped) = ctx.input(|input| {
            let hovers = !input.raw.hovered_files.is_empty();
            (hovers, input.raw.dropped_files.clone())
        });
        let files = dropped.iter().map(|file| file.path());
        self.panel.add_dropped(files, &mut commands);
        if hovers {
            let painter = ctx.debug_painter();
            painter.rect_filled(area, 0.0, Color32::from_black_alpha(140));
            let text = "Let go to put it on the table";
            let font = FontId::proportional(22.0);
            painter.text(
                area.center(),
                Align2::CENTER_CENTER,
                text,
                font,
                Color32::WHITE,
            );
        }
        commands
    }

    fn list_of_keys(&mut self, ctx: &Context) {
        let mut open = self.state.keys;
        eframe::egui::Window::new("Keys")
            .open(&mut open)
            .collapsible(false)
            .resizable(false)
            .anchor(Align2::CENTER_CENTER, Vec2::ZERO)
            .show(ctx, |ui| {
                let most = (ctx.content_rect().height() - KEYS_MARGIN).max(KEYS_MARGIN / 2.0);
                ScrollArea::vertical().max_height(most).show(ui, |ui| {
                    Grid::new("keys")
                        .num_columns(2)
                        .striped(true)
                        .show(ui, |ui| {
                            for binding in bindings() {
                                ui.strong(binding.name);
                                ui.label(binding.does);
                                ui.end_row();
                            }
                        });
                    ui.weak(
                        "Click a thing in the picture to select it, drag its handles to move it.",
                    );
                });
            });
        self.state.keys = open;
    }
}

fn boxed(ui: &mut Ui, text: RichText) {
    Frame::new()
        .fill(Color32::from_black_alpha(190))
        .inner_margin(6.0)
        .corner_radius(4.0)
        .show(ui, |ui| ui.label(text));
}

/// What the keys that were pressed ask for.
fn pressed(ctx: &Context) -> Commands {
    let mut commands = Commands::default();
    if ctx.egui_wants_keyboard_input() {
        return commands;
    }
    for binding in bindings() {
        if ctx.input_mut(|input| input.consume_key(binding.modifiers, binding.key)) {
            commands.push(binding.command);
        }
    }
    commands
}

impl Content for LiveWindow {
    fn renew(&mut self, gpu: &Arc<Gpu>, creation: &eframe::CreationContext<'_>) -> Result<()> {
        self.screen = Screen::new(creation)?;
        gpu.description().clone_into(&mut self.adapter);
        self.full_screen = false;
        self.title.clear();
        self.drag = None;
        self.shared.waker.set(&creation.egui_ctx);
        self.session.renew(Arc::clone(gpu));
        Ok(())
    }

    fn logic(&mut self, ctx: &Context) {
        ctx.request_repaint_after(PULSE);
        if self.shared.stop.load(Ordering::Relaxed) {
            ctx.send_viewport_cmd(ViewportCommand::Close);
        }
        if ctx.input(|input| input.viewport().close_requested()) && self.asks_before_closing() {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            ctx.send_viewport_cmd(ViewportCommand::Minimized(false));
            self.closing = Closing::Asked;
        }
        let shown = self.session.was_shown(self.shared.pass_end.secs());
        if let Err(error) = shown.and_then(|()| self.session.step(&self.state)) {
            let failed: Option<&RenderError> = error.downcast_ref();
            if failed.is_some_and(RenderError::ends_a_device) {
                // It is renewed.
                return;
            }
            self.shared.fail(error);
            ctx.send_viewport_cmd(ViewportCommand::Close);
        }
    }

    fn ui(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        let mut commands = match self.closing {
            Closing::Asked => self.panel.ask_before_closing(&ctx),
            Closing::NotAsked | Closing::Discards => pressed(&ctx),
        };
        if self.state.panel {
            commands.append(self.side_panel(ui));
        }
        let area = CentralPanel::default()
            .frame(Frame::NONE)
            .show(ui, |ui| {
                if let Some(command) = self.picture(ui) {
                    commands.push(command);
                }
                ui.max_rect()
            })
            .inner;
        commands.append(self.dropped(&ctx, area));
        self.notices(&ctx, area);
        if self.state.keys {
            self.list_of_keys(&ctx);
        }
        self.run(&ctx, commands);
        let title = window_title(&self.session.title());
        if title != self.title {
            self.title.clone_from(&title);
            ctx.send_viewport_cmd(ViewportCommand::Title(title));
        }
    }

    fn close(&mut self) {
        for said in self.session.finish() {
            match said {
                Ok(text) => talk::say(text),
                Err(error) => self.shared.fail(error.into()),
            }
        }
        if self.closing != Closing::Discards
            && let Some(path) = self.session.keep_unsaved()
        {
            let path = path.display();
            talk::say(format_args!("the scene was not saved; it is kept: {path}"));
        }
        if let CameraState::Failed(reason) = &self.session.notices.camera {
            self.shared.fail(anyhow::anyhow!("{reason}"));
        }
    }
}

impl WindowShared {
    /// Whether somebody else than the person at the window ends it.
    fn ends(&self) -> bool {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.is_some() || self.stop.load(Ordering::Relaxed)
    }

    /// The first thing that goes wrong is the one that is told.
    fn fail(&self, error: anyhow::Error) {
        let mut failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.get_or_insert(error);
    }
}
