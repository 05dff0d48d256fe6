//! What the program says: messages on stderr, results on stdout.
//!
//! Nobody may be listening (`gnomon … 2>&1 | head -1`), and the disk may be full: what cannot be said changes no job. Text of
//! files that somebody else made cannot steer the terminal.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{self, Write, stderr, stdout};

/// A line of talk.
pub fn say(message: impl Display) {
    write_to(&mut stderr().lock(), &format!("{message}\n"));
}

/// `1 edge`, `2 edges`.
pub fn counted(count: usize, noun: &str) -> String {
    match (count, noun) {
        (1, _) => format!("1 {noun}"),
        (_, "vertex") => format!("{count} vertices"),
        _ => format!("{count} {noun}s"),
    }
}

/// Lines of talk, whose ends they bring along.
pub fn say_lines(lines: &str) {
    write_to(&mut stderr().lock(), lines);
}

/// Lines of a result, whose ends they bring along.
pub fn give(lines: &str) {
    write_to(&mut stdout().lock(), lines);
}

/// A result that is worth nothing unless it is whole, as a file that a shell makes of it.
///
/// # Errors
/// A full disk. Who reads no further has what was wanted.
pub fn hand_out(text: &str) -> io::Result<()> {
    let mut stream = stdout().lock();
    let written = stream
        .write_all(text.as_bytes())
        .and_then(|()| stream.flush());
    match written {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

fn write_to(stream: &mut impl Write, text: &str) {
    _ = stream.write_all(harmless(text).as_bytes());
    _ = stream.flush();
}

/// Text in which control characters, and those that turn the direction of writing, are spelt out: `\u{1b}`.
pub fn harmless(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_harmful) {
        return Cow::Borrowed(text);
    }
    let spelt = text.chars().map(|letter| match is_harmful(letter) {
        true => letter.escape_unicode().to_string(),
        false => letter.to_string(),
    });
    Cow::Owned(spelt.collect())
}

fn is_harmful(letter: char) -> bool {
    let turns = matches!(letter, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    turns || letter.is_control() && !matches!(letter, '\n' | '\t')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_steers_a_terminal_is_spelt_out() {
        assert_eq!(harmless("ein Würfel\n\tα → β"), "ein Würfel\n\tα → β");
        assert_eq!(harmless("\u{1b}[2J\r\u{7}"), "\\u{1b}[2J\\u{d}\\u{7}");
        assert_eq!(harmless("a\u{9b}b\u{202e}c"), "a\\u{9b}b\\u{202e}c");
    }

    #[test]
    fn what_cannot_be_said_is_no_failure() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Err(std::io::ErrorKind::BrokenPipe.into())
            }
        }
        write_to(&mut Full, "nobody hears this");
    }
}
