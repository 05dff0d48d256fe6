//! Skins: where the joints hold a mesh's vertices.

use glam::{DMat4, DVec3, Mat4, Vec4};
use gltf::Semantic;
use gltf::accessor::Dimensions;

use super::file::GltfFile;
use super::nodes::Nodes;
use crate::scene::error::SceneError;

/// For each vertex the mean of its joints' matrices, from the mesh's space to the scene's.
pub(super) fn scene_from_vertices(
    file: &GltfFile<'_>,
    nodes: &Nodes<'_>,
    skin: &gltf::Skin<'_>,
    (place, primitive, count): (&str, &gltf::Primitive<'_>, usize),
) -> Result<Vec<DMat4>, SceneError> {
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
    let scene_from_mesh: Vec<DMat4> = joints
        .iter()
        .zip(&joint_from_mesh)
        .map(|(&joint, bind)| nodes.scene_from_node[joint] * Mat4::from_cols_array(bind).as_dmat4())
        .collect();
    let mut sums = vec![(DMat4::ZERO, 0.0_f64); count];
    for set in 0.. {
        let held = primitive.get(&Semantic::Joints(set));
        let Some((held, weights)) = held.zip(primitive.get(&Semantic::Weights(set))) else {
            break;
        };
        let held: Vec<[u32; 4]> = file.integers(place, &held, Dimensions::Vec4)?;
        let weights: Vec<[f32; 4]> = file.floats(place, &weights, &[Dimensions::Vec4], 0.0)?;
        for ((sum, held), weights) in sums.iter_mut().zip(held).zip(weights) {
            for (joint, weight) in held
                .into_iter()
                .zip(weights)
                .filter(|(_, weight)| *weight != 0.0)
            {
                let matrix = scene_from_mesh.get(joint as usize);
                let matrix = matrix.ok_or_else(|| {
                    let message = format!("JOINTS_{set}: joint {joint} of {}", joints.len());
                    file.error(place, message)
                })?;
                sum.0 += *matrix * f64::from(weight);
                sum.1 += f64::from(weight);
            }
        }
    }
    // A vertex that nothing holds stays with the first joint.
    let first = scene_from_mesh.first().copied().unwrap_or(DMat4::IDENTITY);
    let mean = |(sum, weight): (DMat4, f64)| match weight > 0.0 {
        true => sum * weight.recip(),
        false => first,
    };
    Ok(sums.into_iter().map(mean).collect())
}

/// Adds a primitive's morph targets to places and normals, by their weights.
pub(super) fn morph(
    file: &GltfFile<'_>,
    (place, primitive, weights): (&str, &gltf::Primitive<'_>, &[f32]),
    positions: &mut [DVec3],
    normals: &mut [Option<DVec3>],
) -> Result<(), SceneError> {
    for (number, (target, &weight)) in primitive.morph_targets().zip(weights).enumerate() {
        if weight == 0.0 || !weight.is_finite() {
            continue;
        }
        let place = format!("{place}.targets[{number}]");
        let read = |accessor| file.floats::<3>(&place, &accessor, &[Dimensions::Vec3], 0.0);
        if let Some(moves) = target.positions().map(read).transpose()? {
            for (position, by) in positions.iter_mut().zip(moves) {
                *position += DVec3::from_array(by.map(f64::from)) * f64::from(weight);
            }
        }
        if let Some(moves) = target.normals().map(read).transpose()? {
            for (normal, by) in normals.iter_mut().zip(moves) {
                if let Some(normal) = normal {
                    *normal += DVec3::from_array(by.map(f64::from)) * f64::from(weight);
                }
            }
        }
    }
    Ok(())
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
