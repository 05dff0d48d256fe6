//! The window's keys: one table that is obeyed and listed.

use eframe::egui::{Key, Modifiers};

use super::views::View;
use super::wish::{Overlay, Wish};

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
    /// The same as a wish.
    pub wish: Wish,
}

/// All keys, in the order in which they are listed; those that need more held keys come before those that need fewer.
pub fn bindings() -> Vec<Binding> {
    let plain = |key, name, does, wish| Binding {
        modifiers: Modifiers::NONE,
        key,
        name,
        does,
        wish,
    };
    let with = |modifiers, key, name, does, wish| Binding {
        modifiers,
        ..plain(key, name, does, wish)
    };
    let command = Modifiers::COMMAND;
    let mut all = vec![
        plain(Key::P, "P", "show or hide the panel", Wish::TogglePanel),
        plain(Key::F11, "F11", "full screen", Wish::ToggleFullScreen),
        plain(Key::F, "F", "full screen", Wish::ToggleFullScreen),
        plain(Key::Questionmark, "?", "list the keys", Wish::ToggleKeys),
        plain(Key::F1, "F1", "list the keys", Wish::ToggleKeys),
        with(
            command | Modifiers::SHIFT,
            Key::Z,
            "Ctrl+Shift+Z",
            "redo",
            Wish::Redo,
        ),
        with(command, Key::Z, "Ctrl+Z", "undo", Wish::Undo),
        with(command, Key::Q, "Ctrl+Q", "quit", Wish::Quit),
        plain(Key::S, "S", "save the picture", Wish::Screenshot),
        plain(
            Key::R,
            "R",
            "record the camera as a session, or end that",
            Wish::ToggleSession,
        ),
        plain(
            Key::V,
            "V",
            "record the composite as a video, or end that",
            Wish::ToggleVideo,
        ),
        plain(
            Key::Space,
            "Space",
            "hold the picture, or let it go on",
            Wish::ToggleHold,
        ),
        plain(
            Key::H,
            "H",
            "hide or show the selected thing",
            Wish::ToggleSelected,
        ),
        plain(
            Key::Delete,
            "Del",
            "take the selected thing or light out of the scene",
            Wish::RemoveSelected,
        ),
        plain(
            Key::Escape,
            "Esc",
            "select nothing; leave the full screen",
            Wish::Escape,
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
    let views = numbers.into_iter().zip(View::BY_NAME);
    all.extend(views.map(|((key, name), (does, view))| plain(key, name, does, Wish::Show(view))));
    let letters = [(Key::M, "M"), (Key::A, "A"), (Key::J, "J"), (Key::L, "L")];
    let overlays = letters.into_iter().zip(Overlay::BY_NAME);
    all.extend(
        overlays
            .map(|((key, name), (does, overlay))| plain(key, name, does, Wish::Toggle(overlay))),
    );
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
        for (name, view) in View::BY_NAME {
            assert!(all.iter().any(|b| b.wish == Wish::Show(view)), "{name}");
        }
        for (name, overlay) in Overlay::BY_NAME {
            assert!(
                all.iter().any(|b| b.wish == Wish::Toggle(overlay)),
                "{name}"
            );
        }
    }
}
