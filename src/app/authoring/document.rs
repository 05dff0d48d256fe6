//! A scene and its text, kept as one: what is edited is written into the file, what the file becomes is read again.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::edit::Edit;
use super::history::{EditStep, History};
use super::watch::{KnownText, OutsideChange, SceneWatch};
use super::written::{ThingPlace, Unfit, place_of, touched_by, with_edit};
use crate::app::files::output_error::OutputError;
use crate::app::files::picture_files::write_text;
use crate::scene::{Loading, ModelCache, Scene, SceneError};

/// What an outside change is called in the history.
const OUTSIDE: &str = "change of the file from outside";

/// A scene that is edited, with its file.
pub struct SceneDocument {
    path: PathBuf,
    text: String,
    scene: Scene,
    /// The scene while something is being dragged.
    shown: Option<Scene>,
    files: Vec<PathBuf>,
    history: History,
    known: KnownText,
    /// Read once, whatever is edited.
    models: ModelCache,
}

/// Why an edit was not made; the scene and its file are as they were, but for what [`EditError::ChangedOutside`] says.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// The scene has no such thing, or it does not move so.
    #[error(transparent)]
    Unfit(#[from] Unfit),
    /// What the edit gives is no scene.
    #[error("{0}")]
    Scene(#[from] SceneError),
    /// The file has become something else meanwhile, which is what the scene now is.
    #[error("{path}: changed from outside meanwhile, and that is kept; not done: {label}")]
    ChangedOutside {
        /// The scene's file.
        path: PathBuf,
        /// What was to be done.
        label: String,
    },
    /// Somebody has made a mistake in the file meanwhile.
    #[error("not done: {label}; the file has a mistake: {mistake}")]
    MistakenFile {
        /// What was to be done.
        label: String,
        /// The mistake.
        mistake: SceneError,
    },
    /// The file could not be written.
    #[error(transparent)]
    NotWritten(#[from] OutputError),
    /// The file may not be written.
    #[error("{path}: the file is read-only")]
    ReadOnly {
        /// The scene's file.
        path: PathBuf,
    },
}

impl SceneDocument {
    /// Reads a scene's file.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        Self::open_telling(path, Loading::default())
    }

    /// The same, telling `loading` how far its models are.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn open_telling(path: &Path, loading: Loading) -> Result<Self, SceneError> {
        let text = Scene::read_text(path)?;
        let models = ModelCache::default();
        let reading = Scene::read_with(path, &text, &models.telling(loading));
        Ok(Self {
            models,
            path: path.to_owned(),
            scene: reading.scene?,
            shown: None,
            files: reading.files,
            history: History::default(),
            known: Arc::new(Mutex::new(text.clone())),
            text,
        })
    }

    /// Watches the scene's files from now on; `on_news` is called, from another thread, whenever there are news.
    pub fn watch(&self, on_news: impl Fn() + Send + 'static) -> SceneWatch {
        SceneWatch::start(
            self.path.clone(),
            self.files.clone(),
            (Arc::clone(&self.known), self.models.clone()),
            on_news,
        )
    }

    /// The scene's file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Every other file that the scene depends on.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// The text as it is in the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The scene, with what is being dragged where it is.
    pub fn scene(&self) -> &Scene {
        self.shown.as_ref().unwrap_or(&self.scene)
    }

    /// Where a thing stands, in the numbers of the file; `None` where the scene has no such thing.
    pub fn place(&self, thing: &str) -> Option<ThingPlace> {
        place_of(&self.text, thing)
    }

    /// Shows an edit without making it: for as long as a drag lasts. False where that cannot be, as for a new thing.
    pub fn preview(&mut self, edit: &Edit) -> bool {
        let shown = self.shown.get_or_insert_with(|| self.scene.clone());
        edit.show_in(shown)
    }

    /// Ends what [`SceneDocument::preview`] shows.
    pub fn end_preview(&mut self) {
        self.shown = None;
    }

    /// Makes an edit, one step of the history, and writes it into the file. An edit that changes nothing is no step.
    ///
    /// Where the file was changed from outside meanwhile, the edit is made in what it became; unless that change was of
    /// the same thing: then it is the one that stays, and the error says so.
    ///
    /// # Errors
    /// What kept it from being made.
    pub fn commit(&mut self, edit: &Edit) -> Result<(), EditError> {
        self.shown = None;
        let before = touched_by(&self.text, edit);
        let changed = self.follow_file(|| edit.label())?;
        if changed && touched_by(&self.text, edit) != before {
            return Err(self.changed_outside(edit.label()));
        }
        let after = with_edit(&self.text, &self.scene, edit)?;
        if after == self.text {
            return Ok(());
        }
        let before = self.text.clone();
        self.put(after.clone())?;
        self.history.push(EditStep {
            label: edit.label(),
            before,
            after,
        });
        Ok(())
    }

    /// Reads on another thread what an edit would give, so that [`commit`](Self::commit) finds its models read. `done` gets the
    /// scene that it gives, or its mistake; `loading` tells how far it is.
    ///
    /// # Errors
    /// The edit does not fit the scene.
    pub fn read_ahead(
        &self,
        edit: &Edit,
        loading: Loading,
        done: impl FnOnce(Result<Scene, EditError>) + Send + 'static,
    ) -> Result<(), EditError> {
        let text = with_edit(&self.text, &self.scene, edit)?;
        let (path, models) = (self.path.clone(), self.models.telling(loading));
        std::thread::spawn(move || {
            let reading = Scene::read_with(&path, &text, &models);
            done(reading.scene.map_err(EditError::from));
        });
        Ok(())
    }

    /// What [`SceneDocument::undo`] would take back.
    pub fn next_undo(&self) -> Option<&str> {
        self.history.next_undo().map(|step| step.label.as_str())
    }

    /// What [`SceneDocument::redo`] would do again.
    pub fn next_redo(&self) -> Option<&str> {
        self.history.next_redo().map(|step| step.label.as_str())
    }

    /// Takes the last step back, in the file as well. Does nothing where there is none.
    ///
    /// # Errors
    /// The file was changed from outside, or the step cannot be taken back.
    pub fn undo(&mut self) -> Result<(), EditError> {
        let Some(EditStep { label, before, .. }) = self.history.next_undo().cloned() else {
            return Ok(());
        };
        self.step_to(before, format!("undo {label}"))?;
        self.history.undid();
        Ok(())
    }

    /// Takes again the last step that was taken back, in the file as well. Does nothing where there is none.
    ///
    /// # Errors
    /// The file was changed from outside, or the step cannot be taken.
    pub fn redo(&mut self) -> Result<(), EditError> {
        let Some(EditStep { label, after, .. }) = self.history.next_redo().cloned() else {
            return Ok(());
        };
        self.step_to(after, format!("redo {label}"))?;
        self.history.redid();
        Ok(())
    }

    /// Takes what the file was changed to from outside; a step of the history, so nothing that was there before is lost.
    /// Tells whether: news that the file has outlived are passed over.
    pub fn take(&mut self, change: OutsideChange) -> bool {
        if Scene::read_text(&self.path).ok().as_ref() != Some(&change.text) {
            return false;
        }
        self.accept(change);
        true
    }

    fn accept(&mut self, change: OutsideChange) {
        self.shown = None;
        if change.text != self.text {
            self.history.push(EditStep {
                label: OUTSIDE.to_owned(),
                before: std::mem::replace(&mut self.text, change.text.clone()),
                after: change.text,
            });
        }
        self.scene = change.scene;
        self.files = change.files;
    }

    fn step_to(&mut self, text: String, label: String) -> Result<(), EditError> {
        self.shown = None;
        if self.follow_file(|| label.clone())? {
            return Err(self.changed_outside(label));
        }
        self.put(text)
    }

    /// Takes what the file has become if someone changed it, before what `label` says is done; tells whether.
    fn follow_file(&mut self, label: impl Fn() -> String) -> Result<bool, EditError> {
        let text = Scene::read_text(&self.path)?;
        if text == self.text {
            return Ok(false);
        }
        let reading = Scene::read_with(&self.path, &text, &self.models);
        let scene = reading.scene.map_err(|mistake| EditError::MistakenFile {
            label: label(),
            mistake,
        })?;
        *self.known.lock().unwrap_or_else(PoisonError::into_inner) = text.clone();
        self.accept(OutsideChange {
            text,
            scene,
            files: reading.files,
        });
        Ok(true)
    }

    /// Makes a text the scene's, in memory and in the file.
    fn put(&mut self, text: String) -> Result<(), EditError> {
        let reading = Scene::read_with(&self.path, &text, &self.models);
        let scene = reading.scene?;
        {
            // Held while the file changes, so that the watch never sees one without the other.
            let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
            replace_file(&self.path, &text)?;
            known.clone_from(&text);
        }
        self.scene = scene;
        self.files = reading.files;
        self.text = text;
        Ok(())
    }

    fn changed_outside(&self, label: String) -> EditError {
        EditError::ChangedOutside {
            path: self.path.clone(),
            label,
        }
    }
}

/// Writes the file a link leads to, whole or not at all, unless it may not be written.
fn replace_file(path: &Path, text: &str) -> Result<(), EditError> {
    let there = std::fs::metadata(path).map_err(|error| OutputError::Io {
        path: path.to_owned(),
        error,
    })?;
    if there.permissions().readonly() {
        return Err(EditError::ReadOnly {
            path: path.to_owned(),
        });
    }
    write_text(path, text)?;
    Ok(())
}
