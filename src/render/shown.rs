//! What a frame shows.

/// The content of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The video with the virtual things.
    Composite,
    /// The undistorted video alone.
    Bare,
}
