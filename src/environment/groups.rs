//! Things that are near to each other, which hide light as one (Tamura et al. 2005, section 4.2.3).

use crate::geometry::bounds::Bounds;

/// Things are near where the gap between their boxes is less than this part of the smaller one's size.
const NEAR_PART: f64 = 0.5;

/// Groups of two or more, as places among `things` (the boxes of those that are there, and whether they are real); a group is of real
/// things or of virtual ones.
pub fn groups(things: &[Option<(Bounds, bool)>]) -> Vec<Vec<usize>> {
    let mut group_of: Vec<usize> = (0..things.len()).collect();
    for (later, thing) in things.iter().enumerate() {
        for (earlier, other) in things[..later].iter().enumerate() {
            let are_near = thing
                .zip(*other)
                .is_some_and(|(one, other)| are_near(one, other));
            let [from, to] = [group_of[later], group_of[earlier]];
            if are_near && from != to {
                let members = group_of.iter_mut().filter(|group| **group == from);
                members.for_each(|group| *group = to);
            }
        }
    }
    let all = (0..things.len()).map(|group| {
        let members = group_of.iter().enumerate().filter(|(_, of)| **of == group);
        members.map(|(member, _)| member).collect::<Vec<_>>()
    });
    all.filter(|members| members.len() > 1).collect()
}

fn are_near((one, is_real): (Bounds, bool), (other, other_is_real): (Bounds, bool)) -> bool {
    let gap = (one.low - other.high)
        .max(other.low - one.high)
        .max(glam::DVec3::ZERO);
    let size = |bounds: &Bounds| (bounds.high - bounds.low).length();
    is_real == other_is_real && gap.length() < NEAR_PART * size(&one).min(size(&other))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn near_things_of_a_kind_are_one_group_also_over_others() {
        let at = |x: f64, is_real: bool| {
            let low = DVec3::new(x, 0.0, 0.0);
            Some((
                Bounds {
                    low,
                    high: low + DVec3::ONE,
                },
                is_real,
            ))
        };
        // Half of a unit cube's size is .87.
        let row = [
            at(0.0, false),
            at(5.0, false),
            at(1.8, false),
            at(3.5, false),
            at(1.5, true),
            None,
        ];
        assert_eq!(groups(&row), [vec![0, 1, 2, 3]]);
        let apart = [at(0.0, false), at(2.0, false), at(0.5, true)];
        assert!(groups(&apart).is_empty());
    }
}
