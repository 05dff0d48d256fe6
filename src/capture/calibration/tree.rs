//! The text of a calibration as one tree of values, whatever language it is written in, with limits on depth and number:
//! a file of a few bytes must not cost a stack or a memory.

use std::borrow::Cow;

use roxmltree::Node;
use saphyr_parser::{Event, Parser, ScalarStyle, ScanError, Span};
use serde_json::{Map, Value};

/// Levels of lists and tables in one another; calib.io's have nine.
const MOST_LEVELS: u32 = 32;
/// Values in one file.
const MOST_VALUES: usize = 200_000;

/// The entries of a TOML file.
pub(super) fn of_toml(text: &str) -> Result<Map<String, Value>, String> {
    // (The whole message shows the line, which may be a megabyte long.)
    toml::from_str(text).map_err(|error| {
        let before = error.span().and_then(|span| text.get(..span.start));
        let before = before.unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let column = before
            .rsplit('\n')
            .next()
            .unwrap_or_default()
            .chars()
            .count()
            + 1;
        format!("line {line} column {column}: {}", error.message())
    })
}

/// The entries of a JSON file.
pub(super) fn of_json(text: &str) -> Result<Map<String, Value>, String> {
    serde_json::from_str(text).map_err(|error| error.to_string())
}

/// The entries of a YAML file's first document that has any.
pub(super) fn of_yaml(text: &str) -> Result<Map<String, Value>, String> {
    let text = without_opencv_directive(text);
    let mut reader = YamlReader {
        parser: Parser::new_from_str(&text),
        values: 0,
    };
    loop {
        let (event, span) = reader.next()?;
        match event {
            Event::StreamEnd => return Err("it is empty".to_owned()),
            Event::MappingStart(..) => {
                let tree = reader.table(1)?;
                return Ok(tree);
            }
            Event::Scalar(text, ScalarStyle::Plain, ..) if text.is_empty() || text == "~" => {}
            Event::Scalar(..) | Event::SequenceStart(..) => {
                return Err(at(&span, "a calibration is a table of keys and values"));
            }
            _ => {}
        }
    }
}

/// OpenCV's `%YAML:1.0` is no directive of YAML; its line stays, for the others' numbers.
fn without_opencv_directive(text: &str) -> Cow<'_, str> {
    match text.strip_prefix("%YAML:") {
        Some(rest) => Cow::Owned(format!("# YAML:{rest}")),
        None => Cow::Borrowed(text),
    }
}

struct YamlReader<'text> {
    parser: Parser<'text, saphyr_parser::StrInput<'text>>,
    values: usize,
}

impl<'text> YamlReader<'text> {
    fn next(&mut self) -> Result<(Event<'text>, Span), String> {
        match self.parser.next_event() {
            Some(Ok(found)) => Ok(found),
            Some(Err(error)) => Err(words_of(&error)),
            None => Err("it ends too early".to_owned()),
        }
    }

    fn table(&mut self, level: u32) -> Result<Map<String, Value>, String> {
        let mut table = Map::new();
        loop {
            let (event, span) = self.next()?;
            let key = match event {
                Event::MappingEnd => return Ok(table),
                Event::Scalar(key, ..) => key.into_owned(),
                _ => return Err(at(&span, "a key must be a word")),
            };
            let (event, value_span) = self.next()?;
            let value = self.value(event, &value_span, level)?;
            if table.insert(key.clone(), value).is_some() {
                return Err(at(&span, &format!("the key '{key}' is there twice")));
            }
        }
    }

    fn list(&mut self, level: u32) -> Result<Value, String> {
        let mut list = Vec::new();
        loop {
            let (event, span) = self.next()?;
            if matches!(event, Event::SequenceEnd) {
                return Ok(Value::Array(list));
            }
            list.push(self.value(event, &span, level)?);
        }
    }

    fn value(&mut self, event: Event, span: &Span, level: u32) -> Result<Value, String> {
        self.values += 1;
        if level > MOST_LEVELS || self.values > MOST_VALUES {
            return Err(at(
                span,
                &format!("more than {MOST_LEVELS} levels or {MOST_VALUES} values"),
            ));
        }
        match event {
            Event::Scalar(text, style, ..) => Ok(scalar(&text, style == ScalarStyle::Plain)),
            Event::SequenceStart(..) => self.list(level + 1),
            Event::MappingStart(..) => self.table(level + 1).map(Value::Object),
            // Nine of them make a billion values; no calibration has any.
            Event::Alias(_) => Err(at(span, "aliases (*name) are not supported")),
            _ => Err(at(span, "a value is missing")),
        }
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

/// A number, a truth or a word. What is no finite number stays a word, and is refused where a number is wanted.
fn scalar(text: &str, is_plain: bool) -> Value {
    let text = text.trim();
    if !is_plain {
        return Value::from(text);
    }
    match text {
        "" | "~" | "null" => return Value::Null,
        "true" | "True" | "TRUE" => return Value::Bool(true),
        "false" | "False" | "FALSE" => return Value::Bool(false),
        _ => {}
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Value::from(number),
        _ => Value::from(text),
    }
}

/// The entries of OpenCV's XML: the root's children, matrices as tables, lists as `_`.
pub(super) fn of_xml(text: &str) -> Result<Map<String, Value>, String> {
    let options = roxmltree::ParsingOptions {
        nodes_limit: MOST_VALUES as u32,
        ..Default::default()
    };
    check_levels(text)?;
    let document = roxmltree::Document::parse_with_options(text, options)
        .map_err(|error| error.to_string())?;
    match value_of_element(document.root_element()) {
        Value::Object(table) => Ok(table),
        _ => Err("a calibration is a table of keys and values".to_owned()),
    }
}

/// A parser may walk into elements on the stack: how deep they are is counted first, in the text, at most too high.
fn check_levels(text: &str) -> Result<(), String> {
    let mut level = 0u32;
    let bytes = text.as_bytes();
    for (at, _) in text.match_indices('<') {
        match bytes.get(at + 1) {
            Some(b'/') => level = level.saturating_sub(1),
            Some(b'!' | b'?') | None => {}
            Some(_) => {
                let end = text[at..].find('>').map_or(text.len(), |end| at + end);
                if bytes.get(end.wrapping_sub(1)) != Some(&b'/') {
                    level += 1;
                }
            }
        }
        if level > MOST_LEVELS {
            let line = text[..at].matches('\n').count() + 1;
            return Err(format!("line {line}: more than {MOST_LEVELS} levels"));
        }
    }
    Ok(())
}

fn value_of_element(element: Node) -> Value {
    let mut children = element.children().filter(Node::is_element).peekable();
    if children.peek().is_some_and(|child| child.has_tag_name("_")) {
        return children.map(value_of_element).collect();
    }
    if children.peek().is_some() {
        let entries =
            children.map(|child| (child.tag_name().name().to_owned(), value_of_element(child)));
        return Value::Object(entries.collect());
    }
    let text = element.text().unwrap_or_default().trim();
    let is_quoted = text.starts_with('"');
    let words: Vec<&str> = text.split_whitespace().collect();
    let is_list = words.len() > 1 && words.iter().all(|word| word.parse::<f64>().is_ok());
    if is_list || element.has_tag_name("data") {
        return words.into_iter().map(|word| scalar(word, true)).collect();
    }
    scalar(text.trim_matches('"'), !is_quoted)
}
