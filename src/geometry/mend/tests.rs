use super::*;
use crate::geometry::cuboid::cuboid;

fn face(vertices: [u32; 3]) -> Face {
    let front = Side {
        normals: [None; 3],
        material: 0,
        source: 0,
    };
    Face {
        vertices,
        front,
        back: None,
    }
}

/// Faces of the box from the origin to `size`, two a side, each with vertices of its own.
fn loose_box(size: Vec3) -> (Vec<Vec3>, Vec<Face>) {
    let (corners, triangles) = cuboid(Vec3::ZERO, size);
    let corner = |&corner: &u32| corners[corner as usize];
    let positions = triangles.iter().flatten().map(corner).collect();
    let faces = (0..12)
        .map(|number| face([3 * number, 3 * number + 1, 3 * number + 2]))
        .collect();
    (positions, faces)
}

/// Moves each position by up to `reach` along each axis, the same way in each run (Marsaglia's xorshift).
fn jittered(positions: &[Vec3], reach: f32) -> Vec<Vec3> {
    let mut state = 7_u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    positions
        .iter()
        .map(|&position| position + reach * Vec3::new(next(), next(), next()))
        .collect()
}

#[test]
fn jitter_below_the_tolerance_is_welded_and_above_it_is_not() {
    let (positions, faces) = loose_box(Vec3::ONE);
    let mended = mend(&jittered(&positions, 2e-6), faces.clone());
    assert_eq!((mended.odd_edges, mended.merged_vertices), (0, 36 - 8));
    let apart = mend(&jittered(&positions, 1e-3), faces);
    assert_eq!((apart.odd_edges, apart.merged_vertices), (36, 0));
}

#[test]
fn a_tiny_jittered_box_in_a_huge_mesh_keeps_its_corners() {
    // Its whole size is a tenth of the tolerance that the huge triangle would allow.
    let (positions, mut faces) = loose_box(Vec3::splat(1e-3));
    let mut positions = jittered(&positions, 2e-9);
    faces.push(face([36, 37, 38]));
    positions.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * 1e3));
    let mended = mend(&positions, faces);
    assert_eq!((mended.odd_edges, mended.merged_vertices), (3, 36 - 8));
    assert_eq!(mended.faces.len(), 13);
}

/// A square of side `size` at a corner, of two triangles that share their diagonal.
fn square(low: Vec3, size: f32) -> [Vec3; 4] {
    [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| low + size * Vec3::new(x, y, 0.0))
}

fn square_faces(count: u32) -> Vec<Face> {
    (0..count)
        .flat_map(|number| [[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|c| 4 * number + c)))
        .map(face)
        .collect()
}

#[test]
fn small_parts_of_a_large_mesh_stay_apart() {
    // Their gap is a tenth of their size, and within what the large triangle would allow.
    let low = [Vec3::ZERO, Vec3::new(1.1e-4, 0.0, 0.0)];
    let mut positions = low.map(|low| square(low, 1e-4)).concat();
    let mut faces = square_faces(2);
    faces.push(face([8, 9, 10]));
    positions.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis));
    let mended = mend(&positions, faces);
    assert_eq!((mended.odd_edges, mended.merged_vertices), (11, 0));
}

#[test]
fn a_ribbon_narrower_than_the_tolerance_stays() {
    let positions = square(Vec3::ZERO, 1.0).map(|point| point * Vec3::new(1.0, 5e-6, 1.0));
    let mended = mend(&positions, square_faces(1));
    assert_eq!((mended.faces.len(), mended.merged_vertices), (2, 0));
}

#[test]
fn tiles_meet_in_their_own_layer() {
    // Two layers a tenth of the tolerance apart, of tiles that miss each other by a rounding; the upper layer is
    // whole, or has one tile alone.
    for (tiles, odd_edges, merged_vertices) in [(4, 12, 4), (3, 10, 2)] {
        let low = [
            Vec3::Z * 2e-6,
            Vec3::ZERO,
            Vec3::X,
            Vec3::new(1.0, 0.0, 2e-6),
        ];
        let positions = low[..tiles].iter().flat_map(|&low| square(low, 1.0));
        let positions = jittered(&positions.collect::<Vec<Vec3>>(), 2e-7);
        let mended = mend(&positions, square_faces(tiles as u32));
        let found = (mended.odd_edges, mended.merged_vertices);
        assert_eq!(found, (odd_edges, merged_vertices));
        let upper = |face: &Face| {
            face.vertices
                .map(|vertex| positions[vertex as usize].z > 1e-6)
        };
        let mixed = |face: &&Face| ![[true; 3], [false; 3]].contains(&upper(face));
        assert_eq!(mended.faces.iter().find(mixed), None);
    }
}

#[test]
fn the_sides_of_a_thin_open_sheet_stay_apart() {
    // Two squares of side 1, 1e-6 apart, back to back, without a rim.
    let positions = [0.0, 1e-6].map(|z| square(Vec3::Z * z, 1.0)).concat();
    let faces = [[4, 5, 6], [4, 6, 7], [0, 2, 1], [0, 3, 2]].map(face);
    let mended = mend(&positions, faces.to_vec());
    assert_eq!((mended.merged_vertices, mended.duplicates), (0, 0));
    assert_eq!((mended.odd_edges, mended.faces.len()), (8, 4));
}

#[test]
fn a_closed_box_thinner_than_the_tolerance_stays_as_it_is() {
    let (positions, faces) = loose_box(Vec3::new(1.0, 1.0, 1e-6));
    // The corners merged exactly, as loading does first.
    let first_at = |index: u32| {
        let at = |other: u32| positions[other as usize];
        (0..=index)
            .find(|&other| at(other) == at(index))
            .unwrap_or(index)
    };
    let welded: Vec<Face> = faces
        .iter()
        .map(|each| face(each.vertices.map(first_at)))
        .collect();
    let mended = mend(&positions, welded.clone());
    assert_eq!((mended.odd_edges, mended.merged_vertices), (0, 0));
    assert_eq!(mended.faces, welded);
    // Nor do its sides meet if the top is open.
    let open: Vec<Face> = [&welded[..2], &welded[4..]].concat();
    let mended = mend(&positions, open);
    assert_eq!((mended.odd_edges, mended.merged_vertices), (4, 0));
}

#[test]
fn chains_of_vertices_on_a_long_edge_split_its_face() {
    // A triangle below the x axis, and above it a fan whose rim goes along the axis in `parts` steps.
    for parts in [2_u32, 5, 1000] {
        let mut positions = vec![
            Vec3::ZERO,
            Vec3::X,
            Vec3::new(0.0, -1.0, 0.0),
            Vec3::new(0.5, 1.0, 0.0),
        ];
        positions.extend((1..parts).map(|step| Vec3::X * (step as f32 / parts as f32)));
        let on_axis = |step: u32| match step {
            0 => 0,
            _ if step == parts => 1,
            _ => 3 + step,
        };
        let mut faces = vec![face([0, 2, 1])];
        faces.extend((0..parts).map(|step| face([on_axis(step), on_axis(step + 1), 3])));
        let mended = mend(&positions, faces);
        assert_eq!(mended.splits, parts as usize - 1);
        assert_eq!(mended.odd_edges, 4, "the outline alone is open");
        let area: f64 = mended
            .faces
            .iter()
            .map(|face| {
                let [a, b, c] = face
                    .vertices
                    .map(|index| positions[index as usize].as_dvec3());
                (b - a).cross(c - a).z / 2.0
            })
            .sum();
        assert!((area - 1.0).abs() < 1e-6, "{area}");
    }
}

#[test]
fn a_vertex_beside_an_edge_does_not_split_it() {
    for (beside, splits) in [(0.0, 1), (5e-6, 1), (1e-3, 0)] {
        let positions = [
            Vec3::ZERO,
            Vec3::X,
            Vec3::new(0.0, -1.0, 0.0),
            Vec3::new(0.5, 1.0, 0.0),
            Vec3::new(0.5, 0.0, beside),
        ];
        let faces = [[0, 2, 1], [0, 4, 3], [4, 1, 3]].map(face);
        assert_eq!(mend(&positions, faces.to_vec()).splits, splits, "{beside}");
    }
}

#[test]
fn a_split_face_has_the_normals_of_its_points() {
    let positions = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::new(0.0, -1.0, 0.0),
        Vec3::new(0.25, 0.0, 0.0),
    ];
    let mut whole = face([0, 2, 1]);
    whole.front.normals = [Some(Vec3::X * 2.0), None, Some(Vec3::Y)];
    let [first, second] = split_face(&positions, &whole, [0, 1], 3).expect("two halves");
    let between = Some(Vec3::new(0.75, 0.25, 0.0));
    assert_eq!((first.vertices, second.vertices), ([3, 2, 1], [0, 2, 3]));
    assert_eq!(first.front.normals, [between, None, Some(Vec3::Y)]);
    assert_eq!(second.front.normals, [Some(Vec3::X * 2.0), None, between]);
}

#[test]
fn of_two_sided_faces_both_stay_where_one_would_be_open() {
    let positions: Vec<Vec3> = loose_box(Vec3::ONE).0;
    let sheet = vec![
        face([0, 1, 2]),
        face([0, 2, 5]),
        face([2, 1, 0]),
        face([5, 2, 0]),
    ];
    let mut mended = mend(&positions, sheet.clone());
    assert_eq!((mended.duplicates, mended.faces.len()), (2, 2));
    assert_eq!(restore_backs(&positions, &mut mended.faces), 2);
    let uses = edge_uses(mended.faces.iter().map(|face| face.vertices));
    assert_eq!(super::super::soup::unbalanced_edges(&uses), 0);
    // A square from each side in the middle of a row: its rim would close as many edges as it opened.
    let row: Vec<Vec3> = (0..8)
        .map(|index| Vec3::new((index / 2) as f32, (index % 2) as f32, 0.0))
        .collect();
    let mut faces: Vec<Face> = [0, 2, 4]
        .into_iter()
        .flat_map(|low| [[low, low + 2, low + 3], [low, low + 3, low + 1]])
        .map(face)
        .collect();
    faces.extend([[5, 4, 2], [3, 5, 2]].map(face));
    let mut mended = mend(&row, faces);
    assert_eq!(mended.duplicates, 2);
    assert_eq!(restore_backs(&row, &mut mended.faces), 0);
    // A tetrahedron with one face twice needs one of them.
    let mut faces: Vec<Face> = [[0, 2, 1], [0, 1, 5], [0, 5, 2], [1, 2, 5], [1, 0, 2]]
        .map(face)
        .to_vec();
    faces = mend(&positions, faces).faces;
    assert_eq!(restore_backs(&positions, &mut faces), 0);
    assert_eq!(faces.len(), 4);
}

#[test]
fn duplicates_keep_the_first_s_normals_and_the_other_side_s_at_its_vertices() {
    let mut turned = face([1, 0, 2]);
    turned.front.normals = [Some(Vec3::Y), Some(Vec3::X), Some(Vec3::Z)];
    turned.front.material = 3;
    let again = face([2, 0, 1]);
    let (kept, dropped) = without_duplicates(vec![face([0, 1, 2]), again, turned]);
    assert_eq!((kept.len(), dropped), (1, 2));
    let back = kept[0].back.expect("another side");
    assert_eq!(back.normals, [Some(Vec3::X), Some(Vec3::Y), Some(Vec3::Z)]);
    assert_eq!((kept[0].front.material, back.material), (0, 3));
}

#[test]
fn middles_that_rounding_moves_off_their_edges_are_dropped() {
    // A tetrahedron away from the origin, and on each of its edges a triangle to the edge's rounded middle.
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z]
        .map(|corner| corner * 0.0371 + Vec3::new(0.31, -0.77, 0.53));
    let mut positions = corners.to_vec();
    let mut faces: Vec<Face> = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
        .map(face)
        .to_vec();
    for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
        faces.push(face([a, b, positions.len() as u32]));
        positions.push((corners[a as usize] + corners[b as usize] * 1.7) / 2.7);
    }
    let mended = mend(&positions, faces);
    assert_eq!((mended.faces.len(), mended.odd_edges), (4, 0));
}
