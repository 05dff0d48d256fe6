//! The cut held against regions whose edge is a circle or a line.

use std::f64::consts::PI;

use glam::Vec2;

use super::*;

/// What is within a circle of texture coordinates.
struct Disc {
    radius: f64,
    fine: f64,
}

impl Disc {
    fn distance(look: &CornerLook) -> f64 {
        (look.uv[0] - Vec2::splat(0.5)).as_dvec2().length()
    }
}

impl Region for Disc {
    fn inside(&self, look: &CornerLook) -> f64 {
        self.radius - Self::distance(look)
    }

    fn extent(&self, corners: [&CornerLook; 3]) -> Extent {
        let distances = corners.map(Self::distance);
        let reach = longest_uv(corners);
        if distances.iter().all(|it| *it <= self.radius) {
            Extent::Whole
        } else if distances.iter().all(|it| *it > self.radius + reach) {
            Extent::Nothing
        } else {
            Extent::Part
        }
    }

    fn is_fine(&self, corners: [&CornerLook; 3]) -> bool {
        longest_uv(corners) <= self.fine
    }
}

fn longest_uv([a, b, c]: [&CornerLook; 3]) -> f64 {
    let side = |a: &CornerLook, b: &CornerLook| f64::from(a.uv[0].distance(b.uv[0]));
    side(a, b).max(side(b, c)).max(side(c, a))
}

/// A square of two triangles, whose corners have numbers of their own; its uv is its xy.
fn square(material: u32) -> (Vec<Vec3>, Vec<RawTriangle>, RawLooks) {
    let corners = [
        [0.0, 0.0],
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
    ];
    let positions: Vec<Vec3> = corners.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect();
    let looks = RawLooks {
        looks: corners
            .iter()
            .map(|&uv| CornerLook {
                uv: [Vec2::from_array(uv), Vec2::ZERO],
                ..CornerLook::default()
            })
            .collect(),
        corners: vec![[0, 1, 2], [3, 4, 5]],
    };
    let triangles = [[0, 1, 2], [3, 4, 5]].map(|vertices| RawTriangle {
        vertices,
        normals: [Some(Vec3::Z); 3],
        material,
    });
    (positions, triangles.to_vec(), looks)
}

fn area(cut: &CutTriangles) -> f64 {
    let area = |triangle: &RawTriangle| {
        let [a, b, c] = triangle
            .vertices
            .map(|it| cut.positions[it as usize].as_dvec3());
        0.5 * (b - a).cross(c - a).z
    };
    cut.triangles.iter().map(area).sum()
}

/// Edges that one triangle alone has.
fn rim(cut: &CutTriangles) -> Vec<Edge> {
    let mut count: HashMap<Edge, u32> = HashMap::new();
    for triangle in &cut.triangles {
        let [a, b, c] = triangle.vertices;
        for edge in [edge(a, b), edge(b, c), edge(c, a)] {
            *count.entry(edge).or_default() += 1;
        }
    }
    let rim = count.into_iter().filter(|(_, count)| *count == 1);
    rim.map(|(edge, _)| edge).collect()
}

#[test]
fn a_disc_has_its_area_and_its_rim_alone() {
    let (positions, triangles, looks) = square(0);
    for fine in [0.05, 0.01] {
        let disc = Disc { radius: 0.4, fine };
        let cut = cut(
            (&positions, &[]),
            &triangles,
            &looks,
            |_| Some(&disc),
            1_000_000,
        );
        assert!(!cut.is_coarse);
        // A chord of length s lies s² / 8r within the circle, so the polygon lacks that by two thirds along its rim.
        let most = 2.0 * PI * 0.4 * fine * fine / (8.0 * 0.4);
        let lacking = PI * 0.16 - area(&cut);
        assert!(
            (-1e-4..most).contains(&lacking),
            "{fine}: {lacking} of {most}"
        );
        for (a, b) in rim(&cut) {
            for corner in [a, b] {
                let place = cut.positions[corner as usize];
                let off = place.truncate().distance(Vec2::splat(0.5)) - 0.4;
                assert!(off.abs() < 1e-4, "{place} is off the circle by {off}");
            }
        }
        // Looks follow their places.
        for (triangle, looks) in cut.triangles.iter().zip(&cut.looks.corners) {
            for (vertex, look) in triangle.vertices.iter().zip(looks) {
                let place = cut.positions[*vertex as usize].truncate();
                let uv = cut.looks.looks[*look as usize].uv[0];
                assert!(place.distance(uv) < 1e-5);
            }
        }
    }
}

#[test]
fn what_has_no_region_stays_and_closes_up_with_what_is_cut() {
    let (mut positions, mut triangles, mut looks) = square(0);
    let (beside, more, more_looks) = square(1);
    let first = positions.len() as u32;
    positions.extend(beside.iter().map(|place| *place + Vec3::X));
    looks.looks.extend(more_looks.looks);
    for (triangle, corners) in more.iter().zip(more_looks.corners) {
        let vertices = triangle.vertices.map(|vertex| first + vertex);
        triangles.push(RawTriangle {
            vertices,
            ..*triangle
        });
        looks.corners.push(corners.map(|look| first + look));
    }
    // The disc reaches the square beside.
    let disc = Disc {
        radius: 0.55,
        fine: 0.03,
    };
    let region = |material: u32| (material == 0).then_some(&disc as &dyn Region);
    let cut = cut((&positions, &[]), &triangles, &looks, region, 1_000_000);
    let of_second = |triangle: &&RawTriangle| triangle.material == 1;
    let second = CutTriangles {
        triangles: cut.triangles.iter().filter(of_second).copied().collect(),
        ..cut.clone()
    };
    assert!((area(&second) - 1.0).abs() < 1e-6);
    // Where the two meet inside the disc, their common side is passed by both.
    let half = (0.55_f32 * 0.55 - 0.25).sqrt();
    for (a, b) in rim(&cut) {
        let [a, b] = [a, b].map(|corner| cut.positions[corner as usize]);
        let on_seam = |place: Vec3| (place.x - 1.0).abs() < 1e-6;
        let within = |place: Vec3| (place.y - 0.5).abs() < half - 0.05;
        assert!(
            !(on_seam(a) && on_seam(b) && within(a) && within(b)),
            "{a} {b}"
        );
    }
}

#[test]
fn too_many_pieces_are_told_and_not_made() {
    let (positions, triangles, looks) = square(0);
    let disc = Disc {
        radius: 0.4,
        fine: 0.001,
    };
    let cut = cut((&positions, &[]), &triangles, &looks, |_| Some(&disc), 300);
    assert!(
        cut.is_coarse && cut.triangles.len() < 1500,
        "{}",
        cut.triangles.len()
    );
    assert!((area(&cut) - PI * 0.16).abs() < 0.01);
}
