//! What a stream says of its colours, and from its R'G'B' to sRGB.
//!
//! Spaces, primaries and transfers are those of ITU-T H.273. Pictures for displays (BT.601, BT.709, sRGB) are shown as they
//! are, as all players do. Other primaries (BT.2020, P3) are converted. HLG and PQ (ITU-R BT.2100) hold more light than a
//! display of sRGB shows: they are tone-mapped by the curve of ITU-R BT.2390-10, section 5.4.1, on the brightest of the
//! three channels, which keeps hues; white paper, 203 cd/m² (ITU-R BT.2408, section 2), comes out a little below white.

use glam::{DMat3, DVec3, Mat3, Vec3};
use rayon::prelude::*;
use yuv::{YuvRange, YuvStandardMatrix};

use super::log::ColourTags;
use super::planes::{self, Coding, PixelLayout};

/// Streams with fewer lines that say nothing are BT.601, others BT.709.
const LINES_OF_BT_709: u32 = 720;

/// Luminance of white paper and of the brightest light that is shown, cd/m².
const WHITE_NITS: f64 = 203.0;
/// The brightest light of HLG's reference display, and of what is mastered in PQ for the most part, cd/m².
const PEAK_NITS: f64 = 1000.0;

/// How coded values become light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Transfer {
    /// As displays expect it: BT.709, BT.601, BT.2020, sRGB, and what says nothing.
    Display,
    /// Values are light.
    Linear,
    /// Hybrid log-gamma (BT.2100).
    Hlg,
    /// Perceptual quantizer (BT.2100, SMPTE ST 2084).
    Pq,
}

/// Which lights the three channels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Primaries {
    /// Those of BT.709 and sRGB. BT.601's are taken for the same: cameras that say BT.601 do not convert to them either, and
    /// no player converts back.
    Bt709,
    Bt2020,
    /// P3 with the white of sRGB, or of cinemas, whose white is taken for it.
    P3,
}

/// The colours of a stream.
#[derive(Clone, Copy)]
pub(super) struct Colours {
    pub coding: Coding,
    pub transfer: Transfer,
    pub primaries: Primaries,
}

impl Colours {
    /// What the tags say, or what is usual for a stream of so many lines.
    pub(super) fn of(tags: &ColourTags, layout: PixelLayout, lines: u32) -> Self {
        let matrix = match tags.matrix.as_str() {
            "bt709" => YuvStandardMatrix::Bt709,
            "bt470bg" | "smpte170m" => YuvStandardMatrix::Bt601,
            "bt2020nc" | "bt2020c" => YuvStandardMatrix::Bt2020,
            // (The crate's own has them for each other.)
            "smpte240m" => YuvStandardMatrix::Custom(0.212, 0.087),
            "fcc" => YuvStandardMatrix::Fcc,
            _ if lines >= LINES_OF_BT_709 => YuvStandardMatrix::Bt709,
            _ => YuvStandardMatrix::Bt601,
        };
        let range = match tags.range.as_str() {
            "pc" => YuvRange::Full,
            "tv" => YuvRange::Limited,
            _ => planes::usual_range(layout),
        };
        Self {
            coding: Coding { matrix, range },
            transfer: match tags.transfer.as_str() {
                "arib-std-b67" => Transfer::Hlg,
                "smpte2084" => Transfer::Pq,
                "linear" => Transfer::Linear,
                _ => Transfer::Display,
            },
            primaries: match tags.primaries.as_str() {
                "bt2020" => Primaries::Bt2020,
                "smpte431" | "smpte432" => Primaries::P3,
                _ => Primaries::Bt709,
            },
        }
    }

    /// What is done to the light that no display shows, in words.
    pub(super) fn remark(self) -> Option<&'static str> {
        match self.transfer {
            Transfer::Display | Transfer::Linear => None,
            Transfer::Hlg => Some(
                "HLG, with more light than a display shows: tone-mapped (ITU-R BT.2390), which shadows and lights do not \
                 know of; a camera set to SDR gives better ones",
            ),
            Transfer::Pq => Some(
                "PQ (HDR10), with more light than a display shows: tone-mapped (ITU-R BT.2390), which shadows and lights do \
                 not know of; a camera set to SDR gives better ones",
            ),
        }
    }

    /// Whether R'G'B' is sRGB as it stands.
    pub(super) fn is_srgb(self) -> bool {
        self.transfer == Transfer::Display && self.primaries == Primaries::Bt709
    }
}

/// What to say where the matrix is one that is not known here.
pub(super) fn remark_of_matrix(tags: &ColourTags, layout: PixelLayout) -> Option<String> {
    const KNOWN: [&str; 11] = [
        "bt709",
        "bt470bg",
        "smpte170m",
        "bt2020nc",
        "bt2020c",
        "smpte240m",
        "fcc",
        "gbr",
        "unknown",
        "unspecified",
        "reserved",
    ];
    let is_coded = matches!(layout, PixelLayout::Planar { .. });
    let matrix = tags.matrix.as_str();
    (is_coded && !KNOWN.contains(&matrix)).then(|| {
        format!(
            "its colours are coded by {matrix}, which is not read: they are taken as if they were coded as usual, and are wrong; \
             encode it anew by BT.709"
        )
    })
}

/// From R'G'B' of a stream that is not sRGB to sRGB: tables, made once.
pub(super) struct ToSrgb {
    largest: u16,
    primaries: Primaries,
    transfer: Transfer,
    /// Light of each code; 1 is white.
    light: Vec<f32>,
    /// sRGB code of light from 0 to 1.
    code: Vec<u8>,
    /// What is shown of light from 0 to the brightest.
    shown: Vec<f32>,
    bt709_from_stream: Mat3,
}

/// Entries of the table of codes: so many that no step of the steepest part, in the dark, is passed over.
const CODES: usize = 1 << 14;
const SHOWN: usize = 1 << 12;

impl ToSrgb {
    pub(super) fn new(colours: Colours, largest: u16) -> Self {
        let Colours {
            transfer,
            primaries,
            ..
        } = colours;
        let light = (0..=largest)
            .map(|code| light_of(f64::from(code) / f64::from(largest), transfer) as f32)
            .collect();
        // What was coded for displays keeps its own curve, so that grey stays as it is.
        let coded = |light: f64| match transfer {
            Transfer::Display => light.powf(1.0 / DISPLAY_GAMMA),
            _ => srgb_of(light),
        };
        let code = (0..CODES)
            .map(|k| (coded(k as f64 / (CODES - 1) as f64) * 255.0).round() as u8)
            .collect();
        let shown = (0..SHOWN)
            .map(|k| shown_of(k as f64 / (SHOWN - 1) as f64 * PEAK_NITS / WHITE_NITS) as f32)
            .collect();
        Self {
            largest,
            primaries,
            transfer,
            light,
            code,
            shown,
            bt709_from_stream: bt709_from(primaries).as_mat3(),
        }
    }

    /// Whether it is the one for these.
    pub(super) fn fits(&self, colours: Colours, largest: u16) -> bool {
        (self.transfer, self.primaries, self.largest)
            == (colours.transfer, colours.primaries, largest)
    }

    /// 8-bit RGBA, sRGB, from RGBA as it was coded.
    pub(super) fn rgba(&self, coded: &[u16]) -> Vec<u8> {
        let mut rgba = vec![255; coded.len()];
        rgba.par_chunks_mut(4096)
            .zip(coded.par_chunks(4096))
            .for_each(|(rgba, coded)| {
                for (rgba, coded) in rgba.chunks_exact_mut(4).zip(coded.chunks_exact(4)) {
                    let srgb = self.pixel([coded[0], coded[1], coded[2]]);
                    rgba[..3].copy_from_slice(&srgb);
                }
            });
        rgba
    }

    fn pixel(&self, coded: [u16; 3]) -> [u8; 3] {
        let [red, green, blue] = coded.map(|code| self.light[code.min(self.largest) as usize]);
        let mut light = Vec3::new(red, green, blue);
        match self.transfer {
            Transfer::Display | Transfer::Linear => {}
            Transfer::Hlg => light = self.tone_mapped(hlg_displayed(light)),
            Transfer::Pq => light = self.tone_mapped(light),
        }
        let light = self.bt709_from_stream * light;
        let code = |light: f32| {
            let place = light.clamp(0.0, 1.0) * (CODES - 1) as f32;
            self.code[place.round() as usize]
        };
        [code(light.x), code(light.y), code(light.z)]
    }

    /// Light as a display with the peak of white shows it, from light with up to [`PEAK_NITS`].
    fn tone_mapped(&self, light: Vec3) -> Vec3 {
        let brightest = light.max_element();
        if brightest <= 0.0 {
            return light;
        }
        let place = brightest * (WHITE_NITS / PEAK_NITS) as f32 * (SHOWN - 1) as f32;
        light * (self.shown[(place.round() as usize).min(SHOWN - 1)] / brightest)
    }
}

/// Displays for television (ITU-R BT.1886).
const DISPLAY_GAMMA: f64 = 2.4;

/// The light of a coded value from 0 to 1, white being 1. HLG's is that of the scene, from 0 to 1.
fn light_of(coded: f64, transfer: Transfer) -> f64 {
    match transfer {
        Transfer::Display => coded.powf(DISPLAY_GAMMA),
        Transfer::Linear => coded,
        // ITU-R BT.2100-2, table 5: the inverse of HLG's opto-electronic transfer.
        Transfer::Hlg if coded <= 0.5 => coded * coded / 3.0,
        Transfer::Hlg => {
            let (a, b, c) = (0.178_832_77, 0.284_668_92, 0.559_910_73);
            (((coded - c) / a).exp() + b) / 12.0
        }
        Transfer::Pq => nits_of_pq(coded) / WHITE_NITS,
    }
}

/// What HLG's reference display makes of the scene's light; white is 1 (BT.2100-2, table 5: gamma 1.2 at 1,000 cd/m²).
fn hlg_displayed(scene: Vec3) -> Vec3 {
    let luminance = scene.dot(Vec3::new(0.2627, 0.6780, 0.0593));
    scene * (luminance.max(1e-6).powf(0.2) * (PEAK_NITS / WHITE_NITS) as f32)
}

/// BT.2390-10, section 5.4.1: a Hermite spline in PQ above the knee.
fn shown_of(light: f64) -> f64 {
    let peak = pq_of_nits(PEAK_NITS);
    let largest = pq_of_nits(WHITE_NITS) / peak;
    let start = 1.5 * largest - 0.5;
    let e1 = (pq_of_nits(light * WHITE_NITS) / peak).min(1.0);
    if e1 <= start {
        return light;
    }
    let t = (e1 - start) / (1.0 - start);
    let (t2, t3) = (t * t, t * t * t);
    let e2 = (2.0 * t3 - 3.0 * t2 + 1.0) * start
        + (t3 - 2.0 * t2 + t) * (1.0 - start)
        + (-2.0 * t3 + 3.0 * t2) * largest;
    nits_of_pq(e2 * peak) / WHITE_NITS
}

const PQ_M1: f64 = 2610.0 / 16384.0;
const PQ_M2: f64 = 2523.0 / 4096.0 * 128.0;
const PQ_C1: f64 = 3424.0 / 4096.0;
const PQ_C2: f64 = 2413.0 / 4096.0 * 32.0;
const PQ_C3: f64 = 2392.0 / 4096.0 * 32.0;

/// Luminance of a PQ value, cd/m² (BT.2100-2, table 4).
fn nits_of_pq(coded: f64) -> f64 {
    let root = coded.max(0.0).powf(1.0 / PQ_M2);
    let ratio = (root - PQ_C1).max(0.0) / (PQ_C2 - PQ_C3 * root);
    10_000.0 * ratio.powf(1.0 / PQ_M1)
}

/// The PQ value of a luminance, cd/m² (BT.2100-2, table 4).
fn pq_of_nits(nits: f64) -> f64 {
    let power = (nits / 10_000.0).clamp(0.0, 1.0).powf(PQ_M1);
    ((PQ_C1 + PQ_C2 * power) / (1.0 + PQ_C3 * power)).powf(PQ_M2)
}

/// sRGB's code of light, both from 0 to 1 (IEC 61966-2-1).
fn srgb_of(light: f64) -> f64 {
    if light <= 0.003_130_8 {
        light * 12.92
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

/// Light in BT.709's primaries from light in others with the same white, D65.
fn bt709_from(primaries: Primaries) -> DMat3 {
    let chromaticities = |primaries| match primaries {
        Primaries::Bt709 => [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]],
        Primaries::Bt2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]],
        Primaries::P3 => [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]],
    };
    xyz_from(chromaticities(Primaries::Bt709)).inverse() * xyz_from(chromaticities(primaries))
}

/// CIE XYZ from light in primaries of these chromaticities (SMPTE RP 177).
fn xyz_from(chromaticities: [[f64; 2]; 3]) -> DMat3 {
    let xyz = |[x, y]: [f64; 2]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let columns = DMat3::from_cols_array_2d(&chromaticities.map(|xy| xyz(xy).to_array()));
    let shares = columns.inverse() * xyz([0.3127, 0.3290]);
    columns * DMat3::from_diagonal(shares)
}

#[cfg(test)]
mod tests;
