//! What is unfinished at any moment, for an end without warning to take back.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::capture::children::end_all;

type TakeBack = Box<dyn FnOnce() + Send>;

/// What takes each unfinished thing of this process back, by numbers that grow.
static LIST: Mutex<BTreeMap<u64, TakeBack>> = Mutex::new(BTreeMap::new());

/// Something unfinished. Dropped, it is finished, or was taken back.
#[derive(Debug)]
pub(crate) struct Unfinished(u64);

impl Unfinished {
    /// Makes something, and what takes it back, with no end without warning in between. What takes it back waits for no lock
    /// under which an `Unfinished` is dropped.
    ///
    /// # Errors
    /// What kept it from being made.
    pub(crate) fn begin<T, E>(
        make: impl FnOnce() -> Result<T, E>,
        take_back: impl FnOnce(&T) -> TakeBack,
    ) -> Result<(T, Self), E> {
        let mut list = list();
        let made = make()?;
        let number = list.last_key_value().map_or(0, |(last, _)| last + 1);
        list.insert(number, take_back(&made));
        Ok((made, Self(number)))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        list().remove(&self.0);
    }
}

fn list() -> MutexGuard<'static, BTreeMap<u64, TakeBack>> {
    LIST.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes back what is unfinished, ends what runs for this program, and ends the program with this status: for an interrupt of
/// a job that has no better way to end.
pub fn exit_without_traces(status: i32) -> ! {
    // Held to the end, so that nothing else is begun.
    let mut list = list();
    for take_back in std::mem::take(&mut *list).into_values() {
        take_back();
    }
    end_all();
    std::process::exit(status)
}
