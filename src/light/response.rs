//! How a camera turns exposure into levels, and one picture of radiance from several exposures.
//! Debevec & Malik, 'Recovering High Dynamic Range Radiance Maps from Photographs' (1997).

use std::fmt::Write as _;

use glam::Vec3;

use super::radiance_picture::RadiancePicture;

/// Levels at and above this one may be cut off.
const SATURATED: u8 = 250;
/// Levels at and below this one tell next to nothing.
const BLACK: u8 = 3;
/// What sRGB means by [`MIDDLE`], in parts of white: curves that were estimated up to a factor agree with it there.
const MIDDLE_EXPOSURE: f64 = 0.215_860_5;
const MIDDLE: usize = 128;
const HEADER: &str = "level,red,green,blue";

/// Exposure that makes each level of each channel, 1 = display white; it never falls from level to level.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    exposure_of_level: [[f64; 3]; 256],
}

impl Response {
    /// From exposures up to one factor a channel, which is chosen so that a level of 128 is sRGB's. Where an estimate
    /// falls from one level to the next it is held level.
    ///
    /// `None` where a value is not above 0 from level 128 on, or is negative or not finite.
    pub fn estimated(mut exposure_of_level: [[f64; 3]; 256]) -> Option<Self> {
        for channel in 0..3 {
            let mut highest: f64 = 0.0;
            for exposure in &mut exposure_of_level {
                if !(exposure[channel].is_finite() && exposure[channel] >= 0.0) {
                    return None;
                }
                highest = highest.max(exposure[channel]);
                exposure[channel] = highest;
            }
            let middle = exposure_of_level[MIDDLE][channel];
            if middle <= 0.0 {
                return None;
            }
            for exposure in &mut exposure_of_level {
                exposure[channel] *= MIDDLE_EXPOSURE / middle;
            }
        }
        Some(Self { exposure_of_level })
    }

    /// Exposures of red, green and blue for each level.
    pub fn exposure_of_level(&self) -> &[[f64; 3]; 256] {
        &self.exposure_of_level
    }

    /// As a table with a header.
    pub fn csv(&self) -> String {
        let mut text = format!("{HEADER}\n");
        for (level, [red, green, blue]) in self.exposure_of_level.iter().enumerate() {
            let _ = writeln!(text, "{level},{red:.7},{green:.7},{blue:.7}");
        }
        text
    }

    /// Reads such a table.
    ///
    /// # Errors
    /// The line (from 1) and what is wrong with it.
    pub fn from_csv(text: &str) -> Result<Self, (usize, String)> {
        let mut lines = text.lines().enumerate();
        match lines.next() {
            Some((_, header)) if header.trim() == HEADER => {}
            _ => return Err((1, format!("the header {HEADER:?} is expected"))),
        }
        let mut exposure_of_level = [[0.0; 3]; 256];
        let mut expected = 0;
        for (index, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let say = |message: String| (index + 1, message);
            let fields: Vec<Option<f64>> = line
                .split(',')
                .map(|field| field.trim().parse().ok())
                .collect();
            let [Some(level), Some(red), Some(green), Some(blue)] = fields[..] else {
                return Err(say("a level and three numbers are expected".to_owned()));
            };
            if expected > 255 || level != expected as f64 {
                return Err(say(format!("level {expected} is expected, up to 255")));
            }
            let exposures = [red, green, blue];
            let before = match expected {
                0 => [0.0; 3],
                _ => exposure_of_level[expected - 1],
            };
            for (exposure, before) in exposures.into_iter().zip(before) {
                if !(exposure.is_finite() && exposure >= before) {
                    return Err(say(format!(
                        "{exposure}: exposures are not negative and never fall from level to level"
                    )));
                }
            }
            exposure_of_level[expected] = exposures;
            expected += 1;
        }
        if expected != 256 {
            return Err((
                text.lines().count(),
                format!("ends at level {expected} of 256"),
            ));
        }
        if exposure_of_level[255]
            .iter()
            .any(|&exposure| exposure <= 0.0)
        {
            return Err((257, "level 255 has no exposure".to_owned()));
        }
        Ok(Self { exposure_of_level })
    }
}

/// One picture of a bracket.
#[derive(Debug, Clone, Copy)]
pub struct Exposure<'a> {
    /// 8-bit RGBA as the camera gave it.
    pub rgba: &'a [u8],
    /// Light let in, in parts of the exposure at which radiance 1 is white.
    pub amount: f64,
}

/// Radiance, and where the bracket was too narrow.
#[derive(Debug, Clone, PartialEq)]
pub struct Merged {
    /// Linear radiance; 1 is white at an [`Exposure::amount`] of 1.
    pub picture: RadiancePicture,
    /// Whether each pixel has a channel that is saturated even in the shortest exposure: its radiance is a lower bound.
    pub saturated: Vec<bool>,
    /// Whether each pixel has a channel that is black even in the longest exposure.
    pub black: Vec<bool>,
}

/// Merges exposures of one view. Levels count the more the farther they are from both ends (Debevec & Malik's hat, eq. 4),
/// and not at all where they may be cut off: OpenCV's merge gives those a small weight, which takes a fifth from a lamp
/// that only the shortest of four exposures shows whole, at level 224, and two fifths at 241.
///
/// `None` without exposures, and where pictures do not have the size.
pub fn merge(exposures: &[Exposure], size_px: [usize; 2], response: &Response) -> Option<Merged> {
    let by_amount = |a: &&Exposure, b: &&Exposure| a.amount.total_cmp(&b.amount);
    let shortest = exposures.iter().min_by(by_amount)?;
    let longest = exposures.iter().max_by(by_amount)?;
    let count = size_px[0].checked_mul(size_px[1])?;
    if exposures
        .iter()
        .any(|exposure| exposure.rgba.len() != 4 * count)
    {
        return None;
    }
    let mut pixels = vec![Vec3::ZERO; count];
    let mut saturated = vec![false; count];
    let mut black = vec![false; count];
    for (index, pixel) in pixels.iter_mut().enumerate() {
        for (channel, value) in pixel.as_mut().iter_mut().enumerate() {
            let level = |exposure: &Exposure| exposure.rgba[4 * index + channel];
            let radiance = |exposure: &Exposure| {
                response.exposure_of_level[usize::from(level(exposure))][channel] / exposure.amount
            };
            let (mut sum, mut weights) = (0.0, 0.0);
            for exposure in exposures {
                let weight = hat(level(exposure));
                sum += weight * radiance(exposure);
                weights += weight;
            }
            *value = if weights > 0.0 {
                sum / weights
            } else if level(shortest) >= SATURATED {
                saturated[index] = true;
                radiance(shortest)
            } else {
                // The longest exposure that is not cut off is the least noisy one.
                let whole = exposures
                    .iter()
                    .filter(|exposure| level(exposure) < SATURATED);
                black[index] |= level(longest) <= BLACK;
                radiance(whole.max_by(by_amount)?)
            } as f32;
        }
    }
    Some(Merged {
        picture: RadiancePicture::new(size_px, pixels)?,
        saturated,
        black,
    })
}

fn hat(level: u8) -> f64 {
    f64::from(
        level
            .saturating_sub(BLACK)
            .min(SATURATED.saturating_sub(level)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// sRGB's curve for red, a straight one for green, a square root for blue.
    fn response() -> Response {
        let exposure_of_level = std::array::from_fn(|level| {
            let value = level as f64 / 255.0;
            let srgb = if value <= 0.04045 {
                value / 12.92
            } else {
                ((value + 0.055) / 1.055).powf(2.4)
            };
            [7.0 * srgb, value, 0.1 * value * value]
        });
        Response::estimated(exposure_of_level).unwrap()
    }

    fn level_of(response: &Response, channel: usize, exposure: f64) -> u8 {
        let above = (0..256)
            .find(|&level| response.exposure_of_level[level][channel] >= exposure)
            .unwrap_or(255);
        let off = |level: usize| (response.exposure_of_level[level][channel] - exposure).abs();
        if above > 0 && off(above - 1) < off(above) {
            above as u8 - 1
        } else {
            above as u8
        }
    }

    #[test]
    fn curves_agree_at_the_middle_and_survive_their_file() {
        let response = response();
        for (exposure, expected) in response.exposure_of_level[255].iter().zip([
            1.0,
            MIDDLE_EXPOSURE * 255.0 / 128.0,
            MIDDLE_EXPOSURE * (255.0_f64 / 128.0).powi(2),
        ]) {
            assert!((exposure / expected - 1.0).abs() < 1e-6, "{exposure}");
        }
        let read = Response::from_csv(&response.csv()).unwrap();
        for (read, written) in read
            .exposure_of_level
            .iter()
            .zip(response.exposure_of_level)
        {
            for (read, written) in read.iter().zip(written) {
                assert!((read - written).abs() < 1e-7);
            }
        }
        let mut dented = *response.exposure_of_level();
        dented[40][1] = dented[39][1] * 0.9;
        let held = Response::estimated(dented).unwrap();
        assert_eq!(held.exposure_of_level[40][1], held.exposure_of_level[39][1]);
        dented[128][0] = f64::NAN;
        assert_eq!(Response::estimated(dented), None);
        assert_eq!(Response::estimated([[0.0; 3]; 256]), None);
    }

    #[test]
    fn mistakes_in_the_file_have_their_line() {
        let good = response().csv();
        let broken = |from: &str, to: &str| {
            let (line, message) = Response::from_csv(&good.replacen(from, to, 1)).unwrap_err();
            format!("{line}: {message}")
        };
        assert!(broken("level,", "levels,").starts_with("1: the header"));
        assert!(broken("\n7,", "\n8,").starts_with("9: level 7 is expected"));
        assert!(broken("\n7,", "\n7,x").starts_with("9: a level and three numbers"));
        assert!(broken("\n7,", "\n7,-").starts_with("9: -"));
        assert!(broken("\n9,0", "\n9,NaN\n9,0").contains("three numbers"));
        let cut: String = good
            .lines()
            .take(100)
            .map(|line| format!("{line}\n"))
            .collect();
        assert_eq!(
            Response::from_csv(&cut).unwrap_err(),
            (100, "ends at level 99 of 256".to_owned())
        );
    }

    #[test]
    fn a_bracket_gives_its_radiance_back() {
        let response = response();
        let radiances: Vec<f64> = (0..60).map(|step| 1e-3 * 1.2_f64.powi(step)).collect();
        let amounts = [4.0, 1.0, 0.25, 0.0625];
        let pictures: Vec<Vec<u8>> = amounts
            .iter()
            .map(|amount| {
                let levels = |radiance: &f64| {
                    let level = |channel| level_of(&response, channel, amount * radiance);
                    [level(0), level(1), level(2), 255]
                };
                radiances.iter().flat_map(levels).collect()
            })
            .collect();
        let exposures: Vec<Exposure> = pictures
            .iter()
            .zip(amounts)
            .map(|(rgba, amount)| Exposure { rgba, amount })
            .collect();
        let merged = merge(&exposures, [60, 1], &response).unwrap();
        for (index, radiance) in radiances.iter().enumerate() {
            let found = merged.picture.pixels()[index].as_dvec3();
            // White at the shortest exposure: 16 for red; the other curves end before.
            let within = *radiance > 0.03 && *radiance < 0.42 * 16.0 * 0.95;
            if within {
                let off = (found / *radiance - 1.0).abs().max_element();
                assert!(off < 0.02, "{radiance} {found}");
                assert!(!merged.saturated[index]);
            }
            if *radiance > 16.5 {
                assert!(merged.saturated[index] && found.max_element() < 16.5);
            }
            // Green's straight line is the last to leave level 3.
            let half_level = 3.5 / 255.0 * response.exposure_of_level[255][1];
            let is_black = amounts[0] * radiance < half_level;
            assert_eq!(merged.black[index], is_black, "{radiance}");
        }
        assert_eq!(merge(&exposures, [59, 1], &response), None);
        assert_eq!(merge(&[], [60, 1], &response), None);
    }
}
