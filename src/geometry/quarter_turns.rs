//! Pictures that are turned by quarters: a camera that is held upright.

use glam::DVec2;

/// Quarter turns of a picture, clockwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct QuarterTurns(u8);

impl QuarterTurns {
    /// As it is.
    pub const NONE: Self = Self(0);
    /// Once clockwise.
    pub const ONE: Self = Self(1);
    /// Upside down.
    pub const HALF: Self = Self(2);
    /// Once counter-clockwise.
    pub const BACK: Self = Self(3);

    /// What takes it back.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self((4 - self.0) % 4)
    }

    /// Width and height of a picture after the turn.
    pub fn size_px(self, size_px: [u32; 2]) -> [u32; 2] {
        let [width, height] = size_px;
        match self.0 % 2 {
            0 => size_px,
            _ => [height, width],
        }
    }

    /// Where a pixel of a picture of this size comes to lie.
    pub fn pixel(self, pixel: DVec2, size_px: [u32; 2]) -> DVec2 {
        let last = DVec2::from_array(size_px.map(f64::from)) - 1.0;
        match self.0 {
            0 => pixel,
            1 => DVec2::new(last.y - pixel.y, pixel.x),
            2 => last - pixel,
            _ => DVec2::new(pixel.y, last.x - pixel.x),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_take_the_corners_round_and_back() {
        let size_px = [4, 3];
        // The top left pixel goes to the top right, then on.
        let top_left = DVec2::ZERO;
        assert_eq!(
            QuarterTurns::ONE.pixel(top_left, size_px),
            DVec2::new(2.0, 0.0)
        );
        assert_eq!(
            QuarterTurns::HALF.pixel(top_left, size_px),
            DVec2::new(3.0, 2.0)
        );
        assert_eq!(
            QuarterTurns::BACK.pixel(top_left, size_px),
            DVec2::new(0.0, 3.0)
        );
        for turns in (0..4).map(QuarterTurns) {
            let turned_px = turns.size_px(size_px);
            let there = turns.pixel(DVec2::new(1.0, 0.5), size_px);
            assert_eq!(
                turns.inverse().pixel(there, turned_px),
                DVec2::new(1.0, 0.5)
            );
            assert_eq!(turns.inverse().size_px(turned_px), size_px);
        }
    }
}
