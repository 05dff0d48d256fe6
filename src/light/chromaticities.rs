//! Chromaticities: which colours red, green, blue and white are, and the way from them to the program's own, linear sRGB.

use glam::{DMat3, DVec2, DVec3};

/// CIE 1931 chromaticities (x, y) of three primaries and of the white that equal amounts of them make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chromaticities {
    /// Red, green, blue.
    pub primaries: [DVec2; 3],
    /// Of (1, 1, 1).
    pub white: DVec2,
}

/// IEC 61966-2-1: those of Rec. 709 under D65.
pub const SRGB: Chromaticities = Chromaticities {
    primaries: [
        DVec2::new(0.64, 0.33),
        DVec2::new(0.30, 0.60),
        DVec2::new(0.15, 0.06),
    ],
    white: DVec2::new(0.3127, 0.3290),
};

/// The white whose X, Y and Z are the same.
pub const EQUAL_ENERGY_WHITE: DVec2 = DVec2::new(1.0 / 3.0, 1.0 / 3.0);

/// Bradford's responses of the cones (Lam 1985), rows.
const CONES_FROM_XYZ: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);

impl Chromaticities {
    /// Linear sRGB from linear light in these primaries: white stays white (Bradford's adaptation). `None` where they span
    /// no colours: on one line, outside the plane of chromaticities, or with a white that they cannot make.
    pub fn srgb_from_these(&self) -> Option<DMat3> {
        let adapted = adaptation(self.white, SRGB.white)?;
        finite(SRGB.xyz_from_rgb()?.inverse() * adapted * self.xyz_from_rgb()?)
    }

    /// XYZ from linear RGB (Lindbloom's derivation): columns are the primaries, scaled so that they add up to white.
    fn xyz_from_rgb(&self) -> Option<DMat3> {
        // (Not with Y = 1: the blue of ACES has none above zero.)
        let primaries = self
            .primaries
            .map(|at| DVec3::new(at.x, at.y, 1.0 - at.x - at.y));
        let primaries = DMat3::from_cols_array_2d(&primaries.map(DVec3::into));
        if primaries.determinant().abs() < 1e-3 {
            return None;
        }
        let amounts = primaries.inverse() * xyz(self.white)?;
        (amounts.min_element() > 0.0).then(|| primaries * DMat3::from_diagonal(amounts))
    }
}

/// Linear sRGB from XYZ under a white.
pub fn srgb_from_xyz(white: DVec2) -> Option<DMat3> {
    finite(SRGB.xyz_from_rgb()?.inverse() * adaptation(white, SRGB.white)?)
}

fn finite(matrix: DMat3) -> Option<DMat3> {
    matrix.is_finite().then_some(matrix)
}

/// XYZ of a chromaticity with Y = 1.
fn xyz(at: DVec2) -> Option<DVec3> {
    let xyz = DVec3::new(at.x / at.y, 1.0, (1.0 - at.x - at.y) / at.y);
    (xyz.is_finite() && xyz.abs().max_element() < 1e3).then_some(xyz)
}

/// XYZ as it looks under one white from XYZ under another.
fn adaptation(from: DVec2, to: DVec2) -> Option<DMat3> {
    let cones = |white| Some(CONES_FROM_XYZ * xyz(white)?);
    let scale = DMat3::from_diagonal(cones(to)? / cones(from)?);
    Some(CONES_FROM_XYZ.inverse() * scale * CONES_FROM_XYZ)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_itself_and_white_stays_white() {
        let same = SRGB.srgb_from_these().unwrap();
        assert!(same.abs_diff_eq(DMat3::IDENTITY, 1e-12), "{same}");
        // ACES AP0 (SMPTE ST 2065-1).
        let aces = Chromaticities {
            primaries: [
                DVec2::new(0.7347, 0.2653),
                DVec2::new(0.0, 1.0),
                DVec2::new(0.0001, -0.077),
            ],
            white: DVec2::new(0.32168, 0.33767),
        };
        let from_aces = aces.srgb_from_these().unwrap();
        assert!((from_aces * DVec3::ONE).abs_diff_eq(DVec3::ONE, 1e-9));
        // As ACES' own transforms have it (ACES2065-1 to linear Rec. 709, D60 adapted by Bradford).
        let published = DMat3::from_cols(
            DVec3::new(2.521_686, -0.276_480, -0.015_378),
            DVec3::new(-1.134_131, 1.372_719, -0.152_975),
            DVec3::new(-0.387_556, -0.096_239, 1.168_354),
        );
        assert!(from_aces.abs_diff_eq(published, 5e-4), "{from_aces}");
    }

    #[test]
    fn xyz_of_the_white_is_white() {
        let white = srgb_from_xyz(EQUAL_ENERGY_WHITE).unwrap() * DVec3::ONE;
        assert!(white.abs_diff_eq(DVec3::ONE, 1e-9), "{white}");
    }

    #[test]
    fn what_spans_no_colours_is_none() {
        let line = Chromaticities {
            primaries: [
                DVec2::new(0.6, 0.3),
                DVec2::new(0.4, 0.4),
                DVec2::new(0.2, 0.5),
            ],
            ..SRGB
        };
        assert_eq!(line.srgb_from_these(), None);
        let zero = Chromaticities {
            primaries: [DVec2::ZERO; 3],
            white: DVec2::ZERO,
        };
        assert_eq!(zero.srgb_from_these(), None);
        let outside = Chromaticities {
            white: DVec2::new(0.7, 0.25),
            ..SRGB
        };
        assert_eq!(outside.srgb_from_these(), None);
    }
}
