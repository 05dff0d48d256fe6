//! Which pictures of a long video to learn a layout from: those that show most that the others do not.

use super::bundle::MarkerObservation;

/// More pictures make a layout hardly better, and its equations slow.
const MOST_PICTURES: usize = 250;
/// A picture is looked at when its markers have moved by this part of the picture's width since the last one.
const MOVED: f64 = 0.015;
/// Pictures that the best ones are picked from.
const MOST_CANDIDATES: usize = 2000;

/// Indices of the pictures to use, in order. Pictures with fewer than two markers tell nothing of a layout.
pub(super) fn choose(pictures: &[Vec<MarkerObservation>], width_px: f64) -> Vec<usize> {
    let mut candidates: Vec<usize> = Vec::new();
    for (index, picture) in pictures.iter().enumerate() {
        let differs = |&last: &usize| differs(&pictures[last], picture, MOVED * width_px);
        if picture.len() >= 2 && candidates.last().is_none_or(differs) {
            candidates.push(index);
        }
    }
    if candidates.len() <= MOST_PICTURES {
        return candidates;
    }
    let step = candidates.len().div_ceil(MOST_CANDIDATES);
    let mut left: Vec<usize> = candidates.into_iter().step_by(step).collect();
    let mut chosen = Vec::new();
    // What one more picture of each pair of markers is worth: the less, the more of the chosen ones show it.
    let markers = pictures
        .iter()
        .flatten()
        .map(|seen| seen.marker + 1)
        .max()
        .unwrap_or(0);
    let mut worth_of_pair = vec![1.0; markers * markers];
    let place = |(a, b): (usize, usize)| a * markers + b;
    while chosen.len() < MOST_PICTURES && !left.is_empty() {
        let worth = |&index: &usize| -> f64 {
            pairs(&pictures[index])
                .map(|pair| worth_of_pair[place(pair)])
                .sum()
        };
        let best = (0..left.len())
            .map(|at| (at, worth(&left[at])))
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        let Some((at, _)) = best else { break };
        let index = left.swap_remove(at);
        for pair in pairs(&pictures[index]) {
            // 1, 1/4, 1/9, …
            let worth: &mut f64 = &mut worth_of_pair[place(pair)];
            *worth = (worth.powf(-0.5) + 1.0).powi(-2);
        }
        chosen.push(index);
    }
    chosen.sort_unstable();
    chosen
}

fn pairs(picture: &[MarkerObservation]) -> impl Iterator<Item = (usize, usize)> {
    picture.iter().enumerate().flat_map(move |(at, a)| {
        picture[at + 1..]
            .iter()
            .map(move |b| (a.marker.min(b.marker), a.marker.max(b.marker)))
    })
}

/// Whether a picture shows other markers than another, or the same ones elsewhere.
fn differs(last: &[MarkerObservation], picture: &[MarkerObservation], moved_px: f64) -> bool {
    last.len() != picture.len()
        || last.iter().zip(picture).any(|(a, b)| {
            let moved =
                (0..4).any(|corner| a.corners_px[corner].distance(b.corners_px[corner]) > moved_px);
            a.marker != b.marker || moved
        })
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn seen(marker: usize, x_px: f64) -> MarkerObservation {
        MarkerObservation {
            marker,
            seen_px: [DVec2::new(x_px, 0.0); 4],
            corners_px: [DVec2::new(x_px, 0.0); 4],
        }
    }

    #[test]
    fn a_still_camera_gives_one_picture() {
        let still = vec![vec![seen(0, 10.0), seen(1, 50.0)]; 1000];
        assert_eq!(choose(&still, 640.0), [0]);
    }

    #[test]
    fn a_rare_pair_is_never_left_out_of_a_long_video() {
        let mut video: Vec<Vec<MarkerObservation>> = (0..1900)
            .map(|k| vec![seen(0, f64::from(k) * 20.0), seen(1, f64::from(k) * 20.0)])
            .collect();
        video[777] = vec![seen(1, 5.0), seen(2, 5.0)];
        video[5] = vec![seen(1, 5.0)];
        let chosen = choose(&video, 640.0);
        assert_eq!(chosen.len(), MOST_PICTURES);
        assert!(chosen.contains(&777) && !chosen.contains(&5) && chosen.is_sorted());
    }
}
