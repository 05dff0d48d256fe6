//! Pictures and layers held against path-traced truth: 5 x 5 box filter, masks eroded by as much.

use std::path::Path;

use anyhow::{Context as _, Result};
use glam::DAffine3;

use super::picture::LinearPicture;
use super::poses::TruePoses;
use crate::capture::{Frame, FrameSource};
use crate::light::srgb::linear_from_srgb;
use crate::render::{Layers, REAL, Renderer, Shown, VIRTUAL, VIRTUAL_HIDES};
use crate::scene::Anchor;

/// Of a true mask: the surface faces away from the light.
pub const FACES_AWAY: u8 = 4;
/// Pixels that the truth changes by more than this many levels count as changed.
const CHANGED_LEVELS: f64 = 2.0;
/// Pixels that the truth changes by less than this many levels are left alone.
const ALONE_LEVELS: f64 = 0.5;
/// A true factor below this darkens.
const DARKENED: f64 = 0.995;

/// The errors of one frame.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    /// Index in the recording.
    pub frame: u32,
    /// Pixels whose role is not the truth's, percent of those that are virtual in either.
    pub role_pct: f64,
    /// Of the first light's shadow; `None` where no light is a point or a direction.
    pub shadow: Option<ShadowErrors>,
    /// As `residual_real`, of what the virtual things change alone, without the video's own noise.
    pub change_real: f64,
    /// Root mean square error of the picture over that of the bare video, where the truth changes, on real pixels: 0 is
    /// what the camera would have taken, 1 is as wrong as doing nothing.
    pub residual_real: f64,
    /// The same on virtual pixels.
    pub residual_virtual: f64,
    /// Root mean square error of the gain where the truth darkens.
    pub factor: f64,
    /// The same of a gain that is box-filtered as the truth is, which is a quotient of filtered pictures: by the light that it
    /// takes from. (Filtered alone, even the true gain is off where a shadow's edge lies beside an edge of a print.)
    pub factor_by_light: f64,
    /// Root mean square error of what the virtual things change along the outlines of things, unfiltered, in levels of
    /// 255: jagged outlines show here.
    pub outline_levels: f64,
    /// Pixels that no virtual thing touches, percent of all.
    pub untouched_pct: f64,
    /// How many of them changed.
    pub untouched_wrong: usize,
    /// Real pixels that change by more than two levels, percent of those that the truth leaves alone.
    pub alone_wrong_pct: f64,
}

/// The errors of one light's shadow.
#[derive(Debug, Clone, Copy)]
pub struct ShadowErrors {
    /// Pixels whose bit *a virtual thing hides the light* is wrong, percent of the real ones that face it.
    pub wrong_pct: f64,
    /// How many of them have no edge of the truth within a pixel.
    pub far: usize,
    /// The shadow's intersection with the true one over their union.
    pub iou: f64,
}

/// The true pictures of one frame.
pub struct Truth {
    /// What the camera would have seen with the virtual things.
    pub with: LinearPicture,
    /// And without.
    pub without: LinearPicture,
    /// With over without in linear light, box-filtered.
    pub factor: LinearPicture,
    /// Roles.
    pub ids: Vec<u8>,
    /// Bits of the first light's shadow, and [`FACES_AWAY`]; `None` where it is no light of a scene file.
    pub mask: Option<Vec<u8>>,
}

impl Truth {
    /// Reads what a recording has of a frame.
    ///
    /// # Errors
    /// A picture that is not there.
    pub fn open(folder: &Path, frame: u32) -> Result<Self> {
        let file = |suffix: &str| folder.join(format!("truth/{frame:03}_{suffix}.png"));
        let grey = |suffix: &str| -> Result<Vec<u8>> {
            let path = file(suffix);
            let read = image::open(&path).with_context(|| path.display().to_string())?;
            Ok(read.to_luma8().into_raw())
        };
        Ok(Self {
            with: LinearPicture::open(&file("with"))?,
            without: LinearPicture::open(&file("without"))?,
            factor: LinearPicture::open(&file("factor"))?,
            ids: grey("ids")?,
            mask: match file("mask_0").is_file() {
                true => Some(grey("mask_0")?),
                false => None,
            },
        })
    }
}

/// Gnomon's picture of one frame, with its layers.
#[derive(Clone)]
pub struct Drawn {
    /// The composite, RGBA.
    pub out: Vec<u8>,
    /// The undistorted video, RGBA.
    pub bare: Vec<u8>,
    /// The composite's layers.
    pub layers: Layers,
}

/// Draws a frame at given poses.
///
/// # Errors
/// A frame of another size than the renderer's, or a device that failed.
pub fn draw(
    renderer: &mut Renderer,
    frame: &Frame,
    camera_from_anchor: &[Option<DAffine3>],
) -> Result<Drawn> {
    renderer.upload(frame)?;
    renderer.draw(camera_from_anchor, Shown::Bare);
    let bare = renderer.read_picture()?;
    renderer.draw(camera_from_anchor, Shown::Composite);
    Ok(Drawn {
        out: renderer.read_picture()?,
        bare,
        layers: renderer.layers()?,
    })
}

/// The key frames of a recording, those that its truth has pictures of, with their true poses.
///
/// # Errors
/// A recording or a truth that is not there or not whole.
pub fn key_frames(
    folder: &Path,
    anchors: &[Anchor],
) -> Result<Vec<(Frame, Vec<Option<DAffine3>>)>> {
    let pictures = folder.join("truth");
    let entries = std::fs::read_dir(&pictures).with_context(|| pictures.display().to_string())?;
    let mut keys = Vec::new();
    for entry in entries {
        let name = entry?.file_name();
        let name = name
            .to_str()
            .and_then(|name| name.strip_suffix("_with.png"));
        keys.extend(name.and_then(|number| number.parse::<u32>().ok()));
    }
    keys.sort_unstable();
    let truth = TruePoses::read(folder)?;
    let path = folder.to_str().context("the path is not UTF-8 text")?;
    let mut source = FrameSource::open(path)?;
    let mut found = Vec::new();
    while found.len() < keys.len() {
        let frame = source
            .next_frame()?
            .with_context(|| format!("{path} ends before its truth does"))?;
        if keys.contains(&frame.index) {
            let poses = truth.camera_from_anchors(frame.index, anchors)?;
            found.push((frame, poses.into_iter().map(Some).collect()));
        }
    }
    Ok(found)
}

/// Holds a drawn frame against the truth.
///
/// # Errors
/// A truth in which nothing changes: it can judge nothing.
pub fn compare(frame: u32, truth: &Truth, drawn: &Drawn) -> Result<Errors> {
    let width = truth.with.width;
    let count = truth.ids.len();
    let (role, gain) = (&drawn.layers.role, &drawn.layers.gain);
    let is = |wanted: u8| -> Vec<bool> { truth.ids.iter().map(|&id| id == wanted).collect() };
    let (real, seeming) = (is(REAL), is(VIRTUAL));

    let either = (0..count).filter(|&i| seeming[i] || role[i] == VIRTUAL);
    let either = either.count();
    let role_wrong = (0..count).filter(|&i| seeming[i] != (role[i] == VIRTUAL));
    let role_wrong = role_wrong.count();

    let out = LinearPicture::from_rgba(width, &drawn.out);
    let bare = LinearPicture::from_rgba(width, &drawn.bare);
    let change = truth.with.minus(&truth.without);
    let largest = |pixel: &[f64; 3]| {
        pixel
            .iter()
            .fold(0.0_f64, |most, value| most.max(value.abs()))
    };
    let changed = change.pixels.iter().map(largest);
    let changed: Vec<bool> = changed.map(|levels| levels > CHANGED_LEVELS).collect();
    let inner_real = inner(&real, width);
    let on_real = both(&inner_real, &changed);
    let on_virtual = both(&inner(&seeming, width), &changed);
    let smooth_change = change.blurred();
    let ratio = |error: &LinearPicture, mask: &[bool]| {
        let parts = error.rms(mask).zip(smooth_change.rms(mask));
        let (error, change) =
            parts.with_context(|| format!("frame {frame}: the truth changes nothing"))?;
        anyhow::Ok(error / change)
    };
    let error = out.minus(&truth.with).blurred();
    let change_error = out.minus(&bare).minus(&change);
    let outlines = edges(&truth.ids, width);
    let outline_levels = change_error.rms(&outlines);
    let change_error = change_error.blurred();

    let [factor, factor_by_light] = factor_errors(frame, truth, &drawn.layers.gain, &inner_real)?;

    // A sample of a virtual thing may touch a pixel whose centre it misses.
    let beside_virtual = |i: usize| around(i, 1, width, count).any(|near| role[near] == VIRTUAL);
    let untouched: Vec<usize> = (0..count)
        .filter(|&i| gain[i] == [1.0; 3] && !beside_virtual(i))
        .collect();
    let pixel = |rgba: &[u8], i: usize| [rgba[4 * i], rgba[4 * i + 1], rgba[4 * i + 2]];
    let has_changed = |&&i: &&usize| pixel(&drawn.out, i) != pixel(&drawn.bare, i);
    let alone: Vec<usize> = (0..count)
        .filter(|&i| real[i] && largest(&change.pixels[i]) < ALONE_LEVELS)
        .collect();
    let drawn_change = out.minus(&bare);
    let moves = |&&i: &&usize| largest(&drawn_change.pixels[i]) > CHANGED_LEVELS;
    let alone_wrong = alone.iter().filter(moves).count();
    Ok(Errors {
        frame,
        role_pct: 100.0 * role_wrong as f64 / either.max(1) as f64,
        shadow: shadow_errors(truth, drawn),
        change_real: ratio(&change_error, &on_real)?,
        residual_real: ratio(&error, &on_real)?,
        residual_virtual: ratio(&error, &on_virtual)?,
        factor,
        factor_by_light,
        outline_levels: outline_levels
            .with_context(|| format!("frame {frame}: the truth shows no virtual thing"))?,
        untouched_pct: 100.0 * untouched.len() as f64 / count as f64,
        untouched_wrong: untouched.iter().filter(has_changed).count(),
        alone_wrong_pct: 100.0 * alone_wrong as f64 / alone.len().max(1) as f64,
    })
}

/// RMS errors of [`Errors::factor`] and [`Errors::factor_by_light`] on real pixels.
fn factor_errors(
    frame: u32,
    truth: &Truth,
    gain: &[[f32; 3]],
    inner_real: &[bool],
) -> Result<[f64; 2]> {
    let gain = LinearPicture {
        width: truth.with.width,
        pixels: gain.iter().map(|gain| gain.map(f64::from)).collect(),
    };
    let factors = truth.factor.pixels.iter();
    let means = factors.map(|factor| factor.iter().sum::<f64>() / 3.0);
    let darkened: Vec<bool> = means.map(|mean| mean < DARKENED).collect();
    let in_shadow = both(inner_real, &darkened);
    let light = truth.without.map(|level| linear_from_srgb(level / 255.0));
    let left = gain.with_each(&light, |gain, light| gain * light);
    let by_light = left
        .blurred()
        .with_each(&light.blurred(), |left, light| left / light.max(1e-4));
    let rms = |of: &LinearPicture| {
        let error = of.minus(&truth.factor);
        let rms = error.rms(&in_shadow);
        rms.with_context(|| format!("frame {frame}: the truth darkens nothing"))
    };
    Ok([rms(&gain.blurred())?, rms(&by_light)?])
}

/// The first light's shadow against its true mask, where there are both.
fn shadow_errors(truth: &Truth, drawn: &Drawn) -> Option<ShadowErrors> {
    let (mask, bits) = (truth.mask.as_ref()?, drawn.layers.shadow.first()?);
    let (width, count) = (truth.with.width, truth.ids.len());
    let lit: Vec<usize> = (0..count)
        .filter(|&i| truth.ids[i] == REAL && mask[i] & FACES_AWAY == 0)
        .collect();
    let shadows = |i: usize| (mask[i] & VIRTUAL_HIDES != 0, bits[i] & VIRTUAL_HIDES != 0);
    let differs = |&i: &usize| shadows(i).0 != shadows(i).1;
    let wrong: Vec<usize> = lit.iter().copied().filter(differs).collect();
    let [hides, away] =
        [VIRTUAL_HIDES, FACES_AWAY].map(|bit| mask.iter().map(|m| m & bit).collect());
    let edge: Vec<bool> = {
        let parts: [Vec<bool>; 3] = [&hides, &truth.ids, &away].map(|v: &Vec<u8>| edges(v, width));
        (0..count)
            .map(|i| parts.iter().any(|part| part[i]))
            .collect()
    };
    let is_far = |i: usize| !around(i, 1, width, count).any(|near| edge[near]);
    let far = wrong.iter().filter(|&&i| is_far(i)).count();
    let shadowed = |of: fn((bool, bool)) -> bool| lit.iter().filter(|&&i| of(shadows(i))).count();
    let shared = shadowed(|(truly, found)| truly && found);
    let all = shadowed(|(truly, found)| truly || found);
    Some(ShadowErrors {
        wrong_pct: 100.0 * wrong.len() as f64 / lit.len().max(1) as f64,
        far,
        iou: shared as f64 / all.max(1) as f64,
    })
}

/// How far two pictures of one size are apart, in levels of 255, where they differ at all: the pixels that do, the root
/// mean square over those, and the largest difference of a channel.
pub fn changed_by(one: &[u8], other: &[u8]) -> (usize, f64, u8) {
    let (mut pixels, mut squares, mut largest) = (0, 0.0, 0);
    for (a, b) in one.chunks_exact(4).zip(other.chunks_exact(4)) {
        let off: [u8; 3] = std::array::from_fn(|channel| a[channel].abs_diff(b[channel]));
        pixels += usize::from(off != [0; 3]);
        squares += off.iter().map(|&off| f64::from(off).powi(2)).sum::<f64>() / 3.0;
        largest = off.into_iter().fold(largest, u8::max);
    }
    (
        pixels,
        (squares / f64::max(pixels as f64, 1.0)).sqrt(),
        largest,
    )
}

/// The indices of the pixels within `reach` of one, in the picture alone.
pub fn around(
    index: usize,
    reach: i64,
    width: usize,
    pixels: usize,
) -> impl Iterator<Item = usize> + use<> {
    let (w, h) = (width as i64, (pixels / width) as i64);
    let (x, y) = (index as i64 % w, index as i64 / w);
    let rows = (y - reach).max(0)..=(y + reach).min(h - 1);
    rows.flat_map(move |q| {
        ((x - reach).max(0)..=(x + reach).min(w - 1)).map(move |p| (q * w + p) as usize)
    })
}

/// Whether a mask has both values within a pixel, for each pixel.
pub fn edges(values: &[u8], width: usize) -> Vec<bool> {
    let is_edge = |index: usize| {
        around(index, 1, width, values.len()).any(|near| values[near] != values[index])
    };
    (0..values.len()).map(is_edge).collect()
}

/// What lies inside a mask with all its neighbours within two pixels.
fn inner(mask: &[bool], width: usize) -> Vec<bool> {
    (0..mask.len())
        .map(|index| mask[index] && around(index, 2, width, mask.len()).all(|near| mask[near]))
        .collect()
}

fn both(a: &[bool], b: &[bool]) -> Vec<bool> {
    a.iter().zip(b).map(|(&a, &b)| a && b).collect()
}
