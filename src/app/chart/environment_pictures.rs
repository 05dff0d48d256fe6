//! What an environment cannot show, beside the technique that can and the truth.

use std::path::Path;

use anyhow::Result;

use super::AnyChart;
use super::lab::Lab;
use super::sheet::{ENLARGED, Sheet, SheetPart, changed_part};
use super::shots::Shots;
use crate::app::files::picture_files::write_rgb_png;
use crate::app::stages::progress::Progress;
use crate::app::truth::LinearPicture;
use crate::scene::{EnvironmentMethod, Scene, Technique};

const NAME: &str = "environment-pictures";

/// How a scene is drawn.
type Way = (&'static str, fn(&mut Scene));

/// A recording, and its scene drawn in a way that fails and in one that does not.
struct Failure {
    recording: &'static str,
    fails: Way,
    holds: Way,
}

const FAILURES: [Failure; 3] = [
    Failure {
        recording: "room",
        fails: ("light that is near: environment", |scene| {
            scene.shadows.technique = Technique::Environment;
        }),
        holds: ("shafts", |scene| {
            scene.shadows.technique = Technique::Shafts;
        }),
    },
    Failure {
        recording: "sky",
        fails: ("large touches small: maps", |scene| {
            scene.shadows.environment.method = EnvironmentMethod::Maps;
        }),
        holds: ("rays", |scene| {
            scene.shadows.environment.method = EnvironmentMethod::Rays;
        }),
    },
    Failure {
        recording: "sky",
        fails: ("a sun that is broad: rays alone", |scene| {
            scene.shadows.compact_penumbra_px = 0.0;
        }),
        holds: ("its sun by volumes", |_| {}),
    },
];

/// The pictures.
pub struct EnvironmentPictures;

impl AnyChart for EnvironmentPictures {
    fn name(&self) -> &'static str {
        NAME
    }

    fn family(&self) -> &'static str {
        "environment"
    }

    fn shows(&self) -> &'static str {
        "What an environment cannot show, beside the technique that can and the path-traced truth: the middle key frame of recordings, \
         the part that the virtual things change, enlarged twice."
    }

    fn unit_count(&self, _lab: &Lab<'_>) -> Result<usize> {
        Ok(FAILURES.len())
    }

    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool> {
        let mut rows = Vec::new();
        for failure in &FAILURES {
            progress.tell(&format!("{NAME}: {}", failure.fails.0));
            let recording = lab.recording(failure.recording)?;
            let scene = recording.load_scene()?;
            let shots = Shots::middle_of(&recording, &scene)?;
            let width = shots.size_px()[0] as usize;
            let mut cells = Vec::new();
            for (name, change) in [failure.fails, failure.holds] {
                if lab.is_stopped() {
                    return Ok(false);
                }
                let mut scene = scene.clone();
                change(&mut scene);
                let drawn = shots.draw(&lab.gpu()?, &scene)?;
                for (shot, drawn) in shots.shots.iter().zip(&drawn) {
                    let change = shot.truth.with.minus(&shot.truth.without);
                    let picture = LinearPicture::from_rgba(width, &drawn.out);
                    let cell = |part: SheetPart| part.cut(name.to_owned(), &picture, |it| it);
                    cells.extend(changed_part(&change).map(cell));
                }
            }
            for shot in &shots.shots {
                let change = shot.truth.with.minus(&shot.truth.without);
                let truth = changed_part(&change);
                cells.extend(
                    truth.map(|part| part.cut("truth".to_owned(), &shot.truth.with, |it| it)),
                );
            }
            rows.push(cells);
            progress.advance();
        }
        let (size_px, rgba) = Sheet {
            title: "What an environment cannot show",
            reading: "Left the failure, in the middle what answers it, right the path-traced truth.",
            enlarged: ENLARGED,
            rows,
        }
        .paint()?;
        write_rgb_png(&out.join(format!("{NAME}.png")), size_px, &rgba)?;
        Ok(true)
    }
}
