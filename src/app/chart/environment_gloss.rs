//! What a glossy thing mirrors of an environment, pixel by pixel, by rays: the truth that chart environment holds gloss against.

use glam::{DAffine3, DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::camera::Intrinsics;
use crate::geometry::ray_caster::RayCaster;
use crate::light::reflectance;
use crate::render::VIRTUAL;
use crate::scene::Object;

/// A thing, how it stands, and the camera.
pub struct GlossyThing<'a> {
    /// It.
    pub object: &'a Object,
    /// Its pose in the world.
    pub world_from_anchor: DAffine3,
    /// The camera.
    pub intrinsics: Intrinsics,
    /// And its pose.
    pub world_from_camera: DAffine3,
}

impl GlossyThing<'_> {
    /// Of every so many pixels those well within the thing (roles as in layers), with its radiance there, green: what it mirrors of
    /// lights from afar (unit direction, irradiance across it) that it does not hide from itself. Nothing else is there.
    pub fn radiances(
        &self,
        role: &[u8],
        step: usize,
        lights: &[(DVec3, f64)],
    ) -> Vec<(usize, f64)> {
        let mesh = &self.object.mesh;
        let positions = self.object.positions_in_anchor(mesh);
        let place = |index: u32| {
            let position = positions[index as usize].as_dvec3();
            self.world_from_anchor.transform_point3(position).as_vec3()
        };
        let triangles: Vec<[Vec3; 3]> = mesh.triangles.iter().map(|it| it.map(place)).collect();
        let caster = RayCaster::new(&triangles);
        let width = self.intrinsics.size_px[0] as usize;
        let is_within = |index: usize| {
            let around = [0, 1, width, width + 1].map(|off| 2 * off);
            let first = index.checked_sub(2 * width + 2);
            first.is_some_and(|first| {
                let mut around = around.iter().map(|off| role.get(first + 2 * off));
                around.all(|role| role == Some(&VIRTUAL))
            })
        };
        let pixels: Vec<usize> = (0..role.len())
            .step_by(step)
            .filter(|&it| is_within(it))
            .collect();
        let of_pixel = |&index: &usize| {
            let (start, normal, to_camera) = self.seen(&triangles, &caster, index)?;
            let arriving = lights.iter().map(|&(toward, irradiance)| {
                let cosine = toward.dot(normal);
                if cosine <= 0.0 || caster.is_hidden(start, toward.as_vec3(), f32::INFINITY) {
                    return 0.0;
                }
                let material = &self.object.materials[0];
                irradiance * cosine * reflectance(material, normal, toward, to_camera).y
            });
            Some((index, arriving.sum()))
        };
        pixels.par_iter().filter_map(of_pixel).collect()
    }

    /// What a pixel shows: a place off the surface, the normal there, and the way to the camera.
    fn seen(
        &self,
        triangles: &[[Vec3; 3]],
        caster: &RayCaster,
        index: usize,
    ) -> Option<(Vec3, DVec3, DVec3)> {
        let width = self.intrinsics.size_px[0] as usize;
        let pixel = DVec2::new((index % width) as f64, (index / width) as f64);
        let way = ((pixel - self.intrinsics.center_px) / self.intrinsics.focal_px).extend(1.0);
        let way = self.world_from_camera.transform_vector3(way).normalize();
        let eye = self.world_from_camera.translation.as_vec3();
        let hit = caster.first_hit(eye, way.as_vec3(), f32::INFINITY)?;
        let place = eye + way.as_vec3() * hit.distance;
        let [a, b, c] = triangles[hit.triangle];
        // Barycentric coordinates as areas.
        let areas = [(b, c), (c, a), (a, b)].map(|(b, c)| (b - place).cross(c - place).length());
        let normals = self.object.mesh.corner_normals[hit.triangle];
        let parts = normals.iter().zip(areas);
        let normal: Vec3 = parts.map(|(&normal, area)| normal * area).sum();
        let normal_matrix = self.object.anchor_from_object.matrix3.inverse().transpose();
        let normal = self.world_from_anchor.matrix3 * (normal_matrix * normal.as_dvec3());
        let normal = normal.normalize_or_zero();
        Some((place + normal.as_vec3() * 1e-4, normal, -way))
    }
}
