//! What pictures show where the target is not found in them: a chessboard of another size, or a board left for right.

use std::collections::BTreeMap;

use opencv::boxed_ref::BoxedRef;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Size, Vector};
use opencv::prelude::*;

use super::Target;

/// What was seen in place of a target.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ShownInstead {
    /// Pictures that show a ChArUco board once they are turned left for right.
    pub mirrored: u32,
    /// Chessboards of other sizes: inner corners across and down, and in how many pictures.
    boards: BTreeMap<[u32; 2], u32>,
    blank: u32,
}

impl ShownInstead {
    /// Counts a picture without the target, and says whether to look into it: a long recording gets few looks.
    pub(super) fn is_worth_a_look(&mut self) -> bool {
        const ALL_OF: u32 = 32;
        self.blank += 1;
        self.blank <= ALL_OF || self.blank.is_power_of_two()
    }

    pub(super) fn note_board(&mut self, corners: Option<[u32; 2]>) {
        if let Some(corners) = corners {
            *self.boards.entry(corners).or_default() += 1;
        }
    }

    /// The other chessboard that was seen most, and in how many pictures: in one alone it may be a part of a board.
    pub fn other_board(&self) -> Option<([u32; 2], u32)> {
        const FEWEST: u32 = 2;
        let most = self.boards.iter().max_by_key(|&(_, count)| *count)?;
        Some((*most.0, *most.1)).filter(|&(_, count)| count >= FEWEST)
    }

    /// The other chessboard that was seen so often that the target's size may be a mistake.
    pub(super) fn suspected(&self) -> Option<[u32; 2]> {
        const ENOUGH: u32 = 3;
        let (corners, seen) = self.other_board()?;
        (seen >= ENOUGH).then_some(corners)
    }
}

/// The size of the chessboard that a picture shows, where it is not the target's: inner corners, the larger count first.
pub(super) fn other_board_in(
    picture: &BoxedRef<'_, Mat>,
    target: &Target,
) -> opencv::Result<Option<[u32; 2]>> {
    let flags = calib3d::CALIB_CB_NORMALIZE_IMAGE | calib3d::CALIB_CB_LARGER;
    let (mut corners, mut meta) = (Vector::<Point2f>::new(), Mat::default());
    let least = Size::new(3, 3);
    let found = calib3d::find_chessboard_corners_sb_with_meta(
        picture,
        least,
        &mut corners,
        flags,
        &mut meta,
    )?;
    let ordered = |[one, other]: [u32; 2]| [one.max(other), one.min(other)];
    let size = ordered([meta.cols(), meta.rows()].map(i32::unsigned_abs));
    Ok((found && size != ordered(target.corners())).then_some(size))
}

/// An 8-bit grey picture left for right.
pub(super) fn mirrored(grey: &[u8], size_px: [u32; 2]) -> Vec<u8> {
    let mut mirrored = grey.to_vec();
    let rows = mirrored.chunks_exact_mut(size_px[0].max(1) as usize);
    rows.for_each(<[u8]>::reverse);
    mirrored
}
