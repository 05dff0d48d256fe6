//! Calibrate: views of a chessboard in; the camera's calibration, and a picture of how well they cover it, out.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, bail, ensure};

use super::picture_files::{write_rgb_png, write_text};
use super::progress::Progress;
use super::recording::refuse_to_overwrite;
use crate::capture::FrameSource;
use crate::geometry::camera::Intrinsics;
use crate::tracking::calibrating::{CELLS, Calibrated, Chessboard, Gathering, Look, coverage};
use crate::tracking::grey_from_rgba;

/// A long video is sampled: more frames are not looked at.
const MOST_FRAMES: u32 = 600;
/// Where no view is tilted by more, the focal length hangs on little, degrees.
const LITTLE_TILT_DEG: f64 = 15.0;

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Request {
    /// A video, a folder of pictures, a picture, or a session.
    pub source: String,
    /// What it shows.
    pub board: Chessboard,
    /// Where to write the calibration (TOML).
    pub out: PathBuf,
    /// Where to write a picture of the coverage (PNG).
    pub coverage: Option<PathBuf>,
}

/// Finds the views, solves, writes. Returns what is to be told: a row per view, the camera, what is lacking.
///
/// # Errors
/// No usable view, views that do not determine the camera, files that cannot be read or written; nothing is written then.
pub fn calibrate(request: &Request, stop: &AtomicBool) -> Result<String> {
    let [columns, rows] = request.board.corners;
    ensure!(
        columns >= 3 && rows >= 3,
        "a chessboard of {columns} x {rows} inner corners is too small; at least 3 x 3"
    );
    ensure!(
        request.board.square_m > 1e-4 && request.board.square_m < 10.0,
        "--square-mm is out of range; allowed: 0.1 to 10000"
    );
    let mut source = FrameSource::open(&request.source)?;
    for written in [Some(&request.out), request.coverage.as_ref()] {
        refuse_to_overwrite(&source, written.map(PathBuf::as_path))?;
    }
    let size_px = source.size_px();
    let step = source
        .frame_count()
        .unwrap_or(0)
        .div_ceil(MOST_FRAMES)
        .max(1);
    let progress = Progress::new(source.frame_count());
    let mut gathering = Gathering::new(request.board, size_px);
    let (mut grey, mut looked, mut seen) = (Vec::new(), 0, 0);
    while let Some(frame) = source.next_frame()? {
        progress.advance();
        if stop.load(Ordering::Relaxed) {
            bail!("interrupted; nothing was written");
        }
        if frame.index % step != 0 {
            continue;
        }
        grey_from_rgba(&frame, &mut grey)?;
        let look = gathering.look(frame.index, &grey, frame.size_px)?;
        looked += 1;
        seen += u32::from(look != Look::Nothing);
    }
    progress.finish();
    if seen == 0 {
        bail!(
            "no chessboard of {columns} x {rows} inner corners is whole in any of {looked} pictures of {}; count the \
             corners where four squares meet",
            request.source
        );
    }
    let calibrated = gathering.solve()?;
    write_text(&request.out, &calibration_text(&calibrated.intrinsics))?;
    if let Some(path) = &request.coverage {
        let rgba = coverage_picture(&calibrated, size_px);
        write_rgb_png(path, size_px, &rgba).context("cannot write the picture of the coverage")?;
    }
    Ok(told(&calibrated, (looked, seen), size_px, &request.out))
}

/// As `capture` reads it.
fn calibration_text(camera: &Intrinsics) -> String {
    let [k1, k2, p1, p2, k3] = camera.distortion;
    format!(
        "size_px = [{}, {}]\nfocal_px = [{:.4}, {:.4}]\ncenter_px = [{:.4}, {:.4}]\n# k1, k2, p1, p2, k3\n\
         distortion = [{k1:.8}, {k2:.8}, {p1:.8}, {p2:.8}, {k3:.8}]\n",
        camera.size_px[0],
        camera.size_px[1],
        camera.focal_px.x,
        camera.focal_px.y,
        camera.center_px.x,
        camera.center_px.y
    )
}

fn told(
    calibrated: &Calibrated,
    (looked, seen): (u32, u32),
    size_px: [u32; 2],
    out: &Path,
) -> String {
    let mut text = format!("{seen} of {looked} pictures show the chessboard whole\n");
    for (view, rms_px) in &calibrated.views {
        let _ = writeln!(text, "  frame {:6}  {rms_px:.3} px", view.frame);
    }
    for (frame, rms_px) in &calibrated.dropped {
        let _ = writeln!(
            text,
            "  frame {frame:6}  {rms_px:.3} px  left out: it does not fit the others"
        );
    }
    let camera = &calibrated.intrinsics;
    let (focal, focal_sd) = (camera.focal_px, calibrated.focal_deviation_px);
    let (center, center_sd) = (camera.center_px, calibrated.center_deviation_px);
    let _ = write!(
        text,
        "{} views, {:.3} px in all\nfocal lengths  {:.2} ± {:.2}, {:.2} ± {:.2} px\ncentre         {:.2} ± {:.2}, {:.2} ± {:.2} px\n",
        calibrated.views.len(),
        calibrated.rms_px,
        focal.x,
        focal_sd.x,
        focal.y,
        focal_sd.y,
        center.x,
        center_sd.x,
        center.y,
        center_sd.y
    );
    let cells = coverage(calibrated.views.iter().map(|(view, _)| view), size_px);
    let empty = cells.iter().filter(|&&count| count == 0).count();
    if empty > 0 {
        let _ = writeln!(
            text,
            "warning: {empty} of {} parts of the picture have no corner ({}): the distortion is guessed there",
            cells.len(),
            lacking(&cells)
        );
    }
    let tilt_deg = calibrated.largest_tilt.to_degrees();
    if tilt_deg < LITTLE_TILT_DEG {
        let _ = writeln!(
            text,
            "warning: no view is tilted by more than {tilt_deg:.0}°: tilt the chessboard by 30° and more"
        );
    }
    if calibrated.rms_px > 1.0 {
        text.push_str(
            "warning: above a pixel: is the chessboard flat, sharp, and counted right?\n",
        );
    }
    let _ = writeln!(text, "{}", out.display());
    text
}

/// The sides and corners of the picture that lack views, in words.
fn lacking(cells: &[usize]) -> String {
    let [columns, rows] = CELLS;
    let part = |row: std::ops::Range<usize>, column: std::ops::Range<usize>| {
        let mut empty = 0;
        let all = row.len() * column.len();
        for row in row {
            empty += column
                .clone()
                .filter(|column| cells[row * columns + column] == 0)
                .count();
        }
        2 * empty >= all
    };
    let third = |count: usize| {
        [
            0..count / 3,
            count / 3..count - count / 3,
            count - count / 3..count,
        ]
    };
    let names = [
        ["upper left", "top", "upper right"],
        ["left", "middle", "right"],
        ["lower left", "bottom", "lower right"],
    ];
    let mut words = Vec::new();
    for (row, names) in third(rows).into_iter().zip(names) {
        for (column, name) in third(columns).into_iter().zip(names) {
            if part(row.clone(), column) {
                words.push(name);
            }
        }
    }
    if words.is_empty() {
        words.push("here and there");
    }
    words.join(", ")
}

/// All corners, from green (on their place) to red (a pixel off on average in their view), over the cells of the picture:
/// those without a corner are dark.
fn coverage_picture(calibrated: &Calibrated, size_px: [u32; 2]) -> Vec<u8> {
    const DOT_PX: i64 = 2;
    let cells = coverage(calibrated.views.iter().map(|(view, _)| view), size_px);
    let [width, height] = size_px.map(|side| side as usize);
    let [columns, rows] = CELLS;
    let mut rgba = Vec::with_capacity(4 * width * height);
    for y in 0..height {
        for x in 0..width {
            let cell = (y * rows / height) * columns + x * columns / width;
            let level = if cells[cell] == 0 { 60 } else { 235 };
            rgba.extend([level, level, level, 255]);
        }
    }
    for (view, rms_px) in &calibrated.views {
        let bad = rms_px.min(1.0);
        let color = [(220.0 * bad) as u8, (160.0 * (1.0 - bad)) as u8, 30];
        for corner in &view.corners_px {
            let (x, y) = (corner.x.round() as i64, corner.y.round() as i64);
            for (x, y) in
                (-DOT_PX..=DOT_PX).flat_map(|dy| (-DOT_PX..=DOT_PX).map(move |dx| (x + dx, y + dy)))
            {
                if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                    let at = 4 * (y as usize * width + x as usize);
                    rgba[at..at + 3].copy_from_slice(&color);
                }
            }
        }
    }
    rgba
}
