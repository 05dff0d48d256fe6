//! Parts of a mesh: some of its triangles as a mesh of their own, and which of them hang together.

use std::collections::BTreeMap;

use super::mesh::Mesh;
use super::soup::Sets;

impl Mesh {
    /// The mesh of some of its triangles, by their numbers.
    ///
    /// # Panics
    /// If a number is none of a triangle.
    pub fn part(&self, triangles: &[usize]) -> Self {
        fn of<T: Copy>(all: &[T], triangles: &[usize]) -> Vec<T> {
            triangles.iter().map(|&triangle| all[triangle]).collect()
        }
        fn of_any<T: Copy>(all: &[T], triangles: &[usize]) -> Vec<T> {
            match all.is_empty() {
                true => Vec::new(),
                false => of(all, triangles),
            }
        }
        Self {
            positions: self.positions.clone(),
            triangles: of(&self.triangles, triangles),
            corner_normals: of(&self.corner_normals, triangles),
            triangle_materials: of(&self.triangle_materials, triangles),
            looks: self.looks.clone(),
            corner_looks: of_any(&self.corner_looks, triangles),
            held: of_any(&self.held, triangles),
        }
        .without_unused_positions()
    }

    /// Some of its triangles in groups that have no corner in common, each in the order given.
    ///
    /// # Panics
    /// If a number is none of a triangle.
    pub fn separate(&self, triangles: &[usize]) -> Vec<Vec<usize>> {
        let mut sets = Sets::new(self.positions.len());
        for &triangle in triangles {
            let [a, b, c] = self.triangles[triangle];
            sets.join(a, b);
            sets.join(b, c);
        }
        let mut groups: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for &triangle in triangles {
            let group = sets.least(self.triangles[triangle][0]);
            groups.entry(group).or_default().push(triangle);
        }
        groups.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn parts_have_their_own_positions_and_groups_no_corner_in_common() {
        let mesh = Mesh {
            positions: (0..7).map(|x| Vec3::new(x as f32, 0.0, 1.0)).collect(),
            triangles: vec![[0, 1, 2], [4, 5, 6], [1, 2, 3]],
            corner_normals: vec![[Vec3::Z; 3]; 3],
            triangle_materials: vec![0, 1, 2],
            ..Mesh::default()
        };
        let part = mesh.part(&[1]);
        assert_eq!((part.triangles, part.positions.len()), (vec![[0, 1, 2]], 3));
        assert_eq!(part.triangle_materials, [1]);
        assert_eq!(part.positions[0].x, 4.0);
        assert_eq!(mesh.separate(&[0, 1, 2]), [vec![0, 2], vec![1]]);
        assert_eq!(mesh.separate(&[2]), [[2]]);
    }
}
