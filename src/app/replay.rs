//! Replay: a recording in; the picture, its layers, poses and statistics out. Capture, tracking, rendering and writing
//! each have a thread and hand plain values on; no frame is dropped, and each frame's work depends on the frame alone.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use anyhow::{Context as _, Result, anyhow, bail};

use crate::capture::{Frame, FrameSource, check_frame_size, load_calibration};
use crate::geometry::camera::Intrinsics;
use crate::render::{Gpu, Layers, Renderer, Shown};
use crate::scene::{DetectorKind, Scene, Technique};
use crate::tracking::{AnchorPose, Tracker};

use super::check;
use super::contact_sheet::ContactSheet;
use super::layer_files::{Layer, write_layers};
use super::output::FrameSink;
use super::picture_files::write_text;
use super::poses_file::{GivenPoses, PosesText};
use super::progress::Progress;
use super::stats::{StageLog, Stats, peak_memory_mib};
use super::stopwatch::Stopwatch;
use super::video_writer::Codec;

/// Frames that may wait between two stages: enough to even out their times, few enough to stay small.
const QUEUE: usize = 3;

/// What a replay is asked for.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// The scene file.
    pub scene: PathBuf,
    /// A video (by its extension) or a folder of PNGs; `None`: nothing is drawn, which needs no GPU.
    pub out: Option<PathBuf>,
    /// Layers to be written beside the PNGs.
    pub layers: BTreeSet<Layer>,
    /// The frames to be drawn, by their index in the recording; `None`: all.
    pub frames: Option<BTreeSet<u32>>,
    /// Show no virtual thing.
    pub bare: bool,
    /// Where to write the poses.
    pub poses: Option<PathBuf>,
    /// Poses that replace the tracker's.
    pub poses_from: Option<PathBuf>,
    /// Where to write what it cost.
    pub stats: Option<PathBuf>,
    /// Where to put a sheet of small pictures.
    pub sheet: Option<PathBuf>,
    /// Part of the wanted graphics adapter's name.
    pub adapter: Option<String>,
}

/// What a replay did.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Frames that were read.
    pub frames: u32,
    /// Frames that were drawn.
    pub drawn: u32,
    /// Frames in which the world had no pose.
    pub world_lost: u32,
    /// What was wrong with the recording, in words.
    pub notices: Vec<String>,
    /// Whether it was told to stop before the end.
    pub interrupted: bool,
    /// Median over the frames of the world's reprojection error, pixels; `None` without a tracker.
    pub reprojection_px: Option<f64>,
}

/// Runs a replay. `stop` ends it after the frames at hand, with whole files.
///
/// # Errors
/// Anything that keeps a frame from being read, tracked, drawn or written; files are then not left half-written.
pub fn replay(request: &Request, stop: &AtomicBool) -> Result<Report> {
    let watch = Stopwatch::start();
    let scene = Scene::load(&request.scene)?;
    for warning in check::warnings(&scene) {
        eprintln!("warning: {warning}");
    }
    let source = FrameSource::open(&scene.camera.source)?;
    let intrinsics = calibration(&scene, &source)?;
    if !request.layers.is_empty() {
        match &request.out {
            Some(out) if Codec::of_path(out).is_some() => bail!(
                "--layers writes PNGs beside the pictures: give --out a folder, not {}",
                out.display()
            ),
            Some(_) => {}
            None => bail!("--layers writes PNGs beside the pictures: give --out a folder for them"),
        }
    }
    for written in [&request.out, &request.sheet, &request.poses, &request.stats] {
        refuse_to_overwrite(&source, written.as_deref())?;
    }
    let poser = match &request.poses_from {
        Some(path) => Poser::Given(GivenPoses::read(path, &scene.anchors)?),
        None => Poser::Tracker(Box::new(Tracker::new(
            &scene.tracking,
            &scene.anchors,
            intrinsics,
        )?)),
    };
    let drawing = (request.out.is_some() || request.sheet.is_some())
        .then(|| Drawing::open(request, &scene, &source, intrinsics))
        .transpose()?;
    if drawing.is_none() && request.poses.is_none() && request.stats.is_none() {
        bail!("nothing to do: give --out, --sheet, --poses or --stats");
    }
    let mut run = Run {
        request,
        scene: &scene,
        poses: PosesText::new(),
        log: StageLog::default(),
        lost: vec![0; scene.anchors.len()],
        reprojections_px: Vec::new(),
        frames: 0,
        last_read: None,
        drawn: 0,
    };
    let adapter = drawing
        .as_ref()
        .map(|drawing| drawing.gpu.description().to_owned());
    let size_px = source.size_px();
    let last = request
        .frames
        .as_ref()
        .and_then(|frames| frames.last().copied());
    // What was done before a failure is kept: the files are finished either way.
    let (notices, failure) = match run.all_frames(source, poser, drawing, last, stop) {
        Ok(notices) => (
            notices,
            run.missing_frames(last, stop).map(anyhow::Error::msg),
        ),
        Err(error) => (Vec::new(), Some(error)),
    };
    if let Some(path) = &request.poses {
        write_text(path, run.poses.as_str())?;
    }
    let dropped = notices
        .iter()
        .map(crate::capture::Notice::lost_frames)
        .sum();
    if let Some(path) = &request.stats {
        let stats = run.stats(size_px, dropped, adapter, watch.elapsed_ms() * 1e-3);
        let text = serde_json::to_string_pretty(&stats)?;
        write_text(path, &format!("{text}\n"))?;
    }
    if let Some(failure) = failure {
        return Err(failure);
    }
    run.reprojections_px.sort_by(f64::total_cmp);
    Ok(Report {
        frames: run.frames,
        drawn: run.drawn,
        world_lost: run.lost[0],
        notices: notices.iter().map(ToString::to_string).collect(),
        interrupted: stop.load(Ordering::Relaxed),
        reprojection_px: run
            .reprojections_px
            .get(run.reprojections_px.len() / 2)
            .copied(),
    })
}

/// The scene's own calibration, else what the recording carries.
fn calibration(scene: &Scene, source: &FrameSource) -> Result<Intrinsics> {
    let intrinsics = match &scene.camera.calibration {
        Some(path) => load_calibration(path)?,
        None => source.calibration().ok_or_else(|| {
            anyhow!(
                "{} carries no calibration: give [camera] calibration in the scene",
                scene.camera.source
            )
        })?,
    };
    check_frame_size(&intrinsics, source.size_px(), &scene.camera.source)?;
    Ok(intrinsics)
}

/// A recording is never written over: not the video that is played, nor anything in its folder.
fn refuse_to_overwrite(source: &FrameSource, written: Option<&Path>) -> Result<()> {
    let Some(written) = written else {
        return Ok(());
    };
    let (Ok(recording), Some(target)) = (source.path().canonicalize(), resolved(written)) else {
        return Ok(());
    };
    let lies_in = target == recording || (recording.is_dir() && target.starts_with(&recording));
    if lies_in {
        bail!(
            "{} is, or lies in, the recording {} that is being played; write elsewhere",
            written.display(),
            source.path().display()
        );
    }
    Ok(())
}

/// The real place of a file that may not be there yet.
fn resolved(path: &Path) -> Option<PathBuf> {
    if let Ok(real) = path.canonicalize() {
        return Some(real);
    }
    let parent = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    Some(resolved(parent)?.join(path.file_name()?))
}

/// Where poses come from.
enum Poser {
    Tracker(Box<Tracker>),
    Given(GivenPoses),
}

impl Poser {
    /// The poses, and what a tracker took for them.
    fn poses(&mut self, frame: &Frame) -> Result<(Vec<AnchorPose>, Option<f64>)> {
        match self {
            Self::Tracker(tracker) => {
                let (poses, ms) = Stopwatch::time(|| tracker.track(frame));
                Ok((poses?, Some(ms)))
            }
            Self::Given(given) => Ok((given.of_frame(frame.index), None)),
        }
    }
}

/// A frame with the poses that were measured in it.
struct TrackedFrame {
    frame: Frame,
    poses: Vec<AnchorPose>,
    decode_ms: f64,
    track_ms: Option<f64>,
}

/// A frame on its way to the files.
struct DrawnFrame {
    index: u32,
    rgba: Vec<u8>,
    layers: Option<Layers>,
}

/// What drawing needs, opened before the first frame so that mistakes show at once.
struct Drawing {
    gpu: Arc<Gpu>,
    renderer: Renderer,
    files: Files,
}

impl Drawing {
    fn open(
        request: &Request,
        scene: &Scene,
        source: &FrameSource,
        intrinsics: Intrinsics,
    ) -> Result<Self> {
        let gpu = Arc::new(Gpu::open(request.adapter.as_deref())?);
        eprintln!("drawing on {}", gpu.description());
        let renderer = Renderer::new(Arc::clone(&gpu), scene, intrinsics)?;
        let sink = request
            .out
            .as_ref()
            .map(|out| FrameSink::create(out, source.size_px(), source.fps()))
            .transpose()?;
        let sheet = request.sheet.as_ref().map(|_| ContactSheet::new(4, 3));
        Ok(Self {
            gpu,
            renderer,
            files: Files {
                sink,
                sheet,
                size_px: source.size_px(),
            },
        })
    }
}

/// The state of a replay as it goes.
struct Run<'a> {
    request: &'a Request,
    scene: &'a Scene,
    poses: PosesText,
    log: StageLog,
    lost: Vec<u32>,
    reprojections_px: Vec<f64>,
    frames: u32,
    /// Index of the frame that was read last; a damaged recording lacks some before it.
    last_read: Option<u32>,
    drawn: u32,
}

impl Run<'_> {
    /// Capture → tracking → rendering (here) → writing.
    fn all_frames(
        &mut self,
        source: FrameSource,
        poser: Poser,
        drawing: Option<Drawing>,
        last: Option<u32>,
        stop: &AtomicBool,
    ) -> Result<Vec<crate::capture::Notice>> {
        let expected = match last {
            Some(last) => Some(last + 1),
            None => source.frame_count(),
        };
        let progress = Progress::new(expected);
        thread::scope(|scope| {
            let (to_tracker, from_camera) = sync_channel(QUEUE);
            let (to_renderer, from_tracker) = sync_channel(QUEUE);
            let (to_files, from_renderer) = sync_channel(QUEUE);
            let capture = scope.spawn(move || capture_stage(source, &to_tracker, last, stop));
            let tracking = scope.spawn(move || track_stage(poser, &from_camera, &to_renderer));
            let (mut renderer, files) = match drawing {
                Some(drawing) => (Some(drawing.renderer), Some(drawing.files)),
                None => (None, None),
            };
            let request = self.request;
            let writing = scope.spawn(move || write_stage(request, files, &from_renderer));

            let mut outcome = Ok(());
            for tracked in &from_tracker {
                outcome = self.one_frame(tracked, renderer.as_mut(), &to_files);
                progress.advance();
                if outcome.is_err() {
                    break;
                }
            }
            // Closing both ends lets the other stages finish.
            drop((from_tracker, to_files));
            let written = join(writing);
            let tracked = join(tracking);
            let captured = join(capture);
            progress.finish();
            // A stage that fails stops those before it: the last one knows why. Rendering knows of a failed writer
            // only that it is gone.
            for (stage, times) in written? {
                times.into_iter().for_each(|ms| self.log.add(stage, ms));
            }
            outcome?;
            tracked?;
            captured
        })
    }

    /// Draws a frame and hands it on.
    fn one_frame(
        &mut self,
        tracked: TrackedFrame,
        renderer: Option<&mut Renderer>,
        to_files: &SyncSender<DrawnFrame>,
    ) -> Result<()> {
        let TrackedFrame {
            frame,
            poses,
            decode_ms,
            track_ms,
        } = tracked;
        self.frames += 1;
        self.last_read = Some(frame.index);
        self.log.add("decode", decode_ms);
        if let Some(ms) = track_ms {
            self.log.add("track", ms);
            if poses[0].camera_from_anchor.is_some() {
                self.reprojections_px.push(poses[0].reprojection_px);
            }
        }
        for (lost, pose) in self.lost.iter_mut().zip(&poses) {
            *lost += u32::from(pose.camera_from_anchor.is_none());
        }
        let wanted = self
            .request
            .frames
            .as_ref()
            .is_none_or(|frames| frames.contains(&frame.index));
        let mut render_ms = None;
        if let (Some(renderer), true) = (renderer, wanted) {
            let (drawn, ms) = self
                .draw(renderer, &frame, &poses)
                .with_context(|| format!("frame {}", frame.index))?;
            render_ms = Some(ms);
            self.drawn += 1;
            if to_files.send(drawn).is_err() {
                bail!("writing has stopped");
            }
        }
        self.poses.add_frame(
            (frame.index, frame.time_secs),
            &self.scene.anchors,
            &poses,
            (track_ms, render_ms),
        );
        Ok(())
    }

    fn draw(
        &mut self,
        renderer: &mut Renderer,
        frame: &Frame,
        poses: &[AnchorPose],
    ) -> Result<(DrawnFrame, f64)> {
        let shown = if self.request.bare {
            Shown::Bare
        } else {
            Shown::Composite
        };
        let placed: Vec<_> = poses.iter().map(|pose| pose.camera_from_anchor).collect();
        let whole = Stopwatch::start();
        let (uploaded, upload_ms) = Stopwatch::time(|| renderer.upload(frame));
        uploaded?;
        let visibility: Vec<_> = poses.iter().map(|pose| pose.visibility).collect();
        let ((), submit_ms) = Stopwatch::time(|| renderer.draw_fading(&placed, &visibility, shown));
        let waiting = Stopwatch::start();
        renderer.wait()?;
        let wait_ms = waiting.elapsed_ms();
        let (rgba, readback_ms) = Stopwatch::time(|| renderer.read_picture());
        let rgba = rgba?;
        let render_ms = whole.elapsed_ms();

        self.log.add("upload", upload_ms);
        self.log.add("submit", submit_ms);
        self.log.add("gpu_wait", wait_ms);
        self.log.add("readback", readback_ms);
        self.log.add("render", render_ms);
        let gpu = renderer.gpu_times()?;
        if let Some(ms) = gpu.shadows_ms {
            self.log.add("shadows", ms);
        }
        if let Some(ms) = gpu.composite_ms {
            self.log.add("composite", ms);
        }
        let layers = (!self.request.layers.is_empty())
            .then(|| renderer.layers())
            .transpose()?;
        Ok((
            DrawnFrame {
                index: frame.index,
                rgba,
                layers,
            },
            render_ms,
        ))
    }

    /// What to say when frames that were asked for are not in the recording.
    fn missing_frames(&self, last: Option<u32>, stop: &AtomicBool) -> Option<String> {
        let last = last?;
        (self.last_read < Some(last) && !stop.load(Ordering::Relaxed)).then(|| {
            format!(
                "--frames asks for frame {last}, but {} ends after {} frames",
                self.scene.camera.source, self.frames
            )
        })
    }

    fn stats(
        &self,
        size_px: [u32; 2],
        drops: u32,
        adapter: Option<String>,
        total_secs: f64,
    ) -> Stats {
        let names = self.scene.anchors.iter().map(|anchor| anchor.name.clone());
        let tracking = &self.scene.tracking;
        Stats {
            source: self.scene.camera.source.clone(),
            size_px,
            frames: self.frames,
            drawn: self.drawn,
            drops,
            lost: names.zip(self.lost.iter().copied()).collect(),
            detector: match (&self.request.poses_from, tracking.detector) {
                (Some(path), _) => format!("none: poses from {}", path.display()),
                (None, DetectorKind::AprilTag) => {
                    format!("apriltag, decimation {}", tracking.decimation)
                }
                (None, DetectorKind::Aruco) => "aruco".to_owned(),
            },
            technique: match self.scene.chosen_technique().0 {
                Technique::Auto => "auto",
                Technique::Volumes => "volumes",
            }
            .to_owned(),
            adapter,
            stages: self.log.summary(),
            total_secs,
            peak_memory_mib: peak_memory_mib(),
        }
    }
}

/// Reads frames until the end, the last one wanted, or a stop; gives what was wrong with the recording.
fn capture_stage(
    mut source: FrameSource,
    to_tracker: &SyncSender<(Frame, f64)>,
    last: Option<u32>,
    stop: &AtomicBool,
) -> Result<Vec<crate::capture::Notice>> {
    while !stop.load(Ordering::Relaxed) {
        let (frame, decode_ms) = Stopwatch::time(|| source.next_frame());
        let Some(frame) = frame? else { break };
        let index = frame.index;
        let receiver_gone = to_tracker.send((frame, decode_ms)).is_err();
        if receiver_gone || last.is_some_and(|last| index >= last) {
            break;
        }
    }
    Ok(source.notices().to_vec())
}

fn track_stage(
    mut poser: Poser,
    from_camera: &Receiver<(Frame, f64)>,
    to_renderer: &SyncSender<TrackedFrame>,
) -> Result<()> {
    for (frame, decode_ms) in from_camera {
        let (poses, track_ms) = poser
            .poses(&frame)
            .with_context(|| format!("frame {}", frame.index))?;
        if to_renderer
            .send(TrackedFrame {
                frame,
                poses,
                decode_ms,
                track_ms,
            })
            .is_err()
        {
            break;
        }
    }
    Ok(())
}

/// The files that pictures go to.
struct Files {
    sink: Option<FrameSink>,
    sheet: Option<ContactSheet>,
    size_px: [u32; 2],
}

/// For each stage what each frame took.
type StageSamples = Vec<(&'static str, Vec<f64>)>;

/// Writes pictures and layers as they come, and finishes the files; gives what each stage took per frame.
fn write_stage(
    request: &Request,
    files: Option<Files>,
    from_renderer: &Receiver<DrawnFrame>,
) -> Result<StageSamples> {
    let Some(Files {
        mut sink,
        mut sheet,
        size_px,
    }) = files
    else {
        return Ok(Vec::new());
    };
    let mut encode_ms = Vec::new();
    let folder = request.out.as_deref().unwrap_or(Path::new("."));
    for DrawnFrame {
        index,
        rgba,
        layers,
    } in from_renderer
    {
        let (written, ms) = Stopwatch::time(|| -> Result<()> {
            if let Some(sink) = &mut sink {
                sink.push(index, size_px, &rgba)?;
            }
            if let Some(layers) = &layers {
                write_layers(folder, index, size_px, layers, &request.layers)?;
            }
            Ok(())
        });
        written?;
        encode_ms.push(ms);
        if let Some(sheet) = &mut sheet {
            sheet.push(size_px, &rgba);
        }
    }
    if let Some(sink) = sink {
        sink.finish()?;
    }
    if let (Some(sheet), Some(path)) = (sheet, &request.sheet) {
        sheet.write(path)?;
    }
    Ok(vec![("encode", encode_ms)])
}

fn join<T>(handle: thread::ScopedJoinHandle<'_, Result<T>>) -> Result<T> {
    handle
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
