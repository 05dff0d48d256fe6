//! Names in the panel, which may be long: what is shown of one, and the whole of it where the pointer rests.

use std::borrow::Cow;

use eframe::egui::{Button, Response, Ui};

/// Letters of a name that fit into a row beside something else.
const IN_ROW: usize = 26;

/// A name's beginning and end, where it has more letters than `most`.
pub fn shortened(name: &str, most: usize) -> Cow<'_, str> {
    let count = name.chars().count();
    if count <= most {
        return Cow::Borrowed(name);
    }
    let end = most.saturating_sub(1) / 3;
    let begin = most.saturating_sub(1 + end);
    let begin: String = name.chars().take(begin).collect();
    let end: String = name.chars().skip(count - end).collect();
    Cow::Owned(format!("{begin}…{end}"))
}

/// Shows the whole of a name where it was shortened.
pub fn with_whole(response: Response, name: &str, shown: &str) -> Response {
    match shown == name {
        true => response,
        false => response.on_hover_text(name),
    }
}

/// A name that can be clicked.
pub fn selectable(ui: &mut Ui, is_selected: bool, name: &str) -> Response {
    let shown = shortened(name, IN_ROW);
    let button = ui.add(Button::selectable(is_selected, shown.as_ref()));
    with_whole(button, name, &shown)
}

/// A name alone, of at most so many letters.
pub fn label(ui: &mut Ui, name: &str, most: usize) -> Response {
    let shown = shortened(name, most);
    let label = ui.label(shown.as_ref());
    with_whole(label, name, &shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_keep_their_ends_and_short_ones_stay() {
        assert_eq!(shortened("torus", 5), "torus");
        assert_eq!(shortened("a chair of oak 12", 10), "a chai… 12");
        let long = "größer".repeat(20);
        for most in 1..30 {
            assert_eq!(shortened(&long, most).chars().count(), most, "{most}");
        }
    }
}
