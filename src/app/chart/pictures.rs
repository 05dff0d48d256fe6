//! Pictures of the qualities beside the truth, with their errors.

use std::path::Path;

use anyhow::Result;
use plotters::prelude::DrawingBackend;

use super::AnyChart;
use super::canvas::{Anchor, Canvas, Drawing, INK, PIXELS_PER_UNIT, bitmap};
use super::lab::Lab;
use super::shots::{Shot, Shots, mean};
use crate::app::picture_files::write_rgb_png;
use crate::app::progress::Progress;
use crate::app::stats::quantile;
use crate::app::stopwatch::Stopwatch;
use crate::app::truth::{Drawn, Picture};
use crate::render::{Renderer, Shown, VIRTUAL};
use crate::scene::{Quality, Scene, ShadowSettings, Technique};

const NAME: &str = "shadow-pictures";
/// Each pixel is drawn as a square of so many.
const ENLARGED: usize = 2;
/// The error is shown so much stronger, about a middle grey.
const STRONGER: f64 = 4.0;
/// Around what the virtual things change, pixels.
const MARGIN_PX: usize = 16;
/// Changes of fewer levels are none.
const CHANGED_LEVELS: f64 = 2.0;

const GAP: f64 = 12.0;
const HEAD: f64 = 66.0;
const LABEL: f64 = 26.0;

/// The pictures.
pub struct Pictures;

/// A part of a picture, rows from the top.
struct Cell {
    label: String,
    size_px: [usize; 2],
    rgb: Vec<[u8; 3]>,
}

/// Rows of cells.
struct Sheet {
    rows: Vec<Vec<Cell>>,
}

impl AnyChart for Pictures {
    fn name(&self) -> &'static str {
        NAME
    }

    fn family(&self) -> &'static str {
        "shadows"
    }

    fn shows(&self) -> &'static str {
        "The qualities, or numbers of sources, beside the truth, in the middle key frame of each recording (the part that the virtual \
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
            let mut shots = Shots::of(&recording, &scene)?;
            let middle = shots.shots.len() / 2;
            shots.shots = shots.shots.drain(middle..).take(1).collect();
            let mut drawn = Vec::new();
            for (name, shadows) in ways(&scene) {
                let mut scene = scene.clone();
                scene.shadows = shadows;
                let took_ms = frame_ms(lab, &shots, &scene)?;
                let pictures = shots.draw(&lab.gpu()?, &scene)?;
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
        let (size_px, rgba) = Sheet { rows }.paint()?;
        write_rgb_png(&out.join(format!("{NAME}.png")), size_px, &rgba)?;
        Ok(true)
    }
}

/// What the technique of a scene has to offer: the qualities, or so many sources (Gibson et al. 2003, fig. 9).
fn ways(scene: &Scene) -> Vec<(String, ShadowSettings)> {
    let technique = scene.shadows.technique;
    if scene.chosen_technique().0 != Technique::Shafts {
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
    let sources = [Some(10), Some(20), Some(50), None].into_iter();
    sources
        .map(|sources| {
            let name = sources.map_or("all".to_owned(), |count: u32| count.to_string());
            let mut shadows = scene.shadows;
            shadows.shafts.sources = sources;
            (format!("{name} sources"), shadows)
        })
        .collect()
}

/// What the first of the frames takes to draw once all is made, milliseconds: the middle of some.
fn frame_ms(lab: &Lab<'_>, shots: &Shots, scene: &Scene) -> Result<f64> {
    const FRAMES: usize = 5;
    let Some(shot) = shots.shots.first() else {
        return Ok(0.0);
    };
    let mut renderer = Renderer::new(lab.gpu()?, scene, shots.intrinsics)?;
    renderer.upload(&shot.frame)?;
    let mut frames_ms = Vec::new();
    for _ in 0..=FRAMES {
        let (waited, ms) = Stopwatch::time(|| {
            renderer.draw(&shot.camera_from_anchor, Shown::Composite);
            renderer.wait()
        });
        waited?;
        frames_ms.push(ms);
    }
    // The first one makes what later ones keep.
    Ok(quantile(&frames_ms[1..], 0.5))
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
    let bare = Picture::from_rgba(width, &first.bare);
    let mut pictures = vec![part.cut(format!("{recording}: bare video"), &bare, |level| level)];
    let mut errors = vec![part.cut(String::new(), &change, |level| 128.0 - STRONGER * level)];
    for (name, drawn) in drawn {
        let out = Picture::from_rgba(width, &drawn.out);
        let error = error(&out, &bare, shot);
        pictures.push(part.cut(name.clone(), &out, |level| level));
        errors.push(part.cut(String::new(), &error, |level| 128.0 + STRONGER * level));
    }
    pictures.push(part.cut("truth, path-traced".to_owned(), &shot.truth.with, |l| l));
    Some([pictures, errors])
}

/// On virtual surfaces of the picture itself, on real ones of what the virtual things change: the video's noise is none.
fn error(out: &Picture, bare: &Picture, shot: &Shot) -> Picture {
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

/// A rectangle of pixels: from, to (exclusive).
struct Part {
    from: [usize; 2],
    to: [usize; 2],
}

/// What a change touches, with some room.
fn changed_part(change: &Picture) -> Option<Part> {
    let (width, height) = (change.width, change.pixels.len() / change.width);
    let changed = change
        .pixels
        .iter()
        .enumerate()
        .filter(|(_, pixel)| pixel.iter().any(|level| level.abs() > CHANGED_LEVELS));
    let places = changed.map(|(index, _)| [index % width, index / width]);
    let around = places.fold(None, |part: Option<Part>, place| {
        let mut part = part.unwrap_or(Part {
            from: place,
            to: place,
        });
        part.from = [0, 1].map(|axis| part.from[axis].min(place[axis]));
        part.to = [0, 1].map(|axis| part.to[axis].max(place[axis]));
        Some(part)
    })?;
    Some(Part {
        from: around.from.map(|low| low.saturating_sub(MARGIN_PX)),
        to: [
            (around.to[0] + MARGIN_PX).min(width),
            (around.to[1] + MARGIN_PX).min(height),
        ],
    })
}

impl Part {
    fn cut(&self, label: String, picture: &Picture, level: impl Fn(f64) -> f64) -> Cell {
        let byte = |value: f64| level(value).round().clamp(0.0, 255.0) as u8;
        let rows = self.from[1]..self.to[1];
        let pixels = rows.flat_map(|y| (self.from[0]..self.to[0]).map(move |x| (x, y)));
        Cell {
            label,
            size_px: [self.to[0] - self.from[0], self.to[1] - self.from[1]],
            rgb: pixels
                .map(|(x, y)| picture.pixels[y * picture.width + x].map(byte))
                .collect(),
        }
    }
}

impl Cell {
    /// Width and height on the sheet, in its units.
    fn size(&self) -> [f64; 2] {
        self.size_px
            .map(|px| (px * ENLARGED) as f64 / PIXELS_PER_UNIT)
    }
}

impl Sheet {
    /// Each cell with the upper left corner of its picture.
    fn placed(&self) -> Vec<([f64; 2], &Cell)> {
        let mut placed = Vec::new();
        let mut y = HEAD;
        for row in &self.rows {
            let labelled = row.iter().any(|cell| !cell.label.is_empty());
            y += if labelled { LABEL } else { 0.0 };
            let mut x = GAP;
            for cell in row {
                placed.push(([x, y], cell));
                x += cell.size()[0] + GAP;
            }
            y += row.iter().map(|cell| cell.size()[1]).fold(0.0, f64::max) + GAP;
        }
        placed
    }

    fn paint(&self) -> Result<([u32; 2], Vec<u8>)> {
        let (size_px, mut rgba) = bitmap(self)?;
        for (corner, cell) in self.placed() {
            let [left, top] = corner.map(|at| (at * PIXELS_PER_UNIT).round() as usize);
            let [width, height] = cell.size_px.map(|px| px * ENLARGED);
            for (row, column) in (0..height).flat_map(|row| (0..width).map(move |c| (row, c))) {
                let pixel = cell.rgb[row / ENLARGED * cell.size_px[0] + column / ENLARGED];
                let at = 4 * ((top + row) * size_px[0] as usize + left + column);
                rgba[at..at + 3].copy_from_slice(&pixel);
            }
        }
        Ok((size_px, rgba))
    }
}

impl Drawing for Sheet {
    fn size(&self) -> [f64; 2] {
        let ends = self.placed().into_iter().map(|([x, y], cell)| {
            let [width, height] = cell.size();
            [x + width, y + height]
        });
        let far = ends.fold([0.0_f64; 2], |far, end| {
            [far[0].max(end[0]), far[1].max(end[1])]
        });
        far.map(|end| (end + GAP).ceil())
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<'_, B>) -> Result<()> {
        let title = "Shadows beside the truth";
        canvas.text(title, [GAP, 24.0], 22.0, INK, Anchor::Start)?;
        let reading = "Above each picture the time of a frame and the rms error of its shadows; below it its error, four times stronger.";
        canvas.text(reading, [GAP, 50.0], 15.5, INK, Anchor::Start)?;
        for ([x, y], cell) in self.placed() {
            let above = [x, y - LABEL / 2.0];
            canvas.text(&cell.label, above, 15.5, INK, Anchor::Start)?;
        }
        Ok(())
    }
}
