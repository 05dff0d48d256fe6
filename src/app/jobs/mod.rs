//! The commands of the program but `live` and `chart`: a module each, none of which imports another.

pub mod board;
pub mod calibrate;
pub mod cameras;
pub mod check;
pub mod markers;
pub mod probe;
pub mod record;
pub mod replay;
pub mod track;
