//! The entries of a camera's table in one list, those of tables within it among them.

use serde_json::{Map, Value};

use super::lens_names::{is_of_lens, name_in_lens};
use super::values::normalised;

/// A key and its value.
pub(super) struct Entry<'a> {
    /// As the file has it.
    pub key: &'a str,
    /// The last part of the key (`Camera.fx`), as keys are compared; what it means where its table is a lens's.
    pub name: String,
    pub value: &'a Value,
    /// Which table it stands in; the outermost is 0.
    pub table: usize,
    /// Whether that table is a lens's.
    pub is_in_lens: bool,
}

/// All entries of a tree and of the tables in it down to `levels`, but for those of matrices.
pub(super) fn entries(tree: &Map<String, Value>, levels: u32) -> Vec<Entry<'_>> {
    gathered(tree, levels, |_| true)
}

/// The entries of a tree, and those of the tables in it that are a lens's.
pub(super) fn entries_with_lens(tree: &Map<String, Value>) -> Vec<Entry<'_>> {
    gathered(tree, 2, is_of_lens)
}

fn gathered<'a>(
    tree: &'a Map<String, Value>,
    levels: u32,
    wanted: impl Fn(&str) -> bool,
) -> Vec<Entry<'a>> {
    let mut found = Vec::new();
    let mut tables = vec![(tree, levels, String::new())];
    let mut table = 0;
    while let Some((tree, levels, table_name)) = tables.get(table).cloned() {
        let is_in_lens = is_of_lens(&table_name);
        for (key, value) in tree {
            let name = normalised(key.rsplit('.').next().unwrap_or_default());
            match value {
                Value::Object(inner) if levels > 0 && !is_matrix(value) && wanted(&name) => {
                    tables.push((inner, levels - 1, name));
                }
                _ => found.push(Entry {
                    key,
                    name: match is_in_lens {
                        true => name_in_lens(&table_name, tree, name),
                        false => name,
                    },
                    value,
                    table,
                    is_in_lens,
                }),
            }
        }
        table += 1;
    }
    found
}

/// The entry with the first of some names that any has.
pub(super) fn entry<'e, 'a>(entries: &'e [Entry<'a>], names: &[&str]) -> Option<&'e Entry<'a>> {
    let of = |name: &&str| entries.iter().find(|entry| entry.name == **name);
    names.iter().find_map(of)
}

/// Whether a value is a matrix written as `{rows, cols, data}`.
pub(super) fn is_matrix(value: &Value) -> bool {
    value.get("data").is_some_and(Value::is_array)
}
