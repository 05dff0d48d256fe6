//! A shaft: all lines from one box to another (Haines & Wallace 1994, Haines 2000).

use serde::{Deserialize, Serialize};

use super::bounding::Aabb;

/// A plane along one axis: the points where `normal · (u, v) + offset >= 0` may lie in the shaft.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShaftPlane {
    /// The axis that the plane is parallel to: 0 x, 1 y, 2 z.
    pub axis: u32,
    /// In the two axes after that one.
    pub normal: [f32; 2],
    pub offset: f32,
}

/// Corners may lie this much outside of a plane that they span, in parts of the largest coordinate: rounding.
const ROUNDING: f32 = 4e-6;

/// The planes that bound all lines between two boxes, besides the box around both.
pub fn planes(from: &Aabb, to: &Aabb) -> Vec<ShaftPlane> {
    let largest = [from.min, from.max, to.min, to.max].map(|corner| corner.abs().max_element());
    let margin = largest.into_iter().fold(0.0, f32::max) * ROUNDING;
    let mut found: Vec<ShaftPlane> = Vec::new();
    for axis in 0..3 {
        let (from, to) = (corners(from, axis), corners(to, axis));
        for a in from {
            for b in to {
                let (along_u, along_v) = (b[0] - a[0], b[1] - a[1]);
                let length = along_u.hypot(along_v);
                if length <= margin {
                    continue;
                }
                let normal = [-along_v / length, along_u / length];
                let side = |point: &[f32; 2]| {
                    normal[0] * (point[0] - a[0]) + normal[1] * (point[1] - a[1])
                };
                let sides = || from.iter().chain(&to).map(side);
                let (least, most) = (
                    sides().fold(f32::INFINITY, f32::min),
                    sides().fold(f32::NEG_INFINITY, f32::max),
                );
                let sign = if least >= -margin {
                    1.0
                } else if most <= margin {
                    -1.0
                } else {
                    continue;
                };
                let normal = normal.map(|part| part * sign);
                let offset = -(normal[0] * a[0] + normal[1] * a[1]) + margin;
                let plane = ShaftPlane {
                    axis: axis as u32,
                    normal,
                    offset,
                };
                // A side of the box around both bounds nothing more, and neighbours may span the same plane.
                let slanted = normal.iter().all(|part| part.abs() > 1e-6);
                let known = found.iter().any(|other| is_same(other, &plane, margin));
                if slanted && !known {
                    found.push(plane);
                }
            }
        }
    }
    found
}

fn is_same(one: &ShaftPlane, other: &ShaftPlane, margin: f32) -> bool {
    let [u, v] = [0, 1].map(|part| (one.normal[part] - other.normal[part]).abs());
    one.axis == other.axis && u.max(v) < 1e-5 && (one.offset - other.offset).abs() <= margin
}

/// The corners of a box in the two axes after `axis`.
fn corners(bounds: &Aabb, axis: usize) -> [[f32; 2]; 4] {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let (min, max) = (bounds.min, bounds.max);
    [
        [min[u], min[v]],
        [max[u], min[v]],
        [max[u], max[v]],
        [min[u], max[v]],
    ]
}

impl ShaftPlane {
    /// Whether a box lies outside altogether.
    pub fn excludes(&self, bounds: &Aabb) -> bool {
        let (u, v) = ((self.axis as usize + 1) % 3, (self.axis as usize + 2) % 3);
        let farthest = |axis: usize, part: f32| match part > 0.0 {
            true => bounds.max[axis] * part,
            false => bounds.min[axis] * part,
        };
        farthest(u, self.normal[0]) + farthest(v, self.normal[1]) + self.offset < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f32 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 >> 40) as f32 / (1u64 << 24) as f32
        }
        fn point(&mut self, size: f32) -> Vec3 {
            Vec3::new(self.unit(), self.unit(), self.unit()) * size
        }
        fn bounds(&mut self) -> Aabb {
            let min = self.point(3.0);
            let flat = Vec3::from_array([0; 3].map(|_| f32::from(self.unit() > 0.3)));
            Aabb {
                min,
                max: min + self.point(1.5) * flat,
            }
        }
        fn within(&mut self, bounds: &Aabb) -> Vec3 {
            bounds.min + (bounds.max - bounds.min) * self.point(1.0)
        }
    }

    #[test]
    fn no_line_between_the_boxes_is_missed_and_most_others_are_left_out() {
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let (mut left_out, mut met) = (0, 0);
        for _ in 0..400 {
            let (from, to) = (random.bounds(), random.bounds());
            let around = Aabb::around([from.min, from.max, to.min, to.max]);
            let planes = planes(&from, &to);
            for _ in 0..20 {
                let tested = random.bounds();
                let may_hide =
                    around.touches(&tested) && !planes.iter().any(|plane| plane.excludes(&tested));
                let hides = (0..500).any(|_| {
                    let (a, b) = (random.within(&from), random.within(&to));
                    crosses(a, b, &tested)
                });
                assert!(may_hide || !hides, "{from:?} {to:?} {tested:?}");
                met += usize::from(hides);
                left_out += usize::from(!may_hide);
            }
        }
        assert!(met > 500 && left_out > 3000, "{met} {left_out}");
    }

    fn crosses(a: Vec3, b: Vec3, bounds: &Aabb) -> bool {
        let (mut first, mut last) = (0.0_f32, 1.0_f32);
        for axis in 0..3 {
            let way = b[axis] - a[axis];
            if way.abs() < 1e-12 {
                if a[axis] < bounds.min[axis] || a[axis] > bounds.max[axis] {
                    return false;
                }
                continue;
            }
            let (one, other) = (
                (bounds.min[axis] - a[axis]) / way,
                (bounds.max[axis] - a[axis]) / way,
            );
            first = first.max(one.min(other));
            last = last.min(one.max(other));
        }
        first <= last
    }
}
