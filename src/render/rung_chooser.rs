//! Keeps frames within a time: chooses a rung of a ladder of settings, the dearest that fits, by what frames took.
//!
//! It goes down at once and up late, and the longer the oftener a rung has turned out too dear: a still scene stays still.

/// Frames whose times count.
const WINDOW: usize = 8;
/// A frame that takes this much more than it may is no noise.
const TOO_LONG: f64 = 1.05;
/// Rungs are taken that are expected to need this part of the time.
const EXPECTED: f64 = 0.85;
/// Frames for which a rung that was too dear is not tried again, the first time.
const FIRST_HOLD: u32 = 64;

/// The rung that fits.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RungChooser {
    budget_ms: f64,
    /// What each rung costs in any unit, rising.
    costs: Vec<f64>,
    rung: usize,
    /// Times at this rung, the last one last.
    times_ms: Vec<f64>,
    /// Whether the next frame has to redo what a change of rungs throws away.
    settles: bool,
    /// Frames until a dearer rung may be tried, and for how many the next one is barred.
    barred: u32,
    hold: u32,
}

impl RungChooser {
    /// Starts on the dearest rung.
    pub fn new(budget_ms: f64, costs: Vec<f64>) -> Self {
        Self {
            budget_ms,
            rung: costs.len().saturating_sub(1),
            costs,
            times_ms: Vec::new(),
            settles: false,
            barred: 0,
            hold: FIRST_HOLD,
        }
    }

    /// The present rung.
    pub fn rung(&self) -> usize {
        self.rung
    }

    /// Takes note of what a frame took. Returns whether there is another rung from now on.
    pub fn spent(&mut self, frame_ms: f64) -> bool {
        self.barred = self.barred.saturating_sub(1);
        if std::mem::take(&mut self.settles) {
            return false;
        }
        if self.times_ms.len() == WINDOW {
            self.times_ms.remove(0);
        }
        self.times_ms.push(frame_ms);
        let is_first = self.times_ms.len() == 1;
        let last = &self.times_ms[self.times_ms.len().saturating_sub(2)..];
        let least_of_last = last.iter().copied().fold(f64::INFINITY, f64::min);
        let next = if least_of_last > TOO_LONG * self.budget_ms && (last.len() == 2 || is_first) {
            let fits = |&rung: &usize| self.expected_ms(least_of_last, rung) <= self.budget_ms;
            let lower = (0..self.rung).rev().find(fits).unwrap_or(0);
            if lower < self.rung {
                self.barred = self.hold;
                self.hold = self.hold.saturating_mul(2);
            }
            lower
        } else {
            let longest = self.times_ms.iter().copied().fold(0.0, f64::max);
            let dearer = self.rung + 1;
            let may_rise = self.times_ms.len() == WINDOW
                && self.barred == 0
                && dearer < self.costs.len()
                && self.expected_ms(longest, dearer) <= self.budget_ms;
            if may_rise { dearer } else { self.rung }
        };
        let changes = next != self.rung;
        if changes {
            self.rung = next;
            self.times_ms.clear();
            self.settles = true;
        }
        changes
    }

    /// What a frame would take on another rung, with room to spare.
    fn expected_ms(&self, now_ms: f64, rung: usize) -> f64 {
        now_ms * self.costs[rung] / self.costs[self.rung] / EXPECTED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames that take a part that is always the same, and one for each unit of cost; with noise of ±6 %.
    fn run(chooser: &mut RungChooser, fixed_ms: f64, frames: u32) -> Vec<(usize, f64)> {
        let mut noise = 12_345_u32;
        (0..frames)
            .map(|_| {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let factor = 0.94 + 0.12 * f64::from(noise >> 8) / f64::from(1 << 24);
                let rung = chooser.rung();
                let frame_ms = (fixed_ms + chooser.costs[rung]) * factor;
                chooser.spent(frame_ms);
                (rung, frame_ms)
            })
            .collect()
    }

    const COSTS: [f64; 8] = [4.0, 6.0, 8.0, 11.0, 16.0, 23.0, 32.0, 50.0];

    #[test]
    fn budgets_are_held_and_a_still_scene_stays_still() {
        for part in [2.0, 1.2, 0.5, 0.3] {
            let budget_ms = part * 52.0;
            let mut chooser = RungChooser::new(budget_ms, COSTS.to_vec());
            let frames = run(&mut chooser, 2.0, 400);
            let mut times: Vec<f64> = frames.iter().map(|(_, frame_ms)| *frame_ms).collect();
            times.sort_by(f64::total_cmp);
            assert!(times[380] <= 1.1 * budget_ms, "{part}: {}", times[380]);
            let changes = frames.windows(2).filter(|pair| pair[0].0 != pair[1].0);
            assert!(changes.count() <= 6, "{part}");
            let last = frames[300..].iter();
            assert!(
                last.clone().all(|(rung, _)| *rung == frames[399].0),
                "{part}"
            );
            // And no more is given up than has to be.
            let dearer = frames[399].0 + 1;
            assert!(
                dearer == COSTS.len() || (2.0 + COSTS[dearer]) / EXPECTED > 0.9 * budget_ms,
                "{part}: rung {}",
                frames[399].0
            );
        }
    }

    #[test]
    fn what_cannot_be_held_ends_on_the_cheapest_rung() {
        let mut chooser = RungChooser::new(1.0, COSTS.to_vec());
        run(&mut chooser, 2.0, 50);
        assert_eq!(chooser.rung(), 0);
    }

    #[test]
    fn when_frames_become_cheap_again_it_rises() {
        let mut chooser = RungChooser::new(30.0, COSTS.to_vec());
        run(&mut chooser, 25.0, 60);
        let low = chooser.rung();
        run(&mut chooser, 0.0, 400);
        assert!(chooser.rung() > low);
    }
}
