//! A mesh in the poses of the rig that holds it: the same triangles, its vertices and normals elsewhere.

use glam::{DMat3, DMat4, DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::{Clip, Rig, RigVertices};
use crate::geometry::mesh::{HeldCorner, HeldNormal, Mesh, RigPoint};
use crate::geometry::normals::bent_normals;

/// What poses a mesh.
#[derive(Debug, Clone)]
pub struct MeshPoser {
    rig: Rig,
    clip: Clip,
    at_rest: RigVertices,
    object_from_scene: DMat4,
    crease_rad: f64,
    /// Of the mesh's looks, at rest; none where nothing asks for them.
    tangents: Vec<Vec4>,
}

impl MeshPoser {
    /// Of a rig, what it plays, and the mesh at rest. `object_from_scene` is a turn and an even scale from the model's file to
    /// the mesh; where the file has no normals, faces that meet at up to `crease_rad` at rest look like one surface.
    pub fn new(
        (rig, clip): (Rig, Clip),
        mesh: &Mesh,
        object_from_scene: DMat4,
        crease_rad: f64,
    ) -> Self {
        let tangents: Vec<Vec4> = mesh.looks.iter().map(|look| look.tangent).collect();
        let has_tangents = tangents.iter().any(|tangent| *tangent != Vec4::ZERO);
        Self {
            at_rest: rig.vertices(None),
            rig,
            clip,
            object_from_scene,
            crease_rad,
            tangents: if has_tangents { tangents } else { Vec::new() },
        }
    }

    /// What is played.
    pub fn clip(&self) -> &Clip {
        &self.clip
    }

    /// Brings a mesh of the rig, or a part of one, to a time of the clip, seconds. Tells whether that changes anything.
    pub fn pose(&self, mesh: &mut Mesh, time_s: f64) -> bool {
        let vertices = self.rig.vertices(Some((&self.clip, time_s)));
        let at_rest = self.positions(mesh, &self.at_rest.positions);
        let mut positions = self.positions(mesh, &vertices.positions);
        for (position, &rest) in positions.iter_mut().zip(&at_rest) {
            // (What a clip takes to infinity is not there to be seen; nothing after this has to reckon with it.)
            if !position.is_finite() {
                *position = rest;
            }
        }
        let normals = self.normals(mesh, &vertices, [&at_rest, &positions]);
        let changes = positions != mesh.positions || normals != mesh.corner_normals;
        if changes {
            self.turn_tangents(mesh, &vertices);
            (mesh.positions, mesh.corner_normals) = (positions, normals);
        }
        changes
    }

    /// Where the mesh's vertices are, given where those of the rig are.
    fn positions(&self, mesh: &Mesh, of_rig: &[DVec3]) -> Vec<Vec3> {
        // Whichever triangle is asked, its corner is held alike.
        let mut held: Vec<Option<&RigPoint>> = vec![None; mesh.positions.len()];
        for (triangle, corners) in mesh.triangles.iter().zip(&mesh.held) {
            for (&vertex, corner) in triangle.iter().zip(corners) {
                held[vertex as usize].get_or_insert(&corner.point);
            }
        }
        let place = |(held, &now): (Option<&RigPoint>, &Vec3)| {
            held.map_or(now, |point| {
                let place = mean(point, |vertex| of_rig[vertex as usize]);
                self.object_from_scene.transform_point3(place).as_vec3()
            })
        };
        held.into_par_iter()
            .zip(&mesh.positions)
            .map(place)
            .collect()
    }

    fn normals(
        &self,
        mesh: &Mesh,
        vertices: &RigVertices,
        [at_rest, positions]: [&[Vec3]; 2],
    ) -> Vec<[Vec3; 3]> {
        let object_from_scene = DMat3::from_mat4(self.object_from_scene);
        let of_rig = |held: &HeldCorner| {
            let normal = |vertex: u32| vertices.normals[vertex as usize].unwrap_or(DVec3::ZERO);
            let side = match held.normal {
                HeldNormal::OfRig => 1.0,
                HeldNormal::OfRigTurned => -1.0,
                HeldNormal::OfFaces => 0.0,
            };
            let mean = mean(&held.point, normal) * side;
            (object_from_scene * mean).normalize_or_zero().as_vec3()
        };
        let mut normals: Vec<[Vec3; 3]> = mesh
            .held
            .par_iter()
            .map(|corners| corners.each_ref().map(of_rig))
            .collect();
        let is_missing = |normal: &Vec3| *normal == Vec3::ZERO;
        if normals.as_flattened().iter().any(is_missing) {
            let made = bent_normals(at_rest, positions, &mesh.triangles, self.crease_rad);
            let made = made.as_flattened().iter();
            let found = normals.as_flattened_mut().iter_mut().zip(made);
            found
                .filter(|(normal, _)| is_missing(normal))
                .for_each(|(normal, made)| *normal = *made);
        }
        normals
    }

    /// Tangents are carried along as their vertices are.
    fn turn_tangents(&self, mesh: &mut Mesh, vertices: &RigVertices) {
        let object_from_scene = DMat3::from_mat4(self.object_from_scene);
        // (A part of a mesh has all of its looks.)
        for (look, tangent) in mesh.looks.iter_mut().zip(&self.tangents) {
            let Some((vertex, _)) = look.held_by.parts().next() else {
                continue;
            };
            let linear = |all: &RigVertices| {
                object_from_scene * DMat3::from_mat4(all.scene_from_mesh[vertex as usize])
            };
            let now_from_rest = linear(vertices) * linear(&self.at_rest).inverse();
            let turned = now_from_rest * tangent.truncate().as_dvec3();
            // (Where the matrix at rest has no inverse it stays as it is.)
            if let Some(turned) = turned.try_normalize() {
                look.tangent = turned.as_vec3().extend(tangent.w);
            }
        }
    }
}

/// What a place between vertices has, given what they have.
fn mean(point: &RigPoint, of_vertex: impl Fn(u32) -> DVec3) -> DVec3 {
    let parts = point.parts();
    parts
        .map(|(vertex, weight)| of_vertex(vertex) * f64::from(weight))
        .sum()
}
