//! What all measurements share: the recordings, the graphics adapter, how long to take, and when to stop.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result, ensure};

use super::measured::program_number;
use crate::render::Gpu;
use crate::scene::Scene;

/// The surroundings of a measurement: device, recordings, whether it is to stop.
pub struct Lab<'a> {
    /// Fewer rounds, for a look.
    pub quick: bool,
    /// A folder with more recordings.
    pub sessions: Option<PathBuf>,
    /// Part of the graphics adapter's name.
    pub adapter: Option<String>,
    /// Another one for another build of the program.
    pub program: u64,
    gpu: OnceCell<Arc<Gpu>>,
    stop: &'a AtomicBool,
}

/// A recording of which everything is known, with the scene that plays it.
#[derive(Debug, Clone)]
pub struct Recording {
    /// As charts name it.
    pub name: String,
    /// Video, calibration and truth.
    pub folder: PathBuf,
    /// The scene file.
    pub scene: PathBuf,
}

impl<'a> Lab<'a> {
    /// A lab in the project's folder, which is the current one.
    ///
    /// # Errors
    /// The program's file cannot be read.
    pub fn new(
        quick: bool,
        sessions: Option<PathBuf>,
        adapter: Option<String>,
        stop: &'a AtomicBool,
    ) -> Result<Self> {
        Ok(Self {
            quick,
            sessions,
            adapter,
            program: program_number()?,
            gpu: OnceCell::new(),
            stop,
        })
    }

    /// The graphics adapter, opened by the first measurement that needs one.
    ///
    /// # Errors
    /// There is none.
    pub fn gpu(&self) -> Result<Arc<Gpu>> {
        if let Some(gpu) = self.gpu.get() {
            return Ok(Arc::clone(gpu));
        }
        let gpu = Arc::new(Gpu::open(self.adapter.as_deref())?);
        Ok(Arc::clone(self.gpu.get_or_init(|| gpu)))
    }

    /// Whether measuring is to end.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// How often what takes time is timed.
    pub fn rounds(&self) -> usize {
        if self.quick { 1 } else { 5 }
    }

    /// How many directions of an error are averaged at most.
    pub fn directions(&self) -> usize {
        if self.quick { 1 } else { usize::MAX }
    }

    /// Of the values of what is varied, every so many-th is measured.
    pub fn step(&self) -> usize {
        if self.quick { 2 } else { 1 }
    }

    /// The recordings that ship, then those of `sessions`, each of which a scene file of `config/` plays.
    ///
    /// # Errors
    /// The current folder is not the project's, or a folder cannot be read.
    pub fn recordings(&self) -> Result<Vec<Recording>> {
        let mut found = recordings_in(Path::new("recordings"), "")?;
        ensure!(
            !found.is_empty(),
            "no recordings/ with truth.json here: charts are measured in the project's own folder"
        );
        if let Some(folder) = &self.sessions {
            let more = recordings_in(folder, " (session)")?;
            ensure!(
                !more.is_empty(),
                "--sessions {}: no session with truth.json there that a scene of config/ plays",
                folder.display()
            );
            found.extend(more);
        }
        Ok(found)
    }

    /// Their names.
    ///
    /// # Errors
    /// As [`Lab::recordings`].
    pub fn recording_names(&self) -> Result<Vec<String>> {
        let recordings = self.recordings()?.into_iter();
        Ok(recordings.map(|recording| recording.name).collect())
    }

    /// Folders and scene files of all of them.
    ///
    /// # Errors
    /// As [`Lab::recordings`].
    pub fn recording_inputs(&self) -> Result<Vec<PathBuf>> {
        let recordings = self.recordings()?.into_iter();
        Ok(recordings
            .flat_map(|recording| [recording.folder, recording.scene])
            .collect())
    }

    /// The recording of a name.
    ///
    /// # Errors
    /// There is none.
    pub fn recording(&self, name: &str) -> Result<Recording> {
        let mut all = self.recordings()?.into_iter();
        all.find(|recording| recording.name == name)
            .with_context(|| format!("no recording {name}"))
    }
}

impl Recording {
    /// The scene that plays it, from wherever it lies.
    ///
    /// # Errors
    /// A scene that cannot be read.
    pub fn load_scene(&self) -> Result<Scene> {
        let mut scene = Scene::load(&self.scene)?;
        let folder = self.folder.to_str().context("the path is not UTF-8 text")?;
        scene.camera.source = folder.to_owned();
        Ok(scene)
    }
}

fn recordings_in(folder: &Path, suffix: &str) -> Result<Vec<Recording>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut found = Vec::new();
    for entry in entries {
        let folder = entry?.path();
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let scene = Path::new("config").join(format!("{name}.toml"));
        if folder.join("truth.json").is_file() && scene.is_file() {
            found.push(Recording {
                name: format!("{name}{suffix}"),
                scene,
                folder: folder.clone(),
            });
        }
    }
    // The demo's first.
    found.sort_by_key(|recording| (!recording.name.starts_with("lamp"), recording.name.clone()));
    Ok(found)
}
