//! YAML as a tree of values that know where they stand, with limits on depth and number: a file of a few bytes must not cost
//! a stack or a memory.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;

use saphyr_parser::{Event, Parser, ScalarStyle, ScanError, Span};

/// Levels of lists and tables in one another; calib.io's have nine.
pub const MOST_LEVELS: u32 = 32;
/// Values in one file.
pub const MOST_VALUES: usize = 200_000;

/// A value, and where it begins: line and column, from 1.
#[derive(Debug, Clone, PartialEq)]
pub struct YamlValue {
    /// Its line.
    pub line: usize,
    /// Its column in characters.
    pub column: usize,
    /// What it is.
    pub content: YamlContent,
}

/// What a value is.
#[derive(Debug, Clone, PartialEq)]
pub enum YamlContent {
    /// A word or a number; a plain one has no quotes.
    Scalar {
        /// As written, without quotes.
        text: String,
        /// Whether it has none.
        is_plain: bool,
    },
    /// Values in order.
    List(Vec<YamlValue>),
    /// Keys, each once, with their values.
    Table(Vec<(String, YamlValue)>),
}

impl YamlValue {
    /// The first document of a text that has anything in it; `None` where none has.
    ///
    /// # Errors
    /// What is no YAML, or beyond the limits, with line and column.
    pub fn of_text(text: &str) -> Result<Option<Self>, String> {
        let text = without_opencv_directive(text);
        let mut reader = Reader {
            parser: Parser::new_from_str(&text),
            values: 0,
            anchored: HashMap::new(),
        };
        loop {
            let (event, span) = reader.next()?;
            match event {
                Event::StreamEnd => return Ok(None),
                Event::Scalar(text, ScalarStyle::Plain, ..) if text.is_empty() || text == "~" => {}
                Event::Scalar(..) | Event::SequenceStart(..) | Event::MappingStart(..) => {
                    return reader.value(event, &span, 0).map(Some);
                }
                _ => {}
            }
        }
    }

    /// The bytes of the text that it was read from where it begins, up to the end of the word there.
    pub fn span_in(&self, text: &str) -> Range<usize> {
        let lines = text.split_inclusive('\n');
        let line_start: usize = lines.take(self.line.saturating_sub(1)).map(str::len).sum();
        let line = text.get(line_start..).unwrap_or_default();
        let before = line.char_indices().nth(self.column.saturating_sub(1));
        let start = line_start + before.map_or(0, |(at, _)| at);
        let word = text.get(start..).unwrap_or_default();
        let length = word.find(|c: char| c.is_whitespace() || ",]}".contains(c));
        start..start + length.unwrap_or(word.len()).max(1)
    }
}

/// OpenCV's `%YAML:1.0` is no directive of YAML; its line stays, for the others' numbers.
fn without_opencv_directive(text: &str) -> Cow<'_, str> {
    match text.strip_prefix("%YAML:") {
        Some(rest) => Cow::Owned(format!("# YAML:{rest}")),
        None => Cow::Borrowed(text),
    }
}

struct Reader<'text> {
    parser: Parser<'text, saphyr_parser::StrInput<'text>>,
    /// Values so far, those that aliases repeat among them.
    values: usize,
    /// What `&name` stands before, by the parser's numbers.
    anchored: HashMap<usize, YamlValue>,
}

impl<'text> Reader<'text> {
    fn next(&mut self) -> Result<(Event<'text>, Span), String> {
        match self.parser.next_event() {
            Some(Ok(found)) => Ok(found),
            Some(Err(error)) => Err(words_of(&error)),
            None => Err("it ends too early".to_owned()),
        }
    }

    fn table(&mut self, level: u32) -> Result<Vec<(String, YamlValue)>, String> {
        let mut known = std::collections::HashSet::new();
        let mut table = Vec::new();
        let mut merged_keys: Vec<(String, YamlValue)> = Vec::new();
        loop {
            let (event, span) = self.next()?;
            let key = match event {
                Event::MappingEnd => {
                    merged_keys.retain(|(key, _)| known.insert(key.clone()));
                    table.append(&mut merged_keys);
                    return Ok(table);
                }
                Event::Scalar(key, ..) => key.into_owned(),
                _ => return Err(at(&span, "a key must be a word")),
            };
            let (event, value_span) = self.next()?;
            let value = self.value(event, &value_span, level)?;
            if let ("<<", YamlContent::Table(merged)) = (key.as_str(), &value.content) {
                merged_keys.extend(merged.iter().cloned());
                continue;
            }
            if !known.insert(key.clone()) {
                return Err(at(&span, &format!("the key '{key}' is there twice")));
            }
            table.push((key, value));
        }
    }

    fn list(&mut self, level: u32) -> Result<Vec<YamlValue>, String> {
        let mut list = Vec::new();
        loop {
            let (event, span) = self.next()?;
            if matches!(event, Event::SequenceEnd) {
                return Ok(list);
            }
            list.push(self.value(event, &span, level)?);
        }
    }

    fn value(&mut self, event: Event, span: &Span, level: u32) -> Result<YamlValue, String> {
        self.count(1, level, span)?;
        let anchor = match &event {
            Event::Scalar(_, _, anchor, _)
            | Event::SequenceStart(anchor, _)
            | Event::MappingStart(anchor, _) => *anchor,
            _ => 0,
        };
        let content = match event {
            Event::Scalar(text, style, ..) => YamlContent::Scalar {
                text: text.into_owned(),
                is_plain: style == ScalarStyle::Plain,
            },
            Event::SequenceStart(..) => YamlContent::List(self.list(level + 1)?),
            Event::MappingStart(..) => YamlContent::Table(self.table(level + 1)?),
            Event::Alias(number) => {
                let anchored = self.anchored.get(&number);
                let anchored =
                    anchored.ok_or_else(|| at(span, "the alias stands within what it means"))?;
                // Nine lists of nine aliases make a billion values: they are counted before they are repeated.
                let (repeats, levels) = size_of(anchored);
                let content = anchored.content.clone();
                self.count(repeats, level + levels, span)?;
                content
            }
            _ => return Err(at(span, "a value is missing")),
        };
        let value = YamlValue {
            line: span.start.line(),
            column: span.start.col() + 1,
            content,
        };
        if anchor > 0 {
            // It is kept twice.
            self.count(size_of(&value).0, level, span)?;
            self.anchored.insert(anchor, value.clone());
        }
        Ok(value)
    }

    fn count(&mut self, values: usize, level: u32, span: &Span) -> Result<(), String> {
        self.values += values;
        if level > MOST_LEVELS || self.values > MOST_VALUES {
            return Err(at(
                span,
                &format!("more than {MOST_LEVELS} levels or {MOST_VALUES} values"),
            ));
        }
        Ok(())
    }
}

/// How many values a value is, and of how many levels below itself.
fn size_of(value: &YamlValue) -> (usize, u32) {
    let of_all = |values: &mut dyn Iterator<Item = &YamlValue>| {
        values.map(size_of).fold((1, 0), |(count, levels), inner| {
            (count + inner.0, levels.max(inner.1 + 1))
        })
    };
    match &value.content {
        YamlContent::Scalar { .. } => (1, 0),
        YamlContent::List(list) => of_all(&mut list.iter()),
        YamlContent::Table(table) => of_all(&mut table.iter().map(|(_, value)| value)),
    }
}

fn words_of(error: &ScanError) -> String {
    let place = error.marker();
    format!(
        "line {} column {}: {}",
        place.line(),
        place.col() + 1,
        error.info()
    )
}

fn at(span: &Span, message: &str) -> String {
    format!(
        "line {} column {}: {message}",
        span.start.line(),
        span.start.col() + 1
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tree without its places.
    fn plain(value: &YamlValue) -> String {
        match &value.content {
            YamlContent::Scalar { text, .. } => text.clone(),
            YamlContent::List(list) => {
                format!("[{}]", list.iter().map(plain).collect::<Vec<_>>().join(" "))
            }
            YamlContent::Table(table) => {
                let entries = table
                    .iter()
                    .map(|(key, value)| format!("{key}:{}", plain(value)));
                format!("{{{}}}", entries.collect::<Vec<_>>().join(" "))
            }
        }
    }

    #[test]
    fn aliases_stand_for_what_they_name() {
        for (text, expected) in [
            ("a: &x [1, 2]\nb: *x\n", "{a:[1 2] b:[1 2]}"),
            (
                "a: &x {k: 1, l: 2}\nb: {<<: *x, k: 3}\n",
                "{a:{k:1 l:2} b:{k:3 l:2}}",
            ),
        ] {
            let value = YamlValue::of_text(text).unwrap().unwrap();
            assert_eq!(plain(&value), expected, "{text}");
        }
    }

    #[test]
    fn a_few_lines_do_not_become_a_billion_values() {
        let mut text = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]\n".to_owned();
        for level in 1..12 {
            let alias = vec![format!("*a{}", level - 1); 9].join(", ");
            text += &format!("a{level}: &a{level} [{alias}]\n");
        }
        let message = YamlValue::of_text(&text).unwrap_err();
        assert!(
            message.contains("more than 32 levels or 200000 values"),
            "{message}"
        );
        let itself = YamlValue::of_text("a: &x [1, *x]\n").unwrap_err();
        assert!(itself.starts_with("line 1 column"), "{itself}");
    }
}
