//! Track: a recording in; poses, detections and statistics out. No GPU, no virtual things.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Result, bail};

use crate::app::files::detections_file::DetectionsText;
use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::picture_files::write_text;
use crate::app::files::poses_file::PosesText;
use crate::app::files::result_kind::ResultKind;
use crate::app::input::capture_talk;
use crate::app::input::live_capture::{CaptureEvent, LiveCapture};
use crate::app::input::live_input::LiveInput;
use crate::app::input::mailbox::Taken;
use crate::app::input::mirror_watch::MirrorWatch;
use crate::app::input::sightings::Sightings;
use crate::app::input::usual_tracking::usual_tracking;
use crate::app::stages::known_camera::{KeptCamera, KnownCamera, LearntFrom, LiveCamera};
use crate::app::stages::report::Report;
use crate::app::stages::source::{self, CalibrationNamed};
use crate::app::stages::stats::{Stats, detector_in_words, peak_memory_mib};
use crate::app::stages::tally::Tally;
use crate::app::stages::tracked::{Ended, Frames, Poser, TrackedFrame, each_tracked_frame};
use crate::app::stopwatch::Stopwatch;
use crate::app::talk::{self, counted};
use crate::capture::live::is_live;
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, CameraSettings, Family, TrackingSettings};
use crate::tracking::focal::LearntCamera;
use crate::tracking::{AnchorPose, Detector, Tracker, grey_from_rgba};

/// A request to track a recording or a camera.
#[derive(Debug, Clone)]
pub struct TrackRequest {
    /// What is played, and what is looked for in it.
    pub input: TrackInput,
    /// Where to write the poses.
    pub poses: Option<PathBuf>,
    /// Where to write every marker that the detector sees or that a pose rests on.
    pub markers: Option<PathBuf>,
    /// Where to write what it cost.
    pub stats: Option<PathBuf>,
    /// What the files may take the place of.
    pub replacing: Replacing,
}

/// The recording that is tracked, and what is looked for in it.
#[derive(Debug, Clone)]
pub enum TrackInput {
    /// A scene file says both.
    Scene(PathBuf),
    /// A recording, and the anchors and tracking settings of a scene file that may play another.
    RecordingWithScene(CameraSettings, PathBuf),
    /// A recording, and any markers of one family and size: each that is seen is an anchor.
    LoneMarkers {
        /// The recording.
        camera: CameraSettings,
        /// Of all its markers.
        family: Family,
        /// Side of their black squares, metres.
        size_m: f64,
        /// As in [`TrackingSettings`].
        decimation: f64,
    },
}

/// Runs it. `stop` ends it after the frames at hand, with whole files.
///
/// # Errors
/// Anything that keeps a frame from being read or tracked, or a file from being written.
pub fn track(request: &TrackRequest, stop: &AtomicBool) -> Result<Report> {
    let watch = Stopwatch::start();
    if [&request.poses, &request.markers, &request.stats]
        .iter()
        .all(|file| file.is_none())
    {
        bail!("nothing to do: give --poses, --markers or --stats");
    }
    let mut files = JobFiles::new(request.replacing);
    let plan = TrackPlan::of(&request.input, &mut files)?;
    request.name_results(&mut files);
    files.check()?;
    let (frames_in, camera) = plan.open(request.input.calibration_named(), stop)?;
    let intrinsics = camera.intrinsics();
    let mut poser = plan.poser(intrinsics)?;
    if let (Frames::Live(..), KnownCamera::Learnt(_)) = (&frames_in, &camera) {
        poser = poser.of_live_camera(plan.live_camera(intrinsics.size_px)?);
    }
    let raw = request
        .markers
        .as_ref()
        .map(|_| Raw::new(&plan.settings, &plan.families()))
        .transpose()?;
    let mut run = TrackRun {
        request,
        tally: Tally::new(plan.anchors.len()),
        plan,
        intrinsics,
        raw,
        frames: Vec::new(),
    };
    // A camera is tracked until somebody says stop.
    let interrupts = matches!(frames_in, Frames::Recorded(_));
    // What was done before a failure is kept: the files are finished either way.
    let ended = each_tracked_frame(frames_in, poser, None, stop, |tracked| run.add(tracked));
    let (ended, failure) = match ended {
        Ok(ended) => (ended, None),
        Err(error) => (Ended::default(), Some(error)),
    };
    run.write(ended.dropped, &watch)?;
    if let Some(failure) = failure {
        return Err(failure);
    }
    Ok(run.report(&ended, interrupts && stop.load(Ordering::Relaxed)))
}

impl TrackInput {
    fn calibration_named(&self) -> CalibrationNamed {
        match self {
            Self::Scene(_) => CalibrationNamed::ByKey,
            Self::RecordingWithScene(..) | Self::LoneMarkers { .. } => CalibrationNamed::ByOption,
        }
    }
}

impl TrackRequest {
    fn name_results(&self, files: &mut JobFiles) {
        for (option, path, kind) in [
            ("--poses", &self.poses, ResultKind::Poses),
            ("--markers", &self.markers, ResultKind::Detections),
            ("--stats", &self.stats, ResultKind::Stats),
        ] {
            if let Some(path) = path {
                files.writes(option, path, kind);
            }
        }
    }
}

/// The state of the job as it goes.
struct TrackRun<'a> {
    request: &'a TrackRequest,
    plan: TrackPlan,
    intrinsics: Intrinsics,
    /// `None` where nobody asks what the detector sees.
    raw: Option<Raw>,
    frames: Vec<KeptFrame>,
    tally: Tally,
}

impl TrackRun<'_> {
    fn add(&mut self, tracked: TrackedFrame) -> Result<()> {
        self.tally.add(&tracked);
        if let Some(raw) = &mut self.raw {
            raw.add(&tracked)?;
        }
        self.plan.anchors.extend(tracked.came.iter().cloned());
        self.frames.push(KeptFrame::of(tracked));
        Ok(())
    }

    /// The anchors in the order in which they are written and told of; those that came by themselves by their numbers.
    fn listed(&self) -> Vec<usize> {
        let mut listed: Vec<usize> = (0..self.plan.anchors.len()).collect();
        if self.plan.every_marker.is_some() {
            listed.sort_by_key(|&anchor| self.plan.anchors[anchor].markers[0].id);
        }
        listed
    }

    /// An anchor's name, and the frames without a pose of it.
    fn lost(&self, anchor: usize) -> (String, u32) {
        (
            self.plan.anchors[anchor].name.clone(),
            self.tally.lost[anchor],
        )
    }

    fn write(&self, drops: u32, watch: &Stopwatch) -> Result<()> {
        let listed = self.listed();
        if let Some(path) = &self.request.poses {
            let text = poses_text(&self.plan.anchors, &listed, &self.frames);
            write_text(path, text.as_str())?;
        }
        if let (Some(path), Some(raw)) = (&self.request.markers, &self.raw) {
            write_text(path, raw.text.as_str())?;
        }
        if let Some(path) = &self.request.stats {
            let stats = Stats {
                source: self.plan.camera.source.clone(),
                size_px: self.intrinsics.size_px,
                frames: self.tally.frames,
                drawn: 0,
                drops,
                lost: listed.iter().map(|&anchor| self.lost(anchor)).collect(),
                detector: detector_in_words(&self.plan.settings, &self.plan.families()),
                technique: None,
                adapter: None,
                stages: self.tally.log.summary(),
                total_secs: watch.elapsed_ms() * 1e-3,
                peak_memory_mib: peak_memory_mib(),
            };
            write_text(path, &stats.text()?)?;
        }
        Ok(())
    }

    fn report(mut self, ended: &Ended, interrupted: bool) -> Report {
        let listed = self.listed();
        let lost = listed.iter().map(|&anchor| self.lost(anchor));
        let mut remarks: Vec<String> = lost
            .filter(|&(_, lost)| lost > 0)
            .map(|(name, lost)| format!("\"{name}\" was not found in {lost} of them"))
            .collect();
        let place = self.request.input.calibration_named().place();
        let learnt = ended.camera.map(KnownCamera::Learnt);
        remarks.extend(learnt.and_then(|camera| camera.remark(&self.plan.camera.source, place)));
        let frames = counted(self.tally.frames as usize, "frame");
        let done = match self.plan.every_marker.is_some() {
            true => format!("{frames}, {} found", counted(listed.len(), "marker")),
            false => frames,
        };
        Report::new(
            done,
            remarks,
            &self.plan.anchors,
            (ended, &mut self.tally),
            self.plan.camera.mirror,
            interrupted,
        )
    }
}

/// What an [`TrackInput`] comes to.
struct TrackPlan {
    camera: CameraSettings,
    settings: TrackingSettings,
    anchors: Vec<Anchor>,
    /// A family and the size of its markers where each that is seen is an anchor, as they come.
    every_marker: Option<(Family, f64)>,
}

impl TrackPlan {
    fn of(input: &TrackInput, files: &mut JobFiles) -> Result<Self> {
        Ok(match input {
            TrackInput::Scene(path) => {
                let scene = files.reads_scene(path)?;
                Self {
                    camera: scene.camera,
                    settings: scene.tracking,
                    anchors: scene.anchors,
                    every_marker: None,
                }
            }
            TrackInput::RecordingWithScene(camera, path) => {
                files.reads_camera(camera);
                let scene = files.reads_scene_to_play_another(path)?;
                Self {
                    camera: camera.clone(),
                    settings: scene.tracking,
                    anchors: scene.anchors,
                    every_marker: None,
                }
            }
            TrackInput::LoneMarkers {
                camera,
                family,
                size_m,
                decimation,
            } => {
                files.reads_camera(camera);
                files.reads_family(*family);
                Self {
                    camera: camera.clone(),
                    settings: usual_tracking(*decimation),
                    anchors: Vec::new(),
                    every_marker: Some((*family, *size_m)),
                }
            }
        })
    }
}

impl TrackPlan {
    fn families(&self) -> Vec<Family> {
        let markers = self.anchors.iter().flat_map(|anchor| &anchor.markers);
        let every_marker = self.every_marker.iter().map(|&(family, _)| family);
        markers
            .map(|marker| marker.family)
            .chain(every_marker)
            .collect()
    }

    /// Opens a recording or begins to open a camera.
    fn open(&self, named: CalibrationNamed, stop: &AtomicBool) -> Result<(Frames, KnownCamera)> {
        let source = &self.camera.source;
        if !is_live(source) {
            let from = self.learnt_from();
            let (frames, camera) =
                source::open_and_learn(&self.camera, &self.settings, from, stop)?;
            if let Some(remark) = camera.remark(source, named.place()) {
                talk::say(remark);
            }
            return Ok((Frames::Recorded(Box::new(frames)), camera));
        }
        let input = LiveInput::of(&self.camera)?;
        let now = Arc::new(Stopwatch::clock());
        let capture = Box::new(LiveCapture::start(source, &input.options(false), now, None));
        let camera = match input.calibration {
            Some(intrinsics) => KnownCamera::Calibrated(intrinsics),
            None => KnownCamera::Learnt(LearntCamera::guess(first_size_px(&capture, stop)?)),
        };
        Ok((Frames::Live(capture, camera.intrinsics()), camera))
    }

    /// What a camera that is not calibrated is learnt from.
    fn learnt_from(&self) -> LearntFrom<'_> {
        match self.every_marker {
            Some((family, _)) => LearntFrom::EveryMarker(family),
            None => LearntFrom::Anchors(&self.anchors),
        }
    }

    /// A live camera that is learnt while frames come.
    fn live_camera(&self, size_px: [u32; 2]) -> Result<LiveCamera> {
        let kept = KeptCamera::of(&self.camera.source);
        let from = self.learnt_from();
        Ok(LiveCamera::begin(
            &self.settings,
            from,
            size_px,
            kept,
            None,
        )?)
    }

    fn poser(&self, intrinsics: Intrinsics) -> Result<Poser> {
        let mirror_watch = MirrorWatch::new(&self.settings, self.families());
        Ok(match self.every_marker {
            Some((family, size_m)) => Poser::tracker(
                Tracker::of_every_marker(&self.settings, (family, size_m), intrinsics)?,
                mirror_watch,
                Sightings::of_family(family),
            ),
            None => Poser::tracker(
                Tracker::new(&self.settings, &self.anchors, intrinsics)?,
                mirror_watch,
                Sightings::of_anchors(&self.anchors),
            ),
        })
    }
}

/// The size of a camera's pictures, which its first one tells.
fn first_size_px(capture: &LiveCapture, stop: &AtomicBool) -> Result<[u32; 2]> {
    const PATIENCE: Duration = Duration::from_millis(50);
    let frames = capture.frames();
    loop {
        let taken = frames.take_within(PATIENCE);
        while let Some(event) = capture.next_event() {
            capture_talk::say(&event);
            if let CaptureEvent::Failed(error) = event {
                return Err(error.into());
            }
        }
        match taken {
            Taken::New(arrived) => return Ok(arrived.frame.size_px),
            Taken::Closed => bail!("no frame came"),
            Taken::Nothing if stop.load(Ordering::Relaxed) => bail!("interrupted; no frame came"),
            Taken::Nothing => {}
        }
    }
}

/// The poses of a frame, kept until all anchors are known.
struct KeptFrame {
    index: u32,
    time_secs: f64,
    track_ms: Option<f64>,
    /// By anchor, those alone that have a pose.
    poses: BTreeMap<usize, AnchorPose>,
}

impl KeptFrame {
    fn of(tracked: TrackedFrame) -> Self {
        let found = tracked.poses.into_iter().enumerate();
        Self {
            index: tracked.frame.index,
            time_secs: tracked.frame.time_secs,
            track_ms: tracked.track_ms,
            poses: found
                .filter(|(_, pose)| pose.camera_from_anchor.is_some())
                .collect(),
        }
    }
}

fn poses_text(anchors: &[Anchor], listed: &[usize], frames: &[KeptFrame]) -> PosesText {
    let listed_anchors: Vec<Anchor> = listed.iter().map(|&k| anchors[k].clone()).collect();
    let mut text = PosesText::new();
    for frame in frames {
        let poses: Vec<AnchorPose> = listed
            .iter()
            .map(|anchor| frame.poses.get(anchor).cloned().unwrap_or(AnchorPose::LOST))
            .collect();
        text.add_frame(
            (frame.index, frame.time_secs),
            &listed_anchors,
            &poses,
            (frame.track_ms, None),
        );
    }
    text
}

/// A detector beside the tracker, which between its searches does not look at the whole picture.
struct Raw {
    detector: Detector,
    grey: Vec<u8>,
    text: DetectionsText,
}

impl Raw {
    fn new(settings: &TrackingSettings, families: &[Family]) -> Result<Self> {
        Ok(Self {
            detector: Detector::new(settings, families)?,
            grey: Vec::new(),
            text: DetectionsText::new(),
        })
    }

    fn add(&mut self, tracked: &TrackedFrame) -> Result<()> {
        grey_from_rgba(&tracked.frame, &mut self.grey)?;
        let detections = self.detector.detect(&self.grey, tracked.frame.size_px)?;
        let (index, used) = (tracked.frame.index, &tracked.used);
        self.text.add_frame(index, &detections, used);
        Ok(())
    }
}

/// Whether a path names a scene file rather than a recording.
pub fn is_scene(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}
