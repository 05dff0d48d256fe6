//! Sessions as they are recorded: a folder that is whole at every moment.

mod scene_copy;
mod session_folder;
pub mod session_recorder;
pub mod session_writer;
