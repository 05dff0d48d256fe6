//! Looks of meshes that are welded and mended.

use super::*;
use glam::{Vec2, Vec4};

fn look(u: f32, v: f32) -> CornerLook {
    CornerLook {
        uv: [Vec2::new(u, v); 2],
        color: Vec4::new(u, v, 0.0, 1.0),
        ..CornerLook::default()
    }
}

fn raw(vertices: [u32; 3]) -> RawTriangle {
    RawTriangle {
        vertices,
        normals: [None; 3],
        material: 0,
    }
}

#[test]
fn places_are_merged_and_seams_stay() {
    // A square of two triangles with vertices of their own: along the diagonal u jumps.
    let positions = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::ONE,
        Vec3::ZERO,
        Vec3::ONE,
        Vec3::Y,
    ];
    let looks = RawLooks {
        looks: vec![
            look(0.0, 0.0),
            look(1.0, 0.0),
            look(1.0, 1.0),
            look(0.5, 0.0),
            look(0.5, 1.0),
            look(0.0, 1.0),
        ],
        corners: vec![[0, 1, 2], [3, 4, 5]],
    };
    let triangles = [raw([0, 1, 2]), raw([3, 4, 5])];
    let (mesh, report) = Mesh::weld_with_looks(&positions, &triangles, &looks, 0.5);
    assert_eq!((mesh.positions.len(), report.merged_vertices), (4, 2));
    for (triangle, corners) in mesh.corner_looks.iter().enumerate() {
        let found = corners.map(|index| mesh.looks[index as usize].uv[0]);
        let given = looks.corners[triangle].map(|index| looks.looks[index as usize].uv[0]);
        let is_there = |uv: &Vec2| given.contains(uv);
        assert!(found.iter().all(is_there), "{found:?}");
    }
    // In a mirrored placement each corner keeps its own.
    let turned = mesh.clone().with_winding_reversed();
    for (triangle, corners) in turned.triangles.iter().enumerate() {
        for (corner, vertex) in corners.iter().enumerate() {
            let before = mesh.triangles[triangle].iter().position(|v| v == vertex);
            let before = before.expect("the same vertices");
            assert_eq!(
                turned.corner_looks[triangle][corner],
                mesh.corner_looks[triangle][before]
            );
        }
    }
}

#[test]
fn a_cut_triangle_has_what_lies_between() {
    // The long triangle is cut where the two short ones meet.
    let positions = [Vec3::ZERO, Vec3::X * 4.0, Vec3::Y, Vec3::NEG_Y, Vec3::X];
    let given = |place: Vec3| look(place.x / 4.0, place.y);
    let triangles = [raw([0, 1, 2]), raw([0, 3, 4]), raw([4, 3, 1])];
    let looks = RawLooks {
        looks: positions.map(given).to_vec(),
        corners: triangles.map(|triangle| triangle.vertices).to_vec(),
    };
    let (mesh, report) = Mesh::weld_with_looks(&positions, &triangles, &looks, 0.0);
    assert_eq!(report.splits, 1);
    for (triangle, corners) in mesh.triangles.iter().zip(&mesh.corner_looks) {
        for (vertex, index) in triangle.iter().zip(corners) {
            let expected = given(mesh.positions[*vertex as usize]).uv[0];
            let found = mesh.looks[*index as usize].uv[0];
            assert!(found.distance(expected) < 1e-6, "{found} {expected}");
        }
    }
}
