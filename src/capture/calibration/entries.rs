//! The entries of a camera's table in one list, those of tables within it among them.

use serde_json::{Map, Value};

use super::values::normalised;

/// A key and its value.
pub(super) struct Entry<'a> {
    /// As the file has it.
    pub key: &'a str,
    /// The last part of the key (`Camera.fx`), as keys are compared.
    pub name: String,
    pub value: &'a Value,
    /// Which table it stands in; the outermost is 0.
    pub table: usize,
}

/// All entries of a tree and of the tables in it down to `levels`, but for those of matrices.
pub(super) fn entries(tree: &Map<String, Value>, levels: u32) -> Vec<Entry<'_>> {
    gathered(tree, levels, &|_| true)
}

/// The entries of a tree, and those of its tables whose names (as keys are compared) are wanted.
pub(super) fn entries_with(
    tree: &Map<String, Value>,
    wanted: impl Fn(&str) -> bool,
) -> Vec<Entry<'_>> {
    gathered(tree, 1, &wanted)
}

fn gathered<'a>(
    tree: &'a Map<String, Value>,
    levels: u32,
    wanted: &dyn Fn(&str) -> bool,
) -> Vec<Entry<'a>> {
    let mut found = Vec::new();
    let mut tables = vec![(tree, levels)];
    let mut table = 0;
    while let Some(&(tree, levels)) = tables.get(table) {
        for (key, value) in tree {
            let name = normalised(key.rsplit('.').next().unwrap_or_default());
            match value {
                Value::Object(inner) if levels > 0 && !is_matrix(value) && wanted(&name) => {
                    tables.push((inner, levels - 1));
                }
                _ => found.push(Entry {
                    key,
                    name,
                    value,
                    table,
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
