//! A scene as it is written: edits that keep the file's own words, their history, and what changes the file from outside.

mod document;
mod edit;
mod history;
mod light_from_picture;
mod numbers;
mod spliced;
mod watch;
mod written;

pub use document::{EditError, SceneDocument};
pub use edit::{AnimationName, Edit, NewForm, NewThing};
pub use light_from_picture::{
    FoundLight, LightNotFound, PickedVertex, PicturedThings, ShadowClick,
};
pub use watch::{OutsideChange, SceneNews, SceneWatch};
pub use written::{ThingPlace, Unfit};
