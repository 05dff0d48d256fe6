//! PLY files (Turk 1994): text and bytes of both orders, with colours and texture coordinates, polygons and strips. What is
//! read here says where a file is broken and never takes a count for granted, which no crate in use does.

mod body;
mod header;

use std::path::Path;

use glam::{Vec2, Vec3};

use super::error::{SceneError, TextPlace};
use super::notes::Notes;
use super::obj::FARTHEST;
use super::obj::files::named_file;
use super::raw_model::{GivenMaterial, NO_COORDINATES, RawModel, WithoutSurface};
use super::vertex_colors::{ABOVE_ONE, linear_colors};
use crate::geometry::mesh::{CornerLook, RawLooks, RawTriangle};
use crate::geometry::polygon::PolygonCutter;
use body::Body;
use header::{Element, Format, Header, Kind};

/// What is wrong, and the line of the text if it is one.
#[derive(Debug)]
pub struct PlyError {
    line: Option<usize>,
    message: String,
}

/// A polygon of so many corners is no polygon.
const MOST_CORNERS: usize = 1_000_000;

/// Whether bytes are a PLY file.
pub fn is_ply(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") || bytes.starts_with(b"ply ")
}

/// The pictures that a file names, each with its line; the material of that number is of it.
pub type NamedPictures = Vec<(String, usize)>;

/// Reads it. Colours are taken as sRGB has them. The pictures that it names are left to the caller.
///
/// # Errors
/// A head that cannot be read or counts what is not there; a vertex that a face needs and that is no place; no faces.
pub fn read(path: &Path, bytes: &[u8]) -> Result<(RawModel, NamedPictures), SceneError> {
    let header = header::read(bytes);
    let read = header.and_then(|header| {
        let model = Reader::default().model(path, bytes, &header)?;
        Ok((model, header.textures))
    });
    read.map_err(|PlyError { line, message }| {
        let mut error = SceneError::of_file(path, message);
        error.place = line.map(|line| TextPlace {
            line,
            column: 1,
            width: 1,
            text: line_text(bytes, line),
        });
        error
    })
}

/// A PLY file's bytes with the names that `name_of` gives to the pictures that it names, if they are there. `mesh` is where the
/// file lies.
///
/// # Errors
/// What `name_of` fails with.
pub fn with_pictures_named<E>(
    mesh: &Path,
    bytes: &[u8],
    mut name_of: impl FnMut(&Path) -> Result<String, E>,
) -> Result<Vec<u8>, E> {
    let folder = mesh.parent().unwrap_or(Path::new(""));
    let Ok(header) = header::read(bytes) else {
        return Ok(bytes.to_vec());
    };
    let (mut named, mut done) = (Vec::with_capacity(bytes.len()), 0);
    for (name, _) in header.textures {
        let written = format!("TextureFile {name}").into_bytes();
        let mut parts = bytes[done..header.body].windows(written.len());
        let Some(at) = parts.position(|part| part == written) else {
            continue;
        };
        named.extend(&bytes[done..done + at]);
        done += at + written.len();
        match named_file(folder, &name) {
            Some(picture) => {
                named.extend(format!("TextureFile {}", name_of(&picture)?).into_bytes());
            }
            None => named.extend(written),
        }
    }
    named.extend(&bytes[done..]);
    Ok(named)
}

fn line_text(bytes: &[u8], line: usize) -> String {
    let lines = bytes.split(|byte| matches!(byte, b'\n' | b'\r'));
    let written = lines
        .filter(|line| !line.is_empty())
        .nth(line.saturating_sub(1));
    let written = written.unwrap_or_default();
    String::from_utf8_lossy(&written[..written.len().min(160)]).into_owned()
}

#[derive(Default)]
struct Reader {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// As [`linear_colors`] takes them.
    colors: Vec<[f32; 3]>,
    texture_places: Vec<Vec2>,
    /// Corners of all polygons, one after the other, as the file has them.
    corners: Vec<u32>,
    /// How many corners each polygon has.
    counts: Vec<u32>,
    /// Texture coordinates of each of the corners, where the file has them there.
    corner_texture_places: Vec<Vec2>,
    /// The colour of each of the polygons, where the file has them there.
    face_colors: Vec<[f32; 3]>,
    /// The number of each polygon's picture, where the file has it there.
    face_pictures: Vec<f64>,
    /// Faces of fewer than three corners.
    skipped: usize,
    has_lines: bool,
    notes: Notes,
}

impl Reader {
    fn model(mut self, path: &Path, bytes: &[u8], header: &Header) -> Result<RawModel, PlyError> {
        for message in &header.passed_over {
            self.notes.add_of(path, message);
        }
        let mut body = Body::new(bytes, header.body, header.format);
        for element in &header.elements {
            let least = element.least_bytes(header.format) as u64;
            // The last number of a text needs no space behind it.
            let room = (body.left() as u64 + 1) / least.max(1);
            if element.count > room && least > 0 {
                return Err(PlyError {
                    line: Some(element.line),
                    message: format!(
                        "element {}: the head counts {}, and the file has room for {room}",
                        element.name, element.count
                    ),
                });
            }
            match element.name.as_str() {
                _ if element.properties.is_empty() => {}
                "vertex" => self.add_vertices(&mut body, element)?,
                "face" => self.add_faces(&mut body, element)?,
                "tristrips" => self.add_strips(&mut body, element)?,
                name => {
                    self.has_lines |= name == "edge" && element.count > 0;
                    if element.count > 0 {
                        let message = format!("element {name}: not used");
                        self.notes.add_of(path, message);
                    }
                    pass_over(&mut body, element)?;
                }
            }
        }
        if header.format != Format::Text && body.left() > 0 {
            let message = format!("{} bytes behind the last element: not used", body.left());
            self.notes.add_of(path, message);
        }
        if self.skipped > 0 {
            let message = format!(
                "faces of fewer than three corners: {} left out",
                self.skipped
            );
            self.notes.add_of(path, message);
        }
        self.finish(path, header)
    }

    fn add_vertices(&mut self, body: &mut Body, element: &Element) -> Result<(), PlyError> {
        let index = |names: &[&str]| element.index(names);
        let [x, y, z] = ["x", "y", "z"].map(|name| index(&[name]));
        let (Some(x), Some(y), Some(z)) = (x, y, z) else {
            return Err(PlyError {
                line: Some(element.line),
                message: "element vertex: x, y and z are expected".to_owned(),
            });
        };
        let normal = all([index(&["nx"]), index(&["ny"]), index(&["nz"])]);
        let color = color_of(element);
        let texture_place = all([
            index(&["u", "s", "texture_u", "texture_s"]),
            index(&["v", "t", "texture_v", "texture_t"]),
        ]);
        let mut numbers = Vec::new();
        for _ in 0..element.count {
            row(body, element, &mut numbers, |_, _| Ok(()))?;
            let at = |index: usize| numbers[index] as f32;
            self.positions.push(Vec3::new(at(x), at(y), at(z)));
            if let Some(normal) = normal {
                self.normals.push(Vec3::from_array(normal.map(at)));
            }
            if let Some(color) = color {
                self.colors.push(written_color(color, element, &numbers));
            }
            if let Some(place) = texture_place {
                self.texture_places.push(Vec2::from_array(place.map(at)));
            }
        }
        Ok(())
    }

    fn add_faces(&mut self, body: &mut Body, element: &Element) -> Result<(), PlyError> {
        let corners = element.index(&["vertex_indices", "vertex_index"]);
        let texture_places = element.index(&["texcoord"]);
        let (color, picture) = (color_of(element), element.index(&["texnumber"]));
        let (mut numbers, mut written, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..element.count {
            written.clear();
            places.clear();
            row(body, element, &mut numbers, |index, number| {
                if Some(index) == corners {
                    written.push(number);
                } else if Some(index) == texture_places {
                    places.push(number);
                }
                Ok(())
            })?;
            if written.len() < 3 {
                self.skipped += 1;
                continue;
            }
            if written.len() > MOST_CORNERS {
                return Err(body.error(format!("a face of {} corners", written.len())));
            }
            for corner in &written {
                self.corners.push(index_of(*corner, body)?);
            }
            self.counts.push(written.len() as u32);
            if texture_places.is_some() {
                let at = |index: usize| places.get(index).copied().unwrap_or(0.0) as f32;
                let all =
                    (0..written.len()).map(|corner| Vec2::new(at(2 * corner), at(2 * corner + 1)));
                self.corner_texture_places.extend(all);
            }
            if let Some(color) = color {
                self.face_colors
                    .push(written_color(color, element, &numbers));
            }
            if let Some(picture) = picture {
                self.face_pictures.push(numbers[picture]);
            }
        }
        Ok(())
    }

    /// Each is a list in which -1 ends a strip; every second triangle of one is turned round.
    fn add_strips(&mut self, body: &mut Body, element: &Element) -> Result<(), PlyError> {
        let corners = element.index(&["vertex_indices", "vertex_index"]);
        let (mut numbers, mut written) = (Vec::new(), Vec::new());
        for _ in 0..element.count {
            written.clear();
            row(body, element, &mut numbers, |index, number| {
                if Some(index) == corners {
                    written.push(number);
                }
                Ok(())
            })?;
            for strip in written.split(|index| *index < 0.0) {
                for (number, triangle) in strip.windows(3).enumerate() {
                    let [a, b, c] = [triangle[0], triangle[1], triangle[2]];
                    let [b, c] = if number % 2 == 1 { [c, b] } else { [b, c] };
                    for corner in [a, b, c] {
                        self.corners.push(index_of(corner, body)?);
                    }
                    self.counts.push(3);
                }
            }
        }
        Ok(())
    }

    fn finish(self, path: &Path, header: &Header) -> Result<RawModel, PlyError> {
        let error = |message: String| PlyError {
            line: None,
            message,
        };
        if self.counts.is_empty() {
            let kinds = WithoutSurface {
                points: !self.positions.is_empty() && !self.has_lines,
                lines: self.has_lines,
            };
            return Err(error(format!(
                "no faces{}; a mesh is expected",
                kinds.told()
            )));
        }
        for &corner in &self.corners {
            let known = self.positions.len();
            let position = self.positions.get(corner as usize);
            let position = position.ok_or_else(|| {
                error(format!(
                    "a face names vertex {corner}; the file has {known}"
                ))
            })?;
            let is_place = |part: f32| f64::from(part.abs()) <= FARTHEST;
            if !position.to_array().into_iter().all(is_place) {
                return Err(error(format!(
                    "vertex {corner} is at {position}, which is no place; allowed: up to {FARTHEST} in size"
                )));
            }
        }
        Ok(self.triangles(path, header.textures.len()))
    }

    /// The model, given how many pictures there are: each of them has a material, and one behind them is of none.
    fn triangles(mut self, path: &Path, pictures: usize) -> RawModel {
        let colors = self.linear_colors(path);
        let has_colors = !colors.of_vertices.is_empty() || !colors.of_faces.is_empty();
        let has_looks =
            has_colors || !self.texture_places.is_empty() || !self.corner_texture_places.is_empty();
        let mut model = RawModel {
            materials: vec![GivenMaterial::unknown(has_colors); pictures.max(1)],
            ..RawModel::default()
        };
        let (mut cutter, mut cut) = (PolygonCutter::default(), Vec::new());
        let (mut places, mut first) = (Vec::new(), 0);
        let (mut without_picture, mut without_place) = (0, 0);
        for (face, &count) in self.counts.iter().enumerate() {
            let corners = &self.corners[first..first + count as usize];
            places.clear();
            places.extend(
                corners
                    .iter()
                    .map(|corner| self.positions[*corner as usize]),
            );
            cut.clear();
            cutter.triangles(&places, &mut cut);
            let material = self.material_of(face, pictures);
            without_picture += usize::from(material as usize == model.materials.len());
            // A picture between a place and none would be torn.
            let of_corners = || (first..first + count as usize).map(|it| self.texture_place(it));
            let sole_place = of_corners()
                .any(|place| place.is_none())
                .then(|| of_corners().flatten().next().unwrap_or_default());
            without_place += usize::from(sole_place.is_some() && (material as usize) < pictures);
            for triangle in &cut {
                let vertices = triangle.map(|corner| corners[corner as usize]);
                model.triangles.push(RawTriangle {
                    vertices,
                    normals: vertices.map(|vertex| self.normal(vertex)),
                    material,
                });
                if has_looks {
                    let looks = triangle.map(|corner| {
                        let corner = first + corner as usize;
                        let place = sole_place.or_else(|| self.texture_place(corner));
                        let color = colors.of(face, self.corners[corner]);
                        model.looks.looks.push(look(place, color));
                        model.looks.looks.len() as u32 - 1
                    });
                    model.looks.corners.push(looks);
                }
            }
            first += count as usize;
        }
        if without_picture > 0 {
            model.materials.push(GivenMaterial::unknown(has_colors));
            let message =
                format!("texnumber: {without_picture} faces are of no picture that is named");
            self.notes.add_of(path, message);
        }
        if without_place > 0 {
            self.notes.add_of(path, NO_COORDINATES);
        }
        model.looks = merged(model.looks);
        model.positions = self.positions;
        model.notes = self.notes;
        model
    }

    fn linear_colors(&mut self, path: &Path) -> Colors {
        let (of_vertices, vertices_of_bytes) = linear_colors(std::mem::take(&mut self.colors));
        let (of_faces, faces_of_bytes) = linear_colors(std::mem::take(&mut self.face_colors));
        if vertices_of_bytes || faces_of_bytes {
            self.notes.add_of(path, ABOVE_ONE);
        }
        Colors {
            of_vertices,
            of_faces,
        }
    }

    /// The number of a face's material: that of its picture, the first where nothing says which.
    fn material_of(&self, face: usize, pictures: usize) -> u32 {
        match self.face_pictures.get(face).filter(|_| pictures > 0) {
            Some(number) if (0.0..pictures as f64).contains(number) => *number as u32,
            Some(_) => pictures as u32,
            None => 0,
        }
    }

    fn normal(&self, vertex: u32) -> Option<Vec3> {
        let normal = self.normals.get(vertex as usize)?;
        (normal.is_finite() && *normal != Vec3::ZERO).then_some(*normal)
    }

    /// Where a corner is in its picture, if the file says it.
    fn texture_place(&self, corner: usize) -> Option<Vec2> {
        let vertex = self.corners[corner] as usize;
        let place = self.corner_texture_places.get(corner);
        let place = place.or_else(|| self.texture_places.get(vertex));
        place.copied().filter(|place| place.is_finite())
    }
}

/// Linear colours, where the file has some.
struct Colors {
    of_vertices: Vec<Vec3>,
    of_faces: Vec<Vec3>,
}

impl Colors {
    fn of(&self, face: usize, vertex: u32) -> Vec3 {
        let color = self.of_vertices.get(vertex as usize);
        let color = color.or_else(|| self.of_faces.get(face));
        color.copied().unwrap_or(Vec3::ONE)
    }
}

fn look(place: Option<Vec2>, color: Vec3) -> CornerLook {
    CornerLook {
        // The file's v grows upwards.
        uv: [place.map_or(Vec2::ZERO, |place| Vec2::new(place.x, 1.0 - place.y)); 2],
        color: color.extend(1.0),
        ..CornerLook::default()
    }
}

/// The same looks, each once.
fn merged(looks: RawLooks) -> RawLooks {
    let mut index_of = std::collections::HashMap::new();
    let mut merged = RawLooks::default();
    let mut new_index = Vec::with_capacity(looks.looks.len());
    for look in looks.looks {
        let key = (
            look.uv[0].to_array().map(f32::to_bits),
            look.color.to_array().map(f32::to_bits),
        );
        let next = merged.looks.len() as u32;
        let index = *index_of.entry(key).or_insert(next);
        if index == next {
            merged.looks.push(look);
        }
        new_index.push(index);
    }
    let corners = looks.corners.into_iter();
    merged.corners = corners
        .map(|corners| corners.map(|corner| new_index[corner as usize]))
        .collect();
    merged
}

fn all<const N: usize>(indices: [Option<usize>; N]) -> Option<[usize; N]> {
    let found: Vec<usize> = indices.into_iter().flatten().collect();
    found.try_into().ok()
}

/// The properties of a colour. Its opacity is passed over, as other programs do: scanners write their confidence there.
fn color_of(element: &Element) -> Option<[usize; 3]> {
    let names = [
        ["red", "r", "diffuse_red"],
        ["green", "g", "diffuse_green"],
        ["blue", "b", "diffuse_blue"],
    ];
    all(names.map(|names| element.index(&names)))
}

/// A colour: whole numbers in [0, 1], those with a point as they are written. What is none is white.
fn written_color(color: [usize; 3], element: &Element, numbers: &[f64]) -> [f32; 3] {
    color.map(|index| {
        let white = match element.properties[index].kind {
            Kind::One(scalar) => scalar.white(),
            Kind::List { .. } => 1.0,
        };
        let part = (numbers[index] / white) as f32;
        if part.is_finite() { part } else { 1.0 }
    })
}

fn index_of(number: f64, body: &Body) -> Result<u32, PlyError> {
    match number >= 0.0 && number < f64::from(u32::MAX) && number.fract() == 0.0 {
        true => Ok(number as u32),
        false => Err(body.error(format!("{number} is no vertex"))),
    }
}

/// The numbers of one element, 0 for lists, whose items are given away one by one.
fn row(
    body: &mut Body,
    element: &Element,
    numbers: &mut Vec<f64>,
    mut item: impl FnMut(usize, f64) -> Result<(), PlyError>,
) -> Result<(), PlyError> {
    numbers.clear();
    numbers.resize(element.properties.len(), 0.0);
    for (index, property) in element.properties.iter().enumerate() {
        match property.kind {
            Kind::One(scalar) => numbers[index] = body.next(scalar)?,
            Kind::List {
                count,
                item: scalar,
            } => {
                let count = body.next(count)?;
                if !(count >= 0.0 && count.fract() == 0.0) || count > body.left() as f64 {
                    return Err(body.error(format!("{count} is no length of a list")));
                }
                for _ in 0..count as u64 {
                    item(index, body.next(scalar)?)?;
                }
            }
        }
    }
    Ok(())
}

fn pass_over(body: &mut Body, element: &Element) -> Result<(), PlyError> {
    let mut numbers = Vec::new();
    for _ in 0..element.count {
        row(body, element, &mut numbers, |_, _| Ok(()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
