//! Cameras by nokhwa.

use nokhwa::Camera;
use nokhwa::error::NokhwaError;
use nokhwa::utils::{
    CameraFormat, CameraIndex, FrameFormat, RequestedFormat, RequestedFormatType, Resolution,
    frame_formats,
};

use super::Offered;
use crate::capture::live::decode::RawPicture;
use crate::capture::live::error::LiveError;
use crate::capture::live::format::{self, Offer};
use crate::scene::{PixelFormat, WantedFormat};

const KNOWN: [(FrameFormat, PixelFormat); 6] = [
    (FrameFormat::MJPEG, PixelFormat::Mjpeg),
    (FrameFormat::YUYV, PixelFormat::Yuyv),
    (FrameFormat::NV12, PixelFormat::Nv12),
    (FrameFormat::GRAY, PixelFormat::Grey),
    (FrameFormat::RAWRGB, PixelFormat::Rgb),
    (FrameFormat::RAWBGR, PixelFormat::Bgr),
];

/// What a camera has.
pub(crate) fn offered(number: u32, label: &str) -> Result<Offered, LiveError> {
    let formats = open_any(number, label)?
        .compatible_camera_formats()
        .map_err(|error| refusal(label, &error))?;
    let (mut offers, mut unknown) = (Vec::new(), Vec::new());
    for format in formats {
        match KNOWN.iter().find(|(known, _)| *known == format.format()) {
            None => unknown.push(format!("{:?}", format.format())),
            Some(&(_, pixels)) => offers.push(Offer {
                size_px: [format.width(), format.height()],
                fps: format.frame_rate(),
                pixels,
            }),
        }
    }
    Ok(Offered::sorted(offers, unknown))
}

/// A camera that sends pictures.
pub(crate) struct Device {
    camera: Camera,
    offer: Offer,
}

impl Device {
    /// Has the camera send what it offers.
    pub(crate) fn open(number: u32, offer: Offer, label: &str) -> Result<Self, LiveError> {
        let refused = |error| refusal(label, &error);
        let mut camera = open_any(number, label)?;
        let [width, height] = offer.size_px;
        let kind = KNOWN.iter().find(|(_, pixels)| *pixels == offer.pixels);
        let &(kind, _) = kind.ok_or_else(|| LiveError::Camera {
            camera: label.to_owned(),
            message: format!("{offer} cannot be asked for on this system"),
        })?;
        let chosen = CameraFormat::new(Resolution::new(width, height), kind, offer.fps);
        if camera.camera_format() != chosen {
            let exactly = RequestedFormatType::Exact(chosen);
            camera
                .set_camera_requset(RequestedFormat::with_formats(exactly, frame_formats()))
                .map_err(refused)?;
        }
        camera.open_stream().map_err(refused)?;
        Ok(Self { camera, offer })
    }

    /// Waits for the next picture, and gives what `look` makes of it.
    pub(crate) fn next<T>(
        &mut self,
        label: &str,
        look: impl FnOnce(RawPicture<'_>) -> T,
    ) -> Result<T, LiveError> {
        let bytes = self
            .camera
            .frame_raw()
            .map_err(|error| refusal(label, &error))?;
        Ok(look(RawPicture {
            bytes: &bytes,
            pixels: self.offer.pixels,
            size_px: self.offer.size_px,
            stride_bytes: 0,
        }))
    }
}

/// Opens a camera in whatever format, so that it can be asked for those it has.
fn open_any(number: u32, label: &str) -> Result<Camera, LiveError> {
    let any = RequestedFormat::with_formats(RequestedFormatType::None, frame_formats());
    Camera::new(CameraIndex::Index(number), any).map_err(|error| match error {
        // There was no format to take.
        NokhwaError::GetPropertyError { property, .. } if property == "CameraFormat" => {
            LiveError::NoFormat {
                camera: label.to_owned(),
                wanted: format::in_words(&WantedFormat::default()),
                offers: Vec::new(),
                unknown: Vec::new(),
            }
        }
        error => refusal(label, &error),
    })
}

/// What nokhwa says, as one of our errors.
fn refusal(label: &str, error: &NokhwaError) -> LiveError {
    let message = error.to_string();
    let camera = label.to_owned();
    // EBUSY: another program has the camera's buffers or its format.
    if message.contains("os error 16") {
        LiveError::Busy { camera }
    } else {
        LiveError::Camera { camera, message }
    }
}
