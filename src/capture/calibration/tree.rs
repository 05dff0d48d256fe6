//! The text of a calibration as one tree of values, whatever language it is written in, with limits on depth and number:
//! a file of a few bytes must not cost a stack or a memory.

use roxmltree::Node;
use serde_json::{Map, Value};

use crate::scene::yaml::{MOST_LEVELS, MOST_VALUES, YamlContent, YamlValue};

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
    let root = YamlValue::of_text(text)?.ok_or("it is empty")?;
    let (line, column) = (root.line, root.column);
    match value_of_yaml(root) {
        Value::Object(table) => Ok(table),
        _ => Err(format!(
            "line {line} column {column}: a calibration is a table of keys and values"
        )),
    }
}

fn value_of_yaml(value: YamlValue) -> Value {
    match value.content {
        YamlContent::Scalar { text, is_plain } => scalar(&text, is_plain),
        YamlContent::List(list) => list.into_iter().map(value_of_yaml).collect(),
        YamlContent::Table(table) => {
            let entries = table.into_iter();
            Value::Object(
                entries
                    .map(|(key, value)| (key, value_of_yaml(value)))
                    .collect(),
            )
        }
    }
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
