//! An anchor's pose from the pixels: all edges of all its markers at once, each by its own light (`edge_fit.rs`).
//!
//! A detector's four corners use a marker's outline alone, and each marker for itself. Here every boundary between
//! black and white cells tells how far across itself it lies from where the pose puts it, with a variance of its own;
//! Gauss-Newton steps on the six parameters of the one pose take all of them together, robustly, so that a pencil or a
//! shadow's edge across a marker has no say. (Edges that steer a pose: C. Harris, "Tracking with rigid models", in
//! Active Vision, 1992; the M-estimator is Tukey's.)

use glam::{DAffine3, DMat2, DVec2, DVec3};

use super::condition::Condition;
use super::cover::HiddenPart;
use super::edge_fit::{BlurError, EdgeView, fit_edge};
use super::light::Grey;
use super::marker_template::MarkerTemplate;
use crate::geometry::camera::{Intrinsics, ProjectedPoint};
use crate::geometry::least_squares::NormalEquations;
use crate::geometry::matrix::Matrix;
use crate::geometry::pose::{PoseStep, by_step, moved};
use crate::geometry::robust::{deviation, tukey_weight};

/// Parameters of a step: a turn about the anchor's origin (left of the rotation), a shift, how far all edges lie
/// toward the black (ink runs, and light that the camera does not encode as it says spills), and by what part of its
/// size each marker is larger than the scene says (a page printed to fit, a rule read wrongly).
const PARAMETERS: usize = 8;
/// The parameters of a step that move the anchor.
pub(super) const POSE_PARAMETERS: usize = 6;
/// The parameter by which all edges lie toward the black.
const SPILL: usize = 6;
/// The parameter by which markers are larger.
const SIZE: usize = 7;
/// Standard deviation of what edges are expected to lie toward the black, pixels.
const SPILL_PX: f64 = 0.1;
/// An edge is never known better than this, pixels: paper bends, sheets are not printed to the micrometre.
const FLOOR_PX: f64 = 0.02;
/// The pose is found once a step moves the edges by no more than this (root mean square), pixels.
const SETTLED_PX: f64 = 0.05;
/// The blur is known once its variance changes by no more than this part of itself: with too small a one, whole markers are
/// taken for something else.
const SETTLED_BLUR: f64 = 0.3;
/// Weight from which on an edge counts as being where it should be.
const FITTING: f64 = 0.3;
/// The part of a marker's edges that must fit for it to be seen.
const SEEN_SHARE: f64 = 0.4;
/// The number of a marker's edges that must fit for it to be seen.
const SEEN_EDGES: usize = 10;
/// The least cosine between the way out of a marker's face and the way to the camera for its edges to be looked for: those
/// of a face that is seen along itself, or from behind, are not there.
const LEAST_FACING: f64 = 0.03;
/// The largest part of a marker's edges that may be the wrong way round: of a marker that is not there, half are.
const MOST_REVERSED: f64 = 0.15;

/// A pose that the pixels agree on.
pub(super) struct PixelPose {
    pub(super) camera_from_anchor: DAffine3,
    /// Covariance of a step from the pose.
    pub(super) covariance: Matrix<POSE_PARAMETERS>,
    /// Whether the marker of each template was seen.
    pub(super) seen: Vec<bool>,
    /// Root mean square distance, pixels, of the edges from where the pose and the scene put them; without those that
    /// something else lies across.
    pub(super) rms_px: f64,
    /// By what factor the edges vary more than their pixels' noise says.
    pub(super) excess: f64,
    pub(super) edges: Vec<MeasuredEdge>,
}

impl PixelPose {
    /// How many markers were seen.
    pub(super) fn markers(&self) -> usize {
        self.seen.iter().filter(|&&seen| seen).count()
    }
}

/// An edge of a marker as one picture shows it.
pub(super) struct MeasuredEdge {
    template: usize,
    /// The edge's middle in the anchor's space, metres.
    pub(super) point_m: DVec3,
    /// Where a point of the edge was seen, distorted pixels; that the ink spills or the marker is of another size is taken out.
    pub(super) seen_px: DVec2,
    /// A unit vector of the picture across the edge.
    pub(super) normal: DVec2,
    /// The way from where the pose puts the edge to where it was seen, along the normal, pixels.
    offset_px: f64,
    pub(super) variance: f64,
    /// Derivative of the offset that a step explains.
    row: [f64; PARAMETERS],
    blur_error: BlurError,
    /// Tukey's weight, 0 to 1.
    pub(super) weight: f64,
}

impl MeasuredEdge {
    /// What a step does not explain of the offset, pixels.
    fn left_px(&self, step: &[f64; PARAMETERS]) -> f64 {
        let explained: f64 = self
            .row
            .iter()
            .zip(step)
            .map(|(row, step)| row * step)
            .sum();
        self.offset_px - explained
    }
}

/// A point of the anchor as the camera sees it (distorted).
pub(super) struct AnchorPoint {
    pub(super) projection: ProjectedPoint,
    /// The point from the anchor's origin, in camera axes.
    turned_m: DVec3,
}

impl AnchorPoint {
    /// The derivative of the pixel along a direction of the picture by a step of the pose.
    pub(super) fn by_step(&self, direction: DVec2) -> PoseStep {
        by_step(self.turned_m, self.projection.gradient(direction))
    }
}

/// Where a pose puts a point of the anchor; `None` behind the camera.
pub(super) fn project(
    intrinsics: &Intrinsics,
    camera_from_anchor: &DAffine3,
    point_m: DVec3,
) -> Option<AnchorPoint> {
    let turned_m = camera_from_anchor.matrix3 * point_m;
    Some(AnchorPoint {
        projection: intrinsics.project(turned_m + camera_from_anchor.translation)?,
        turned_m,
    })
}

/// The distorted pixel of a point of the anchor; `None` behind the camera.
pub(super) fn pixel_of(
    intrinsics: &Intrinsics,
    camera_from_anchor: &DAffine3,
    point_m: DVec3,
) -> Option<DVec2> {
    intrinsics.pixel_of(camera_from_anchor.transform_point3(point_m))
}

/// The pose near `start` that puts the edges of the markers where the picture has them. `None` when too few edges are
/// where they should be; `condition` is then as it was.
pub(super) fn fit_pose(
    picture: Grey<'_>,
    intrinsics: &Intrinsics,
    templates: &[MarkerTemplate],
    start: DAffine3,
    condition: &mut Condition,
) -> Option<PixelPose> {
    const ROUNDS: usize = 5;
    let mut learned = *condition;
    let (size_error, _) = condition.size();
    let mut guess = Guess {
        camera_from_anchor: start,
        size_error,
    };
    let mut edges = Vec::new();
    let mut solution = None;
    for _ in 0..ROUNDS {
        edges.clear();
        for (index, template) in templates.iter().enumerate() {
            measure(
                picture,
                intrinsics,
                (index, template),
                &guess,
                &learned,
                &mut edges,
            );
        }
        if edges.is_empty() {
            return None;
        }
        let solved = solve(&mut edges, condition, &guess)?;
        guess = Guess {
            camera_from_anchor: moved(&guess.camera_from_anchor, pose_part(&solved.step)),
            size_error: guess.size_error + solved.step[SIZE],
        };
        let blurs = edges
            .iter()
            .map(|edge| (edge.normal, edge.weight, edge.blur_error));
        let blur_change = learned.correct_blur(blurs);
        let explained: f64 = edges
            .iter()
            .map(|edge| {
                let by_pose: f64 = (0..POSE_PARAMETERS)
                    .map(|k| edge.row[k] * solved.step[k])
                    .sum();
                edge.weight * by_pose * by_pose
            })
            .sum();
        let used: f64 = edges.iter().map(|edge| edge.weight).sum();
        solution = Some(solved);
        if (explained / used).sqrt() < SETTLED_PX && blur_change < SETTLED_BLUR {
            break;
        }
    }
    let solution = solution?;
    let fitted = fitted(templates, &guess, edges, &solution)?;
    if fitted.seen.iter().filter(|&&seen| seen).count() > 1 {
        learned.learn_size(guess.size_error, solution.size_certainty / fitted.excess);
    }
    *condition = learned;
    Some(fitted)
}

fn pose_part(step: &[f64; PARAMETERS]) -> [f64; POSE_PARAMETERS] {
    std::array::from_fn(|k| step[k])
}

/// Where the markers are expected, and by what part of its size each is larger than the scene says.
struct Guess {
    camera_from_anchor: DAffine3,
    size_error: f64,
}

/// Adds the edges of one marker that the picture shows near where they are expected; none of a marker that is not there.
fn measure(
    picture: Grey<'_>,
    intrinsics: &Intrinsics,
    (index, template): (usize, &MarkerTemplate),
    guess: &Guess,
    condition: &Condition,
    edges: &mut Vec<MeasuredEdge>,
) {
    let (known, mut reversed) = (edges.len(), 0);
    let (pose, scale) = (&guess.camera_from_anchor, 1.0 + guess.size_error);
    if template.facing(pose) < LEAST_FACING {
        return;
    }
    let center_m = template.center_m();
    let radius_m = center_m.distance(template.corners_m()[0]);
    let hidden = HiddenPart::of(&template.covers, (center_m, radius_m), pose);
    for edge in &template.edges {
        if hidden.has(edge.point_m) {
            continue;
        }
        let outward_m = edge.point_m - template.center_m();
        let point_m = template.center_m() + scale * outward_m;
        let Some(point) = project(intrinsics, pose, point_m) else {
            continue;
        };
        let expected_px = point.projection.pixel;
        let in_picture = |step_m: DVec3| point.projection.step_px(pose.matrix3 * step_m);
        let pixels_from_cells =
            scale * DMat2::from_cols(in_picture(edge.across_m), in_picture(edge.along_m));
        // The gradient of the place across.
        let gradient = pixels_from_cells.inverse().row(0);
        let length = gradient.length();
        if !(length.is_finite() && length > 0.0) {
            continue;
        }
        let normal = gradient / length;
        let blur_variance = condition.blur_variance_along(normal);
        let fit = match fit_edge(picture, edge, expected_px, pixels_from_cells, blur_variance) {
            EdgeView::Seen(fit) => fit,
            EdgeView::Reversed => {
                reversed += 1;
                continue;
            }
            EdgeView::Blank => continue,
        };
        let offset_px = fit.offset_cells / length;
        let [rx, ry, rz, tx, ty, tz] = point.by_step(normal);
        let by_size = normal.dot(in_picture(outward_m));
        let toward_black = if edge.brightens { -1.0 } else { 1.0 };
        edges.push(MeasuredEdge {
            template: index,
            point_m: edge.point_m,
            seen_px: expected_px + normal * offset_px,
            normal,
            offset_px,
            variance: fit.variance_cells / (length * length) + FLOOR_PX * FLOOR_PX,
            row: [rx, ry, rz, tx, ty, tz, toward_black, by_size],
            blur_error: fit.blur_error,
            weight: 1.0,
        });
    }
    let shown = edges.len() - known + reversed;
    if reversed as f64 > MOST_REVERSED * shown as f64 {
        edges.truncate(known);
    }
}

struct EdgeSolution {
    step: [f64; PARAMETERS],
    /// Inverse of the variance of the size in the step.
    size_certainty: f64,
}

/// The step that explains the offsets, robustly. Leaves each edge its weight.
fn solve(edges: &mut [MeasuredEdge], condition: &Condition, guess: &Guess) -> Option<EdgeSolution> {
    const ROUNDS: usize = 5;
    let mut found = None;
    let mut scale = f64::INFINITY;
    for _ in 0..ROUNDS {
        let mut equations = NormalEquations::<PARAMETERS>::ZERO;
        for edge in edges.iter() {
            equations.add_weighted(&edge.row, edge.offset_px, edge.weight / edge.variance);
        }
        let (size_error, size_certainty) = condition.size();
        equations.add_prior(SPILL, 0.0, 1.0 / (SPILL_PX * SPILL_PX));
        equations.add_prior(SIZE, size_error - guess.size_error, size_certainty);
        let step = equations.solve()?;

        let left = |edge: &MeasuredEdge| edge.left_px(&step) / edge.variance.sqrt();
        scale = deviation(edges.iter().map(left)).clamp(1.0, scale);
        for edge in edges.iter_mut() {
            edge.weight = tukey_weight(left(edge), scale);
        }
        found = Some((step, equations));
    }
    let (step, equations) = found?;
    Some(EdgeSolution {
        step,
        size_certainty: 1.0 / equations.covariance()?.0[SIZE][SIZE],
    })
}

fn fitted(
    templates: &[MarkerTemplate],
    guess: &Guess,
    mut edges: Vec<MeasuredEdge>,
    solved: &EdgeSolution,
) -> Option<PixelPose> {
    let not_by_pose_px = |edge: &MeasuredEdge| {
        edge.row[SPILL] * solved.step[SPILL] + edge.row[SIZE] * guess.size_error
    };
    let (mut squares_px, mut counted) = (0.0, 0.0);
    for edge in edges.iter().filter(|edge| edge.weight > 0.0) {
        squares_px += (edge.left_px(&solved.step) + not_by_pose_px(edge)).powi(2);
        counted += 1.0;
    }
    for edge in &mut edges {
        edge.seen_px -= edge.normal * not_by_pose_px(edge);
    }
    let mut fitting = vec![0; templates.len()];
    for edge in edges.iter().filter(|edge| edge.weight > FITTING) {
        fitting[edge.template] += 1;
    }
    let seen: Vec<bool> = templates
        .iter()
        .zip(fitting)
        .map(|(template, fitting)| {
            fitting >= SEEN_EDGES && fitting as f64 >= SEEN_SHARE * template.edges.len() as f64
        })
        .collect();
    if !seen.contains(&true) {
        return None;
    }
    let mut equations = NormalEquations::<POSE_PARAMETERS>::ZERO;
    let (mut squares, mut used) = (0.0, 0.0);
    for edge in &edges {
        equations.add_weighted(&pose_part(&edge.row), 0.0, edge.weight / edge.variance);
        let left_px = edge.left_px(&solved.step);
        squares += edge.weight * left_px * left_px / edge.variance;
        used += edge.weight;
    }
    // Edges err more than their pixels' noise says where a codec has been at work.
    let excess = (squares / (used - PARAMETERS as f64).max(1.0)).max(1.0);
    Some(PixelPose {
        camera_from_anchor: guess.camera_from_anchor,
        covariance: equations.covariance()? * excess,
        seen,
        rms_px: (squares_px / f64::max(counted, 1.0)).sqrt(),
        excess,
        edges,
    })
}
