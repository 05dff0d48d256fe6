//! The text of a calibration as one tree of values, whatever language it is written in, with limits on depth and number:
//! a file of a few bytes must not cost a stack or a memory.

use std::fmt;

use roxmltree::Node;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
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
    match serde_json::from_str(text).map_err(|error| error.to_string())? {
        OnceOnly(Value::Object(table)) => Ok(table),
        _ => Err("a calibration is a table of keys and values".to_owned()),
    }
}

/// What to say of a table with a key twice: which of both holds nobody knows.
fn twice(key: &str) -> String {
    format!("the key '{key}' is there twice")
}

/// A value of JSON whose tables have each key once; as it comes, the last one of a key would win.
struct OnceOnly(Value);

impl<'de> Deserialize<'de> for OnceOnly {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OnceOnlyVisitor).map(Self)
    }
}

/// The reader of [`OnceOnly`].
struct OnceOnlyVisitor;

impl<'de> Visitor<'de> for OnceOnlyVisitor {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(OnceOnly(value)) = entries.next_element()? {
            list.push(value);
        }
        Ok(list.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut table = Map::new();
        while let Some((key, OnceOnly(value))) = entries.next_entry::<String, _>()? {
            if table.contains_key(&key) {
                return Err(Error::custom(twice(&key)));
            }
            table.insert(key, value);
        }
        Ok(table.into())
    }
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
    match value_of_element(document.root_element())? {
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

fn value_of_element(element: Node) -> Result<Value, String> {
    let mut children = element.children().filter(Node::is_element).peekable();
    if children.peek().is_some_and(|child| child.has_tag_name("_")) {
        return children.map(value_of_element).collect();
    }
    if children.peek().is_some() {
        let mut table = Map::new();
        for child in children {
            let key = child.tag_name().name();
            if table
                .insert(key.to_owned(), value_of_element(child)?)
                .is_some()
            {
                return Err(twice(key));
            }
        }
        return Ok(Value::Object(table));
    }
    // Comments part a text.
    let texts = element.children().filter(Node::is_text);
    let text: String = texts.filter_map(|part| part.text()).collect();
    let text = text.trim();
    let is_quoted = text.starts_with('"');
    let words: Vec<&str> = text.split_whitespace().collect();
    let is_list = words.len() > 1 && words.iter().all(|word| word.parse::<f64>().is_ok());
    if is_list || element.has_tag_name("data") {
        return Ok(words.into_iter().map(|word| scalar(word, true)).collect());
    }
    Ok(scalar(text.trim_matches('"'), !is_quoted))
}
