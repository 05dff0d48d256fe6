//! Pictures of the qualities beside the truth, with their errors.

use std::path::Path;

use anyhow::Result;

use super::AnyChart;
use super::lab::Lab;
use super::shadows::with_sources;
use super::sheet::{Cell, ENLARGED, Sheet, changed_part};
use super::shots::{Shot, Shots, mean};
use crate::app::files::picture_files::write_small_rgb_png;
use crate::app::stages::progress::Progress;
use crate::app::stages::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::app::truth::{Drawn, LinearPicture};
use crate::render::{Renderer, Shown, VIRTUAL};
use crate::scene::{EnvironmentMethod, Quality, Scene, ShadowSettings, ShadowTechnique};

/// The error is shown so much stronger, about a middle grey.
const STRONGER: f64 = 4.0;
/// How many sources get a shadow each; `None`: all (Gibson et al. 2003, figure 9).
const SOURCES: [Option<u32>; 4] = [Some(10), Some(20), Some(50), None];

/// Ways to draw a scene beside each other, by name.
type Ways = Vec<(String, Scene)>;

/// What each technique has to offer.
pub struct ShadowPictures;

/// Soft shadows by ever more sources, in environments of several kinds (Gibson et al. 2003, figures 8 and 9).
pub struct SourcePictures;

impl AnyChart for ShadowPictures {
    fn name(&self) -> &'static str {
        "shadow-pictures"
    }

    fn family(&self) -> &'static str {
        "shadows"
    }

    fn shows(&self) -> &'static str {
        "The qualities, numbers of sources, or an environment's methods beside the truth, in the middle key frame of each \
         recording (the part that the virtual things change, enlarged twice), with the time of a frame and the rms error of \
         the shadow's factor. Below each its error, four times stronger about a middle grey: of virtual surfaces as they \
         are, of real ones by what changes on them."
    }

    fn unit_count(&self, lab: &Lab<'_>) -> Result<usize> {
        Ok(lab.recording_names()?.len())
    }

    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool> {
        let head = ("Shadows beside the truth", ENLARGED);
        make_sheet(self, head, qualities, lab, out, progress)
    }
}

impl AnyChart for SourcePictures {
    fn name(&self) -> &'static str {
        "source-pictures"
    }

    fn family(&self) -> &'static str {
        "shadows"
    }

    fn shows(&self) -> &'static str {
        "Real places without and with virtual things in them, as in figures 8 and 9 of Gibson et al. 2003: a room with soft \
         light, a low sun, a studio with several lamps; shadows of 10, 20, 50 and all sources beside the path-traced truth, \
         with the time of a frame, the rms error of the shadow's factor, and below each its error, four times stronger. What \
         is compact in a probe, such as the sun, is drawn by shadow volumes beside the sources."
    }

    fn unit_count(&self, lab: &Lab<'_>) -> Result<usize> {
        Ok(lab.recording_names()?.len())
    }

    fn make(&self, lab: &Lab<'_>, out: &Path, progress: &Progress) -> Result<bool> {
        let head = (
            "Soft shadows by 10, 20, 50 and all sources beside the truth",
            1,
        );
        make_sheet(self, head, by_sources, lab, out, progress)
    }
}

/// A pair of rows for each recording that is drawn in any way; whether it was made to its end. `enlarged`: each pixel becomes a square
/// of so many.
fn make_sheet(
    chart: &dyn AnyChart,
    (title, enlarged): (&'static str, usize),
    ways: fn(&Scene) -> Ways,
    lab: &Lab<'_>,
    out: &Path,
    progress: &Progress,
) -> Result<bool> {
    let mut rows = Vec::new();
    for recording in lab.recordings()? {
        progress.tell(&format!("{}: {}", chart.name(), recording.name));
        if lab.is_stopped() {
            return Ok(false);
        }
        let scene = recording.load_scene()?;
        // For a look the cheaper ones do.
        let ways = ways(&scene)
            .into_iter()
            .take(if lab.quick { 2 } else { usize::MAX });
        let shots = Shots::middle_of(&recording, &scene)?;
        let mut drawn = Vec::new();
        for (name, scene) in ways {
            if lab.is_stopped() {
                return Ok(false);
            }
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
            let pair = two_rows(&recording.name, shot, &drawn, width);
            rows.extend(pair.into_iter().flatten());
        }
        progress.advance();
    }
    let (size_px, rgba) = Sheet {
        title,
        reading: "Above each picture the time of a frame and the rms error of its shadows; below it its error, four times stronger.",
        enlarged,
        rows,
    }
    .paint()?;
    write_small_rgb_png(&out.join(format!("{}.png", chart.name())), size_px, &rgba)?;
    Ok(true)
}

/// What the technique of a scene has to offer: the qualities, numbers of sources, or an environment's methods.
fn qualities(scene: &Scene) -> Ways {
    let with = |name: &str, shadows: ShadowSettings| {
        let mut scene = scene.clone();
        scene.shadows = shadows;
        (name.to_owned(), scene)
    };
    let technique = scene.chosen_technique().0;
    if technique == ShadowTechnique::Environment {
        return environment_ways(scene);
    }
    if technique.has_shafts() {
        let ways = by_sources(scene).into_iter();
        return ways
            .map(|(name, scene)| (format!("{name} sources"), scene))
            .collect();
    }
    let qualities = Quality::BY_NAME.into_iter();
    let technique = scene.shadows.technique;
    let shadows = |quality: Quality| ShadowSettings {
        technique,
        ..quality.shadows()
    };
    qualities
        .map(|(name, quality)| with(name, shadows(quality)))
        .collect()
}

/// Shafts beside compact light by ever more sources; none without a probe.
fn by_sources(scene: &Scene) -> Ways {
    let with = |sources: Option<u32>| {
        let name = sources.map_or("all".to_owned(), |count| count.to_string());
        Some((name, with_sources(scene, sources)?))
    };
    SOURCES.into_iter().filter_map(with).collect()
}

/// The third paper's own way with fewer and more regions (Tamura et al. 2005, fig. 6), and ours.
fn environment_ways(scene: &Scene) -> Ways {
    let ways = [
        (EnvironmentMethod::Maps, 32, "maps, 32 regions"),
        (EnvironmentMethod::Maps, 64, "maps, 64 regions"),
        (EnvironmentMethod::Rays, 64, "rays"),
    ];
    ways.into_iter()
        .map(|(method, regions, name)| {
            let mut scene = scene.clone();
            scene.shadows.environment.method = method;
            scene.shadows.environment.regions = regions;
            (name.to_owned(), scene)
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
