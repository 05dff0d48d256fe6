//! A TOML text in which single values change: what no change touches stays byte for byte.

use std::ops::Range;

use toml_edit::{Document, InlineTable, Item, Key, Table, TableLike, Value};

use super::numbers;
use crate::scene::Digits;

/// Changes of a text, gathered to be made at once.
pub struct Spliced<'a> {
    text: &'a str,
    line_end: &'static str,
    /// Spans of the text and what comes in their place; they do not overlap.
    changes: Vec<(Range<usize>, String)>,
}

/// A table under its own head, or in braces.
#[derive(Clone, Copy)]
pub enum Body<'a> {
    Headed(&'a Table),
    Braced(&'a InlineTable),
}

impl<'a> Body<'a> {
    fn keys(self) -> &'a dyn TableLike {
        match self {
            Self::Headed(table) => table,
            Self::Braced(table) => table,
        }
    }

    pub fn item(self, key: &str) -> Option<&'a Item> {
        self.keys().get(key)
    }

    pub fn value(self, key: &str) -> Option<&'a Value> {
        self.item(key).and_then(Item::as_value)
    }

    fn key_and_value(self, key: &str) -> Option<(&'a Key, &'a Value)> {
        let (key, item) = self.keys().get_key_value(key)?;
        Some((key, item.as_value()?))
    }

    pub fn has_name(self, name: &str) -> bool {
        self.value("name").and_then(Value::as_str) == Some(name)
    }

    fn span(self) -> Range<usize> {
        let span = match self {
            Self::Headed(table) => table.span(),
            Self::Braced(table) => table.span(),
        };
        span.unwrap_or_default()
    }

    /// Where its own last value ends.
    fn last_value_end(self) -> Option<usize> {
        self.keys()
            .iter()
            .filter_map(|(_, item)| item.as_value()?.span())
            .map(|span| span.end)
            .max()
    }

    /// Where its head or the last value in it or below it ends.
    fn end(self) -> usize {
        let below = self.keys().iter().flat_map(|(_, item)| match item {
            Item::Value(value) => value.span().map(|span| span.end).into_iter().collect(),
            _ => bodies(Some(item))
                .into_iter()
                .map(Body::end)
                .collect::<Vec<_>>(),
        });
        below.chain([self.head_end()]).max().unwrap_or_default()
    }

    fn head_end(self) -> usize {
        self.span().end
    }
}

/// The table, or all tables, that a key stands for.
pub fn bodies(item: Option<&Item>) -> Vec<Body<'_>> {
    match item {
        Some(Item::Table(table)) => vec![Body::Headed(table)],
        Some(Item::ArrayOfTables(tables)) => tables.iter().map(Body::Headed).collect(),
        Some(Item::Value(Value::InlineTable(table))) => vec![Body::Braced(table)],
        Some(Item::Value(Value::Array(array))) => array
            .iter()
            .filter_map(Value::as_inline_table)
            .map(Body::Braced)
            .collect(),
        Some(Item::Value(_) | Item::None) | None => Vec::new(),
    }
}

impl<'a> Spliced<'a> {
    pub fn new(text: &'a str) -> Self {
        Self {
            text,
            line_end: if text.contains("\r\n") { "\r\n" } else { "\n" },
            changes: Vec::new(),
        }
    }

    /// The text with all changes.
    pub fn text(mut self) -> String {
        // Stable: what is inserted at one place stays in its order.
        self.changes.sort_by_key(|(span, _)| (span.start, span.end));
        let mut text = String::with_capacity(self.text.len() + 64);
        let mut at = 0;
        for (span, new) in &self.changes {
            text.push_str(&self.text[at..span.start.max(at)]);
            text.push_str(new);
            at = at.max(span.end);
        }
        text.push_str(&self.text[at..]);
        text
    }

    /// Writes numbers: an array, or one number where they are equal and one is written. `default` is what each is
    /// where the key is missing.
    pub fn set_numbers(
        &mut self,
        body: Body,
        key: &str,
        wanted: &[f64],
        digits: Digits,
        default: Option<f64>,
    ) {
        let all_equal = wanted.windows(2).all(|pair| pair[0] == pair[1]);
        let stands_alone = |value: &Value| numbers::number_of(value).is_some();
        match body.value(key) {
            Some(Value::Array(array)) if array.len() == wanted.len() => {
                for (written, &number) in array.iter().zip(wanted) {
                    if let Some(new) = numbers::changed(written, number, digits) {
                        self.replace(written, new);
                    }
                }
            }
            Some(single) if all_equal && stands_alone(single) => {
                if let Some(new) = numbers::changed(single, wanted[0], digits) {
                    self.replace(single, new);
                }
            }
            Some(other) => self.replace(other, numbers::new_array(wanted, digits)),
            None if wanted.iter().all(|&number| Some(number) == default) => {}
            None => {
                let new = match wanted {
                    [single] => digits.text(*single),
                    _ => numbers::new_array(wanted, digits),
                };
                self.insert_key(body, key, &new);
            }
        }
    }

    /// Writes a value that `text` is TOML for.
    pub fn set(&mut self, body: Body, key: &str, text: String) {
        match body.value(key) {
            Some(value) => self.replace(value, text),
            None => self.insert_key(body, key, &text),
        }
    }

    /// Gives a key another name and another value.
    pub fn rename(&mut self, body: Body, key: &str, new_key: &str, text: String) {
        match body.key_and_value(key) {
            Some((key, value)) => {
                self.changes
                    .extend(key.span().map(|span| (span, new_key.to_owned())));
                self.replace(value, text);
            }
            None => self.insert_key(body, new_key, &text),
        }
    }

    /// Takes a key away, with its line where it has one.
    pub fn remove_key(&mut self, body: Body, key: &str) {
        let Some((name, value)) = body.key_and_value(key) else {
            return;
        };
        let (Some(name), Some(value)) = (name.span(), value.span()) else {
            return;
        };
        let span = match body {
            // With the end of the line above, so that what comes behind the last key still does.
            Body::Headed(_) => match self.line_start(name.start) {
                0 => 0..self.next_line(value.end),
                start => self.line_end_at(self.line_start(start - 1))..self.line_end_at(value.end),
            },
            Body::Braced(table) => {
                let spans: Vec<Range<usize>> = table
                    .iter()
                    .filter_map(|(key, value)| {
                        Some(table.key(key)?.span()?.start..value.span()?.end)
                    })
                    .collect();
                member_span(&spans, &(name.start..value.end))
            }
        };
        self.changes.push((span, String::new()));
    }

    /// A `[head]` or `[[head]]` with its keys, behind the last of those that are there, or else at the text's end.
    pub fn add_table(&mut self, head: &str, written: Option<&Item>, keys: &[(&str, String)]) {
        let siblings = bodies(written);
        if let Some(Item::Value(list)) = written {
            let pairs: Vec<String> = keys
                .iter()
                .map(|(key, text)| format!("{key} = {text}"))
                .collect();
            let member = format!("{{ {} }}", pairs.join(", "));
            match siblings.last() {
                Some(last) => {
                    let end = last.span().end;
                    self.changes.push((end..end, format!(", {member}")));
                }
                None => self.replace(list, format!("[{member}]")),
            }
            return;
        }
        let line_end = self.line_end;
        let mut block = format!("{line_end}{head}");
        for (key, text) in keys {
            block += &format!("{line_end}{key} = {text}");
        }
        match siblings.last() {
            Some(last) => {
                let at = self.table_end(last.end());
                self.changes.push((at..at, line_end.to_owned() + &block));
            }
            None => {
                let end = self.text.len();
                if !self.text.is_empty() && !self.text.ends_with('\n') {
                    block.insert_str(0, line_end);
                }
                self.changes.push((end..end, block + line_end));
            }
        }
    }

    /// One of several tables once more, with other values of some keys: behind that which is there, without the comments above it.
    pub fn repeat_table(&mut self, siblings: &[Body], index: usize, keys: &[(&str, String)]) {
        let body = siblings[index];
        let (before, span, end) = match body {
            Body::Headed(table) => {
                let head = table.span().unwrap_or_default();
                let end = self.table_end(body.end());
                ("", self.line_start(head.start)..end, end)
            }
            Body::Braced(_) => ("it = ", body.span(), body.span().end),
        };
        let written = format!("{before}{}", &self.text[span]);
        let Some(document) = parsed(&written) else {
            return;
        };
        let mut repeated = Spliced::new(&written);
        let found: Vec<Body> = document
            .iter()
            .flat_map(|(_, item)| bodies(Some(item)))
            .collect();
        let Some(&first) = found.first() else {
            return;
        };
        for (key, text) in keys {
            repeated.set(first, key, text.clone());
        }
        let repeated = repeated.text();
        let repeated = repeated.strip_prefix(before).unwrap_or(&repeated);
        let between = match body {
            Body::Headed(_) => self.line_end.repeat(2),
            Body::Braced(_) => ", ".to_owned(),
        };
        self.changes.push((end..end, between + repeated));
    }

    /// Takes one of several tables away: with the comment right above it, and one empty line.
    pub fn remove_table(&mut self, siblings: &[Body], index: usize) {
        let span = match siblings[index] {
            Body::Headed(table) => {
                let head = table.span().unwrap_or_default();
                let start = self.block_start(self.line_start(head.start));
                let end = self.next_line(self.table_end(siblings[index].end()));
                let blank_above = start == 0 || self.line_above(start).trim().is_empty();
                let below = &self.text[end..];
                let blank_below = below.split('\n').next().unwrap_or_default();
                if blank_above && !below.is_empty() && blank_below.trim().is_empty() {
                    start..self.next_line(end)
                } else if blank_above && below.is_empty() {
                    start - self.line_above_length(start)..end
                } else {
                    start..end
                }
            }
            Body::Braced(_) => {
                let spans: Vec<Range<usize>> = siblings.iter().map(|body| body.span()).collect();
                let mut span = member_span(&spans, &spans[index]);
                let behind = &self.text[span.end..];
                if spans.len() == 1 && behind.trim_start().starts_with(',') {
                    span.end += behind.find(',').map_or(0, |comma| comma + 1);
                }
                span
            }
        };
        self.changes.push((span, String::new()));
    }

    fn replace(&mut self, value: &Value, text: String) {
        self.changes.extend(value.span().map(|span| (span, text)));
    }

    /// Adds a key.
    pub fn insert_key(&mut self, body: Body, key: &str, text: &str) {
        let change = match (body, body.last_value_end()) {
            (Body::Headed(table), last) => {
                let at = self.line_end_at(last.unwrap_or_else(|| body.head_end()));
                let prefix = self.dotted_prefix(table);
                (at..at, format!("{}{prefix}{key} = {text}", self.line_end))
            }
            (Body::Braced(_), Some(last)) => (last..last, format!(", {key} = {text}")),
            (Body::Braced(_), None) => (body.span(), format!("{{ {key} = {text} }}")),
        };
        self.changes.push(change);
    }

    /// `shadows.` where a table has no head, and its keys are written so.
    fn dotted_prefix(&self, table: &Table) -> String {
        let first = table.iter().next().filter(|_| table.is_dotted());
        let key_span = first.and_then(|(key, _)| table.key(key)?.span());
        key_span.map_or(String::new(), |span| {
            self.text[self.line_start(span.start)..span.start].to_owned()
        })
    }

    fn line_start(&self, at: usize) -> usize {
        self.text[..at].rfind('\n').map_or(0, |newline| newline + 1)
    }

    /// Where a line ends, before what ends it.
    fn line_end_at(&self, at: usize) -> usize {
        let rest = &self.text[at..];
        let line = rest.split('\n').next().unwrap_or_default();
        at + line.strip_suffix('\r').unwrap_or(line).len()
    }

    /// Where the next line starts.
    fn next_line(&self, at: usize) -> usize {
        self.text[at..]
            .find('\n')
            .map_or(self.text.len(), |newline| at + newline + 1)
    }

    fn line_above(&self, line_start: usize) -> &'a str {
        &self.text[line_start - self.line_above_length(line_start)..line_start]
    }

    fn line_above_length(&self, line_start: usize) -> usize {
        match line_start {
            0 => 0,
            _ => line_start - self.line_start(line_start - 1),
        }
    }

    /// Where the comment begins that stands right above a line.
    fn block_start(&self, mut line_start: usize) -> usize {
        while self.line_above(line_start).trim_start().starts_with('#') {
            line_start -= self.line_above_length(line_start);
        }
        line_start
    }

    /// Where a table ends whose last value ends here: behind the comments that follow it at once, unless they stand
    /// right above another head.
    fn table_end(&self, last_value_end: usize) -> usize {
        let end = self.line_end_at(last_value_end);
        let mut behind_comments = end;
        loop {
            let start = self.next_line(behind_comments);
            let line = self.text[start..].split('\n').next().unwrap_or_default();
            match line.trim() {
                comment if comment.starts_with('#') => behind_comments = self.line_end_at(start),
                "" => return behind_comments,
                _ => return end,
            }
        }
    }
}

/// A member of a list with the comma that it takes along.
fn member_span(members: &[Range<usize>], member: &Range<usize>) -> Range<usize> {
    let before = members.iter().rfind(|other| other.end <= member.start);
    let after = members.iter().find(|other| other.start >= member.end);
    match (before, after) {
        (Some(before), _) => before.end..member.end,
        (None, Some(after)) => member.start..after.start,
        (None, None) => member.clone(),
    }
}

/// Reads a text with the places of its values.
pub fn parsed(text: &str) -> Option<Document<&str>> {
    Document::parse(text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spliced(text: &str, change: impl FnOnce(&Document<&str>, &mut Spliced)) -> String {
        let document = parsed(text).unwrap();
        let mut spliced = Spliced::new(text);
        change(&document, &mut spliced);
        spliced.text()
    }

    #[test]
    fn a_table_leaves_with_its_own_comment_and_one_empty_line() {
        let text = "# file\n\n# group\n\n# first\n[[a]]\nx = 1 # one\n# y = 2\n\n# second\n[[a]]\nx = 2\n# third\n[[a]]\nx = 3";
        let without = |index: usize| {
            spliced(text, |document, spliced| {
                spliced.remove_table(&bodies(document.as_table().get("a")), index);
            })
        };
        assert_eq!(
            without(0),
            "# file\n\n# group\n\n# second\n[[a]]\nx = 2\n# third\n[[a]]\nx = 3"
        );
        assert_eq!(
            without(1),
            "# file\n\n# group\n\n# first\n[[a]]\nx = 1 # one\n# y = 2\n\n# third\n[[a]]\nx = 3"
        );
        assert_eq!(
            without(2),
            "# file\n\n# group\n\n# first\n[[a]]\nx = 1 # one\n# y = 2\n\n# second\n[[a]]\nx = 2\n"
        );
    }

    #[test]
    fn lists_in_brackets_grow_and_shrink_by_whole_members() {
        let text = "a = [ { x = 1 },\n  { x = 2 }, ] # both\r\n";
        let list = |document: &Document<&str>, spliced: &mut Spliced, index: Option<usize>| {
            let members = bodies(document.as_table().get("a"));
            match index {
                Some(index) => spliced.remove_table(&members, index),
                None => {
                    let written = document.as_table().get("a");
                    spliced.add_table("[[a]]", written, &[("x", "3".to_owned())]);
                }
            }
        };
        let removed = |index| spliced(text, |d, s| list(d, s, Some(index)));
        assert_eq!(removed(0), "a = [ { x = 2 }, ] # both\r\n");
        assert_eq!(removed(1), "a = [ { x = 1 }, ] # both\r\n");
        let alone = spliced("a = [{ x = 1 } , ]", |d, s| list(d, s, Some(0)));
        assert_eq!(alone, "a = [ ]");
        let first = spliced("a = [] # none\n", |d, s| list(d, s, None));
        assert_eq!(first, "a = [{ x = 3 }] # none\n");
        assert_eq!(
            spliced(text, |d, s| list(d, s, None)),
            "a = [ { x = 1 },\n  { x = 2 }, { x = 3 }, ] # both\r\n"
        );
    }

    #[test]
    fn keys_come_and_go_in_every_kind_of_table() {
        let text = "b = { x = 1, y = 2 }\ne = {}\nd.x = 1 # dotted\r\n[h] # head\r\n";
        let changed = spliced(text, |document, spliced| {
            let body = |key: &str| bodies(document.as_table().get(key))[0];
            spliced.remove_key(body("b"), "x");
            spliced.set(body("e"), "z", "true".to_owned());
            spliced.set(body("d"), "z", "true".to_owned());
            spliced.set(body("h"), "z", "true".to_owned());
        });
        assert_eq!(
            changed,
            "b = { y = 2 }\ne = { z = true }\nd.x = 1 # dotted\r\nd.z = true\r\n[h] # head\r\nz = true\r\n"
        );
        let text = "[h]\nx = 1 # gone\ny = 2";
        let changed = spliced(text, |document, spliced| {
            let body = bodies(document.as_table().get("h"))[0];
            spliced.remove_key(body, "x");
            spliced.set_numbers(body, "p", &[0.5, 1.0], Digits::Decimals(4), None);
        });
        assert_eq!(changed, "[h]\ny = 2\np = [0.5, 1.0]");
    }
}
