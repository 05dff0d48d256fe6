//! What the first frames of a scene's recording tell before it is played.

use std::sync::atomic::AtomicBool;

use anyhow::{Result, bail};
use glam::{DAffine3, DVec2, DVec3};

use crate::app::input::live_input::LiveInput;
use crate::app::input::mirror_watch::MirrorWatch;
use crate::app::input::sightings::Sightings;
use crate::app::stages::known_camera::KnownCamera;
use crate::app::stages::source::{self, CalibrationNamed};
use crate::capture::live::is_live;
use crate::capture::{Frame, FrameSource, notices_told};
use crate::geometry::camera::Intrinsics;
use crate::scene::{Object, Scene};
use crate::tracking::Tracker;

/// Frames that are read where all anchors were found, a few seconds of a recording…
const READ_FRAMES: u32 = 120;
/// …of which one in so many is looked at, after the first ones.
const STRIDE: u32 = 10;
/// The first ones, each of which is looked at.
const FIRST_FRAMES: u32 = 16;

/// What a recording tells of its scene before it is played.
#[derive(Debug, Default)]
pub struct FirstLook {
    /// Mirrored pictures, things that are out of view, a camera that is not calibrated.
    pub warnings: Vec<String>,
    /// The anchors that are in none of its frames, which playing it ends with, in words.
    pub never_found: Option<String>,
}

/// A look at the first frames of a scene's recording, and at all of them where an anchor does not come. A live camera is not
/// asked, but its calibration is read.
///
/// # Errors
/// What keeps the scene from being replayed: a recording that cannot be opened, is damaged where it was read, or has a
/// calibration of another size.
pub fn first_look(scene: &Scene) -> Result<FirstLook> {
    if is_live(&scene.camera.source) {
        let warnings = match &scene.camera.calibration {
            Some(_) => LiveInput::of(&scene.camera).map(|_| Vec::new())?,
            None => vec![format!(
                "{} has no calibration: its focal length is guessed, and learnt from the markers while pictures come \
                 ({} is better)",
                scene.camera.source,
                CalibrationNamed::ByKey.place()
            )],
        };
        return Ok(FirstLook {
            warnings,
            never_found: None,
        });
    }
    let (mut source, camera) = source::open(scene, &AtomicBool::new(false))?;
    let mut look = Look::new(scene, &camera)?;
    let ended = look.watch(&mut source)?;
    if !source.notices().is_empty() {
        bail!(
            "the recording is damaged: {}",
            notices_told(source.notices())
        );
    }
    let of_camera = camera.remark(&scene.camera.source, CalibrationNamed::ByKey.place());
    let of_frames = look.warnings(ended, source.good_frames());
    Ok(FirstLook {
        warnings: of_camera.into_iter().chain(of_frames).collect(),
        never_found: look.sightings.never_found().filter(|_| ended),
    })
}

/// What was seen so far.
struct Look<'a> {
    scene: &'a Scene,
    intrinsics: Intrinsics,
    tracker: Tracker,
    mirror: MirrorWatch,
    /// What is seen in place of anchors.
    sightings: Sightings,
    /// For each anchor, whether it was found.
    found: Vec<bool>,
    /// For each virtual thing, whether some of it may have been in the picture.
    in_view: Vec<bool>,
}

impl<'a> Look<'a> {
    fn new(scene: &'a Scene, camera: &KnownCamera) -> Result<Self> {
        let intrinsics = camera.intrinsics();
        Ok(Self {
            scene,
            intrinsics,
            tracker: Tracker::new(&scene.tracking, &scene.anchors, intrinsics)?,
            mirror: MirrorWatch::new(&scene.tracking, scene.families()),
            sightings: Sightings::of_anchors(&scene.anchors),
            found: vec![false; scene.anchors.len()],
            in_view: (scene.virtuals.iter())
                .map(|thing| !thing.visible || thing.mesh.positions.is_empty())
                .collect(),
        })
    }

    /// Reads frames until all was seen, or enough where only things are out of view; whether the recording came to its end.
    fn watch(&mut self, source: &mut FrameSource) -> Result<bool> {
        for number in 0.. {
            let are_found = self.found.iter().all(|&found| found);
            let is_enough = number >= READ_FRAMES || self.in_view.iter().all(|&seen| seen);
            if are_found && is_enough {
                return Ok(false);
            }
            let Some(frame) = source.next_frame()? else {
                return Ok(true);
            };
            // Where an anchor is missing all frames count, as they do when it is played.
            if !are_found || number < FIRST_FRAMES || number % STRIDE == 0 {
                self.add(&frame)?;
            }
        }
        Ok(false)
    }

    fn add(&mut self, frame: &Frame) -> Result<()> {
        let poses: Vec<Option<DAffine3>> = (self.tracker.track(frame)?.into_iter())
            .map(|pose| pose.camera_from_anchor)
            .collect();
        for (found, pose) in self.found.iter_mut().zip(&poses) {
            *found |= pose.is_some();
        }
        let shows_marker =
            poses.iter().any(Option::is_some) || !self.tracker.detections().is_empty();
        self.mirror.watch(frame, shows_marker)?;
        self.sightings
            .watch(frame, poses.iter().map(Option::is_some))?;
        let nodes = self.scene.camera_from_nodes(&poses, frame.time_secs);
        let scene = self.scene.shaped_at(frame.time_secs);
        for (in_view, thing) in self.in_view.iter_mut().zip(&scene.virtuals) {
            let camera_from_node = nodes.get(thing.anchor).copied().flatten();
            *in_view |= camera_from_node.is_some_and(|node| {
                may_show(thing, node * thing.anchor_from_object, &self.intrinsics)
            });
        }
        Ok(())
    }

    fn warnings(&self, ended: bool, read_frames: u32) -> Vec<String> {
        if let Some(hint) = self.mirror.hint(self.scene.camera.mirror) {
            return vec![hint];
        }
        let frames = match ended {
            true => "any frame".to_owned(),
            false => format!("the first {read_frames} frames"),
        };
        let things = self.scene.virtuals.iter().zip(&self.in_view);
        // What stands on an anchor that is never found is told of with it.
        let out_of_view = things
            .filter(|(thing, seen)| !**seen && self.found.get(thing.anchor) != Some(&false))
            .map(|(thing, _)| {
                format!(
                    "\"{}\" is out of view in {frames}: is its place right?",
                    thing.name
                )
            });
        out_of_view.collect()
    }
}

/// Whether some of a thing may be in the picture: its box is not all behind the camera, nor all beyond one of the picture's
/// sides.
fn may_show(thing: &Object, camera_from_object: DAffine3, intrinsics: &Intrinsics) -> bool {
    let positions = || {
        thing
            .mesh
            .positions
            .iter()
            .map(|position| position.as_dvec3())
    };
    let least = positions().fold(DVec3::INFINITY, DVec3::min);
    let most = positions().fold(DVec3::NEG_INFINITY, DVec3::max);
    let corners: Vec<DVec3> = (0..8)
        .map(|corner| {
            let choose = |axis: usize| match corner >> axis & 1 {
                0 => least[axis],
                _ => most[axis],
            };
            camera_from_object.transform_point3(DVec3::from_array([0, 1, 2].map(choose)))
        })
        .collect();
    let size_px = DVec2::from_array(intrinsics.size_px.map(f64::from));
    let first = intrinsics.plane_from_pixel(DVec2::splat(-0.5));
    let last = intrinsics.plane_from_pixel(size_px - 0.5);
    let beyond = |outside: &dyn Fn(&DVec3) -> bool| corners.iter().all(outside);
    !(beyond(&|corner| corner.z <= 0.0)
        || beyond(&|corner| corner.x < first.x * corner.z)
        || beyond(&|corner| corner.x > last.x * corner.z)
        || beyond(&|corner| corner.y < first.y * corner.z)
        || beyond(&|corner| corner.y > last.y * corner.z))
}
