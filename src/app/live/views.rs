//! What the window can show in place of the picture.

/// A way to look at the scene, in place of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ViewMode {
    /// The video with the virtual things.
    #[default]
    Composite,
    /// The video alone.
    Bare,
    /// How many shadow volumes each surface lies in.
    StencilCount,
    /// The sides of the shadow volumes.
    Volumes,
    /// The coarse models of the real things.
    Phantoms,
    /// The edges from which shadows are cast.
    Silhouettes,
    /// How far each surface is.
    Depth,
    /// What virtual things leave of the light on real ones.
    Gain,
}

impl ViewMode {
    /// All of them, by their names.
    pub const BY_NAME: [(&str, Self); 8] = [
        ("composite", Self::Composite),
        ("video alone", Self::Bare),
        ("stencil count", Self::StencilCount),
        ("volumes", Self::Volumes),
        ("phantoms", Self::Phantoms),
        ("silhouettes", Self::Silhouettes),
        ("depth", Self::Depth),
        ("gain", Self::Gain),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        let found = Self::BY_NAME.iter().find(|(_, view)| *view == self);
        found.map_or("", |(name, _)| name)
    }
}
