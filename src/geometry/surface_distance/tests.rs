use super::*;
use crate::geometry::cuboid::cuboid;
use crate::geometry::mesh::RawTriangle;
use glam::Vec3;

fn surface(corners: &[[Vec3; 3]]) -> SampledSurface {
    let triangles: Vec<RawTriangle> = (0..corners.len() as u32)
        .map(|triangle| RawTriangle {
            vertices: [0, 1, 2].map(|corner| 3 * triangle + corner),
            normals: [None; 3],
            material: 0,
        })
        .collect();
    SampledSurface::new(&Mesh::weld(corners.as_flattened(), &triangles, 0.0).0).expect("a surface")
}

fn square(half: f32, z: f32) -> [[Vec3; 3]; 2] {
    let corner = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
    [
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
    ]
}

fn apart(one: &SampledSurface, other: &SampledSurface) -> SurfaceDistance {
    one.distance_to(other, &|| true).expect("somebody waits")
}

#[test]
fn parallel_squares_lie_their_gap_apart_and_a_smaller_one_farther() {
    let margin = 1.0 + TOLERANCE;
    let (large, near) = (surface(&square(1.0, 0.0)), surface(&square(1.0, 0.25)));
    let distance = apart(&large, &near);
    assert!((distance.max_m - 0.25 * margin).abs() < 1e-9);
    assert!((distance.outline_mean_m - 0.25).abs() < 1e-9);
    let same = apart(&large, &large);
    assert_eq!((same.max_m, same.outline_mean_m), (0.0, 0.0));
    // The corner of the large square is √2 / 2 from the small one's; all points of the small one are at 0.
    let small = surface(&square(0.5, 0.0));
    for distance in [apart(&large, &small), apart(&small, &large)] {
        assert!((distance.max_m - 0.5_f64.sqrt() * margin).abs() < 1e-9);
        assert!(distance.outline_mean_m > 0.5);
    }
}

#[test]
fn a_peak_within_a_large_triangle_is_found() {
    // A tent over a square: its tip is the tent's vertex, below which the square has none.
    let tip = Vec3::new(0.31, -0.17, 0.1);
    let tent: Vec<[Vec3; 3]> = square(1.0, 0.0)
        .iter()
        .flat_map(|&[a, b, c]| [[a, b, tip], [b, c, tip], [c, a, tip]])
        .collect();
    let distance = apart(&surface(&square(1.0, 0.0)), &surface(&tent));
    assert!((distance.max_m / 0.1 / (1.0 + TOLERANCE) - 1.0).abs() < 1e-6);
}

#[test]
fn the_outline_is_where_faces_meet_at_an_angle() {
    let (corners, triangles) = cuboid(Vec3::ZERO, Vec3::ONE);
    let places = |triangle: [u32; 3]| triangle.map(|corner| corners[corner as usize]);
    let cube: Vec<[Vec3; 3]> = triangles.into_iter().map(places).collect();
    let mut shares: Vec<f64> = surface(&cube)
        .edges
        .iter()
        .map(|e| e.outline_share)
        .collect();
    shares.sort_by(f64::total_cmp);
    assert_eq!(shares.len(), 18);
    assert!(shares[..6].iter().all(|share| share.abs() < 1e-12));
    assert!(shares[6..].iter().all(|share| (share - 0.5).abs() < 1e-12));
    assert_eq!(
        surface(&square(1.0, 0.0))
            .edges
            .iter()
            .filter(|e| e.outline_share == 1.0)
            .count(),
        4
    );
}

#[test]
fn a_needle_is_as_far_as_its_edges() {
    let needle = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
    for (point, away_m) in [
        (DVec3::new(1.5, 0.0, 3.0), 3.0),
        (DVec3::new(-3.0, 4.0, 0.0), 5.0),
        (DVec3::new(2.0, 1.0, 0.0), 1.0),
    ] {
        assert!((distance_squared(point, &needle) - away_m * away_m).abs() < 1e-12);
    }
}

#[test]
fn work_keeps_its_order() {
    for count in [0, 1, CHUNK, 5 * CHUNK + 3] {
        let done = in_parallel(count, &|| true, |range| range.collect::<Vec<usize>>());
        assert!(done.into_iter().eq(0..count));
    }
}
