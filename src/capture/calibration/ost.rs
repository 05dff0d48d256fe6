//! The `ost.txt` that ROS's calibrators pack beside their YAML: sections in brackets, each with names on lines of their own
//! and numbers below them.

use serde_json::{Map, Value, json};

/// Whether a text is one.
pub(super) fn is_ost(text: &str) -> bool {
    let mut lines = text.lines().map(str::trim);
    lines.any(|line| section(line) == Some("image"))
}

fn section(line: &str) -> Option<&str> {
    line.strip_prefix('[')?.strip_suffix(']')
}

/// A table for each camera, with the picture's size above them.
///
/// # Errors
/// Numbers without a name.
pub(super) fn tree(text: &str) -> Result<Map<String, Value>, String> {
    let mut root = Map::new();
    let mut camera = String::new();
    let mut name: Option<String> = None;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if let Some(section) = section(line) {
            (camera, name) = (section.to_owned(), None);
            continue;
        }
        let numbers: Option<Vec<f64>> = line
            .split_whitespace()
            .map(|word| word.parse().ok())
            .collect();
        let Some(numbers) = numbers else {
            name = Some(line.to_owned());
            continue;
        };
        let Some(name) = &name else {
            return Err(format!(
                "line {}: a name is expected above these numbers",
                number + 1
            ));
        };
        let table = match camera.as_str() {
            "image" => &mut root,
            _ => match root.entry(camera.clone()).or_insert_with(|| json!({})) {
                Value::Object(table) => table,
                _ => return Err(format!("line {}: there are two [{camera}]", number + 1)),
            },
        };
        match table.entry(name.clone()).or_insert_with(|| json!([])) {
            Value::Array(known) => known.extend(numbers.into_iter().map(Value::from)),
            other => *other = numbers.into_iter().collect(),
        }
    }
    // A size is one number.
    for key in ["width", "height"] {
        if let Some(Value::Array(one)) = root.get(key)
            && let [side] = &one[..]
        {
            let side = side.clone();
            root.insert(key.to_owned(), side);
        }
    }
    Ok(root)
}
