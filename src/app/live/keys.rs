//! The window's keys: one table that is obeyed and listed.

use eframe::egui::{Key, Modifiers};

use super::command::{LiveCommand, Overlay, RecordingCommand, SceneCommand, WindowCommand};
use super::views::ViewMode;

/// A key and what it is for.
pub struct Binding {
    /// What must be held with it.
    pub modifiers: Modifiers,
    /// The key.
    pub key: Key,
    /// As people call it.
    pub name: &'static str,
    /// What it does.
    pub does: &'static str,
    /// What it asks for.
    pub command: LiveCommand,
}

/// All keys, in the order in which they are listed; those that need more held keys come before those that need fewer.
pub fn bindings() -> Vec<Binding> {
    let plain = |key, name, does, command| Binding {
        modifiers: Modifiers::NONE,
        key,
        name,
        does,
        command,
    };
    let with = |modifiers, key, name, does, command| Binding {
        modifiers,
        ..plain(key, name, does, command)
    };
    let ctrl = Modifiers::COMMAND;
    let mut all = vec![
        plain(
            Key::P,
            "P",
            "show or hide the panel",
            WindowCommand::TogglePanel.into(),
        ),
        plain(
            Key::F11,
            "F11",
            "full screen",
            WindowCommand::ToggleFullScreen.into(),
        ),
        plain(
            Key::F,
            "F",
            "full screen",
            WindowCommand::ToggleFullScreen.into(),
        ),
        plain(
            Key::Questionmark,
            "?",
            "list the keys",
            WindowCommand::ToggleKeys.into(),
        ),
        plain(
            Key::F1,
            "F1",
            "list the keys",
            WindowCommand::ToggleKeys.into(),
        ),
        with(
            ctrl | Modifiers::SHIFT,
            Key::Z,
            "Ctrl+Shift+Z",
            "redo",
            SceneCommand::Redo.into(),
        ),
        with(ctrl, Key::Z, "Ctrl+Z", "undo", SceneCommand::Undo.into()),
        with(ctrl, Key::Q, "Ctrl+Q", "quit", LiveCommand::Quit),
        plain(
            Key::S,
            "S",
            "save the picture",
            RecordingCommand::Screenshot.into(),
        ),
        plain(
            Key::R,
            "R",
            "record the camera as a session, or end that",
            RecordingCommand::ToggleSession.into(),
        ),
        plain(
            Key::V,
            "V",
            "record the composite as a video, or end that",
            RecordingCommand::ToggleVideo.into(),
        ),
        plain(
            Key::Space,
            "Space",
            "hold the picture, or let it go on",
            WindowCommand::ToggleHold.into(),
        ),
        plain(
            Key::H,
            "H",
            "hide or show the selected thing",
            SceneCommand::ToggleSelected.into(),
        ),
        plain(
            Key::D,
            "D",
            "duplicate the selected thing",
            SceneCommand::DuplicateSelected.into(),
        ),
        plain(
            Key::Delete,
            "Del",
            "take the selected thing or light out of the scene",
            SceneCommand::RemoveSelected.into(),
        ),
        plain(
            Key::Escape,
            "Esc",
            "find no light; select nothing; leave the full screen",
            WindowCommand::Escape.into(),
        ),
    ];
    let numbers = [
        (Key::Num1, "1"),
        (Key::Num2, "2"),
        (Key::Num3, "3"),
        (Key::Num4, "4"),
        (Key::Num5, "5"),
        (Key::Num6, "6"),
        (Key::Num7, "7"),
        (Key::Num8, "8"),
    ];
    let views = numbers.into_iter().zip(ViewMode::BY_NAME);
    all.extend(views.map(|((key, name), (does, view))| {
        plain(key, name, does, WindowCommand::Show(view).into())
    }));
    let letters = [(Key::M, "M"), (Key::A, "A"), (Key::J, "J"), (Key::L, "L")];
    let overlays = letters.into_iter().zip(Overlay::BY_NAME);
    all.extend(overlays.map(|((key, name), (does, overlay))| {
        plain(key, name, does, WindowCommand::Toggle(overlay).into())
    }));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_does_two_things_and_every_view_has_one() {
        let all = bindings();
        for (index, one) in all.iter().enumerate() {
            for other in &all[..index] {
                assert!(
                    (one.key, one.modifiers) != (other.key, other.modifiers),
                    "{}",
                    one.name
                );
            }
        }
        for (name, view) in ViewMode::BY_NAME {
            assert!(
                all.iter()
                    .any(|b| b.command == WindowCommand::Show(view).into()),
                "{name}"
            );
        }
        for (name, overlay) in Overlay::BY_NAME {
            assert!(
                all.iter()
                    .any(|b| b.command == WindowCommand::Toggle(overlay).into()),
                "{name}"
            );
        }
    }
}
