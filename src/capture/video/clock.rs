//! The times of a video's frames since the first, from their time stamps. Readers count on times that increase.

/// Stamps that go back by more start again: recordings that were put one after the other.
const LEAST_RESTART_SECS: f64 = 0.5;

/// What the stamps of a video come to.
pub(super) struct Clock {
    frame_secs: f64,
    /// The shortest step between two frames with times of their own, or `frame_secs`.
    least_step_secs: f64,
    origin: Origin,
    /// The last stamp.
    pub(super) last_stamp_secs: Option<f64>,
    last_secs: Option<f64>,
    /// Whether the last frame had no time of its own.
    is_moved: bool,
    /// How many frames had none: no stamp, or one that does not increase.
    pub(super) moved_frames: u32,
}

/// What is taken from the stamps.
#[derive(Default)]
struct Origin {
    secs: Option<f64>,
    /// The one before the stamps started again: they may come back to it.
    before_secs: Option<f64>,
}

impl Clock {
    /// Of a video with a frame in so many seconds.
    pub(super) fn new(frame_secs: f64) -> Self {
        Self {
            frame_secs,
            least_step_secs: frame_secs,
            origin: Origin::default(),
            last_stamp_secs: None,
            last_secs: None,
            is_moved: false,
            moved_frames: 0,
        }
    }

    /// The time of the next frame.
    pub(super) fn time_secs(&mut self, stamp_secs: Option<f64>) -> f64 {
        let own_secs = stamp_secs.and_then(|stamp_secs| self.by_stamp(stamp_secs));
        let time_secs = own_secs.unwrap_or_else(|| self.beside_the_last(stamp_secs));
        if let (Some(own_secs), Some(last_secs), false) = (own_secs, self.last_secs, self.is_moved)
        {
            self.least_step_secs = self.least_step_secs.min(own_secs - last_secs);
        }
        self.is_moved = own_secs.is_none();
        self.moved_frames += u32::from(self.is_moved);
        self.last_stamp_secs = stamp_secs.or(self.last_stamp_secs);
        self.last_secs = Some(time_secs);
        time_secs
    }

    /// What a stamp says; `None` where time would not go on by it.
    fn by_stamp(&mut self, stamp_secs: f64) -> Option<f64> {
        let next_secs = self.last_secs.map_or(0.0, |last| last + self.frame_secs);
        let starts_again = |last: f64| stamp_secs < last - LEAST_RESTART_SECS;
        if self.last_stamp_secs.is_some_and(starts_again) {
            let before_secs = self.origin.secs.replace(stamp_secs - next_secs);
            self.origin.before_secs = before_secs;
        }
        let origin_secs = *self.origin.secs.get_or_insert(stamp_secs - next_secs);
        let last_secs = self.last_secs.unwrap_or(f64::NEG_INFINITY);
        let by = |origin_secs: f64| Some(stamp_secs - origin_secs).filter(|&secs| secs > last_secs);
        // A stamp or two that were wrong: the old times go on.
        if let Some(before_secs) = self.origin.before_secs
            && let Some(secs) = by(before_secs)
        {
            self.origin = Origin {
                secs: Some(before_secs),
                before_secs: None,
            };
            return Some(secs);
        }
        by(origin_secs)
    }

    /// The time of a frame that has none of its own: a little after the last, before the next one that has. Where there is nothing
    /// but the same stamp it is the rate's.
    fn beside_the_last(&self, stamp_secs: Option<f64>) -> f64 {
        let is_lone =
            stamp_secs.is_some() && !(self.is_moved && stamp_secs == self.last_stamp_secs);
        let step_secs = match is_lone {
            true => 0.5 * self.least_step_secs,
            false => self.frame_secs,
        };
        self.last_secs.map_or(0.0, |last| last + step_secs)
    }

    /// To the end of the last frame.
    pub(super) fn length_secs(&self) -> f64 {
        self.last_secs.map_or(0.0, |last| last + self.frame_secs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The times of stamps at ten frames a second, and how many had none of their own.
    fn times(stamps: &[f64]) -> (Vec<f64>, u32) {
        let mut clock = Clock::new(0.1);
        let times = stamps
            .iter()
            .map(|&stamp| clock.time_secs(Some(stamp)))
            .collect();
        (times, clock.moved_frames)
    }

    fn assert_times(stamps: &[f64], expected: &[f64], moved: u32) {
        let (found, count) = times(stamps);
        let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < 1e-9, "{stamps:?}: {found:?}");
        assert_eq!((found.len(), count), (expected.len(), moved), "{stamps:?}");
    }

    #[test]
    fn a_stamp_that_does_not_increase_moves_its_own_frame_alone() {
        assert_times(&[5.0, 5.1, 5.1, 5.3], &[0.0, 0.1, 0.15, 0.3], 1);
        assert_times(&[0.0, 0.1, 0.05, 0.2], &[0.0, 0.1, 0.15, 0.2], 1);
        assert_times(&[2.0, 2.0, 2.0, 2.0], &[0.0, 0.05, 0.15, 0.25], 3);
        // Frames that come faster than the rate says.
        assert_times(&[0.0, 0.02, 0.02, 0.04], &[0.0, 0.02, 0.03, 0.04], 1);
    }

    #[test]
    fn stamps_that_start_again_go_on_by_a_frame() {
        let joined = [9.0, 9.1, 9.8, 1.0, 1.1, 1.9, 2.0];
        assert_times(&joined, &[0.0, 0.1, 0.8, 0.9, 1.0, 1.8, 1.9], 0);
        // Forth again, which a wrong stamp was between.
        let wrong = [9.0, 9.1, 9.8, 0.0, 10.0, 10.1];
        assert_times(&wrong, &[0.0, 0.1, 0.8, 0.9, 1.0, 1.1], 0);
    }

    #[test]
    fn frames_without_stamps_come_by_the_rate() {
        let mut clock = Clock::new(0.1);
        let times = [None, None, Some(7.0), None].map(|stamp| clock.time_secs(stamp));
        for (found, expected) in times.into_iter().zip([0.0, 0.1, 0.2, 0.3]) {
            assert!((found - expected).abs() < 1e-9, "{times:?}");
        }
        assert_eq!(clock.moved_frames, 3);
    }
}
