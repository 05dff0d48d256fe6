//! Skins and morph targets: what holds and moves a mesh's vertices.

use glam::{DMat4, DVec3, Mat4, Vec4};
use gltf::Semantic;
use gltf::accessor::Dimensions;

use super::file::GltfFile;
use crate::geometry::rig::surface::{Joints, MorphTarget};
use crate::scene::error::SceneError;

/// How a skin holds the vertices of a primitive, of which there are `count`.
pub(super) fn joints(
    file: &GltfFile<'_>,
    skin: &gltf::Skin<'_>,
    (place, primitive, count): (&str, &gltf::Primitive<'_>, usize),
) -> Result<Joints, SceneError> {
    let skin_place = format!("skins[{}]", skin.index());
    let joints: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
    let joint_from_mesh: Vec<[f32; 16]> = match skin.inverse_bind_matrices() {
        Some(accessor) => file.floats(&skin_place, &accessor, &[Dimensions::Mat4], 0.0)?,
        None => vec![Mat4::IDENTITY.to_cols_array(); joints.len()],
    };
    if joint_from_mesh.len() < joints.len() {
        let message = format!(
            "{} inverse bind matrices for {} joints",
            joint_from_mesh.len(),
            joints.len()
        );
        return Err(file.error(&skin_place, message));
    }
    let mut holds = vec![Vec::new(); count];
    for set in 0.. {
        let held = primitive.get(&Semantic::Joints(set));
        let Some((held, weights)) = held.zip(primitive.get(&Semantic::Weights(set))) else {
            break;
        };
        let held: Vec<[u32; 4]> = file.integers(place, &held, Dimensions::Vec4)?;
        let weights: Vec<[f32; 4]> = file.floats(place, &weights, &[Dimensions::Vec4], 0.0)?;
        for ((holds, held), weights) in holds.iter_mut().zip(held).zip(weights) {
            for (joint, weight) in held
                .into_iter()
                .zip(weights)
                .filter(|(_, weight)| *weight != 0.0)
            {
                if joint as usize >= joints.len() {
                    let message = format!("JOINTS_{set}: joint {joint} of {}", joints.len());
                    return Err(file.error(place, message));
                }
                holds.push((joint, f64::from(weight)));
            }
        }
    }
    let binds = joint_from_mesh.iter().map(Mat4::from_cols_array);
    let binds = binds.map(|bind| bind.as_dmat4());
    Ok(Joints {
        skin: skin.index(),
        joints: joints.into_iter().zip(binds).collect(),
        holds,
    })
}

/// A primitive's morph targets, as far as `is_wanted` says so by their numbers: nothing of the others.
pub(super) fn morph_targets(
    file: &GltfFile<'_>,
    (place, primitive): (&str, &gltf::Primitive<'_>),
    is_wanted: impl Fn(usize) -> bool,
) -> Result<Vec<MorphTarget>, SceneError> {
    let mut targets = Vec::new();
    for (number, target) in primitive.morph_targets().enumerate() {
        let place = format!("{place}.targets[{number}]");
        let read = |accessor: Option<gltf::Accessor<'_>>| {
            let Some(accessor) = accessor.filter(|_| is_wanted(number)) else {
                return Ok(Vec::new());
            };
            let moves = file.floats::<3>(&place, &accessor, &[Dimensions::Vec3], 0.0)?;
            let in_double = |by: [f32; 3]| DVec3::from_array(by.map(f64::from));
            Ok(moves.into_iter().map(in_double).collect())
        };
        targets.push(MorphTarget {
            positions: read(target.positions())?,
            normals: read(target.normals())?,
        });
    }
    Ok(targets)
}

/// A tangent in the scene's space.
pub(super) fn turned_tangent(scene_from_mesh: &DMat4, tangent: Vec4) -> Vec4 {
    let turned = scene_from_mesh.transform_vector3(tangent.truncate().as_dvec3());
    let side = match scene_from_mesh.determinant() < 0.0 {
        true => -tangent.w,
        false => tangent.w,
    };
    turned.normalize_or_zero().as_vec3().extend(side)
}
