//! Triangle meshes made in code, good and bad ones.

use std::f32::consts::{PI, TAU};
use std::fmt::Write as _;

use glam::{Vec2, Vec3};

use super::random::Random;

/// Triangles as a file has them: nothing welded, merged or turned.
#[derive(Debug, Clone, Default)]
pub struct Soup {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// One for each position, where the surface is meant to be smooth.
    pub normals: Option<Vec<Vec3>>,
}

impl Soup {
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        Self {
            positions,
            triangles,
            normals: None,
        }
    }

    /// The text of an OBJ file; a number's text gives the very number back.
    pub fn to_obj(&self) -> String {
        let mut text = String::new();
        for p in &self.positions {
            writeln!(text, "v {} {} {}", p.x, p.y, p.z).expect("text");
        }
        for n in self.normals.iter().flatten() {
            writeln!(text, "vn {} {} {}", n.x, n.y, n.z).expect("text");
        }
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|index| index + 1);
            let line = match self.normals {
                Some(_) => format!("f {a}//{a} {b}//{b} {c}//{c}"),
                None => format!("f {a} {b} {c}"),
            };
            writeln!(text, "{line}").expect("text");
        }
        text
    }

    pub fn map(mut self, place: impl FnMut(Vec3) -> Vec3) -> Self {
        self.positions = self.positions.into_iter().map(place).collect();
        self
    }

    pub fn moved(self, by: [f32; 3]) -> Self {
        self.map(|position| position + Vec3::from_array(by))
    }

    pub fn scaled(self, by: f32) -> Self {
        self.map(|position| position * by)
    }

    /// Both, each with its own vertices.
    pub fn and(mut self, other: Self) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        let shifted = other.triangles.iter().map(|t| t.map(|index| index + first));
        self.triangles.extend(shifted);
        self
    }

    /// Each triangle for which `takes` holds (by its index) turned over.
    pub fn flipped(mut self, mut takes: impl FnMut(usize) -> bool) -> Self {
        for (index, triangle) in self.triangles.iter_mut().enumerate() {
            if takes(index) {
                triangle.swap(1, 2);
            }
        }
        self
    }

    /// Without the triangles for which `takes` holds.
    pub fn without(mut self, mut takes: impl FnMut(usize) -> bool) -> Self {
        let kept = self.triangles.into_iter().enumerate();
        self.triangles = kept
            .filter(|(index, _)| !takes(*index))
            .map(|(_, triangle)| triangle)
            .collect();
        self
    }

    /// The triangles for which `takes` holds twice, the second time turned over where `reversed`.
    pub fn doubled(mut self, mut takes: impl FnMut(usize) -> bool, reversed: bool) -> Self {
        let copies: Vec<[u32; 3]> = (0..self.triangles.len())
            .filter(|&index| takes(index))
            .map(|index| {
                let [a, b, c] = self.triangles[index];
                if reversed { [a, c, b] } else { [b, c, a] }
            })
            .collect();
        self.triangles.extend(copies);
        self
    }

    /// Three own vertices for each triangle, moved by up to `jitter_m`.
    pub fn unwelded(self, random: &mut Random, jitter_m: f32) -> Self {
        let corners = self.triangles.iter().flatten();
        let positions: Vec<Vec3> = corners
            .map(|&index| self.positions[index as usize] + random.vector() * jitter_m)
            .collect();
        let triangles = (0..self.triangles.len() as u32)
            .map(|index| [3 * index, 3 * index + 1, 3 * index + 2])
            .collect();
        Self::new(positions, triangles)
    }
}

pub fn cuboid(low: [f32; 3], high: [f32; 3]) -> Soup {
    let (positions, triangles) = gnomon::geometry::cuboid::cuboid(low.into(), high.into());
    Soup::new(positions, triangles)
}

/// Two triangles in the plane z = 0 that face +z.
pub fn rectangle(low: [f32; 2], high: [f32; 2]) -> Soup {
    let corners = [
        [low[0], low[1]],
        [high[0], low[1]],
        [high[0], high[1]],
        [low[0], high[1]],
    ];
    let positions = corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
    Soup::new(positions, vec![[0, 1, 2], [0, 2, 3]])
}

/// About the z axis.
pub fn torus(radius: f32, tube: f32, around: u32, across: u32) -> Soup {
    let at = |i: u32, j: u32| (i % around) * across + j % across;
    let mut torus = Soup::default();
    for i in 0..around {
        for j in 0..across {
            let turn = Vec2::from_angle(TAU * i as f32 / around as f32);
            let ring = Vec2::from_angle(TAU * j as f32 / across as f32);
            let place = turn * (radius + tube * ring.x);
            torus.positions.push(place.extend(tube * ring.y));
            torus.triangles.extend([
                [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
            ]);
        }
    }
    torus
}

/// Rings from pole to pole about the z axis, its normals those of the sphere.
pub fn sphere(radius: f32, rings: u32, sectors: u32) -> Soup {
    let mut directions = vec![Vec3::Z];
    for ring in 1..rings {
        let (sine, cosine) = (PI * ring as f32 / rings as f32).sin_cos();
        for sector in 0..sectors {
            let turn = Vec2::from_angle(TAU * sector as f32 / sectors as f32);
            directions.push((turn * sine).extend(cosine));
        }
    }
    directions.push(Vec3::NEG_Z);
    let last = directions.len() as u32 - 1;
    let at = |ring: u32, sector: u32| match ring {
        0 => 0,
        _ if ring == rings => last,
        _ => 1 + (ring - 1) * sectors + sector % sectors,
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for sector in 0..sectors {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            if ring + 1 < rings {
                triangles.push([a, c, d]);
            }
            if ring > 0 {
                triangles.push([a, d, b]);
            }
        }
    }
    let positions = directions.iter().map(|&towards| towards * radius).collect();
    Soup {
        positions,
        triangles,
        normals: Some(directions),
    }
}

/// Closed plates one above the other: as many nested volumes under a lamp above them.
pub fn plates(count: u32) -> Soup {
    (0..count).fold(Soup::default(), |stack, index| {
        let bottom = 0.02 + 0.0003 * index as f32;
        stack.and(cuboid(
            [-0.04, -0.04, bottom],
            [0.04, 0.04, bottom + 0.0002],
        ))
    })
}

/// A strip with one half turn: open, and with no outside.
pub fn moebius(radius: f32, half_width: f32, steps: u32) -> Soup {
    let mut strip = Soup::default();
    for step in 0..steps {
        let angle = TAU * step as f32 / steps as f32;
        let (turn, twist) = (Vec2::from_angle(angle), Vec2::from_angle(angle / 2.0));
        for side in [-half_width, half_width] {
            let place = turn * (radius + side * twist.x);
            strip.positions.push(place.extend(side * twist.y));
        }
        let [a, b] = [2 * step, 2 * step + 1];
        // After the half turn the sides have changed places.
        let [c, d] = if step + 1 < steps {
            [a + 2, b + 2]
        } else {
            [1, 0]
        };
        strip.triangles.extend([[a, c, b], [b, c, d]]);
    }
    strip
}
