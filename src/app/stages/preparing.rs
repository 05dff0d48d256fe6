//! A scene's renderer for a job: what takes long before the first frame shows how far it is, and an interrupt ends it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Result;

use super::progress::Progress;
use crate::app::precomputed::{Onlooker, watched_renderer};
use crate::geometry::camera::Intrinsics;
use crate::render::{Gpu, Renderer};
use crate::scene::Scene;

/// The renderer of a scene. Where `stop` was set meanwhile, it is not to draw.
///
/// # Errors
/// A picture larger than the adapter can hold, or a device that failed.
pub fn renderer(
    gpu: Arc<Gpu>,
    scene: &Scene,
    intrinsics: Intrinsics,
    stop: &AtomicBool,
) -> Result<Renderer> {
    let shown = ShownProgress {
        bar: Mutex::new(None),
        stop,
    };
    Ok(watched_renderer(gpu, scene, intrinsics, &shown)?)
}

/// Shows a bar for each thing.
struct ShownProgress<'a> {
    bar: Mutex<Option<Progress>>,
    stop: &'a AtomicBool,
}

impl Onlooker for ShownProgress<'_> {
    fn sees(&self, done: usize, of: usize) -> bool {
        let goes_on = self.goes_on();
        let mut bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner);
        match done < of && goes_on {
            true => bar
                .get_or_insert_with(|| Progress::of_points(of))
                .reach(done),
            false => bar.take().iter().for_each(Progress::finish),
        }
        goes_on
    }

    fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }
}
