//! Watches a scene's files. They are asked for their time and length twenty times a second: a handful of files costs
//! nothing, and it sees what events of the system miss (network drives, containers, files replaced by renaming, files
//! that are not there yet).

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::app::stopwatch::Stopwatch;
use crate::scene::{FileStamp, ModelCache, Reading, Scene, SceneError};

/// The text that the program itself knows the file to have.
pub(super) type KnownText = Arc<Mutex<String>>;

const PERIOD: Duration = Duration::from_millis(50);
/// Files that have not changed for so long are read.
const QUIET_SECS: f64 = 0.1;
/// A mistake is told once it has stood for so long: before that, the file may be half written.
const MISTAKE_QUIET_SECS: f64 = 0.3;

/// The scene's file was changed by someone else, and reads well.
#[derive(Debug)]
pub struct OutsideChange {
    /// The whole new text.
    pub text: String,
    /// The scene that it is.
    pub scene: Scene,
    /// The other files that it depends on.
    pub files: Vec<PathBuf>,
}

/// News of a scene's files.
#[derive(Debug)]
pub enum SceneNews {
    /// They give another scene.
    Changed(Box<OutsideChange>),
    /// They give none; the last one stays.
    Mistaken(SceneError),
}

/// A thread that watches a scene's files until it is dropped.
pub struct SceneWatch {
    news: Receiver<SceneNews>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl SceneWatch {
    pub(super) fn start(
        path: PathBuf,
        files: Vec<PathBuf>,
        (known, models): (KnownText, ModelCache),
        on_news: impl Fn() + Send + 'static,
    ) -> Self {
        let (sender, news) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let mut watched = Watched::new(path, files, models);
        let thread = thread::spawn(move || {
            run(&mut watched, &known, &stopped, &sender, &on_news);
        });
        Self {
            news,
            stop,
            thread: Some(thread),
        }
    }

    /// The next news, if there are any; in the order in which they came.
    pub fn next(&self) -> Option<SceneNews> {
        self.news.try_recv().ok()
    }
}

impl Drop for SceneWatch {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // Its panic was told where it happened.
            _ = thread.join();
        }
    }
}

fn run(
    watched: &mut Watched,
    known: &KnownText,
    stop: &AtomicBool,
    sender: &Sender<SceneNews>,
    on_news: &impl Fn(),
) {
    let clock = Stopwatch::clock();
    while !stop.load(Ordering::Relaxed) {
        if let Some(news) = watched.look(clock(), known) {
            if let SceneNews::Changed(change) = &news {
                *known.lock().unwrap_or_else(PoisonError::into_inner) = change.text.clone();
            }
            if sender.send(news).is_err() {
                return;
            }
            on_news();
        }
        thread::park_timeout(PERIOD);
    }
}

/// A scene's file and those that it depends on, and what became of them.
struct Watched {
    path: PathBuf,
    files: Vec<PathBuf>,
    /// Of the scene's file and the others, as they were read last; `None` before the first time.
    taken: Option<Stamps>,
    seen: Stamps,
    /// When they came to be as they were seen last.
    seen_at_secs: f64,
    /// A mistake that has not stood for long enough, with the files that it depends on.
    mistake: Option<(SceneError, Vec<PathBuf>)>,
    /// The mistake that was told last, unless the files have given a scene since.
    told: Option<SceneError>,
    models: ModelCache,
}

#[derive(Debug, Clone, PartialEq)]
struct Stamps {
    scene: FileStamp,
    others: Vec<FileStamp>,
}

impl Watched {
    fn new(path: PathBuf, files: Vec<PathBuf>, models: ModelCache) -> Self {
        let seen = stamps(&path, &files);
        Self {
            path,
            files,
            taken: None,
            seen,
            seen_at_secs: 0.0,
            mistake: None,
            told: None,
            models,
        }
    }

    /// Looks at the files.
    fn look(&mut self, now_secs: f64, known: &KnownText) -> Option<SceneNews> {
        let now = stamps(&self.path, &self.files);
        if now != self.seen {
            self.see(now, now_secs);
            return None;
        }
        if self.taken.as_ref() == Some(&self.seen) {
            return None;
        }
        let quiet_secs = now_secs - self.seen_at_secs;
        if quiet_secs < QUIET_SECS {
            return None;
        }
        if self.mistake.is_none() {
            let (text, ours) = {
                let known = known.lock().unwrap_or_else(PoisonError::into_inner);
                let text = Scene::read_text(&self.path);
                let ours = text.as_ref().is_ok_and(|text| *text == *known);
                (text, ours)
            };
            let others_stay = self
                .taken
                .as_ref()
                .is_none_or(|taken| taken.others == self.seen.others);
            // What the program wrote itself, it knows; but a mistake that was told has to be taken back.
            if ours && others_stay && self.told.is_none() {
                self.taken = Some(self.seen.clone());
                return None;
            }
            let reading = match &text {
                Ok(text) => Scene::read_with(&self.path, text, &self.models),
                Err(error) => Reading {
                    scene: Err(error.clone()),
                    files: self.files.clone(),
                    named: Vec::new(),
                },
            };
            let after = stamps(&self.path, &self.files);
            if after != self.seen {
                // Written while it was read.
                self.see(after, now_secs);
                return None;
            }
            match (reading.scene, text) {
                (Ok(scene), Ok(text)) => {
                    self.told = None;
                    self.take(reading.files.clone());
                    return Some(SceneNews::Changed(Box::new(OutsideChange {
                        text,
                        scene,
                        files: reading.files,
                    })));
                }
                (Err(error), _) | (_, Err(error)) => self.mistake = Some((error, reading.files)),
            }
        }
        if quiet_secs < MISTAKE_QUIET_SECS {
            return None;
        }
        let (error, files) = self.mistake.take()?;
        self.take(files);
        if self.told.as_ref() == Some(&error) {
            return None;
        }
        self.told = Some(error.clone());
        Some(SceneNews::Mistaken(error))
    }

    fn see(&mut self, stamps: Stamps, now_secs: f64) {
        self.seen = stamps;
        self.seen_at_secs = now_secs;
        self.mistake = None;
    }

    /// What was read is done with; from now on these are the other files.
    fn take(&mut self, files: Vec<PathBuf>) {
        if files != self.files {
            self.files = files;
            self.seen.others = stamps(&self.path, &self.files).others;
        }
        self.taken = Some(self.seen.clone());
    }
}

fn stamps(path: &Path, files: &[PathBuf]) -> Stamps {
    Stamps {
        scene: FileStamp::of(path),
        others: files.iter().map(|file| FileStamp::of(file)).collect(),
    }
}
