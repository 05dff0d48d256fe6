//! The live program without its window: scene, camera, tracking, drawing and recording, moved on frame by frame by
//! whoever shows the picture.

mod edits;
mod states;
mod things;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, Result};

use super::beginning::{Opening, plan_of, title_of};
use super::canvas::SceneCanvas;
use super::command::{Overlay, RecordingCommand, WindowCommand};
use super::frame_tracker::TrackedPicture;
use super::meters::{Meters, Sample};
use super::pipeline::{Pipeline, PipelineInput};
use super::recorders::Recorders;
use super::shadow_clicks::ShadowClicks;
use super::window_state::WindowState;
use crate::app::authoring::{Edit, SceneDocument, ThingPlace};
use crate::app::files::job_files::Replacing;
use crate::app::files::output_error::OutputError;
use crate::app::input::live_capture::CaptureEvent;
use crate::app::input::mailbox::Taken;
use crate::app::recording::session_writer::SessionHead;
use crate::app::stopwatch::Stopwatch;
use crate::app::window::Wake;
use crate::app::window::notices::{CameraState, Notices, Weight};
use crate::capture::live::{Now, is_live};
use crate::geometry::camera::Intrinsics;
use crate::render::{Gpu, Renderer};
use crate::scene::{CameraSettings, Scene};
use states::{DrawnPicture, Origin, Pending, PictureState, SceneState};

/// For composites of sources that do not say their rate.
const ASSUMED_FPS: f64 = 30.0;
/// A wait that is no shorter was one, milliseconds.
const INSTANT_MS: f64 = 0.5;

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
    /// What is to be selected, after what came into the scene or went.
    selection: Option<WindowCommand>,
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
            selection: None,
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
        if let Some(said) = self.recorders.take_ended(&self.pipeline) {
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
            self.notices.never_found.clone_from(&tracked.never_found);
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
    /// it, whichever is later. What was handed over before it was drawn was another one: it has yet to be shown.
    ///
    /// # Errors
    /// The GPU failed.
    pub fn was_shown(&mut self, handed_over_secs: f64) -> Result<()> {
        let picture = self.picture.drawn_mut();
        let is_handed_over = |pending: &mut Pending| pending.begun_secs <= handed_over_secs;
        let pending = picture.and_then(|picture| picture.pending.take_if(is_handed_over));
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

    /// The part that is done, 0 to 1, of what takes a scene's renderer longest to make; `None` where nothing of it is made.
    pub fn preparing(&self) -> Option<f32> {
        self.canvas.preparing()
    }

    /// How long the scene has been shown worse than it can be, or not at all, milliseconds.
    pub fn awaited_ms(&self) -> Option<f64> {
        self.canvas.awaited_ms()
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
    pub fn place(&self, thing: &str) -> Option<ThingPlace> {
        let scene = self.scene.open()?;
        let written = scene.document.place(thing)?;
        Some(match (&scene.previewed, written) {
            (
                Some(Edit::Place {
                    thing: it,
                    placement,
                }),
                ThingPlace::Free(_),
            ) if it == thing => ThingPlace::Free(*placement),
            (
                Some(Edit::Place {
                    thing: it,
                    placement,
                }),
                ThingPlace::TableTop { .. },
            ) if it == thing => {
                let height_m = placement.position_m.z;
                ThingPlace::TableTop { height_m }
            }
            _ => written,
        })
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

    /// What is shown, for a title.
    pub fn title(&self) -> String {
        match self.is_unsaved() {
            true => format!("{} (not saved)", self.camera.source),
            false => title_of(self.document(), &self.camera),
        }
    }

    /// Keeps a scene that nobody has saved, whatever becomes of the program: where its file is.
    pub fn keep_unsaved(&mut self) -> Option<PathBuf> {
        match &mut self.scene.open_mut()?.origin {
            Origin::Saved => None,
            Origin::Unsaved { folder } => Some(folder.keep()),
        }
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

    /// Frames of a session that has ended which have yet to be written; `None` where all are.
    pub fn frames_being_written(&self) -> Option<usize> {
        self.recorders.frames_being_written()
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
        let nothing_comes = matches!(
            self.notices.camera,
            CameraState::Failed(_) | CameraState::Ended
        );
        if nothing_comes && !self.recorders.records_session() {
            return self.tell(Weight::Trouble, "No pictures come that could be recorded.");
        }
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
        if let Some(said) = said.transpose() {
            self.say(said);
        }
    }

    /// Whether a camera that could not be opened is looked for.
    pub fn looks_for_camera(&self) -> bool {
        is_live(&self.camera.source) && matches!(self.notices.camera, CameraState::Failed(_))
    }

    /// Whether pictures still come, or may come again.
    pub fn is_live(&self) -> bool {
        !matches!(
            self.notices.camera,
            CameraState::Ended | CameraState::Failed(_)
        )
    }
}
