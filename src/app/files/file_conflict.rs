//! Why a job is not begun because of the files that it reads and writes.

use std::path::PathBuf;

/// The reason why a job is not begun: nothing has been written.
#[derive(Debug, thiserror::Error)]
pub enum FileConflict {
    /// An output would be written over an input.
    #[error("{output} {}: that is {}, which is read; write elsewhere", path.display(), input.display())]
    Read {
        /// The option that names the output.
        output: &'static str,
        /// What it names.
        path: PathBuf,
        /// The input.
        input: PathBuf,
    },
    /// An output would be written into a folder that is an input.
    #[error("{output} {}: that is, or lies in, {}, which is read; write elsewhere", path.display(), folder.display())]
    InFolder {
        /// The option that names the output.
        output: &'static str,
        /// What it names.
        path: PathBuf,
        /// The folder.
        folder: PathBuf,
    },
    /// Two outputs would be one.
    #[error("{output} {} and {other} {}: one would be written over the other", path.display(), other_path.display())]
    Twice {
        /// The option that names the one.
        output: &'static str,
        /// What it names.
        path: PathBuf,
        /// The option that names the other.
        other: &'static str,
        /// What that names.
        other_path: PathBuf,
    },
    /// Something else stands there.
    #[error(
        "{output} {}: what is there is not {expected}; write elsewhere, or replace it with --force",
        path.display()
    )]
    Foreign {
        /// The option that names the output.
        output: &'static str,
        /// What it names.
        path: PathBuf,
        /// What might be replaced.
        expected: &'static str,
    },
    /// A folder where a file is to be, or the other way round.
    #[error("{output} {}: {message}", path.display())]
    Unfit {
        /// The option that names the output.
        output: &'static str,
        /// What it names.
        path: PathBuf,
        /// What is wrong.
        message: &'static str,
    },
    /// The system does not tell what is there.
    #[error("{}: {error}", path.display())]
    Io {
        /// What was looked at.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
}
