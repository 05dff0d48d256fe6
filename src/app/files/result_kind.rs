//! What a result is, told by what is in it: a new one takes the place of an older one of its kind, and of nothing else.

use std::path::Path;

use serde_json::Value as Json;

use super::made_by::{MADE_BY, SOFTWARE};
use super::{anchor_block, detections_file, poses_file};
use crate::light::response::Response;

/// The kind of thing that a job writes under a name that it was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResultKind {
    /// Poses (CSV).
    Poses,
    /// Detections (CSV).
    Detections,
    /// What a job cost (JSON).
    Stats,
    /// A camera's response (CSV).
    Response,
    /// A table of a chart (CSV).
    Table,
    /// What is kept for a chart until it is made.
    Measurements,
    /// The page that shows all charts (Markdown).
    ChartsPage,
    /// A picture of a chart (PNG).
    ChartPicture,
    /// A drawing of a chart (SVG).
    ChartDrawing,
    /// A video.
    Video,
    /// A picture (PNG).
    Png,
    /// Radiance (Radiance HDR, OpenEXR).
    Radiance,
    /// A sheet (PDF).
    Pdf,
    /// A drawing (SVG).
    Svg,
    /// Anchors that a job learnt, as a scene takes them (TOML).
    LearntBoard,
    /// Anchors that a job printed (TOML).
    PrintedMarkers,
    /// A camera's calibration (TOML).
    Calibration,
    /// A folder for frames and layers, named by frame.
    Frames,
    /// A folder that takes a session.
    Session,
    /// A folder for files under names that nothing has yet.
    Folder,
}

impl ResultKind {
    /// Of a sheet, by the extension of its name.
    pub fn of_sheet(path: &Path) -> Option<Self> {
        match extension(path).as_str() {
            "pdf" => Some(Self::Pdf),
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            _ => None,
        }
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Poses => "poses (CSV)",
            Self::Detections => "detections (CSV)",
            Self::Stats => "statistics (JSON)",
            Self::Response => "a camera's response (CSV)",
            Self::Table => "a table (CSV)",
            Self::Measurements => "measurements of a chart",
            Self::ChartsPage => "the page of the charts",
            Self::ChartPicture => "a picture (PNG)",
            Self::ChartDrawing => "a drawing (SVG)",
            Self::Video => "a video made by gnomon",
            Self::Png => "a picture (PNG) made by gnomon",
            Self::Radiance => "a probe (Radiance HDR or OpenEXR) made by gnomon",
            Self::Pdf => "a PDF made by gnomon",
            Self::Svg => "an SVG made by gnomon",
            Self::LearntBoard => "a [[board]] alone (TOML)",
            Self::PrintedMarkers => "printed markers alone (TOML)",
            Self::Calibration => "a calibration (TOML)",
            Self::Frames => "a folder of frames",
            Self::Session => "a session",
            Self::Folder => "a folder",
        }
    }

    /// Whether it is a folder rather than a file.
    pub fn is_folder(self) -> bool {
        matches!(self, Self::Frames | Self::Session | Self::Folder)
    }

    /// Whether it is text, which stdout takes.
    pub fn is_text(self) -> bool {
        matches!(
            self,
            Self::Poses
                | Self::Detections
                | Self::Stats
                | Self::Response
                | Self::LearntBoard
                | Self::Calibration
        )
    }

    /// Whether its mark stands in a file's first kilobytes.
    pub fn is_marked_early(self) -> bool {
        // What describes an MP4 as a whole stands behind the places of all its frames.
        use ResultKind::*;
        matches!(
            self,
            Png | Radiance | Pdf | Svg | ChartPicture | ChartDrawing
        )
    }

    /// Whether a file holds such a result. What others make too, pictures and videos, has to say that it is this program's. One
    /// that is empty holds nothing that could be lost.
    pub fn is(self, bytes: &[u8]) -> bool {
        let first_line = || {
            let line = bytes.split(|&byte| byte == b'\n').next();
            std::str::from_utf8(line.unwrap_or_default()).map_or("", str::trim_end)
        };
        let begins = |magic: &[u8]| bytes.starts_with(magic);
        let has = |mark: String| {
            let mut windows = bytes.windows(mark.len());
            windows.any(|window| window == mark.as_bytes())
        };
        let is_png = begins(b"\x89PNG\r\n\x1a\n");
        if bytes.is_empty() {
            return !self.is_folder();
        }
        match self {
            Self::Poses => first_line() == poses_file::HEADER,
            Self::Detections => first_line().starts_with(detections_file::FIRST_COLUMNS),
            Self::Response => {
                std::str::from_utf8(bytes).is_ok_and(|text| Response::from_csv(text).is_ok())
            }
            Self::Table => is_header(first_line()),
            Self::Measurements => begins(b"# made from "),
            Self::ChartsPage => begins(b"# Charts: "),
            Self::Stats => is_stats(bytes),
            Self::ChartPicture => is_png,
            Self::ChartDrawing => begins(b"<svg "),
            Self::Video => is_video(bytes) && has(MADE_BY.to_owned()),
            Self::Png => is_png && has(format!("tEXtSoftware\0{SOFTWARE}")),
            Self::Radiance => {
                begins(b"#?") && has(format!("\nSOFTWARE={SOFTWARE}\n"))
                    || begins(b"\x76\x2f\x31\x01")
                        && has(format!("software\0string\0\x06\0\0\0{SOFTWARE}"))
            }
            Self::Pdf => begins(b"%PDF-") && has(format!("/Creator ({SOFTWARE})")),
            Self::Svg => begins(b"<svg ") && has(MADE_BY.to_owned()),
            // Who has gathered more than one did so by hand.
            Self::LearntBoard => has_keys(bytes, &["board"], &[]) && count_of(bytes, "board") == 1,
            // A layout that was learnt may have cost an hour; a printed one is made again by the same command.
            Self::PrintedMarkers => {
                begins(anchor_block::PRINTED.as_bytes())
                    && has_keys(bytes, &[], &["board", "marker"])
            }
            Self::Calibration => has_keys(
                bytes,
                &["focal_px", "center_px", "distortion"],
                &["size_px", "model"],
            ),
            Self::Frames | Self::Session | Self::Folder => false,
        }
    }
}

/// Whether a name is that of a frame's picture or layer, `000012.png` or `000012_role.png`.
pub fn is_frame_name(name: &Path) -> bool {
    let stem = name.file_stem().unwrap_or_default().to_string_lossy();
    let is_picture = ["png", "exr"].contains(&extension(name).as_str());
    let (digits, rest) = stem.split_at_checked(6).unwrap_or(("", ""));
    is_picture
        && digits.len() == 6
        && digits.bytes().all(|byte| byte.is_ascii_digit())
        && (rest.is_empty() || rest.starts_with('_'))
}

fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

/// Two or more names of columns.
fn is_header(line: &str) -> bool {
    let is_name = |name: &str| {
        name.starts_with(|first: char| first.is_ascii_lowercase())
            && (name.bytes()).all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    };
    line.contains(',') && line.split(',').all(is_name)
}

fn is_stats(bytes: &[u8]) -> bool {
    let stats: Json = serde_json::from_slice(bytes).unwrap_or_default();
    ["source", "detector", "stages", "total_secs"]
        .iter()
        .all(|key| stats.get(key).is_some())
}

/// QuickTime and MP4, Matroska, AVI.
fn is_video(bytes: &[u8]) -> bool {
    let at = |start: usize, magics: &[&[u8; 4]]| {
        let found = bytes.get(start..start + 4);
        found.is_some_and(|found| magics.iter().any(|magic| magic[..] == *found))
    };
    at(4, &[b"ftyp", b"moov", b"mdat", b"wide", b"free"])
        || at(0, &[b"\x1a\x45\xdf\xa3"])
        || (at(0, &[b"RIFF"]) && at(8, &[b"AVI "]))
}

/// Whether a text is TOML with all of these keys and at most those at its outermost level.
fn has_keys(bytes: &[u8], all: &[&str], perhaps: &[&str]) -> bool {
    let text = std::str::from_utf8(bytes).ok();
    let Some(table) = text.and_then(|text| text.parse::<toml::Table>().ok()) else {
        return false;
    };
    let is_known = |key: &String| all.contains(&key.as_str()) || perhaps.contains(&key.as_str());
    !table.is_empty()
        && all.iter().all(|key| table.contains_key(*key))
        && table.keys().all(is_known)
}

fn count_of(bytes: &[u8], key: &str) -> usize {
    let text = std::str::from_utf8(bytes).ok();
    let table = text.and_then(|text| text.parse::<toml::Table>().ok());
    let listed = table.as_ref().and_then(|table| table.get(key)?.as_array());
    listed.map_or(0, Vec::len)
}

#[cfg(test)]
mod tests {
    use super::super::picture_files::grey_png;
    use super::*;

    fn project_file(name: &str) -> Vec<u8> {
        std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
    }

    #[test]
    fn results_are_told_from_what_looks_like_them() {
        use ResultKind::*;
        let poses = format!("{}\n0,0,a,lost,0,,,,,,,,\n", poses_file::HEADER).into_bytes();
        let board = b"[[board]]\nname = \"t\"\nmarkers = []\n".to_vec();
        let printed = [anchor_block::PRINTED.as_bytes(), b".\n", &board].concat();
        let marked = |head: &str, mark: &str| format!("{head} {mark} ").into_bytes();
        let picture = grey_png(Path::new("p.png"), [1, 1], &[7]).unwrap();
        let cases: [(ResultKind, Vec<u8>); 12] = [
            (Poses, poses),
            (LearntBoard, board),
            (PrintedMarkers, printed),
            (Calibration, project_file("recordings/lamp/camera.toml")),
            (Video, marked("0000ftypisom", MADE_BY)),
            (Table, project_file("charts/shadows.csv")),
            (ChartDrawing, project_file("charts/shadows.svg")),
            (Svg, marked("<svg >", MADE_BY)),
            (ChartPicture, project_file("charts/shadows.png")),
            (Png, picture),
            (ChartsPage, project_file("charts/README.md")),
            (Pdf, marked("%PDF-1.7\n", "/Creator (gnomon)")),
        ];
        let kinds = [
            Poses,
            Detections,
            Stats,
            Response,
            Table,
            Measurements,
            ChartsPage,
            ChartPicture,
            ChartDrawing,
            Video,
            Png,
            Radiance,
            Pdf,
            Svg,
            LearntBoard,
            PrintedMarkers,
            Calibration,
            Frames,
            Session,
            Folder,
        ];
        for (kind, bytes) in &cases {
            assert!(kind.is(bytes), "{kind:?}");
            for other in kinds.iter().filter(|other| *other != kind) {
                // Printed markers can be learnt anew; each CSV is a table, each picture may be a chart's, and charts say that
                // gnomon made them.
                let both = [
                    (PrintedMarkers, LearntBoard),
                    (Poses, Table),
                    (Png, ChartPicture),
                    (ChartPicture, Png),
                    (Svg, ChartDrawing),
                ];
                let both = both.contains(&(*kind, *other));
                assert_eq!(other.is(bytes), both, "{kind:?} as {other:?}");
            }
        }
        for foreign in [
            "config/lamp.toml",
            "models/house.obj",
            "Cargo.toml",
            "README.md",
            "LICENSE",
            "recordings/lamp/video.mp4",
            "recordings/room/probe.hdr",
        ] {
            let bytes = project_file(foreign);
            assert!(kinds.iter().all(|kind| !kind.is(&bytes)), "{foreign}");
        }
        assert!(kinds.iter().all(|kind| kind.is(b"") != kind.is_folder()));
    }

    #[test]
    fn names_of_frames_are_known() {
        for (name, is) in [
            ("000012.png", true),
            ("000012_shadow_0.png", true),
            ("000012_depth.exr", true),
            ("00012.png", false),
            ("000012a.png", false),
            ("000012.jpg", false),
            ("äöü.png", false),
        ] {
            assert_eq!(is_frame_name(Path::new(name)), is, "{name}");
        }
    }
}
