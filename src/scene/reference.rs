//! The reference: a scene's file that shows every key, with what its entry says.

use std::fmt::Write as _;

use super::format::SECTIONS;
use super::quality::Quality;
use super::schema::section::{AnyKey, Example, Section, Times};
use super::schema::values::Described as _;

/// Columns of a comment.
const WIDTH: usize = 118;

const HEAD: &str = "Every key of a scene, with its unit, its range and its default; the file is a valid scene itself. It is \
made from the entries in src/scene: GNOMON_WRITE_REFERENCE=1 cargo test --release --lib reference.";

const CONVENTIONS: &str = "Lengths are metres, angles degrees (counter-clockwise positive), colours linear RGB. world: \
right-handed, z up, origin at the centre of the first board (else of the first marker), x right and y up as printed. \
\"Required\" keys have no default. A relative path starts at this file's folder or, if nothing is there, at that folder's \
parent. An unknown key is a mistake.";

/// The whole file.
pub fn reference() -> String {
    let mut text = String::new();
    comment(&mut text, "", HEAD);
    comment(&mut text, "", "");
    comment(&mut text, "", CONVENTIONS);
    for (index, section) in SECTIONS.iter().enumerate() {
        text.push('\n');
        show_section(&mut text, section, &SECTIONS[..index]);
    }
    text
}

fn show_section(text: &mut String, section: &Section, before: &[&Section]) {
    let often = match section.times {
        Times::Once => " Required.",
        Times::UpToOnce => " Optional.",
        Times::Any => " Any number of them.",
        Times::InBraces => "",
    };
    comment(text, "", &format!("{}{often}", section.says));
    line(text, section.is_aside, &section.head());
    for key in section.keys() {
        let is_this = |known: &dyn AnyKey| std::ptr::addr_eq(known, key);
        let earlier = before.iter().find(|earlier| earlier.keys().any(is_this));
        match earlier {
            Some(earlier) => {
                let limits = limits(key);
                comment(text, "", &format!("As in {}. {limits}", earlier.head()));
            }
            None => explain(text, key),
        }
        show_key(text, section, key);
    }
}

/// What a key is, and its words and parts.
fn explain(text: &mut String, key: &dyn AnyKey) {
    comment(text, "", &sentence(key));
    for (word, says) in key.words() {
        let says = says.trim_end_matches('.');
        comment(text, "  ", &format!("\"{word}\": {says}."));
    }
    for part in key.parts().into_iter().flat_map(Section::keys) {
        comment(text, "  ", &format!("{}: {}", part.name(), sentence(part)));
    }
}

/// A key with its value.
fn show_key(text: &mut String, section: &Section, key: &dyn AnyKey) {
    let shown = section.shown.iter().find(|(name, _)| *name == key.name());
    let (value, is_aside) = match shown {
        Some((_, Example::Live(value))) => ((*value).to_owned(), false),
        Some((_, Example::Aside(value))) => ((*value).to_owned(), true),
        None => (key.default_text().unwrap_or_default(), false),
    };
    if value.is_empty() {
        return;
    }
    let written = format!("{} = {value}", key.name());
    line(text, section.is_aside || is_aside, &written);
}

/// All of it: what a key is, what it takes, and what holds without it.
fn sentence(key: &dyn AnyKey) -> String {
    format!("{}. {}", key.says(), limits(key))
}

/// What a key takes, and what holds without it.
fn limits(key: &dyn AnyKey) -> String {
    // Words have lines of their own, and what a switch takes is seen.
    let told = match key.words().is_empty() && key.told() != bool::told(&()) {
        true => key.told(),
        false => String::new(),
    };
    let of_quality = |(name, quality): &(&str, Quality)| {
        let value = key.quality_text(*quality)?;
        Some(format!("{name} {value}"))
    };
    let by_quality: Vec<String> = Quality::BY_NAME.iter().filter_map(of_quality).collect();
    let default = match (key.default_told(), by_quality.is_empty()) {
        (None, _) => "required".to_owned(),
        (Some(default), true) => format!("default {default}"),
        (Some(default), false) => {
            format!("default {default}; by quality {}", by_quality.join(", "))
        }
    };
    let limits = match told.is_empty() {
        true => default,
        false => format!("{told}; {default}"),
    };
    let mut letters = limits.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    format!("{}{}.", first.collect::<String>(), letters.as_str())
}

/// A comment in lines of [`WIDTH`], those after the first indented further where the first one is.
fn comment(text: &mut String, indent: &str, words: &str) {
    let mut written = format!("#{indent}");
    let further = if indent.is_empty() { "" } else { "  " };
    for word in words.split_whitespace() {
        if written.chars().count() + 1 + word.chars().count() > WIDTH {
            // Writing to a text cannot fail.
            _ = writeln!(text, "{written}");
            written = format!("#{indent}{further}");
        }
        written.push(' ');
        written.push_str(word);
    }
    _ = writeln!(text, "{}", written.trim_end());
}

fn line(text: &mut String, is_aside: bool, written: &str) {
    for part in written.lines() {
        let aside = if is_aside { "# " } else { "" };
        // Writing to a text cannot fail.
        _ = writeln!(text, "{aside}{part}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_reference_is_what_the_entries_say() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/reference.toml");
        if std::env::var_os("GNOMON_WRITE_REFERENCE").is_some() {
            std::fs::write(&path, reference()).unwrap();
        }
        let written = std::fs::read_to_string(&path).unwrap();
        assert!(
            written == reference(),
            "config/reference.toml is not what the entries say; to write it anew: \
             GNOMON_WRITE_REFERENCE=1 cargo test --release --lib reference"
        );
    }

    #[test]
    fn every_key_is_shown_with_what_it_is() {
        for section in SECTIONS.iter() {
            for (name, _) in section.shown {
                assert!(section.names().contains(name), "{}.{name}", section.name);
            }
            for key in section.keys() {
                let name = format!("{}.{}", section.name, key.name());
                let mut text = String::new();
                show_key(&mut text, section, key);
                let is_key = |line: &str| {
                    line.trim_start_matches("# ")
                        .starts_with(&format!("{} = ", key.name()))
                };
                assert!(text.lines().any(is_key), "{name}: {text}");
                assert!(!key.says().is_empty() && !key.told().is_empty(), "{name}");
            }
        }
    }
}
