//! Primitives of meshes as triangles in the scene's space, with all that their corners have.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3, Vec4};
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;
use gltf::{Primitive, Semantic};

use super::file::GltfFile;
use super::materials::material;
use super::nodes::Nodes;
use super::skins::{joints, morph_targets, turned_tangent};
use super::tangents::made_tangents;
use super::textures::Textures;
use crate::geometry::mesh::{CornerLook, RawLooks, RawTriangle, RigPoint};
use crate::geometry::rig::RigVertices;
use crate::geometry::rig::surface::{AlwaysTogether, Holding, MorphTarget, RigSurface};
use crate::scene::error::SceneError;
use crate::scene::raw_model::{GivenMaterial, WithoutSurface};

/// Corners that all primitives have together at most, where the file itself has no more bytes.
const MOST_CORNERS: usize = 12_000_000;

/// Triangles so far.
#[derive(Default)]
pub(super) struct Builder {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<RawTriangle>,
    pub looks: RawLooks,
    pub materials: Vec<GivenMaterial>,
    pub textures: Textures,
    /// By the file's number, and whether corners have colours.
    index_of_material: HashMap<(Option<usize>, bool), u32>,
    /// What primitives there are of points or lines, and how many.
    pub without_surface: (WithoutSurface, usize),
    /// Primitives whose pictures have no texture coordinates: the first, in words, and how many there are.
    without_coordinates: Option<(String, usize)>,
    /// Where the model is to move.
    pub moving: Option<Moving>,
}

/// What moves, and for each position which others it always goes with.
#[derive(Default)]
pub(super) struct Moving {
    pub surfaces: Vec<RigSurface>,
    pub together: Vec<u32>,
    /// Vertices of all surfaces.
    vertex_count: u32,
    numbers: AlwaysTogether,
}

/// What the vertices of a primitive have, in the mesh's space.
struct Vertices {
    positions: Vec<DVec3>,
    normals: Vec<Option<DVec3>>,
    looks: Vec<CornerLook>,
    has_colors: bool,
    has_tangents: bool,
}

impl Builder {
    /// Without triangles; `moves` tells whether they are to move.
    pub fn new(moves: bool) -> Self {
        Self {
            moving: moves.then(Moving::default),
            ..Self::default()
        }
    }

    /// Adds a mesh where its node or its skin has it.
    pub fn add(
        &mut self,
        file: &mut GltfFile<'_>,
        nodes: &Nodes<'_>,
        node: &gltf::Node<'_>,
        mesh: &gltf::Mesh<'_>,
        note_read: &dyn Fn(&Path),
    ) -> Result<(), SceneError> {
        for primitive in mesh.primitives() {
            let place = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
            let is_of_points = primitive.mode() == Mode::Points;
            let is_of_lines = matches!(
                primitive.mode(),
                Mode::Lines | Mode::LineLoop | Mode::LineStrip
            );
            if is_of_points || is_of_lines {
                let (kinds, count) = &mut self.without_surface;
                kinds.points |= is_of_points;
                kinds.lines |= is_of_lines;
                *count += 1;
                continue;
            }
            let vertices = vertices(file, &place, &primitive)?;
            let triangles = triangles(file, &place, &primitive, vertices.positions.len())?;
            let corners = self.positions.len()
                + vertices.positions.len()
                + 3 * (self.triangles.len() + triangles.len());
            if corners > MOST_CORNERS.max(file.bytes) {
                return Err(file.error(&place, format!("more than {MOST_CORNERS} corners in all")));
            }
            let material = self.material(file, &primitive, vertices.has_colors, note_read)?;
            self.look_for_coordinates(&place, &primitive, material);
            let held = (&place[..], &primitive, vertices.positions.len());
            let surface = RigSurface {
                holding: match node.skin() {
                    Some(skin) if primitive.get(&Semantic::Joints(0)).is_some() => {
                        Holding::Joints(joints(file, &skin, held)?)
                    }
                    _ => Holding::Node,
                },
                targets: self.morph_targets(file, (&place, &primitive), nodes, node.index())?,
                node: node.index(),
                positions: vertices.positions,
                normals: vertices.normals,
            };
            let placed = surface.placed(&nodes.at_rest);
            let looks = (vertices.looks, vertices.has_tangents);
            self.put(file, &place, (placed, looks), triangles, material)?;
            if let Some(moving) = &mut self.moving {
                moving.add(surface, self.positions.len());
            }
        }
        Ok(())
    }

    /// All of them where the model is to move, else those that count at rest.
    fn morph_targets(
        &self,
        file: &GltfFile<'_>,
        primitive: (&str, &Primitive<'_>),
        nodes: &Nodes<'_>,
        node: usize,
    ) -> Result<Vec<MorphTarget>, SceneError> {
        let weights = &nodes.at_rest.weights[node];
        morph_targets(file, primitive, |number| {
            let counts = weights.get(number).is_some_and(|weight| *weight != 0.0);
            counts || self.moving.is_some()
        })
    }

    /// Whether a primitive has the texture coordinates that its material's pictures lie by.
    fn look_for_coordinates(&mut self, place: &str, primitive: &Primitive<'_>, material: u32) {
        let maps = self.materials[material as usize].material.maps;
        let mut sets = maps.used().map(|(map, _)| map.uv_set);
        let missing = sets.find(|set| primitive.get(&Semantic::TexCoords(*set)).is_none());
        let Some(set) = missing else { return };
        let told = || format!("{place}: TEXCOORD_{set} is not there, and pictures lie by it");
        let (_, count) = self.without_coordinates.get_or_insert_with(|| (told(), 0));
        *count += 1;
    }

    /// Tells what has no surface, and what no picture can lie on.
    pub fn note_passed_over(&self, file: &mut GltfFile<'_>) {
        let (_, count) = self.without_surface;
        if count > 0 {
            file.note(format!(
                "primitives of points or lines, which have no surface, are passed over: {count}"
            ));
        }
        if let Some((first, count)) = &self.without_coordinates {
            let others = match count - 1 {
                0 => String::new(),
                others => format!(" (and {others} more such)"),
            };
            file.note(format!("{first}: each of them is of one colour{others}"));
        }
    }

    fn material(
        &mut self,
        file: &mut GltfFile<'_>,
        primitive: &Primitive<'_>,
        is_colored: bool,
        note_read: &dyn Fn(&Path),
    ) -> Result<u32, SceneError> {
        let given = primitive.material();
        let key = (given.index(), is_colored && given.index().is_none());
        if let Some(&index) = self.index_of_material.get(&key) {
            return Ok(index);
        }
        let read = material(file, &mut self.textures, &given, (is_colored, note_read))?;
        let index = self.materials.len() as u32;
        self.materials.push(read);
        self.index_of_material.insert(key, index);
        Ok(index)
    }

    /// Puts triangles into the scene's space.
    fn put(
        &mut self,
        file: &GltfFile<'_>,
        place: &str,
        (placed, (looks, has_tangents)): (RigVertices, (Vec<CornerLook>, bool)),
        triangles: Vec<[u32; 3]>,
        material: u32,
    ) -> Result<(), SceneError> {
        let first = self.positions.len() as u32;
        let normal_map = self.materials[material as usize].material.maps.normal;
        let held_from = self.moving.as_ref().map(|moving| moving.vertex_count);
        for (index, mut look) in looks.into_iter().enumerate() {
            let position = placed.positions[index].as_vec3();
            if !position.is_finite() {
                return Err(file.error(place, format!("POSITION {index} is placed at infinity")));
            }
            self.positions.push(position);
            look.tangent = turned_tangent(&placed.scene_from_mesh[index], look.tangent);
            if let Some(first) = held_from {
                look.held_by = RigPoint::at(first + index as u32);
            }
            self.looks.looks.push(look);
        }
        // What a mirror turns is turned back.
        let is_mirrored =
            |corners: &[u32; 3]| placed.scene_from_mesh[corners[0] as usize].determinant() < 0.0;
        let triangles: Vec<[u32; 3]> = triangles
            .into_iter()
            .map(|[a, b, c]| {
                if is_mirrored(&[a, b, c]) {
                    [a, c, b]
                } else {
                    [a, b, c]
                }
            })
            .collect();
        let given = |vertex: u32| placed.normals[vertex as usize].map(|normal| normal.as_vec3());
        let start = self.triangles.len();
        self.triangles
            .extend(triangles.iter().map(|corners| RawTriangle {
                vertices: corners.map(|corner| first + corner),
                normals: corners.map(given),
                material,
            }));
        self.looks.corners.extend(
            triangles
                .iter()
                .map(|corners| corners.map(|corner| first + corner)),
        );
        if let Some(map) = normal_map.filter(|_| !has_tangents) {
            self.make_tangents(first as usize, start, &triangles, map.uv_set as usize);
        }
        Ok(())
    }

    /// Gives the corners of the last triangles tangents by one of their texture coordinates.
    fn make_tangents(&mut self, first: usize, start: usize, triangles: &[[u32; 3]], uv_set: usize) {
        let positions = &self.positions[first..];
        let normals: Vec<[Vec3; 3]> = triangles
            .iter()
            .zip(&self.triangles[start..])
            .map(|(corners, raw)| {
                let [a, b, c] = corners.map(|corner| positions[corner as usize]);
                let face = (b - a).cross(c - a).normalize_or(Vec3::Z);
                raw.normals.map(|normal| normal.unwrap_or(face))
            })
            .collect();
        let uv: Vec<Vec2> = self.looks.looks[first..]
            .iter()
            .map(|look| look.uv[uv_set])
            .collect();
        let tangents = made_tangents(triangles, positions, &normals, &uv);
        let mut is_set = vec![false; uv.len()];
        for (corners, tangents) in self.looks.corners[start..].iter_mut().zip(tangents) {
            for (index, tangent) in corners.iter_mut().zip(tangents) {
                let look = &mut self.looks.looks[*index as usize];
                let is_first = !std::mem::replace(&mut is_set[*index as usize - first], true);
                if is_first {
                    look.tangent = tangent;
                } else if look.tangent != tangent {
                    // Another one at the same vertex: a look of its own.
                    let own = CornerLook { tangent, ..*look };
                    *index = self.looks.looks.len() as u32;
                    self.looks.looks.push(own);
                    is_set.push(true);
                }
            }
        }
        // (Looks and positions go by the same numbers where the next primitive begins.)
        self.positions.resize(self.looks.looks.len(), Vec3::ZERO);
    }
}

impl Moving {
    /// Adds a surface whose positions were put; with those that tangents need there are `position_count` of them.
    fn add(&mut self, surface: RigSurface, position_count: usize) {
        self.together.extend(self.numbers.numbers(&surface));
        // (No triangle has the rest as its corner.)
        self.together.resize(position_count, u32::MAX);
        self.vertex_count += surface.positions.len() as u32;
        self.surfaces.push(surface);
    }
}

fn vertices(
    file: &mut GltfFile<'_>,
    place: &str,
    primitive: &Primitive<'_>,
) -> Result<Vertices, SceneError> {
    let of = |semantic: Semantic| primitive.get(&semantic);
    let named = |name: &str| format!("{place}.{name}");
    let Some(positions) = of(Semantic::Positions) else {
        return Err(file.error(place, "no POSITION"));
    };
    let vec3 = [Dimensions::Vec3];
    let positions: Vec<[f32; 3]> = file.floats(&named("POSITION"), &positions, &vec3, 0.0)?;
    let count = positions.len();
    let checked = |file: &GltfFile<'_>, name: &str, found: usize| match found < count {
        true => Err(file.error(
            &named(name),
            format!("{found} elements for {count} positions"),
        )),
        false => Ok(()),
    };
    let in_double = |vector: [f32; 3]| DVec3::from_array(vector.map(f64::from));
    let mut vertices = Vertices {
        positions: positions.into_iter().map(in_double).collect(),
        normals: vec![None; count],
        looks: vec![CornerLook::default(); count],
        has_colors: false,
        has_tangents: false,
    };
    if let Some(accessor) = of(Semantic::Normals) {
        let none = (0.0, [0.0; 3]);
        let normals = file.mended_floats::<3>(&named("NORMAL"), &accessor, &vec3, none)?;
        checked(file, "NORMAL", normals.len())?;
        let normals = normals.into_iter().map(|normal| Some(in_double(normal)));
        vertices.normals = normals.take(count).collect();
    }
    if let Some(accessor) = of(Semantic::Tangents) {
        let (vec4, none) = ([Dimensions::Vec4], (0.0, [0.0; 4]));
        let tangents = file.mended_floats::<4>(&named("TANGENT"), &accessor, &vec4, none)?;
        checked(file, "TANGENT", tangents.len())?;
        vertices.has_tangents = true;
        for (look, tangent) in vertices.looks.iter_mut().zip(tangents) {
            look.tangent = Vec4::from_array(tangent);
        }
    }
    for set in 0..2 {
        if let Some(accessor) = of(Semantic::TexCoords(set)) {
            let name = format!("TEXCOORD_{set}");
            let (vec2, none) = ([Dimensions::Vec2], (0.0, [0.0; 2]));
            let uv = file.mended_floats::<2>(&named(&name), &accessor, &vec2, none)?;
            checked(file, &name, uv.len())?;
            for (look, uv) in vertices.looks.iter_mut().zip(uv) {
                look.uv[set as usize] = Vec2::from_array(uv);
            }
        }
    }
    if let Some(accessor) = of(Semantic::Colors(0)) {
        let allowed = [Dimensions::Vec3, Dimensions::Vec4];
        let none = (1.0, [1.0; 4]);
        let colors = file.mended_floats::<4>(&named("COLOR_0"), &accessor, &allowed, none)?;
        checked(file, "COLOR_0", colors.len())?;
        vertices.has_colors = true;
        for (look, color) in vertices.looks.iter_mut().zip(colors) {
            look.color = Vec4::from_array(color).clamp(Vec4::ZERO, Vec4::ONE);
        }
    }
    Ok(vertices)
}

/// Strips and fans as triangles too, all indices in range.
fn triangles(
    file: &GltfFile<'_>,
    place: &str,
    primitive: &Primitive<'_>,
    count: usize,
) -> Result<Vec<[u32; 3]>, SceneError> {
    let indices: Vec<u32> = match primitive.indices() {
        Some(accessor) => {
            let indices =
                file.integers::<1>(&format!("{place}.indices"), &accessor, Dimensions::Scalar)?;
            indices.into_iter().map(|[index]| index).collect()
        }
        None => (0..count as u32).collect(),
    };
    if let Some(at) = indices.iter().position(|&index| index as usize >= count) {
        let message = format!("index {at} is {}, of {count} vertices", indices[at]);
        return Err(file.error(&format!("{place}.indices"), message));
    }
    let triangles: Vec<[u32; 3]> = match primitive.mode() {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(number, corners)| match number % 2 {
                0 => [corners[0], corners[1], corners[2]],
                _ => [corners[1], corners[0], corners[2]],
            })
            .collect(),
        Mode::TriangleFan => indices
            .get(1..)
            .unwrap_or_default()
            .windows(2)
            .map(|pair| [indices[0], pair[0], pair[1]])
            .collect(),
        _ => indices.as_chunks::<3>().0.to_vec(),
    };
    Ok(triangles)
}
