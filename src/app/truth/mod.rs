//! Recordings of which everything is known: true poses, and what the camera would have seen with the virtual things
//! really there. Charts and tests hold gnomon against them.

mod comparison;
pub mod photographs;
mod picture;
mod pose_error;
mod poses;
pub mod ray_cast;
pub mod sheets;

pub use comparison::{
    Drawn, Errors, FACES_AWAY, ShadowErrors, Truth, around, changed_by, compare, draw, edges,
    key_frames,
};
pub use picture::LinearPicture;
pub use pose_error::{PoseErrors, shifts_px};
pub use poses::{TruePoses, affine};
