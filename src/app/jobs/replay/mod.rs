//! Replay: a recording in; the picture, its layers, poses and statistics out. Capture, tracking, rendering and writing
//! each have a thread and hand plain values on; no frame is dropped, and each frame's work depends on the frame alone.

mod contact_sheet;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use anyhow::{Context as _, Result, bail, ensure};
use glam::DAffine3;

use crate::capture::{Frame, FrameSource};
use crate::geometry::camera::Intrinsics;
use crate::render::{Gpu, Layers, QualityController, Renderer, Shown};
use crate::scene::{Scene, Shortcuts};
use crate::tracking::{AnchorPose, Tracker};

use crate::app::files::frame_sink::FrameSink;
use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::layer_files::Layer;
use crate::app::files::picture_files::write_text;
use crate::app::files::poses_file::{GivenPoses, PosesText};
use crate::app::files::result_kind::ResultKind;
use crate::app::files::video_writer::Codec;
use crate::app::input::mirror_watch::MirrorWatch;
use crate::app::input::sightings::Sightings;
use crate::app::scene_warnings;
use crate::app::stages::budget_words::budget_words;
use crate::app::stages::preparing;
use crate::app::stages::report::Report;
use crate::app::stages::source::{self, CalibrationNamed};
use crate::app::stages::stats::{Stats, detector_in_words, peak_memory_mib};
use crate::app::stages::tally::Tally;
use crate::app::stages::tracked::{
    Ended, Frames, Poser, QUEUE, TrackedFrame, each_tracked_frame, join,
};
use crate::app::stopwatch::Stopwatch;
use crate::app::talk;
use contact_sheet::ContactSheet;

/// A request to replay a recording.
#[derive(Debug, Clone, Default)]
pub struct ReplayRequest {
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
    /// Shortcuts that shadow volumes are not to take.
    pub without: Shortcuts,
    /// Part of the wanted graphics adapter's name.
    pub adapter: Option<String>,
    /// What the files may take the place of.
    pub replacing: Replacing,
}

/// Runs a replay. `stop` ends it after the frames at hand, with whole files.
///
/// # Errors
/// Anything that keeps a frame from being read, tracked, drawn or written; files are then not left half-written.
pub fn replay(request: &ReplayRequest, stop: &AtomicBool) -> Result<Report> {
    let watch = Stopwatch::start();
    let mut files = JobFiles::new(request.replacing);
    let mut scene = files.reads_scene(&request.scene)?;
    scene.shadows.without = request.without;
    for warning in scene_warnings::warnings(&scene) {
        talk::say(format_args!("warning: {warning}"));
    }
    request.name_files(&mut files)?;
    files.check()?;
    request.check_pictures()?;
    let (source, camera) = source::open(&scene, stop)?;
    let place = CalibrationNamed::ByKey.place();
    if let Some(remark) = camera.remark(&scene.camera.source, place) {
        talk::say(remark);
    }
    let intrinsics = camera.intrinsics();
    let (poser, given_frames) = poser(request, &scene, intrinsics)?;
    let drawing = (request.out.is_some() || request.sheet.is_some())
        .then(|| ReplayDrawing::open(request, &scene, &source, intrinsics, stop))
        .transpose()?;
    if drawing.is_none() && request.poses.is_none() && request.stats.is_none() {
        bail!("nothing to do: give --out, --sheet, --poses or --stats");
    }
    let mut run = ReplayRun {
        request,
        scene: &scene,
        poses: PosesText::new(),
        tally: Tally::new(scene.anchors.len()),
        drawn: 0,
        controller: None,
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
    let (ended, failure) = match run.all_frames(source, poser, drawing, last, stop) {
        Ok(ended) => (
            ended,
            run.missing_frames(last, stop).map(anyhow::Error::msg),
        ),
        Err(error) => (Ended::default(), Some(error)),
    };
    run.write_tables(size_px, ended.dropped, adapter, watch.elapsed_ms() * 1e-3)?;
    if let Some(failure) = failure {
        return Err(failure);
    }
    let done = talk::counted(run.tally.frames as usize, "frame");
    let report = Report::new(
        format!("{done}, {} drawn", run.drawn),
        run.remarks(),
        &scene.anchors,
        (&ended, &mut run.tally),
        scene.camera.mirror,
        stop.load(Ordering::Relaxed),
    );
    Ok(match given_frames {
        Some(frames) => report.missing(run.never_given(&frames)),
        // The video alone is whole without its anchors.
        None if !run.needs_poses() => report.missing(None),
        None => report,
    })
}

/// What tells where the anchors are, and in words which frames it was given poses for.
fn poser(
    request: &ReplayRequest,
    scene: &Scene,
    intrinsics: Intrinsics,
) -> Result<(Poser, Option<String>)> {
    let Some(path) = &request.poses_from else {
        let tracked = Poser::tracker(
            Tracker::new(&scene.tracking, &scene.anchors, intrinsics)?,
            MirrorWatch::new(&scene.tracking, scene.families()),
            Sightings::of_anchors(&scene.anchors),
        );
        return Ok((tracked, None));
    };
    let given = GivenPoses::read(path, &scene.anchors)?;
    let frames = given.frames_in_words();
    Ok((Poser::Given(given), Some(frames)))
}

impl ReplayRequest {
    /// A sheet is a PNG, and layers lie beside PNGs alone.
    fn check_pictures(&self) -> Result<()> {
        if let Some(sheet) = &self.sheet {
            let extension = sheet.extension().map(|it| it.to_ascii_lowercase());
            ensure!(
                extension.is_none_or(|extension| extension == "png"),
                "--sheet {}: the sheet is a PNG (.png)",
                sheet.display()
            );
        }
        if !self.layers.is_empty() {
            match &self.out {
                Some(out) if Codec::of_path(out).is_some() => bail!(
                    "--layers writes PNGs beside the pictures: give --out a folder, not {}",
                    out.display()
                ),
                Some(_) => {}
                None => {
                    bail!("--layers writes PNGs beside the pictures: give --out a folder for them")
                }
            }
        }
        Ok(())
    }

    /// What is read besides the scene, and what is written.
    fn name_files(&self, files: &mut JobFiles) -> Result<()> {
        if let Some(path) = &self.poses_from {
            files.reads(path);
        }
        if let Some(out) = &self.out {
            files.writes("--out", out, FrameSink::kind_of(out)?);
        }
        for (option, path, kind) in [
            ("--sheet", &self.sheet, ResultKind::Png),
            ("--poses", &self.poses, ResultKind::Poses),
            ("--stats", &self.stats, ResultKind::Stats),
        ] {
            if let Some(path) = path {
                files.writes(option, path, kind);
            }
        }
        Ok(())
    }
}

/// A frame on its way to the files.
struct DrawnFrame {
    index: u32,
    time_secs: f64,
    rgba: Vec<u8>,
    layers: Option<Layers>,
}

/// The renderer and the files of a replay, opened before the first frame so that mistakes show at once.
struct ReplayDrawing {
    gpu: Arc<Gpu>,
    renderer: Renderer,
    files: Files,
}

impl ReplayDrawing {
    fn open(
        request: &ReplayRequest,
        scene: &Scene,
        source: &FrameSource,
        intrinsics: Intrinsics,
        stop: &AtomicBool,
    ) -> Result<Self> {
        let gpu = Arc::new(Gpu::open(request.adapter.as_deref())?);
        talk::say(format_args!("drawing on {}", gpu.description()));
        let renderer = preparing::renderer(Arc::clone(&gpu), scene, intrinsics, stop)?;
        let sink = request
            .out
            .as_ref()
            .map(|out| FrameSink::create(out, source.size_px(), source.finest_fps()))
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
struct ReplayRun<'a> {
    request: &'a ReplayRequest,
    scene: &'a Scene,
    poses: PosesText,
    tally: Tally,
    drawn: u32,
    /// What the frame budget has led to so far.
    controller: Option<QualityController>,
}

impl ReplayRun<'_> {
    /// What there is to say of the whole.
    fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        let render = self.tally.log.summary().remove("render");
        if let (Some(controller), Some(times)) = (&self.controller, render) {
            remarks.push(budget_words(controller, times.p95_ms));
        }
        if self.tally.lost[0] > 0 && self.needs_poses() {
            remarks.push(format!(
                "the world's anchor was not found in {} of them; there the video is shown alone",
                self.tally.lost[0]
            ));
        }
        if self.request.poses_from.is_some() {
            let others = self.scene.anchors.iter().zip(&self.tally.lost).skip(1);
            let never = others.filter(|(_, lost)| **lost == self.tally.frames);
            remarks.extend(never.map(|(anchor, _)| {
                format!(
                    "no pose of \"{}\" is given for any frame played",
                    anchor.name
                )
            }));
        }
        remarks
    }

    /// Whether anything is made of poses: the video alone needs none.
    fn needs_poses(&self) -> bool {
        !self.request.bare || self.request.poses.is_some()
    }

    /// What to say where the given poses have none of the world's anchor for any frame played; `frames` are those that they have.
    fn never_given(&self, frames: &str) -> Option<String> {
        let path = self.request.poses_from.as_ref()?;
        (self.needs_poses() && self.tally.lost[0] == self.tally.frames).then(|| {
            format!(
                "{} has no pose of \"{}\" for any of the {} played; {frames}",
                path.display(),
                self.scene.anchors[0].name,
                talk::counted(self.tally.frames as usize, "frame"),
            )
        })
    }

    /// Capture → tracking → rendering (here) → writing.
    fn all_frames(
        &mut self,
        source: FrameSource,
        poser: Poser,
        drawing: Option<ReplayDrawing>,
        last: Option<u32>,
        stop: &AtomicBool,
    ) -> Result<Ended> {
        thread::scope(|scope| {
            let (to_files, from_renderer) = sync_channel(QUEUE);
            let (mut renderer, files) = match drawing {
                Some(drawing) => (Some(drawing.renderer), Some(drawing.files)),
                None => (None, None),
            };
            let request = self.request;
            let writing = scope.spawn(move || write_stage(request, files, &from_renderer));
            let ended = each_tracked_frame(
                Frames::Recorded(Box::new(source)),
                poser,
                last,
                stop,
                |tracked| self.one_frame(tracked, renderer.as_mut(), &to_files),
            );
            // Closing the end lets the writer finish. Rendering knows of a failed writer only that it is gone.
            drop(to_files);
            for (stage, times) in join(writing)? {
                times
                    .into_iter()
                    .for_each(|ms| self.tally.log.add(stage, ms));
            }
            ended
        })
    }

    /// Draws a frame and hands it on.
    fn one_frame(
        &mut self,
        tracked: TrackedFrame,
        mut renderer: Option<&mut Renderer>,
        to_files: &SyncSender<DrawnFrame>,
    ) -> Result<()> {
        self.tally.add(&tracked);
        let TrackedFrame {
            frame,
            poses,
            track_ms,
            ..
        } = tracked;
        let wanted = self
            .request
            .frames
            .as_ref()
            .is_none_or(|frames| frames.contains(&frame.index));
        let mut render_ms = None;
        if let (Some(renderer), false) = (&mut renderer, wanted) {
            // `--frames 25` shows what the whole replay shows in frame 25.
            renderer.set_time(frame.time_secs);
            renderer.pass_over(&self.camera_from_nodes(&frame, &poses));
        }
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

    /// What the frame's things stand on.
    fn camera_from_nodes(&self, frame: &Frame, poses: &[AnchorPose]) -> Vec<Option<DAffine3>> {
        let anchors: Vec<_> = poses.iter().map(|pose| pose.camera_from_anchor).collect();
        self.scene.camera_from_nodes(&anchors, frame.time_secs)
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
        let placed = self.camera_from_nodes(frame, poses);
        let whole = Stopwatch::start();
        let (uploaded, upload_ms) = Stopwatch::time(|| renderer.upload(frame));
        uploaded?;
        renderer.set_time(frame.time_secs);
        let visibility: Vec<_> = poses.iter().map(|pose| pose.visibility).collect();
        let visibility = self.scene.of_nodes(&visibility);
        let ((), submit_ms) = Stopwatch::time(|| renderer.draw_fading(&placed, &visibility, shown));
        let waiting = Stopwatch::start();
        renderer.wait()?;
        let wait_ms = waiting.elapsed_ms();
        let (rgba, readback_ms) = Stopwatch::time(|| renderer.read_picture());
        let rgba = rgba?;
        let render_ms = whole.elapsed_ms();

        self.tally.log.add("upload", upload_ms);
        self.tally.log.add("submit", submit_ms);
        self.tally.log.add("gpu_wait", wait_ms);
        self.tally.log.add("readback", readback_ms);
        self.tally.log.add("render", render_ms);
        renderer.spent(render_ms);
        self.controller = renderer.quality_controller().cloned();
        let gpu = renderer.gpu_times()?;
        if let Some(ms) = gpu.shadows_ms {
            self.tally.log.add("shadows", ms);
        }
        if let Some(ms) = gpu.composite_ms {
            self.tally.log.add("composite", ms);
        }
        let layers = (!self.request.layers.is_empty())
            .then(|| renderer.layers())
            .transpose()?;
        Ok((
            DrawnFrame {
                index: frame.index,
                time_secs: frame.time_secs,
                rgba,
                layers,
            },
            render_ms,
        ))
    }

    /// What to say when frames that were asked for are not in the recording.
    fn missing_frames(&self, last: Option<u32>, stop: &AtomicBool) -> Option<String> {
        let last = last?;
        (self.tally.last_read < Some(last) && !stop.load(Ordering::Relaxed)).then(|| {
            format!(
                "--frames asks for frame {last}, but {} ends after {}",
                self.scene.camera.source,
                talk::counted(self.tally.frames as usize, "frame")
            )
        })
    }

    /// Writes the tables that were asked for, of the frames that were done.
    fn write_tables(
        &self,
        size_px: [u32; 2],
        drops: u32,
        adapter: Option<String>,
        total_secs: f64,
    ) -> Result<()> {
        if let Some(path) = &self.request.poses {
            write_text(path, self.poses.as_str())?;
        }
        if let Some(path) = &self.request.stats {
            let stats = self.stats(size_px, drops, adapter, total_secs);
            write_text(path, &stats.text()?)?;
        }
        Ok(())
    }

    fn stats(
        &self,
        size_px: [u32; 2],
        drops: u32,
        adapter: Option<String>,
        total_secs: f64,
    ) -> Stats {
        let names = self.scene.anchors.iter().map(|anchor| anchor.name.clone());
        Stats {
            source: self.scene.camera.source.clone(),
            size_px,
            frames: self.tally.frames,
            drawn: self.drawn,
            drops,
            lost: names.zip(self.tally.lost.iter().copied()).collect(),
            detector: match &self.request.poses_from {
                Some(path) => format!("none: poses from {}", path.display()),
                None => detector_in_words(&self.scene.tracking, &self.scene.families()),
            },
            technique: Some(self.scene.chosen_technique().0.name()),
            adapter,
            stages: self.tally.log.summary(),
            total_secs,
            peak_memory_mib: peak_memory_mib(),
        }
    }
}

/// The files that pictures go to.
struct Files {
    sink: Option<FrameSink>,
    sheet: Option<ContactSheet>,
    size_px: [u32; 2],
}

/// Times of each frame, by stage.
type StageSamples = Vec<(&'static str, Vec<f64>)>;

/// Writes pictures and layers as they come, and finishes the files; gives what each stage took per frame.
fn write_stage(
    request: &ReplayRequest,
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
    for DrawnFrame {
        index,
        time_secs,
        rgba,
        layers,
    } in from_renderer
    {
        let (written, ms) = Stopwatch::time(|| -> Result<()> {
            if let Some(sink) = &mut sink {
                sink.push((index, time_secs), size_px, &rgba)?;
            }
            if let (Some(sink), Some(layers)) = (&mut sink, &layers) {
                sink.push_layers(index, size_px, layers, &request.layers)?;
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
