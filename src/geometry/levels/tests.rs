use super::*;
use crate::geometry::mesh::{RawLooks, RawTriangle};
use glam::{Vec2, Vec4};
use std::f32::consts::{PI, TAU};

fn raw(vertices: [u32; 3], material: u32) -> RawTriangle {
    RawTriangle {
        vertices,
        normals: [None; 3],
        material,
    }
}

/// A patch of `columns` by `rows` squares, each cut in two, with their places as a function of their share of both;
/// what falls together is welded.
fn patch(
    [columns, rows]: [u32; 2],
    crease_rad: f64,
    place: impl Fn(f32, f32) -> Vec3,
    material: impl Fn(f32, f32) -> u32,
) -> Mesh {
    let mut positions = Vec::new();
    for row in 0..=rows {
        for column in 0..=columns {
            positions.push(place(
                column as f32 / columns as f32,
                row as f32 / rows as f32,
            ));
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let at = |right: u32, up: u32| (row + up) * (columns + 1) + column + right;
            let material = material(
                (column as f32 + 0.5) / columns as f32,
                (row as f32 + 0.5) / rows as f32,
            );
            triangles.push(raw([at(0, 0), at(1, 0), at(1, 1)], material));
            triangles.push(raw([at(0, 0), at(1, 1), at(0, 1)], material));
        }
    }
    Mesh::weld(&positions, &triangles, crease_rad).0
}

/// Sine and cosine of a share of a turn, the same at both its ends.
fn turn(share: f32) -> (f32, f32) {
    if share == 1.0 {
        (0.0, 1.0)
    } else {
        (share * TAU).sin_cos()
    }
}

fn torus(columns: u32, rows: u32) -> Mesh {
    let place = |u: f32, v: f32| {
        let ((sin_u, cos_u), (sin_v, cos_v)) = (turn(u), turn(v));
        let radius = 1.0 + 0.4 * cos_v;
        Vec3::new(radius * cos_u, radius * sin_u, 0.4 * sin_v)
    };
    patch([columns, rows], 1.0, place, |u, _| u32::from(u > 0.5))
}

/// The box from 0 to (1, 1, 2), its sides cut into `cuts` by `cuts`, flat; opposite sides share a material.
fn cut_box(cuts: u32) -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
        let flat = |u: f32, v: f32| {
            let mut place = [side as f32; 3];
            place[(axis + 1) % 3] = u;
            place[(axis + 2) % 3] = v;
            Vec3::from_array(place) * Vec3::new(1.0, 1.0, 2.0)
        };
        let face = patch([cuts; 2], 0.0, flat, |_, _| 0);
        let first = positions.len() as u32;
        positions.extend(&face.positions);
        for [a, b, c] in face.triangles {
            let vertices = if side == 0 { [a, c, b] } else { [a, b, c] };
            triangles.push(raw(vertices.map(|vertex| first + vertex), axis as u32));
        }
    }
    Mesh::weld(&positions, &triangles, 0.0).0
}

/// A sphere of radius 1 with nearly equal triangles: an octahedron, its faces cut into `cuts` by `cuts`.
fn sphere(cuts: u32, radius: impl Fn(Vec3) -> f32) -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for octant in 0..8 {
        let sign = |bit: u32| if octant >> bit & 1 == 1 { -1.0 } else { 1.0 };
        let signs = Vec3::new(sign(0), sign(1), sign(2));
        let inward = signs.element_product() < 0.0;
        let mut triangle = |corners: [[u32; 2]; 3]| {
            let first = positions.len() as u32;
            positions.extend(corners.map(|[x, y]| {
                let [x, y, z] = [x, y, cuts - x - y].map(|part| part as f32);
                let direction = (Vec3::new(x, y, z) * signs).normalize();
                direction * radius(direction)
            }));
            let turned = if inward { [0, 2, 1] } else { [0, 1, 2] };
            triangles.push(raw(turned.map(|corner| first + corner), 0));
        };
        for (x, y) in (0..cuts).flat_map(|x| (0..cuts - x).map(move |y| (x, y))) {
            triangle([[x, y], [x + 1, y], [x, y + 1]]);
            if x + y + 2 <= cuts {
                triangle([[x + 1, y], [x + 1, y + 1], [x, y + 1]]);
            }
        }
    }
    Mesh::weld(&positions, &triangles, PI.into()).0
}

fn bumpy(direction: Vec3) -> f32 {
    let bumps = direction * 5.0;
    1.0 + 0.1 * bumps.x.sin() * bumps.y.cos() + 0.05 * (2.0 * bumps.z).sin()
}

/// An open bowl with a wavy rim.
fn bowl() -> Mesh {
    let place = |u: f32, v: f32| {
        let (sine, cosine) = turn(u);
        let radius = v * (1.0 + 0.1 * (5.0 * u * TAU).sin());
        Vec3::new(radius * cosine, radius * sine, 0.5 * v * v)
    };
    patch([96, 16], 1.0, place, |_, _| 0)
}

/// Numbers in [0, 1), the same in each run.
fn numbers(mut state: u64) -> impl FnMut() -> f32 {
    move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1_u64 << 24) as f32
    }
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [DVec3; 3]> + '_ {
    mesh.triangles
        .iter()
        .map(|triangle| triangle.map(|corner| mesh.positions[corner as usize].as_dvec3()))
}

/// Distance to a triangle by its barycentric regions (Ericson 2005, section 5.1.5).
fn triangle_distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (ab, ac) = (b - a, c - a);
    let [d1, d2] = [ab.dot(p - a), ac.dot(p - a)];
    let [d3, d4] = [ab.dot(p - b), ac.dot(p - b)];
    let [d5, d6] = [ab.dot(p - c), ac.dot(p - c)];
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let nearest = if d1 <= 0.0 && d2 <= 0.0 {
        a
    } else if d3 >= 0.0 && d4 <= d3 {
        b
    } else if d6 >= 0.0 && d5 <= d6 {
        c
    } else if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        a + ab * (d1 / (d1 - d3))
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        a + ac * (d2 / (d2 - d6))
    } else if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    } else {
        a + (ab * vb + ac * vc) / (va + vb + vc)
    };
    (p - nearest).length()
}

/// The largest distance from one mesh to another, at all points that cut each triangle's sides into `pieces`.
fn densely_sampled(from: &Mesh, to: &Mesh, pieces: u32) -> f64 {
    let targets: Vec<([DVec3; 3], DVec3, f64)> = corners(to)
        .map(|corners| {
            let center = corners.iter().sum::<DVec3>() / 3.0;
            let reach = corners.map(|corner| (corner - center).length());
            (corners, center, reach.into_iter().fold(0.0, f64::max))
        })
        .collect();
    let mut largest: f64 = 0.0;
    for [a, b, c] in corners(from) {
        for (i, j) in (0..=pieces).flat_map(|i| (0..=pieces - i).map(move |j| (i, j))) {
            let [x, y] = [i, j].map(|part| f64::from(part) / f64::from(pieces));
            let point = a + (b - a) * x + (c - a) * y;
            let mut least = f64::INFINITY;
            for (triangle, center, reach) in &targets {
                if (point - center).length() - reach < least {
                    least = least.min(triangle_distance(point, *triangle));
                }
            }
            largest = largest.max(least);
        }
    }
    largest
}

#[test]
fn a_sphere_s_levels_are_off_by_the_sag_of_their_triangles() {
    let sphere = sphere(24, |_| 1.0);
    assert_eq!(sphere.triangles.len(), 8 * 24 * 24);
    // How deep below the sphere a mesh with its corners on it lies at most.
    let depth_m = |mesh: &Mesh| {
        let depths = corners(mesh).map(|corners| 1.0 - triangle_distance(DVec3::ZERO, corners));
        depths.fold(0.0, f64::max)
    };
    let levels = levels(&sphere);
    assert!(levels.len() >= 5, "{}", levels.len());
    for level in &levels {
        let most_m = depth_m(&level.mesh);
        assert!(level.max_error_m <= 1.02 * most_m);
        assert!(level.max_error_m >= most_m - depth_m(&sphere));
        // Were the triangles equal: a side's square is 16 π / (√3 n), and their middles lie a sixth of it deep.
        let triangles = level.mesh.triangles.len() as f64;
        let sag_m = 16.0 * std::f64::consts::PI / (3.0_f64.sqrt() * triangles) / 6.0;
        let share = level.mean_error_m / sag_m;
        assert!(share > 0.5 && share < 1.1, "{triangles}: {share}");
    }
}

#[test]
fn triangles_halve_and_what_is_closed_stays_closed() {
    for mesh in [torus(60, 30), sphere(16, bumpy), cut_box(10)] {
        assert!(mesh.closed_and_consistent());
        let levels = levels(&mesh);
        assert!(levels.len() >= 3);
        let mut count = mesh.triangles.len();
        for level in &levels {
            let halved = level.mesh.triangles.len() as f64 / count as f64;
            assert!(halved > 0.4 && halved < 0.6, "{halved}");
            count = level.mesh.triangles.len();
            assert!(level.mesh.closed_and_consistent());
            assert!(count >= FEWEST);
            assert!(
                level
                    .mesh
                    .positions
                    .iter()
                    .all(|p| mesh.positions.contains(p))
            );
            let volume = level.mesh.signed_volume_m3() / mesh.signed_volume_m3();
            assert!(volume > 0.75 && volume < 1.05, "{volume}");
        }
    }
}

#[test]
fn errors_hold_at_every_point_of_a_denser_sampling() {
    for mesh in [sphere(10, bumpy), torus(36, 16), bowl()] {
        let levels = levels(&mesh);
        assert!(levels.len() >= 3);
        for level in levels {
            let forth = densely_sampled(&mesh, &level.mesh, 4);
            let back = densely_sampled(&level.mesh, &mesh, 16);
            let sampled_m = forth.max(back);
            assert!(
                sampled_m <= level.max_error_m && level.max_error_m < 1.06 * sampled_m,
                "{sampled_m} {level_m}",
                level_m = level.max_error_m
            );
            assert!(level.mean_error_m < level.max_error_m);
        }
    }
}

#[test]
fn a_cut_box_becomes_twelve_triangles_with_its_materials_and_flat_normals() {
    let mesh = cut_box(8);
    let levels = chain(&mesh, 12, &|| true);
    let smallest = &levels[levels.len() - 1].mesh;
    assert_eq!(
        (smallest.triangles.len(), smallest.positions.len()),
        (12, 8)
    );
    for level in &levels {
        assert!(level.max_error_m < 1e-6, "{}", level.max_error_m);
        for (index, triangle) in level.mesh.triangles.iter().enumerate() {
            let normal = face_normal(&level.mesh.positions, *triangle).as_vec3();
            assert_eq!(level.mesh.corner_normals[index], [normal; 3]);
            let axis = level.mesh.triangle_materials[index] as usize;
            assert!((normal[axis].abs() - 1.0).abs() < 1e-6);
        }
    }
    // In a mirrored placement the winding is turned, the normals are not.
    let mirrored = cut_box(8).with_winding_reversed();
    for level in chain(&mirrored, 12, &|| true) {
        for (triangle, normals) in level.mesh.triangles.iter().zip(&level.mesh.corner_normals) {
            let normal = face_normal(&level.mesh.positions, *triangle).as_vec3();
            assert_eq!(*normals, [-normal; 3]);
        }
    }
}

/// Whenever it is, it ends, and gives the first of all levels.
#[test]
fn levels_that_nobody_waits_for_any_more_are_not_made() {
    let (mesh, _) = pictured_torus(96, 48);
    let all = levels(&mesh);
    assert!(all.len() > 3);
    let mut ends = std::collections::BTreeSet::new();
    for asked in [0, 1, 2, 5, 20, 60, 150, 400, 1000] {
        let left = std::sync::atomic::AtomicI64::new(asked);
        let goes_on = || left.fetch_sub(1, std::sync::atomic::Ordering::Relaxed) > 0;
        let some = levels_while(&mesh, &goes_on);
        let counts = |levels: &[Level]| -> Vec<usize> {
            levels
                .iter()
                .map(|level| level.mesh.triangles.len())
                .collect()
        };
        assert_eq!(counts(&some), counts(&all)[..some.len()], "{asked}");
        ends.insert(some.len());
    }
    assert!(ends.contains(&0) && ends.len() > 2, "{ends:?}");
}

#[test]
fn smooth_surfaces_keep_their_normals_and_materials_their_parts() {
    let mesh = torus(80, 40);
    for level in levels(&mesh) {
        let mut areas = [0.0; 2];
        for (index, [a, b, c]) in corners(&level.mesh).enumerate() {
            let material = level.mesh.triangle_materials[index] as usize;
            areas[material] += (b - a).cross(c - a).length() / 2.0;
            // The first material has the half with y > 0.
            let inside = if material == 0 { 1.0 } else { -1.0 };
            assert!([a, b, c].iter().all(|corner| corner.y * inside > -1e-6));
            for (corner, normal) in level.mesh.triangles[index]
                .iter()
                .zip(level.mesh.corner_normals[index])
            {
                let place = level.mesh.positions[*corner as usize];
                let ring = place.truncate().normalize().extend(0.0);
                assert!(normal.angle_between(place - ring) < 0.15);
            }
        }
        assert!((areas[0] / areas[1] - 1.0).abs() < 0.1, "{areas:?}");
    }
}

/// A torus whose picture has a seam both ways round.
fn pictured_torus(columns: u32, rows: u32) -> (Mesh, impl Fn(Vec2) -> DVec3) {
    let place = |uv: Vec2| {
        let ((sin_u, cos_u), (sin_v, cos_v)) = (turn(uv.x), turn(uv.y));
        let radius = 1.0 + 0.4 * cos_v;
        Vec3::new(radius * cos_u, radius * sin_u, 0.4 * sin_v)
    };
    let uv =
        |column: u32, row: u32| Vec2::new(column as f32 / columns as f32, row as f32 / rows as f32);
    let at = |column: u32, row: u32| row * (columns + 1) + column;
    let (mut positions, mut looks) = (Vec::new(), RawLooks::default());
    for (row, column) in (0..=rows).flat_map(|row| (0..=columns).map(move |column| (row, column))) {
        positions.push(place(uv(column, row)));
        looks.looks.push(CornerLook {
            uv: [uv(column, row), Vec2::ZERO],
            ..CornerLook::default()
        });
    }
    let mut triangles = Vec::new();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let [a, b] = [at(column, row), at(column + 1, row)];
        let [c, d] = [at(column + 1, row + 1), at(column, row + 1)];
        for corners in [[a, b, c], [a, c, d]] {
            triangles.push(raw(corners, 0));
            looks.corners.push(corners);
        }
    }
    let mesh = Mesh::weld_with_looks(&positions, &triangles, &looks, 1.0).0;
    (mesh, move |uv| place(uv).as_dvec3())
}

#[test]
fn a_picture_keeps_its_seams_and_slides_no_farther_than_is_said() {
    let (mesh, place) = pictured_torus(80, 40);
    assert!(mesh.closed_and_consistent());
    let sag_m = 1.4 * (1.0 - (std::f64::consts::PI / 80.0).cos())
        + 0.4 * (1.0 - (std::f64::consts::PI / 40.0).cos());
    let levels = levels(&mesh);
    assert!(levels.len() >= 4, "{}", levels.len());
    for level in &levels {
        assert!(level.mesh.closed_and_consistent());
        let mut most_m: f64 = 0.0;
        for (corners, looks) in corners(&level.mesh).zip(&level.mesh.corner_looks) {
            let uv = looks.map(|look| level.mesh.looks[look as usize].uv[0]);
            for (i, j) in (0..=4_u32).flat_map(|i| (0..=4 - i).map(move |j| (i, j))) {
                let [x, y] = [i, j].map(|part| part as f32 / 4.0);
                let shown = uv[0] + (uv[1] - uv[0]) * x + (uv[2] - uv[0]) * y;
                let [x, y] = [x, y].map(f64::from);
                let here =
                    corners[0] + (corners[1] - corners[0]) * x + (corners[2] - corners[0]) * y;
                most_m = most_m.max(here.distance(place(shown)));
            }
        }
        let said_m = level.max_error_m;
        assert!(
            most_m < 1.5 * said_m + 2.0 * sag_m,
            "{most_m}, said {said_m}"
        );
    }
}

/// A flat sheet whose corners have the colours of a ramp may lose them all, one of a noise none.
#[test]
fn colours_at_corners_are_kept() {
    let counts = [true, false].map(|is_even| {
        let mut next = numbers(5);
        let flat = |u: f32, v: f32| Vec3::new(u, v, 0.0);
        let mut mesh = patch([30, 30], 0.0, flat, |_, _| 0);
        let color = |place: &Vec3| match is_even {
            true => place.extend(1.0),
            false => Vec4::new(next(), next(), next(), 1.0),
        };
        let colors: Vec<Vec4> = mesh.positions.iter().map(color).collect();
        mesh.looks = colors
            .into_iter()
            .map(|color| CornerLook {
                color,
                ..CornerLook::default()
            })
            .collect();
        mesh.corner_looks = mesh.triangles.clone();
        levels(&mesh).len()
    });
    assert!(counts[0] >= 3 && counts[1] == 0, "{counts:?}");
}

#[test]
fn creases_stay_creases() {
    // A can: its wall is smooth, its lids are flat, and the file says so.
    let place = |u: f32, v: f32| {
        let (sine, cosine) = turn(u);
        let (radius, height) = match v {
            v if v < 0.25 => (4.0 * v, 0.0),
            v if v > 0.75 => (4.0 * (1.0 - v), 2.0),
            v => (1.0, 4.0 * v - 1.0),
        };
        Vec3::new(radius * cosine, radius * sine, height)
    };
    let can = patch([64, 32], 0.8, place, |_, _| 0);
    let levels = levels(&can);
    assert!(levels.len() >= 3);
    for level in levels {
        for (triangle, normals) in level.mesh.triangles.iter().zip(&level.mesh.corner_normals) {
            let face = face_normal(&level.mesh.positions, *triangle).as_vec3();
            for normal in normals {
                // What a coarse level cuts off the crease is neither lid nor wall.
                if face.z.abs() > 0.99 {
                    assert!(normal.dot(face) > 0.999, "{face} {normal}");
                } else if face != Vec3::ZERO && face.z.abs() < 0.5 {
                    assert!(normal.z.abs() < 0.01, "{face} {normal}");
                }
            }
        }
    }
}

/// Long triangles that cross each other, each in the boxes of most: their levels would take the square of their number.
#[test]
fn a_tangle_of_long_triangles_has_no_levels() {
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let positions: Vec<Vec3> = (0..60_000)
        .map(|_| Vec3::new(random(), random(), random()))
        .collect();
    let triangles: Vec<_> = (0..20_000)
        .map(|k| raw([3 * k, 3 * k + 1, 3 * k + 2], 0))
        .collect();
    let tangle = Mesh::weld(&positions, &triangles, 0.0).0;
    assert_eq!(levels(&tangle), []);
    let distance = |mesh: &Mesh| {
        let surface = SampledSurface::new(mesh).unwrap();
        surface.distance_to(&surface, &|| true)
    };
    assert_eq!(distance(&tangle), None);
    let ball = distance(&sphere(50, |_| 1.0)).unwrap();
    assert!(ball.max_m < 1e-6, "{ball:?}");
}

#[test]
fn a_book_of_thousands_of_pages_has_no_levels() {
    let book = |pages: u32| {
        let page = |k: u32| Vec3::new((k as f32).cos(), (k as f32).sin(), 0.5);
        let positions: Vec<Vec3> = [Vec3::ZERO, Vec3::Z]
            .into_iter()
            .chain((0..pages).map(page))
            .collect();
        let triangles: Vec<_> = (0..pages).map(|k| raw([0, 1, 2 + k], 0)).collect();
        Mesh::weld(&positions, &triangles, 0.0).0
    };
    assert!(!has_crowded_edge(&book(MOST_ON_AN_EDGE as u32)));
    assert_eq!(levels(&book(20_000)), []);
}

/// A can whose lids are fans about their middles: where so many triangles meet, some of them stand for all.
#[test]
fn the_lids_of_a_round_can_stay_flat() {
    let slices = 3 * MOST_CORNERS as u32;
    let place = |u: f32, v: f32| {
        let (sine, cosine) = turn(u);
        let radius = if v == 0.0 || v == 1.0 { 0.0 } else { 1.0 };
        let height = if v < 0.5 { -0.5 } else { 0.5 };
        Vec3::new(radius * cosine, radius * sine, height)
    };
    let can = patch([slices, 3], 30.0_f64.to_radians(), place, |_, _| 0);
    assert!(can.closed_and_consistent());
    let levels = levels(&can);
    assert!(!levels.is_empty());
    for level in &levels {
        assert!(level.mesh.closed_and_consistent());
        for (corners, normals) in corners(&level.mesh).zip(&level.mesh.corner_normals) {
            let [a, b, c] = corners;
            let face = (b - a).cross(c - a).normalize();
            let is_lid = face.z.abs() > 0.99;
            for normal in normals {
                let is_kept = match is_lid {
                    true => normal.dot(face.as_vec3()) > 0.999,
                    // (What a coarse level cuts off the crease is neither.)
                    false => face.z.abs() > 0.5 || normal.z.abs() < 0.01,
                };
                assert!(is_kept, "{face}: {normals:?}");
            }
        }
    }
}

#[test]
fn a_rim_is_part_of_the_outline_and_its_error_counts() {
    // A flat disc: only its rim can be off.
    let place = |u: f32, v: f32| {
        let (sine, cosine) = turn(u);
        Vec3::new(v * cosine, v * sine, 0.0)
    };
    let disc = patch([96, 12], 0.0, place, |_, _| 0);
    let levels = levels(&disc);
    assert!(levels.len() >= 3);
    for level in levels {
        let area: f64 = corners(&level.mesh)
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
            .sum();
        let lost = corners(&disc)
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
            .sum::<f64>()
            - area;
        let rim_m = std::f64::consts::TAU;
        assert!(lost <= rim_m * level.max_error_m + 1e-9);
        assert!(
            lost <= 1.1 * rim_m * level.mean_error_m + 1e-9,
            "{lost} {}",
            level.mean_error_m
        );
        assert!(level.mesh.open_edge_count() > 0);
    }
}

/// Soups of all kinds: loose and tangled triangles, a strip with half a twist, and a torus turned, doubled, scaled and moved.
fn soups() -> Vec<Mesh> {
    let mut number = numbers(3);
    let mut vector = || Vec3::new(number(), number(), number());
    // Loose triangles.
    let positions: Vec<Vec3> = (0..3000).map(|_| vector()).collect();
    let loose: Vec<RawTriangle> = (0..1000)
        .map(|i| raw([3 * i, 3 * i + 1, 3 * i + 2], 0))
        .collect();
    // Triangles between few points: edges with many faces.
    let tangled: Vec<RawTriangle> = (0..1500)
        .map(|i| raw([i % 61, (i * 7 + 1) % 59, (i * 31 + 2) % 53], i % 3))
        .collect();
    let mut soups = vec![
        Mesh::weld(&positions, &loose, 0.0).0,
        Mesh::weld(&positions, &tangled, 0.5).0,
    ];
    // A strip with half a twist.
    let strip = |u: f32, v: f32| {
        let ((sin_u, cos_u), (sin_half, cos_half)) = ((u * TAU).sin_cos(), (u * PI).sin_cos());
        let radius = 1.0 + (v - 0.5) * 0.4 * cos_half;
        Vec3::new(radius * cos_u, radius * sin_u, (v - 0.5) * 0.4 * sin_half)
    };
    soups.push(patch([200, 4], 1.0, strip, |_, _| 0));
    // A torus with every third triangle turned round, one with each doubled, a huge, a tiny, and a far one.
    let torus = torus(40, 20);
    let mut turned = torus.clone();
    turned
        .triangles
        .iter_mut()
        .step_by(3)
        .for_each(|corners| corners.swap(0, 1));
    let mut doubled = torus.clone();
    doubled.triangles.extend_from_slice(&torus.triangles);
    doubled
        .corner_normals
        .extend_from_slice(&torus.corner_normals);
    doubled
        .triangle_materials
        .extend_from_slice(&torus.triangle_materials);
    let moved = |scale: f32, by: f32| {
        let mut moved = torus.clone();
        moved
            .positions
            .iter_mut()
            .for_each(|place| *place = *place * scale + Vec3::splat(by));
        moved
    };
    soups.extend([
        turned,
        doubled,
        moved(1e12, 0.0),
        moved(1e-12, 0.0),
        moved(1.0, 3e3),
    ]);
    soups
}

fn assert_levels_hold(index: usize, soup: &Mesh) {
    let diagonal_m = Bounds::around(soup.positions.iter().map(|p| p.as_dvec3()))
        .map_or(0.0, |bounds| (bounds.high - bounds.low).length());
    let mut count = soup.triangles.len();
    for level in levels(soup) {
        assert!(level.mesh.triangles.len() < count, "soup {index}");
        count = level.mesh.triangles.len();
        assert_eq!(
            level.mesh.closed_and_consistent(),
            soup.closed_and_consistent()
        );
        assert!(
            level.max_error_m <= LARGEST_ERROR * diagonal_m,
            "soup {index}"
        );
        assert!(level.mean_error_m <= level.max_error_m, "soup {index}");
        let unit = |normal: &Vec3| (normal.length() - 1.0).abs() < 1e-3;
        assert!(
            level.mesh.corner_normals.iter().flatten().all(unit),
            "soup {index}"
        );
    }
}

#[test]
fn any_soup_has_levels_that_hold_or_none() {
    let soups = soups();
    for (index, soup) in soups.iter().enumerate() {
        assert_levels_hold(index, soup);
    }
    assert!(!levels(&soups[2]).is_empty() && !levels(&soups[6]).is_empty());
    let mut broken = torus(40, 20);
    broken.positions[7].y = f32::NAN;
    assert!(levels(&broken).is_empty() && levels(&Mesh::default()).is_empty());
    assert!(
        levels(&sphere(7, |_| 1.0)).is_empty(),
        "too small to be worth it"
    );
}

#[test]
fn facets_are_measured_where_a_surface_bends_and_nowhere_else() {
    let around = 36;
    for level in levels(&torus(around, 16)) {
        let facet_m = level.largest_facet_m;
        assert!(facet_m > 0.0 && facet_m < 4.0, "{facet_m}");
    }
    let flat = chain(&cut_box(8), 12, &|| true);
    assert!(flat.iter().all(|level| level.largest_facet_m == 0.0));
}

#[test]
fn the_coarsest_level_below_both_limits_is_chosen() {
    let levels = [
        (0.001, 0.00001),
        (0.002, 0.0003),
        (0.008, 0.0004),
        (0.02, 0.004),
    ];
    let chosen = |px_per_m: f64, limit_px| {
        let fits = |&&(max_m, mean_m): &&(f64, f64)| {
            is_close_enough(max_m * px_per_m, mean_m * px_per_m, limit_px)
        };
        levels.iter().rev().find(fits).map(|(max_m, _)| *max_m)
    };
    assert_eq!(chosen(10.0, 0.5), Some(0.02));
    assert_eq!(chosen(60.0, 0.5), Some(0.008));
    // The largest error would allow the next coarser one, the mean does not.
    assert_eq!(chosen(20.0, 0.5), Some(0.008));
    assert_eq!(chosen(200.0, 0.5), Some(0.001));
    assert_eq!(chosen(500.0, 0.5), None, "a limit is kept, not met");
    assert_eq!(chosen(0.0, 0.5), Some(0.02), "out of sight");
    assert_eq!(chosen(f64::INFINITY, 0.5), None);
    assert_eq!(chosen(0.0, 0.0), None, "no simplification is asked for");
}
