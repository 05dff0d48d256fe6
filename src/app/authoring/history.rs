//! The texts that a scene had, step by step.

/// How many steps are kept; the oldest go first.
const MOST_STEPS: usize = 500;

/// What was done, and the text before and after.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EditStep {
    pub label: String,
    pub before: String,
    pub after: String,
}

/// Steps that were taken, and those that were taken back.
#[derive(Debug, Default)]
pub struct History {
    done: Vec<EditStep>,
    undone: Vec<EditStep>,
}

impl History {
    /// A step was taken; what was taken back before is given up.
    pub fn push(&mut self, step: EditStep) {
        self.undone.clear();
        self.done.push(step);
        if self.done.len() > MOST_STEPS {
            self.done.remove(0);
        }
    }

    /// What would be taken back next.
    pub fn next_undo(&self) -> Option<&EditStep> {
        self.done.last()
    }

    /// What would be taken again next.
    pub fn next_redo(&self) -> Option<&EditStep> {
        self.undone.last()
    }

    /// The last step was taken back.
    pub fn undid(&mut self) {
        self.undone.extend(self.done.pop());
    }

    /// The last step taken back was taken again.
    pub fn redid(&mut self) {
        self.done.extend(self.undone.pop());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(number: usize) -> EditStep {
        EditStep {
            label: number.to_string(),
            before: format!("{number}"),
            after: format!("{}", number + 1),
        }
    }

    #[test]
    fn steps_go_back_and_forth_until_another_is_taken() {
        let mut history = History::default();
        history.push(step(0));
        history.push(step(1));
        history.undid();
        assert_eq!(history.next_undo(), Some(&step(0)));
        assert_eq!(history.next_redo(), Some(&step(1)));
        history.redid();
        assert_eq!(history.next_undo(), Some(&step(1)));
        history.undid();
        history.push(step(7));
        assert_eq!(history.next_redo(), None);
        for number in 0..2 * MOST_STEPS {
            history.push(step(number));
        }
        assert_eq!(history.done.len(), MOST_STEPS);
        assert_eq!(history.next_undo(), Some(&step(2 * MOST_STEPS - 1)));
    }
}
