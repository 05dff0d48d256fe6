//! An OBJ file's faces as triangles with materials.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use super::libraries::Libraries;
use super::text::without_comment;
use super::{Corner, FARTHEST, Face, NONE, Reader};
use crate::geometry::mesh::{CornerLook, RawLooks, RawTriangle};
use crate::geometry::polygon::PolygonCutter;
use crate::scene::error::SceneError;
use crate::scene::raw_model::{GivenMaterial, NO_COORDINATES, RawModel};
use crate::scene::vertex_colors::{ABOVE_ONE, linear_colors};

impl Reader<'_> {
    /// What the whole file has.
    pub(super) fn model(mut self, libraries: &Libraries) -> Result<RawModel, SceneError> {
        self.check_vertices()?;
        let has_colors = !self.colors.is_empty();
        let material_of_use = self.materials(libraries, has_colors);
        let faces = std::mem::take(&mut self.faces);
        let mut looks = Looks::new(&mut self);
        let mut model = RawModel {
            materials: material_of_use.materials,
            textures: libraries.textures.clone(),
            ..RawModel::default()
        };
        let (mut cutter, mut places, mut cut) = (PolygonCutter::default(), Vec::new(), Vec::new());
        let (mut lost_normals, mut lost_places) = (None, None);
        for face in &faces {
            let corners = self.corners_of(face);
            let material = material_of_use.of_use[&face.material_use];
            places.clear();
            places.extend(
                corners
                    .iter()
                    .map(|corner| self.positions[corner.vertex as usize]),
            );
            cut.clear();
            cutter.triangles(&places, &mut cut);
            let asks_in_vain =
                |corner: &Corner| corner.normal != NONE && self.normal(*corner).is_none();
            if lost_normals.is_none() && corners.iter().any(asks_in_vain) {
                lost_normals = Some(face.at as usize);
            }
            let sole_place = Looks::sole_place(looks.as_ref(), corners);
            let mut maps = model.materials[material as usize].material.maps.used();
            if lost_places.is_none() && sole_place.is_some() && maps.next().is_some() {
                lost_places = Some(face.at as usize);
            }
            for triangle in &cut {
                let mut corners = triangle.map(|corner| corners[corner as usize]);
                if let Some(place) = sole_place {
                    (corners.iter_mut()).for_each(|corner| corner.texture_place = place);
                }
                model.triangles.push(RawTriangle {
                    vertices: corners.map(|corner| corner.vertex),
                    normals: corners.map(|corner| self.normal(corner)),
                    material,
                });
                if let Some(looks) = &mut looks {
                    looks.add(corners);
                }
            }
        }
        if let Some(at) = lost_normals {
            let message = "vn: normals that are not there or no directions are made anew";
            self.notes.add_at(self.path, self.text, at, message);
        }
        if let Some(at) = lost_places {
            let message = format!("vt: {NO_COORDINATES}");
            self.notes.add_at(self.path, self.text, at, message);
        }
        model.looks = looks.map(|looks| looks.looks).unwrap_or_default();
        model.positions = self.positions;
        model.notes = self.notes;
        Ok(model)
    }

    fn corners_of(&self, face: &Face) -> &[Corner] {
        &self.corners[face.first_corner as usize..][..face.corners as usize]
    }

    /// What a corner names has to be there and a place.
    fn check_vertices(&self) -> Result<(), SceneError> {
        let known = self.positions.len();
        for face in &self.faces {
            for (index, corner) in self.corners_of(face).iter().enumerate() {
                let line = |at: usize| {
                    let rest = self.text.get(at..).unwrap_or_default();
                    rest.lines().next().unwrap_or_default()
                };
                if corner.vertex as usize >= known {
                    let at = face.at as usize;
                    let number = u64::from(corner.vertex) + 1;
                    let message =
                        format!("f: vertex {number} does not exist; the file has {known}");
                    // A face that goes on in the next line has its later corners there.
                    let record = line(at);
                    let word = record.split_whitespace().nth(index + 1).unwrap_or(record);
                    let at = word.as_ptr() as usize - self.text.as_ptr() as usize;
                    return Err(self.error_at(at, word.len(), message));
                }
                if let Some(&at) = self.nowhere.get(&corner.vertex) {
                    let message = format!(
                        "v: no place, and a face needs it; allowed: three finite numbers up to {FARTHEST} in size"
                    );
                    return Err(self.error_at(at, line(at).len(), message));
                }
            }
        }
        Ok(())
    }

    /// `None` for what is made anew.
    fn normal(&self, corner: Corner) -> Option<Vec3> {
        let normal = self.normals.get(corner.normal as usize)?;
        (normal.is_finite() && *normal != Vec3::ZERO).then_some(*normal)
    }

    /// The materials that faces use, each once, and which of them each use means.
    fn materials(&mut self, libraries: &Libraries, has_colors: bool) -> UsedMaterials {
        let mut used = UsedMaterials::default();
        let mut index_of: BTreeMap<Option<usize>, u32> = BTreeMap::new();
        let sole = self.sole_material(libraries);
        for face in &self.faces {
            let material_use = face.material_use;
            if used.of_use.contains_key(&material_use) {
                continue;
            }
            let named = (material_use as usize)
                .checked_sub(1)
                .and_then(|index| self.uses.get(index))
                .filter(|(name, _)| !name.is_empty());
            let found = match named {
                Some((name, _)) => libraries.find(name),
                None => sole,
            };
            if let (Some((name, at)), None) = (named, found) {
                let message = match libraries.are_there() {
                    true => format!(
                        "usemtl: no material \"{}\" in {}; it is grey",
                        without_comment(name),
                        libraries.told()
                    ),
                    false => "usemtl: there are no materials; it is grey".to_owned(),
                };
                self.notes.add_at(self.path, self.text, *at, message);
            }
            let next = used.materials.len() as u32;
            let index = *index_of.entry(found).or_insert(next);
            if index == next {
                used.materials.push(match found {
                    Some(found) => libraries.materials[found].clone(),
                    None => GivenMaterial::unknown(has_colors),
                });
            }
            used.of_use.insert(material_use, index);
        }
        used
    }

    /// What faces are made of where the file has libraries and no `usemtl`: of their material, if there is one alone, as programs
    /// for scans mean it. What becomes of the libraries is told.
    fn sole_material(&mut self, libraries: &Libraries) -> Option<usize> {
        let at = self.libraries.first().map(|(_, at)| *at)?;
        if !self.uses.is_empty() {
            return None;
        }
        let (sole, message) = match libraries.materials.as_slice() {
            [] => return None,
            [sole] => {
                let message = format!("there is no usemtl: all is of \"{}\"", sole.name);
                (Some(0), message)
            }
            several => {
                let (count, files) = (several.len(), libraries.told());
                let message = format!(
                    "there is no usemtl: which of the {count} materials in {files} is meant? it is grey"
                );
                (None, message)
            }
        };
        self.notes.add_at(self.path, self.text, at, message);
        sole
    }
}

#[derive(Default)]
struct UsedMaterials {
    materials: Vec<GivenMaterial>,
    of_use: HashMap<u32, u32>,
}

/// Looks of corners, each once.
struct Looks {
    looks: RawLooks,
    index_of: HashMap<(u32, u32), u32>,
    texture_places: Vec<glam::Vec2>,
    /// Linear, of the first vertices.
    colors: Vec<Vec3>,
}

impl Looks {
    /// `None` where the file has neither texture coordinates nor colours.
    fn new(reader: &mut Reader) -> Option<Self> {
        if reader.colors.is_empty() && reader.texture_places.is_empty() {
            return None;
        }
        let (colors, is_of_bytes) = linear_colors(std::mem::take(&mut reader.colors));
        if is_of_bytes {
            reader.notes.add_of(reader.path, ABOVE_ONE);
        }
        Some(Self {
            looks: RawLooks::default(),
            index_of: HashMap::new(),
            texture_places: std::mem::take(&mut reader.texture_places),
            colors,
        })
    }

    /// The one texture place that all corners of a face get where one of them has none: a picture between a place and none
    /// would be torn. `None`: each has its own.
    fn sole_place(looks: Option<&Self>, corners: &[Corner]) -> Option<u32> {
        let has_place = |corner: &&Corner| {
            let places = looks.map_or(&[][..], |looks| &looks.texture_places);
            let place = places.get(corner.texture_place as usize);
            place.is_some_and(|place| place.is_finite())
        };
        if corners.iter().all(|corner| has_place(&corner)) {
            return None;
        }
        let first = corners.iter().find(has_place);
        Some(first.map_or(NONE, |corner| corner.texture_place))
    }

    fn add(&mut self, corners: [Corner; 3]) {
        let corners = corners.map(|corner| {
            let vertex = match (corner.vertex as usize) < self.colors.len() {
                true => corner.vertex,
                false => NONE,
            };
            let looks = &mut self.looks.looks;
            *self
                .index_of
                .entry((corner.texture_place, vertex))
                .or_insert_with(|| {
                    let mut look = CornerLook::default();
                    if let Some(place) = self.texture_places.get(corner.texture_place as usize) {
                        // The file's v grows upwards.
                        look.uv = [glam::Vec2::new(place.x, 1.0 - place.y); 2];
                    }
                    if let Some(color) = self.colors.get(vertex as usize) {
                        look.color = color.extend(1.0);
                    }
                    looks.push(look);
                    looks.len() as u32 - 1
                })
        });
        self.looks.corners.push(corners);
    }
}
