//! Key frames of a recording with their true poses and what the camera would have seen.

use std::sync::Arc;

use anyhow::Result;
use glam::DAffine3;

use super::lab::{Lab, Recording};
use crate::app::stages::source::{self, CalibrationNamed};
use crate::app::truth::{Drawn, Errors, Truth, compare, draw, key_frames};
use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::render::{Gpu, Renderer};
use crate::scene::Scene;

/// A frame and its true poses, by anchor.
type PosedFrame = (Frame, Vec<Option<DAffine3>>);

/// Key frames of one recording.
pub struct Shots {
    /// In their order.
    pub shots: Vec<Shot>,
    /// Of the camera.
    pub intrinsics: Intrinsics,
}

/// A key frame.
pub struct Shot {
    /// As recorded.
    pub frame: Frame,
    /// True poses, by anchor.
    pub camera_from_anchor: Vec<Option<DAffine3>>,
    /// What the camera would have seen.
    pub truth: Truth,
}

impl Shots {
    /// Reads all of them, or the middle one where a look is enough.
    ///
    /// # Errors
    /// A recording or a truth that is not there.
    pub fn of(lab: &Lab<'_>, recording: &Recording, scene: &Scene) -> Result<Self> {
        if lab.quick {
            return Self::middle_of(recording, scene);
        }
        let frames = key_frames(&recording.folder, &scene.anchors)?;
        Self::read(recording, scene, frames)
    }

    /// Reads the middle one alone.
    ///
    /// # Errors
    /// As [`Shots::of`].
    pub fn middle_of(recording: &Recording, scene: &Scene) -> Result<Self> {
        let frames = key_frames(&recording.folder, &scene.anchors)?;
        let middle = frames.len() / 2;
        let frames = frames.into_iter().skip(middle).take(1).collect();
        Self::read(recording, scene, frames)
    }

    fn read(recording: &Recording, scene: &Scene, frames: Vec<PosedFrame>) -> Result<Self> {
        let (_, intrinsics) = source::open_calibrated(&scene.camera, CalibrationNamed::ByKey)?;
        let shots = frames.into_iter().map(|(frame, camera_from_anchor)| {
            Ok(Shot {
                truth: Truth::open(&recording.folder, frame.index)?,
                frame,
                camera_from_anchor,
            })
        });
        Ok(Self {
            shots: shots.collect::<Result<_>>()?,
            intrinsics,
        })
    }

    /// Width and height of the pictures.
    pub fn size_px(&self) -> [u32; 2] {
        self.intrinsics.size_px
    }

    /// Draws all at their true poses.
    ///
    /// # Errors
    /// A device that failed.
    pub fn draw(&self, gpu: &Arc<Gpu>, scene: &Scene) -> Result<Vec<Drawn>> {
        self.draw_with(&mut crate::app::precomputed::renderer(
            Arc::clone(gpu),
            scene,
            self.intrinsics,
        )?)
    }

    /// Draws all at their true poses with a renderer that is there already.
    ///
    /// # Errors
    /// A device that failed.
    pub fn draw_with(&self, renderer: &mut Renderer) -> Result<Vec<Drawn>> {
        let shots = self.shots.iter();
        shots
            .map(|shot| draw(renderer, &shot.frame, &shot.camera_from_anchor))
            .collect()
    }

    /// The errors of what was drawn.
    ///
    /// # Errors
    /// A truth that changes nothing.
    pub fn errors(&self, drawn: &[Drawn]) -> Result<Vec<Errors>> {
        self.shots
            .iter()
            .zip(drawn)
            .map(|(shot, drawn)| compare(shot.frame.index, &shot.truth, drawn))
            .collect()
    }
}

/// The mean of one of the errors over the frames.
pub fn mean(errors: &[Errors], of: fn(&Errors) -> f64) -> f64 {
    errors.iter().map(of).sum::<f64>() / errors.len().max(1) as f64
}

/// The mean of the pixels with a wrong shadow, percent; `None` where no light has a shadow of its own.
pub fn mean_wrong_pct(errors: &[Errors]) -> Option<f64> {
    let shadows: Option<Vec<f64>> = errors
        .iter()
        .map(|error| Some(error.shadow?.wrong_pct))
        .collect();
    let shadows = shadows.filter(|shadows| !shadows.is_empty())?;
    Some(shadows.iter().sum::<f64>() / shadows.len() as f64)
}

/// A frame without any picture.
pub fn grey_frame(size_px: [u32; 2]) -> Frame {
    Frame {
        index: 0,
        time_secs: 0.0,
        size_px,
        rgba: vec![128; 4 * (size_px[0] * size_px[1]) as usize],
    }
}
