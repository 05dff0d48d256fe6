//! What the window tells: for a while, or for as long as it is so.

use crate::app::input::live_capture::CaptureEvent;
use crate::capture::live::{Opened, is_live};

/// How long a passing notice stays, seconds.
const STAYS_SECS: f64 = 6.0;
/// Passing notices that are shown at once; the oldest make room.
const MOST_PASSING: usize = 4;

/// The seriousness of a notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weight {
    /// Something was done.
    Done,
    /// Something is not as it should be.
    Trouble,
}

/// The state of the camera.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraState {
    /// It is being opened.
    Opening,
    /// Its name and format.
    Open(String),
    /// It cannot be opened, and why; a camera is looked for until it is there.
    Failed(String),
    /// It was open and is gone, and why; it is looked for.
    Lost(String),
    /// The recording has come to its end.
    Ended,
}

/// Messages for the person at the window.
#[derive(Debug)]
pub struct Notices {
    /// How the camera does.
    pub camera: CameraState,
    /// Why the scene's file is not what is shown.
    pub scene: Option<String>,
    /// Why frames are not tracked.
    pub tracking: Option<String>,
    /// Which anchors were never found, and what is seen instead.
    pub never_found: Option<String>,
    passing: Vec<(f64, Weight, String)>,
}

impl Notices {
    /// Nothing but a camera that is being opened.
    pub fn new() -> Self {
        Self {
            camera: CameraState::Opening,
            scene: None,
            tracking: None,
            never_found: None,
            passing: Vec::new(),
        }
    }

    /// Tells something for a while, from `now_secs` on.
    pub fn tell(&mut self, now_secs: f64, weight: Weight, text: impl Into<String>) {
        if self.passing.len() == MOST_PASSING {
            self.passing.remove(0);
        }
        self.passing.push((now_secs, weight, text.into()));
    }

    /// Takes what happened to the camera.
    pub fn take(&mut self, now_secs: f64, event: &CaptureEvent) {
        self.camera = match event {
            CaptureEvent::Opened(opened) => CameraState::Open(in_words(opened)),
            CaptureEvent::Back(opened) => {
                self.tell(now_secs, Weight::Done, format!("{} is back", opened.name));
                CameraState::Open(in_words(opened))
            }
            CaptureEvent::Failed(error) => CameraState::Failed(error.to_string()),
            CaptureEvent::Lost(error) => CameraState::Lost(error.to_string()),
            CaptureEvent::Ended => CameraState::Ended,
        };
    }

    /// What is to be shown now, what lasts first.
    pub fn shown(&self, now_secs: f64) -> Vec<(Weight, String)> {
        let camera = match &self.camera {
            CameraState::Opening | CameraState::Open(_) => None,
            CameraState::Failed(reason) => Some(reason.clone()),
            CameraState::Lost(reason) => Some(format!(
                "{reason}. The last picture stays; the camera is taken up again when it is back."
            )),
            CameraState::Ended => Some("The recording has come to its end.".to_owned()),
        };
        let lasting = [
            camera,
            self.scene.clone(),
            self.tracking
                .as_ref()
                .map(|reason| format!("Not tracked: {reason}")),
            self.never_found.clone(),
        ];
        let passing = self.passing.iter();
        let passing = passing.filter(|(told_secs, ..)| now_secs - told_secs < STAYS_SECS);
        lasting
            .into_iter()
            .flatten()
            .map(|text| (Weight::Trouble, text))
            .chain(passing.map(|(_, weight, text)| (*weight, text.clone())))
            .collect()
    }
}

/// A source and its format; of a recording's path the last part.
fn in_words(opened: &Opened) -> String {
    let name = match is_live(&opened.name) {
        true => &opened.name,
        false => opened.name.rsplit('/').next().unwrap_or(&opened.name),
    };
    format!("{name}: {}", opened.format)
}

impl Default for Notices {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_passes_goes_and_what_lasts_stays() {
        let mut notices = Notices::new();
        assert_eq!(notices.shown(0.0), []);
        for number in 0..6 {
            notices.tell(f64::from(number), Weight::Done, format!("saved {number}"));
        }
        notices.scene = Some("line 3".to_owned());
        let texts = |now_secs| -> Vec<String> {
            notices
                .shown(now_secs)
                .into_iter()
                .map(|(_, text)| text)
                .collect()
        };
        assert_eq!(
            texts(5.5),
            ["line 3", "saved 2", "saved 3", "saved 4", "saved 5"]
        );
        assert_eq!(texts(10.9), ["line 3", "saved 5"]);
        assert_eq!(texts(1e3), ["line 3"]);
    }
}
