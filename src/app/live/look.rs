//! How the window looks at things: what is shown, what lies over it, what is selected.

use super::views::View;
use super::wish::{Overlay, Selected, Wish};
use crate::scene::Shortcuts;

/// The window's own state, apart from the scene's.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// What is shown.
    pub view: View,
    /// What lies over it.
    pub overlays: Vec<Overlay>,
    /// Whether the picture is held.
    pub holds: bool,
    /// Whether the panel is there.
    pub panel: bool,
    /// Whether the keys are listed.
    pub keys: bool,
    /// Whether the window fills the screen.
    pub full_screen: bool,
    /// What is selected.
    pub selected: Option<Selected>,
    /// Shortcuts that shadow volumes are not to take.
    pub without: Shortcuts,
}

impl Look {
    /// The picture and the panel.
    pub fn new() -> Self {
        Self {
            view: View::Composite,
            overlays: Vec::new(),
            holds: false,
            panel: true,
            keys: false,
            full_screen: false,
            selected: None,
            without: Shortcuts::NONE,
        }
    }

    /// Takes a wish that is the window's own affair; false where it is not.
    pub fn take(&mut self, wish: &Wish) -> bool {
        match wish {
            Wish::Select(selected) => self.selected.clone_from(selected),
            // The same again leads back to the picture.
            Wish::Show(view) if self.view == *view => self.view = View::Composite,
            Wish::Show(view) => self.view = *view,
            Wish::Toggle(overlay) => {
                let shown = self.overlays.iter().position(|shown| shown == overlay);
                match shown {
                    Some(index) => _ = self.overlays.swap_remove(index),
                    None => self.overlays.push(*overlay),
                }
            }
            Wish::ToggleShortcut(shortcut) => {
                let was_off = self.without.has(*shortcut);
                self.without = self.without.with(*shortcut, !was_off);
            }
            Wish::ToggleHold => self.holds = !self.holds,
            Wish::TogglePanel => self.panel = !self.panel,
            Wish::ToggleKeys => self.keys = !self.keys,
            Wish::ToggleFullScreen => self.full_screen = !self.full_screen,
            Wish::Escape if self.keys => self.keys = false,
            Wish::Escape if self.selected.is_some() => self.selected = None,
            Wish::Escape => self.full_screen = false,
            _ => return false,
        }
        true
    }

    /// Whether something lies over the picture.
    pub fn shows(&self, overlay: Overlay) -> bool {
        self.overlays.contains(&overlay)
    }
}

impl Default for Look {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shortcut;

    #[test]
    fn the_same_wish_twice_leads_back() {
        for wish in [
            Wish::Show(View::Depth),
            Wish::Toggle(Overlay::Axes),
            Wish::ToggleShortcut(Shortcut::Ends),
            Wish::ToggleHold,
            Wish::TogglePanel,
            Wish::ToggleKeys,
            Wish::ToggleFullScreen,
        ] {
            let mut look = Look::new();
            assert!(look.take(&wish));
            assert_ne!(look, Look::new(), "{wish:?}");
            assert!(look.take(&wish));
            assert_eq!(look, Look::new(), "{wish:?}");
        }
        assert!(!Look::new().take(&Wish::Undo), "that is the scene's");
    }
}
