//! Corners of a black square moved to where the light says its edges are.
//!
//! A lens and a moving hand blur *light*, and the camera writes it down sRGB-encoded: in encoded values the middle of a
//! blurred edge lies inside the black, every marker looks small, and a lone one seems too far away. Here the edges are
//! found in linear light, each by its gradient along many normals, and the corners are where neighbouring edges meet.

use glam::DVec2;

use super::light::Grey;

/// How far from where the detector says an edge is looked for, pixels.
const REACH_PX: f64 = 2.5;
/// Steps along a normal, pixels.
const STEP_PX: f64 = 0.5;
/// Ends of an edge that are left out, as a part of it: there the neighbouring edge bends the gradient.
const LEFT_OUT: f64 = 0.08;
/// Normals along an edge; more make it no straighter.
const MOST_SAMPLES: usize = 64;
/// A corner that would move farther keeps its place: something else was found.
const MOST_MOVE_PX: f64 = 3.0;

/// A line through a point along a unit direction.
#[derive(Clone, Copy)]
struct Line {
    point: DVec2,
    direction: DVec2,
}

impl Line {
    fn meets(&self, other: &Self) -> Option<DVec2> {
        let sine = self.direction.perp_dot(other.direction);
        let along = (other.point - self.point).perp_dot(other.direction) / sine;
        (sine.abs() > 0.05).then(|| self.point + self.direction * along)
    }
}

/// The corners of a square, in order around it, moved to where its edges meet; `lighter_outside` for a black one on
/// white. A corner one of whose edges cannot be found stays.
pub(super) fn refined(
    picture: Grey<'_>,
    corners_px: [DVec2; 4],
    lighter_outside: bool,
) -> [DVec2; 4] {
    let middle = corners_px.iter().sum::<DVec2>() / 4.0;
    let edges: [Option<Line>; 4] = std::array::from_fn(|edge| {
        edge_line(
            picture,
            corners_px[edge],
            corners_px[(edge + 1) % 4],
            middle,
            lighter_outside,
        )
    });
    std::array::from_fn(|corner| {
        let stays = corners_px[corner];
        let (Some(before), Some(after)) = (&edges[(corner + 3) % 4], &edges[corner]) else {
            return stays;
        };
        let moved = before
            .meets(after)
            .filter(|place| place.distance(stays) <= MOST_MOVE_PX);
        moved.unwrap_or(stays)
    })
}

/// The line through an edge, fitted to where along its normals the light rises.
fn edge_line(
    picture: Grey<'_>,
    from: DVec2,
    to: DVec2,
    middle: DVec2,
    lighter_outside: bool,
) -> Option<Line> {
    let along = (to - from).try_normalize()?;
    let is_outward = along.perp().dot(from - middle) > 0.0;
    let lightward = if is_outward == lighter_outside {
        along.perp()
    } else {
        -along.perp()
    };
    let length = from.distance(to);
    let samples = (length.ceil() as usize).clamp(8, MOST_SAMPLES);
    // Not so far that the white border or the code's cells come in.
    let reach_px = REACH_PX.min(length / 16.0 + 1.0);
    let mut places = Vec::with_capacity(samples);
    for sample in 0..samples {
        let share = LEFT_OUT + (1.0 - 2.0 * LEFT_OUT) * (sample as f64 + 0.5) / samples as f64;
        let place = from.lerp(to, share);
        if let Some(offset) = rise(picture, place, lightward, reach_px) {
            places.push(place + lightward * offset);
        }
    }
    (places.len() * 2 >= samples)
        .then(|| fitted(&places))
        .flatten()
}

/// Where around a place the light rises most, pixels along `lightward`: the centroid of the squared gradient.
fn rise(picture: Grey<'_>, place: DVec2, lightward: DVec2, reach_px: f64) -> Option<f64> {
    let steps = (reach_px / STEP_PX).round() as i32;
    let at = |step: i32| picture.light(place + lightward * (f64::from(step) * STEP_PX));
    let (mut weights, mut moments) = (0.0, 0.0);
    let (mut inside, mut here) = (at(-steps - 1)?, at(-steps)?);
    for step in -steps..=steps {
        let outside = at(step + 1)?;
        let rise = (outside - inside).max(0.0);
        weights += rise * rise;
        moments += rise * rise * f64::from(step) * STEP_PX;
        (inside, here) = (here, outside);
    }
    (weights > 1e-6).then(|| moments / weights)
}

/// The line of least squared distance to points; those farther off than most are left out of a second fit.
fn fitted(places: &[DVec2]) -> Option<Line> {
    let first = least_squares(places)?;
    let distance = |place: &DVec2| (*place - first.point).perp_dot(first.direction).abs();
    let mut distances: Vec<f64> = places.iter().map(distance).collect();
    distances.sort_by(f64::total_cmp);
    let limit = (3.0 * distances[distances.len() / 2]).max(0.05);
    let near: Vec<DVec2> = places
        .iter()
        .copied()
        .filter(|place| distance(place) <= limit)
        .collect();
    least_squares(&near)
}

fn least_squares(places: &[DVec2]) -> Option<Line> {
    let count = places.len() as f64;
    let point = places.iter().sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for place in places {
        let from_mean = *place - point;
        xx += from_mean.x * from_mean.x;
        xy += from_mean.x * from_mean.y;
        yy += from_mean.y * from_mean.y;
    }
    // The axis of the larger moment.
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    (places.len() >= 2 && xx + yy > 0.0).then(|| Line {
        point,
        direction: DVec2::from_angle(angle),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A black quadrilateral on white, blurred as light by a box of `blur_px`, then sRGB-encoded.
    fn picture(corners: [DVec2; 4], blur_px: f64) -> Vec<u8> {
        let inside = |place: DVec2| {
            (0..4).all(|edge| {
                let (from, to) = (corners[edge], corners[(edge + 1) % 4]);
                (to - from).perp_dot(place - from) > 0.0
            })
        };
        let side = 24;
        let encoded = |x: u32, y: u32| {
            let mut light = 0.0;
            for sample in 0..side * side {
                let jitter = DVec2::new(f64::from(sample % side), f64::from(sample / side)) + 0.5;
                let place =
                    DVec2::new(x.into(), y.into()) + (jitter / f64::from(side) - 0.5) * blur_px;
                light += if inside(place) { 0.03 } else { 0.82 };
            }
            let light = light / f64::from(side * side);
            (255.0 * (1.055 * f64::powf(light, 1.0 / 2.4) - 0.055)).round() as u8
        };
        (0..80 * 80)
            .map(|index| encoded(index % 80, index / 80))
            .collect()
    }

    #[test]
    fn corners_land_where_light_was_blurred() {
        let truth = [
            DVec2::new(20.3, 22.1),
            DVec2::new(57.8, 19.4),
            DVec2::new(61.2, 58.7),
            DVec2::new(18.6, 55.5),
        ];
        for blur_px in [1.0, 2.0, 3.0] {
            let levels = picture(truth, blur_px);
            let grey = Grey {
                levels: &levels,
                size_px: [80, 80],
            };
            // As a detector that sees encoded values would start: a little inside.
            let middle = truth.iter().sum::<DVec2>() / 4.0;
            let start = truth.map(|corner| corner.lerp(middle, 0.02));
            for (found, truth) in refined(grey, start, true).iter().zip(truth) {
                assert!(
                    found.distance(truth) < 0.06,
                    "blur {blur_px}: {found} for {truth}"
                );
            }
        }
    }

    #[test]
    fn without_an_edge_corners_stay() {
        let levels = vec![90; 80 * 80];
        let corners = [
            DVec2::new(20.0, 20.0),
            DVec2::new(60.0, 20.0),
            DVec2::new(60.0, 60.0),
            DVec2::new(-3.0, 60.0),
        ];
        assert_eq!(
            refined(
                Grey {
                    levels: &levels,
                    size_px: [80, 80]
                },
                corners,
                true
            ),
            corners
        );
    }
}
