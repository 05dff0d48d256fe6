//! The six faces of a cube to print: in one piece to fold where that fits on the page, otherwise one by one.

use anyhow::{Result, ensure};
use glam::{DAffine3, DMat3, DVec3};

use super::page::{MARGIN_MM, Page};
use super::{
    BETWEEN_MM, LABEL_MM, QUIET_CELLS, border_text, cells_beyond, check_size, print_marker,
};
use crate::app::files::anchor_block;
use crate::scene::{Family, Marker};

/// A cube whose edge is longer is made of something else than paper, millimetres.
const LONGEST_EDGE_MM: f64 = 1000.0;

/// The sheet of a cube.
pub(super) struct CubeSheet<'a> {
    pub family: Family,
    pub first_id: u32,
    /// Side of the black squares.
    pub marker_mm: f64,
    /// Edge of the cube.
    pub edge_mm: f64,
    pub name: &'a str,
}

/// A side of the cube, as somebody before it sees it.
struct Side {
    name: &'static str,
    /// What lies above it.
    above: &'static str,
    /// Its right, its top, and the way out, in the cube's frame: x to the right, y to the back, z up.
    axes: [DVec3; 3],
    /// Column and row in the piece to fold.
    in_net: [u32; 2],
}

/// In the order of their ids.
const SIDES: [Side; 6] = [
    Side {
        name: "front",
        above: "top",
        axes: [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        in_net: [1, 1],
    },
    Side {
        name: "right",
        above: "top",
        axes: [DVec3::Y, DVec3::Z, DVec3::X],
        in_net: [2, 1],
    },
    Side {
        name: "back",
        above: "top",
        axes: [DVec3::NEG_X, DVec3::Z, DVec3::Y],
        in_net: [3, 1],
    },
    Side {
        name: "left",
        above: "top",
        axes: [DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X],
        in_net: [0, 1],
    },
    Side {
        name: "top",
        above: "back",
        axes: [DVec3::X, DVec3::Y, DVec3::Z],
        in_net: [1, 0],
    },
    Side {
        name: "bottom",
        above: "front",
        axes: [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z],
        in_net: [1, 2],
    },
];

/// Columns and rows of the piece to fold.
const NET: [f64; 2] = [4.0, 3.0];

/// The pages of a cube's faces, and its `[[board]]`, whose origin is the cube's middle.
pub(super) fn cube(sheet: &CubeSheet, size_mm: [f64; 2]) -> Result<(Vec<Page>, String)> {
    check_size("--size-mm", sheet.marker_mm)?;
    let cell_mm = sheet.marker_mm / f64::from(sheet.family.cells_across());
    let beyond_mm = cells_beyond(sheet.family)? * cell_mm;
    let least_mm = sheet.marker_mm + 2.0 * (beyond_mm + QUIET_CELLS * cell_mm);
    ensure!(
        (least_mm..=LONGEST_EDGE_MM).contains(&sheet.edge_mm),
        "--cube {} is out of range; allowed with markers of {} mm: {least_mm:.1} (a cell of white around them) to \
         {LONGEST_EDGE_MM}",
        sheet.edge_mm,
        sheet.marker_mm
    );
    let [left, top, right, bottom] = Page::free_mm(size_mm);
    let free = [
        right - left - 2.0 * BETWEEN_MM,
        bottom - top - 2.0 * BETWEEN_MM,
    ];
    let about = format!(
        "{} {} to {}, {} mm on a cube of {} mm{}",
        sheet.family.name(),
        sheet.first_id,
        sheet.first_id.saturating_add(5),
        sheet.marker_mm,
        sheet.edge_mm,
        border_text(sheet.family)
    );
    let fits_in_one = NET[0] * sheet.edge_mm <= free[0] && NET[1] * sheet.edge_mm <= free[1];
    let pages = match fits_in_one {
        true => vec![sheet.net(Page::new(size_mm, &about))?],
        false => sheet.one_by_one(size_mm, free, &about)?,
    };
    let markers: Vec<Marker> = (sheet.first_id..)
        .zip(&SIDES)
        .map(|(id, side)| sheet.marker(id, side))
        .collect();
    Ok((pages, anchor_block::board(sheet.name, &markers)))
}

impl CubeSheet<'_> {
    fn marker(&self, id: u32, side: &Side) -> Marker {
        let [x, y, z] = side.axes;
        Marker {
            anchor_from_marker: DAffine3::from_mat3_translation(
                DMat3::from_cols(x, y, z),
                z * (self.edge_mm / 2000.0),
            ),
            ..Marker::alone(self.family, id, self.marker_mm / 1000.0)
        }
    }

    /// All faces in one piece: cut around it, fold it backwards along the edges.
    fn net(&self, mut page: Page) -> Result<Page> {
        for (id, side) in (self.first_id..).zip(&SIDES) {
            let at = side
                .in_net
                .map(|step| MARGIN_MM + BETWEEN_MM + f64::from(step) * self.edge_mm);
            self.face(&mut page, at, id)?;
        }
        Ok(page)
    }

    /// Each face by itself, with what it is below it.
    fn one_by_one(&self, size_mm: [f64; 2], free: [f64; 2], about: &str) -> Result<Vec<Page>> {
        let card_mm = [self.edge_mm, self.edge_mm + LABEL_MM];
        let counts =
            [0, 1].map(|k| ((free[k] + BETWEEN_MM) / (card_mm[k] + BETWEEN_MM)).floor() as usize);
        let per_page = counts[0] * counts[1];
        ensure!(
            per_page > 0,
            "a face of {} mm does not fit on {:.0} x {:.0} mm of this paper",
            self.edge_mm,
            free[0],
            free[1]
        );
        let ids: Vec<(u32, &Side)> = (self.first_id..).zip(&SIDES).collect();
        let mut pages = Vec::new();
        for faces in ids.chunks(per_page) {
            let mut page = Page::new(size_mm, about);
            for (place, &(id, side)) in faces.iter().enumerate() {
                let step = [place % counts[0], place / counts[0]];
                let at = [0, 1]
                    .map(|k| MARGIN_MM + BETWEEN_MM + step[k] as f64 * (card_mm[k] + BETWEEN_MM));
                self.face(&mut page, at, id)?;
                let label = format!("{}, above it {}", side.name, side.above);
                page.write([at[0], at[1] + self.edge_mm + LABEL_MM - 1.2], 2.5, &label);
            }
            pages.push(page);
        }
        Ok(pages)
    }

    fn face(&self, page: &mut Page, at: [f64; 2], id: u32) -> Result<()> {
        page.cut_marks(at, [self.edge_mm; 2]);
        let marker_at = at.map(|at| at + (self.edge_mm - self.marker_mm) / 2.0);
        print_marker(page, marker_at, self.marker_mm, (self.family, id))
    }
}
