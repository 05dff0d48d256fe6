use super::*;
use crate::geometry::cuboid::cuboid;
use std::collections::HashMap;

const FACING: [i8; 2] = [1, 0];
const ALL: [i8; 2] = [1, -1];
const SURPLUS: [i8; 2] = [-1, -1];

fn cube() -> Caster {
    let (positions, triangles) = cuboid(Vec3::ZERO, Vec3::ONE);
    Caster::new(positions, triangles)
}

/// The caps and sides for a light.
fn volume(caster: &Caster, light: LightPlace, casts: [i8; 2]) -> Vec<u32> {
    let silhouette = caster.silhouette(light, casts);
    let [mut indices, turned] = caster.cap_indices(&silhouette);
    indices.extend(turned.chunks(3).flat_map(|t| [t[0], t[2], t[1]]));
    indices.extend(caster.side_indices(&silhouette));
    indices
}

/// How often each directed edge is used, less the uses of its opposite; all points at infinity of a distant light
/// are one point.
fn boundary(indices: &[u32], vertices: &[Vec4], distant: bool) -> usize {
    let name = |index: u32| {
        if distant && vertices[index as usize].w == 0.0 {
            u32::MAX
        } else {
            index
        }
    };
    let mut uses: HashMap<(u32, u32), i32> = HashMap::new();
    for triangle in indices.chunks(3) {
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let (from, to) = (name(triangle[from]), name(triangle[to]));
            if from != to {
                *uses.entry((from.min(to), from.max(to))).or_default() +=
                    if from < to { 1 } else { -1 };
            }
        }
    }
    uses.values().filter(|&&count| count != 0).count()
}

fn lights() -> Vec<LightPlace> {
    vec![
        LightPlace::Point(DVec3::new(3.0, 2.0, 5.0)),
        LightPlace::Point(DVec3::new(0.5, 0.5, 0.5)),
        LightPlace::Point(DVec3::new(0.2, 0.3, 40.0)),
        LightPlace::Point(DVec3::new(1.0, 1.0, 2.0)),
        LightPlace::Along(DVec3::new(0.0, 0.0, -1.0)),
        LightPlace::Along(DVec3::new(0.48, -0.6, 0.64)),
    ]
}

#[test]
fn the_volume_is_closed_for_every_light_and_any_soup() {
    let closed = cube();
    let mut triangles = closed.triangles[..9].to_vec();
    triangles.extend([[0, 1, 7], [7, 1, 3]]);
    let open = Caster::new(closed.positions.clone(), triangles);
    assert!(closed.closed && !open.closed);
    for caster in [&closed, &open] {
        for light in lights() {
            for casting in [FACING, ALL, SURPLUS] {
                let distant = matches!(light, LightPlace::Along(_));
                let indices = volume(caster, light, casting);
                let open_edges = boundary(&indices, &caster.volume_vertices(), distant);
                assert_eq!(open_edges, 0, "{light:?} {casting:?}");
            }
        }
    }
}

#[test]
fn a_cube_lit_from_above_has_the_outline_of_its_top() {
    let light = LightPlace::Along(DVec3::new(0.0, 0.0, -1.0));
    // Two triangles for each cap and each of four sides.
    assert_eq!(volume(&cube(), light, FACING).len() / 3, 12);
}

#[test]
fn the_winding_number_counts_the_triangles_towards_the_light() {
    // A ray from a point, away from everything, crosses the volumes outward once for each that it lies in.
    let caster = cube();
    let crossings = |light: DVec3, casting: [i8; 2], origin: DVec3| -> i32 {
        let indices = volume(&caster, LightPlace::Point(light), casting);
        let vertices = caster.volume_vertices();
        let place = |index: u32| {
            let vertex = vertices[index as usize];
            let place = vertex.truncate().as_dvec3();
            if vertex.w == 0.0 {
                light + (place - light) * 1e4
            } else {
                place
            }
        };
        let direction = DVec3::new(1.0, 0.123, 0.0456);
        indices
            .chunks(3)
            .map(|t| {
                let [a, b, c] = [place(t[0]), place(t[1]), place(t[2])];
                let normal = (b - a).cross(c - a);
                let distance = normal.dot(a - origin) / normal.dot(direction);
                let hit = origin + direction * distance;
                let inside = [(a, b), (b, c), (c, a)]
                    .iter()
                    .all(|(p, q)| (*q - *p).cross(hit - *p).dot(normal) >= 0.0);
                if distance > 0.0 && inside {
                    normal.dot(direction).signum() as i32
                } else {
                    0
                }
            })
            .sum()
    };
    let above = DVec3::new(0.4, 0.3, 5.0);
    let (below, over, beside) = (
        DVec3::new(0.5, 0.55, -1.0),
        DVec3::new(0.5, 0.55, 2.0),
        DVec3::new(-3.0, 0.5, -1.0),
    );
    for (point, facing, all) in [(below, 1, 2), (over, 0, 0), (beside, 0, 0)] {
        assert_eq!(crossings(above, FACING, point), facing, "{point}");
        assert_eq!(crossings(above, ALL, point), all, "{point}");
        let surplus = all - 2 * facing;
        assert_eq!(crossings(above, SURPLUS, point), surplus, "{point}");
    }
    // From within, each way out meets one triangle.
    let within = DVec3::new(0.4, 0.3, 0.5);
    for point in [below, over, beside] {
        assert_eq!(crossings(within, ALL, point), 1, "{point}");
    }
    assert_eq!(crossings(within, ALL, DVec3::new(0.2, 0.7, 0.3)), 0);
}

#[test]
fn the_cheap_way_is_taken_only_with_light_and_eye_outside_a_closed_mesh() {
    let (light, eye) = (DVec3::new(0.3, 0.4, 5.0), DVec3::new(4.0, 0.0, 2.0));
    let inside = DVec3::splat(0.4);
    let closed = cube();
    let open = Caster::new(closed.positions.clone(), closed.triangles[1..].to_vec());
    let point = LightPlace::Point;
    assert_eq!(closed.casting(point(light), eye), Casting::Facing);
    assert_eq!(
        closed.casting(LightPlace::Along(DVec3::X), eye),
        Casting::Facing
    );
    assert_eq!(closed.casting(point(light), inside), Casting::All);
    assert_eq!(closed.casting(point(inside), eye), Casting::All);
    assert_eq!(open.casting(point(light), eye), Casting::All);
}

/// Cubes one around another, in the middle of the unit cube.
fn nested(count: usize) -> Caster {
    let cube = cube();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for shell in 0..count {
        let scale = 1.0 - 0.9 * shell as f32 / count as f32;
        let first = positions.len() as u32;
        positions.extend(cube.positions.iter().map(|p| 0.5 + (*p - 0.5) * scale));
        triangles.extend(cube.triangles.iter().map(|t| t.map(|index| first + index)));
    }
    Caster::new(positions, triangles)
}

#[test]
fn the_bound_of_layers_holds_and_is_not_far_off() {
    for count in [1, 7, 40] {
        let caster = nested(count);
        for light in lights() {
            for (casting, each) in [(FACING, 1), (ALL, 2)] {
                let silhouette = caster.silhouette(light, casting);
                // The innermost cube lies behind all the others.
                let (origin, way) = match light {
                    LightPlace::Point(light) => (light, DVec3::new(0.501, 0.502, 0.5003) - light),
                    LightPlace::Along(way) => (DVec3::new(0.501, 0.502, 0.5003) - way * 9.0, way),
                };
                let layers = caster.casting_towards(&silhouette, origin, way);
                let is_enough =
                    |enough: &u32| caster.most_layers(light, &silhouette, *enough) <= *enough;
                let bound = (0..=100).find(is_enough).unwrap();
                let from_within = light == lights()[1];
                if !from_within {
                    assert_eq!(layers as usize, each * count, "{light:?}");
                }
                assert!(bound >= layers, "{bound} {layers} {light:?} {casting:?}");
                assert!(
                    bound <= 2 * layers + 3,
                    "{bound} {layers} {light:?} {casting:?}"
                );
            }
        }
    }
}

#[test]
fn deep_nests_are_cut_into_parts_that_cast_the_same_triangles() {
    let caster = nested(40);
    for light in lights() {
        let whole = caster.silhouette(light, ALL);
        let parts = caster.shallow(light, whole.clone(), 15, false);
        assert!(parts.len() >= 2, "{light:?}");
        let is_shallow = |part: &VolumePart| part.layers <= 15 && !part.counted_apart;
        assert!(parts.iter().all(is_shallow));
        let casting = parts.into_iter().flat_map(|part| part.silhouette.casting);
        assert_eq!(casting.collect::<Vec<_>>(), whole.casting);
    }
    let parts = cube().parts(lights()[0], Casting::All, 15);
    assert!(parts.len() == 1 && !parts[0].counted_apart);
}

#[test]
fn a_nearly_closed_mesh_is_counted_by_what_faces_the_light_and_the_surplus() {
    let closed = nested(40);
    let open = Caster::new(closed.positions.clone(), closed.triangles[1..].to_vec());
    let light = lights()[0];
    let parts = open.parts(light, Casting::All, 63);
    let sides = |part: &VolumePart| part.silhouette.edges.len();
    assert!(parts.len() == 2 && parts[0].counted_apart && !parts[1].counted_apart);
    assert_eq!(sides(&parts[1]), 3);
    let all = open.silhouette(light, ALL).edges.len();
    assert!(sides(&parts[0]) < all / 2 + 3);
}

#[test]
fn a_needle_casts_as_its_neighbour_does() {
    // A square of which one triangle has a vertex in the middle of the diagonal, joined by a needle.
    let positions = vec![
        Vec3::ZERO,
        Vec3::X,
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::Y,
        Vec3::new(0.5, 0.5, 0.0),
    ];
    let triangles = vec![[0, 1, 2], [0, 4, 3], [4, 2, 3], [0, 2, 4]];
    let caster = Caster::new(positions, triangles);
    let light = LightPlace::Point(DVec3::new(0.3, 0.2, 2.0));
    let silhouette = caster.silhouette(light, ALL);
    let triangles = 0..4;
    let casting = triangles.map(|triangle| CastingTriangle { triangle, sign: 1 });
    assert_eq!(silhouette.casting, casting.collect::<Vec<_>>());
    assert_eq!(silhouette.edges.len(), 4);
}

#[test]
fn the_terminator_is_where_smooth_normals_still_face_the_light() {
    let caster = cube();
    let light = LightPlace::Point(DVec3::new(0.5, 0.5, 9.0));
    // As on a ball about the cube: the sides' upper corners face the light, the bottom's do not.
    let normals: Vec<[Vec3; 3]> = caster
        .triangles
        .iter()
        .map(|t| t.map(|index| (caster.positions[index as usize] - 0.5).normalize()))
        .collect();
    let is_side = |triangle: &usize| {
        let corners = caster.triangles[*triangle].map(|index| caster.positions[index as usize].z);
        corners.iter().sum::<f32>() % 3.0 != 0.0
    };
    let sorted = caster.lit_triangles(light, None, Some(&normals));
    assert_eq!(
        sorted.terminator.outer,
        (0..12).filter(is_side).collect::<Vec<_>>()
    );
    let counts = |sides: &SeenTriangles| (sides.outer.len(), sides.inner.len());
    assert_eq!(
        (counts(&sorted.facing), counts(&sorted.back_facing)),
        ((2, 0), (2, 0))
    );
    // An eye below sees the bottom from outside, and from inside the top, which the light sees from the other side, and
    // the walls, which it sees from the same.
    let below = Some(DVec3::new(0.5, 0.5, -3.0));
    let sorted = caster.lit_triangles(light, below, None);
    assert_eq!(
        (counts(&sorted.facing), counts(&sorted.back_facing)),
        ((0, 8), (2, 2))
    );
}
