//! A scene as the floors below take it: what reflects light, what hides it, and the room around.

use glam::{DVec3, DVec4, UVec2, Vec3};

use super::probe::BEYOND_M;
use super::{Object, ProbeScene, Scene, SplitLight};
use crate::geometry::bounds::Bounds;
use crate::geometry::mesh::{CornerLook, Mesh};
use crate::light::bounce::Reflector;
use crate::light::material::{Encoding, Map, Material};
use crate::light::mean_surface::{MeanSurface, PlacesOfSurface};
use crate::light::texture::Texture;
use crate::shafts::casters::Occluder;
use crate::shafts::patches::RoomTriangle;
use crate::shafts::placed_probe::PlacedProbe;
use crate::shafts::room::{Room, RoomOptions};

/// One place of a triangle is looked at for so many texels that it covers, in no more rows than these.
const TEXELS_A_PLACE: f32 = 16.0;
const MOST_ROWS: usize = 64;

/// Barycentric coordinates of the middles of the like triangles that a triangle is cut into by so many rows.
fn middles(rows: usize) -> impl Iterator<Item = [f32; 3]> {
    let place = move |a: usize, b: usize, third: f32| {
        let [a, b] = [a, b].map(|at| (at as f32 + third) / rows as f32);
        [a, b, 1.0 - a - b]
    };
    (0..rows).flat_map(move |a| {
        let upright = (0..rows - a).map(move |b| place(a, b, 1.0 / 3.0));
        let turned = (0..rows - a - 1).map(move |b| place(a, b, 2.0 / 3.0));
        upright.chain(turned)
    })
}

impl Object {
    /// The positions of its mesh, or of a coarser one, in its anchor's space.
    pub fn positions_in_anchor(&self, mesh: &Mesh) -> Vec<Vec3> {
        let place = |position: &Vec3| {
            self.anchor_from_object
                .transform_point3(position.as_dvec3())
                .as_vec3()
        };
        mesh.positions.iter().map(place).collect()
    }

    /// Its triangles as what light meets there, in its anchor's space.
    pub fn reflectors(&self) -> impl Iterator<Item = Reflector> {
        let mesh = &self.mesh;
        let positions = self.positions_in_anchor(mesh);
        mesh.triangles
            .iter()
            .enumerate()
            .map(move |(number, triangle)| Reflector {
                corners: triangle.map(|index| positions[index as usize]),
                albedo: self.albedo(number),
            })
    }

    /// It as it hides light.
    pub fn occluder(&self) -> Occluder<'_> {
        Occluder {
            mesh: &self.mesh,
            surfaces: self.mean_surfaces(),
            anchor: self.anchor,
            anchor_from_object: self.anchor_from_object,
            casts: self.casts,
            visible: self.visible,
            deforms: self.animation.is_some(),
        }
    }

    /// Whether what it reflects differs from place to place by more than its materials.
    pub fn is_pictured(&self) -> bool {
        let mut materials = self.materials.iter();
        let mut looks = self.mesh.looks.iter();
        !self.mesh.corner_looks.is_empty()
            && (materials.any(|material| material.maps.color.is_some())
                || looks.any(|look| look.color.truncate() != Vec3::ONE))
    }

    /// The part of light from everywhere that a triangle reflects on the average: of its material, with what its pictures have in
    /// its middle and halfway to its corners (at more places where it covers many texels), and its corners' colours.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn albedo(&self, triangle: usize) -> DVec3 {
        let mut places = PlacesOfSurface::default();
        for material in self.places(triangle) {
            places.add(&material, 1.0);
        }
        places.mean().map_or(DVec3::ZERO, |mean| mean.albedo)
    }

    /// What a triangle's material is at some places of it, which stand for like parts of it.
    fn places(&self, triangle: usize) -> impl Iterator<Item = Material> {
        let material = &self.materials[self.mesh.triangle_materials[triangle] as usize];
        let looks = self.mesh.corner_looks.get(triangle);
        let looks = looks.map(|looks| looks.map(|look| &self.mesh.looks[look as usize]));
        let plain = looks.is_none().then_some(*material);
        let pictured = looks.into_iter().flat_map(move |looks| {
            let places = middles(self.rows(material, looks));
            places.map(move |weights| self.pictured_at(material, looks, weights))
        });
        plain.into_iter().chain(pictured)
    }

    /// Into how many rows of like places a triangle whose corners look so is cut.
    fn rows(&self, material: &Material, looks: [&CornerLook; 3]) -> usize {
        let texels = self
            .pictured(material.maps.color)
            .map_or(0.0, |(map, texture)| {
                let [a, b, c] = looks.map(|look| {
                    let uv = look.uv[map.uv_set as usize & 1];
                    let place = map.picture_from_corner.transform_point2(uv);
                    place * UVec2::from_array(texture.size_px).as_vec2()
                });
                (b - a).perp_dot(c - a).abs() / 2.0
            });
        ((texels / TEXELS_A_PLACE).sqrt() as usize).clamp(2, MOST_ROWS)
    }

    /// A material with what its pictures show between corners that look so.
    fn pictured_at(
        &self,
        material: &Material,
        looks: [&CornerLook; 3],
        weights: [f32; 3],
    ) -> Material {
        let maps = &material.maps;
        let look = CornerLook::blended(looks, weights);
        let tint = self.texel(maps.color, &look, Encoding::Srgb) * look.color.as_dvec4();
        let rough = self.texel(maps.roughness, &look, Encoding::Linear).y;
        let metal = self.texel(maps.metallic, &look, Encoding::Linear).z;
        Material {
            albedo: material.albedo * tint.truncate(),
            roughness: material.roughness.map(|alpha| alpha * rough * rough),
            metallic: material.metallic * metal,
            ..*material
        }
    }

    /// What a picture of it has at a corner, or between corners, that looks so; 1 without a picture.
    pub fn texel(&self, map: Option<Map>, look: &CornerLook, encoding: Encoding) -> DVec4 {
        self.pictured(map).map_or(DVec4::ONE, |(map, texture)| {
            texture.sample(&map, look.uv[map.uv_set as usize & 1], encoding)
        })
    }

    fn pictured(&self, map: Option<Map>) -> Option<(Map, &Texture)> {
        let map = map?;
        Some((map, self.textures.get(map.texture as usize)?))
    }

    /// For each material what stands for its surface.
    fn mean_surfaces(&self) -> Vec<MeanSurface> {
        let mesh = &self.mesh;
        let mut places = vec![PlacesOfSurface::default(); self.materials.len()];
        // (What has no pictures is the same at all places.)
        let pictured = match mesh.looks.is_empty() {
            true => &[],
            false => mesh.triangles.as_slice(),
        };
        for (number, triangle) in pictured.iter().enumerate() {
            let [a, b, c] = triangle.map(|index| mesh.positions[index as usize].as_dvec3());
            let area = (b - a).cross(c - a).length();
            let of_material = &mut places[mesh.triangle_materials[number] as usize];
            let of_triangle: Vec<Material> = self.places(number).collect();
            for material in &of_triangle {
                of_material.add(material, area / of_triangle.len() as f64);
            }
        }
        let of_materials = places.iter().zip(&self.materials);
        of_materials
            .map(|(places, material)| places.mean().unwrap_or(MeanSurface::plain(material)))
            .collect()
    }

    /// The smallest box around it, in its anchor's space; `None` without triangles.
    pub fn bounds_in_anchor(&self) -> Option<Bounds> {
        let positions = self.mesh.positions.iter();
        Bounds::around(positions.map(|position| {
            self.anchor_from_object
                .transform_point3(position.as_dvec3())
        }))
    }
}

impl Scene {
    /// What of a scene with a probe its room's light depends on.
    pub fn room<'a>(&self, probe: &'a ProbeScene) -> Room<'a> {
        let standing = || self.standing_phantoms();
        let mut triangles: Vec<RoomTriangle> = Vec::new();
        for (piece, object) in (0..).zip(standing()) {
            triangles.extend(object.reflectors().map(|reflector| RoomTriangle {
                corners: reflector.corners,
                albedo: Some(reflector.albedo.as_vec3()),
                piece,
            }));
        }
        let first = standing().count() as u32;
        for (piece, part) in (first..).zip(&probe.room) {
            let triangle = |&(corners, albedo): &([Vec3; 3], Option<Vec3>)| RoomTriangle {
                corners,
                albedo,
                piece,
            };
            triangles.extend(part.triangles.iter().map(triangle));
        }
        let things = standing()
            .filter(|object| object.casts)
            .filter_map(Object::bounds_in_anchor);
        let settings = &self.shadows.shafts;
        let SplitLight { compact, rest, .. } = self.split_light(probe);
        Room {
            triangles,
            standing: first,
            things: things.chain(self.virtual_bounds()).collect(),
            options: RoomOptions {
                patches: settings.patches as usize,
                source_power: settings.source_power,
                receivers_per_leaf: settings.receivers_per_leaf as usize,
                least_part: settings.least_part,
            },
            probe: PlacedProbe {
                probe: rest,
                position_m: probe.position_m,
                exposure: probe.exposure as f32,
                beyond_m: if probe.is_far { BEYOND_M } else { 0.0 },
            },
            // (The room is worked out once: a light that moves along with an anchor is thrown back by nothing.)
            compact: compact
                .iter()
                .filter(|light| light.anchor == 0)
                .map(|light| light.light)
                .collect(),
        }
    }

    /// The phantoms that are parts of a room, in the order of its pieces.
    pub fn standing_phantoms(&self) -> impl Iterator<Item = &Object> {
        let phantoms = self.phantoms.iter();
        phantoms.filter(|object| object.visible && object.anchor == 0)
    }

    /// The boxes around the visible virtual things that stand in the world.
    pub fn virtual_bounds(&self) -> impl Iterator<Item = Bounds> {
        let virtuals = self
            .virtuals
            .iter()
            .filter(|object| object.visible && object.anchor == 0);
        virtuals.filter_map(Object::bounds_in_anchor)
    }

    /// The virtual things as they hide light.
    pub fn occluders(&self) -> Vec<Occluder<'_>> {
        self.virtuals.iter().map(Object::occluder).collect()
    }

    /// The phantoms as they hide light.
    pub fn real_occluders(&self) -> Vec<Occluder<'_>> {
        self.phantoms.iter().map(Object::occluder).collect()
    }
}
