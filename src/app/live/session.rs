//! The live program without its window: scene, camera, tracking, drawing and recording, moved on frame by frame by
//! whoever shows the picture.

mod things;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, Result};

use super::beginning::{Opening, plan_of, same_camera};
use super::canvas::SceneCanvas;
use super::command::{Clicks, Overlay, RecordingCommand, SceneCommand, Selected};
use super::demonstration::{self, Demonstration};
use super::frame_tracker::TrackedPicture;
use super::meters::{Meters, Sample};
use super::pipeline::{Pipeline, PipelineInput};
use super::recorders::Recorders;
use super::shadow_clicks::{self, ShadowClicks};
use super::views::ViewMode;
use super::window_state::WindowState;
use crate::app::authoring::{Edit, EditError, SceneDocument, SceneNews, SceneWatch};
use crate::app::files::job_files::Replacing;
use crate::app::files::output_error::OutputError;
use crate::app::input::live_capture::CaptureEvent;
use crate::app::input::mailbox::Taken;
use crate::app::recording::session_writer::SessionHead;
use crate::app::stopwatch::Stopwatch;
use crate::app::window::Wake;
use crate::app::window::notices::{CameraState, Notices, Weight};
use crate::capture::live::Now;
use crate::geometry::camera::Intrinsics;
use crate::render::{Gpu, Renderer};
use crate::scene::{CameraSettings, Placement, Scene};
use things::ReadAhead;

/// For composites of sources that do not say their rate.
const ASSUMED_FPS: f64 = 30.0;
/// A wait that is no shorter was one, milliseconds.
const INSTANT_MS: f64 = 0.5;

/// The scene, as far as there is one.
enum SceneState {
    /// First use: nobody has said what stands on the table.
    Absent,
    /// A scene is shown and edited.
    Open(Box<OpenScene>),
}

/// A scene that is shown and edited.
struct OpenScene {
    document: SceneDocument,
    /// Tells what becomes of its files.
    watch: SceneWatch,
    origin: Origin,
    /// What is shown while it lasts.
    previewed: Option<Edit>,
    /// Models that are on their way into it.
    reading: Vec<ReadAhead>,
}

/// The place of a scene's file.
enum Origin {
    /// Where a person keeps it.
    Saved,
    /// In a folder that is gone with the program, until somebody saves it.
    Unsaved {
        #[expect(dead_code, reason = "it keeps the folder")]
        folder: Demonstration,
    },
}

/// The picture, as far as there is one.
enum PictureState {
    /// None has come yet.
    Awaited,
    /// The newest, until a newer one comes.
    Following(Box<DrawnPicture>),
    /// One that is held, while a light is found in it by clicks.
    FindingLight(Box<DrawnPicture>, Box<ShadowClicks>),
}

/// The frame that was drawn last.
struct DrawnPicture {
    tracked: TrackedPicture,
    /// The view that it was drawn in, while nothing has changed since.
    drawn: Option<ViewMode>,
    /// Its times, until its display is told of.
    pending: Option<Pending>,
}

/// A frame that was drawn, and not yet seen to be on the screen.
struct Pending {
    begun_secs: f64,
    arrived_secs: f64,
    sample: Sample,
}

/// The live program without its window.
pub struct LiveSession {
    now: Now,
    wake: Wake,
    camera: CameraSettings,
    /// `None` where it is learnt.
    calibration: Option<Intrinsics>,
    /// The source's rate, where it says it.
    fps: Option<f64>,
    scene: SceneState,
    picture: PictureState,
    pipeline: Pipeline,
    canvas: SceneCanvas,
    recorders: Recorders,
    /// What there is to tell.
    pub notices: Notices,
    /// What it costs.
    pub meters: Meters,
    /// Renderers that drew, one after the other: a new one has another picture.
    renderers: u64,
    /// What has just come into the scene.
    newly_selected: Option<Selected>,
}

impl SceneState {
    fn of(document: Option<SceneDocument>, wake: &Wake) -> Self {
        document.map_or(Self::Absent, |document| {
            Self::opened(document, Origin::Saved, wake)
        })
    }

    fn opened(document: SceneDocument, origin: Origin, wake: &Wake) -> Self {
        Self::Open(Box::new(OpenScene {
            watch: watch(&document, wake),
            document,
            origin,
            previewed: None,
            reading: Vec::new(),
        }))
    }

    fn open(&self) -> Option<&OpenScene> {
        match self {
            Self::Absent => None,
            Self::Open(scene) => Some(scene),
        }
    }

    fn open_mut(&mut self) -> Option<&mut OpenScene> {
        match self {
            Self::Absent => None,
            Self::Open(scene) => Some(scene),
        }
    }
}

fn watch(document: &SceneDocument, wake: &Wake) -> SceneWatch {
    let wake = Arc::clone(wake);
    document.watch(move || wake())
}

impl PictureState {
    fn drawn(&self) -> Option<&DrawnPicture> {
        match self {
            Self::Awaited => None,
            Self::Following(picture) | Self::FindingLight(picture, _) => Some(picture.as_ref()),
        }
    }

    fn drawn_mut(&mut self) -> Option<&mut DrawnPicture> {
        match self {
            Self::Awaited => None,
            Self::Following(picture) | Self::FindingLight(picture, _) => Some(picture.as_mut()),
        }
    }

    /// Whether it stays although a newer one has come.
    fn is_held(&self, state: &WindowState) -> bool {
        match self {
            Self::Awaited => false,
            Self::Following(_) => state.holds,
            Self::FindingLight(..) => true,
        }
    }

    /// What is shown of it: virtual things would hide the shadows that are to be clicked.
    fn view(&self, state: &WindowState) -> ViewMode {
        match self {
            Self::FindingLight(..) => ViewMode::Bare,
            Self::Awaited | Self::Following(_) => state.view,
        }
    }

    fn clicks(&self) -> Option<&ShadowClicks> {
        match self {
            Self::FindingLight(_, clicks) => Some(clicks.as_ref()),
            Self::Awaited | Self::Following(_) => None,
        }
    }

    /// With clicks a light is found in it from now on, without them no longer.
    fn set_clicks(&mut self, clicks: Option<ShadowClicks>) {
        *self = match (std::mem::replace(self, Self::Awaited), clicks) {
            (Self::Awaited, _) => Self::Awaited,
            (Self::Following(picture) | Self::FindingLight(picture, _), None) => {
                Self::Following(picture)
            }
            (Self::Following(picture) | Self::FindingLight(picture, _), Some(clicks)) => {
                Self::FindingLight(picture, Box::new(clicks))
            }
        };
    }

    /// Something has changed: it has to be drawn again.
    fn draw_again(&mut self) {
        if let Some(picture) = self.drawn_mut() {
            picture.drawn = None;
        }
    }
}

impl LiveSession {
    /// Begins to open the camera and to draw, by the clock `now`. `wake` is called from other threads when there is
    /// something to do. What the keys record goes into the folder `out`. A recording begins again at its end if it
    /// `repeats`.
    pub fn open(
        opening: Opening,
        gpu: Arc<Gpu>,
        out: &Path,
        repeats: bool,
        (now, wake): (Now, Wake),
    ) -> Self {
        let Opening {
            document,
            camera,
            input,
        } = opening;
        let scene = document.as_ref().map(|document| document.scene().clone());
        let pipeline = Pipeline::start(
            &PipelineInput {
                source: camera.source.clone(),
                options: input.options(repeats),
                calibration: input.calibration,
            },
            plan_of(document.as_ref()),
            &now,
            Arc::clone(&wake),
        );
        let mut session = Self {
            canvas: SceneCanvas::new(gpu, Arc::new(scene.unwrap_or_default()), Arc::clone(&wake)),
            recorders: Recorders::new(out.to_owned()),
            notices: Notices::new(),
            meters: Meters::default(),
            fps: None,
            scene: SceneState::of(document, &wake),
            picture: PictureState::Awaited,
            renderers: 0,
            newly_selected: None,
            calibration: input.calibration,
            pipeline,
            camera,
            now,
            wake,
        };
        if session.calibration.is_none() {
            session.tell(
                Weight::Trouble,
                "The camera is not calibrated: its focal length is learnt from the markers. Show several of a board from \
                 several sides.",
            );
        }
        session
    }

    /// Draws on another device from now on; what is tracked and recorded goes on.
    pub fn renew(&mut self, gpu: Arc<Gpu>) {
        let scene = Arc::new(self.scene().cloned().unwrap_or_default());
        self.canvas = SceneCanvas::new(gpu, scene, Arc::clone(&self.wake));
        self.picture.draw_again();
        self.renderers += 1;
        self.tell(
            Weight::Trouble,
            "The GPU was lost; a new device draws from here on.",
        );
    }

    /// Takes what has come, and draws it as `state` wants it. Tells whether the picture is another than before.
    ///
    /// # Errors
    /// The GPU failed: nothing can be shown any more.
    pub fn step(&mut self, state: &WindowState) -> Result<bool> {
        let now_secs = (self.now)();
        while let Some(event) = self.pipeline.next_event() {
            if let CaptureEvent::Opened(opened) | CaptureEvent::Back(opened) = &event {
                self.fps = opened.fps.or(self.fps);
            }
            self.notices.take(now_secs, &event);
        }
        self.take_scene_news();
        self.take_read();
        if let Some(said) = self.recorders.take_failure(&self.pipeline) {
            self.say(said);
        }
        self.pipeline.want_rejected(state.shows(Overlay::Rejected));
        if self.canvas.set_without(state.without) {
            self.picture.draw_again();
        }
        if self.canvas.improve()? {
            self.picture.draw_again();
            self.renderers += 1;
        }
        if let (false, Taken::New(tracked)) = (
            self.picture.is_held(state),
            self.pipeline.tracked().take_within(Duration::ZERO),
        ) {
            self.recorders.add_poses(&tracked);
            self.notices.tracking.clone_from(&tracked.trouble);
            self.tell_of_camera(&tracked);
            self.picture = PictureState::Following(Box::new(DrawnPicture {
                tracked,
                drawn: None,
                pending: None,
            }));
            self.draw(state, true)?;
            return Ok(true);
        }
        let view = self.picture.view(state);
        let is_stale = |picture: &DrawnPicture| picture.drawn != Some(view);
        if self.picture.drawn().is_some_and(is_stale) {
            self.draw(state, false)?;
            return Ok(true);
        }
        Ok(false)
    }

    /// Draws the last frame; `is_new`: for the first time.
    fn draw(&mut self, state: &WindowState, is_new: bool) -> Result<()> {
        let view = self.picture.view(state);
        let Some(picture) = self.picture.drawn_mut() else {
            return Ok(());
        };
        let tracked = &picture.tracked;
        let size_before = self.canvas.renderer().map(|(_, size_px)| size_px);
        let begun_secs = (self.now)();
        let drawn = self.canvas.draw(tracked, view);
        drawn.with_context(|| format!("frame {}", tracked.frame.index))?;
        let size_px = self.canvas.renderer().map(|(_, size_px)| size_px);
        if size_px != size_before {
            self.renderers += 1;
        }
        picture.drawn = Some(view);
        if is_new {
            picture.pending = Some(Pending {
                begun_secs,
                arrived_secs: tracked.arrived_secs,
                sample: Sample {
                    wait_ms: tracked.wait_ms,
                    track_ms: tracked.track_ms,
                    ..Sample::default()
                },
            });
            if let (true, Some((renderer, size_px))) =
                (self.recorders.records_video(), self.canvas.renderer())
            {
                let (time_secs, rgba) = (tracked.frame.time_secs, renderer.read_picture()?);
                self.recorders.add_composite(size_px, time_secs, rgba);
            }
        }
        Ok(())
    }

    /// The frame that was drawn last is on the screen: handed over at `handed_over_secs`, or when the GPU is done with
    /// it, whichever is later.
    ///
    /// # Errors
    /// The GPU failed.
    pub fn was_shown(&mut self, handed_over_secs: f64) -> Result<()> {
        let picture = self.picture.drawn_mut();
        let pending = picture.and_then(|picture| picture.pending.take());
        let (Some(pending), Some((renderer, _))) = (pending, self.canvas.renderer()) else {
            return Ok(());
        };
        let ((), waited_ms) = {
            let (waited, ms) = Stopwatch::time(|| renderer.wait());
            (waited?, ms)
        };
        let shown_secs = match waited_ms > INSTANT_MS {
            true => (self.now)(),
            false => handed_over_secs,
        };
        let draw_ms = (shown_secs - pending.begun_secs) * 1e3;
        self.canvas.spent(draw_ms);
        self.meters.push(Sample {
            shown_secs,
            draw_ms,
            latency_ms: (shown_secs - pending.arrived_secs) * 1e3,
            ..pending.sample
        });
        Ok(())
    }

    /// Tells once when a camera that is not calibrated is known surely.
    fn tell_of_camera(&mut self, tracked: &TrackedPicture) {
        let was_sure = self.picture().and_then(|picture| picture.learnt);
        let was_sure = was_sure.is_some_and(|camera| camera.is_sure());
        if let Some(camera) = tracked
            .learnt
            .filter(|camera| camera.is_sure() && !was_sure)
        {
            self.tell(
                Weight::Done,
                format!("The camera is known: {}.", camera.in_words()),
            );
        }
    }

    /// What the program's clock shows, seconds.
    pub fn now_secs(&self) -> f64 {
        (self.now)()
    }

    /// The renderer that drew last, the pictures' size, and a number that changes with the renderer; `None` before the
    /// first picture.
    pub fn renderer(&self) -> Option<(&Renderer, [u32; 2], u64)> {
        let (renderer, size_px) = self.canvas.renderer()?;
        Some((renderer, size_px, self.renderers))
    }

    /// Whether the scene is shown as well as can be, or a better renderer has yet to come.
    pub fn is_settled(&self) -> bool {
        self.canvas.is_settled()
    }

    /// The frame that was drawn last.
    pub fn picture(&self) -> Option<&TrackedPicture> {
        self.picture.drawn().map(|picture| &picture.tracked)
    }

    /// The scene as it is shown; `None` on first use.
    pub fn scene(&self) -> Option<&Scene> {
        self.document().map(SceneDocument::scene)
    }

    /// Where a thing stands in the numbers of the scene, with what is being dragged where it is.
    pub fn placement(&self, thing: &str) -> Option<Placement> {
        let scene = self.scene.open()?;
        match &scene.previewed {
            Some(Edit::Place {
                thing: previewed,
                placement,
            }) if previewed == thing => Some(*placement),
            _ => scene.document.placement(thing),
        }
    }

    /// The scene with its file; `None` on first use.
    pub fn document(&self) -> Option<&SceneDocument> {
        self.scene.open().map(|scene| &scene.document)
    }

    /// Whether the scene has yet to be saved.
    pub fn is_unsaved(&self) -> bool {
        let scene = self.scene.open();
        scene.is_some_and(|scene| matches!(scene.origin, Origin::Unsaved { .. }))
    }

    /// Frames that came, and how many of them were not shown: see [`Pipeline::dropped`].
    pub fn frames(&self) -> (u64, [u64; 3]) {
        (self.pipeline.captured(), self.pipeline.dropped())
    }

    /// The clicks by which a light is being found.
    pub fn clicks(&self) -> Option<&ShadowClicks> {
        self.picture.clicks()
    }

    /// Whether a session and a video are being recorded.
    pub fn records(&self) -> [bool; 2] {
        [
            self.recorders.records_session(),
            self.recorders.records_video(),
        ]
    }

    /// Does what is asked of the scene, of which `state` says what is selected. What goes wrong is told as a notice.
    pub fn edit_scene(&mut self, command: SceneCommand, state: &WindowState) {
        match command {
            SceneCommand::Preview(edit) => self.preview(&edit),
            SceneCommand::Commit(edit) => self.commit(&edit),
            SceneCommand::EndPreview => {
                if let Some(scene) = self.scene.open_mut() {
                    scene.previewed = None;
                    scene.document.end_preview();
                    self.scene_changed(true);
                }
            }
            SceneCommand::Undo => self.edit(SceneDocument::undo),
            SceneCommand::Redo => self.edit(SceneDocument::redo),
            SceneCommand::Clicks(clicks) => self.take_clicks(clicks, state),
            SceneCommand::Demonstrate { id, size_m } => self.demonstrate(id, size_m),
            SceneCommand::Save(path) => self.save(&path),
            SceneCommand::ToggleSelected => {
                if let (Some(Selected::Thing(thing)), Some(scene)) = (&state.selected, self.scene())
                {
                    let mut things = scene.phantoms.iter().chain(&scene.virtuals);
                    let found = things.find(|found| found.name == *thing);
                    if let Some(visible) = found.map(|found| !found.visible) {
                        let thing = thing.clone();
                        self.commit(&Edit::Show { thing, visible });
                    }
                }
            }
            SceneCommand::RemoveSelected => match &state.selected {
                Some(Selected::Thing(name)) => self.commit(&Edit::RemoveThing(name.clone())),
                Some(Selected::Light(index)) => self.commit(&Edit::RemoveLight(*index)),
                None => {}
            },
            SceneCommand::Add(wanted) => self.add(&wanted),
            SceneCommand::DuplicateSelected => {
                if let Some(Selected::Thing(name)) = &state.selected {
                    self.duplicate(name);
                }
            }
            SceneCommand::Rename { thing, name } => self.rename(&thing, &name),
        }
    }

    /// Does what is asked of the recorders. What goes wrong is told as a notice.
    pub fn record(&mut self, command: RecordingCommand) {
        match command {
            RecordingCommand::Screenshot => self.screenshot(),
            RecordingCommand::ToggleSession => self.toggle_session(),
            RecordingCommand::ToggleVideo => {
                let Some((_, size_px)) = self.canvas.renderer() else {
                    return self.tell(Weight::Trouble, "There is no picture yet.");
                };
                let fps = self.fps.unwrap_or(ASSUMED_FPS);
                let said = self.recorders.toggle_video(size_px, fps);
                self.say(said);
            }
        }
    }

    /// Ends all recording, so that files are whole: what there is to say.
    pub fn finish(&mut self) -> Vec<Result<String, OutputError>> {
        self.recorders.finish(&self.pipeline)
    }

    /// Tells something for a while.
    pub fn tell(&mut self, weight: Weight, text: impl Into<String>) {
        let now_secs = self.now_secs();
        self.notices.tell(now_secs, weight, text);
    }

    fn say(&mut self, said: Result<String, OutputError>) {
        match said {
            Ok(text) => self.tell(Weight::Done, text),
            Err(error) => self.tell(Weight::Trouble, error.to_string()),
        }
    }

    fn preview(&mut self, edit: &Edit) {
        if let Some(scene) = self.scene.open_mut()
            && scene.document.preview(edit)
        {
            scene.previewed = Some(edit.clone());
            self.scene_changed(false);
        }
    }

    fn commit(&mut self, edit: &Edit) {
        self.edit(|document| document.commit(edit));
    }

    fn edit(&mut self, change: impl FnOnce(&mut SceneDocument) -> Result<(), EditError>) {
        let Some(scene) = self.scene.open_mut() else {
            return;
        };
        scene.previewed = None;
        if let Err(error) = change(&mut scene.document) {
            self.tell(Weight::Trouble, error.to_string());
        }
        self.scene_changed(true);
    }

    /// The scene is another: what depends on it follows.
    fn scene_changed(&mut self, lasting: bool) {
        let Some(document) = self.document() else {
            return;
        };
        let scene = Arc::new(document.scene().clone());
        self.pipeline.set_plan(plan_of(Some(document)));
        self.canvas.set_scene(scene, lasting);
        self.picture.draw_again();
    }

    fn take_scene_news(&mut self) {
        while let Some(scene) = self.scene.open_mut() {
            match scene.watch.next() {
                None => return,
                Some(SceneNews::Mistaken(error)) => self.notices.scene = Some(error.to_string()),
                Some(SceneNews::Changed(change)) => {
                    if !scene.document.take(*change) {
                        continue;
                    }
                    scene.watch = watch(&scene.document, &self.wake);
                    let is_same_camera = same_camera(&scene.document.scene().camera, &self.camera);
                    self.notices.scene = None;
                    self.scene_changed(true);
                    if !is_same_camera {
                        self.tell(
                            Weight::Trouble,
                            "The scene's [camera] was changed: start again to take it.",
                        );
                    }
                }
            }
        }
    }

    fn take_clicks(&mut self, step: Clicks, state: &WindowState) {
        let (Some(document), Some(tracked)) = (self.document(), self.picture()) else {
            return self.tell(Weight::Trouble, "There is no picture of the scene yet.");
        };
        match step {
            Clicks::Begin => {
                let clicks = ShadowClicks::begin(document.scene(), tracked);
                let sees_world = clicks.is_some();
                self.picture.set_clicks(clicks);
                if !sees_world {
                    self.tell(Weight::Trouble, "The world's markers are not seen.");
                }
            }
            Clicks::Cancel => self.picture.set_clicks(None),
            Clicks::Find(freedom) => {
                let clicks = self.clicks();
                match clicks.map(|clicks| clicks.find(tracked, freedom)) {
                    None => {}
                    Some(Err(reason)) => self.tell(Weight::Trouble, reason),
                    Some(Ok(found)) => {
                        let index = match state.selected {
                            Some(Selected::Light(index)) => index,
                            _ => 0,
                        };
                        let edits = shadow_clicks::edits(document.scene(), index, &found);
                        self.picture.set_clicks(None);
                        for edit in edits {
                            self.commit(&edit);
                        }
                        self.tell(Weight::Done, shadow_clicks::in_words(&found));
                    }
                }
            }
            Clicks::At(_) | Clicks::TakeBack => {
                let PictureState::FindingLight(_, clicks) = &mut self.picture else {
                    return;
                };
                match step {
                    Clicks::At(pixel) => {
                        if let Err(reason) = clicks.click(pixel) {
                            self.tell(Weight::Trouble, reason);
                        }
                    }
                    _ => clicks.take_back(),
                }
            }
        }
    }

    fn screenshot(&mut self) {
        let read = self
            .canvas
            .renderer()
            .map(|(renderer, size_px)| renderer.read_picture().map(|rgba| (size_px, rgba)));
        match read {
            None => self.tell(Weight::Trouble, "There is no picture yet."),
            Some(Err(error)) => self.tell(Weight::Trouble, error.to_string()),
            Some(Ok((size_px, rgba))) => {
                let said = self.recorders.screenshot(size_px, &rgba);
                self.say(said);
            }
        }
    }

    fn toggle_session(&mut self) {
        let head = SessionHead {
            fps: self.fps,
            calibration: self.calibration,
            scene: self.document().map(|d| d.path().to_owned()),
            anchors: self
                .scene()
                .map_or(Vec::new(), |scene| scene.anchors.clone()),
            replacing: Replacing::OlderResults,
        };
        let said = self.recorders.toggle_session(&self.pipeline, head);
        self.say(said);
    }

    fn demonstrate(&mut self, id: u32, size_m: f64) {
        let made = Demonstration::make(&self.camera, id, size_m)
            .map_err(anyhow::Error::from)
            .and_then(|made| Ok((SceneDocument::open(&made.path())?, made)));
        match made {
            Ok((document, made)) => {
                let origin = Origin::Unsaved { folder: made };
                self.scene = SceneState::opened(document, origin, &self.wake);
                self.scene_changed(true);
            }
            Err(error) => self.tell(Weight::Trouble, format!("{error:#}")),
        }
    }

    fn save(&mut self, path: &Path) {
        let Some(document) = self.document() else {
            return;
        };
        let saved = demonstration::save(document.text(), path)
            .map_err(anyhow::Error::from)
            .and_then(|()| Ok(SceneDocument::open(path)?));
        match saved {
            Ok(document) => {
                self.scene = SceneState::opened(document, Origin::Saved, &self.wake);
                self.scene_changed(true);
                self.tell(Weight::Done, format!("{} saved", path.display()));
            }
            Err(error) => self.tell(Weight::Trouble, format!("{error:#}")),
        }
    }

    /// Whether pictures still come, or may come again.
    pub fn is_live(&self) -> bool {
        !matches!(
            self.notices.camera,
            CameraState::Ended | CameraState::Failed(_)
        )
    }
}
