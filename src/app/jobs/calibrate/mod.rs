//! Calibrate: pictures of a target in; a calibration, and what it rests on, out.

mod watched;

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail};

use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::new_file::is_stdout;
use crate::app::files::picture_files::{write_rgb_png, write_text};
use crate::app::files::result_kind::ResultKind;
use crate::app::stages::progress::Progress;
use crate::app::talk;
use crate::calibration::{
    CalibrateError, Calibration, Lack, Placing, Target, TargetLook, Views, coverage_picture, solve,
};
use crate::capture::live::LiveOptions;
use crate::capture::{CaptureError, FrameSource, calibration_text};
use crate::geometry::quarter_turns::QuarterTurns;
use crate::scene::WantedFormat;
use crate::tracking::grey_from_rgba;

/// A request to calibrate a camera.
#[derive(Debug, Clone)]
pub struct CalibrateRequest {
    /// Videos, folders of pictures, single pictures; all of one camera at one size, held however.
    pub sources: Vec<String>,
    /// What they show.
    pub target: Target,
    /// Whether the camera mirrors its pictures and they are turned back first, as in a scene.
    pub mirror: bool,
    /// Where to write the calibration (TOML).
    pub out: PathBuf,
    /// Where to write the picture of coverage (PNG).
    pub coverage: Option<PathBuf>,
    /// A camera, or a video as if it were one, in a window; `None`: recordings, all frames that differ.
    pub watch: Option<Watch>,
    /// What the files may take the place of.
    pub replacing: Replacing,
}

/// Settings of the window in which a camera is calibrated.
#[derive(Debug, Clone, Default)]
pub struct Watch {
    /// What a webcam is asked for.
    pub wanted: WantedFormat,
    /// Part of the wanted graphics adapter's name.
    pub adapter: Option<String>,
}

/// The outcome of a calibration, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Done {
    /// All of it in words: views, errors, the camera.
    pub summary: String,
    /// What makes it less sure than it could be, in words.
    pub warnings: Vec<String>,
    /// What was wrong with the recordings, in words.
    pub notices: Vec<String>,
}

/// Frames of a recording that are looked at: neighbours in a video show the same.
const MOST_FRAMES: u32 = 400;
/// Corners that are farther off on the whole are not those of the target, pixels: small pictures are sharper…
const MOST_RMS_PX: [f64; 2] = [0.5, 1.0];
/// …than those that are as many times as large across their diagonal, pixels.
const SHARP_PX: f64 = 1600.0;

/// Calibrates. `stop` ends it with nothing written.
///
/// # Errors
/// Pictures that cannot be read or give no calibration, files that cannot be written.
pub fn calibrate(request: &CalibrateRequest, stop: &Arc<AtomicBool>) -> Result<Done> {
    let out = &request.out;
    let is_toml = out.extension().is_some_and(|extension| extension == "toml");
    if !is_toml && !is_stdout(out) {
        bail!("{}: a calibration is written as .toml", out.display());
    }
    request.files().check()?;
    let pictures = match &request.watch {
        Some(watch) => watched(request, watch, stop)?,
        None => TargetPictures::of_recordings(request, stop)?,
    };
    let calibration = solve(&pictures.views)?;
    let summary = pictures.summary(&calibration);
    if let Some(path) = &request.coverage {
        let picture = coverage_picture(&calibration)?;
        write_rgb_png(path, picture.size_px, &picture.rgba)?;
    }
    let text = format!(
        "# {} views ({}), {:.3} px rms.\n{}",
        calibration.views.len(),
        request.target,
        calibration.rms_px,
        calibration_text(&calibration.intrinsics)
    );
    write_text(out, &text)?;
    Ok(Done {
        summary,
        warnings: warnings(&calibration, pictures.views.mirrored()),
        notices: pictures.notices,
    })
}

/// What somebody holds to a camera.
fn watched(
    request: &CalibrateRequest,
    watch: &Watch,
    stop: &Arc<AtomicBool>,
) -> Result<TargetPictures> {
    let [source] = &request.sources[..] else {
        bail!(
            "a camera is calibrated alone, in a window; several recordings together without --watch"
        );
    };
    let options = LiveOptions {
        wanted: watch.wanted,
        mirror: request.mirror,
        repeats: false,
    };
    let held = watched::views(
        source,
        &options,
        request.target,
        watch.adapter.as_deref(),
        stop,
    )?;
    Ok(TargetPictures {
        views: held.views,
        names: held
            .times_secs
            .iter()
            .map(|at_secs| format!("at {at_secs:.1} s"))
            .collect(),
        others: Vec::new(),
        notices: Vec::new(),
    })
}

impl CalibrateRequest {
    fn files(&self) -> JobFiles {
        let mut files = JobFiles::new(self.replacing);
        for source in &self.sources {
            files.reads(Path::new(source));
        }
        if let Some(markers) = &self.target.markers {
            files.reads_family(markers.family);
        }
        files.writes("--out", &self.out, ResultKind::Calibration);
        if let Some(path) = &self.coverage {
            files.writes("--coverage", path, ResultKind::Png);
        }
        files
    }
}

/// The pictures of all sources, numbered as they come.
struct TargetPictures {
    views: Views,
    /// By number.
    names: Vec<String>,
    /// Pictures of other sizes, by name, with their width and height.
    others: Vec<(String, [u32; 2])>,
    notices: Vec<String>,
}

/// The pictures of all sources, sorted by their size.
#[derive(Default)]
struct SortedPictures {
    sizes: Vec<OfOneSize>,
    /// By number.
    names: Vec<String>,
    notices: Vec<String>,
}

/// The pictures of one size, upright ones among them.
struct OfOneSize {
    /// The longer side first.
    size_px: [u32; 2],
    views: Views,
    /// Numbers of the pictures.
    pictures: Vec<usize>,
    /// How many of those that show the target are shown after which turn.
    shown: BTreeMap<QuarterTurns, u32>,
}

impl TargetPictures {
    fn of_recordings(request: &CalibrateRequest, stop: &AtomicBool) -> Result<Self> {
        let mut sorted = SortedPictures::default();
        for name in &request.sources {
            let is_only_source = request.sources.len() == 1;
            let source = match FrameSource::open(name) {
                // One of several pictures: the others are used all the same.
                Err(error @ CaptureError::NoGoodFrame { .. }) if !is_only_source => {
                    sorted.notices.push(error.to_string());
                    continue;
                }
                opened => opened?.mirrored(request.mirror).as_taken(),
            };
            sorted.look_at(source, is_only_source, request.target, stop)?;
        }
        sorted.conclude(request.target)
    }
}

impl SortedPictures {
    fn look_at(
        &mut self,
        mut source: FrameSource,
        is_only: bool,
        target: Target,
        stop: &AtomicBool,
    ) -> Result<()> {
        if let Some(passed_over) = source.passed_over() {
            talk::say(passed_over);
        }
        let path = source.path().to_owned();
        let count = source.frame_count();
        let step = count.map_or(1, |count| count.div_ceil(MOST_FRAMES).max(1));
        let progress = Progress::new(count);
        let mut grey = Vec::new();
        while let Some(frame) = source.next_frame()? {
            progress.advance();
            if stop.load(Ordering::Relaxed) {
                progress.finish();
                bail!("interrupted; nothing was calibrated");
            }
            if !frame.index.is_multiple_of(step) {
                continue;
            }
            let name = name_of(&path, (count == Some(1), is_only), frame.index);
            grey_from_rgba(&frame, &mut grey)?;
            let number = self.names.len();
            self.names.push(name.clone());
            self.of_size(frame.size_px, target)?
                .look(number, &grey, frame.size_px, source.shown_turn())
                .context(name)?;
        }
        progress.finish();
        self.notices
            .extend(source.notices().iter().map(ToString::to_string));
        Ok(())
    }

    /// Those of a size, the camera held however.
    fn of_size(&mut self, [width, height]: [u32; 2], target: Target) -> Result<&mut OfOneSize> {
        let size_px = [width.max(height), width.min(height)];
        let known = self.sizes.iter().position(|of| of.size_px == size_px);
        let at = known.unwrap_or(self.sizes.len());
        if known.is_none() {
            self.sizes.push(OfOneSize {
                size_px,
                views: Views::new(target)?,
                pictures: Vec::new(),
                shown: BTreeMap::new(),
            });
        }
        Ok(&mut self.sizes[at])
    }

    /// The pictures of that size in which the target was seen most; the others are left out.
    fn conclude(mut self, target: Target) -> Result<TargetPictures> {
        // Of those that are alike the first one.
        let worth = |of: &OfOneSize| (of.views.found(), of.views.looked());
        let best = (0..self.sizes.len())
            .rev()
            .max_by_key(|&at| worth(&self.sizes[at]));
        let chosen = match best {
            Some(best) => self.sizes.remove(best),
            None => bail!("no picture of {target} was read"),
        };
        let mut left_out: Vec<(usize, [u32; 2])> = (self.sizes.iter())
            .flat_map(|of| of.pictures.iter().map(|&number| (number, of.size_px)))
            .collect();
        left_out.sort_unstable();
        // The calibration holds for how most of them are shown.
        let shown = chosen
            .shown
            .iter()
            .max_by_key(|&(turn, count)| (count, Reverse(turn)));
        let turn = shown.map_or(QuarterTurns::NONE, |(turn, _)| *turn);
        Ok(TargetPictures {
            views: chosen.views.turned(turn),
            others: (left_out.into_iter())
                .map(|(number, size_px)| (self.names[number].clone(), size_px))
                .collect(),
            names: self.names,
            notices: self.notices,
        })
    }
}

impl OfOneSize {
    fn look(
        &mut self,
        number: usize,
        grey: &[u8],
        size_px: [u32; 2],
        shown_turn: QuarterTurns,
    ) -> Result<(), CalibrateError> {
        // An upright picture that no EXIF explains was turned by a program, or is one of a video that is shown so.
        let (placing, shown_turn) = match size_px == self.size_px {
            true => (Placing::Known(QuarterTurns::NONE), shown_turn),
            false => (
                Placing::UpOrDown(QuarterTurns::ONE),
                QuarterTurns::ONE.inverse(),
            ),
        };
        self.pictures.push(number);
        let number = u32::try_from(number).unwrap_or(u32::MAX);
        let look = self.views.look_placed(number, grey, size_px, placing)?;
        if look != TargetLook::NoTarget {
            *self.shown.entry(shown_turn).or_default() += 1;
        }
        Ok(())
    }
}

impl TargetPictures {
    /// A row for each view, then the camera.
    fn summary(&self, calibration: &Calibration) -> String {
        let name = |picture: u32| self.names.get(picture as usize).map_or("", String::as_str);
        let mut text = String::new();
        // Writing to a text cannot fail.
        let _ = writeln!(
            text,
            "{:>8} {:>8} {:>8}  view",
            "rms, px", "tilt, °", "corners"
        );
        for view in &calibration.views {
            let _ = writeln!(
                text,
                "{:>8.3} {:>8.1} {:>8}  {}",
                view.rms_px,
                view.tilt_rad().to_degrees(),
                view.residuals.len(),
                name(view.picture)
            );
        }
        for &(picture, rms_px) in &calibration.dropped {
            let _ = writeln!(
                text,
                "{rms_px:>8.3} {:>8} {:>8}  {}: does not fit, left out",
                "",
                "",
                name(picture)
            );
        }
        let used_px = self.views.size_px().unwrap_or_default();
        for (name, size_px) in &self.others {
            let _ = writeln!(
                text,
                "{:>8} {:>8} {:>8}  {name}: {} x {} pixels, most have {} x {}; left out",
                "", "", "", size_px[0], size_px[1], used_px[0], used_px[1]
            );
        }
        let _ = writeln!(
            text,
            "{} pictures, {} show the target, {} differ, {} used: {:.3} px rms",
            self.views.looked(),
            self.views.found(),
            self.views.kept().len(),
            calibration.views.len(),
            calibration.rms_px
        );
        text + &camera_text(calibration)
    }
}

fn warnings(calibration: &Calibration, mirrored: u32) -> Vec<String> {
    let mut warnings: Vec<String> = calibration.lacks.iter().map(Lack::to_string).collect();
    if mirrored > 0 {
        warnings.push(format!(
            "{mirrored} pictures show the target only when they are turned left for right, and were left out"
        ));
    }
    let [width, height] = calibration.intrinsics.size_px.map(f64::from);
    let most_px = (width.hypot(height) / SHARP_PX).clamp(MOST_RMS_PX[0], MOST_RMS_PX[1]);
    if let Some(change) = calibration.focal_change {
        warnings.push(format!("{change}: the calibration holds for none of them"));
    } else if calibration.rms_px > most_px {
        warnings.push(format!(
            "corners are off by {:.1} px: is the target flat, sharp, and as it was described?",
            calibration.rms_px
        ));
    }
    warnings
}

fn camera_text(calibration: &Calibration) -> String {
    let camera = &calibration.intrinsics;
    let focal_deviation_px = calibration.focal_deviation_px;
    let center_deviation_px = calibration.center_deviation_px;
    let names = ["k1", "k2", "p1", "p2", "k3"];
    let coefficients: Vec<String> = (0..5)
        .map(|k| {
            let (coefficient, deviation) = (
                camera.distortion.coefficients()[k],
                calibration.distortion_deviations[k],
            );
            if coefficient == 0.0 {
                format!("{} 0", names[k])
            } else {
                format!("{} {coefficient:.5} ± {deviation:.5}", names[k])
            }
        })
        .collect();
    let untold = match (calibration.lens.radial, calibration.lens.tangential) {
        (3, true) => "",
        _ => "; what is 0 the views do not tell from noise",
    };
    format!(
        "focal length  {:.2} ± {:.2}, {:.2} ± {:.2} px\n\
         center        {:.2} ± {:.2}, {:.2} ± {:.2} px\n\
         distortion    {}{untold}\n\
         coverage      {:.0} % of the picture\n",
        camera.focal_px.x,
        focal_deviation_px.x,
        camera.focal_px.y,
        focal_deviation_px.y,
        camera.center_px.x,
        center_deviation_px.x,
        camera.center_px.y,
        center_deviation_px.y,
        coefficients.join(", "),
        100.0 * calibration.coverage.share()
    )
}

/// What people call a picture.
fn name_of(path: &Path, (is_single, is_only): (bool, bool), index: u32) -> String {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    match (is_single, is_only) {
        (true, _) => file.into_owned(),
        (false, true) => format!("frame {index}"),
        (false, false) => format!("{file} frame {index}"),
    }
}
