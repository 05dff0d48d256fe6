//! What a renderer leaves out because it cannot be seen, and the switches that put it back.

/// A way to less work for the same picture. Whoever looks for a wrong pixel switches them off one by one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Shortcut {
    /// Nothing is drawn outside the rectangles that things and their shadows can reach.
    Scissors,
    /// Shadow volumes end where they leave the box around all that can receive a shadow, not at infinity.
    Ends,
    /// The insides of solids are not drawn.
    Insides,
    /// Things are drawn and cast in the coarsest version that is close enough.
    Levels,
    /// Volumes are counted without their caps where the camera surely is outside them.
    DepthPass,
    /// One light and one sample are shaded straight into the picture, not added up.
    Direct,
    /// Volumes, and the picture around what moves, are kept from the last frame.
    Kept,
}

impl Shortcut {
    /// All of them, by the names that the command line uses.
    pub const BY_NAME: [(&str, Self); 7] = [
        ("scissors", Self::Scissors),
        ("ends", Self::Ends),
        ("insides", Self::Insides),
        ("levels", Self::Levels),
        ("depth-pass", Self::DepthPass),
        ("direct", Self::Direct),
        ("kept", Self::Kept),
    ];
}

/// A set of shortcuts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Shortcuts(u8);

impl Shortcuts {
    /// No shortcut.
    pub const NONE: Self = Self(0);
    /// Every shortcut: without them the picture is that of the plain textbook method.
    pub const ALL: Self = Self((1 << Shortcut::BY_NAME.len()) - 1);

    /// Whether a shortcut is among them.
    pub fn has(self, shortcut: Shortcut) -> bool {
        self.0 & 1 << shortcut as u8 != 0
    }

    /// The same set with a shortcut in it, or without it.
    pub fn with(self, shortcut: Shortcut, is_in: bool) -> Self {
        let bit = 1 << shortcut as u8;
        Self(if is_in { self.0 | bit } else { self.0 & !bit })
    }
}

impl FromIterator<Shortcut> for Shortcuts {
    fn from_iter<T: IntoIterator<Item = Shortcut>>(shortcuts: T) -> Self {
        let empty = Self::NONE;
        shortcuts
            .into_iter()
            .fold(empty, |set, shortcut| set.with(shortcut, true))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_shortcuts_are_those_that_have_names() {
        let named: Shortcuts = Shortcut::BY_NAME.iter().map(|(_, one)| *one).collect();
        assert_eq!(named, Shortcuts::ALL);
        for (name, shortcut) in Shortcut::BY_NAME {
            let without = Shortcuts::ALL.with(shortcut, false);
            assert!(Shortcuts::ALL.has(shortcut) && !without.has(shortcut));
            let typed = <Shortcut as clap::ValueEnum>::from_str(name, false);
            assert_eq!(typed, Ok(shortcut));
        }
    }
}
