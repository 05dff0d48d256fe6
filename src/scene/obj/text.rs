//! The text of OBJ and MTL files, whatever wrote it.

use std::borrow::Cow;

/// A file's text: UTF-8, with or without a byte order mark, UTF-16 with one, or else Latin-1, so that names are the same
/// wherever they have the same bytes. All line ends become `\n`.
pub fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    let text = match bytes {
        [0xff, 0xfe, rest @ ..] => Cow::Owned(utf16(rest, u16::from_le_bytes)),
        [0xfe, 0xff, rest @ ..] => Cow::Owned(utf16(rest, u16::from_be_bytes)),
        _ => {
            let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
            match std::str::from_utf8(bytes) {
                Ok(text) => Cow::Borrowed(text),
                Err(_) => Cow::Owned(bytes.iter().copied().map(char::from).collect()),
            }
        }
    };
    match text.contains('\r') {
        true => Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n")),
        false => text,
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units: Vec<u16> = bytes
        .chunks_exact(2)
        .map(|pair| unit([pair[0], pair[1]]))
        .collect();
    String::from_utf16_lossy(&units)
}

/// A record, with the lines that continue it.
#[derive(Debug, Clone, PartialEq)]
pub struct Record<'a> {
    /// Its first byte in the text.
    pub start: usize,
    /// The byte after its line end.
    pub end: usize,
    /// Byte for byte as long as in the text: what joins lines is spaces.
    pub line: Cow<'a, str>,
}

impl Record<'_> {
    /// The keyword; empty in a line that has nothing to say.
    pub fn keyword(&self) -> &str {
        let line = uncommented(&self.line);
        line.split_whitespace().next().unwrap_or_default()
    }

    /// What follows the keyword, up to a comment.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        uncommented(&self.line).split_whitespace().skip(1)
    }

    /// All that follows the keyword: a name may have spaces, and a `#`.
    pub fn rest(&self) -> &str {
        let line = self.line.trim();
        line.split_once(char::is_whitespace)
            .map_or("", |(_, rest)| rest.trim())
    }

    /// Where a part of the line is in the text.
    pub fn at(&self, part: &str) -> usize {
        let offset = (part.as_ptr() as usize).saturating_sub(self.line.as_ptr() as usize);
        self.start + offset.min(self.line.len())
    }
}

/// A line up to its comment.
fn uncommented(line: &str) -> &str {
    line.split('#').next().unwrap_or_default()
}

/// A name without the comment behind it, if there is one.
pub fn without_comment(name: &str) -> &str {
    let mut parts = name.match_indices('#');
    let comment = parts.find(|(at, _)| name[..*at].ends_with(char::is_whitespace));
    comment.map_or(name, |(at, _)| name[..at].trim_end())
}

/// The records of a text. A line that ends in `\` goes on in the next one, unless it is a comment.
pub fn records(text: &str) -> impl Iterator<Item = Record<'_>> {
    let mut start = 0;
    std::iter::from_fn(move || {
        let first = start;
        let mut line = next_line(text, &mut start)?;
        if line.trim_start().starts_with('#') || !goes_on(line) {
            return Some(Record {
                start: first,
                end: start,
                line: Cow::Borrowed(line),
            });
        }
        let mut joined = String::new();
        loop {
            let is_last = !goes_on(line);
            let kept = if is_last { line } else { before_sign(line) };
            joined.push_str(kept);
            if is_last {
                break;
            }
            joined.extend(std::iter::repeat_n(' ', line.len() + 1 - kept.len()));
            match next_line(text, &mut start) {
                Some(next) => line = next,
                None => break,
            }
        }
        Some(Record {
            start: first,
            end: start,
            line: Cow::Owned(joined),
        })
    })
}

fn next_line<'a>(text: &'a str, start: &mut usize) -> Option<&'a str> {
    let rest = text.get(*start..).filter(|rest| !rest.is_empty())?;
    let length = rest.find('\n').unwrap_or(rest.len());
    *start += (length + 1).min(rest.len());
    Some(&rest[..length])
}

fn goes_on(line: &str) -> bool {
    line.trim_end().ends_with('\\')
}

fn before_sign(line: &str) -> &str {
    let line = line.trim_end();
    line.strip_suffix('\\').unwrap_or(line)
}

/// A finite number; some write `1.#QNAN` or `-nan(ind)` for what is none, and some a comma for the point.
pub fn number(word: &str) -> Option<f64> {
    let with_point = || match word.matches([',', '.']).count() {
        1 => word.replace(',', ".").parse().ok(),
        _ => None,
    };
    let number: Option<f64> = word.parse().ok().or_else(with_point);
    number.filter(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_and_line_end_gives_the_same_text() {
        let text = "usemtl grün\nv 1 2 3\n";
        let utf16 = |to_bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            let units = "\u{feff}".encode_utf16().chain(text.encode_utf16());
            units.flat_map(to_bytes).collect()
        };
        let latin1: Vec<u8> = text.chars().map(|c| c as u8).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            latin1,
            utf16(u16::to_le_bytes),
            utf16(u16::to_be_bytes),
            text.replace('\n', "\r\n").into_bytes(),
            text.replace('\n', "\r").into_bytes(),
        ] {
            assert_eq!(decoded(&bytes), text);
        }
        assert_eq!(decoded(&[0xff, 0xfe, 0x41]), "");
    }

    #[test]
    fn numbers_are_those_that_programs_write() {
        for (word, number_there) in [
            ("1.5", Some(1.5)),
            ("-1,5", Some(-1.5)),
            ("+.5e1", Some(5.0)),
            ("1,000,000", None),
            ("1.000,5", None),
            ("nan", None),
            (",", None),
        ] {
            assert_eq!(number(word), number_there, "{word}");
        }
    }

    #[test]
    fn records_go_on_and_know_where_they_are() {
        let text = "# c:\\\nf 1 \\ \n 2\\\n3 # three\nusemtl a #1 # red\nf 4\\";
        let records: Vec<Record> = records(text).collect();
        let keywords: Vec<&str> = records.iter().map(Record::keyword).collect();
        assert_eq!(keywords, ["", "f", "usemtl", "f"]);
        let words: Vec<&str> = records[1].words().collect();
        assert_eq!(words, ["1", "2", "3"]);
        for word in records[1].words() {
            let at = records[1].at(word);
            assert_eq!(&text[at..at + 1], word);
        }
        assert_eq!(records[1].end, text.find("usemtl").unwrap());
        assert_eq!(records[2].rest(), "a #1 # red");
        assert_eq!(without_comment("red # the red"), "red");
        assert_eq!(without_comment("Material#25"), "Material#25");
    }
}
