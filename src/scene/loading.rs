//! How far the reading of a model has come, told to whoever waits beside it, and the wish that it end.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What is done with a model's file, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum LoadStage {
    /// Nothing yet.
    Waiting,
    /// Its bytes are read.
    Reading,
    /// Its triangles and pictures are unpacked.
    Unpacking,
    /// What belongs together is joined, and what is open mended.
    Joining,
    /// It is there.
    Ready,
}

impl LoadStage {
    const ALL: [Self; 5] = [
        Self::Waiting,
        Self::Reading,
        Self::Unpacking,
        Self::Joining,
        Self::Ready,
    ];

    /// In words.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Waiting => "waits",
            Self::Reading => "reads its file",
            Self::Unpacking => "unpacks triangles and pictures",
            Self::Joining => "joins its triangles",
            Self::Ready => "is read",
        }
    }

    /// The part that is behind it, 0 to 1, as it mostly is of large models with pictures.
    pub fn part(self) -> f32 {
        match self {
            Self::Waiting => 0.0,
            Self::Reading => 0.05,
            Self::Unpacking => 0.1,
            Self::Joining => 0.6,
            Self::Ready => 1.0,
        }
    }
}

/// The reading of models, one after the other; copies are of the same.
#[derive(Debug, Clone, Default)]
pub struct Loading(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// Name of the file.
    file: Mutex<String>,
    stage: AtomicU8,
    is_given_up: AtomicBool,
}

impl Loading {
    /// What it is at.
    pub fn stage(&self) -> LoadStage {
        LoadStage::ALL[usize::from(self.0.stage.load(Ordering::Relaxed))]
    }

    /// What it is at, in words.
    pub fn in_words(&self) -> String {
        let file = self.0.file.lock().unwrap_or_else(PoisonError::into_inner);
        format!("{file} {}", self.stage().in_words())
    }

    /// It is at something else of a file now. False where nobody waits for it any more.
    pub(super) fn enter(&self, path: &Path, stage: LoadStage) -> bool {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        *self.0.file.lock().unwrap_or_else(PoisonError::into_inner) = name.into_owned();
        self.0.stage.store(stage as u8, Ordering::Relaxed);
        !self.is_given_up()
    }

    /// Nobody waits for it any more: it ends as soon as it may.
    pub fn give_up(&self) {
        self.0.is_given_up.store(true, Ordering::Relaxed);
    }

    /// Whether nobody waits for it any more.
    pub fn is_given_up(&self) -> bool {
        self.0.is_given_up.load(Ordering::Relaxed)
    }
}
