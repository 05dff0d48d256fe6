//! Board: a recording of markers stuck about a table in, their layout as a scene's `[[board]]` out.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail};
use glam::DVec3;

use crate::app::files::anchor_block;
use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::picture_files::write_text;
use crate::app::files::result_kind::ResultKind;
use crate::app::input::usual_tracking::usual_tracking;
use crate::app::stages::known_camera::KnownCamera;
use crate::app::stages::progress::Progress;
use crate::app::stages::source::{self, CalibrationNamed};
use crate::app::talk;
use crate::capture::{FrameSource, Notice, notices_told};
use crate::scene::{CameraSettings, Family, Marker, TrackingSettings};
use crate::tracking::focal::{CameraLearner, LearntCamera};
use crate::tracking::mapping::{
    BoardShape, LearntBoard, LearntMarker, MapSettings, SpaceFrame, learn_board,
    learn_board_and_camera, off_in_words,
};
use crate::tracking::{Detection, Detector, grey_from_rgba};

/// More frames are not looked at: a long video is sampled.
const MOST_FRAMES: u32 = 3000;

/// A request to learn a board's layout: what is to be learnt from what.
#[derive(Debug, Clone)]
pub struct BoardRequest {
    /// The recording.
    pub input: BoardInput,
    /// Of all markers.
    pub family: Family,
    /// Sizes, gauge and tolerance.
    pub map: MapSettings,
    /// A known distance, which gives the scale in place of the gauge's size.
    pub distance: Option<Distance>,
    /// Name of the board.
    pub name: String,
    /// Where to write the `[[board]]` block; `None`: stdout.
    pub out: Option<PathBuf>,
    /// What that may take the place of.
    pub replacing: Replacing,
}

/// The recording that a board is learnt from.
#[derive(Debug, Clone)]
pub enum BoardInput {
    /// What a scene file plays, with its tracking settings.
    Scene(PathBuf),
    /// A recording of its own.
    Recording {
        /// Where it is.
        camera: CameraSettings,
        /// As in [`TrackingSettings`].
        decimation: f64,
    },
}

/// What was measured between the centres of two markers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distance {
    /// Their ids.
    pub ids: [u32; 2],
    /// The distance, metres.
    pub distance_m: f64,
}

/// Learns the layout and writes it; tells on stderr how sure it is.
///
/// # Errors
/// Anything that keeps a frame from being read or the layout from being learnt; nothing is written then.
pub fn board(request: &BoardRequest, stop: &AtomicBool) -> Result<()> {
    let mut files = JobFiles::new(request.replacing);
    let (camera, settings) = match &request.input {
        BoardInput::Scene(path) => {
            let scene = files.reads_scene(path)?;
            (scene.camera, scene.tracking)
        }
        BoardInput::Recording { camera, decimation } => {
            files.reads_camera(camera);
            (camera.clone(), usual_tracking(*decimation))
        }
    };
    files.reads_family(request.family);
    if let Some(out) = &request.out {
        files.writes("--out", out, ResultKind::LearntBoard);
    }
    files.check()?;
    let named = match &request.input {
        BoardInput::Scene(_) => CalibrationNamed::ByKey,
        BoardInput::Recording { .. } => CalibrationNamed::ByOption,
    };
    let (source, calibration) = source::open_as_it_is(&camera)?;
    let size_px = source.size_px();
    let (pictures, notices) = detections(source, &settings, request.family, stop)?;
    let learnt = match calibration {
        Some(intrinsics) => learn_board(&intrinsics, request.family, &pictures, &request.map)
            .map_err(anyhow::Error::from),
        None => learn_with_camera(request, &settings, size_px, &pictures).map(
            |(learnt, camera_found)| {
                let remark =
                    KnownCamera::Learnt(camera_found).remark(&camera.source, named.place());
                if let Some(remark) = remark {
                    talk::say(&remark);
                }
                learnt
            },
        ),
    };
    let learnt =
        learnt.with_context(|| format!("{} pictures of {}", pictures.len(), camera.source))?;
    let learnt = match &request.distance {
        Some(distance) => to_scale(&learnt, distance)?,
        None => learnt,
    };
    talk::say_lines(&certainty_text(&learnt));
    let block = board_block(&learnt, &request.name);
    match &request.out {
        Some(path) => write_text(path, &block)?,
        None => talk::hand_out(&block).context("the layout cannot be written to stdout")?,
    }
    if !notices.is_empty() {
        bail!(
            "the recording is damaged; the layout was learnt from its good frames: {}",
            notices_told(&notices)
        );
    }
    Ok(())
}

/// The layout in the pictures of a camera that nobody has calibrated: first by what each marker alone tells of the camera,
/// and from there both together.
fn learn_with_camera(
    request: &BoardRequest,
    settings: &TrackingSettings,
    size_px: [u32; 2],
    pictures: &[Vec<Detection>],
) -> Result<(LearntBoard, LearntCamera)> {
    let mut learner = CameraLearner::of_every_marker(settings, request.family, size_px)?;
    pictures.iter().for_each(|seen| learner.look_at(seen));
    let camera = learner.finish();
    let learnt = learn_board_and_camera(&camera, request.family, pictures, &request.map)?;
    Ok(learnt)
}

/// The markers that each frame that is looked at proves.
fn detections(
    mut source: FrameSource,
    settings: &TrackingSettings,
    family: Family,
    stop: &AtomicBool,
) -> Result<(Vec<Vec<Detection>>, Vec<Notice>)> {
    let mut detector = Detector::new(settings, &[family])?;
    let step = source
        .frame_count()
        .map_or(1, |count| count.div_ceil(MOST_FRAMES).max(1));
    let progress = Progress::new(source.frame_count());
    let (mut grey, mut pictures) = (Vec::new(), Vec::new());
    while let Some(frame) = source.next_frame()? {
        progress.advance();
        if stop.load(Ordering::Relaxed) {
            progress.finish();
            bail!("interrupted; nothing was learnt");
        }
        if frame.index.is_multiple_of(step) {
            grey_from_rgba(&frame, &mut grey)?;
            pictures.push(detector.detect_proven(&grey, frame.size_px)?);
        }
    }
    progress.finish();
    Ok((pictures, source.notices().to_vec()))
}

fn to_scale(learnt: &LearntBoard, distance: &Distance) -> Result<LearntBoard> {
    let center = |id: u32| {
        let found = learnt.markers.iter().find(|learnt| learnt.marker.id == id);
        found
            .map(|learnt| learnt.marker.center_m())
            .with_context(|| {
                let known: Vec<String> = learnt
                    .markers
                    .iter()
                    .map(|learnt| learnt.marker.id.to_string())
                    .collect();
                format!(
                    "--distance names marker {id}, which was not learnt; learnt are {}",
                    known.join(", ")
                )
            })
    };
    let [a, b] = distance.ids;
    Ok(learnt.scaled(distance.distance_m / center(a)?.distance(center(b)?)))
}

/// The layout as a scene file takes it.
pub fn board_block(learnt: &LearntBoard, name: &str) -> String {
    let markers: Vec<Marker> = learnt.markers.iter().map(|learnt| learnt.marker).collect();
    anchor_block::board(name, &markers)
}

/// A row for each marker: where it is, how sure that is, and how well the pictures agree.
fn certainty_text(learnt: &LearntBoard) -> String {
    let places = match learnt.shape {
        BoardShape::Flat => format!(
            "{:>18} {:>18} {:>16} {:>15} {:>8}",
            "x, mm", "y, mm", "turn, °", "size, mm", "off, mm"
        ),
        BoardShape::Space { .. } => format!(
            "{:>18} {:>18} {:>18} {:>31} {:>15}",
            "x, mm", "y, mm", "z, mm", "turns about x, y, z, °", "size, mm"
        ),
    };
    let mut text = format!(
        "{} markers from {} pictures; corners {:.3} px from where the layout puts them (standard deviation)\n\
         {}\n{:>6} {places} {:>9} {:>8} {:>8}\n",
        learnt.markers.len(),
        learnt.pictures,
        learnt.noise_px,
        frame_in_words(learnt),
        "marker",
        "pictures",
        "dropped",
        "rms, px"
    );
    for marker in &learnt.markers {
        let place = match learnt.shape {
            BoardShape::Flat => flat_row(marker),
            BoardShape::Space { .. } => space_row(marker),
        };
        let _ = writeln!(
            text,
            "{:>6} {place} {:>9} {:>8} {:>8.3}",
            marker.marker.id, marker.observations, marker.dropped, marker.rms_px
        );
    }
    for learnt in &learnt.markers {
        // Here and there a pencil covers a marker; one that moved fits in no more than a part of the pictures.
        if learnt.dropped > learnt.observations / 4 {
            let _ = writeln!(
                text,
                "marker {} did not fit in {} of {} pictures: did it move?",
                learnt.marker.id,
                learnt.dropped,
                learnt.dropped + learnt.observations
            );
        }
    }
    if !learnt.left_out.is_empty() {
        let ids: Vec<String> = learnt.left_out.iter().map(u32::to_string).collect();
        let _ = writeln!(
            text,
            "left out, because just one picture shows them with others: {}",
            ids.join(", ")
        );
    }
    text
}

/// What the markers lie in, and which frame that gives the board.
fn frame_in_words(learnt: &LearntBoard) -> String {
    let gauge = learnt.gauge;
    match &learnt.shape {
        BoardShape::Flat => format!(
            "they lie in a plane, the board's z = 0; its origin is the middle of marker {gauge}, its x points to that one's right"
        ),
        BoardShape::Space { off, frame } => {
            let why = match off.as_slice() {
                [] => "the board is in space".to_owned(),
                off => format!(
                    "off the plane of the others lie {}, so the board is in space",
                    off_in_words(off)
                ),
            };
            let frame = match frame {
                SpaceFrame::Gauge => format!(
                    "its frame is marker {gauge}'s: origin in its middle, x to its right, y to its top, z out of the print"
                ),
                SpaceFrame::PlaneOfMost => format!(
                    "z = 0 of its frame is the plane of the others; its origin is the middle of marker {gauge}, its x points \
                     to that one's right"
                ),
            };
            format!("{why}; {frame}")
        }
    }
}

fn flat_row(learnt: &LearntMarker) -> String {
    let (center_mm, deviation_mm) = centers_mm(learnt);
    format!(
        "{:>10.2} ± {:<5.3} {:>10.2} ± {:<5.3} {:>8.2} ± {:<5.3} {} {:>8.2}",
        center_mm.x,
        deviation_mm.x,
        center_mm.y,
        deviation_mm.y,
        learnt.marker.rotation_rad().to_degrees(),
        learnt.rotation_deviation_rad.to_degrees(),
        size_cell(learnt),
        learnt.off_plane_m * 1e3,
    )
}

fn space_row(learnt: &LearntMarker) -> String {
    let (center_mm, deviation_mm) = centers_mm(learnt);
    let turns_deg = learnt.marker.rotation_deg();
    format!(
        "{:>10.2} ± {:<5.3} {:>10.2} ± {:<5.3} {:>10.2} ± {:<5.3} {:>7.2} {:>7.2} {:>7.2} ± {:<5.3} {}",
        center_mm.x,
        deviation_mm.x,
        center_mm.y,
        deviation_mm.y,
        center_mm.z,
        deviation_mm.z,
        turns_deg.x,
        turns_deg.y,
        turns_deg.z,
        learnt.rotation_deviation_rad.to_degrees(),
        size_cell(learnt),
    )
}

fn centers_mm(learnt: &LearntMarker) -> (DVec3, DVec3) {
    (
        learnt.marker.center_m() * 1e3,
        learnt.center_deviation_m * 1e3,
    )
}

fn size_cell(learnt: &LearntMarker) -> String {
    format!(
        "{:>7.2} ± {:<5.3}",
        learnt.marker.size_m * 1e3,
        learnt.size_deviation_m * 1e3
    )
}
