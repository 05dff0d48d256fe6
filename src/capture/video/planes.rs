//! From planes of luma and chroma to RGB, by the `yuv` crate: it knows all matrices, ranges and depths, and is as fast as
//! the decoders. Chroma of less resolution is that of the nearest sample, as FFmpeg and OpenCV have it (the crate's bilinear
//! ways are off by a pixel).

use bytemuck::cast_slice;
use yuv::{YuvError, YuvGrayImage, YuvPlanarImage, YuvRange, YuvStandardMatrix};

/// How R'G'B' was coded as luma and chroma.
#[derive(Clone, Copy)]
pub(super) struct Coding {
    pub matrix: YuvStandardMatrix,
    pub range: YuvRange,
}

/// The way in which a frame's pixels lie in memory: planes without padding, or RGBA.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PixelLayout {
    /// 8-bit RGBA.
    Rgba,
    /// 8-bit luma alone.
    Grey,
    /// Planes of luma and two of chroma.
    Planar {
        chroma: Chroma,
        depth: Depth,
        /// Full range by the name of the format, as JPEG has it.
        jpeg: bool,
    },
}

/// How much less chroma there is than luma.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Chroma {
    /// In both directions half.
    Yuv420,
    /// Half as wide.
    Yuv422,
    /// As much.
    Yuv444,
}

/// Bits of a sample; more than 8 lie in 16.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    Eight,
    Ten,
    Twelve,
}

/// FFmpeg's names of those that it is asked for. It converts others to the nearest of them.
const BY_NAME: [(&str, PixelLayout); 14] = [
    ("yuv420p", planar(Chroma::Yuv420, Depth::Eight, false)),
    ("yuvj420p", planar(Chroma::Yuv420, Depth::Eight, true)),
    ("yuv422p", planar(Chroma::Yuv422, Depth::Eight, false)),
    ("yuvj422p", planar(Chroma::Yuv422, Depth::Eight, true)),
    ("yuv444p", planar(Chroma::Yuv444, Depth::Eight, false)),
    ("yuvj444p", planar(Chroma::Yuv444, Depth::Eight, true)),
    ("yuv420p10le", planar(Chroma::Yuv420, Depth::Ten, false)),
    ("yuv422p10le", planar(Chroma::Yuv422, Depth::Ten, false)),
    ("yuv444p10le", planar(Chroma::Yuv444, Depth::Ten, false)),
    ("yuv420p12le", planar(Chroma::Yuv420, Depth::Twelve, false)),
    ("yuv422p12le", planar(Chroma::Yuv422, Depth::Twelve, false)),
    ("yuv444p12le", planar(Chroma::Yuv444, Depth::Twelve, false)),
    ("gray", PixelLayout::Grey),
    ("rgba", PixelLayout::Rgba),
];

const fn planar(chroma: Chroma, depth: Depth, jpeg: bool) -> PixelLayout {
    PixelLayout::Planar {
        chroma,
        depth,
        jpeg,
    }
}

impl PixelLayout {
    /// All, as FFmpeg's filter `format` takes them.
    pub(super) fn ffmpeg_names() -> String {
        BY_NAME.map(|(name, _)| name).join("|")
    }

    pub(super) fn by_ffmpeg_name(name: &str) -> Option<Self> {
        BY_NAME
            .iter()
            .find(|(known, _)| *known == name)
            .map(|&(_, layout)| layout)
    }

    /// Bytes of a frame.
    pub(super) fn bytes(self, size_px: [u32; 2]) -> usize {
        let area = area([size_px[0], size_px[1]]);
        match self {
            Self::Rgba => area * 4,
            Self::Grey => area,
            Self::Planar { chroma, depth, .. } => {
                (area + 2 * self::area(chroma.size(size_px))) * depth.bytes()
            }
        }
    }
}

impl PixelLayout {
    /// The largest code of a channel.
    pub(super) fn largest(self) -> u16 {
        match self {
            Self::Rgba | Self::Grey => 255,
            Self::Planar { depth, .. } => depth.largest(),
        }
    }
}

impl Chroma {
    /// Width and height of a plane of chroma; odd sides are rounded up.
    fn size(self, [width, height]: [u32; 2]) -> [u32; 2] {
        match self {
            Self::Yuv420 => [width.div_ceil(2), height.div_ceil(2)],
            Self::Yuv422 => [width.div_ceil(2), height],
            Self::Yuv444 => [width, height],
        }
    }
}

impl Depth {
    fn bytes(self) -> usize {
        match self {
            Self::Eight => 1,
            Self::Ten | Self::Twelve => 2,
        }
    }

    /// The largest code.
    pub(super) fn largest(self) -> u16 {
        match self {
            Self::Eight => 255,
            Self::Ten => 1023,
            Self::Twelve => 4095,
        }
    }
}

fn area([width, height]: [u32; 2]) -> usize {
    width as usize * height as usize
}

/// 8-bit RGBA of a frame's pixels, its R'G'B' as it was coded.
pub(super) fn rgba8(
    pixels: &[u8],
    layout: PixelLayout,
    size_px: [u32; 2],
    coding: Coding,
) -> Result<Vec<u8>, YuvError> {
    let [width, height] = size_px;
    let (range, matrix) = (coding.range, coding.matrix);
    let stride = width * 4;
    let (chroma, depth) = match layout {
        PixelLayout::Rgba => {
            let mut rgba = pixels.to_vec();
            // What lies behind a see-through pixel is as good as what a camera saw.
            rgba.chunks_exact_mut(4).for_each(|pixel| pixel[3] = 255);
            return Ok(rgba);
        }
        PixelLayout::Grey => {
            let grey = YuvGrayImage {
                y_plane: pixels,
                y_stride: width,
                width,
                height,
            };
            let mut rgba = vec![0; area(size_px) * 4];
            yuv::yuv400_to_rgba(&grey, &mut rgba, stride, range, matrix)?;
            return Ok(rgba);
        }
        PixelLayout::Planar { chroma, depth, .. } => (chroma, depth),
    };
    let mut rgba = vec![0; area(size_px) * 4];
    match depth {
        Depth::Eight => {
            let convert = match chroma {
                Chroma::Yuv420 => yuv::yuv420_to_rgba,
                Chroma::Yuv422 => yuv::yuv422_to_rgba,
                Chroma::Yuv444 => yuv::yuv444_to_rgba,
            };
            let planes = planes(pixels, chroma, size_px);
            convert(&planes, &mut rgba, stride, range, matrix)?;
        }
        Depth::Ten | Depth::Twelve => {
            let deep = rgba16(pixels, layout, size_px, coding)?;
            let shift = depth.largest().count_ones() - 8;
            for (eight, deep) in rgba.iter_mut().zip(deep) {
                // To the nearest; 255 stands for the largest code as 0 for 0.
                *eight = ((u32::from(deep) * 255 + (128 << shift) - 1) / u32::from(depth.largest()))
                    .min(255) as u8;
            }
        }
    }
    Ok(rgba)
}

/// RGBA of a frame's pixels, its R'G'B' as it was coded, with all the bits that it has: to [`Depth::largest`].
pub(super) fn rgba16(
    pixels: &[u8],
    layout: PixelLayout,
    size_px: [u32; 2],
    coding: Coding,
) -> Result<Vec<u16>, YuvError> {
    let PixelLayout::Planar { chroma, depth, .. } = layout else {
        return rgba8(pixels, layout, size_px, coding).map(widened);
    };
    let convert = match (depth, chroma) {
        (Depth::Eight, _) => return rgba8(pixels, layout, size_px, coding).map(widened),
        (Depth::Ten, Chroma::Yuv420) => yuv::i010_to_rgba10,
        (Depth::Ten, Chroma::Yuv422) => yuv::i210_to_rgba10,
        (Depth::Ten, Chroma::Yuv444) => yuv::i410_to_rgba10,
        (Depth::Twelve, Chroma::Yuv420) => yuv::i012_to_rgba12,
        (Depth::Twelve, Chroma::Yuv422) => yuv::i212_to_rgba12,
        (Depth::Twelve, Chroma::Yuv444) => yuv::i412_to_rgba12,
    };
    let mut rgba = vec![0; area(size_px) * 4];
    let samples = samples(pixels);
    let planes = planes(&samples, chroma, size_px);
    convert(
        &planes,
        &mut rgba,
        size_px[0] * 4,
        coding.range,
        coding.matrix,
    )?;
    Ok(rgba)
}

fn widened(rgba: Vec<u8>) -> Vec<u16> {
    rgba.into_iter().map(u16::from).collect()
}

/// Little-endian samples; copied only where they do not lie as this machine wants them.
fn samples(pixels: &[u8]) -> std::borrow::Cow<'_, [u16]> {
    match bytemuck::try_cast_slice(pixels) {
        Ok(samples) if cfg!(target_endian = "little") => samples.into(),
        _ => cast_slice::<u8, [u8; 2]>(pixels)
            .iter()
            .map(|&bytes| u16::from_le_bytes(bytes))
            .collect(),
    }
}

fn planes<T: Copy + std::fmt::Debug>(
    samples: &[T],
    chroma: Chroma,
    size_px: [u32; 2],
) -> YuvPlanarImage<'_, T> {
    let chroma_px = chroma.size(size_px);
    let (y_plane, rest) = samples.split_at(area(size_px));
    let (u_plane, v_plane) = rest.split_at(area(chroma_px));
    YuvPlanarImage {
        y_plane,
        y_stride: size_px[0],
        u_plane,
        u_stride: chroma_px[0],
        v_plane,
        v_stride: chroma_px[0],
        width: size_px[0],
        height: size_px[1],
    }
}

/// The range of a layout whose stream says nothing of it: luma alone is what a sensor gives.
pub(super) fn usual_range(layout: PixelLayout) -> YuvRange {
    match layout {
        PixelLayout::Rgba | PixelLayout::Grey => YuvRange::Full,
        PixelLayout::Planar { jpeg: true, .. } => YuvRange::Full,
        PixelLayout::Planar { jpeg: false, .. } => YuvRange::Limited,
    }
}
