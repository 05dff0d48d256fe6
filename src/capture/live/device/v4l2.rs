//! Video4Linux, by the crate `v4l` (which nokhwa uses too).

use std::io;

use v4l::buffer::Type;
use v4l::format::FourCC;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::io::mmap::Stream;
use v4l::io::traits::CaptureStream as _;
use v4l::video::Capture as _;
use v4l::video::capture::Parameters;

use super::Offered;
use crate::capture::live::decode::RawPicture;
use crate::capture::live::error::LiveError;
use crate::capture::live::format::Offer;
use crate::scene::PixelFormat;

/// Formats by the driver's names of them.
const BY_FOURCC: [(&[u8; 4], PixelFormat); 12] = [
    (b"MJPG", PixelFormat::Mjpeg),
    (b"JPEG", PixelFormat::Mjpeg),
    (b"YUYV", PixelFormat::Yuyv),
    (b"YVYU", PixelFormat::Yvyu),
    (b"UYVY", PixelFormat::Uyvy),
    (b"NV12", PixelFormat::Nv12),
    (b"YU12", PixelFormat::Yu12),
    (b"GREY", PixelFormat::Grey),
    (b"Y800", PixelFormat::Grey),
    (b"Y16 ", PixelFormat::Y16),
    (b"RGB3", PixelFormat::Rgb),
    (b"BGR3", PixelFormat::Bgr),
];

/// Sizes that are asked of a camera that takes any between two.
const USUAL_SIZES_PX: [[u32; 2]; 9] = [
    [160, 120],
    [320, 240],
    [640, 360],
    [640, 480],
    [800, 600],
    [1280, 720],
    [1280, 960],
    [1600, 1200],
    [1920, 1080],
];
/// Rates that are asked of a camera that takes any between two.
const USUAL_FPS: [u32; 6] = [5, 10, 15, 24, 30, 60];

/// What a camera has.
pub(crate) fn offered(number: u32, label: &str) -> Result<Offered, LiveError> {
    let refused = |error: io::Error| refusal(label, &error);
    let device = v4l::Device::new(number as usize).map_err(refused)?;
    let (mut offers, mut unknown) = (Vec::new(), Vec::new());
    for description in device.enum_formats().map_err(refused)? {
        let fourcc = description.fourcc;
        let Some(pixels) = pixels_of(fourcc) else {
            unknown.push(format!("{} ({})", fourcc, description.description));
            continue;
        };
        let sizes = device.enum_framesizes(fourcc).unwrap_or_default();
        let sizes_px = sizes.into_iter().flat_map(|size| sizes_of(size.size));
        let mut sizes_px: Vec<[u32; 2]> = sizes_px.collect();
        if sizes_px.is_empty() {
            // Drivers that list none have the size that they are set to.
            sizes_px.extend(
                device
                    .format()
                    .ok()
                    .map(|format| [format.width, format.height]),
            );
        }
        for size_px in sizes_px {
            let rates = rates_of(&device, fourcc, size_px);
            offers.extend(rates.into_iter().map(|fps| Offer {
                size_px,
                fps,
                pixels,
            }));
        }
    }
    Ok(Offered::sorted(offers, unknown))
}

fn pixels_of(fourcc: FourCC) -> Option<PixelFormat> {
    let known = BY_FOURCC.iter().find(|(name, _)| **name == fourcc.repr);
    known.map(|&(_, pixels)| pixels)
}

fn sizes_of(size: FrameSizeEnum) -> Vec<[u32; 2]> {
    match size {
        FrameSizeEnum::Discrete(size) => vec![[size.width, size.height]],
        FrameSizeEnum::Stepwise(steps) => {
            let has = |side: u32, least: u32, most: u32, step: u32| {
                (least..=most).contains(&side) && (side - least).is_multiple_of(step.max(1))
            };
            let mut sizes: Vec<[u32; 2]> = USUAL_SIZES_PX
                .into_iter()
                .filter(|[width, height]| {
                    has(*width, steps.min_width, steps.max_width, steps.step_width)
                        && has(
                            *height,
                            steps.min_height,
                            steps.max_height,
                            steps.step_height,
                        )
                })
                .collect();
            if sizes.is_empty() {
                sizes.push([steps.max_width, steps.max_height]);
            }
            sizes
        }
    }
}

/// Rates at a size, in whole pictures per second.
fn rates_of(device: &v4l::Device, fourcc: FourCC, [width, height]: [u32; 2]) -> Vec<u32> {
    let intervals = device.enum_frameintervals(fourcc, width, height);
    let rate = |above: u32, below: u32| f64::from(below) / f64::from(above.max(1));
    let mut rates = Vec::new();
    for interval in intervals.unwrap_or_default() {
        match interval.interval {
            FrameIntervalEnum::Discrete(secs) => {
                rates.push(rate(secs.numerator, secs.denominator).round() as u32);
            }
            FrameIntervalEnum::Stepwise(steps) => {
                let slowest = rate(steps.max.numerator, steps.max.denominator);
                let fastest = rate(steps.min.numerator, steps.min.denominator);
                let usual = USUAL_FPS
                    .into_iter()
                    .filter(|fps| (slowest - 0.01..=fastest + 0.01).contains(&f64::from(*fps)));
                rates.extend(usual);
            }
        }
    }
    if rates.is_empty() {
        let set = device.params().map(|params| params.interval);
        let set = set.map(|secs| rate(secs.numerator, secs.denominator).round() as u32);
        rates.push(set.unwrap_or(0));
    }
    // A driver that does not know says 0.
    rates
        .into_iter()
        .map(|fps| if fps == 0 { 30 } else { fps })
        .collect()
}

/// A camera that sends pictures.
pub(crate) struct Device {
    stream: Stream<'static>,
    /// The stream's buffers are the device's.
    _device: v4l::Device,
    pixels: PixelFormat,
    size_px: [u32; 2],
    stride_bytes: usize,
}

impl Device {
    /// Has the camera send what it offers.
    pub(crate) fn open(number: u32, offer: Offer, label: &str) -> Result<Self, LiveError> {
        let refused = |error: io::Error| refusal(label, &error);
        let device = v4l::Device::new(number as usize).map_err(refused)?;
        let named = BY_FOURCC
            .iter()
            .filter(|(_, pixels)| *pixels == offer.pixels);
        let mut taken = None;
        for (name, _) in named {
            let mut format = device.format().map_err(refused)?;
            [format.width, format.height] = offer.size_px;
            format.fourcc = FourCC::new(name);
            // Rows as long as the driver likes.
            format.stride = 0;
            let set = device.set_format(&format).map_err(refused)?;
            if set.fourcc.repr == **name && [set.width, set.height] == offer.size_px {
                taken = Some(set);
                break;
            }
        }
        let format = taken.ok_or_else(|| LiveError::Camera {
            camera: label.to_owned(),
            message: format!("it offers {offer}, but does not take it"),
        })?;
        // Some drivers have one rate and cannot be asked for it.
        _ = device.set_params(&Parameters::with_fps(offer.fps));
        let stream = Stream::new(&device, Type::VideoCapture).map_err(refused)?;
        Ok(Self {
            stream,
            _device: device,
            pixels: offer.pixels,
            size_px: offer.size_px,
            stride_bytes: format.stride as usize,
        })
    }

    /// Waits for the next picture, and gives what `look` makes of it.
    pub(crate) fn next<T>(
        &mut self,
        label: &str,
        look: impl FnOnce(RawPicture<'_>) -> T,
    ) -> Result<T, LiveError> {
        let (bytes, metadata) = self.stream.next().map_err(|error| refusal(label, &error))?;
        // The buffer is as long as the largest picture, this one perhaps not.
        let used = bytes.get(..metadata.bytesused as usize);
        let bytes = used.filter(|bytes| !bytes.is_empty()).unwrap_or(bytes);
        Ok(look(RawPicture {
            bytes,
            pixels: self.pixels,
            size_px: self.size_px,
            stride_bytes: self.stride_bytes,
        }))
    }
}

/// What the driver says, as one of our errors.
fn refusal(label: &str, error: &io::Error) -> LiveError {
    let camera = label.to_owned();
    // Another program has the camera's buffers or its format.
    if error.kind() == io::ErrorKind::ResourceBusy {
        LiveError::Busy { camera }
    } else {
        let message = error.to_string();
        LiveError::Camera { camera, message }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use v4l::framesize::Stepwise;

    #[test]
    fn a_busy_camera_is_told_as_one() {
        // EBUSY and ENODEV.
        let told = |number| refusal("webcam:0", &io::Error::from_raw_os_error(number));
        assert!(matches!(told(16), LiveError::Busy { .. }));
        assert!(matches!(told(19), LiveError::Camera { .. }));
    }

    #[test]
    fn of_any_size_the_usual_ones_are_offered() {
        let steps = |most: [u32; 2], step| {
            FrameSizeEnum::Stepwise(Stepwise {
                min_width: 16,
                max_width: most[0],
                step_width: step,
                min_height: 16,
                max_height: most[1],
                step_height: step,
            })
        };
        let expected = [[160, 120], [320, 240], [640, 360], [640, 480]];
        assert_eq!(sizes_of(steps([700, 500], 8)), expected);
        assert_eq!(sizes_of(steps([48, 32], 1)), [[48, 32]]);
    }

    #[test]
    fn every_format_is_known_by_the_drivers_name() {
        for (name, pixels) in BY_FOURCC {
            assert_eq!(pixels_of(FourCC::new(name)), Some(pixels));
        }
        for (_, pixels) in PixelFormat::BY_NAME {
            assert!(
                BY_FOURCC.iter().any(|(_, known)| *known == pixels),
                "{pixels:?}"
            );
        }
        assert_eq!(pixels_of(FourCC::new(b"H264")), None);
    }
}
