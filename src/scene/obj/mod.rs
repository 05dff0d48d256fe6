//! OBJ files as other programs read them: what does not matter refuses no mesh, and what is passed over is told.

pub mod files;
pub mod libraries;
mod material;
pub mod mtl;
pub mod text;
mod triangles;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::error::SceneError;
use super::mesh_format::MeshFormat;
use super::notes::Notes;
use super::raw_model::{RawModel, WithoutSurface};
use libraries::Libraries;
use text::{Record, number, records};

/// No index.
const NONE: u32 = u32::MAX;
/// A coordinate beyond this is none that single precision can do anything with.
pub const FARTHEST: f64 = 1e7;

/// Reads an OBJ file's bytes and the material libraries that it names; `path` is where it lies, and `note_read` is told of
/// every file that is looked for besides. Coordinates are as they are written.
///
/// # Errors
/// What cannot be meant: a face's corner that is none, or that names a vertex that is not there or no place; no faces; a
/// library that is there and cannot be read.
pub fn read(path: &Path, bytes: &[u8], note_read: &dyn Fn(&Path)) -> Result<RawModel, SceneError> {
    let text = text::decoded(bytes);
    if text.trim().is_empty() {
        return Err(SceneError::of_file(
            path,
            "the file is empty; a mesh is expected",
        ));
    }
    let mut reader = Reader::new(path, &text);
    for record in records(&text) {
        reader.add(&record)?;
    }
    if reader.faces.is_empty() {
        let mut without = reader.without_surface;
        without.points |= !reader.positions.is_empty() && !without.lines;
        let message = format!(
            "no faces{}; a mesh is expected: {} (OBJ with f records)",
            without.told(),
            MeshFormat::all_names()
        );
        return Err(SceneError::of_file(path, message));
    }
    if reader.colors.is_empty() {
        reader.colors = std::mem::take(&mut reader.polypaint);
        reader.colors.truncate(reader.positions.len());
    }
    let libraries = Libraries::read(path, &text, &reader.libraries, &mut reader.notes, note_read)?;
    reader.model(&libraries)
}

/// What has been read so far.
struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
    positions: Vec<Vec3>,
    /// Vertices that are no places, each with where its record begins.
    nowhere: BTreeMap<u32, usize>,
    /// Of the first vertices, as they are written; the rest have none.
    colors: Vec<[f32; 3]>,
    /// The same as ZBrush writes them, in comments.
    polypaint: Vec<[f32; 3]>,
    texture_places: Vec<Vec2>,
    /// NaN where the file gives none.
    normals: Vec<Vec3>,
    corners: Vec<Corner>,
    faces: Vec<Face>,
    without_surface: WithoutSurface,
    /// The records that choose a material: their names and where they are.
    uses: Vec<(String, usize)>,
    /// The index of the record that holds for the next face, one more than in `uses`.
    use_now: u32,
    /// What the mtllib records name, and where they are.
    libraries: Vec<(String, usize)>,
    notes: Notes,
}

/// Indices into what the whole file has, for it may come later.
#[derive(Debug, Clone, Copy)]
struct Corner {
    vertex: u32,
    texture_place: u32,
    normal: u32,
}

#[derive(Debug, Clone, Copy)]
struct Face {
    first_corner: u32,
    corners: u32,
    /// One more than an index into the uses; 0 before the first.
    material_use: u32,
    /// Where its record begins.
    at: u32,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, text: &'a str) -> Self {
        Self {
            path,
            text,
            positions: Vec::new(),
            nowhere: BTreeMap::new(),
            colors: Vec::new(),
            polypaint: Vec::new(),
            texture_places: Vec::new(),
            normals: Vec::new(),
            corners: Vec::new(),
            faces: Vec::new(),
            without_surface: WithoutSurface::default(),
            uses: Vec::new(),
            use_now: 0,
            libraries: Vec::new(),
            notes: Notes::default(),
        }
    }

    fn note(&mut self, record: &Record, message: impl Into<String>) {
        let start = record.at(record.line.trim_start());
        self.notes.add_at(self.path, self.text, start, message);
    }

    fn error_at(&self, start: usize, length: usize, message: String) -> SceneError {
        SceneError::at(self.path, self.text, start..start + length, message)
    }

    fn add(&mut self, record: &Record) -> Result<(), SceneError> {
        // (A few programs write capitals.)
        match record.keyword().to_ascii_lowercase().as_str() {
            "v" => self.add_vertex(record),
            "vt" => {
                let mut numbers = record.words().map(number);
                // (What is not there is 0, and what is no number is no place.)
                let mut next = || {
                    let written = numbers.next().unwrap_or(Some(0.0));
                    written.map_or(f32::NAN, |part| part as f32)
                };
                self.texture_places.push(Vec2::new(next(), next()));
            }
            "vn" => {
                let mut numbers = record.words().map(number);
                let mut next = || {
                    numbers
                        .next()
                        .flatten()
                        .map_or(f32::NAN, |part| part as f32)
                };
                self.normals.push(Vec3::new(next(), next(), next()));
            }
            "f" | "fo" => return self.add_face(record),
            "usemtl" => {
                let name = record.rest().to_owned();
                if name.is_empty() {
                    self.note(record, "usemtl: names no material");
                }
                let at = record.at(record.line.trim_start());
                self.uses.push((name, at));
                self.use_now = self.uses.len() as u32;
            }
            "mtllib" => {
                let at = record.at(record.line.trim_start());
                self.libraries.push((record.rest().to_owned(), at));
            }
            keyword @ ("l" | "p") => {
                self.without_surface.lines |= keyword == "l";
                self.without_surface.points |= keyword == "p";
                self.note(record, "lines and points have no surface: not used");
            }
            "curv" | "curv2" | "surf" | "cstype" => {
                self.note(record, "free-form curves and surfaces are not read");
            }
            "" => self.add_polypaint(record),
            _ => {}
        }
        Ok(())
    }

    /// ZBrush's comment of up to 64 vertices, each the mask, which is passed over, red, green and blue by two digits.
    fn add_polypaint(&mut self, record: &Record) {
        let Some(written) = record.line.trim().strip_prefix("#MRGB ") else {
            return;
        };
        let (entries, rest) = written.trim().as_bytes().as_chunks::<8>();
        let color = |entry: &[u8; 8]| {
            let bits = u32::from_str_radix(std::str::from_utf8(entry).ok()?, 16).ok()?;
            let [_, color @ ..] = bits.to_be_bytes();
            Some(color.map(|part| f32::from(part) / 255.0))
        };
        let colors: Option<Vec<[f32; 3]>> = entries.iter().map(color).collect();
        match colors.filter(|_| rest.is_empty()) {
            Some(colors) => self.polypaint.extend(colors),
            None => self.note(
                record,
                "#MRGB: not used; eight digits a vertex are expected",
            ),
        }
    }

    /// Three numbers; a weight or a colour behind them.
    fn add_vertex(&mut self, record: &Record) {
        let mut numbers = [f64::NAN; 7];
        let mut count = 0;
        for word in record.words() {
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number(word).unwrap_or(f64::NAN);
            }
            count += 1;
        }
        let [x, y, z, fourth, green, blue, _] = numbers;
        // (A weight of 0 is no place; those who write it mean nothing by it.)
        let weight = if count == 4 && fourth != 0.0 {
            fourth
        } else {
            1.0
        };
        let place = [x / weight, y / weight, z / weight];
        let index = self.positions.len() as u32;
        if !place.iter().all(|part| part.abs() <= FARTHEST) {
            self.nowhere.insert(index, record.start);
        }
        self.positions
            .push(Vec3::from_array(place.map(|part| part as f32)));
        // x y z r g b, and the opacity that some write behind.
        if count >= 6 {
            let color = [fourth, green, blue].map(|part| part as f32);
            if color.iter().all(|part| part.is_finite()) {
                self.colors.resize(index as usize, [1.0; 3]);
                self.colors.push(color);
            }
        }
    }

    fn add_face(&mut self, record: &Record) -> Result<(), SceneError> {
        let first = self.corners.len();
        for word in record.words() {
            let corner = self.corner(word).map_err(|message| {
                self.error_at(record.at(word), word.len(), format!("f: {message}"))
            })?;
            self.corners.push(corner);
        }
        let corners = self.corners.len() - first;
        if corners < 3 {
            self.corners.truncate(first);
            self.note(record, "f: a face of fewer than three corners is left out");
            return Ok(());
        }
        self.faces.push(Face {
            first_corner: first as u32,
            corners: corners as u32,
            material_use: self.use_now,
            at: record.start as u32,
        });
        Ok(())
    }

    /// A face's corner: `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let none = || format!("{word} is not a face's corner; allowed: v, v/vt, v//vn or v/vt/vn");
        let mut parts = word.split('/');
        let mut next = || -> Result<Option<i64>, String> {
            match parts.next() {
                None | Some("") => Ok(None),
                Some(part) => part.parse().map(Some).map_err(|_| none()),
            }
        };
        let (vertex, texture_place, normal) = (next()?, next()?, next()?);
        if parts.next().is_some() {
            return Err(none());
        }
        let vertex = vertex.ok_or_else(none)?;
        let known = self.positions.len();
        let absent =
            || format!("vertex {vertex} does not exist; {known} vertices are known by this line");
        Ok(Corner {
            vertex: index(vertex, known).ok_or_else(absent)?,
            texture_place: texture_place
                .and_then(|number| index(number, self.texture_places.len()))
                .unwrap_or(NONE),
            normal: normal
                .and_then(|number| index(number, self.normals.len()))
                .unwrap_or(NONE),
        })
    }
}

/// An index from 0: written ones count from 1, negative ones back from the newest of those that are known. Positive ones may
/// be beyond, for what they mean may come later.
fn index(number: i64, known: usize) -> Option<u32> {
    let from_start = match number {
        0 => return None,
        1.. => number - 1,
        _ => known as i64 + number,
    };
    let index = u32::try_from(from_start).ok()?;
    (index < NONE).then_some(index)
}
