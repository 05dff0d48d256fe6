//! The one message that a scene with a mistake gives: file, line, column, what was meant, what is allowed.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

/// Why a scene could not be read. Its text is one line, and where the place is known the line of the file with a caret
/// under it:
/// ```text
/// config/lamp.toml:12:10: board.family = "tag36h12": unknown family; did you mean "tag36h11"? allowed: …
///    12 | family = "tag36h12"
///       |          ^^^^^^^^^^
/// ```
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct SceneError {
    /// The file with the mistake: the scene's, or a mesh's.
    pub file: PathBuf,
    /// `None` where the mistake has no place, such as a file that cannot be read.
    pub place: Option<TextPlace>,
    /// What is wrong and what is allowed, on one line.
    pub message: String,
}

/// A place in a text file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextPlace {
    /// From 1.
    pub line: usize,
    /// In characters, from 1.
    pub column: usize,
    /// Characters that the mistake takes on its line; at least 1.
    pub width: usize,
    /// The line itself.
    pub text: String,
}

/// Characters of a line that are shown at most.
const SHOWN_CHARS: usize = 160;

impl SceneError {
    /// A mistake without a place.
    pub fn of_file(file: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            place: None,
            message: one_line(&message.into()),
        }
    }

    /// A mistake at a span of bytes of the file's text.
    pub fn at(
        file: impl Into<PathBuf>,
        text: &str,
        span: Range<usize>,
        message: impl Into<String>,
    ) -> Self {
        Self {
            file: file.into(),
            place: Some(TextPlace::of_span(text, span)),
            message: one_line(&message.into()),
        }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(TextPlace {
            line,
            column,
            width,
            text,
        }) = &self.place
        else {
            return write!(f, "{}: {}", self.file.display(), self.message);
        };
        write!(
            f,
            "{}:{line}:{column}: {}",
            self.file.display(),
            self.message
        )?;
        if column + width > SHOWN_CHARS {
            return Ok(());
        }
        let shown: String = text.chars().take(SHOWN_CHARS).collect();
        // Tabs stay tabs, so that the caret stands where the text does.
        let indent: String = text
            .chars()
            .take(column - 1)
            .map(|c| if c == '\t' { '\t' } else { ' ' })
            .collect();
        write!(
            f,
            "\n{line:>5} | {shown}\n      | {indent}{}",
            "^".repeat(*width)
        )
    }
}

impl TextPlace {
    /// Finds a span of bytes in a text; a span beyond it is at its end.
    pub fn of_span(text: &str, span: Range<usize>) -> Self {
        let start = floor_char_boundary(text, span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line_text = text[line_start..].lines().next().unwrap_or_default();
        let line_end = line_start + line_text.len();
        let end = floor_char_boundary(text, span.end).clamp(start, line_end.max(start));
        Self {
            line: text[..line_start].matches('\n').count() + 1,
            column: text[line_start..start].chars().count() + 1,
            width: text[start..end].chars().count().max(1),
            text: line_text.to_owned(),
        }
    }
}

fn floor_char_boundary(text: &str, byte: usize) -> usize {
    (0..=byte.min(text.len()))
        .rev()
        .find(|&byte| text.is_char_boundary(byte))
        .unwrap_or(0)
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// `; did you mean "…"? allowed: …`, the first part only if something allowed is near what was written.
pub fn suggestion(written: &str, allowed: &[&str]) -> String {
    let distance = |candidate: &str| {
        strsim::damerau_levenshtein(&written.to_lowercase(), &candidate.to_lowercase())
    };
    let reach = (written.chars().count() / 3).max(1);
    // Of equals the last: newer families stand behind older ones.
    let nearest = allowed
        .iter()
        .rev()
        .min_by_key(|candidate| distance(candidate));
    let mut hint = String::from(";");
    if let Some(nearest) = nearest.filter(|candidate| distance(candidate) <= reach) {
        hint += &format!(" did you mean \"{nearest}\"?");
    }
    match allowed {
        [] => hint + " none is defined",
        _ => hint + " allowed: " + &allowed.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_characters_and_survive_odd_spans() {
        let text = "a = 1\r\nnäme = \"x\"\n";
        let place = TextPlace::of_span(text, 15..18);
        assert_eq!(
            (place.line, place.column, place.width, place.text.as_str()),
            (2, 8, 3, "näme = \"x\"")
        );
        assert_eq!(TextPlace::of_span(text, 900..901).line, 3);
        assert_eq!(TextPlace::of_span("", 0..0).column, 1);
        assert_eq!(TextPlace::of_span("ab\ncd", 1..5).width, 1);
    }

    #[test]
    fn the_message_shows_the_line_with_a_caret() {
        let error = SceneError::at("x.toml", "\tname = 3", 8..9, "a text\nis expected");
        assert_eq!(
            error.to_string(),
            "x.toml:1:9: a text is expected\n    1 | \tname = 3\n      | \t       ^"
        );
        assert_eq!(
            SceneError::of_file("x.toml", "gone").to_string(),
            "x.toml: gone"
        );
    }

    #[test]
    fn suggestions_are_near_or_silent() {
        assert_eq!(
            suggestion("tag36h12", &["tag36h10", "tag36h11"]),
            "; did you mean \"tag36h11\"? allowed: tag36h10, tag36h11"
        );
        assert_eq!(suggestion("xyz", &["family"]), "; allowed: family");
        assert_eq!(suggestion("xyz", &[]), "; none is defined");
    }
}
