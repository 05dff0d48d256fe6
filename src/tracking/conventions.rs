//! Where the two detectors differ on what a corner is, and how gnomon says it.
//!
//! gnomon: corners as printed, from the top left clockwise (as the viewer of the print sees them); a pixel's integer
//! coordinate is its centre. libapriltag: counter-clockwise from the bottom left, a pixel's centre is at .5. OpenCV:
//! clockwise from the corner that is the top left of *its* picture; the integer is the centre, but corners refined by
//! its copy of AprilTag's code keep that code's half pixel, and its contours run through the outermost black pixels'
//! centres, half a pixel inside the printed edge.

use glam::DVec2;

use crate::scene::{ArucoRefinement, Drawing, Ink};

/// Corners as printed from those of libapriltag.
pub(super) fn corners_from_apriltag(corners: [DVec2; 4]) -> [DVec2; 4] {
    let [bottom_left, bottom_right, top_right, top_left] =
        corners.map(|corner| corner - DVec2::splat(0.5));
    [top_left, top_right, bottom_right, bottom_left]
}

/// Corners of a drawing from those of the family's own.
pub(super) fn corners_as_drawn(corners: [DVec2; 4], drawing: Drawing) -> [DVec2; 4] {
    let [top_left, top_right, bottom_right, bottom_left] = corners;
    match drawing {
        Drawing::Own => corners,
        Drawing::OpenCv => [bottom_right, bottom_left, top_left, top_right],
    }
}

/// Corners as printed from those of OpenCV, whose picture of the marker is the print turned by `quarter_turns`
/// clockwise.
pub(super) fn corners_from_aruco(
    corners: [DVec2; 4],
    quarter_turns: usize,
    refinement: ArucoRefinement,
    ink: Ink,
) -> [DVec2; 4] {
    // Contours are of what is dark: within a black marker's edge, outside of a white one's.
    let inside_px = match ink {
        Ink::BlackOnWhite => 0.5,
        Ink::WhiteOnBlack => -0.5,
    };
    let corners = match refinement {
        ArucoRefinement::AprilTag => corners.map(|corner| corner - DVec2::splat(0.5)),
        ArucoRefinement::None | ArucoRefinement::Contour => edge_from_contour(corners, inside_px),
        ArucoRefinement::Subpixel => corners,
    };
    std::array::from_fn(|k| corners[(k + quarter_turns) % 4])
}

/// Moves a contour's four sides outward by what they lie inside the edge: on average `inside_px` along the axis that
/// they cross.
fn edge_from_contour(corners: [DVec2; 4], inside_px: f64) -> [DVec2; 4] {
    let sides: [(DVec2, f64); 4] = std::array::from_fn(|k| {
        let along = (corners[(k + 1) % 4] - corners[k]).normalize_or_zero();
        // Clockwise with y down: outside is on the left hand.
        let outward = DVec2::new(along.y, -along.x);
        (
            outward,
            outward.dot(corners[k]) + inside_px * outward.abs().max_element(),
        )
    });
    std::array::from_fn(|k| {
        let ((a, a_offset), (b, b_offset)) = (sides[(k + 3) % 4], sides[k]);
        let sine = a.perp_dot(b);
        let corner = DVec2::new(
            a_offset * b.y - b_offset * a.y,
            b_offset * a.x - a_offset * b.x,
        ) / sine;
        if corner.is_finite() {
            corner
        } else {
            corners[k]
        }
    })
}

/// How many quarter turns clockwise bring the print to OpenCV's picture; both are squares of `side` cells, rows from
/// the top. `None` when no turn does.
///
/// Up to 4.x OpenCV's pictures of the AprilTag families stand on their heads, from 5 on they do not, so the installed
/// dictionary is asked.
pub(super) fn quarter_turns_between(
    template: &[bool],
    opencv: &[bool],
    side: usize,
) -> Option<usize> {
    if template.len() != side * side || opencv.len() != side * side {
        return None;
    }
    let mut turned = template.to_vec();
    for quarter_turns in 0..4 {
        if turned == opencv {
            return Some(quarter_turns);
        }
        turned = (0..side * side)
            .map(|k| turned[(side - 1 - k % side) * side + k / side])
            .collect();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_picture_tells_its_turn() {
        // A cell at the top left; a quarter turn clockwise brings it to the top right.
        let at = |k: usize| (0..9).map(|cell| cell == k).collect::<Vec<bool>>();
        for (quarter_turns, corner) in [0, 2, 8, 6].into_iter().enumerate() {
            assert_eq!(
                quarter_turns_between(&at(0), &at(corner), 3),
                Some(quarter_turns)
            );
        }
        assert_eq!(quarter_turns_between(&at(0), &at(1), 3), None);
    }

    #[test]
    fn a_contour_grows_by_half_a_pixel() {
        // Black pixels 10..=19: their centres' contour, and the edge of what they cover.
        let contour = [(10.0, 10.0), (19.0, 10.0), (19.0, 19.0), (10.0, 19.0)].map(DVec2::from);
        let edge = [(9.5, 9.5), (19.5, 9.5), (19.5, 19.5), (9.5, 19.5)].map(DVec2::from);
        for (grown, corner) in edge_from_contour(contour, 0.5).into_iter().zip(edge) {
            assert!((grown - corner).length() < 1e-12);
        }
    }

    #[test]
    fn the_top_left_of_the_print_comes_first() {
        let [a, b, c, d] = [0.0, 1.0, 2.0, 3.0].map(DVec2::splat);
        // The print turned by 90° clockwise: OpenCV's first corner (its top left) is the print's bottom left.
        let as_printed = corners_from_aruco(
            [d, a, b, c],
            1,
            ArucoRefinement::Subpixel,
            Ink::BlackOnWhite,
        );
        assert_eq!(as_printed, [a, b, c, d]);
    }
}
