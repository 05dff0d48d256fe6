//! Markers: sheets to print, with the text that a scene file takes beside them.

mod cube;
mod page;
mod pdf;
mod png;
mod svg;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use glam::DVec2;

use crate::app::files::anchor_block::{self, PRINTED};
use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::picture_files::{write_bytes, write_text};
use crate::app::files::result_kind::ResultKind;
use crate::calibration::Target;
use crate::scene::{Family, Ink, Marker};
use crate::tracking::{Cell, PrintedMarker};
pub use page::Paper;
use page::{MARGIN_MM, Page};

/// White that a marker needs around it, in cells.
const QUIET_CELLS: f64 = 1.0;
/// White between the cut marks of neighbouring markers, millimetres.
const BETWEEN_MM: f64 = 5.0;
/// Room for a marker's own small print, millimetres.
const LABEL_MM: f64 = 4.0;
/// A marker larger or smaller than this is a slip of the pen, millimetres.
const SIZES_MM: [f64; 2] = [3.0, 400.0];
const DPIS: [f64; 2] = [50.0, 2400.0];

/// A request for sheets to print.
#[derive(Debug, Clone)]
pub struct MarkersRequest {
    /// The sheet: .pdf, .svg or .png.
    pub out: PathBuf,
    /// What is on it.
    pub sheet: MarkerSheet,
    /// The paper.
    pub paper: Paper,
    /// Whether it lies on its side.
    pub landscape: bool,
    /// Pixels per inch of a PNG.
    pub dpi: f64,
    /// What the files may take the place of.
    pub replacing: Replacing,
}

/// The contents of a printed sheet.
#[derive(Debug, Clone)]
pub enum MarkerSheet {
    /// Markers in rows and columns, which are one anchor.
    Board {
        /// Of all markers.
        family: Family,
        /// Id of the upper left marker; the others follow, row by row.
        first_id: u32,
        /// Rows.
        rows: u32,
        /// Columns.
        columns: u32,
        /// Side of the black squares.
        size_mm: f64,
        /// White between neighbours.
        gap_mm: f64,
        /// The anchor's name.
        name: String,
    },
    /// The six faces of a cube, which are one anchor.
    Cube {
        /// Of all markers.
        family: Family,
        /// Id of the front's marker; those of right, back, left, top and bottom follow.
        first_id: u32,
        /// Edge of the cube.
        edge_mm: f64,
        /// Side of the black squares.
        size_mm: f64,
        /// The anchor's name.
        name: String,
    },
    /// Markers to be cut out, each an anchor of its own.
    Lone {
        /// Of all markers.
        family: Family,
        /// Their ids.
        ids: Vec<u32>,
        /// Side of the black squares.
        size_mm: f64,
    },
    /// A target for the calibration of a camera.
    Target(Target),
}

/// Writes the sheet, and beside it the text for the scene file. Returns the files.
///
/// # Errors
/// What does not fit on the paper, a marker that the family does not have, a file that cannot be written.
pub fn markers(request: &MarkersRequest) -> Result<Vec<PathBuf>> {
    let out = request.out.as_path();
    let kind = ResultKind::of_sheet(out);
    let kind = kind.with_context(|| {
        format!(
            "{}: a sheet is written as .pdf, .svg or .png",
            out.display()
        )
    })?;
    let beside = out.with_extension("toml");
    request.files(kind, &beside).check()?;
    let [least, most] = DPIS;
    ensure!(
        (least..=most).contains(&request.dpi),
        "--dpi {} is out of range; allowed: {least} to {most}",
        request.dpi
    );
    let size_mm = request.paper.size_mm(request.landscape);
    let (pages, block) = match &request.sheet {
        MarkerSheet::Board { .. } => {
            let (page, block) = board(&request.sheet, size_mm)?;
            (vec![page], Some(block))
        }
        MarkerSheet::Cube {
            family,
            first_id,
            edge_mm,
            size_mm: marker_mm,
            name,
        } => {
            let sheet = cube::CubeSheet {
                family: *family,
                first_id: *first_id,
                marker_mm: *marker_mm,
                edge_mm: *edge_mm,
                name,
            };
            let (pages, block) = cube::cube(&sheet, size_mm)?;
            (pages, Some(block))
        }
        MarkerSheet::Lone {
            family,
            ids,
            size_mm: marker_mm,
        } => {
            let (pages, block) = lone(*family, ids, *marker_mm, size_mm)?;
            (pages, Some(block))
        }
        MarkerSheet::Target(target) => (vec![calibration_target(target, size_mm)?], None),
    };
    match (kind, pages.as_slice()) {
        (ResultKind::Pdf, pages) => write_bytes(out, &pdf::bytes(pages))?,
        (ResultKind::Svg, [page]) => write_text(out, &svg::text(page))?,
        (ResultKind::Png, [page]) => {
            write_bytes(out, &png::bytes(page, request.dpi)?)?;
        }
        _ => bail!(
            "the markers take {} pages; only a PDF has more than one: give --out a .pdf, or fewer ids at a time",
            pages.len()
        ),
    }
    let mut written = vec![out.to_owned()];
    if let Some(block) = block {
        write_text(&beside, &format!("{PRINTED}.\n{block}"))?;
        written.push(beside);
    }
    Ok(written)
}

impl MarkersRequest {
    fn files(&self, kind: ResultKind, beside: &Path) -> JobFiles {
        let mut files = JobFiles::new(self.replacing);
        files.writes("--out", &self.out, kind);
        let family = match &self.sheet {
            MarkerSheet::Board { family, .. }
            | MarkerSheet::Cube { family, .. }
            | MarkerSheet::Lone { family, .. } => Some(*family),
            MarkerSheet::Target(target) => target.markers.as_ref().map(|markers| markers.family),
        };
        if let Some(family) = family {
            files.reads_family(family);
        }
        if !matches!(self.sheet, MarkerSheet::Target(_)) {
            files.writes("the text beside --out,", beside, ResultKind::PrintedMarkers);
        }
        files
    }
}

/// The page of a board in the middle of the paper, and its `[[board]]`, whose origin is the board's centre.
fn board(sheet: &MarkerSheet, size_mm: [f64; 2]) -> Result<(Page, String)> {
    let MarkerSheet::Board {
        family,
        first_id,
        rows,
        columns,
        size_mm: marker_mm,
        gap_mm,
        name,
    } = sheet
    else {
        bail!("no board");
    };
    check_size("--size-mm", *marker_mm)?;
    ensure!(
        *rows > 0 && *columns > 0,
        "a board needs at least one row and one column"
    );
    let cell_mm = marker_mm / f64::from(family.cells_across());
    let beyond_mm = cells_beyond(*family)? * cell_mm;
    let least_gap_mm = QUIET_CELLS * cell_mm + 2.0 * beyond_mm;
    ensure!(
        *gap_mm >= least_gap_mm,
        "--gap-mm {gap_mm} leaves too little white between markers; at least one cell, {least_gap_mm:.1}, is needed"
    );
    let pitch_mm = marker_mm + gap_mm;
    let extent = [columns, rows].map(|&count| f64::from(count) * pitch_mm - gap_mm);
    let [left, top, right, bottom] = Page::free_mm(size_mm);
    let free = [right - left, bottom - top];
    let printed = extent.map(|extent| extent + 2.0 * beyond_mm);
    if printed[0] > free[0] || printed[1] > free[1] {
        let fits = free.map(|free| {
            ((free - 2.0 * beyond_mm + gap_mm) / pitch_mm)
                .floor()
                .max(0.0) as u32
        });
        bail!(
            "a board of {:.0} x {:.0} mm does not fit on {:.0} x {:.0} mm of this paper; {} columns and {} rows of this \
             size would",
            extent[0],
            extent[1],
            free[0],
            free[1],
            fits[0],
            fits[1]
        );
    }
    let last = first_id
        .checked_add(rows * columns - 1)
        .context("too many markers")?;
    let about = format!(
        "{} {first_id} to {last}, {marker_mm} mm, gap {gap_mm} mm{}",
        family.name(),
        border_text(*family)
    );
    let mut page = Page::new(size_mm, &about);
    let origin = [
        left + (free[0] - extent[0]) / 2.0,
        top + (free[1] - extent[1]) / 2.0,
    ];
    let mut placed = Vec::new();
    for row in 0..*rows {
        for column in 0..*columns {
            let id = first_id + row * columns + column;
            let at = [
                origin[0] + f64::from(column) * pitch_mm,
                origin[1] + f64::from(row) * pitch_mm,
            ];
            print_marker(&mut page, at, *marker_mm, (*family, id))?;
            let from_center = [0, 1].map(|k| at[k] + marker_mm / 2.0 - origin[k] - extent[k] / 2.0);
            let marker = Marker::alone(*family, id, marker_mm / 1000.0);
            // y runs up on the board.
            let center_m = DVec2::new(from_center[0], -from_center[1]) / 1000.0;
            placed.push(marker.in_plane(center_m, 0.0));
        }
    }
    Ok((page, anchor_block::board(name, &placed)))
}

/// Pages of markers to be cut out, and their `[[marker]]`s.
fn lone(
    family: Family,
    ids: &[u32],
    marker_mm: f64,
    size_mm: [f64; 2],
) -> Result<(Vec<Page>, String)> {
    check_size("--size-mm", marker_mm)?;
    ensure!(!ids.is_empty(), "no ids");
    let mut known = HashSet::new();
    if let Some(id) = ids.iter().find(|id| !known.insert(**id)) {
        bail!("--ids has {id} twice, and a scene takes each marker once");
    }
    let cell_mm = marker_mm / f64::from(family.cells_across());
    let quiet_mm = (2.0 * QUIET_CELLS + cells_beyond(family)?) * cell_mm;
    let card_mm = [
        marker_mm + 2.0 * quiet_mm,
        marker_mm + 2.0 * quiet_mm + LABEL_MM,
    ];
    let [left, top, right, bottom] = Page::free_mm(size_mm);
    let free = [
        right - left - 2.0 * BETWEEN_MM,
        bottom - top - 2.0 * BETWEEN_MM,
    ];
    let counts =
        [0, 1].map(|k| ((free[k] + BETWEEN_MM) / (card_mm[k] + BETWEEN_MM)).floor() as usize);
    let per_page = counts[0] * counts[1];
    ensure!(
        per_page > 0,
        "a marker of {marker_mm} mm with the white around it does not fit on {:.0} x {:.0} mm of this paper",
        free[0],
        free[1]
    );
    let about = format!("{}, {marker_mm} mm{}", family.name(), border_text(family));
    let mut block = String::new();
    let mut pages = Vec::new();
    for ids in ids.chunks(per_page) {
        let mut page = Page::new(size_mm, &about);
        for (place, &id) in ids.iter().enumerate() {
            let step = [place % counts[0], place / counts[0]];
            let at =
                [0, 1].map(|k| MARGIN_MM + BETWEEN_MM + step[k] as f64 * (card_mm[k] + BETWEEN_MM));
            page.cut_marks(at, card_mm);
            let marker_at = at.map(|at| at + quiet_mm);
            print_marker(&mut page, marker_at, marker_mm, (family, id))?;
            let label = format!("{} {id}  {marker_mm} mm", family.name());
            page.write([at[0] + quiet_mm, at[1] + card_mm[1] - 1.2], 2.5, &label);
            let marker = Marker::alone(family, id, marker_mm / 1000.0);
            if !block.is_empty() {
                block.push('\n');
            }
            block.push_str(&anchor_block::marker(&format!("marker {id}"), &marker));
        }
        pages.push(page);
    }
    Ok((pages, block))
}

/// A chessboard or a ChArUco board in the middle of the paper.
fn calibration_target(target: &Target, size_mm: [f64; 2]) -> Result<Page> {
    let square_mm = target.square_m * 1000.0;
    let extent = target.squares.map(|count| f64::from(count) * square_mm);
    let [left, top, right, bottom] = Page::free_mm(size_mm);
    let free = [right - left, bottom - top];
    ensure!(
        // Rounding must not turn away what just fits.
        extent[0] <= free[0] + 1e-6 && extent[1] <= free[1] + 1e-6,
        "a target of {:.0} x {:.0} mm does not fit on {:.0} x {:.0} mm of this paper; {} x {} squares of this size would",
        extent[0],
        extent[1],
        free[0],
        free[1],
        (free[0] / square_mm).floor(),
        (free[1] / square_mm).floor()
    );
    let mut page = Page::new(size_mm, &target.to_string());
    let origin = [
        left + (free[0] - extent[0]) / 2.0,
        top + (free[1] - extent[1]) / 2.0,
    ];
    let corner_mm = |[column, row]: [u32; 2]| {
        [
            origin[0] + f64::from(column) * square_mm,
            origin[1] + f64::from(row) * square_mm,
        ]
    };
    let [columns, rows] = target.squares;
    for square in (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row])) {
        if Target::is_black(square) {
            page.fill(corner_mm(square), [square_mm; 2]);
        }
    }
    if let Some(markers) = &target.markers {
        let marker_mm = markers.size_m * 1000.0;
        for (id, square) in (0..).zip(target.marker_squares(false)) {
            let at = corner_mm(square).map(|at| at + (square_mm - marker_mm) / 2.0);
            print_marker(&mut page, at, marker_mm, (markers.family, id))?;
        }
    }
    Ok(page)
}

fn border_text(family: Family) -> String {
    let inverted = match family.ink() {
        Ink::WhiteOnBlack => ", white on black",
        Ink::BlackOnWhite => "",
    };
    match family.border_cells() {
        1 => inverted.to_owned(),
        cells => format!(", black border of {cells} cells{inverted}"),
    }
}

/// Cells that are printed beyond the square of a marker's size: the codes around a ring, or one of black around a white
/// border.
fn cells_beyond(family: Family) -> Result<f64> {
    let printed = PrintedMarker::of(family, 0)?;
    Ok(f64::from(match (family.has_ring(), family.ink()) {
        (true, _) => printed.rim(),
        (false, Ink::WhiteOnBlack) => 1,
        (false, Ink::BlackOnWhite) => 0,
    }))
}

/// Prints a marker whose square has its upper left corner at `at`, with all that belongs to it around.
fn print_marker(
    page: &mut Page,
    at: [f64; 2],
    marker_mm: f64,
    (family, id): (Family, u32),
) -> Result<()> {
    let printed = PrintedMarker::of(family, id)?;
    let beyond = cells_beyond(family)?;
    let cells = -(beyond as i32)..printed.side() + beyond as i32;
    let white: Vec<bool> = cells
        .clone()
        .flat_map(|row| cells.clone().map(move |column| (column, row)))
        .map(|(column, row)| printed.cell(column, row) != Cell::Black)
        .collect();
    let cell_mm = marker_mm / f64::from(printed.side());
    let at = at.map(|at| at - beyond * cell_mm);
    page.print(at, marker_mm + 2.0 * beyond * cell_mm, &white);
    Ok(())
}

fn check_size(option: &str, mm: f64) -> Result<()> {
    let [least, most] = SIZES_MM;
    ensure!(
        (least..=most).contains(&mm),
        "{option} {mm} is out of range; allowed: {least} to {most}"
    );
    Ok(())
}
