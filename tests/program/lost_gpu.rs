//! A device that is lost while it draws: an error that says so, no panic, no wait without end.

use std::sync::Arc;

use gnomon::capture::{FrameSource, load_calibration};
use gnomon::render::{Gpu, Renderer, Shown};
use gnomon::scene::Scene;

use crate::common::project_file;

#[test]
fn a_device_that_is_lost_ends_in_a_message() {
    let scene = Scene::load(&project_file("config/lamp.toml")).unwrap();
    let session = project_file("recordings/lamp");
    let intrinsics = load_calibration(&session.join("camera.toml")).unwrap();
    let mut source = FrameSource::open(session.to_str().unwrap()).unwrap();
    let frame = source.next_frame().unwrap().unwrap();
    let gpu = Arc::new(Gpu::open(None).unwrap());
    let mut renderer = Renderer::new(Arc::clone(&gpu), &scene, intrinsics).unwrap();
    let nowhere = vec![None; scene.node_count()];
    renderer.upload(&frame).unwrap();
    renderer.draw(&nowhere, Shown::Composite);
    renderer.read_picture().unwrap();
    gpu.shared().device.destroy();
    let outcome = renderer.upload(&frame).and_then(|()| {
        renderer.draw(&nowhere, Shown::Composite);
        renderer.read_picture()
    });
    let said = outcome.unwrap_err().to_string();
    assert!(said.contains("GPU"), "{said}");
}
