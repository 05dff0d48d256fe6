//! Checks an OBJ or MTL file line by line before tobj reads it: tobj tells no lines, takes NaN for a coordinate, makes
//! triangles of polylines, lends a corner without a normal that of another, and panics at a short colour.

use std::collections::HashMap;
use std::ops::Range;

/// A coordinate beyond this is a mistake of units, metres.
const FARTHEST_M: f32 = 1e5;

/// What is wrong at which bytes of the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanError {
    pub span: Range<usize>,
    pub message: String,
}

/// An OBJ file that tobj can read without surprises.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct ScannedObj {
    /// Without what gnomon has no use for: polylines, texture coordinates, vertex colours.
    pub text: String,
    /// For each triangle of the fans that tobj makes of the faces, which corners have a normal of their own.
    pub corner_has_normal: Vec<[bool; 3]>,
}

/// Checks an OBJ file's records.
pub fn scan_obj(text: &str) -> Result<ScannedObj, ScanError> {
    let mut scanned = ScannedObj::default();
    let mut places: Vec<CornerPlace> = Vec::new();
    let mut normals = 0_usize;
    let mut polygons = Polygons::default();
    for line in text.lines() {
        let record = Record { text, line };
        let mut words = line.split_whitespace();
        match words.next().map(|word| word.trim_start_matches('\u{feff}')) {
            Some("v") => {
                let words: Vec<&str> = words.collect();
                let [x, y, z] = vertex(&record, &words)?;
                scanned.text += &format!("v {x} {y} {z}");
                // Adding 0 makes 0 of -0, which is the same place.
                places.push([x, y, z].map(|coordinate_m| (coordinate_m + 0.0).to_bits()));
            }
            Some("vn") => {
                let words: Vec<&str> = words.collect();
                if words.len() != 3 {
                    return Err(record.error(
                        line.trim(),
                        format!("{} numbers; a normal has 3", words.len()),
                    ));
                }
                for word in words {
                    record.number(word)?;
                }
                scanned.text += line;
                normals += 1;
            }
            Some("f") => {
                let mut corners = words
                    .map(|corner| record.corner(corner, places.len(), normals))
                    .collect::<Result<Vec<FaceCorner>, ScanError>>()?;
                if corners.len() < 3 {
                    return Err(record.error(
                        line.trim(),
                        format!("{} corners; a face has 3 or more", corners.len()),
                    ));
                }
                polygons.start_alike(&mut corners, &places);
                let has_normal: Vec<bool> =
                    corners.iter().map(|corner| corner.has_normal).collect();
                let fan = has_normal[1..]
                    .windows(2)
                    .map(|pair| [has_normal[0], pair[0], pair[1]]);
                scanned.corner_has_normal.extend(fan);
                scanned.text.push('f');
                for corner in &corners {
                    scanned.text.push(' ');
                    scanned.text += corner.written;
                }
            }
            Some(kind @ ("usemtl" | "mtllib")) => {
                let line = line.trim();
                let name = line.split_once(char::is_whitespace);
                let name = name.map_or("", |(_, name)| name.trim());
                if kind == "usemtl" && name.is_empty() {
                    return Err(record.error(line, "names no material"));
                }
                // tobj knows the space alone.
                scanned.text += &format!("{kind} {name}");
            }
            _ => continue,
        }
        scanned.text.push('\n');
    }
    Ok(scanned)
}

/// Checks an MTL file's colours and numbers.
pub fn scan_mtl(text: &str) -> Result<(), ScanError> {
    for line in text.lines() {
        let record = Record { text, line };
        let mut words = line.split_whitespace();
        let (count, most) = match words.next() {
            Some("Kd") => (3, 1.0),
            Some("Ka" | "Ks" | "Ke") => (3, f32::MAX),
            Some("Ns" | "Ni") => (1, f32::MAX),
            Some("d" | "Pr") => (1, 1.0),
            Some("newmtl") if words.next().is_none() => {
                return Err(record.error(line.trim(), "names no material"));
            }
            _ => continue,
        };
        let words: Vec<&str> = words.collect();
        if words.len() < count {
            return Err(record.error(
                line.trim(),
                format!("{} numbers; {count} are expected", words.len()),
            ));
        }
        for word in &words[..count] {
            let number = record.number(word)?;
            if number < 0.0 || number > most {
                let upper = if most == 1.0 { "0 to 1" } else { "0 or more" };
                return Err(record.error(word, format!("{word}: out of range; allowed: {upper}")));
            }
        }
    }
    Ok(())
}

/// A face's corner.
struct FaceCorner<'a> {
    written: &'a str,
    /// Index of its vertex, from 0.
    vertex: usize,
    has_normal: bool,
}

/// A vertex's coordinates, bit by bit.
type CornerPlace = [u32; 3];

/// Polygons by the places of their vertices. A fan starts at the first vertex, so the same polygon twice, or once from
/// each side, could be cut along different diagonals; here copies start where the first one does.
#[derive(Default)]
struct Polygons {
    start_of: HashMap<Vec<CornerPlace>, CornerPlace>,
}

impl Polygons {
    fn start_alike(&mut self, corners: &mut [FaceCorner], places: &[CornerPlace]) {
        // A triangle has no diagonal.
        if corners.len() == 3 {
            return;
        }
        let mut key: Vec<CornerPlace> =
            corners.iter().map(|corner| places[corner.vertex]).collect();
        let first = key[0];
        key.sort_unstable();
        let start = *self.start_of.entry(key).or_insert(first);
        let offset = corners
            .iter()
            .position(|corner| places[corner.vertex] == start);
        corners.rotate_left(offset.unwrap_or(0));
    }
}

/// A line and the text that it is a part of.
struct Record<'a> {
    text: &'a str,
    line: &'a str,
}

impl Record<'_> {
    /// A mistake at a part of the line.
    fn error(&self, part: &str, message: impl Into<String>) -> ScanError {
        let start = (part.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        let kind = self
            .line
            .split_whitespace()
            .next()
            .unwrap_or_default()
            .trim_start_matches('\u{feff}');
        ScanError {
            span: start..start + part.len(),
            message: format!("{kind}: {}", message.into()),
        }
    }

    fn number(&self, word: &str) -> Result<f32, ScanError> {
        match word.parse::<f32>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(_) => Err(self.error(word, format!("{word} is not a finite number"))),
            Err(_) => Err(self.error(word, format!("{word} is not a number"))),
        }
    }

    /// A face's corner: `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner<'b>(
        &self,
        corner: &'b str,
        vertices: usize,
        normals: usize,
    ) -> Result<FaceCorner<'b>, ScanError> {
        let mut parts = corner.split('/');
        let vertex = parts.next().unwrap_or_default();
        let vertex = self.index(corner, vertex, vertices, "vertex", "vertices")?;
        if let Some(texture) = parts.next().filter(|texture| !texture.is_empty()) {
            texture
                .parse::<i64>()
                .map_err(|_| self.error(corner, format!("{corner} is not a face's corner")))?;
        }
        let normal = parts.next().filter(|normal| !normal.is_empty());
        if parts.next().is_some() {
            return Err(self.error(corner, format!("{corner} is not a face's corner")));
        }
        if let Some(normal) = normal {
            self.index(corner, normal, normals, "normal", "normals")?;
        }
        Ok(FaceCorner {
            written: corner,
            vertex,
            has_normal: normal.is_some(),
        })
    }

    /// An index from 0. Written ones count from 1, negative ones back from the newest.
    fn index(
        &self,
        corner: &str,
        written: &str,
        known: usize,
        one: &str,
        many: &str,
    ) -> Result<usize, ScanError> {
        let index: i64 = written
            .parse()
            .map_err(|_| self.error(corner, format!("{corner} is not a face's corner")))?;
        if index == 0 || index.unsigned_abs() > known as u64 {
            let message =
                format!("{one} {index} does not exist; {known} {many} are known by this line");
            return Err(self.error(corner, message));
        }
        let from_start = index.unsigned_abs() as usize;
        Ok(if index > 0 {
            from_start - 1
        } else {
            known - from_start
        })
    }
}

/// A vertex's position, checked; its weight is divided out.
fn vertex(record: &Record, words: &[&str]) -> Result<[f32; 3], ScanError> {
    let numbers = words
        .iter()
        .map(|word| record.number(word))
        .collect::<Result<Vec<f32>, ScanError>>()?;
    let weight = match numbers.len() {
        3 | 6 => 1.0,
        4 | 7 => numbers[3],
        count => {
            let message =
                format!("{count} numbers; a vertex has 3, and a weight or a colour after them");
            return Err(record.error(record.line.trim(), message));
        }
    };
    let mut position_m = [0.0; 3];
    for ((coordinate_m, word), number) in position_m.iter_mut().zip(words).zip(&numbers) {
        *coordinate_m = number / weight;
        // A weight of 0 gives infinity or NaN.
        if coordinate_m.is_nan() || coordinate_m.abs() > FARTHEST_M {
            let message = format!(
                "{coordinate_m} m is too far; allowed: up to {FARTHEST_M} m from the origin"
            );
            return Err(record.error(word, message));
        }
    }
    Ok(position_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failure(text: &str) -> (usize, String) {
        let error = scan_obj(text).unwrap_err();
        (
            text[..error.span.start].matches('\n').count() + 1,
            error.message,
        )
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    #[test]
    fn keeps_what_is_of_use() {
        let text = format!(
            "\u{feff}# a\n{TRIANGLE}v 2 2 0 2\nv 1 1 1 .5 .5 .5\nvt 0\nvn 0 0 1\nl 1 2 3\nf 1/1/1 2//-1 3 4/7\n"
        );
        let scanned = scan_obj(&text).unwrap();
        assert_eq!(
            scanned.text,
            format!("{TRIANGLE}v 1 1 0\nv 1 1 1\nvn 0 0 1\nf 1/1/1 2//-1 3 4/7\n")
        );
        assert_eq!(
            scanned.corner_has_normal,
            [[true, true, false], [true, false, false]]
        );
    }

    #[test]
    fn copies_of_a_polygon_are_cut_along_the_same_diagonals() {
        let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 -0\n";
        let loose = "v 1 1 0\nv 0 1 0\nv 0 0 0\nv 1 0 0\n";
        let text = format!("{quad}{loose}f 2 3 4 1\nf 4 3 2 1\nf 1 2 3 4\nf 5 6 7 8\nf 5 7 6\n");
        let faces: Vec<String> = scan_obj(&text)
            .unwrap()
            .text
            .lines()
            .filter(|line| line.starts_with('f'))
            .map(str::to_owned)
            .collect();
        assert_eq!(
            faces,
            [
                "f 2 3 4 1",
                "f 2 1 4 3",
                "f 2 3 4 1",
                "f 8 5 6 7",
                "f 5 7 6"
            ]
        );
    }

    #[test]
    fn mistakes_have_lines() {
        let face = |face: &str| failure(&format!("{TRIANGLE}{face}\n"));
        assert_eq!(
            face("f 1 2 4"),
            (
                4,
                "f: vertex 4 does not exist; 3 vertices are known by this line".into()
            )
        );
        for (record, part) in [
            ("f 1 2 0", "vertex 0"),
            ("f 1 2 -4", "vertex -4"),
            ("f 1 2", "2 corners"),
            ("f", "0 corners"),
            ("f 1 2 x", "x is not a face's corner"),
            ("f 1 2 3\\", "not a face's corner"),
            ("f 1/2/3/4 2 3", "not a face's corner"),
            ("f 1/x 2 3", "not a face's corner"),
            ("f 1//1 2 3", "normal 1 does not exist; 0 normals"),
            ("f 99999999999999999999 2 3", "not a face's corner"),
            ("v nan 0 0", "nan is not a finite number"),
            ("v 1e39 0 0", "not a finite number"),
            ("v 200000 0 0", "too far"),
            ("v 1 0 0 0", "too far"),
            ("v 0 0 0 0", "too far"),
            ("v 1 2", "2 numbers"),
            ("v 1 2 3 4 5", "5 numbers"),
            ("v 1 2 c", "c is not a number"),
            ("vn 0 0", "2 numbers"),
            ("vn 0 0 inf", "not a finite number"),
            ("usemtl", "names no material"),
        ] {
            let (line, message) = face(record);
            assert_eq!(line, 4, "{record}");
            assert!(message.contains(part), "{record}: {message}");
        }
    }

    #[test]
    fn materials_are_checked() {
        assert_eq!(
            scan_mtl("newmtl a\nKd .1 .2 .3\nKs 0 0 0\nNs 10\nd 1\nmap_Kd x.png\nPr .5\n"),
            Ok(())
        );
        for text in [
            "Kd .1 .2",
            "Kd 0 0 1.5",
            "Kd -1 0 0",
            "Ks spectral x 1",
            "Ns nan",
            "newmtl",
            "Pr 2",
            "Ns",
        ] {
            assert!(scan_mtl(text).is_err(), "{text}");
        }
    }
}
