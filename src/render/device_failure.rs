//! What a device reports by itself: kept until a picture is read, for wgpu's own answer is a panic.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::{Arc, Mutex, Once, PoisonError};

use super::error::RenderError;

/// The failure of a device, if there was one.
#[derive(Debug, Clone, Default)]
pub(super) struct DeviceFailure(Arc<Mutex<Option<RenderError>>>);

impl DeviceFailure {
    /// Listens to a device from now on.
    pub fn of(device: &wgpu::Device) -> Self {
        let failure = Self::default();
        let uncaptured = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            uncaptured.note(match error {
                wgpu::Error::OutOfMemory { .. } => RenderError::OutOfMemory,
                other => RenderError::Failed(other.to_string()),
            });
        }));
        let lost = failure.clone();
        device.set_device_lost_callback(move |_, message| lost.note(RenderError::Lost(message)));
        failure
    }

    /// The first failure counts; but whatever else is said of a device that is lost follows from that.
    fn note(&self, error: RenderError) {
        let mut noted = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match (&*noted, &error) {
            (None, _) | (Some(RenderError::Failed(_)), RenderError::Lost(_)) => {
                *noted = Some(error);
            }
            _ => {}
        }
    }

    /// # Errors
    /// The failure, if there was one.
    pub fn check(&self) -> Result<(), RenderError> {
        let noted = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        noted.clone().map_or(Ok(()), Err)
    }

    /// Waits until a device has done all that it was given; it panics where it is lost meanwhile.
    ///
    /// # Errors
    /// The failure, if there was one until then.
    pub fn wait(&self, device: &wgpu::Device) -> Result<(), RenderError> {
        self.check()?;
        let polled = without_a_panic(|| device.poll(wgpu::PollType::wait_indefinitely()));
        match polled {
            Ok(Ok(_)) => {}
            Ok(Err(error)) => self.note(RenderError::Failed(error.to_string())),
            Err(panic) => self.note(RenderError::Lost(panic.words)),
        }
        self.check()
    }
}

thread_local! {
    /// Whether a panic of this thread is caught and told otherwise.
    static CAUGHT: Cell<bool> = const { Cell::new(false) };
    /// Where the last one of those arose.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// A panic that was caught, of which nothing was said on stderr.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct CaughtPanic {
    /// Its message.
    pub words: String,
    /// File and line.
    pub place: String,
}

/// What some work gives, or its panic.
pub(crate) fn without_a_panic<T>(work: impl FnOnce() -> T) -> Result<T, CaughtPanic> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| match CAUGHT.get() {
            true => PLACE.set(
                panic
                    .location()
                    .map(ToString::to_string)
                    .unwrap_or_default(),
            ),
            false => usual(panic),
        }));
    });
    CAUGHT.set(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    CAUGHT.set(false);
    done.map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        CaughtPanic {
            words: text.unwrap_or("for no reason that it tells").to_owned(),
            place: PLACE.take(),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_words() {
        assert_eq!(without_a_panic(|| 3), Ok(3));
        let panic = without_a_panic(|| panic!("device {} is lost", 7)).unwrap_err();
        assert_eq!(panic.words, "device 7 is lost");
        assert!(panic.place.contains("device_failure.rs"), "{panic:?}");
    }

    #[test]
    fn a_loss_explains_all_other_failures() {
        let failure = DeviceFailure::default();
        assert!(failure.check().is_ok());
        failure.note(RenderError::Failed("texture is invalid".to_owned()));
        failure.note(RenderError::Lost("reset".to_owned()));
        failure.note(RenderError::Failed("buffer is invalid".to_owned()));
        assert!(matches!(failure.check(), Err(RenderError::Lost(words)) if words == "reset"));
    }
}
