//! What keeps a frame from being drawn.

/// A failure on the way to a drawn frame.
#[derive(Debug, Clone, thiserror::Error)]
pub enum RenderError {
    /// There is no adapter at all.
    #[error("no graphics adapter found; install a Vulkan driver (Debian: mesa-vulkan-drivers)")]
    NoAdapter,
    /// There is none of the wanted name.
    #[error("no adapter is called \"{wanted}\"; there are: {found}")]
    UnknownAdapter {
        /// The part of a name that was asked for.
        wanted: String,
        /// The names that there are.
        found: String,
    },
    /// It does not open.
    #[error("the adapter \"{adapter}\" cannot be used: {reason}")]
    Unusable {
        /// Its name.
        adapter: String,
        /// The driver's own words.
        reason: String,
    },
    /// It holds no picture of this size.
    #[error("the picture of {width}x{height} is larger than the adapter's limit of {limit}")]
    TooLarge {
        /// Its width, pixels.
        width: u32,
        /// Its height, pixels.
        height: u32,
        /// The longest side that the adapter holds, pixels.
        limit: u32,
    },
    /// A frame is not of the calibration's size.
    #[error("the frame is {found:?} pixels, the camera's calibration {expected:?}")]
    FrameSize {
        /// Width and height of the frame, pixels.
        found: [u32; 2],
        /// Those of the calibration.
        expected: [u32; 2],
    },
    /// The device is gone, as when a driver is reset or a card unplugged.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// The device has no memory left.
    #[error("the GPU has no memory left")]
    OutOfMemory,
    /// What the device itself reported.
    #[error("the GPU failed: {0}")]
    Failed(String),
}

impl RenderError {
    /// Whether a new device may do what this one no longer can.
    pub fn ends_a_device(&self) -> bool {
        matches!(self, Self::Lost(_) | Self::OutOfMemory)
    }
}
