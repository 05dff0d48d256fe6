//! A folder of images as a recording.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use super::error::{CaptureError, Notice, too_many_pixels};
use super::pixels::{self, Unread, read_picture, read_picture_as_taken, turn_when_shown};
use super::video::Place;
use crate::geometry::quarter_turns::QuarterTurns;

/// Images carry no time of their own.
pub(super) const ASSUMED_FPS: f64 = 30.0;

const EXTENSIONS: [&str; 9] = [
    "png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp", "ppm", "pgm",
];

/// A picture's place in a folder.
pub(super) fn place_of(index: u32) -> Place {
    Place {
        index,
        time_secs: f64::from(index) / ASSUMED_FPS,
    }
}

pub(super) fn is_image(file: &Path) -> bool {
    super::has_extension(file, &EXTENSIONS)
}

pub(super) struct ImageFrames {
    paths: Vec<PathBuf>,
    next_index: u32,
    good_frames: u32,
    size_px: [u32; 2],
    /// Whether pictures come of any size and as the sensor has them.
    as_taken: bool,
    /// The turn by which the last one is shown.
    shown_turn: QuarterTurns,
}

/// A picture of a folder.
pub(super) struct Image {
    pub(super) index: u32,
    pub(super) size_px: [u32; 2],
    pub(super) rgba: Vec<u8>,
}

impl ImageFrames {
    /// `folder` names the recording in errors.
    pub(super) fn open(folder: &Path, mut paths: Vec<PathBuf>) -> Result<Self, CaptureError> {
        if paths.is_empty() {
            return Err(CaptureError::NoPictures {
                path: folder.to_owned(),
                there: String::new(),
            });
        }
        paths.sort_by(|a, b| natural_order(&name_of(a), &name_of(b)));
        let size_px = first_size_px(&paths).map_err(|unread| {
            let path = folder.to_owned();
            let why = match unread {
                Unread::Undecodable => String::new(),
                Unread::OtherKind(what) => format!(": it is {what}"),
                Unread::TooManyPixels(most) => too_many_pixels(most),
                Unread::TooLong(size_px) => return CaptureError::TooLong { path, size_px },
            };
            CaptureError::NoGoodFrame { path, why }
        })?;
        Ok(Self {
            paths,
            next_index: 0,
            good_frames: 0,
            size_px,
            as_taken: false,
            shown_turn: QuarterTurns::NONE,
        })
    }

    /// From now on pictures come of any size, and as the camera's sensor has them.
    pub(super) fn take_as_taken(&mut self) {
        self.as_taken = true;
    }

    /// By which turn the last picture is shown, where pictures come as the sensor has them.
    pub(super) fn shown_turn(&self) -> QuarterTurns {
        self.shown_turn
    }

    pub(super) fn frame_count(&self) -> u32 {
        self.paths.len() as u32
    }

    pub(super) fn size_px(&self) -> [u32; 2] {
        self.size_px
    }

    pub(super) fn next_picture(
        &mut self,
        notices: &mut Vec<Notice>,
    ) -> Result<Option<Image>, CaptureError> {
        while let Some(path) = self.paths.get(self.next_index as usize) {
            let index = self.next_index;
            self.next_index += 1;
            let read = match self.as_taken {
                true => read_picture_as_taken(path),
                false => read_picture(path),
            };
            match read {
                Err(Unread::OtherKind(what)) => notices.push(Notice::OtherKind {
                    path: path.clone(),
                    frame: index,
                    what,
                }),
                Err(Unread::Undecodable | Unread::TooLong(_)) => notices.push(Notice::Broken {
                    path: path.clone(),
                    first: index,
                    count: 1,
                    good_before: self.good_frames,
                }),
                Err(Unread::TooManyPixels(most)) => notices.push(Notice::TooLarge {
                    path: path.clone(),
                    frame: index,
                    most,
                }),
                Ok(picture) if !self.as_taken && pixels::size_of(&picture.bgr) != self.size_px => {
                    notices.push(Notice::OtherSize {
                        path: path.clone(),
                        frame: index,
                        size_px: pixels::size_of(&picture.bgr),
                        expected_px: self.size_px,
                    })
                }
                Ok(picture) => {
                    if picture.is_cut_off {
                        notices.push(Notice::Corrupt {
                            path: path.clone(),
                            first: index,
                            count: 1,
                        });
                    }
                    if picture.of > 1 {
                        notices.push(Notice::FirstOfSeveral {
                            path: path.clone(),
                            pictures: picture.of,
                        });
                    }
                    let picture = picture.bgr;
                    self.good_frames += 1;
                    if self.as_taken {
                        self.shown_turn = turn_when_shown(path);
                    }
                    let rgba =
                        pixels::rgba_from_bgr(&picture).map_err(|error| CaptureError::OpenCv {
                            path: path.clone(),
                            frame: index,
                            message: error.message,
                        })?;
                    return Ok(Some(Image {
                        index,
                        size_px: pixels::size_of(&picture),
                        rgba,
                    }));
                }
            }
        }
        Ok(None)
    }
}

/// The size of the first picture that is read; else why the first one is not.
fn first_size_px(paths: &[PathBuf]) -> Result<[u32; 2], Unread> {
    let mut why = None;
    for path in paths {
        match read_picture(path) {
            Ok(picture) => return Ok(pixels::size_of(&picture.bgr)),
            Err(unread) => _ = why.get_or_insert(unread),
        }
    }
    Err(why.unwrap_or(Unread::Undecodable))
}

fn name_of(path: &Path) -> String {
    path.file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Orders names as people do: runs of digits by their value, so that `img_9` comes before `img_10`.
fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut rest_a, mut rest_b) = (a, b);
    while !rest_a.is_empty() && !rest_b.is_empty() {
        let (run_a, run_b) = (take_run(&mut rest_a), take_run(&mut rest_b));
        let both_digits = run_a.starts_with(|c: char| c.is_ascii_digit())
            && run_b.starts_with(|c: char| c.is_ascii_digit());
        let order = if both_digits {
            let (value_a, value_b) = (run_a.trim_start_matches('0'), run_b.trim_start_matches('0'));
            value_a
                .len()
                .cmp(&value_b.len())
                .then_with(|| value_a.cmp(value_b))
        } else {
            run_a.cmp(run_b)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    rest_a.len().cmp(&rest_b.len()).then_with(|| a.cmp(b))
}

/// Splits the leading run of digits, or of anything else, off.
fn take_run<'a>(rest: &mut &'a str) -> &'a str {
    let digits = rest.starts_with(|c: char| c.is_ascii_digit());
    let end = rest
        .find(|c: char| c.is_ascii_digit() != digits)
        .unwrap_or(rest.len());
    let (run, tail) = rest.split_at(end);
    *rest = tail;
    run
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_as_people_count() {
        let mut names = [
            "img_10.png",
            "img_9.png",
            "img_009.png",
            "a2b10.png",
            "a2b9.png",
            "10.png",
            "9.png",
        ];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(
            names,
            [
                "9.png",
                "10.png",
                "a2b9.png",
                "a2b10.png",
                "img_009.png",
                "img_9.png",
                "img_10.png"
            ]
        );
    }
}
