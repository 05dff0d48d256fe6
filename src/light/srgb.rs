//! The display values of linear light and back (IEC 61966-2-1).

/// Linear light of a display value in [0, 1].
pub fn linear_from_srgb(encoded: f64) -> f64 {
    match encoded <= 0.040_45 {
        true => encoded / 12.92,
        false => ((encoded + 0.055) / 1.055).powf(2.4),
    }
}

/// The display value of linear light; what is darker than black or brighter than white is these.
pub fn srgb_from_linear(linear: f64) -> f64 {
    match linear <= 0.003_130_8 {
        true => 12.92 * linear.max(0.0),
        false => (1.055 * linear.powf(1.0 / 2.4) - 0.055).min(1.0),
    }
}

/// The level of 255 of a part of display white, or of white paper's light.
pub fn srgb_level(linear: f32) -> u8 {
    (255.0 * srgb_from_linear(f64::from(linear))).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_come_back() {
        for level in 0..=255_u8 {
            let linear = linear_from_srgb(f64::from(level) / 255.0);
            assert_eq!(srgb_level(linear as f32), level);
        }
        assert_eq!([-1.0, 2.0].map(srgb_level), [0, 255]);
        // A mean of both is brighter on the screen than half.
        assert_eq!(srgb_level(0.5), 188);
    }
}
