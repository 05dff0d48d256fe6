//! Where an edge of a marker lies in the picture, from the light of the pixels around it.
//!
//! A pixel's light is `black + contrast · whiteness`: the whiteness is that of the marker's cells, blurred by the lens,
//! the motion and the pixel itself; black and contrast are the edge's own, since a shadow may lie across the marker.
//! Light, not encoded values, for that is what blurs.

use std::sync::LazyLock;

use glam::{DMat2, DVec2};

use super::light::Grey;
use super::marker_template::{COLUMNS, ROWS, TemplateEdge};
use crate::geometry::matrix::{Matrix, dot};

/// The most that the window reaches across an edge to either side, pixels.
const ACROSS_PX: f64 = 3.0;
/// The most that the window reaches across an edge to either side, cells.
const ACROSS_CELLS: f64 = 1.0;
/// The most that the window reaches along an edge to either side, pixels; a longer edge tells as much in its middle.
const ALONG_PX: f64 = 6.0;
/// An edge with fewer pixels tells nothing.
const FEWEST_PIXELS: u32 = 8;
/// Less light between white and black is none.
const LEAST_CONTRAST: f64 = 0.004;
/// Variance of a pixel's light that no picture is without: what 8 bits leave out.
const NOISE_FLOOR: f64 = 1e-6;

/// What the picture says of an edge.
pub(super) enum EdgeView {
    /// The edge is there.
    Seen(EdgeFit),
    /// The side that should be white is the darker one.
    Reversed,
    /// Out of the picture, covered, or in the dark.
    Blank,
}

/// What the variance of the blur across an edge is short of.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlurError {
    /// Pixels².
    pub error: f64,
    /// Inverse of the error's own variance.
    pub certainty: f64,
}

/// An edge as the picture shows it.
pub(super) struct EdgeFit {
    /// How far across the edge it lies from where it was expected, cells.
    pub offset_cells: f64,
    /// Variance of the offset, cells².
    pub variance_cells: f64,
    pub blur_error: BlurError,
}

/// Fits one edge. `middle_px` is where its middle is expected, the columns of `pixels_from_cells` are one cell across
/// and one along it there (distorted pixels); `blur_variance` is the blur's across the edge, pixels².
pub(super) fn fit_edge(
    picture: Grey<'_>,
    edge: &TemplateEdge,
    middle_px: DVec2,
    pixels_from_cells: DMat2,
    blur_variance: f64,
) -> EdgeView {
    let cells_from_pixels = pixels_from_cells.inverse();
    let (across_cells_per_px, along_cells_per_px) = (
        cells_from_pixels.row(0).length(),
        cells_from_pixels.row(1).length(),
    );
    let reach = DVec2::new(
        (ACROSS_PX * across_cells_per_px).min(ACROSS_CELLS),
        (ALONG_PX * along_cells_per_px).min(0.5),
    );
    let extent = DVec2::new(
        pixels_from_cells.row(0).abs().dot(reach),
        pixels_from_cells.row(1).abs().dot(reach),
    );
    let (low, high) = ((middle_px - extent).ceil(), (middle_px + extent).floor());
    let [width, height] = picture.size_px.map(f64::from);
    if !(low.cmpge(DVec2::ZERO).all() && high.x < width && high.y < height) {
        return EdgeView::Blank;
    }

    let deviation_px = blur_variance.sqrt();
    let across_scale = (1.0 / (across_cells_per_px * deviation_px)) as f32;
    let along_scale = (1.0 / (along_cells_per_px * deviation_px)) as f32;
    let steps = Steps::new(edge);
    let reach = reach.as_vec2();
    let to_cells = cells_from_pixels.as_mat2();
    let mut sums = EdgeSums::default();
    for y in low.y as u32..=high.y as u32 {
        let row = picture.row(y);
        let start = DVec2::new(low.x, f64::from(y)) - middle_px;
        let mut cells = to_cells * start.as_vec2();
        for light in &row[low.x as usize..=high.x as usize] {
            if cells.x.abs() <= reach.x && cells.y.abs() <= reach.y {
                let [white, slope, blurring] = steps.whiteness(cells, across_scale, along_scale);
                sums.add(
                    [1.0, white, -slope * across_scale, blurring],
                    crate::capture::linear::linear(*light),
                );
            }
            cells += to_cells.x_axis;
        }
    }
    sums.solve(blur_variance).unwrap_or(EdgeView::Blank)
}

/// The integral of the unit Gaussian up to a place, and its density there.
fn gaussian(place: f32) -> (f32, f32) {
    /// Beyond so many deviations nothing is left.
    const REACH: f32 = 4.0;
    const PER_DEVIATION: f32 = 64.0;
    /// Integral and density at the grid's places; between them the density is the integral's slope.
    static GRID: LazyLock<Vec<(f32, f32)>> = LazyLock::new(|| {
        let count = (2.0 * REACH * PER_DEVIATION) as i32 + 1;
        let density = |place: f64| (-0.5 * place * place).exp() / std::f64::consts::TAU.sqrt();
        let at = |k: i32| f64::from(k) / f64::from(PER_DEVIATION) - f64::from(REACH);
        let mut integral = 0.0;
        (0..count)
            .map(|k| {
                let here = (integral as f32, density(at(k)) as f32);
                let (low, high) = (at(k), at(k + 1));
                // Simpson's rule.
                integral += (high - low) / 6.0
                    * (density(low) + 4.0 * density(0.5 * (low + high)) + density(high));
                here
            })
            .collect()
    });
    if place <= -REACH {
        return (0.0, 0.0);
    }
    if place >= REACH {
        return (1.0, 0.0);
    }
    let index = (place + REACH) * PER_DEVIATION;
    let cell = index as usize;
    let beyond = (index - cell as f32) / PER_DEVIATION;
    let (integral, density) = GRID[cell];
    // To second order, the density's own slope included.
    (
        integral + beyond * density * (1.0 - 0.5 * beyond * (place - beyond)),
        density * (1.0 - beyond * (place - beyond)),
    )
}

/// The whiteness around an edge, as steps across it per row.
struct Steps {
    first: [f32; ROWS],
    steps: [[f32; COLUMNS - 1]; ROWS],
}

impl Steps {
    fn new(edge: &TemplateEdge) -> Self {
        Self {
            first: edge.around.map(|row| row[0]),
            steps: edge
                .around
                .map(|row| std::array::from_fn(|k| row[k + 1] - row[k])),
        }
    }

    /// Whiteness at a place in cells from the edge's middle, its derivative by the scaled place across, and that by
    /// the logarithm of the blur; the scales are the inverse of the blur in cells.
    fn whiteness(&self, cells: glam::Vec2, across_scale: f32, along_scale: f32) -> [f32; 3] {
        let along = [-0.5, 0.5].map(|line: f32| gaussian((cells.y - line) * along_scale).0);
        let shares = [1.0 - along[0], along[0] - along[1], along[1]];
        let lines: [(f32, f32, f32); COLUMNS - 1] = std::array::from_fn(|k| {
            let scaled = (cells.x - (k as f32 - 1.0)) * across_scale;
            let (integral, density) = gaussian(scaled);
            (integral, density, -scaled * density)
        });
        let mut sum = [0.0; 3];
        for ((share, first), steps) in shares.into_iter().zip(self.first).zip(&self.steps) {
            let mut row = [first, 0.0, 0.0];
            for (step, line) in steps.iter().zip(lines) {
                row[0] += step * line.0;
                row[1] += step * line.1;
                row[2] += step * line.2;
            }
            for (sum, row) in sum.iter_mut().zip(row) {
                *sum += share * row;
            }
        }
        sum
    }
}

/// The normal equations of black, contrast, contrast · offset and contrast · blur; their lower triangle in single
/// precision, since they are added to for each pixel.
#[derive(Default)]
struct EdgeSums {
    normal: [[f32; 4]; 4],
    right: [f32; 4],
    squares: f32,
    count: u32,
}

impl EdgeSums {
    fn add(&mut self, row: [f32; 4], light: f32) {
        for i in 0..4 {
            for j in 0..=i {
                self.normal[i][j] += row[i] * row[j];
            }
            self.right[i] += row[i] * light;
        }
        self.squares += light * light;
        self.count += 1;
    }

    /// `None` where the equations have no solution.
    fn solve(&self, blur_variance: f64) -> Option<EdgeView> {
        if self.count < FEWEST_PIXELS {
            return None;
        }
        let entry = |i: usize, j: usize| f64::from(self.normal[i.max(j)][i.min(j)]);
        let normal: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
        let right: [f64; 3] = std::array::from_fn(|i| f64::from(self.right[i]));
        let inverse = Matrix(normal).inverse()?;
        let solution = inverse * right;
        let [_, contrast, shift] = solution;
        let explained = dot(&solution, &right);
        let unexplained = (f64::from(self.squares) - explained).max(0.0);
        let noise = unexplained / f64::from(self.count - 3) + NOISE_FLOOR;
        if contrast < LEAST_CONTRAST {
            let reversed = contrast < -LEAST_CONTRAST;
            return reversed.then_some(EdgeView::Reversed);
        }
        // What is left of the fourth equation once the other three are solved.
        let blurring: [f64; 3] = std::array::from_fn(|i| entry(i, 3));
        let blur_left = f64::from(self.right[3]) - dot(&blurring, &solution);
        let blur_information = entry(3, 3) - dot(&blurring, &(inverse * blurring));
        // By the logarithm of the deviation, hence twice the variance.
        let (unit, certainty) = (
            2.0 * blur_variance,
            blur_information * contrast * contrast / noise,
        );
        let blur_error = match blur_information > 1e-9 {
            true => BlurError {
                error: unit * blur_left / (blur_information * contrast),
                certainty: certainty / (unit * unit),
            },
            false => BlurError {
                error: 0.0,
                certainty: 0.0,
            },
        };
        Some(EdgeView::Seen(EdgeFit {
            offset_cells: shift / contrast,
            variance_cells: inverse.0[2][2] * noise / (contrast * contrast),
            blur_error,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Family, Marker};
    use crate::tracking::marker_template::MarkerTemplate;
    use crate::tracking::printed_marker::{Cell, PrintedMarker};

    const SIDE: u32 = 64;

    /// A picture of one vertical edge, black to the left of `at` and white to the right, blurred by a Gaussian of a
    /// standard deviation in pixels, sRGB-encoded; `light` falls on it from row to row.
    fn picture(at: f64, deviation_px: f64, light: impl Fn(u32) -> f64) -> Vec<u8> {
        let encoded = |x: u32, y: u32| {
            // The mean over the pixel of the blurred edge, by many places in it.
            let places = 64;
            let sum: f64 = (0..places)
                .map(|k| {
                    let place = f64::from(x) - 0.5 + (f64::from(k) + 0.5) / f64::from(places);
                    integral((place - at) / deviation_px)
                })
                .sum();
            let level = light(y) * (0.03 + 0.6 * sum / f64::from(places));
            (255.0 * (1.055 * level.powf(1.0 / 2.4) - 0.055)).round() as u8
        };
        (0..SIDE * SIDE)
            .map(|k| encoded(k % SIDE, k / SIDE))
            .collect()
    }

    /// Light that differs a little from row to row, so that rounding to levels does not err alike in all of them.
    fn dithered(y: u32) -> f64 {
        1.0 - 0.004 * f64::from(y)
    }

    /// The Gaussian's integral, by a sum that is nothing like the table's.
    fn integral(place: f64) -> f64 {
        let steps = 400;
        let (low, high) = (-6.0, place.clamp(-6.0, 6.0));
        let width = (high - low) / f64::from(steps);
        (0..steps)
            .map(|k| {
                let x: f64 = low + (f64::from(k) + 0.5) * width;
                (-0.5 * x * x).exp() * width / std::f64::consts::TAU.sqrt()
            })
            .sum()
    }

    /// An edge between large cells, which goes from black to white.
    fn edge() -> TemplateEdge {
        let marker = Marker::alone(Family::TAG16H5, 0, 1.0);
        // Black, two columns of it, then white.
        let cells = (0..16).map(|k| if k % 4 > 1 { Cell::White } else { Cell::Black });
        let template = MarkerTemplate::new(&marker, PrintedMarker::new(4, cells.collect()));
        template
            .edges
            .into_iter()
            .find(|edge| edge.brightens && edge.around == [[0.0, 0.0, 1.0, 1.0]; ROWS])
            .expect("such an edge")
    }

    fn view(levels: &[u8], at: DVec2, cell_px: f64, blur_variance: f64) -> EdgeView {
        let picture = Grey {
            levels,
            size_px: [SIDE, SIDE],
        };
        fit_edge(
            picture,
            &edge(),
            at,
            DMat2::from_diagonal(DVec2::splat(cell_px)),
            blur_variance,
        )
    }

    #[test]
    fn an_edge_is_found_to_a_hundredth_of_a_pixel() {
        for deviation_px in [0.5, 1.0] {
            for at in [31.0, 31.3, 31.5, 31.77] {
                let levels = picture(at, deviation_px, dithered);
                let variance = deviation_px * deviation_px + 1.0 / 12.0;
                // From where a prediction may put it: the step is a first one, not the last.
                for expected in [at, at + 0.1] {
                    let EdgeView::Seen(fit) =
                        view(&levels, DVec2::new(expected, 32.0), 10.0, variance)
                    else {
                        panic!("not seen")
                    };
                    let found = expected + fit.offset_cells * 10.0;
                    assert!(
                        (found - at).abs() < 0.01,
                        "{found} for {at}, blur {deviation_px}, from {expected}"
                    );
                    assert!(fit.variance_cells.sqrt() * 10.0 < 0.02);
                }
            }
        }
    }

    #[test]
    fn what_the_blur_lacks_is_told() {
        let levels = picture(31.4, 1.0, dithered);
        let right = 1.0 + 1.0 / 12.0;
        for wrong in [0.8, 1.4] {
            let EdgeView::Seen(fit) = view(&levels, DVec2::new(31.4, 32.0), 10.0, wrong) else {
                panic!("not seen")
            };
            let told = wrong + fit.blur_error.error;
            assert!(
                (told - right).abs() < 0.12,
                "{told} for {right}, from {wrong}"
            );
            assert!(
                (fit.offset_cells * 10.0).abs() < 0.02,
                "an edge does not move by blur"
            );
        }
    }

    #[test]
    fn a_shade_along_the_edge_moves_it_little() {
        // Half as bright below the middle.
        let levels = picture(31.4, 0.6, |y| if y < 32 { 1.0 } else { 0.5 });
        let EdgeView::Seen(fit) = view(&levels, DVec2::new(31.4, 32.0), 10.0, 0.36 + 1.0 / 12.0)
        else {
            panic!("not seen")
        };
        assert!(
            (fit.offset_cells * 10.0).abs() < 0.03,
            "{}",
            fit.offset_cells
        );
    }

    #[test]
    fn what_is_no_edge_is_none() {
        let blank = vec![120; (SIDE * SIDE) as usize];
        assert!(matches!(
            view(&blank, DVec2::splat(32.0), 10.0, 0.4),
            EdgeView::Blank
        ));
        let mut turned = picture(31.4, 0.6, |_| 1.0);
        for row in turned.chunks_exact_mut(SIDE as usize) {
            row.reverse();
        }
        assert!(matches!(
            view(&turned, DVec2::new(31.6, 32.0), 10.0, 0.4),
            EdgeView::Reversed
        ));
        // At the picture's rim, and nowhere at all.
        for at in [DVec2::new(1.0, 32.0), DVec2::new(-500.0, 32.0), DVec2::NAN] {
            assert!(matches!(view(&blank, at, 10.0, 0.4), EdgeView::Blank));
        }
        assert!(matches!(
            view(&blank, DVec2::splat(32.0), 0.0, 0.4),
            EdgeView::Blank
        ));
    }
}
