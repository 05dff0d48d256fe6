//! Collects views of a target, one picture at a time, and tells what the set lacks.

use glam::{DMat3, DVec2, DVec3};

use super::{CalibrateError, Coverage, Target, TargetCorner, TargetFinder};
use crate::geometry::homography::{best_homography, mapped};
use crate::geometry::quarter_turns::QuarterTurns;

/// Fewer different views are no calibration.
pub const FEWEST_VIEWS: usize = 4;
/// From here on more views tell little that is new.
const ENOUGH_VIEWS: usize = 12;
/// What a calibration is made of at most: its time grows with the cube of their number.
const MOST_VIEWS: usize = 40;
/// Views whose targets lie closer are alike: root mean square distance of the target's own four corners, as a part of
/// the picture's diagonal.
const ALIKE: f64 = 0.03;
/// Views that tell focal length from distance.
pub(super) const ENOUGH_TILTED: usize = 4;
/// What counts as tilted: the angle between the target's normal and the camera's axis, radians.
pub(super) const TILTED_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// The part of the picture's cells that corners are to be in.
const ENOUGH_COVERAGE: f64 = 0.7;

/// Views of one target by one camera.
pub struct Views {
    finder: TargetFinder,
    size_px: Option<[u32; 2]>,
    kept: Vec<TargetView>,
    looked: u32,
    found: u32,
}

/// A picture of the target.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetView {
    /// The number under which the picture was shown.
    pub picture: u32,
    /// What it shows.
    pub corners: Vec<TargetCorner>,
    /// How it was turned to the others.
    pub(super) placing: Placing,
    /// Where a plain homography puts the corners of the whole target.
    outline_px: [DVec2; 4],
    /// Root mean square distance of the corners from that homography: the lens, and how sharp the picture is.
    misfit_px: f64,
}

/// How a picture lies to those of its camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Placing {
    /// After these turns, as the camera's sensor does.
    Known(QuarterTurns),
    /// After these turns as the camera's sensor does, or upside down: nobody has noted how an upright picture was turned.
    UpOrDown(QuarterTurns),
}

impl Placing {
    fn turns(self) -> QuarterTurns {
        match self {
            Self::Known(turns) | Self::UpOrDown(turns) => turns,
        }
    }
}

/// What became of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TargetLook {
    /// The target was not found.
    NoTarget,
    /// It lies as in another picture, the sharper of which is kept.
    Alike,
    /// It is a new view.
    Kept,
}

/// What a set of views lacks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Lack {
    /// Too few differ.
    #[error("{have} different views; {ENOUGH_VIEWS} or more are better")]
    Views {
        /// How many differ.
        have: usize,
    },
    /// Parts of the picture without corners.
    #[error(
        "corners in {:.0} % of the picture{}: the lens is a guess elsewhere",
        100.0 * share,
        if missing.is_empty() { String::new() } else { format!(", few at {}", missing.join(", ")) }
    )]
    Coverage {
        /// The part of its cells that have corners.
        share: f64,
        /// Corners, sides, middle.
        missing: Vec<&'static str>,
    },
    /// The target was held too square to the camera.
    #[error(
        "{have} views tilted by 15 degrees or more; {ENOUGH_TILTED} or more are better, to all sides"
    )]
    Tilt {
        /// How many are tilted.
        have: usize,
    },
}

impl Views {
    /// # Errors
    /// A target that no detector knows.
    pub fn new(target: Target) -> Result<Self, CalibrateError> {
        Ok(Self {
            finder: TargetFinder::new(target)?,
            size_px: None,
            kept: Vec::new(),
            looked: 0,
            found: 0,
        })
    }

    /// Shows an 8-bit grey picture (rows from the top, no padding). `picture` is its number in what is told of it later.
    ///
    /// # Errors
    /// A picture of another size than those before, or a failure of a library.
    pub fn look(
        &mut self,
        picture: u32,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<TargetLook, CalibrateError> {
        self.look_placed(picture, grey, size_px, Placing::Known(QuarterTurns::NONE))
    }

    /// The same of a picture that is turned against the others.
    ///
    /// # Errors
    /// As there; the size is that after the turn.
    pub fn look_placed(
        &mut self,
        picture: u32,
        grey: &[u8],
        size_px: [u32; 2],
        placing: Placing,
    ) -> Result<TargetLook, CalibrateError> {
        let view = self.see_placed(picture, grey, size_px, placing)?;
        Ok(view.map_or(TargetLook::NoTarget, |view| self.take(view)))
    }

    /// Looks for the target in a picture as [`Views::look`] does, and takes nothing yet; `None` where it is not found.
    ///
    /// # Errors
    /// As there.
    pub fn see(
        &mut self,
        picture: u32,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Option<TargetView>, CalibrateError> {
        self.see_placed(picture, grey, size_px, Placing::Known(QuarterTurns::NONE))
    }

    fn see_placed(
        &mut self,
        picture: u32,
        grey: &[u8],
        size_px: [u32; 2],
        placing: Placing,
    ) -> Result<Option<TargetView>, CalibrateError> {
        let turned_px = placing.turns().size_px(size_px);
        let expected_px = *self.size_px.get_or_insert(turned_px);
        if turned_px != expected_px {
            return Err(CalibrateError::OtherSize {
                size_px: turned_px,
                expected_px,
            });
        }
        self.looked += 1;
        let corners = self.finder.find(grey, size_px)?;
        let view = TargetView::new(picture, corners, self.finder.target())?;
        let view = view.map(|view| TargetView {
            placing,
            ..view.turned(placing.turns(), size_px)
        });
        self.found += u32::from(view.is_some());
        Ok(view)
    }

    /// Takes a view that was seen.
    pub fn take(&mut self, view: TargetView) -> TargetLook {
        let size_px = self.size_px.unwrap_or_default();
        let alike = self
            .kept
            .iter_mut()
            .find(|kept| kept.distance(&view, size_px) < ALIKE);
        let Some(kept) = alike else {
            self.kept.push(view);
            return TargetLook::Kept;
        };
        // The lens bends both alike: what differs is blur and noise.
        let better = (view.corners.len(), -view.misfit_px) > (kept.corners.len(), -kept.misfit_px);
        if better {
            *kept = view;
        }
        TargetLook::Alike
    }

    /// The same views in pictures that are all turned: so that the calibration holds for how they are shown.
    #[must_use]
    pub fn turned(mut self, turns: QuarterTurns) -> Self {
        if let Some(size_px) = self.size_px {
            self.size_px = Some(turns.size_px(size_px));
            for view in &mut self.kept {
                *view = view.turned(turns, size_px);
            }
        }
        self
    }

    /// Forgets the view that was taken last; false where there is none.
    pub fn drop_last(&mut self) -> bool {
        self.kept.pop().is_some()
    }

    /// Whether a view differs from all that were taken by this part of the picture's diagonal (root mean square distance
    /// of the target's own four corners) or more.
    pub(super) fn is_new(&self, view: &TargetView, by: f64) -> bool {
        let size_px = self.size_px.unwrap_or_default();
        let mut kept = self.kept.iter();
        kept.all(|kept| kept.distance(view, size_px) >= by)
    }

    /// Whether a view would make less of something that the set lacks.
    pub(super) fn helps(&self, view: &TargetView) -> bool {
        let (Some(coverage), Some(size_px)) = (self.coverage(), self.size_px) else {
            return true;
        };
        self.lacks().iter().any(|lack| match lack {
            Lack::Views { .. } => true,
            Lack::Coverage { .. } => coverage.fresh(view.pixels()) > 0,
            Lack::Tilt { .. } => view
                .rough_tilt_rad(size_px)
                .is_some_and(|tilt_rad| tilt_rad > TILTED_RAD),
        })
    }

    /// What is looked for.
    pub fn target(&self) -> &Target {
        self.finder.target()
    }

    /// Width and height of the pictures; `None` before the first.
    pub fn size_px(&self) -> Option<[u32; 2]> {
        self.size_px
    }

    /// Pictures that were shown.
    pub fn looked(&self) -> u32 {
        self.looked
    }

    /// Pictures that show the target.
    pub fn found(&self) -> u32 {
        self.found
    }

    /// The views that differ, in the order in which they were shown.
    pub fn kept(&self) -> &[TargetView] {
        &self.kept
    }

    /// Where the kept views' corners lie; `None` before the first picture.
    pub fn coverage(&self) -> Option<Coverage> {
        self.size_px.map(|size_px| coverage_of(&self.kept, size_px))
    }

    /// What the kept views lack; nothing when they are good.
    pub fn lacks(&self) -> Vec<Lack> {
        let Some(coverage) = self.coverage() else {
            return vec![Lack::Views { have: 0 }];
        };
        let tilted = self.kept.iter().filter(|view| {
            let tilt_rad = self
                .size_px
                .and_then(|size_px| view.rough_tilt_rad(size_px));
            tilt_rad.is_some_and(|tilt_rad| tilt_rad > TILTED_RAD)
        });
        lacks_of(self.kept.len(), &coverage, tilted.count())
    }

    /// How many pictures show a ChArUco board left for right; they are left out.
    pub fn mirrored(&self) -> u32 {
        self.finder.shown_instead().mirrored
    }

    /// Why most pictures tell little, where their squares are too small for it.
    pub(super) fn too_small(&self) -> Option<CalibrateError> {
        let small = self.finder.small_squares();
        (2 * small.pictures > self.looked).then_some(CalibrateError::TooSmall {
            looked: self.looked,
            small,
        })
    }

    /// Why no picture shows the target.
    fn why_none(&self) -> CalibrateError {
        let (looked, target) = (self.looked, *self.target());
        if let Some(too_small) = self.too_small() {
            return too_small;
        }
        if self.mirrored() > 0 {
            return CalibrateError::Mirrored {
                looked,
                seen: self.mirrored(),
            };
        }
        match self.finder.shown_instead().other_board() {
            Some((corners, seen)) => CalibrateError::OtherBoard {
                looked,
                seen,
                corners,
                target,
            },
            None => CalibrateError::NoTarget { looked, target },
        }
    }

    /// The views that a calibration is made of: all, or those that cover most and differ most.
    pub(super) fn chosen(&self) -> Result<Vec<&TargetView>, CalibrateError> {
        if self.finder.swapped() > self.found {
            return Err(CalibrateError::Swapped {
                looked: self.looked,
                seen: self.finder.swapped(),
                squares: self.target().swapped().squares,
            });
        }
        let Some(size_px) = self.size_px.filter(|_| self.found > 0) else {
            return Err(self.why_none());
        };
        if self.found < FEWEST_VIEWS as u32 {
            if let Some(too_small) = self.too_small() {
                return Err(too_small);
            }
            return Err(CalibrateError::TooFewViews {
                looked: self.looked,
                found: self.found,
            });
        }
        if self.kept.len() < FEWEST_VIEWS {
            return Err(CalibrateError::Alike {
                found: self.found,
                different: self.kept.len(),
            });
        }
        let mut rest: Vec<&TargetView> = self.kept.iter().collect();
        if rest.len() <= MOST_VIEWS {
            return Ok(rest);
        }
        let mut chosen: Vec<&TargetView> = Vec::new();
        let mut coverage = Coverage::new(size_px);
        while chosen.len() < MOST_VIEWS {
            let worth = |view: &TargetView| {
                let nearest = chosen
                    .iter()
                    .map(|other| other.distance(view, size_px))
                    .fold(1.0, f64::min);
                nearest * (1 + coverage.fresh(view.pixels())) as f64
            };
            let best = (0..rest.len()).max_by(|&a, &b| worth(rest[a]).total_cmp(&worth(rest[b])));
            let Some(best) = best else { break };
            let view = rest.swap_remove(best);
            coverage.add(view.pixels());
            chosen.push(view);
        }
        chosen.sort_by_key(|view| view.picture);
        Ok(chosen)
    }
}

pub(super) fn coverage_of<'a>(
    views: impl IntoIterator<Item = &'a TargetView>,
    size_px: [u32; 2],
) -> Coverage {
    let mut coverage = Coverage::new(size_px);
    for view in views {
        coverage.add(view.pixels());
    }
    coverage
}

pub(super) fn lacks_of(views: usize, coverage: &Coverage, tilted: usize) -> Vec<Lack> {
    let mut lacks = Vec::new();
    if views < ENOUGH_VIEWS {
        lacks.push(Lack::Views { have: views });
    }
    if tilted < ENOUGH_TILTED {
        lacks.push(Lack::Tilt { have: tilted });
    }
    if coverage.share() < ENOUGH_COVERAGE {
        lacks.push(Lack::Coverage {
            share: coverage.share(),
            missing: coverage.missing_parts(),
        });
    }
    lacks
}

impl TargetView {
    /// `None` where the corners determine no plane.
    pub(super) fn new(
        picture: u32,
        corners: Vec<TargetCorner>,
        target: &Target,
    ) -> Result<Option<Self>, CalibrateError> {
        let pairs: Vec<(DVec2, DVec2)> = corners
            .iter()
            .map(|corner| (corner.target_m, corner.pixel))
            .collect();
        let Some(picture_from_target) = best_homography(&pairs) else {
            return Ok(None);
        };
        let squared: f64 = pairs
            .iter()
            .map(|&(target_m, pixel)| {
                (mapped(&picture_from_target, target_m) - pixel).length_squared()
            })
            .sum();
        let size_m = DVec2::new(f64::from(target.squares[0]), f64::from(target.squares[1]))
            * target.square_m;
        let outline_px = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y]
            .map(|place| mapped(&picture_from_target, place * size_m));
        Ok(outline_px
            .iter()
            .all(|corner| corner.is_finite())
            .then(|| Self {
                picture,
                placing: Placing::Known(QuarterTurns::NONE),
                misfit_px: (squared / pairs.len() as f64).sqrt(),
                corners,
                outline_px,
            }))
    }

    /// The view in the picture of this size, turned.
    #[must_use]
    pub(super) fn turned(&self, turns: QuarterTurns, size_px: [u32; 2]) -> Self {
        let corners = self.corners.iter().map(|corner| TargetCorner {
            pixel: turns.pixel(corner.pixel, size_px),
            ..*corner
        });
        Self {
            corners: corners.collect(),
            outline_px: self.outline_px.map(|pixel| turns.pixel(pixel, size_px)),
            ..self.clone()
        }
    }

    /// Where its corners are in the picture.
    pub fn pixels(&self) -> impl Iterator<Item = DVec2> {
        self.corners.iter().map(|corner| corner.pixel)
    }

    /// The corners of the whole target, in its order, as a plain homography puts them; pixels.
    pub fn outline_px(&self) -> [DVec2; 4] {
        self.outline_px
    }

    /// How far two views put the target's outline apart, as a part of the picture's diagonal. A chessboard looks the same
    /// when turned by 180°.
    pub(super) fn distance(&self, other: &Self, size_px: [u32; 2]) -> f64 {
        let [width, height] = size_px.map(f64::from);
        let turned = |turn: usize| {
            let squared: f64 = (0..4)
                .map(|k| self.outline_px[k].distance_squared(other.outline_px[(k + turn) % 4]))
                .sum();
            (squared / 4.0).sqrt()
        };
        turned(0).min(turned(2)) / width.hypot(height)
    }

    /// The angle between the target's normal and the camera's axis as a camera with a usual lens would see it, radians.
    fn rough_tilt_rad(&self, size_px: [u32; 2]) -> Option<f64> {
        /// Focal length as a part of the picture's longer side: 53° across.
        const USUAL_FOCAL: f64 = 1.0;
        let [width, height] = size_px.map(f64::from);
        let focal_px = USUAL_FOCAL * width.max(height);
        let middle_px = DVec2::new(width, height) / 2.0;
        let [a, b, c, d] = self
            .outline_px
            .map(|pixel| ((pixel - middle_px) / focal_px).extend(1.0));
        // The outline is a parallelogram a + c = b + d at depths that its rays tell up to scale.
        let depths = depths_of(a, b, c, d)?;
        let (a, b, d) = (a, b * depths[0], d * depths[2]);
        let normal = (b - a).cross(d - a);
        Some((normal.z.abs() / normal.length()).acos())
    }
}

/// Depths of b, c and d against a's.
fn depths_of(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<[f64; 3]> {
    // a + c t = b s + d u
    let matrix = DMat3::from_cols(b, -c, d);
    let depths = (matrix.inverse() * a).to_array();
    depths
        .iter()
        .all(|depth| depth.is_finite() && *depth > 0.0)
        .then_some(depths)
}
