use super::*;

fn raw(vertices: [u32; 3]) -> RawTriangle {
    RawTriangle {
        vertices,
        normals: [None; 3],
        material: 0,
    }
}

/// Flat triangles of one material, welded.
pub(crate) fn welded(positions: &[Vec3], triangles: &[[u32; 3]]) -> Mesh {
    let raw: Vec<RawTriangle> = triangles.iter().copied().map(raw).collect();
    Mesh::weld(positions, &raw, 0.0).0
}

/// A tetrahedron whose triangles share no vertex.
fn loose_tetrahedron() -> (Vec<Vec3>, Vec<RawTriangle>) {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let positions = faces
        .iter()
        .flatten()
        .map(|&corner| corners[corner as usize])
        .collect();
    (
        positions,
        (0..4)
            .map(|face| raw([3 * face, 3 * face + 1, 3 * face + 2]))
            .collect(),
    )
}

#[test]
fn welding_closes_what_is_closed_in_space() {
    let (mut positions, triangles) = loose_tetrahedron();
    positions[0] = Vec3::new(-0.0, 0.0, -0.0);
    let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
    assert_eq!(
        report,
        MeshReport {
            merged_vertices: 8,
            components: 1,
            closed: true,
            ..MeshReport::default()
        }
    );
    assert_eq!(mesh.positions.len(), 4);
    assert!(mesh.closed_and_consistent());
    assert!((mesh.signed_volume_m3() - 1.0 / 6.0).abs() < 1e-12);
    let reversed = mesh.with_winding_reversed();
    assert!(reversed.closed_and_consistent());
    assert!((reversed.signed_volume_m3() + 1.0 / 6.0).abs() < 1e-12);
}

#[test]
fn a_missing_triangle_opens_three_edges_and_a_turned_one_is_turned_back() {
    let (positions, mut triangles) = loose_tetrahedron();
    triangles[3].vertices.swap(0, 1);
    let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
    assert!(report.closed && mesh.closed_and_consistent());
    assert_eq!(report.turned_triangles, 1);
    triangles.pop();
    let report = Mesh::weld(&positions, &triangles, 0.0).1;
    assert_eq!((report.open_edges, report.closed), (3, false));
    assert!(!Mesh::default().closed_and_consistent());
}

#[test]
fn triangles_without_area_go() {
    let (mut positions, mut triangles) = loose_tetrahedron();
    triangles.push(raw([0, 0, 1]));
    let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
    assert_eq!(
        (
            mesh.triangles.len(),
            report.dropped_without_area,
            report.closed
        ),
        (4, 1, true)
    );

    // The edge from (1,0,0) to (0,1,0) of the last face gets a vertex in its middle, and a needle fills the gap:
    // the face on the other side is cut there instead.
    positions.push(Vec3::new(0.5, 0.5, 0.0));
    let [x, y, z] = [9, 10, 11];
    triangles[3].vertices = [x, 12, z];
    triangles[4] = raw([12, y, z]);
    triangles.push(raw([x, y, 12]));
    let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
    assert_eq!(
        report,
        MeshReport {
            merged_vertices: 8,
            dropped_without_area: 1,
            splits: 1,
            components: 1,
            closed: true,
            ..MeshReport::default()
        }
    );
    assert_eq!(mesh.triangles.len(), 6);
    assert!((mesh.signed_volume_m3() - 1.0 / 6.0).abs() < 1e-12);

    // By itself it joins nothing.
    let line = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    let (mesh, report) = Mesh::weld(&line, &[raw([0, 1, 2])], 0.0);
    assert_eq!(
        (
            mesh.positions.len(),
            mesh.triangles.len(),
            report.dropped_without_area
        ),
        (0, 0, 1)
    );
    assert!(!report.closed);
}

#[test]
fn normals_turn_with_their_triangle_unless_they_were_right() {
    let (positions, mut triangles) = loose_tetrahedron();
    for triangle in &mut triangles {
        let [a, b, c] = triangle.vertices.map(|vertex| positions[vertex as usize]);
        triangle.normals = [Some((b - a).cross(c - a)); 3];
    }
    let outward = Mesh::weld(&positions, &triangles, 0.0).0;
    // All inside out, and of two triangles the normals too.
    for triangle in &mut triangles {
        triangle.vertices.swap(0, 1);
    }
    for triangle in &mut triangles[..2] {
        triangle.normals = triangle.normals.map(|normal| normal.map(|normal| -normal));
    }
    let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
    assert_eq!((report.turned_triangles, report.closed), (4, true));
    assert_eq!(mesh.corner_normals, outward.corner_normals);
    assert!((mesh.signed_volume_m3() - 1.0 / 6.0).abs() < 1e-12);
}

#[test]
fn of_a_face_that_is_there_both_ways_round_a_closed_mesh_keeps_the_outer_one() {
    let (positions, mut triangles) = loose_tetrahedron();
    let mut outer = triangles[3];
    outer.normals = [Some(Vec3::ONE); 3];
    outer.material = 1;
    triangles[3].vertices.swap(0, 1);
    triangles.push(outer);
    triangles.push(triangles[0]);
    let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
    assert_eq!(
        report,
        MeshReport {
            merged_vertices: 8,
            dropped_duplicates: 2,
            components: 1,
            closed: true,
            ..MeshReport::default()
        }
    );
    assert_eq!(mesh.triangle_materials, [0, 0, 0, 1]);
    assert_eq!(mesh.corner_normals[3], [Vec3::ONE.normalize(); 3]);
}

#[test]
fn a_sheet_of_two_sides_is_closed_and_has_a_normal_on_each() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)];
    let sides = [[0, 1, 2], [1, 3, 2], [2, 1, 0], [2, 3, 1]].map(raw);
    let (mesh, report) = Mesh::weld(&positions, &sides, 0.0);
    assert_eq!((report.open_edges, report.closed), (0, true));
    assert_eq!((report.dropped_duplicates, report.crowded_edges), (0, 1));
    let up = mesh
        .corner_normals
        .iter()
        .filter(|normals| **normals == [Vec3::Z; 3]);
    let down = mesh
        .corner_normals
        .iter()
        .filter(|normals| **normals == [-Vec3::Z; 3]);
    assert_eq!((up.count(), down.count()), (2, 2));
}

#[test]
fn it_winds_once_around_its_inside() {
    let (positions, triangles) = loose_tetrahedron();
    let mesh = Mesh::weld(&positions, &triangles, 0.0).0;
    assert!((mesh.winding_number(DVec3::splat(0.1)) - 1.0).abs() < 1e-12);
    assert!(mesh.winding_number(DVec3::splat(0.4)).abs() < 1e-12);
}

#[test]
fn given_normals_are_made_unit_and_zero_ones_are_replaced() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let normals = [Some(Vec3::new(0.0, 3.0, 4.0)), Some(Vec3::ZERO), None];
    let triangle = RawTriangle {
        vertices: [0, 1, 2],
        normals,
        material: 0,
    };
    let (mesh, _) = Mesh::weld(&positions, &[triangle], 0.0);
    assert_eq!(
        mesh.corner_normals[0],
        [Vec3::new(0.0, 0.6, 0.8), Vec3::Z, Vec3::Z]
    );
}

/// Marsaglia's xorshift: the same soups in each run.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % u64::from(end)) as u32
    }

    fn point(&mut self) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| {
            let share = f64::from(self.below(1 << 30)) / f64::from(1 << 30);
            3.0 * share - 0.5
        }))
    }
}

fn passes_through(positions: &[Vec3], corners: [u32; 3], from: DVec3, to: DVec3) -> bool {
    let [a, b, c] = corners.map(|index| positions[index as usize].as_dvec3());
    let side = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    let around = [(a, b), (b, c), (c, a)].map(|(p, q)| side(from, to, p, q));
    let one_way = around.iter().all(|&s| s > 0.0) || around.iter().all(|&s| s < 0.0);
    one_way && side(a, b, c, from) * side(a, b, c, to) < 0.0
}

#[test]
fn mending_never_changes_what_lies_between_two_points() {
    // On a grid of 27 points all goes wrong at once: needles, duplicates, sheets of two sides, fins, vertices on
    // edges.
    let positions: Vec<Vec3> = (0..27)
        .map(|index| {
            Vec3::new(
                (index % 3) as f32,
                (index / 3 % 3) as f32,
                (index / 9) as f32,
            )
        })
        .collect();
    let mut random = Random(3);
    let (mut splits, mut duplicates, mut turned, mut hidden) = (0, 0, 0, 0);
    for soup in 0..400 {
        let triangles: Vec<RawTriangle> = (0..1 + random.below(60))
            .map(|_| raw([random.below(27), random.below(27), random.below(27)]))
            .collect();
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.5);
        splits += report.splits;
        duplicates += report.dropped_duplicates;
        turned += report.turned_triangles;
        assert_eq!(report.open_edges, mesh.open_edge_count());
        for _ in 0..40 {
            let (from, to) = (random.point(), random.point());
            let before = triangles
                .iter()
                .any(|triangle| passes_through(&positions, triangle.vertices, from, to));
            let after = mesh
                .triangles
                .iter()
                .any(|&corners| passes_through(&mesh.positions, corners, from, to));
            assert_eq!(before, after, "soup {soup}: {from} to {to}");
            hidden += usize::from(before);
        }
    }
    assert!(splits > 100 && duplicates > 10 && turned > 1000 && hidden > 2000);
}
