use std::f64::consts::{FRAC_PI_6, PI};

use super::*;
use crate::geometry::mesh::{Mesh, MeshReport};
use crate::geometry::normals::face_normal;

const CREASE_RAD: f64 = FRAC_PI_6;

fn welded(shape: &BasicShape) -> (Mesh, MeshReport) {
    let ShapeTriangles {
        positions,
        triangles,
    } = shape.triangles(CREASE_RAD);
    Mesh::weld(&positions, &triangles, CREASE_RAD)
}

/// The mesh of a shape that bounds a volume, which needed no mending.
fn solid(shape: &BasicShape) -> Mesh {
    let (mesh, report) = welded(shape);
    let expected = MeshReport {
        components: 1,
        closed: true,
        ..MeshReport::default()
    };
    assert_eq!(report, expected, "{shape:?}");
    mesh
}

fn corner(mesh: &Mesh, index: u32) -> DVec3 {
    mesh.positions[index as usize].as_dvec3()
}

fn area_m2(mesh: &Mesh) -> f64 {
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|index| corner(mesh, index));
        (b - a).cross(c - a).length() / 2.0
    };
    mesh.triangles.iter().map(area).sum()
}

/// Each corner with its normal and its face's.
fn corners(mesh: &Mesh) -> impl Iterator<Item = (DVec3, DVec3, DVec3)> + '_ {
    let triangles = mesh.triangles.iter().zip(&mesh.corner_normals);
    triangles.flat_map(move |(triangle, normals)| {
        let face = face_normal(&mesh.positions, *triangle);
        let corners = triangle.iter().zip(normals);
        corners.map(move |(&index, normal)| (corner(mesh, index), normal.as_dvec3(), face))
    })
}

fn is_near(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-5 * expected.abs()
}

fn places<const N: usize>(places: [[f64; 2]; N]) -> Vec<DVec2> {
    places.map(DVec2::from_array).to_vec()
}

fn prism_of(outline: &[DVec2], height_m: f64) -> BasicShape {
    BasicShape::Prism {
        outline: Outline::new(outline).unwrap(),
        height_m,
    }
}

fn revolved_of(profile: &[DVec2]) -> BasicShape {
    BasicShape::Revolved(Profile::new(profile).unwrap())
}

/// The area of the polygon that stands for a circle of radius 1, and its circumference.
fn circle() -> (f64, f64) {
    let half = PI / f64::from(SIDES);
    let sides = f64::from(SIDES);
    (sides * half.sin() * half.cos(), 2.0 * sides * half.sin())
}

#[test]
fn a_box_has_its_sides() {
    let (low, high) = (DVec3::new(-0.1, -0.2, 0.0), DVec3::new(0.1, 0.2, 0.05));
    let mesh = solid(&BasicShape::Cuboid { low, high });
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (8, 12));
    assert!(is_near(mesh.signed_volume_m3(), 0.2 * 0.4 * 0.05));
    assert!(is_near(area_m2(&mesh), 2.0 * (0.08 + 0.01 + 0.02)));
    assert!(corners(&mesh).all(|(_, normal, face)| normal.distance(face) < 1e-6));
}

#[test]
fn a_cylinder_is_round_and_its_rims_are_sharp() {
    let (radius, height) = (0.04, 0.1);
    let shape = BasicShape::Revolved(Profile::between_discs(radius, radius, height).unwrap());
    let mesh = solid(&shape);
    assert_eq!(mesh.triangles.len() as u32, 4 * SIDES);
    let (area, around) = circle();
    let (disc, wall) = (area * radius * radius, around * radius * height);
    assert!(is_near(mesh.signed_volume_m3(), disc * height));
    assert!(is_near(area_m2(&mesh), 2.0 * disc + wall));
    for (place, normal, face) in corners(&mesh) {
        let expected = match face.z.abs() > 0.5 {
            true => DVec3::Z * place.z.mul_add(2.0, -height).signum(),
            false => place.with_z(0.0).normalize(),
        };
        assert!(normal.distance(expected) < 1e-6, "{place}: {normal}");
    }
    // Its outline is off by what is promised: a fifth of a pixel of a circle 720 pixels wide.
    let half = PI / f64::from(SIDES);
    let off = mesh.triangles.iter().flat_map(|&[a, b, c]| {
        let [a, b, c] = [a, b, c].map(|index| corner(&mesh, index).with_z(0.0));
        let edges = [(a, b), (b, c), (c, a)];
        edges.map(|(from, to)| ((from + to) / 2.0).length())
    });
    let rims = off.filter(|&middle| middle > 0.9 * radius);
    let nearest = rims.fold(f64::INFINITY, f64::min);
    assert!(is_near(nearest, radius * half.cos()), "{nearest}");
    assert!((1.0 - half.cos()) * 360.0 < 0.2);
}

#[test]
fn a_ball_lies_on_its_lowest_point_and_is_as_round_as_a_cylinder() {
    let radius = 0.03;
    let mesh = solid(&BasicShape::Ball { radius_m: radius });
    let center = DVec3::Z * radius;
    let lowest = mesh.positions.iter().map(|place| place.z);
    assert_eq!(lowest.fold(f32::INFINITY, f32::min), 0.0);
    let mut nearest = radius;
    for (triangle, normals) in mesh.triangles.iter().zip(&mesh.corner_normals) {
        let face = face_normal(&mesh.positions, *triangle);
        for (&index, normal) in triangle.iter().zip(normals) {
            let outwards = corner(&mesh, index) - center;
            assert!((outwards.length() - radius).abs() < 1e-8);
            assert!(normal.as_dvec3().distance(outwards / radius) < 1e-6);
            nearest = nearest.min(face.dot(outwards));
        }
    }
    let half = PI / f64::from(SIDES);
    assert!(nearest > radius * half.cos(), "{}", 1.0 - nearest / radius);
    // Inscribed, and nowhere farther off than that.
    let (volume, area) = (4.0 / 3.0 * PI * radius.powi(3), 4.0 * PI * radius * radius);
    let (least_volume, least_area) = (half.cos().powi(3) * volume, half.cos().powi(2) * area);
    assert!((least_volume..volume).contains(&mesh.signed_volume_m3()));
    assert!((least_area..area).contains(&area_m2(&mesh)));
}

#[test]
fn a_cone_shades_as_its_own_sides_do() {
    let (radius, height) = (0.03, 0.08);
    let mesh = solid(&BasicShape::Revolved(
        Profile::between_discs(radius, 0.0, height).unwrap(),
    ));
    assert_eq!(mesh.triangles.len() as u32, 2 * SIDES);
    let (area, _) = circle();
    assert!(is_near(
        mesh.signed_volume_m3(),
        area * radius * radius * height / 3.0
    ));
    let slope = DVec2::new(height, radius).normalize();
    for (place, normal, face) in corners(&mesh) {
        if face.z < -0.5 {
            assert!(normal.distance(DVec3::NEG_Z) < 1e-6);
            continue;
        }
        // At its tip each side has a normal of its own.
        let facing = match place.truncate() == DVec2::ZERO {
            true => face.truncate().normalize(),
            false => place.truncate().normalize(),
        };
        let expected = (facing * slope.x).extend(slope.y);
        assert!(normal.distance(expected) < 1e-6, "{place}: {normal}");
    }
}

#[test]
fn prisms_bound_the_area_of_their_outline() {
    // The letter L, with a place amid a side.
    let outline = places([
        [0.0, 0.0],
        [0.08, 0.0],
        [0.08, 0.02],
        [0.05, 0.02],
        [0.02, 0.02],
        [0.02, 0.06],
        [0.0, 0.06],
    ]);
    let (area, around) = (0.08 * 0.02 + 0.02 * 0.04, 2.0 * (0.08 + 0.06));
    let height = 0.03;
    for is_reversed in [false, true] {
        for start in 0..outline.len() {
            let mut outline = outline.clone();
            outline.rotate_left(start);
            if is_reversed {
                outline.reverse();
            }
            // The first place once more at the end.
            outline.extend((start == 3).then_some(outline[0]));
            let (mesh, report) = welded(&prism_of(&outline, height));
            assert!(report.closed && report.components == 1, "{report:?}");
            assert!(is_near(mesh.signed_volume_m3(), area * height));
            assert!(is_near(area_m2(&mesh), 2.0 * area + around * height));
            assert!(corners(&mesh).all(|(_, normal, face)| normal.distance(face) < 1e-6));
        }
    }
    // A round outline is round, and its rims are sharp.
    let circle: Vec<DVec2> = (0..60)
        .map(|step| DVec2::from_angle(f64::from(step) * TAU / 60.0) * 0.05)
        .collect();
    let mesh = solid(&prism_of(&circle, height));
    for (place, normal, face) in corners(&mesh) {
        let expected = match face.z.abs() > 0.5 {
            true => face,
            false => place.with_z(0.0).normalize(),
        };
        assert!(normal.distance(expected) < 1e-6, "{place}: {normal}");
    }
}

#[test]
fn profiles_sweep_what_guldin_says() {
    let (area, _) = circle();
    // As much of a full turn as the sides cover.
    let part = area / PI;
    // A mug's wall and floor, from its bottom's middle to its floor's, either way; a ring; an hourglass without its middle.
    let mug = places([
        [0.0, 0.0],
        [0.04, 0.0],
        [0.04, 0.1],
        [0.036, 0.1],
        [0.036, 0.005],
        [0.0, 0.005],
    ]);
    let mug_m3 = PI * (0.04_f64.powi(2) * 0.1 - 0.036_f64.powi(2) * 0.095);
    let ring = places([
        [0.03, 0.0],
        [0.05, 0.0],
        [0.05, 0.01],
        [0.03, 0.01],
        [0.03, 0.0],
    ]);
    let ring_m3 = TAU * 0.04 * 0.02 * 0.01;
    let frustum = places([[0.02, 0.01], [0.04, 0.07]]);
    let frustum_m3 = PI * 0.06 / 3.0 * (0.02_f64.powi(2) + 0.02 * 0.04 + 0.04_f64.powi(2));
    for (profile, volume_m3) in [(mug, mug_m3), (ring, ring_m3), (frustum, frustum_m3)] {
        for is_reversed in [false, true] {
            let mut profile = profile.clone();
            if is_reversed {
                profile.reverse();
            }
            let mesh = solid(&revolved_of(&profile));
            let found = mesh.signed_volume_m3();
            assert!(is_near(found, part * volume_m3), "{found} {volume_m3}");
        }
    }
}

#[test]
fn a_profile_that_bends_gently_looks_round() {
    // Half a circle, from pole to pole.
    let radius = 0.05;
    let profile: Vec<DVec2> = (0..=40)
        .map(|step| match step {
            0 => DVec2::NEG_Y * radius,
            40 => DVec2::Y * radius,
            _ => DVec2::from_angle(PI * (f64::from(step) / 40.0 - 0.5)) * radius,
        })
        .collect();
    let mesh = solid(&revolved_of(&profile));
    for (place, normal, _) in corners(&mesh) {
        assert!(normal.distance(place / radius) < 1e-6, "{place}: {normal}");
    }
    let (mesh, flat) = (mesh, revolved_of(&profile).triangles(0.0));
    assert_eq!(mesh.positions.len(), flat.positions.len());
    let bends = flat.triangles.iter().any(|triangle| {
        let place = flat.positions[triangle.vertices[0] as usize].as_dvec3() / radius;
        triangle.normals[0].unwrap().as_dvec3().distance(place) > 0.03
    });
    assert!(bends, "0 is flat along the profile");
}

#[test]
fn outlines_that_bound_nothing_are_told_apart() {
    use OutlineFault::{Meeting, TooFew, Twice};
    let bow_tie = places([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
    let touching = places([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
    let spike = places([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0], [0.5, 1.0]]);
    let line = places([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]);
    let twice = places([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    for (outline, fault) in [
        (bow_tie, Meeting([0, 2])),
        (touching, Meeting([0, 2])),
        (spike, Meeting([0, 2])),
        (line, Meeting([1, 2])),
        (twice, Twice(2)),
        (places([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]), TooFew),
        (places([[1.0, 1.0]]), TooFew),
        (Vec::new(), TooFew),
    ] {
        assert_eq!(Outline::new(&outline), Err(fault), "{outline:?}");
    }
    // Discs at the ends take part: one that would lie in the other, one that cuts the wall.
    let flat = places([[0.02, 0.0], [0.04, 0.0]]);
    assert!(Profile::new(&flat).is_err());
    let through = places([[0.04, 0.0], [0.02, 0.05], [0.04, 0.1], [0.05, 0.05]]);
    assert_eq!(Profile::new(&through), Err(Meeting([0, 3])));
    assert_eq!(Profile::new(&[]), Err(TooFew));
    assert_eq!(Profile::new(&places([[0.0, 0.0], [0.0, 1.0]])), Err(TooFew));
}

#[test]
fn a_rectangle_faces_up() {
    let shape = BasicShape::Rectangle {
        low: DVec2::new(-0.1, -0.2),
        high: DVec2::new(0.3, 0.2),
    };
    let (mesh, report) = welded(&shape);
    assert_eq!((mesh.triangles.len(), report.open_edges), (2, 4));
    assert!(is_near(area_m2(&mesh), 0.4 * 0.4));
    assert!(corners(&mesh).all(|(place, normal, _)| normal == DVec3::Z && place.z == 0.0));
}

#[test]
fn coarser_versions_of_what_is_round_keep_to_what_they_say() {
    let bottle = revolved_of(&places([
        [0.03, 0.0],
        [0.03, 0.1],
        [0.01, 0.13],
        [0.01, 0.15],
    ]));
    for shape in [bottle, BasicShape::Ball { radius_m: 0.03 }] {
        let mesh = solid(&shape);
        let levels = crate::geometry::levels::levels(&mesh);
        assert!(!levels.is_empty(), "{shape:?}");
        for level in levels {
            assert!(level.mesh.closed_and_consistent());
            let mut bounds_off: f64 = 0.0;
            for axis in 0..3 {
                let extent = |mesh: &Mesh| {
                    let along = mesh.positions.iter().map(|place| f64::from(place[axis]));
                    let (low, high) = along.fold((f64::MAX, f64::MIN), |(low, high), at| {
                        (low.min(at), high.max(at))
                    });
                    high - low
                };
                bounds_off = bounds_off.max((extent(&mesh) - extent(&level.mesh)).abs());
            }
            assert!(bounds_off <= 2.0 * level.max_error_m + 1e-9);
        }
    }
}
