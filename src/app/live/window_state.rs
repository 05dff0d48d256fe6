//! The window's own state: what is shown, what lies over it, what is selected.

use super::command::{Overlay, Selected, WindowCommand};
use super::views::ViewMode;
use crate::scene::Shortcuts;

/// The window's own state, apart from the scene's.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowState {
    /// What is shown.
    pub view: ViewMode,
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

impl WindowState {
    /// The picture and the panel.
    pub fn new() -> Self {
        Self {
            view: ViewMode::Composite,
            overlays: Vec::new(),
            holds: false,
            panel: true,
            keys: false,
            full_screen: false,
            selected: None,
            without: Shortcuts::NONE,
        }
    }

    /// Does what is asked of the window.
    pub fn apply(&mut self, command: &WindowCommand) {
        match command {
            WindowCommand::Select(selected) => self.selected.clone_from(selected),
            // The same again leads back to the picture.
            WindowCommand::Show(view) if self.view == *view => self.view = ViewMode::Composite,
            WindowCommand::Show(view) => self.view = *view,
            WindowCommand::Toggle(overlay) => {
                let shown = self.overlays.iter().position(|shown| shown == overlay);
                match shown {
                    Some(index) => _ = self.overlays.swap_remove(index),
                    None => self.overlays.push(*overlay),
                }
            }
            WindowCommand::ToggleShortcut(shortcut) => {
                let was_off = self.without.has(*shortcut);
                self.without = self.without.with(*shortcut, !was_off);
            }
            WindowCommand::ToggleHold => self.holds = !self.holds,
            WindowCommand::TogglePanel => self.panel = !self.panel,
            WindowCommand::ToggleKeys => self.keys = !self.keys,
            WindowCommand::ToggleFullScreen => self.full_screen = !self.full_screen,
            WindowCommand::Escape if self.keys => self.keys = false,
            WindowCommand::Escape if self.selected.is_some() => self.selected = None,
            WindowCommand::Escape => self.full_screen = false,
        }
    }

    /// Whether something lies over the picture.
    pub fn shows(&self, overlay: Overlay) -> bool {
        self.overlays.contains(&overlay)
    }
}

impl Default for WindowState {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shortcut;

    #[test]
    fn the_same_command_twice_leads_back() {
        for command in [
            WindowCommand::Show(ViewMode::Depth),
            WindowCommand::Toggle(Overlay::Axes),
            WindowCommand::ToggleShortcut(Shortcut::Ends),
            WindowCommand::ToggleHold,
            WindowCommand::TogglePanel,
            WindowCommand::ToggleKeys,
            WindowCommand::ToggleFullScreen,
        ] {
            let mut state = WindowState::new();
            state.apply(&command);
            assert_ne!(state, WindowState::new(), "{command:?}");
            state.apply(&command);
            assert_eq!(state, WindowState::new(), "{command:?}");
        }
    }
}
