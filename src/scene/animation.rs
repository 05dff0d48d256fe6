//! What plays of a model's file: `animation`, `animation_speed` and `animation_loop`, with the frames' time.

use std::borrow::Cow;
use std::sync::Arc;

use super::error::SceneError;
use super::ranges::{Numbers, Whole};
use super::raw_model::ClipInfo;
use super::reader::{Table, Value};
use super::schema::key::Missing::{Is, Means};
use super::schema::values::{InWords, Written};
use super::{Object, Scene};
use crate::geometry::rig::posed::MeshPoser;

/// How fast it may play: beyond that no camera's frames show it.
const SPEED: Numbers = Numbers::between(-1e3, 1e3);
/// Numbers of a file's animations.
const NUMBER: Whole = Whole::between(0, 9_999);

keys! {
    /// What plays of a model.
    pub static ANIMATION: AnimationKeys;

    /// The animation of its glTF file that plays: its name there, or its number, counted from 0. Nodes, skins and morph targets
    /// move. Time is the frame's.
    animation: Written, InWords::new("a name in quotes, or a number") => Means(Written, "none: the file's rest pose");
    /// How fast it plays, as a factor; below 0 backwards from its end.
    animation_speed: f64, SPEED => Is(1.0);
    /// It begins again when it has ended; false: its last pose stays.
    animation_loop: bool => Is(true);
}

/// An animation that plays.
#[derive(Debug, Clone)]
pub struct Animation {
    /// Its number in the file.
    pub number: usize,
    /// As a factor.
    pub speed: f64,
    /// Whether it begins again.
    pub loops: bool,
    /// What it does to the mesh.
    pub poser: Arc<MeshPoser>,
}

impl Animation {
    /// The time of the clip at a time since the recording's first frame, both in seconds.
    pub fn clip_time_s(&self, time_s: f64) -> f64 {
        let duration_s = self.poser.clip().duration_s;
        if duration_s <= 0.0 {
            return 0.0;
        }
        let played_s = time_s * self.speed;
        match (self.loops, self.speed < 0.0) {
            (true, _) => played_s.rem_euclid(duration_s),
            (false, false) => played_s.clamp(0.0, duration_s),
            (false, true) => (duration_s + played_s).clamp(0.0, duration_s),
        }
    }
}

impl Object {
    /// Takes the shape that it has at a time since the recording's first frame, seconds. Tells whether that is another one.
    pub fn take_shape(&mut self, time_s: f64) -> bool {
        let Some(animation) = &self.animation else {
            return false;
        };
        let time_s = animation.clip_time_s(time_s);
        animation.poser.pose(Arc::make_mut(&mut self.mesh), time_s)
    }
}

impl Scene {
    /// The scene with all its things in the shapes that they have at a frame's time, seconds.
    pub fn shaped_at(&self, time_s: f64) -> Cow<'_, Self> {
        let things = || self.phantoms.iter().chain(&self.virtuals);
        if !things().any(|thing| thing.animation.is_some()) {
            return Cow::Borrowed(self);
        }
        let mut shaped = self.clone();
        let things = shaped.phantoms.iter_mut().chain(&mut shaped.virtuals);
        for thing in things {
            thing.take_shape(time_s);
        }
        Cow::Owned(shaped)
    }
}

/// What a scene asks of a model's animations.
pub struct WantedAnimation<'a> {
    which: Value<'a>,
    speed: f64,
    loops: bool,
}

impl<'a> WantedAnimation<'a> {
    /// Reads it; `None` where nothing is to play.
    ///
    /// # Errors
    /// Values that are none; how something plays where nothing does.
    pub fn read(table: &Table<'a>) -> Result<Option<Self>, SceneError> {
        let speed = ANIMATION.animation_speed.read(table)?;
        let loops = ANIMATION.animation_loop.read(table)?;
        let Some(which) = ANIMATION.animation.value(table) else {
            let how = ANIMATION.animation_speed.value(table);
            let how = how.or_else(|| ANIMATION.animation_loop.value(table));
            return match how {
                Some(how) => Err(how.error("nothing plays; allowed: along with animation")),
                None => Ok(None),
            };
        };
        Ok(Some(Self {
            which,
            speed,
            loops,
        }))
    }

    /// An error at the place where the scene asks for it.
    pub fn error(&self, message: &str) -> SceneError {
        self.which.error(message)
    }

    /// The number of the animation that is asked for.
    ///
    /// # Errors
    /// There is none of that name or number; the message lists those that there are.
    pub fn choose(&self, clips: &[ClipInfo]) -> Result<usize, SceneError> {
        if clips.is_empty() {
            let message = "its file has no animation; allowed: a glTF file that has some";
            return Err(self.which.error(message));
        }
        let found = match self.which.text() {
            Ok(name) => clips.iter().position(|clip| clip.name == name),
            Err(_) => {
                let number = self.which.integer(&NUMBER)? as usize;
                (number < clips.len()).then_some(number)
            }
        };
        found.ok_or_else(|| {
            let known = clips
                .iter()
                .enumerate()
                .map(|(number, clip)| match &clip.name[..] {
                    "" => number.to_string(),
                    name => format!("{number} \"{name}\""),
                });
            let known = known.collect::<Vec<_>>().join(", ");
            let message = format!("no such animation; allowed: those of its file: {known}");
            self.which.error(message)
        })
    }

    /// All of it in words, wherever it is written.
    pub fn in_words(&self) -> String {
        let which = match self.which.text() {
            Ok(name) => format!("{name:?}"),
            Err(_) => self
                .which
                .integer(&NUMBER)
                .map_or_else(|_| String::new(), |it| it.to_string()),
        };
        format!(
            "{which}, {} times as fast, again and again: {}",
            self.speed, self.loops
        )
    }

    /// It as it plays.
    pub fn playing(&self, number: usize, poser: MeshPoser) -> Animation {
        Animation {
            number,
            speed: self.speed,
            loops: self.loops,
            poser: Arc::new(poser),
        }
    }
}
