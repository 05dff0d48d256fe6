//! Frames from sessions, videos and folders of images, and the calibration of the camera that took them.
//! OpenCV's types stay inside.

/// A picture with its place in the recording; the pixels are as the camera gave them (distorted, sRGB).
#[derive(Debug, Clone)]
pub struct Frame {
    /// Number of the frame in its recording, from 0.
    pub index: u32,
    /// Time since the recording's start, seconds.
    pub time_secs: f64,
    pub size_px: [u32; 2],
    /// 8-bit RGBA, rows from the top, alpha 255.
    pub rgba: Vec<u8>,
}
