//! Pictures and layers held against path-traced truth, by the definitions of the reference's compare.py (5 x 5 box
//! filter, masks eroded by as much).

use std::path::Path;

use glam::DAffine3;
use gnomon::capture::{Frame, FrameSource};
use gnomon::render::{Layers, Renderer, Shown};
use serde_json::Value;

use super::affine;
use super::ray_cast::{FACES_AWAY, REAL, VIRTUAL, VIRTUAL_HIDES};

/// The errors of one frame.
#[derive(Debug)]
pub struct Errors {
    pub frame: u32,
    pub role_pct: f64,
    pub wrong_pct: f64,
    pub far: usize,
    pub iou: f64,
    pub change_real: f64,
    pub residual_real: f64,
    pub residual_virtual: f64,
    /// Root mean square error of the gain where the truth darkens.
    pub factor: f64,
    /// Pixels that no virtual thing touches, in percent of all, and how many of them changed.
    pub untouched_pct: f64,
    pub untouched_wrong: usize,
}

/// RGB in levels, rows from the top.
#[derive(Clone)]
pub struct Picture {
    pub width: usize,
    pub pixels: Vec<[f64; 3]>,
}

impl Picture {
    pub fn open(path: &Path) -> Self {
        let read = image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let width = read.width() as usize;
        let sixteen = read.to_rgb16().into_raw();
        // An 8-bit level v reads as 257 v.
        let unit = if read.color().bytes_per_pixel() > 4 {
            32768.0
        } else {
            257.0
        };
        let pixels = sixteen
            .chunks_exact(3)
            .map(|p| [0, 1, 2].map(|channel| f64::from(p[channel]) / unit));
        Self {
            width,
            pixels: pixels.collect(),
        }
    }

    pub fn from_rgba(width: usize, rgba: &[u8]) -> Self {
        let pixels = rgba
            .chunks_exact(4)
            .map(|p| [p[0], p[1], p[2]].map(f64::from));
        Self {
            width,
            pixels: pixels.collect(),
        }
    }

    pub fn minus(&self, other: &Self) -> Self {
        let pixels = self.pixels.iter().zip(&other.pixels);
        Self {
            width: self.width,
            pixels: pixels
                .map(|(a, b)| std::array::from_fn(|channel| a[channel] - b[channel]))
                .collect(),
        }
    }

    /// 5 x 5 box filter; the border is mirrored without repeating its pixels.
    pub fn blurred(&self) -> Self {
        let (width, height) = (self.width as i64, (self.pixels.len() / self.width) as i64);
        let mirrored = |at: i64, size: i64| {
            let at = at.abs();
            (if at >= size { 2 * size - 2 - at } else { at }) as usize
        };
        let filter = |source: &[[f64; 3]], across: i64, down: i64| -> Vec<[f64; 3]> {
            let mean = |index: usize| {
                let (x, y) = (index as i64 % width, index as i64 / width);
                let mut sum = [0.0; 3];
                for step in -2..=2 {
                    let (p, q) = (
                        mirrored(x + step * across, width),
                        mirrored(y + step * down, height),
                    );
                    let value = source[q * width as usize + p];
                    (0..3).for_each(|channel| sum[channel] += value[channel] / 5.0);
                }
                sum
            };
            (0..source.len()).map(mean).collect()
        };
        Self {
            width: self.width,
            pixels: filter(&filter(&self.pixels, 1, 0), 0, 1),
        }
    }

    /// Root mean square over the pixels of a mask; `None` where it is empty.
    pub fn rms(&self, mask: &[bool]) -> Option<f64> {
        let squares: Vec<f64> = self
            .pixels
            .iter()
            .zip(mask)
            .filter(|&(_, &inside)| inside)
            .flat_map(|(pixel, _)| pixel.map(|value| value * value))
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
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

/// What lies inside a mask with all its neighbours within two pixels.
pub fn inner(mask: &[bool], width: usize) -> Vec<bool> {
    (0..mask.len())
        .map(|index| mask[index] && around(index, 2, width, mask.len()).all(|near| mask[near]))
        .collect()
}

/// Whether a mask has both values within a pixel, for each pixel.
pub fn edges(values: &[u8], width: usize) -> Vec<bool> {
    (0..values.len())
        .map(|index| {
            around(index, 1, width, values.len()).any(|near| values[near] != values[index])
        })
        .collect()
}

pub fn both(a: &[bool], b: &[bool]) -> Vec<bool> {
    a.iter().zip(b).map(|(&a, &b)| a && b).collect()
}

/// What the truth says of one frame.
pub struct Truth {
    pub with: Picture,
    pub without: Picture,
    pub factor: Picture,
    pub ids: Vec<u8>,
    pub mask: Vec<u8>,
}

impl Truth {
    pub fn open(folder: &Path, frame: u32) -> Self {
        let file = |suffix: &str| folder.join(format!("truth/{frame:03}_{suffix}.png"));
        let grey = |suffix: &str| {
            let path = file(suffix);
            image::open(&path)
                .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
                .to_luma8()
                .into_raw()
        };
        Self {
            with: Picture::open(&file("with")),
            without: Picture::open(&file("without")),
            factor: Picture::open(&file("factor")),
            ids: grey("ids"),
            mask: grey("mask_0"),
        }
    }
}

/// What gnomon makes of one frame.
pub struct Drawn {
    pub out: Vec<u8>,
    pub bare: Vec<u8>,
    pub layers: Layers,
}

pub fn compare(frame: u32, truth: &Truth, drawn: &Drawn) -> Errors {
    let width = truth.with.width;
    let count = truth.ids.len();
    let (role, gain) = (&drawn.layers.role, &drawn.layers.gain);
    let real: Vec<bool> = truth.ids.iter().map(|&id| id == REAL).collect();
    let seeming: Vec<bool> = truth.ids.iter().map(|&id| id == VIRTUAL).collect();

    let either = (0..count)
        .filter(|&i| seeming[i] || role[i] == VIRTUAL)
        .count();
    let role_wrong = (0..count)
        .filter(|&i| seeming[i] != (role[i] == VIRTUAL))
        .count();

    let bits = &drawn.layers.shadow[0];
    let lit: Vec<usize> = (0..count)
        .filter(|&i| real[i] && truth.mask[i] & FACES_AWAY == 0)
        .collect();
    let shadows = |i: usize| {
        (
            truth.mask[i] & VIRTUAL_HIDES != 0,
            bits[i] & VIRTUAL_HIDES != 0,
        )
    };
    let wrong: Vec<usize> = lit
        .iter()
        .copied()
        .filter(|&i| shadows(i).0 != shadows(i).1)
        .collect();
    let [hides, away] =
        [VIRTUAL_HIDES, FACES_AWAY].map(|bit| truth.mask.iter().map(|m| m & bit).collect());
    let edge: Vec<bool> = {
        let parts: [Vec<bool>; 3] = [&hides, &truth.ids, &away].map(|v: &Vec<u8>| edges(v, width));
        (0..count)
            .map(|i| parts.iter().any(|part| part[i]))
            .collect()
    };
    let far = wrong
        .iter()
        .filter(|&&i| !around(i, 1, width, count).any(|near| edge[near]))
        .count();
    let shared = lit
        .iter()
        .filter(|&&i| shadows(i).0 && shadows(i).1)
        .count();
    let all = lit
        .iter()
        .filter(|&&i| shadows(i).0 || shadows(i).1)
        .count();

    let out = Picture::from_rgba(width, &drawn.out);
    let bare = Picture::from_rgba(width, &drawn.bare);
    let change = truth.with.minus(&truth.without);
    let changed: Vec<bool> = change
        .pixels
        .iter()
        .map(|pixel| pixel.iter().any(|value| value.abs() > 2.0))
        .collect();
    let inner_real = inner(&real, width);
    let on_real = both(&inner_real, &changed);
    let on_virtual = both(&inner(&seeming, width), &changed);
    let smooth_change = change.blurred();
    let error = out.minus(&truth.with).blurred();
    let residual = |mask: &[bool]| {
        error.rms(mask).expect("pixels that change")
            / smooth_change.rms(mask).expect("pixels that change")
    };
    let change_error = out.minus(&bare).minus(&change).blurred();

    let gain_picture = Picture {
        width,
        pixels: gain.iter().map(|gain| gain.map(f64::from)).collect(),
    };
    let darkened: Vec<bool> = truth
        .factor
        .pixels
        .iter()
        .map(|factor| factor.iter().sum::<f64>() / 3.0 < 0.995)
        .collect();

    // A sample of a virtual thing may touch a pixel whose centre it misses.
    let untouched: Vec<usize> = (0..count)
        .filter(|&i| {
            gain[i] == [1.0; 3] && around(i, 1, width, count).all(|near| role[near] != VIRTUAL)
        })
        .collect();
    let pixel = |rgba: &[u8], i: usize| [rgba[4 * i], rgba[4 * i + 1], rgba[4 * i + 2]];
    Errors {
        frame,
        role_pct: 100.0 * role_wrong as f64 / either.max(1) as f64,
        wrong_pct: 100.0 * wrong.len() as f64 / lit.len().max(1) as f64,
        far,
        iou: shared as f64 / all.max(1) as f64,
        change_real: change_error.rms(&on_real).expect("a shadow")
            / smooth_change.rms(&on_real).expect("a shadow"),
        residual_real: residual(&on_real),
        residual_virtual: residual(&on_virtual),
        factor: gain_picture
            .blurred()
            .minus(&truth.factor)
            .rms(&both(&inner_real, &darkened))
            .expect("a shadow"),
        untouched_pct: 100.0 * untouched.len() as f64 / count as f64,
        untouched_wrong: untouched
            .iter()
            .filter(|&&i| pixel(&drawn.out, i) != pixel(&drawn.bare, i))
            .count(),
    }
}

/// The true poses of a frame, in the scene's order of anchors: the board, then the marker 17 where there is one.
fn true_poses(frame: &Value, anchors: usize) -> Vec<Option<DAffine3>> {
    let camera_from_world = affine(&frame["world_to_camera"]);
    let mut poses = vec![Some(camera_from_world)];
    if anchors > 1 {
        poses.push(Some(camera_from_world * affine(&frame["markers"]["17"])));
    }
    poses
}

/// The key frames of a recording, those that its truth has pictures of, with their true poses.
pub fn key_frames(folder: &Path, anchors: usize) -> Vec<(Frame, Vec<Option<DAffine3>>)> {
    let mut keys: Vec<u32> = std::fs::read_dir(folder.join("truth"))
        .expect("a folder of truth")
        .filter_map(|entry| {
            let name = entry.expect("an entry").file_name();
            name.to_str()?.strip_suffix("_with.png")?.parse().ok()
        })
        .collect();
    keys.sort_unstable();
    let text = std::fs::read_to_string(folder.join("truth.json")).expect("true poses");
    let truth: Value = serde_json::from_str(&text).expect("JSON");
    let video = folder.join("video.mp4");
    let mut source = FrameSource::open(video.to_str().expect("a plain path")).expect("the video");
    let mut found = Vec::new();
    while found.len() < keys.len() {
        let frame = source.next_frame().expect("a frame");
        let frame = frame.expect("every key frame in the video");
        if keys.contains(&frame.index) {
            let poses = true_poses(&truth["frames"][frame.index as usize], anchors);
            found.push((frame, poses));
        }
    }
    found
}

pub fn draw(renderer: &mut Renderer, frame: &Frame, poses: &[Option<DAffine3>]) -> Drawn {
    renderer.upload(frame).expect("an uploaded frame");
    renderer.draw(poses, Shown::Bare);
    let bare = renderer.read_picture().expect("the bare picture");
    renderer.draw(poses, Shown::Composite);
    Drawn {
        out: renderer.read_picture().expect("a picture"),
        bare,
        layers: renderer.layers().expect("layers"),
    }
}
