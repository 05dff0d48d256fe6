//! Cut triangles held against their pictures, place by place.

use std::sync::Arc;

use glam::{Affine2, DVec3, Vec3};

use super::*;
use crate::geometry::mesh::RawTriangle;
use crate::geometry::ray_caster::RayCaster;
use crate::light::material::Encoding;
use crate::scene::raw_model::GivenMaterial;

/// A square, 1 m wide, whose texture coordinates go from 0 to `times`.
fn square(map: Map, times: f32, texture: Texture, cutoff: f64) -> RawModel {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let look = |corner: [f32; 2]| CornerLook {
        uv: [Vec2::from_array(corner) * times, Vec2::ZERO],
        ..CornerLook::default()
    };
    let mut material = Material::matt(DVec3::ONE);
    material.coverage = Coverage::Mask { cutoff };
    material.maps.color = Some(map);
    let mut model = RawModel {
        positions: corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
        materials: vec![GivenMaterial {
            name: String::new(),
            material,
            is_given: true,
        }],
        textures: vec![Arc::new(texture)],
        ..RawModel::default()
    };
    let triangles = [[0, 1, 2], [0, 2, 3]];
    model.triangles = triangles
        .map(|vertices| RawTriangle {
            vertices,
            normals: [None; 3],
            material: 0,
        })
        .to_vec();
    model.looks.looks = corners.map(look).to_vec();
    model.looks.corners = triangles.to_vec();
    model
}

/// A picture whose opacity is told by column and row.
fn picture(size_px: [u32; 2], alpha: impl Fn(u32, u32) -> f64) -> Texture {
    let texels = (0..size_px[1]).flat_map(|row| (0..size_px[0]).map(move |column| [column, row]));
    Texture {
        name: "mask".to_owned(),
        size_px,
        rgba: texels
            .flat_map(|[column, row]| [0, 0, 0, (255.0 * alpha(column, row)).round() as u8])
            .collect(),
    }
}

/// Of 400 × 400 places that part at which the cut model and the picture disagree.
fn disagreeing(times: f32, map: Map, texture: Texture, cutoff: f64) -> f64 {
    const SIDE: u32 = 400;
    let mut model = square(map, times, texture.clone(), cutoff);
    cut_masks(&mut model, Path::new("square")).unwrap();
    assert_eq!(model.materials[0].material.coverage, Coverage::Opaque);
    let corners = model.triangles.iter().map(|triangle| {
        let corners = triangle.vertices;
        corners.map(|vertex| model.positions[vertex as usize])
    });
    let caster = RayCaster::new(&corners.collect::<Vec<_>>());
    let place = |number: u32| (f64::from(number) + 0.4371) / f64::from(SIDE);
    let wrong = (0..SIDE * SIDE).filter(|number| {
        let at = DVec2::new(place(number % SIDE), place(number / SIDE));
        let alpha = texture
            .sample(&map, at.as_vec2() * times, Encoding::Linear)
            .w;
        let from = at.as_vec2().extend(1.0);
        caster.is_hidden(from, -Vec3::Z, 2.0) != (alpha >= cutoff)
    });
    wrong.count() as f64 / f64::from(SIDE * SIDE)
}

/// A soft blot that touches no side.
fn blot(column: u32, row: u32) -> f64 {
    let from_middle = DVec2::new(f64::from(column) - 15.5, f64::from(row) - 17.5).length();
    ((11.0 - from_middle) / 4.0).clamp(0.0, 1.0)
}

#[test]
fn soft_edges_are_where_the_picture_has_them() {
    let map = Map::of(0);
    for cutoff in [0.1, 0.5, 0.9] {
        let wrong = disagreeing(1.0, map, picture([32, 32], blot), cutoff);
        assert!(wrong < 0.001, "{cutoff}: {wrong}");
    }
}

#[test]
fn pictures_that_go_on_are_cut_as_they_go_on() {
    let turned =
        Affine2::from_scale_angle_translation(Vec2::new(1.5, 0.7), 0.4, Vec2::new(-0.8, 0.3));
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        let map = Map {
            wrap: [wrap, Wrap::Repeat],
            picture_from_corner: turned,
            ..Map::of(0)
        };
        // (Along the picture's own sides, which lie off the middle, mirrors and repeats differ.)
        let texture = picture([24, 40], |column, row| blot(column + 9, row));
        let wrong = disagreeing(2.0, map, texture, 0.5);
        assert!(wrong < 0.002, "{wrap:?}: {wrong}");
    }
}

#[test]
fn squares_keep_their_corners_and_stripes_of_a_texel_stay() {
    let map = Map {
        filter: Filter::Pixels,
        ..Map::of(0)
    };
    let checkered = picture([8, 8], |column, row| f64::from((column + row) % 2));
    let wrong = disagreeing(1.0, map, checkered, 0.5);
    assert!(wrong < 0.02, "{wrong}");
    let stripes = picture([16, 1], |column, _| f64::from(column % 2));
    let wrong = disagreeing(1.0, Map::of(0), stripes, 0.5);
    assert!(wrong < 0.002, "{wrong}");
}

#[test]
fn colours_at_corners_count_and_what_is_all_cut_out_is_an_error() {
    let solid = || picture([1, 1], |_, _| 1.0);
    let mut model = square(Map::of(0), 1.0, solid(), 0.5);
    model.looks.looks[0].color.w = 0.0;
    cut_masks(&mut model, Path::new("square")).unwrap();
    // Of both triangles the half of the sides at the first corner is gone.
    let area = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(|vertex| model.positions[vertex as usize].as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    };
    let area: f64 = model.triangles.iter().map(|it| area(it.vertices)).sum();
    assert!((area - 0.75).abs() < 0.02, "{area}");
    let mut model = square(Map::of(0), 1.0, picture([1, 1], |_, _| 0.2), 0.5);
    let error = cut_masks(&mut model, Path::new("square")).unwrap_err();
    assert!(error.to_string().contains("nothing is left"), "{error}");
}
