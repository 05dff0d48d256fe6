//! `[camera]`: where the pictures come from.

use std::path::PathBuf;

use super::error::SceneError;
use super::named_files::FileKind;
use super::ranges::Whole;
use super::reader::{Table, Value};
use super::schema::key::Missing::{Is, Means};
use super::schema::section::{Example, Section, Times};
use super::schema::values::{InWords, Written};
use crate::geometry::camera::MOST_SIDE_PX;

choices! {
    /// How a webcam sends its pixels.
    pub enum PixelFormat, "format" {
        /// A JPEG each.
        Mjpeg = "MJPEG",
        /// 4:2:2, brightness and colour in turn.
        Yuyv = "YUYV",
        /// 4:2:0, a plane of brightness and one of colour.
        Nv12 = "NV12",
        /// 4:2:2 as YUYV, its two colours the other way round.
        Yvyu = "YVYU",
        /// 4:2:2, colour and brightness in turn.
        Uyvy = "UYVY",
        /// 4:2:0, a plane of brightness and two of colour; also called I420.
        Yu12 = "YU12",
        /// Brightness alone.
        Grey = "GREY",
        /// Brightness alone, in 16 bits.
        Y16 = "Y16",
        /// 8-bit red, green, blue.
        Rgb = "RGB",
        /// 8-bit blue, green, red.
        Bgr = "BGR",
    }
}

keys! {
    /// Keys of `[camera]`.
    pub static CAMERA: CameraKeys;
    required {
        /// A session's folder, a video, a folder of pictures, a webcam by its number or a part of its name
        /// ("webcam:0", "webcam:C920", "/dev/video0"; `gnomon cameras` lists them), or an address.
        source: Written, InWords::file("a text; addresses begin with http://, https:// or rtsp://", FileKind::Recording)
            => "a session, a video, a folder of images, \"webcam:0\" or an address is expected";
    }
    /// File with the camera's matrix and lens distortion.
    calibration: Option<PathBuf>, FileKind::Calibration => Means(None, "what the recording itself carries, else what its markers tell of the camera");
    /// The camera mirrors its pictures: turn them back first.
    mirror: bool => Is(false);
    /// Ask a webcam for pictures of this size.
    size_px: Option<[u32; 2]>, Whole::between(1, MOST_SIDE_PX).unit("px") => Means(None, "the calibration's");
    /// Ask a webcam for this rate, in pictures per second.
    fps: Option<u32>, Whole::between(1, 1000) => Means(None, "as good as the camera has it");
    /// Ask a webcam for this format.
    format: Option<PixelFormat> => Means(None, "as good as the camera has it");
}

/// `[camera]`.
pub static CAMERA_SECTION: Section = Section {
    name: "camera",
    says: "Where the pictures come from.",
    times: Times::Once,
    groups: &[CameraKeys::ALL],
    shown: &[
        ("source", Example::Live("\"webcam:0\"")),
        ("calibration", Example::Aside("\"camera.toml\"")),
        ("size_px", Example::Aside("[1280, 720]")),
        ("fps", Example::Aside("30")),
        ("format", Example::Aside("\"YUYV\"")),
    ],
    is_aside: false,
};

/// Where the pictures come from.
#[derive(Debug, Clone, Default)]
pub struct CameraSettings {
    /// As the file says, a path made absolute against the scene file's folder.
    pub source: String,
    /// `None`: what the recording itself carries.
    pub calibration: Option<PathBuf>,
    /// Whether the pictures come mirrored and are turned back first.
    pub mirror: bool,
    /// What a webcam is asked for.
    pub wanted: WantedFormat,
}

/// What a webcam is asked for; what is `None` is chosen by itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WantedFormat {
    /// Width and height, pixels.
    pub size_px: Option<[u32; 2]>,
    /// Pictures per second.
    pub fps: Option<u32>,
    /// How the pixels come.
    pub pixels: Option<PixelFormat>,
}

/// Reads it.
pub fn camera(root: &Table) -> Result<CameraSettings, SceneError> {
    let what = "a scene needs [camera] with a source";
    let camera = CAMERA_SECTION.table_of(&root.required(CAMERA_SECTION.name, what)?)?;
    Ok(CameraSettings {
        source: source(&CAMERA.source.require(&camera)?)?,
        calibration: CAMERA.calibration.read(&camera)?,
        mirror: CAMERA.mirror.read(&camera)?,
        wanted: WantedFormat {
            size_px: CAMERA.size_px.read(&camera)?,
            fps: CAMERA.fps.read(&camera)?,
            pixels: CAMERA.format.read(&camera)?,
        },
    })
}

fn source(value: &Value) -> Result<String, SceneError> {
    let written = value.text()?;
    if let Some(camera) = written.strip_prefix("webcam:") {
        if camera.trim().is_empty() {
            return Err(value.error(
                "which webcam? allowed: webcam:0, webcam:1, …, or webcam: and a part of its name (gnomon cameras lists \
                 them)",
            ));
        }
        return Ok(written.to_owned());
    }
    if ["http://", "https://", "rtsp://", "/dev/video"]
        .iter()
        .any(|scheme| written.starts_with(scheme))
    {
        return Ok(written.to_owned());
    }
    let path = value.existing_path(FileKind::Recording)?;
    path.into_os_string()
        .into_string()
        .map_err(|_| value.error("the path to it is not UTF-8 text"))
}
