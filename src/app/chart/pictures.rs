//! Pictures of the qualities beside the truth, with their errors.

use std::path::Path;

use anyhow::Result;

use super::AnyChart;
use super::lab::Lab;
use super::sheet::{Cell, Sheet, changed_part};
use super::shots::{Shot, Shots, mean};
use crate::app::files::picture_files::write_rgb_png;
use crate::app::stages::progress::Progress;
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::app::truth::{Drawn, LinearPicture};
use crate::render::{Renderer, Shown, VIRTUAL};
use crate::scene::{EnvironmentMethod, Quality, Scene, ShadowSettings, ShadowTechnique};

const NAME: &str = "shadow-pictures";
/// The error is shown so much stronger, about a middle grey.
const STRONGER: f64 = 4.0;

/// The pictures.
pub struct PicturesChart;

impl AnyChart for PicturesChart {
    fn name(&self) -> &'static str {
        NAME
    }

    fn family(&self) -> &'static str {
        "shadows"
    }

    fn shows(&self) -> &'static str {
        "The qualities, numbers of sources, or an environment's methods beside the truth, in the middle key frame of each recording (the part that the virtual \
         things change, enlarged twice), with the time of a frame and the rms error of the shadow's factor. Below each its error, four times stronger about a middle grey: of virtual surfaces as they are, of real ones by \
         what changes on them."
    }

    fn unit_count(&self, lab: &Lab<'_>) -> Result<usize> {
        Ok(lab.recording_names()?.len())
    }

    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool> {
        let mut rows = Vec::new();
        for recording in lab.recordings()? {
            progress.tell(&format!("{NAME}: {}", recording.name));
            if lab.is_stopped() {
                return Ok(false);
            }
            let scene = recording.load_scene()?;
            let shots = Shots::middle_of(&recording, &scene)?;
            let mut drawn = Vec::new();
            for (name, shadows) in ways(&scene, lab.quick) {
                let mut scene = scene.clone();
                scene.shadows = shadows;
                let mut renderer =
                    crate::app::precomputed::renderer(lab.gpu()?, &scene, shots.intrinsics)?;
                let pictures = shots.draw_with(&mut renderer)?;
                let took_ms = frame_ms(lab, &shots, &mut renderer)?;
                let factor = mean(&shots.errors(&pictures)?, |errors| errors.factor);
                let label = format!("{name}: {took_ms:.0} ms, ±{factor:.3}");
                drawn.extend(pictures.into_iter().map(|picture| (label.clone(), picture)));
            }
            if let Some(shot) = shots.shots.first() {
                let width = shots.size_px()[0] as usize;
                rows.extend(
                    two_rows(&recording.name, shot, &drawn, width)
                        .into_iter()
                        .flatten(),
                );
            }
            progress.advance();
        }
        let (size_px, rgba) = Sheet {
            title: "Shadows beside the truth",
            reading: "Above each picture the time of a frame and the rms error of its shadows; below it its error, four times stronger.",
            rows,
        }
        .paint()?;
        write_rgb_png(&out.join(format!("{NAME}.png")), size_px, &rgba)?;
        Ok(true)
    }
}

/// What the technique of a scene has to offer: the qualities, or so many sources (Gibson et al. 2003, fig. 9).
fn ways(scene: &Scene, quick: bool) -> Vec<(String, ShadowSettings)> {
    let technique = scene.shadows.technique;
    if scene.chosen_technique().0 == ShadowTechnique::Environment {
        return environment_ways(scene);
    }
    if !scene.chosen_technique().0.has_shafts() {
        let qualities = Quality::BY_NAME.into_iter();
        return qualities
            .map(|(name, quality)| {
                let shadows = ShadowSettings {
                    technique,
                    ..quality.shadows()
                };
                (name.to_owned(), shadows)
            })
            .collect();
    }
    // For a look the cheaper ones do.
    let sources = [Some(10), Some(20), Some(50), None].into_iter();
    sources
        .take(if quick { 2 } else { usize::MAX })
        .map(|sources| {
            let name = sources.map_or("all".to_owned(), |count: u32| count.to_string());
            let mut shadows = scene.shadows;
            shadows.shafts.sources = sources;
            (format!("{name} sources"), shadows)
        })
        .collect()
}

/// The third paper's own way with fewer and more regions (Tamura et al. 2005, fig. 6), and ours.
fn environment_ways(scene: &Scene) -> Vec<(String, ShadowSettings)> {
    let ways = [
        (EnvironmentMethod::Maps, 32, "maps, 32 regions"),
        (EnvironmentMethod::Maps, 64, "maps, 64 regions"),
        (EnvironmentMethod::Rays, 64, "rays"),
    ];
    ways.into_iter()
        .map(|(method, regions, name)| {
            let mut shadows = scene.shadows;
            shadows.environment.method = method;
            shadows.environment.regions = regions;
            (name.to_owned(), shadows)
        })
        .collect()
}

/// What the first of the frames takes to draw again, milliseconds: the middle of some.
fn frame_ms(lab: &Lab<'_>, shots: &Shots, renderer: &mut Renderer) -> Result<f64> {
    let Some(shot) = shots.shots.first() else {
        return Ok(0.0);
    };
    renderer.upload(&shot.frame)?;
    let mut frames_ms = Vec::new();
    for _ in 0..lab.rounds() {
        let (waited, ms) = Stopwatch::time(|| {
            renderer.draw(&shot.camera_from_anchor, Shown::Composite);
            renderer.wait()
        });
        waited?;
        frames_ms.push(ms);
    }
    Ok(quantile(&frames_ms, 0.5))
}

/// The pictures of a frame, and their errors.
fn two_rows(
    recording: &str,
    shot: &Shot,
    drawn: &[(String, Drawn)],
    width: usize,
) -> Option<[Vec<Cell>; 2]> {
    let change = shot.truth.with.minus(&shot.truth.without);
    let part = changed_part(&change)?;
    let (_, first) = drawn.first()?;
    let bare = LinearPicture::from_rgba(width, &first.bare);
    let mut pictures = vec![part.cut(format!("{recording}: bare video"), &bare, |level| level)];
    let mut errors = vec![part.cut(String::new(), &change, |level| 128.0 - STRONGER * level)];
    for (name, drawn) in drawn {
        let out = LinearPicture::from_rgba(width, &drawn.out);
        let error = error(&out, &bare, shot);
        pictures.push(part.cut(name.clone(), &out, |level| level));
        errors.push(part.cut(String::new(), &error, |level| 128.0 + STRONGER * level));
    }
    pictures.push(part.cut("truth, path-traced".to_owned(), &shot.truth.with, |l| l));
    Some([pictures, errors])
}

/// On virtual surfaces of the picture itself, on real ones of what the virtual things change: the video's noise is none.
fn error(out: &LinearPicture, bare: &LinearPicture, shot: &Shot) -> LinearPicture {
    let change = shot.truth.with.minus(&shot.truth.without);
    let mut error = out.minus(bare).minus(&change);
    let whole = out.minus(&shot.truth.with);
    for (index, pixel) in error.pixels.iter_mut().enumerate() {
        if shot.truth.ids[index] == VIRTUAL {
            *pixel = whole.pixels[index];
        }
    }
    error
}
