//! Takes views by itself while somebody holds the target to a camera: when it is held still, and where the set gains.

use super::{CalibrateError, Target, TargetLook, TargetView, Views};

/// A view is taken by itself when it differs from all others by this: root mean square distance of the target's own four
/// corners, as a part of the picture's diagonal.
const WORTH_TAKING: f64 = 0.08;
/// From one picture that is looked at to the next a hand moves a target by more, unless it holds it still; in the same
/// measure. Two pixels of 640 x 480: what moves no more is not blurred either.
const STILL: f64 = 0.0025;

/// Views, and when they are taken.
pub struct Taker {
    views: Views,
    before: Option<TargetView>,
}

/// What became of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// The target was not found.
    NoTarget,
    /// It moves: the picture would be blurred.
    Moves,
    /// It is held still where it tells nothing that the set lacks.
    Known,
    /// It is a new view.
    Taken,
}

impl Taker {
    /// # Errors
    /// A target that no detector knows.
    pub fn new(target: Target) -> Result<Self, CalibrateError> {
        Ok(Self {
            views: Views::new(target)?,
            before: None,
        })
    }

    /// Shows the next 8-bit grey picture (rows from the top, no padding); `by_hand` takes it whether or not it is still and
    /// tells something new. What was seen comes along with what became of it.
    ///
    /// # Errors
    /// A picture of another size than those before, or a failure of a library.
    pub fn show(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
        by_hand: bool,
    ) -> Result<(Moment, Option<TargetView>), CalibrateError> {
        let seen = self.views.see(self.views.looked(), grey, size_px)?;
        Ok((self.judge(seen.clone(), size_px, by_hand), seen))
    }

    fn judge(&mut self, seen: Option<TargetView>, size_px: [u32; 2], by_hand: bool) -> Moment {
        let before = std::mem::replace(&mut self.before, seen.clone());
        let Some(view) = seen else {
            return Moment::NoTarget;
        };
        if !by_hand {
            let still = before.is_some_and(|before| before.distance(&view, size_px) < STILL);
            if !still {
                return Moment::Moves;
            }
            if !self.views.is_new(&view, WORTH_TAKING) || !self.views.helps(&view) {
                return Moment::Known;
            }
        }
        match self.views.take(view) {
            TargetLook::Kept => Moment::Taken,
            TargetLook::Alike | TargetLook::NoTarget => Moment::Known,
        }
    }

    /// Forgets the view that was taken last; false where there is none.
    pub fn drop_last(&mut self) -> bool {
        self.views.drop_last()
    }

    /// The views so far. A view's number tells how many pictures were shown before it.
    pub fn views(&self) -> &Views {
        &self.views
    }

    /// The views.
    pub fn into_views(self) -> Views {
        self.views
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Lack, TargetCorner};
    use glam::DVec2;

    const SIZE_PX: [u32; 2] = [640, 480];

    /// The target's middle at a place of the picture, upright and `wide_px` wide; farther away to the right, where it is
    /// shrunk to a part.
    fn view(taker: &Taker, middle_px: [f64; 2], wide_px: f64, shrunk: f64) -> TargetView {
        let target = taker.views().target();
        let wide_m = f64::from(target.squares[0]) * target.square_m;
        let high_m = f64::from(target.squares[1]) * target.square_m;
        let corner = |target_m: DVec2| {
            let depth = 1.0 + (1.0 / shrunk - 1.0) * target_m.x / wide_m;
            let from_middle_m = target_m - DVec2::new(wide_m, high_m) / 2.0;
            let pixel = DVec2::from(middle_px) + from_middle_m * (wide_px / wide_m) / depth;
            TargetCorner { target_m, pixel }
        };
        let corners = target.corners_m().into_iter().map(corner).collect();
        TargetView::new(0, corners, target).unwrap().unwrap()
    }

    fn taker() -> Taker {
        let mut taker = Taker::new(Target::chessboard([8, 5], 0.025).unwrap()).unwrap();
        let empty = vec![128; 640 * 480];
        assert_eq!(
            taker.show(&empty, SIZE_PX, true).unwrap(),
            (Moment::NoTarget, None)
        );
        taker
    }

    /// Moves the target there and holds it still.
    fn hold(taker: &mut Taker, middle_px: [f64; 2], wide_px: f64, shrunk: f64) -> Moment {
        let view = view(taker, middle_px, wide_px, shrunk);
        let moved = taker.judge(Some(view.clone()), SIZE_PX, false);
        assert_eq!(moved, Moment::Moves);
        taker.judge(Some(view), SIZE_PX, false)
    }

    #[test]
    fn a_view_is_taken_once_it_is_held_still() {
        let mut taker = taker();
        // Three pixels a picture are too many.
        for step in 0..10 {
            let at = view(&taker, [200.0 + 3.0 * f64::from(step), 240.0], 200.0, 1.0);
            assert_eq!(taker.judge(Some(at), SIZE_PX, false), Moment::Moves);
        }
        let at = view(&taker, [228.0, 240.0], 200.0, 1.0);
        assert_eq!(taker.judge(Some(at.clone()), SIZE_PX, false), Moment::Taken);
        assert_eq!(taker.judge(Some(at), SIZE_PX, false), Moment::Known);
        assert_eq!(taker.judge(None, SIZE_PX, false), Moment::NoTarget);
        // A little aside it is no other view, unless somebody wants it.
        assert_eq!(hold(&mut taker, [270.0, 240.0], 200.0, 1.0), Moment::Known);
        let aside = view(&taker, [270.0, 240.0], 200.0, 1.0);
        assert_eq!(taker.judge(Some(aside), SIZE_PX, true), Moment::Taken);
        assert_eq!(taker.views().kept().len(), 2);
        assert!(taker.drop_last());
        assert_eq!(hold(&mut taker, [320.0, 240.0], 200.0, 1.0), Moment::Taken);
        assert!(taker.drop_last() && taker.drop_last() && !taker.drop_last());
    }

    #[test]
    fn when_there_are_enough_it_takes_what_is_lacking_alone() {
        let mut taker = taker();
        // The left half of the picture, near and far.
        for wide_px in [110.0, 230.0] {
            for y in [60.0, 180.0, 300.0, 420.0] {
                for x in [75.0, 190.0] {
                    hold(&mut taker, [x, y], wide_px, 1.0);
                }
            }
        }
        let lacks = taker.views().lacks();
        assert!(taker.views().kept().len() >= 12, "{lacks:?}");
        let missing = lacks.iter().find_map(|lack| match lack {
            Lack::Coverage { missing, .. } => Some(missing.as_slice()),
            _ => None,
        });
        assert_eq!(missing, Some(&["top right", "right", "bottom right"][..]));
        let nothing_new = hold(&mut taker, [160.0, 240.0], 310.0, 1.0);
        assert_eq!(nothing_new, Moment::Known);
        let right = hold(&mut taker, [560.0, 60.0], 150.0, 1.0);
        assert_eq!(right, Moment::Taken);
        for y in [180.0, 300.0, 420.0] {
            hold(&mut taker, [560.0, y], 150.0, 1.0);
        }
        let lacks = taker.views().lacks();
        assert!(matches!(lacks[..], [Lack::Tilt { have: 0 }]), "{lacks:?}");
        let square_on = hold(&mut taker, [320.0, 240.0], 320.0, 1.0);
        assert_eq!(square_on, Moment::Known);
        for middle_px in [
            [320.0, 160.0],
            [320.0, 300.0],
            [220.0, 240.0],
            [440.0, 240.0],
        ] {
            let tilted = hold(&mut taker, middle_px, 320.0, 0.75);
            assert_eq!(tilted, Moment::Taken);
        }
        assert_eq!(taker.views().lacks(), []);
        let one_more = hold(&mut taker, [320.0, 240.0], 420.0, 0.7);
        assert_eq!(one_more, Moment::Known, "it is enough");
    }
}
