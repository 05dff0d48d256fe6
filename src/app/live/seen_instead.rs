//! What pictures show in place of an anchor that has not been found yet: looked for beside tracking, which never waits for it
//! but where other anchors are wanted.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use super::frame_tracker::{TrackedPicture, TrackingPlan};
use crate::app::input::mailbox::Mailbox;
use crate::app::input::sightings::Sightings;
use crate::capture::Frame;
use crate::scene::Anchor;

/// Anchors that are found sooner are not missed, seconds.
const GRACE_SECS: f64 = 2.0;

/// A thread that looks for all kinds of markers as long as an anchor is missed.
pub struct SeenInstead {
    anchors: Arc<[Anchor]>,
    /// Of each, whether any picture showed it.
    found: Vec<bool>,
    since_secs: Option<f64>,
    to_look_at: Arc<Mailbox<LookedAt>>,
    told: Arc<Mutex<Option<String>>>,
    thread: Option<JoinHandle<()>>,
}

/// A frame, and which anchors were found until then.
struct LookedAt {
    frame: Arc<Frame>,
    found: Vec<bool>,
}

impl SeenInstead {
    /// A watch for a plan's anchors; `None` where any marker is looked for.
    pub fn of(plan: &TrackingPlan) -> Option<Self> {
        let TrackingPlan::Follow { anchors, .. } = plan else {
            return None;
        };
        let to_look_at = Arc::new(Mailbox::new());
        let told = Arc::new(Mutex::new(None));
        let thread = {
            let (to_look_at, told) = (Arc::clone(&to_look_at), Arc::clone(&told));
            let sightings = Sightings::of_anchors(anchors);
            thread::spawn(move || watch(sightings, &to_look_at, &told))
        };
        Some(Self {
            anchors: Arc::clone(anchors),
            found: vec![false; anchors.len()],
            since_secs: None,
            to_look_at,
            told,
            thread: Some(thread),
        })
    }

    /// Whether it watches for what a plan wants.
    pub fn is_for(&self, plan: &TrackingPlan) -> bool {
        matches!(plan, TrackingPlan::Follow { anchors, .. } if anchors[..] == self.anchors[..])
    }

    /// Takes a frame that was tracked: what is missed by now and what is seen instead, in words.
    pub fn note(&mut self, picture: &TrackedPicture) -> Option<String> {
        for (found, pose) in self.found.iter_mut().zip(&picture.poses) {
            *found |= pose.camera_from_anchor.is_some();
        }
        if self.found.iter().all(|found| *found) {
            return None;
        }
        let since_secs = *self.since_secs.get_or_insert(picture.arrived_secs);
        if picture.trouble.is_some() || picture.arrived_secs - since_secs < GRACE_SECS {
            return None;
        }
        self.to_look_at.put(LookedAt {
            frame: Arc::clone(&picture.frame),
            found: self.found.clone(),
        });
        let told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        told.clone()
    }
}

impl Drop for SeenInstead {
    fn drop(&mut self) {
        self.to_look_at.close();
        if let Some(thread) = self.thread.take() {
            // A panic in it has been told on stderr.
            _ = thread.join();
        }
    }
}

fn watch(mut sightings: Sightings, to_look_at: &Mailbox<LookedAt>, told: &Mutex<Option<String>>) {
    while let Some(LookedAt { frame, found }) = to_look_at.take() {
        // (Of a library that fails here tracking tells.)
        if sightings.watch(&frame, found).is_err() {
            return;
        }
        *told.lock().unwrap_or_else(PoisonError::into_inner) = sightings.never_found();
    }
}
