//! Where composited frames go: a video or a folder of pictures, whole under its final name or not there at all.

use std::collections::BTreeSet;
use std::path::Path;

use super::frame_folder::{FrameFolder, frame_name};
use super::layer_files::{Layer, write_layers};
use super::new_file::ends_as_folder;
use super::output_error::OutputError;
use super::picture_files;
use super::result_kind::ResultKind;
use super::video_writer::{Codec, Naming, Pace, VideoWriter};
use crate::render::Layers;

/// The place that frames go to one by one.
pub enum FrameSink {
    /// A video file.
    Video(Box<VideoWriter>),
    /// A folder of `NNNNNN.png`.
    Folder(FrameFolder),
}

const FOREIGN_FILES: [&str; 8] = ["webm", "m4v", "mpg", "mpeg", "gif", "ts", "wmv", "png"];

impl FrameSink {
    /// What `path` is for by its extension: a video, else a folder of PNGs.
    ///
    /// # Errors
    /// A name that looks like a video, of a kind that is not written.
    pub fn kind_of(path: &Path) -> Result<ResultKind, OutputError> {
        if Codec::of_path(path).is_some() {
            return Ok(ResultKind::Video);
        }
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let is_folder = ends_as_folder(path) || path.is_dir();
        if FOREIGN_FILES.iter().any(|foreign| extension == *foreign) && !is_folder {
            return Err(OutputError::UnknownFormat {
                path: path.to_owned(),
            });
        }
        Ok(ResultKind::Frames)
    }

    /// Opens `path`: by its extension a video, else a folder of PNGs. Folders on the way are made. `fps` is the rate of
    /// the shortest steps; frames of a video keep their times.
    ///
    /// # Errors
    /// As [`FrameSink::kind_of`]; a place that cannot be written to.
    pub fn create(path: &Path, size_px: [u32; 2], fps: f64) -> Result<Self, OutputError> {
        if let Some(codec) = Codec::of_path(path) {
            let video = VideoWriter::create(
                path,
                codec,
                size_px,
                Pace::Stamped { nominal_fps: fps },
                Naming::Finished,
            )?;
            return Ok(Self::Video(Box::new(video)));
        }
        Self::kind_of(path)?;
        FrameFolder::create(path).map(Self::Folder)
    }

    /// Adds a frame of 8-bit RGBA by its index and its time.
    pub fn push(
        &mut self,
        (index, time_secs): (u32, f64),
        size_px: [u32; 2],
        rgba: &[u8],
    ) -> Result<(), OutputError> {
        match self {
            Self::Video(video) => video.push(size_px, time_secs, rgba),
            Self::Folder(folder) => folder.put(&frame_name(index), |path| {
                picture_files::rgb_png(path, size_px, rgba)
            }),
        }
    }

    /// Adds layers of a frame beside its picture. A video has no room for them.
    ///
    /// # Errors
    /// What keeps a file from being written.
    pub fn push_layers(
        &mut self,
        index: u32,
        size_px: [u32; 2],
        layers: &Layers,
        wanted: &BTreeSet<Layer>,
    ) -> Result<(), OutputError> {
        match self {
            Self::Video(_) => Ok(()),
            Self::Folder(folder) => write_layers(folder, index, size_px, layers, wanted),
        }
    }

    /// Makes what was written whole and gives it its final name. A sink dropped without this leaves no video behind.
    pub fn finish(self) -> Result<(), OutputError> {
        match self {
            Self::Video(video) => video.finish(),
            Self::Folder(folder) => folder.finish(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::FrameSource;

    /// Noise: what a lossy or a wrong path would change.
    fn noise(size_px: [u32; 2], seed: u32) -> Vec<u8> {
        let mut state = seed.wrapping_mul(2_654_435_761).max(1);
        (0..size_px[0] * size_px[1])
            .flat_map(|_| {
                state ^= state << 13;
                state ^= state >> 17;
                state ^= state << 5;
                let [red, green, blue, _] = state.to_le_bytes();
                [red, green, blue, 255]
            })
            .collect()
    }

    fn flat(size_px: [u32; 2], rgb: [u8; 3]) -> Vec<u8> {
        [rgb[0], rgb[1], rgb[2], 255].repeat((size_px[0] * size_px[1]) as usize)
    }

    fn names_in(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn lossless_outputs_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let size_px = [50, 38];
        for name in ["a.mkv", "a.avi", "deep/er/pictures"] {
            let path = folder.path().join(name);
            let mut sink = FrameSink::create(&path, size_px, 25.0).unwrap();
            for index in 0..3 {
                sink.push(
                    (index, f64::from(index) / 25.0),
                    size_px,
                    &noise(size_px, index + 1),
                )
                .unwrap();
            }
            sink.finish().unwrap();
            let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
            for index in 0..3 {
                let frame = source.next_frame().unwrap().unwrap();
                assert!(
                    frame.rgba == noise(size_px, index + 1),
                    "{name} frame {index}"
                );
            }
            assert!(source.next_frame().unwrap().is_none());
        }
        assert_eq!(names_in(folder.path()), ["a.avi", "a.mkv", "deep"]);
        assert_eq!(
            names_in(&folder.path().join("deep/er/pictures")),
            ["000000.png", "000001.png", "000002.png"]
        );
    }

    #[test]
    fn mp4_plays_everywhere_and_keeps_its_colours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mp4");
        let size_px = [63, 47];
        let mut sink = FrameSink::create(&path, size_px, 29.97).unwrap();
        for index in 0..5 {
            sink.push(
                (index, f64::from(index) / 29.97),
                size_px,
                &flat(size_px, [200, 60, 30]),
            )
            .unwrap();
        }
        sink.finish().unwrap();
        let probe = std::process::Command::new("ffprobe")
            .args([
                "-v",
                "error",
                "-show_entries",
                "stream=codec_name,pix_fmt,color_space,color_range,color_transfer,color_primaries,nb_frames",
                "-of",
                "csv=p=0",
            ])
            .arg(&path)
            .output()
            .unwrap();
        assert_eq!(
            String::from_utf8_lossy(&probe.stdout).trim(),
            "h264,yuv420p,tv,bt709,bt709,bt709,5"
        );
        let back = std::process::Command::new("ffmpeg")
            .args(["-v", "error", "-i"])
            .arg(&path)
            .args(["-frames:v", "1", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
            .output()
            .unwrap();
        for (found, expected) in back.stdout[..3].iter().zip([200_u8, 60, 30]) {
            assert!(found.abs_diff(expected) <= 3, "{:?}", &back.stdout[..3]);
        }
        assert_eq!(names_in(folder.path()), ["a.mp4"]);
    }

    #[test]
    fn nothing_half_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mp4");
        let size_px = [64, 48];
        let mut sink = FrameSink::create(&path, size_px, 30.0).unwrap();
        sink.push((0, 0.0), size_px, &noise(size_px, 1)).unwrap();
        assert!(
            sink.push((1, 0.1), [48, 64], &noise(size_px, 1)).is_err(),
            "a frame of another size"
        );
        drop(sink);
        assert_eq!(names_in(folder.path()), [""; 0]);
        FrameSink::create(&path, size_px, 30.0)
            .unwrap()
            .finish()
            .unwrap();
        assert_eq!(names_in(folder.path()), [""; 0], "no frame, no video");
    }

    #[test]
    fn frames_keep_their_times() {
        let folder = tempfile::tempdir().unwrap();
        let size_px = [64, 48];
        // A pause, frames of another rate, one that stands still.
        let times_secs = [
            0.5,
            0.5 + 1.0 / 30.0,
            0.5 + 2.0 / 30.0,
            1.7,
            1.74,
            1.74,
            2.5,
        ];
        for (name, allowed_secs) in [
            ("a.mp4", 2e-6),
            ("a.mov", 2e-6),
            ("a.mkv", 0.51e-3),
            ("a.avi", 0.51 / 30.0),
        ] {
            let path = folder.path().join(name);
            let mut sink = FrameSink::create(&path, size_px, 30.0).unwrap();
            for (index, time_secs) in times_secs.into_iter().enumerate() {
                let frame = (index as u32, time_secs);
                sink.push(frame, size_px, &flat(size_px, [index as u8 * 30, 60, 30]))
                    .unwrap();
            }
            sink.finish().unwrap();
            let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
            for (index, time_secs) in times_secs.into_iter().enumerate() {
                let frame = source.next_frame().unwrap().unwrap();
                let stands_still = index == 5;
                let off_secs = (frame.time_secs - (time_secs - 0.5)).abs();
                assert!(
                    off_secs < allowed_secs || stands_still,
                    "{name} {index}: {}",
                    frame.time_secs
                );
                assert!(
                    frame.rgba[0].abs_diff(index as u8 * 30) <= 3,
                    "{name} {index}"
                );
            }
            assert!(source.next_frame().unwrap().is_none(), "{name}");
            assert_eq!(source.notices(), [], "{name}");
        }
    }

    /// AVI has a rate and no times.
    #[test]
    fn avi_is_in_time_or_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.avi");
        let written = |fps: f64| {
            let mut sink = FrameSink::create(&path, [64, 48], fps).unwrap();
            let times_secs = [0.0, 1.0, 1.033, 1.067, 1.1, 1.133];
            let pushed = times_secs
                .iter()
                .zip(0..)
                .try_for_each(|(&time_secs, index)| {
                    sink.push((index, time_secs), [64, 48], &flat([64, 48], [9; 3]))
                });
            pushed.and_then(|()| sink.finish())
        };
        let refused = written(4.0).unwrap_err().to_string();
        assert!(refused.contains("write .mkv or .mp4"), "{refused}");
        assert_eq!(names_in(folder.path()), [""; 0]);
        written(30.0).unwrap();
    }

    #[test]
    fn a_steady_video_says_its_rate() {
        let folder = tempfile::tempdir().unwrap();
        let size_px = [64, 48];
        for (name, fps) in [
            ("a.mp4", 30.0),
            ("b.mp4", 30000.0 / 1001.0),
            ("c.mov", 25.0),
            ("d.mp4", 24000.0 / 1001.0),
        ] {
            let path = folder.path().join(name);
            let mut sink = FrameSink::create(&path, size_px, fps).unwrap();
            for index in 0..12 {
                sink.push(
                    (index, f64::from(index) / fps),
                    size_px,
                    &noise(size_px, index + 1),
                )
                .unwrap();
            }
            sink.finish().unwrap();
            let source = FrameSource::open(path.to_str().unwrap()).unwrap();
            assert!(
                (source.fps() - fps).abs() < 1e-3,
                "{name}: {}",
                source.fps()
            );
            assert_eq!(source.frame_count(), Some(12));
        }
    }

    #[test]
    fn an_encoder_that_fails_is_quoted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mp4");
        // No rate that the encoder knows.
        let pace = Pace::Even { fps: f64::NAN };
        let mut video =
            VideoWriter::create(&path, Codec::H264, [64, 48], pace, Naming::Finished).unwrap();
        let pushed: Result<(), OutputError> =
            (0..500).try_for_each(|_| video.push([64, 48], 0.0, &noise([64, 48], 1)));
        let text = pushed
            .and_then(|()| video.finish())
            .unwrap_err()
            .to_string();
        assert!(
            text.contains("a.mp4: ffmpeg failed") && text.contains("NaN"),
            "{text}"
        );
        assert_eq!(names_in(folder.path()), [""; 0]);
        let text = FrameSink::create(&folder.path().join("a.webm"), [64, 48], 30.0)
            .err()
            .unwrap()
            .to_string();
        assert!(text.contains(".mp4 or .mov"), "{text}");
    }
}
