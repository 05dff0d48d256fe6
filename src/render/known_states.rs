//! What was worked out for the last few states of a scene, so that what comes back is not worked out again: a frame with
//! translucent layers is drawn without and with each of them.

use glam::DAffine3;

use crate::light::Light;

/// States that are known at once, where nothing moves.
const MOST: usize = 16;

/// Where things are in the space that light is known in (`None`: not there), and the lights there.
pub(super) type Standing = (Vec<Option<DAffine3>>, Vec<Light>);

/// Values by what they were worked out for, the last one first.
pub(super) struct KnownStates<State, Value> {
    known: Vec<(State, Value)>,
    most: usize,
}

impl<State: PartialEq, Value> KnownStates<State, Value> {
    /// None yet; of a scene that `moves` each frame has another, and the last one is enough.
    pub fn new(moves: bool) -> Self {
        Self {
            known: Vec::new(),
            most: if moves { 1 } else { MOST },
        }
    }

    /// Takes out what is known of a state.
    pub fn take(&mut self, state: &State) -> Option<Value> {
        let place = self.known.iter().position(|(known, _)| known == state)?;
        Some(self.known.remove(place).1)
    }

    /// Keeps what was worked out for a state that is not known; the oldest is forgotten.
    pub fn keep(&mut self, state: State, value: Value) {
        self.known.insert(0, (state, value));
        self.known.truncate(self.most);
    }

    /// What was kept last.
    pub fn last(&self) -> Option<&(State, Value)> {
        self.known.first()
    }

    /// What was kept last, to be changed.
    pub fn last_mut(&mut self) -> Option<&mut (State, Value)> {
        self.known.first_mut()
    }

    /// All that is known.
    pub fn iter(&self) -> impl Iterator<Item = &(State, Value)> {
        self.known.iter()
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.known.clear();
    }
}

/// Whether two states differ in what is there, and in nothing else.
pub(super) fn differ_in_presence(one: &Standing, other: &Standing) -> bool {
    let alike = |(one, other): (&Option<DAffine3>, &Option<DAffine3>)| {
        one.is_none() || other.is_none() || one == other
    };
    one.1 == other.1 && one.0.len() == other.0.len() && one.0.iter().zip(&other.0).all(alike)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn what_comes_back_is_known_and_the_oldest_is_forgotten() {
        let mut known = KnownStates::new(false);
        for state in 0..MOST + 1 {
            known.keep(state, 10 * state);
        }
        assert_eq!(known.take(&0), None);
        assert_eq!(known.take(&1), Some(10));
        assert_eq!(known.take(&1), None);
        known.keep(1, 11);
        assert_eq!(known.last(), Some(&(1, 11)));
    }

    #[test]
    fn what_is_elsewhere_differs_in_more_than_presence() {
        let here = Some(DAffine3::IDENTITY);
        let there = Some(DAffine3::from_translation(DVec3::X));
        let of = |poses: [Option<DAffine3>; 2]| (poses.to_vec(), Vec::new());
        assert!(differ_in_presence(&of([here, None]), &of([here, there])));
        assert!(!differ_in_presence(&of([here, here]), &of([here, there])));
    }
}
