//! Files that jobs read and write: what they may take the place of, how they come whole to their names, their formats.

pub(crate) mod anchor_block;
pub mod detections_file;
mod encoder;
mod file_conflict;
mod file_identity;
mod frame_folder;
pub mod frame_sink;
pub mod job_files;
pub mod layer_files;
mod locked_folder;
pub mod made_by;
pub mod new_file;
pub mod output_error;
pub mod picture_files;
pub mod poses_file;
pub mod result_kind;
mod stamped_frames;
pub mod unfinished;
pub mod video_writer;

pub(crate) use file_identity::is_at;
pub(crate) use locked_folder::LockedFolder;
