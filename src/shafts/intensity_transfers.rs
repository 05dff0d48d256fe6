//! Intensity transfers: what hidden sources take from a picture's encoded levels rather than from its light (Gibson et al.
//! 2003, section 7.1).

use glam::Vec3;

use crate::light::srgb::srgb_from_linear;

/// The sets of sources that are taken to be hidden together (section 7.1: two of half are best where a third to a half of
/// them is).
pub const SETS: usize = 2;

/// What each of some sources takes from a vertex's encoded level, 0 to 1 a channel (section 7.1.1, figure 4). `radiance` is
/// the vertex's without shadows; `sources` have the set that each belongs to and the radiance that the vertex sends to the
/// camera because of it, those that send most first.
pub fn intensity_transfers<const N: usize>(
    radiance: Vec3,
    sources: impl IntoIterator<Item = (usize, Vec3)>,
) -> Vec<Vec3> {
    let mut left = [radiance; N];
    let mut levels = [encoded(radiance); N];
    sources
        .into_iter()
        .map(|(set, taken)| {
            left[set] -= taken;
            let level = encoded(left[set]);
            let transfer = levels[set] - level;
            levels[set] = level;
            transfer
        })
        .collect()
}

/// The set of a source by its place in the order: of two that follow each other one is in either, so that the sets are equally
/// large, and which is where is as if drawn by lot, and the same in each frame.
pub fn set_of(place: usize) -> usize {
    // Knuth's multiplicative hash.
    let lot = (((place / SETS) as u32).wrapping_mul(2_654_435_761) >> 16) as usize;
    (place + lot) % SETS
}

/// How a camera encodes linear light as sRGB, 0 to 1.
pub fn encoded(linear: Vec3) -> Vec3 {
    let channels = linear.to_array();
    Vec3::from_array(channels.map(|linear| srgb_from_linear(f64::from(linear)) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vertex and its sources, those that send most first, with 30 % of its light from elsewhere.
    fn lit(random: &mut fastrand::Rng, count: usize) -> (Vec3, Vec<Vec3>) {
        // A few windows and many walls.
        let mut sources: Vec<Vec3> = (0..count)
            .map(|_| Vec3::new(1.0, 0.9, 0.8) * 0.02 * (-random.f32().max(1e-6).ln()).powi(2))
            .collect();
        sources.sort_by(|a, b| b.x.total_cmp(&a.x));
        let radiance = sources.iter().sum::<Vec3>() / 0.7;
        let scale = 0.5 / radiance.x;
        sources.iter_mut().for_each(|source| *source *= scale);
        (radiance * scale, sources)
    }

    /// Root mean square error of the level when so many of 50 sources are hidden, with so many of them in the first set
    /// (figure 3).
    fn error(hidden: usize, in_first: usize) -> f32 {
        let mut random = fastrand::Rng::with_seed(7);
        let mut squared = 0.0;
        let trials = 2000;
        for _ in 0..trials {
            let (radiance, sources) = lit(&mut random, 50);
            let mut sets = [0; 50];
            sets[in_first..].fill(1);
            random.shuffle(&mut sets);
            let each = sets.into_iter().zip(sources.iter().copied());
            let transfers = intensity_transfers::<2>(radiance, each);
            let mut is_hidden = [false; 50];
            is_hidden[..hidden].fill(true);
            random.shuffle(&mut is_hidden);
            let sum = |what: &[Vec3]| -> Vec3 {
                let hidden = what.iter().zip(is_hidden);
                hidden
                    .filter(|(_, is_hidden)| *is_hidden)
                    .map(|(what, _)| *what)
                    .sum()
            };
            let level = encoded(radiance) - sum(&transfers);
            squared += (level - encoded(radiance - sum(&sources))).x.powi(2);
        }
        (squared / trials as f32).sqrt()
    }

    #[test]
    fn a_set_that_is_hidden_whole_leaves_the_exact_level() {
        let (radiance, sources) = lit(&mut fastrand::Rng::with_seed(1), 50);
        let one_set = intensity_transfers::<1>(radiance, sources.iter().map(|&taken| (0, taken)));
        let left = encoded(radiance - sources.iter().sum::<Vec3>());
        let level = encoded(radiance) - one_set.iter().sum::<Vec3>();
        assert!((level - left).abs().max_element() < 1e-5);
        let alternate = sources.iter().enumerate();
        let halves =
            intensity_transfers::<2>(radiance, alternate.map(|(k, &taken)| (k % 2, taken)));
        for set in 0..2 {
            let of_set = |all: &[Vec3]| all.iter().skip(set).step_by(2).sum::<Vec3>();
            let level = encoded(radiance) - of_set(&halves);
            let left = encoded(radiance - of_set(&sources));
            assert!((level - left).abs().max_element() < 1e-5);
        }
    }

    #[test]
    fn halves_are_best_where_a_third_to_a_half_is_hidden() {
        assert_eq!(error(0, 25), 0.0);
        assert!(error(50, 50) < 1e-5, "all in one set, all hidden");
        for hidden in [15, 20, 25] {
            let halves = error(hidden, 25);
            for in_first in [40, 50] {
                let other = error(hidden, in_first);
                assert!(
                    halves < other,
                    "{hidden} hidden: {halves}, {in_first}: {other}"
                );
            }
        }
        // Beyond, more is left than should be taken: the figure's other end.
        assert!(error(50, 25) > 2.0 * error(25, 25));
    }

    #[test]
    fn sources_are_split_in_halves() {
        let first = (0..200).filter(|&place| set_of(place) == 0).count();
        assert!((80..120).contains(&first), "{first}");
    }
}
