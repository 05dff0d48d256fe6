//! What a scene's frame budget comes to on this machine: one frame of its recording is drawn until the settings settle.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Result, bail, ensure};

use crate::app::stages::budget_words::setting_words;
use crate::app::stages::source;
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::capture::live::is_live;
use crate::render::{Gpu, Shown};
use crate::scene::Scene;
use crate::tracking::Tracker;

/// Frames that are looked at for one that shows where the world is.
const FIRST_FRAMES: usize = 16;
/// Times that it is drawn, at most in all…
const DRAWS: usize = 200;
/// …and at most for so long, milliseconds.
const LONGEST_MS: f64 = 6000.0;
/// The last of them tell what frames take.
const LAST: usize = 20;

/// A line for people; `None` where the scene has no frame budget.
pub fn budget_line(scene: &Scene) -> Option<String> {
    let budget_ms = scene.shadows.frame_budget_ms?;
    let told = measured(scene).unwrap_or_else(|error| format!("not measured: {error:#}"));
    Some(format!("{budget_ms} ms a frame: {told}"))
}

fn measured(scene: &Scene) -> Result<String> {
    if is_live(&scene.camera.source) {
        bail!("that takes a recording");
    }
    let (mut source, camera) = source::open(scene, &AtomicBool::new(false))?;
    let intrinsics = camera.intrinsics();
    let mut tracker = Tracker::new(&scene.tracking, &scene.anchors, intrinsics)?;
    let mut found = None;
    for _ in 0..FIRST_FRAMES {
        let Some(frame) = source.next_frame()? else {
            break;
        };
        let poses: Vec<_> = tracker
            .track(&frame)?
            .into_iter()
            .map(|pose| pose.camera_from_anchor)
            .collect();
        if poses.first().is_some_and(Option::is_some) {
            let nodes = scene.camera_from_nodes(&poses, frame.time_secs);
            found = Some((frame, nodes));
            break;
        }
    }
    let Some((frame, poses)) = found else {
        bail!("the recording's first frames do not show where the world is");
    };
    let gpu = Arc::new(Gpu::open(None)?);
    let mut renderer = crate::app::precomputed::renderer(Arc::clone(&gpu), scene, intrinsics)?;
    let watch = Stopwatch::start();
    let mut frames_ms = Vec::new();
    while frames_ms.len() < DRAWS && watch.elapsed_ms() < LONGEST_MS {
        let (drawn, ms) = Stopwatch::time(|| {
            renderer.upload(&frame)?;
            renderer.set_time(frame.time_secs);
            renderer.draw(&poses, Shown::Composite);
            renderer.wait()
        });
        drawn?;
        renderer.spent(ms);
        frames_ms.push(ms);
    }
    let controller = renderer.quality_controller();
    ensure!(
        controller.is_some(),
        "the technique has nothing to leave out"
    );
    let last = &frames_ms[frames_ms.len().saturating_sub(LAST)..];
    let setting = controller.map(|controller| setting_words(controller.setting()));
    Ok(format!(
        "{} here, at {:.1} ms (19 of 20 within {:.1} ms; {})",
        setting.unwrap_or_default(),
        quantile(last, 0.5),
        quantile(last, 0.95),
        gpu.description()
    ))
}
