//! The live program without its window: scene, camera, tracking, drawing and recording, moved on frame by frame by
//! whoever shows the picture.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, Result};

use super::beginning::{Opening, plan_of, same_camera};
use super::canvas::Canvas;
use super::demonstration::{self, Demonstration};
use super::eye::TrackedPicture;
use super::look::Look;
use super::meters::{Meters, Sample};
use super::pipeline::{Input, Pipeline};
use super::recorders::Recorders;
use super::shadow_clicks::{self, ShadowClicks};
use super::views::View;
use super::wish::{Clicks, Overlay, Selected, Wish};
use crate::app::authoring::{Edit, SceneDocument, SceneNews, SceneWatch};
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

/// For composites of sources that do not say their rate.
const ASSUMED_FPS: f64 = 30.0;
/// A wait that is no shorter was one, milliseconds.
const INSTANT_MS: f64 = 0.5;

/// A frame that was drawn, and not yet seen to be on the screen.
struct Pending {
    begun_secs: f64,
    arrived_secs: f64,
    sample: Sample,
}

/// Everything but the window.
pub struct Studio {
    now: Now,
    wake: Wake,
    camera: CameraSettings,
    calibration: Option<Intrinsics>,
    /// `None` as long as nobody has said what there is.
    document: Option<SceneDocument>,
    watch: Option<SceneWatch>,
    demonstration: Option<Demonstration>,
    pipeline: Pipeline,
    canvas: Canvas,
    recorders: Recorders,
    /// What there is to tell.
    pub notices: Notices,
    /// What it costs.
    pub meters: Meters,
    fps: Option<f64>,
    last: Option<TrackedPicture>,
    /// The view that [`Studio::last`] was drawn in, while nothing has changed since.
    drawn: Option<View>,
    /// A shown frame whose display has yet to be told of.
    pending: Option<Pending>,
    /// A light is being found in the picture, which is held meanwhile.
    clicks: Option<ShadowClicks>,
    /// What is shown while it lasts.
    previewed: Option<Edit>,
    /// Renderers that drew, one after the other: a new one has another picture.
    renderers: u64,
}

impl Studio {
    /// Begins to open the camera and to draw, by the clock `now`. `wake` is called from other threads when there is something to do. What
    /// the keys record goes into the folder `out`. A recording begins again at its end if it `repeats`.
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
            &Input {
                source: camera.source.clone(),
                options: input.options(repeats),
                calibration: input.calibration,
            },
            plan_of(document.as_ref()),
            &now,
            Arc::clone(&wake),
        );
        let mut studio = Self {
            canvas: Canvas::new(gpu, Arc::new(scene.unwrap_or_default()), Arc::clone(&wake)),
            watch: None,
            demonstration: None,
            recorders: Recorders::new(out.to_owned()),
            notices: Notices::new(),
            meters: Meters::default(),
            fps: None,
            last: None,
            drawn: None,
            pending: None,
            clicks: None,
            previewed: None,
            renderers: 0,
            calibration: input.calibration,
            document,
            pipeline,
            camera,
            now,
            wake,
        };
        studio.watch_files();
        if studio.calibration.is_none() {
            studio.tell(
                Weight::Trouble,
                "The camera is not calibrated: a usual one is assumed, and things will not stand quite still. See gnomon \
                 calibrate --help.",
            );
        }
        studio
    }

    /// Takes what has come, and draws it as `look` wants it. Tells whether the picture is another than before.
    ///
    /// # Errors
    /// The GPU failed: nothing can be shown any more.
    pub fn step(&mut self, look: &Look) -> Result<bool> {
        let now_secs = (self.now)();
        while let Some(event) = self.pipeline.next_event() {
            if let CaptureEvent::Opened(opened) | CaptureEvent::Back(opened) = &event {
                self.fps = opened.fps.or(self.fps);
            }
            self.notices.take(now_secs, &event);
        }
        self.take_scene_news();
        if let Some(said) = self.recorders.take_failure(&self.pipeline) {
            self.say(said);
        }
        self.pipeline.want_rejected(look.shows(Overlay::Rejected));
        if self.canvas.set_without(look.without) {
            self.drawn = None;
        }
        if self.canvas.improve()? {
            self.drawn = None;
            self.renderers += 1;
        }
        let is_held = self.last.is_some() && (look.holds || self.clicks.is_some());
        if let (false, Taken::New(picture)) =
            (is_held, self.pipeline.tracked().take_within(Duration::ZERO))
        {
            self.recorders.add_poses(&picture);
            self.notices.tracking.clone_from(&picture.trouble);
            self.last = Some(picture);
            self.draw(look, true)?;
            return Ok(true);
        }
        let view_is_drawn = self.drawn == Some(self.view(look));
        if !view_is_drawn && self.last.is_some() {
            self.draw(look, false)?;
            return Ok(true);
        }
        Ok(false)
    }

    /// Virtual things would hide the shadows that are to be clicked.
    fn view(&self, look: &Look) -> View {
        match self.clicks {
            Some(_) => View::Bare,
            None => look.view,
        }
    }

    /// Draws the last frame; `is_new`: for the first time.
    fn draw(&mut self, look: &Look, is_new: bool) -> Result<()> {
        let Some(picture) = &self.last else {
            return Ok(());
        };
        let size_before = self.canvas.renderer().map(|(_, size_px)| size_px);
        let begun_secs = (self.now)();
        let view = self.view(look);
        let drawn = self.canvas.draw(picture, view);
        drawn.with_context(|| format!("frame {}", picture.frame.index))?;
        let size_px = self.canvas.renderer().map(|(_, size_px)| size_px);
        if size_px != size_before {
            self.renderers += 1;
        }
        self.drawn = Some(view);
        if is_new {
            self.pending = Some(Pending {
                begun_secs,
                arrived_secs: picture.arrived_secs,
                sample: Sample {
                    wait_ms: picture.wait_ms,
                    track_ms: picture.track_ms,
                    ..Sample::default()
                },
            });
            if let (true, Some((renderer, size_px))) =
                (self.recorders.records_video(), self.canvas.renderer())
            {
                let (time_secs, rgba) = (picture.frame.time_secs, renderer.read_picture()?);
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
        let (Some(pending), Some((renderer, _))) = (self.pending.take(), self.canvas.renderer())
        else {
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
        self.last.as_ref()
    }

    /// The scene as it is shown; `None` on first use.
    pub fn scene(&self) -> Option<&Scene> {
        self.document.as_ref().map(SceneDocument::scene)
    }

    /// Where a thing stands in the numbers of the scene, with what is being dragged where it is.
    pub fn placement(&self, thing: &str) -> Option<Placement> {
        match &self.previewed {
            Some(Edit::Place {
                thing: previewed,
                placement,
            }) if previewed == thing => Some(*placement),
            _ => self.document.as_ref()?.placement(thing),
        }
    }

    /// The scene with its file; `None` on first use.
    pub fn document(&self) -> Option<&SceneDocument> {
        self.document.as_ref()
    }

    /// Whether the scene has yet to be saved.
    pub fn is_unsaved(&self) -> bool {
        self.demonstration.is_some()
    }

    /// Frames that came, and how many of them were not shown: see [`Pipeline::dropped`].
    pub fn frames(&self) -> (u64, [u64; 3]) {
        (self.pipeline.captured(), self.pipeline.dropped())
    }

    /// The clicks by which a light is being found.
    pub fn clicks(&self) -> Option<&ShadowClicks> {
        self.clicks.as_ref()
    }

    /// Whether a session and a video are being recorded.
    pub fn records(&self) -> [bool; 2] {
        [
            self.recorders.records_session(),
            self.recorders.records_video(),
        ]
    }

    /// Fulfils a wish that is not the window's own. What goes wrong is told as a notice.
    pub fn fulfil(&mut self, wish: Wish, look: &Look) {
        match wish {
            Wish::Preview(edit) => self.preview(&edit),
            Wish::Commit(edit) => self.commit(&edit),
            Wish::EndPreview => {
                self.previewed = None;
                if let Some(document) = &mut self.document {
                    document.end_preview();
                    self.scene_changed(true);
                }
            }
            Wish::Undo => self.edit(SceneDocument::undo),
            Wish::Redo => self.edit(SceneDocument::redo),
            Wish::Screenshot => self.screenshot(),
            Wish::ToggleSession => self.toggle_session(),
            Wish::ToggleVideo => {
                let Some((_, size_px)) = self.canvas.renderer() else {
                    return self.tell(Weight::Trouble, "There is no picture yet.");
                };
                let fps = self.fps.unwrap_or(ASSUMED_FPS);
                let said = self.recorders.toggle_video(size_px, fps);
                self.say(said);
            }
            Wish::Clicks(clicks) => self.take_clicks(clicks, look),
            Wish::Demonstrate { id, size_m } => self.demonstrate(id, size_m),
            Wish::Save(path) => self.save(&path),
            Wish::ToggleSelected => {
                if let (Some(Selected::Thing(thing)), Some(scene)) = (&look.selected, self.scene())
                {
                    let mut things = scene.phantoms.iter().chain(&scene.virtuals);
                    let found = things.find(|found| found.name == *thing);
                    if let Some(visible) = found.map(|found| !found.visible) {
                        let thing = thing.clone();
                        self.commit(&Edit::Show { thing, visible });
                    }
                }
            }
            Wish::RemoveSelected => match &look.selected {
                Some(Selected::Thing(name)) => self.commit(&Edit::RemoveVirtual(name.clone())),
                Some(Selected::Light(index)) => self.commit(&Edit::RemoveLight(*index)),
                None => {}
            },
            // The window's own.
            Wish::Select(_)
            | Wish::Show(_)
            | Wish::Toggle(_)
            | Wish::ToggleShortcut(_)
            | Wish::TogglePanel
            | Wish::ToggleKeys
            | Wish::ToggleHold
            | Wish::ToggleFullScreen
            | Wish::Escape
            | Wish::Quit => {}
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
        let shown = self.document.as_mut().is_some_and(|d| d.preview(edit));
        if shown {
            self.previewed = Some(edit.clone());
            self.scene_changed(false);
        }
    }

    fn commit(&mut self, edit: &Edit) {
        self.edit(|document| document.commit(edit));
    }

    fn edit(
        &mut self,
        change: impl FnOnce(&mut SceneDocument) -> Result<(), crate::app::authoring::EditError>,
    ) {
        self.previewed = None;
        let Some(document) = &mut self.document else {
            return;
        };
        if let Err(error) = change(document) {
            self.tell(Weight::Trouble, error.to_string());
        }
        self.scene_changed(true);
    }

    /// The scene is another: what depends on it follows.
    fn scene_changed(&mut self, lasting: bool) {
        let Some(document) = &self.document else {
            return;
        };
        let scene = Arc::new(document.scene().clone());
        self.pipeline.set_plan(plan_of(Some(document)));
        self.canvas.set_scene(scene, lasting);
        self.drawn = None;
    }

    fn take_scene_news(&mut self) {
        while let Some(news) = self.watch.as_ref().and_then(SceneWatch::next) {
            match news {
                SceneNews::Mistaken(error) => self.notices.scene = Some(error.to_string()),
                SceneNews::Changed(change) => {
                    let camera_before = self.camera.clone();
                    let taken = self.document.as_mut().is_some_and(|d| d.take(*change));
                    if !taken {
                        continue;
                    }
                    self.notices.scene = None;
                    self.scene_changed(true);
                    self.watch_files();
                    let camera = self.scene().map(|scene| scene.camera.clone());
                    if camera.is_some_and(|camera| !same_camera(&camera, &camera_before)) {
                        self.tell(
                            Weight::Trouble,
                            "The scene's [camera] was changed: start again to take it.",
                        );
                    }
                }
            }
        }
    }

    fn watch_files(&mut self) {
        let wake = Arc::clone(&self.wake);
        self.watch = self.document.as_ref().map(|d| d.watch(move || wake()));
    }

    fn take_clicks(&mut self, step: Clicks, look: &Look) {
        let (Some(document), Some(picture)) = (&self.document, &self.last) else {
            return self.tell(Weight::Trouble, "There is no picture of the scene yet.");
        };
        match (step, &mut self.clicks) {
            (Clicks::Begin, clicks) => {
                *clicks = ShadowClicks::begin(document.scene(), picture);
                if clicks.is_none() {
                    self.tell(Weight::Trouble, "The world's markers are not seen.");
                }
            }
            (Clicks::At(pixel), Some(clicks)) => {
                if let Err(why) = clicks.click(pixel) {
                    self.tell(Weight::Trouble, why);
                }
            }
            (Clicks::TakeBack, Some(clicks)) => clicks.take_back(),
            (Clicks::Cancel, clicks) => *clicks = None,
            (Clicks::Find(freedom), Some(clicks)) => match clicks.find(picture, freedom) {
                Ok(found) => {
                    let index = match look.selected {
                        Some(Selected::Light(index)) => index,
                        _ => 0,
                    };
                    let edits = shadow_clicks::edits(document.scene(), index, &found);
                    self.clicks = None;
                    for edit in edits {
                        self.commit(&edit);
                    }
                    self.tell(Weight::Done, shadow_clicks::in_words(&found));
                }
                Err(why) => self.tell(Weight::Trouble, why),
            },
            (_, None) => {}
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
            scene: self.document.as_ref().map(|d| d.path().to_owned()),
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
                self.document = Some(document);
                self.demonstration = Some(made);
                self.watch_files();
                self.scene_changed(true);
            }
            Err(error) => self.tell(Weight::Trouble, format!("{error:#}")),
        }
    }

    fn save(&mut self, path: &Path) {
        let Some(document) = &self.document else {
            return;
        };
        let saved = demonstration::save(document.text(), path)
            .map_err(anyhow::Error::from)
            .and_then(|()| Ok(SceneDocument::open(path)?));
        match saved {
            Ok(document) => {
                self.document = Some(document);
                self.demonstration = None;
                self.watch_files();
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
