//! Figures that README and docs quote are in a committed CSV, digit by digit; and those parse.
//!
//! A paragraph, list or table that quotes measured figures begins with the line `<!-- figures: FILE.csv … -->`, which names
//! the CSVs that have them, from the project's folder; one whose figures are none that were measured (settings, versions,
//! sizes) with `<!-- no figures -->`. A figure is a number with a decimal point, or one before %, ms or px.

use std::fs;
use std::path::{Path, PathBuf};

fn project_file(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn files_in(folder: &str, extension: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(project_file(folder)).expect("a folder");
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.retain(|file| file.extension().is_some_and(|found| found == extension));
    files.sort();
    files
}

/// All numbers of a CSV, which has to have a head and rows as wide as it.
fn values(path: &Path) -> Result<Vec<f64>, String> {
    let told = |error: csv::Error| format!("{}: {error}", path.display());
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(told)?;
    let mut values = Vec::new();
    let mut rows = 0;
    for row in reader.records() {
        let row = row.map_err(told)?;
        values.extend(row.iter().filter_map(|field| field.parse::<f64>().ok()));
        rows += 1;
    }
    match rows {
        0 => Err(format!("{}: no rows", path.display())),
        _ => Ok(values),
    }
}

/// A number as a text quotes it, and what it may differ by: half of its last digit.
#[derive(Debug, PartialEq)]
struct Quoted {
    value: f64,
    slack: f64,
}

/// The figures of a text, without its code, links' targets and dates.
fn quoted(text: &str) -> Vec<Quoted> {
    let mut plain = String::new();
    for (index, part) in text.split('`').enumerate() {
        plain += if index % 2 == 0 { part } else { " code " };
    }
    while let Some(start) = plain.find("](") {
        let Some(length) = plain[start..].find(')') else {
            break;
        };
        plain.replace_range(start..=start + length, "] ");
    }
    let chars: Vec<char> = plain.chars().collect();
    let mut found = Vec::new();
    let mut at = 0;
    while at < chars.len() {
        let starts = chars[at].is_ascii_digit()
            || chars[at] == '.' && chars.get(at + 1).is_some_and(char::is_ascii_digit);
        // A name like tag36h11 is no number.
        let in_word = at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_');
        if !starts || in_word {
            at += 1;
            continue;
        }
        let mut end = at;
        let continues = |end: usize| {
            let digit_after = chars.get(end + 1).is_some_and(char::is_ascii_digit);
            chars[end].is_ascii_digit() || ".,".contains(chars[end]) && digit_after
        };
        while end < chars.len() && continues(end) {
            end += 1;
        }
        let token: String = chars[at..end].iter().filter(|c| **c != ',').collect();
        let rest: String = chars[end..].iter().take(8).collect();
        let unit = rest.trim_start_matches([' ', '\u{a0}']);
        let measured = ["%", "ms", "px", "pixels"]
            .iter()
            .any(|name| unit.starts_with(name));
        let digits = token.split_once('.').map(|(_, digits)| digits.len());
        if let Ok(value) = token.parse::<f64>()
            && (digits.is_some() || measured)
        {
            let slack = 0.5 * 10_f64.powi(-(digits.unwrap_or(0) as i32));
            found.push(Quoted { value, slack });
        }
        at = end.max(at + 1);
    }
    found
}

/// Paragraphs, lists and tables, without blocks of code; each with the number of its first line.
fn blocks(text: &str) -> Vec<(usize, String)> {
    let mut blocks: Vec<(usize, String)> = Vec::new();
    let (mut in_code, mut ended) = (false, true);
    for (number, line) in (1..).zip(text.lines()) {
        if line.starts_with("```") {
            in_code = !in_code;
            continue;
        }
        if in_code {
            continue;
        }
        if line.trim().is_empty() {
            ended = true;
        } else if let Some((_, block)) = blocks.last_mut().filter(|_| !ended) {
            block.push('\n');
            block.push_str(line);
        } else {
            blocks.push((number, line.to_owned()));
            ended = false;
        }
    }
    blocks
}

/// What is wrong with a text's figures.
fn mistakes(name: &str, text: &str) -> Vec<String> {
    let mut mistakes = Vec::new();
    for (number, block) in blocks(text) {
        let (first, rest) = block.split_once('\n').unwrap_or((&block, ""));
        if first.trim() == "<!-- no figures -->" {
            continue;
        }
        let files = first
            .trim()
            .strip_prefix("<!-- figures:")
            .and_then(|files| files.strip_suffix("-->"));
        let Some(files) = files else {
            for Quoted { value, .. } in quoted(&block) {
                mistakes.push(format!("{name}:{number}: {value} comes from no CSV"));
            }
            continue;
        };
        let mut known = Vec::new();
        for file in files.split_whitespace() {
            match values(&project_file(file)) {
                Ok(values) => known.extend(values),
                Err(error) => mistakes.push(format!("{name}:{number}: {error}")),
            }
        }
        for Quoted { value, slack } in quoted(rest) {
            let is_quoted = |known: &f64| (known.abs() - value).abs() <= slack * 1.000_001;
            if !known.iter().any(is_quoted) {
                mistakes.push(format!(
                    "{name}:{number}: {value} is not in {}",
                    files.trim()
                ));
            }
        }
    }
    mistakes
}

#[test]
fn every_figure_quoted_is_in_a_committed_csv() {
    let mut texts = files_in("docs", "md");
    texts.push(project_file("README.md"));
    let mut wrong = Vec::new();
    for path in texts {
        let text = fs::read_to_string(&path).expect("a text");
        let name = path.file_name().expect("a name").to_string_lossy();
        wrong.extend(mistakes(&name, &text));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn committed_charts_parse() {
    let mut files = files_in("charts", "csv");
    assert!(files.len() >= 7, "{files:?}");
    files.extend(files_in("docs/measured", "csv"));
    for file in files {
        let found = values(&file).unwrap_or_else(|error| panic!("{error}"));
        assert!(!found.is_empty(), "{} has no number", file.display());
    }
    for csv in files_in("charts", "csv") {
        let picture = csv.with_extension("png");
        assert!(picture.is_file(), "{} is not there", picture.display());
    }
}

#[test]
fn a_wrong_figure_is_found() {
    let head = "<!-- figures: tests/stability/peers.csv -->\n";
    let right = format!("{head}OGRE: 0.013 %, Irrlicht .39 or 99.6 %, `0.5 px` aside.");
    assert_eq!(mistakes("t", &right), Vec::<String>::new());
    for wrong in ["0.015 %", "99.7", "98 %"] {
        assert_eq!(mistakes("t", &format!("{head}{wrong}")).len(), 1, "{wrong}");
    }
    assert_eq!(mistakes("t", "It took 12 ms.").len(), 1);
    assert_eq!(mistakes("t", "<!-- no figures -->\nRust 1.95").len(), 0);
    assert_eq!(mistakes("t", "<!-- figures: nowhere.csv -->\n1.5").len(), 2);
    assert_eq!(mistakes("t", "12 of tag36h11, [a](b_1.5.png)").len(), 0);
    assert_eq!(mistakes("t", "a\n\n```\n1.5 px\n```\n").len(), 0);
    let quoted = quoted("0.11/0.25, 1,234.5 and 640x480");
    let values: Vec<f64> = quoted.iter().map(|q| q.value).collect();
    assert_eq!(values, [0.11, 0.25, 1234.5]);
}
