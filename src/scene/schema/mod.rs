//! How the scene's format is described: a [`key::Key`] says all that is known of one key, a [`section::Section`] has a
//! table's keys.
//!
//! The entries stand beside what they become: `camera.rs`, `tracking.rs`, `shadows.rs`, `anchors.rs`, `objects.rs`,
//! `lights.rs`, `probe.rs`; `format.rs` lists the sections. From an entry come the reader and its messages, the reference
//! (`config/reference.toml`), what a quality sets, how an edit is written, a field's range in the panel, the option of the
//! command line of the same name, and what a file is that it names.

pub mod choice;
pub mod key;
#[macro_use]
pub mod macros;
pub mod section;
pub mod settings;
pub mod values;
