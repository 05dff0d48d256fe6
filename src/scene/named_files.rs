//! The files that a scene names: what each is, and where in the scene's text it stands.

use std::ops::Range;
use std::path::PathBuf;

use super::mesh_format::MeshFormat;

/// What a file is that a scene names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FileKind {
    /// What is played: a session, a video, a folder of pictures.
    Recording,
    /// The camera's calibration.
    Calibration,
    /// A phantom's or a virtual thing's mesh.
    Mesh,
    /// A mesh of the room.
    RoomMesh,
    /// A light probe's picture.
    Probe,
    /// A picture that lies on a surface.
    Picture,
    /// A dictionary of markers (YAML).
    Dictionary,
    /// Bundles of markers (YAML).
    Bundles,
}

impl FileKind {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Recording,
        Self::Calibration,
        Self::Mesh,
        Self::RoomMesh,
        Self::Probe,
        Self::Picture,
        Self::Dictionary,
        Self::Bundles,
    ];

    /// What is expected, in words.
    pub fn told(self) -> String {
        let told = match self {
            Self::Mesh | Self::RoomMesh => return MeshFormat::any_in_words(),
            Self::Recording => "a session, a video or a folder of pictures",
            Self::Calibration => "a calibration's file",
            Self::Probe => "a picture in linear radiance, .hdr or .exr",
            Self::Picture => "a picture: PNG, JPEG, WebP, TGA, BMP, TIFF, GIF",
            Self::Dictionary => "a dictionary of markers, .yml",
            Self::Bundles => "bundles of tags as apriltag_ros has them, .yaml",
        };
        told.to_owned()
    }
}

/// A file that a scene names, and that is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedFile {
    /// What it is.
    pub kind: FileKind,
    /// Where it was found.
    pub path: PathBuf,
    /// The bytes of the scene's text that name it: a text of TOML with its quotes.
    pub span: Range<usize>,
}
