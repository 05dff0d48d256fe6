//! The marks by which files are known to be gnomon's own.

/// The program's name, where a format has a field for it.
pub const SOFTWARE: &str = "gnomon";
/// The comment of videos and drawings.
pub const MADE_BY: &str = "made by gnomon";
