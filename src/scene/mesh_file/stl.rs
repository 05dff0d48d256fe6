//! STL files, of text and of bytes, with the colours of VisCAM and of Materialise. No crate in use reads the colours, tells
//! the two kinds apart by more than their first word, or says where a file is broken, and the format is 50 bytes a triangle.

use std::collections::HashMap;
use std::path::Path;

use glam::{Vec3, Vec4};

use crate::geometry::mesh::{CornerLook, RawLooks, RawTriangle};
use crate::geometry::polygon::PolygonCutter;
use crate::scene::error::SceneError;
use crate::scene::notes::Notes;
use crate::scene::obj::FARTHEST;
use crate::scene::obj::text::{decoded, number};
use crate::scene::raw_model::{GivenMaterial, RawModel};
use crate::scene::vertex_colors::linear_colors;

const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Whether bytes are an STL file of bytes: its length is what it says. Some of these begin with "solid", as text does.
pub fn is_binary(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|count| count > 0 && bytes.len() as u64 == length(count))
}

/// Whether bytes are an STL file of text.
pub fn is_text(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let head: String = bytes
        .iter()
        .take(4096)
        .map(|byte| char::from(byte.to_ascii_lowercase()))
        .collect();
    let mut words = head.split_whitespace();
    words.next() == Some("solid") && words.any(|word| matches!(word, "facet" | "endsolid"))
}

/// The triangles that the header counts.
fn count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().ok()?))
}

fn length(count: u32) -> u64 {
    HEADER as u64 + TRIANGLE as u64 * u64::from(count)
}

/// Reads a file of either kind. Its normals are passed over: its triangles have the same, by their winding.
///
/// # Errors
/// A header that counts other triangles than there are; a vertex that is no place; text that stops in a triangle.
pub fn read(path: &Path, bytes: &[u8]) -> Result<RawModel, SceneError> {
    match is_text(bytes) && !is_binary(bytes) {
        true => read_text(path, bytes),
        false => read_binary(path, bytes),
    }
}

fn read_binary(path: &Path, bytes: &[u8]) -> Result<RawModel, SceneError> {
    let Some(count) = count(bytes) else {
        let message = format!(
            "{} bytes are too few for an STL file: its header alone has {HEADER}",
            bytes.len()
        );
        return Err(SceneError::of_file(path, message));
    };
    let there = bytes.len() as u64;
    let mut notes = Notes::default();
    // Who writes as triangles come does not know their number beforehand, and leaves what is no number of them.
    let room = (there - HEADER as u64) / TRIANGLE as u64;
    let is_whole = room > 0 && length(room as u32) == there;
    let count = match is_whole && (count == 0 || length(count) > there) {
        true => {
            notes.add_of(
                path,
                format!(
                    "byte 80: the header counts {count} triangles; the file's {room} are taken"
                ),
            );
            room as u32
        }
        false => count,
    };
    if count == 0 {
        return Err(SceneError::of_file(
            path,
            "no triangles; a mesh is expected",
        ));
    }
    if length(count) > there {
        let message =
            format!("byte 80: the header counts {count} triangles, and the file has {room}");
        return Err(SceneError::of_file(path, message));
    }
    if length(count) < there {
        let message = format!(
            "{} bytes behind the last triangle: not used",
            there - length(count)
        );
        notes.add_of(path, message);
    }
    let records = || bytes[HEADER..].chunks_exact(TRIANGLE).take(count as usize);
    let mut positions = Vec::with_capacity(3 * count as usize);
    for (index, record) in records().enumerate() {
        for corner in 0..3 {
            let part = |axis: usize| {
                let at = 12 * (corner + 1) + 4 * axis;
                f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
            };
            let position = Vec3::new(part(0), part(1), part(2));
            if !is_place(position) {
                let at = HEADER + TRIANGLE * index + 12 * (corner + 1);
                let message = format!(
                    "byte {at}: triangle {index} has a vertex at {position}, which is no place; allowed: up to {FARTHEST} in size"
                );
                return Err(SceneError::of_file(path, message));
            }
            positions.push(position);
        }
    }
    let attributes: Vec<u16> = records()
        .map(|record| u16::from_le_bytes([record[48], record[49]]))
        .collect();
    let mut model = model(positions, notes);
    if let Some(looks) = colors(&bytes[..HEADER - 4], &attributes) {
        model.looks = looks;
        model.materials = vec![GivenMaterial::unknown(true)];
    }
    Ok(model)
}

fn is_place(position: Vec3) -> bool {
    position
        .to_array()
        .iter()
        .all(|part| f64::from(part.abs()) <= FARTHEST)
}

/// A model of three vertices for each triangle.
fn model(positions: Vec<Vec3>, notes: Notes) -> RawModel {
    let triangles = (0..positions.len() as u32 / 3).map(|triangle| RawTriangle {
        vertices: [0, 1, 2].map(|corner| 3 * triangle + corner),
        normals: [None; 3],
        material: 0,
    });
    RawModel {
        triangles: triangles.collect(),
        positions,
        materials: vec![GivenMaterial::unknown(false)],
        notes,
        ..RawModel::default()
    }
}

/// The colours of triangles. Materialise writes one for all into the header, behind `COLOR=`, and those of triangles red
/// first, where the highest bit is not set; VisCAM writes them blue first, where it is.
fn colors(header: &[u8], attributes: &[u16]) -> Option<RawLooks> {
    const SIGN: &[u8] = b"COLOR=";
    let sign = header.windows(SIGN.len()).position(|part| part == SIGN);
    let of_all = sign.and_then(|at| header.get(at + SIGN.len()..at + SIGN.len() + 3));
    let has_own = |attribute: u16| (attribute & 0x8000 == 0) == of_all.is_some();
    if of_all.is_none() && !attributes.iter().any(|attribute| has_own(*attribute)) {
        return None;
    }
    let usual = of_all.map_or([1.0; 3], |color| {
        [0, 1, 2].map(|part| f32::from(color[part]) / 255.0)
    });
    let mut looks = RawLooks::default();
    let mut index_of: HashMap<Option<u16>, u32> = HashMap::new();
    for &attribute in attributes {
        let own = has_own(attribute).then_some(attribute & 0x7fff);
        let index = *index_of.entry(own).or_insert_with(|| {
            let color = own.map_or(usual, |bits| {
                let [low, middle, high] =
                    [0, 5, 10].map(|shift| f32::from(bits >> shift & 31) / 31.0);
                match of_all {
                    Some(_) => [low, middle, high],
                    None => [high, middle, low],
                }
            });
            let color: Vec4 = linear_colors(vec![color]).0[0].extend(1.0);
            looks.looks.push(CornerLook {
                color,
                ..CornerLook::default()
            });
            looks.looks.len() as u32 - 1
        });
        looks.corners.push([index; 3]);
    }
    Some(looks)
}

fn read_text(path: &Path, bytes: &[u8]) -> Result<RawModel, SceneError> {
    let text = decoded(bytes);
    let mut positions: Vec<Vec3> = Vec::new();
    let mut outline: Vec<Vec3> = Vec::new();
    let (mut cutter, mut cut) = (PolygonCutter::default(), Vec::new());
    let mut last_line = "";
    for line in text.lines() {
        let error = |message: &str| {
            let line = line.trim();
            let at = line.as_ptr() as usize - text.as_ptr() as usize;
            SceneError::at(path, &text, at..at + line.len(), message)
        };
        let mut words = line.split_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let mut next = || words.next().and_then(number);
                let place = match (next(), next(), next()) {
                    (Some(x), Some(y), Some(z)) => Vec3::new(x as f32, y as f32, z as f32),
                    _ => Vec3::NAN,
                };
                if !is_place(place) {
                    return Err(error("vertex: no place; three finite numbers are expected"));
                }
                outline.push(place);
            }
            Some("endloop" | "endfacet") if !outline.is_empty() => {
                if outline.len() < 3 {
                    return Err(error("a loop of fewer than three vertices"));
                }
                cut.clear();
                cutter.triangles(&outline, &mut cut);
                positions.extend(cut.iter().flatten().map(|corner| outline[*corner as usize]));
                outline.clear();
            }
            _ => {}
        }
        if !line.trim().is_empty() {
            last_line = line;
        }
    }
    if !outline.is_empty() {
        let at = last_line.as_ptr() as usize - text.as_ptr() as usize;
        let message = "the file ends within a triangle";
        return Err(SceneError::at(
            path,
            &text,
            at..at + last_line.len(),
            message,
        ));
    }
    if positions.is_empty() {
        return Err(SceneError::of_file(
            path,
            "no triangles; a mesh is expected",
        ));
    }
    Ok(model(positions, Notes::default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[[f32; 3]; 3]; 4] = {
        let [o, x, y, z] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        [[o, y, x], [o, x, z], [o, z, y], [x, y, z]]
    };

    fn binary(header: &[u8], attributes: [u16; 4]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend(4_u32.to_le_bytes());
        for (triangle, attribute) in TETRAHEDRON.iter().zip(attributes) {
            bytes.extend([0; 12]);
            bytes.extend(
                triangle
                    .iter()
                    .flatten()
                    .flat_map(|part| part.to_le_bytes()),
            );
            bytes.extend(attribute.to_le_bytes());
        }
        bytes
    }

    fn read_it(bytes: &[u8]) -> Result<RawModel, String> {
        read(Path::new("a.stl"), bytes).map_err(|error| error.to_string())
    }

    #[test]
    fn text_and_bytes_are_told_apart_and_give_the_same() {
        let mut text = String::from("solid a facet\n");
        for triangle in TETRAHEDRON {
            text += " FACET NORMAL nan 0 0\n  outer loop\n";
            for [x, y, z] in triangle {
                text += &format!("   vertex {x} {y:e} {z}\n");
            }
            text += "  endloop\n endfacet\n";
        }
        text += "endsolid\n";
        let expected: Vec<Vec3> = TETRAHEDRON
            .iter()
            .flatten()
            .map(|&place| place.into())
            .collect();
        for bytes in [
            text.clone().into_bytes(),
            text.replace('\n', "\r").into_bytes(),
            binary(b"solid facet of bytes", [0; 4]),
            binary(b"", [0; 4]),
        ] {
            let model = read_it(&bytes).unwrap();
            assert_eq!(model.positions, expected);
            assert_eq!(model.triangles.len(), 4);
            assert!(model.looks.corners.is_empty() && model.notes.told().is_empty());
        }
        let cut_off = &text[..text.rfind("vertex").unwrap()];
        let message = read_it(cut_off.as_bytes()).unwrap_err();
        assert!(
            message.starts_with("a.stl:26:1: the file ends within a triangle"),
            "{message}"
        );
        let message = read_it(text.replace("vertex 0 1e0", "vertex 0 x").as_bytes()).unwrap_err();
        assert!(message.contains("a.stl:5:4: vertex: no place"), "{message}");
    }

    #[test]
    fn colors_of_both_programs_are_read() {
        let red_first = 31 | 15 << 5;
        let colors = |bytes: &[u8]| -> Vec<[f32; 3]> {
            let looks = read_it(bytes).unwrap().looks;
            let corners = looks.corners.iter();
            corners
                .map(|corner| looks.looks[corner[0] as usize].color.truncate().to_array())
                .collect()
        };
        let grey = linear_colors(vec![[15.0 / 31.0; 3]]).0[0].x;
        let materialise = colors(&binary(
            b"COLOR=\x00\xff\x00\xff",
            [red_first, 0x8000, 0x8000, 0],
        ));
        let expected = [[1.0, grey, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];
        assert_eq!(materialise, expected);
        let viscam = colors(&binary(b"", [0x8000 | red_first, 0, 0x8000, red_first]));
        assert_eq!(viscam, [[0.0, grey, 1.0], [1.0; 3], [0.0; 3], [1.0; 3]]);
    }

    #[test]
    fn a_header_that_lies_is_a_mistake() {
        let whole = binary(b"", [0; 4]);
        let message = read_it(&whole[..whole.len() - 1]).unwrap_err();
        assert!(
            message.contains("byte 80: the header counts 4 triangles, and the file has 3"),
            "{message}"
        );
        let mut huge = whole[..whole.len() - 1].to_vec();
        huge[80..84].fill(0xff);
        assert!(
            read_it(&huge)
                .unwrap_err()
                .contains("counts 4294967295 triangles")
        );
        // Of whole triangles the file's number holds: who writes them as they come knows it last.
        for count in [0, 5, u32::MAX] {
            let mut unknown = whole.clone();
            unknown[80..84].copy_from_slice(&count.to_le_bytes());
            let model = read_it(&unknown).unwrap();
            assert_eq!(model.triangles.len(), 4);
            let expected = format!(
                "a.stl: byte 80: the header counts {count} triangles; the file's 4 are taken"
            );
            assert_eq!(model.notes.told(), [expected]);
        }
        assert!(read_it(&[0; 84]).unwrap_err().contains("no triangles"));
        assert!(
            read_it(&[0; 20])
                .unwrap_err()
                .contains("20 bytes are too few")
        );
        let longer = [whole.as_slice(), b"tail"].concat();
        assert_eq!(
            read_it(&longer).unwrap().notes.told(),
            ["a.stl: 4 bytes behind the last triangle: not used"]
        );
        let mut broken = whole;
        broken[84 + 50 + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(
            read_it(&broken)
                .unwrap_err()
                .contains("byte 146: triangle 1 has a vertex")
        );
    }
}
