//! Models that were read, kept while their files stay as they are: an edit of a scene's text need not read a large file again.

use std::any::Any;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::file_stamp::FileStamp;
use super::loading::Loading;

/// So many models stay, those that were asked for last.
const MOST_MODELS: usize = 64;

/// Models by their files; copies share them.
#[derive(Debug, Clone, Default)]
pub struct ModelCache {
    kept: Arc<Mutex<Vec<KeptModel>>>,
    /// Told of what is read by way of this copy.
    loading: Option<Loading>,
}

/// A model, and what it was read from.
#[derive(Debug)]
struct KeptModel {
    path: PathBuf,
    /// How it was taken, in words.
    reading: String,
    /// The model's file and all that were looked for besides, as they were.
    files: Vec<(PathBuf, FileStamp)>,
    loaded: Arc<dyn Any + Send + Sync>,
}

impl ModelCache {
    /// A copy that tells `loading` of what is read.
    pub fn telling(&self, loading: Loading) -> Self {
        Self {
            loading: Some(loading),
            ..self.clone()
        }
    }

    /// What is told of what is read.
    pub(super) fn loading(&self) -> Option<&Loading> {
        self.loading.as_ref()
    }

    /// A model that was read so, with the files that it depends on; `None` where it was not, or any of them has changed.
    pub(super) fn get<T: Any + Send + Sync>(
        &self,
        path: &Path,
        reading: &str,
    ) -> Option<(Arc<T>, Vec<PathBuf>)> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let index = kept
            .iter()
            .position(|model| model.path == path && model.reading == reading)?;
        let model = kept.remove(index);
        if model
            .files
            .iter()
            .any(|(file, then)| FileStamp::of(file) != *then)
        {
            return None;
        }
        let files = model.files.iter().map(|(file, _)| file.clone()).collect();
        let loaded = Arc::clone(&model.loaded).downcast().ok()?;
        kept.push(model);
        Some((loaded, files))
    }

    /// Keeps a model that was read from files, which `read` gives with the names of those besides its own; nothing is kept
    /// where one of them changes meanwhile.
    pub(super) fn keep<T: Any + Send + Sync, E>(
        &self,
        path: &Path,
        reading: &str,
        read: impl FnOnce() -> Result<(T, Vec<PathBuf>), E>,
    ) -> Result<Arc<T>, E> {
        let before = FileStamp::of(path);
        let (loaded, besides) = read()?;
        let loaded = Arc::new(loaded);
        let own = (path.to_owned(), before);
        let besides = besides.into_iter().map(|file| {
            let now = FileStamp::of(&file);
            (file, now)
        });
        let files: Vec<_> = std::iter::once(own).chain(besides).collect();
        if FileStamp::of(path) == files[0].1 {
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if kept.len() >= MOST_MODELS {
                kept.remove(0);
            }
            kept.push(KeptModel {
                path: path.to_owned(),
                reading: reading.to_owned(),
                files,
                loaded: loaded.clone(),
            });
        }
        Ok(loaded)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use std::fs;

    #[test]
    fn a_model_is_read_once_and_again_when_any_of_its_files_changes() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str| folder.path().join(name);
        let scene = "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 0\nsize_m = 0.05\n\
                     [[virtual]]\nname = \"t\"\nmesh = \"t.obj\"\n";
        let mesh = "mtllib t.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        fs::write(file("t.obj"), mesh).expect("written");
        let models = ModelCache::default();
        let read = || {
            let reading = Scene::read_with(&file("scene.toml"), scene, &models);
            let scene = reading.scene.expect("a scene");
            (scene.virtuals[0].materials[0].albedo.x, reading.files)
        };
        let count = || models.kept.lock().expect("nobody panicked").len();
        let first = read();
        assert!(first.1.contains(&file("t.mtl")), "{:?}", first.1);
        assert_eq!((read(), count()), (first.clone(), 1));
        // What was looked for comes.
        fs::write(file("t.mtl"), "newmtl a\nKd 0.25 0.25 0.25\n").expect("written");
        assert_eq!(read().0, 0.25);
        assert_eq!((read().0, count()), (0.25, 1));
        // What was there becomes another.
        fs::write(file("t.mtl"), "newmtl a\nKd 0.125 0.25 0.25\n").expect("written");
        assert_eq!(read().0, 0.125);
        // A mistake is not kept.
        fs::write(file("t.obj"), "v 0 0 0\n").expect("written");
        let broken = Scene::read_with(&file("scene.toml"), scene, &models).scene;
        assert!(broken.is_err() && count() == 0);
        fs::write(file("t.obj"), mesh).expect("written");
        assert_eq!(read().0, 0.125);
    }
}
