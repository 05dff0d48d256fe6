//! What a job reads and what it is to write, compared by file before it begins: no output is an input, two outputs are not
//! one, and what stands under an output's name is an older result of its kind, or is replaced because somebody said so.

use std::collections::HashSet;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

pub use super::file_conflict::FileConflict;
use super::file_identity::{FileIdentity, is_open_file, real_place};
use super::new_file::{ends_as_folder, is_stdout};
use super::result_kind::{ResultKind, is_frame_name};
use crate::scene::{CameraSettings, Codes, Family, Scene, SceneError};

/// A result that is told by more than its first bytes is read up to here; longer ones are none of ours.
const MOST_BYTES: u64 = 64 << 20;
/// Enough to tell a result from other files where its beginning is enough.
const FIRST_BYTES: u64 = 4096;

/// The files that results may take the place of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Replacing {
    /// Older results of their kind.
    #[default]
    OlderResults,
    /// Any file that the job does not read.
    Anything,
}

/// The files of one job.
#[derive(Debug, Default)]
pub struct JobFiles {
    inputs: Vec<PathBuf>,
    outputs: Vec<Output>,
    replacing: Replacing,
}

#[derive(Debug)]
struct Output {
    option: &'static str,
    path: PathBuf,
    kind: ResultKind,
}

/// A file or folder that is read.
struct InputFile<'a> {
    path: &'a Path,
    found: Found,
    /// Of a folder, those that lie in it: they may be known elsewhere by other names.
    files: HashSet<FileIdentity>,
}

/// A file that was found.
struct Found {
    identity: FileIdentity,
    /// Without links.
    place: PathBuf,
}

impl JobFiles {
    /// None yet.
    pub fn new(replacing: Replacing) -> Self {
        Self {
            replacing,
            ..Self::default()
        }
    }

    /// The job reads a file, or whatever is in a folder.
    pub fn reads(&mut self, path: &Path) {
        self.inputs.push(path.to_owned());
    }

    /// The job reads a scene with all that it names, which is read here.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn reads_scene(&mut self, path: &Path) -> Result<Scene, SceneError> {
        let text = Scene::read_text(path)?;
        let reading = Scene::read(path, &text);
        self.reads(path);
        self.inputs.extend(reading.files);
        reading.scene
    }

    /// The job reads a scene, which is read here, and plays something else.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn reads_scene_to_play_another(&mut self, path: &Path) -> Result<Scene, SceneError> {
        let before = self.inputs.len();
        let scene = self.reads_scene(path)?;
        let its_own = Path::new(&scene.camera.source);
        let mut position = 0;
        self.inputs.retain(|input| {
            position += 1;
            position <= before || input != its_own
        });
        Ok(scene)
    }

    /// The job plays a camera's source with its calibration.
    pub fn reads_camera(&mut self, camera: &CameraSettings) {
        self.reads(Path::new(&camera.source));
        self.inputs.extend(camera.calibration.clone());
    }

    /// The job reads a dictionary, if the family is from one.
    pub fn reads_family(&mut self, family: Family) {
        if let Codes::Own(dictionary) = family.codes() {
            self.reads(Path::new(dictionary.name()));
        }
    }

    /// The job writes what an option names.
    pub fn writes(&mut self, option: &'static str, path: &Path, kind: ResultKind) {
        self.outputs.push(Output {
            option,
            path: path.to_owned(),
            kind,
        });
    }

    /// Whether the job may begin.
    ///
    /// # Errors
    /// The first output that would do harm.
    pub fn check(&self) -> Result<(), FileConflict> {
        let inputs = self.inputs.iter().filter_map(|path| InputFile::at(path));
        let inputs: Vec<InputFile> = inputs.collect();
        let mut before: Vec<(&Output, Found)> = Vec::new();
        for output in &self.outputs {
            let found = Found::at(&output.path).map_err(|error| FileConflict::Io {
                path: output.path.clone(),
                error,
            })?;
            let frames = match output.kind {
                ResultKind::Frames => found.frames(),
                _ => Vec::new(),
            };
            for input in &inputs {
                output.differs_from_input(&found, &frames, input)?;
            }
            for (other, written) in &before {
                output.differs_from(&found, other, written)?;
            }
            output.has_room(&found, self.replacing)?;
            for frame in &frames {
                output.has_room_for_frame(frame, self.replacing)?;
            }
            before.push((output, found));
        }
        Ok(())
    }
}

impl<'a> InputFile<'a> {
    /// One that cannot be looked at is the business of whoever reads it.
    fn at(path: &'a Path) -> Option<Self> {
        let found = Found::at(path).ok()?;
        let entries = fs::read_dir(&found.place).into_iter().flatten().flatten();
        Some(Self {
            path,
            files: entries
                .filter_map(|entry| FileIdentity::of(&entry.path()).ok())
                .collect(),
            found,
        })
    }

    fn is(&self, file: &Found) -> bool {
        file.identity == self.found.identity || self.files.contains(&file.identity)
    }
}

impl Found {
    fn at(path: &Path) -> std::io::Result<Self> {
        if is_stdout(path) {
            return Ok(Self {
                identity: FileIdentity::of_stdout()?,
                place: path.to_owned(),
            });
        }
        Ok(Self {
            identity: FileIdentity::of(path)?,
            place: real_place(path)?,
        })
    }

    /// Whether it is that folder or lies in it, however deep; stdout lies in none.
    fn is_in(&self, folder: &FileIdentity) -> bool {
        if is_stdout(&self.place) {
            return self.identity == *folder;
        }
        let is_folder = |place: &Path| FileIdentity::of(place).is_ok_and(|found| found == *folder);
        self.identity == *folder || self.place.ancestors().skip(1).any(is_folder)
    }

    /// What a folder holds under names of frames, which new frames would replace.
    fn frames(&self) -> Vec<Self> {
        let entries = fs::read_dir(&self.place).into_iter().flatten().flatten();
        let frames = entries
            .map(|entry| entry.path())
            .filter(|path| is_frame_name(path));
        // A link leads to what is replaced, but the link's own name tells its kind.
        frames
            .filter_map(|path| {
                let identity = FileIdentity::of(&path).ok()?;
                Some(Self {
                    identity,
                    place: path,
                })
            })
            .collect()
    }

    /// Whether it lies in that folder under the name of a frame.
    fn is_frame_in(&self, folder: &FileIdentity) -> bool {
        let parent = self.place.parent().map(FileIdentity::of);
        is_frame_name(&self.place) && matches!(parent, Some(Ok(parent)) if parent == *folder)
    }
}

impl Output {
    /// `frames` are what is there already under names of frames.
    fn differs_from_input(
        &self,
        own: &Found,
        frames: &[Found],
        input: &InputFile,
    ) -> Result<(), FileConflict> {
        let output = self.option;
        let read = &input.found;
        if read.place.is_dir() && (own.is_in(&read.identity) || input.is(own)) {
            return Err(FileConflict::InFolder {
                output,
                path: self.path.clone(),
                folder: input.path.to_owned(),
            });
        }
        let becomes_frame = self.kind == ResultKind::Frames && read.is_frame_in(&own.identity);
        if input.is(own) || becomes_frame || frames.iter().any(|frame| input.is(frame)) {
            return Err(FileConflict::Read {
                output,
                path: self.path.clone(),
                input: input.path.to_owned(),
            });
        }
        Ok(())
    }

    fn differs_from(&self, own: &Found, other: &Self, its: &Found) -> Result<(), FileConflict> {
        let is_frame = |one: &Self, found: &Found, frame: &Found| {
            one.kind == ResultKind::Frames && frame.is_frame_in(&found.identity)
        };
        let is_below = |one: &Self, found: &Found, below: &Found| {
            !one.kind.is_folder()
                && below.place != found.place
                && below.place.starts_with(&found.place)
        };
        let is_one = own.identity == its.identity && !is_sink(&own.place);
        if is_one
            || is_frame(self, own, its)
            || is_frame(other, its, own)
            || is_below(self, own, its)
            || is_below(other, its, own)
        {
            return Err(FileConflict::Twice {
                output: self.option,
                path: self.path.clone(),
                other: other.option,
                other_path: other.path.clone(),
            });
        }
        Ok(())
    }

    /// Whether what is there, if anything, may go.
    fn has_room(&self, own: &Found, replacing: Replacing) -> Result<(), FileConflict> {
        let unfit = |message: &'static str| {
            Err(FileConflict::Unfit {
                output: self.option,
                path: self.path.clone(),
                message,
            })
        };
        if is_stdout(&self.path) {
            return match self.kind.is_text() {
                true => Ok(()),
                false => unfit("that stands for stdout, which takes text alone; give it a name"),
            };
        }
        if ends_as_folder(&self.path) && !self.kind.is_folder() {
            return unfit("a name that ends so is a folder's; a file is to be written");
        }
        let Ok(there) = fs::metadata(&own.place) else {
            let mut above = own.place.ancestors().skip(1);
            return match above.find(|folder| folder.exists()) {
                Some(folder) if !folder.is_dir() => unfit("what it is to lie in is no folder"),
                _ => Ok(()),
            };
        };
        if there.is_dir() != self.kind.is_folder() {
            return unfit(match there.is_dir() {
                true => "a folder is there; a file is to be written",
                false => "a folder is wanted, and what is there is none",
            });
        }
        if replacing == Replacing::Anything {
            return Ok(());
        }
        let may_go = there.is_dir()
            || !there.is_file()
            || is_open_file(&own.place)
            || is_of_kind(&own.place, self.kind);
        match may_go {
            true => Ok(()),
            false => Err(self.foreign(&self.path, self.kind)),
        }
    }

    /// Whether what has a frame's name may go.
    fn has_room_for_frame(&self, own: &Found, replacing: Replacing) -> Result<(), FileConflict> {
        if own.place.is_dir() {
            return Err(FileConflict::Unfit {
                output: self.option,
                path: own.place.clone(),
                message: "a folder is there; a file is to be written",
            });
        }
        let kind = frame_kind(&own.place);
        match replacing == Replacing::Anything || is_of_kind(&own.place, kind) {
            true => Ok(()),
            false => Err(self.foreign(&own.place, kind)),
        }
    }

    fn foreign(&self, path: &Path, kind: ResultKind) -> FileConflict {
        FileConflict::Foreign {
            output: self.option,
            path: path.to_owned(),
            expected: kind.name(),
        }
    }
}

/// Layers of depth are OpenEXR.
fn frame_kind(name: &Path) -> ResultKind {
    let is_exr = name.extension().is_some_and(|extension| extension == "exr");
    match is_exr {
        true => ResultKind::Radiance,
        false => ResultKind::Png,
    }
}

fn is_of_kind(path: &Path, kind: ResultKind) -> bool {
    let read = |most: u64| {
        let mut bytes = Vec::new();
        let file = fs::File::open(path).ok()?;
        file.take(most).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    };
    if !path.is_file() {
        return false;
    }
    let most = match kind.is_marked_early() {
        true => FIRST_BYTES,
        false => MOST_BYTES,
    };
    read(most).is_some_and(|bytes| kind.is(&bytes))
}

/// Whether what is written there is gone, so that it may be done twice: `/dev/null`, a terminal.
#[cfg(unix)]
fn is_sink(place: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    fs::metadata(place).is_ok_and(|there| there.file_type().is_char_device())
}

#[cfg(not(unix))]
fn is_sink(_place: &Path) -> bool {
    false
}
