//! What is asked of the scene, and what becomes of its file.

use std::path::Path;
use std::sync::Arc;

use super::super::beginning::{plan_of, same_camera};
use super::super::command::{Clicks, SceneCommand, Selected, WindowCommand};
use super::super::demonstration::{self, Demonstration};
use super::super::shadow_clicks::{self, ShadowClicks};
use super::super::window_state::WindowState;
use super::LiveSession;
use super::states::{Origin, PictureState, SceneState, watch};
use crate::app::authoring::{Edit, EditError, SceneDocument, SceneNews};
use crate::app::window::notices::Weight;

impl LiveSession {
    /// Does what is asked of the scene, of which `state` says what is selected. What goes wrong is told as a notice.
    pub fn edit_scene(&mut self, command: SceneCommand, state: &WindowState) {
        match command {
            SceneCommand::Preview(edit) => self.preview(&edit),
            SceneCommand::Commit(Edit::RemoveLight(index)) => {
                self.remove(&Selected::Light(index), state.selected.as_ref());
            }
            SceneCommand::Commit(edit @ Edit::AddLight(_)) => {
                if self.commit(&edit) {
                    let last = self.scene().map_or(0, |scene| scene.lights.len() - 1);
                    self.selection = Some(WindowCommand::Select(Some(Selected::Light(last))));
                }
            }
            SceneCommand::Commit(edit) => _ = self.commit(&edit),
            SceneCommand::EndPreview => {
                if let Some(scene) = self.scene.open_mut() {
                    scene.previewed = None;
                    scene.document.end_preview();
                    self.scene_changed(true);
                }
            }
            SceneCommand::Undo => _ = self.edit(SceneDocument::undo),
            SceneCommand::Redo => _ = self.edit(SceneDocument::redo),
            SceneCommand::Clicks(clicks) => self.take_clicks(clicks, state),
            SceneCommand::Demonstrate { id, size_m } => self.demonstrate(id, size_m),
            SceneCommand::Save(path) => self.save(&path),
            SceneCommand::ToggleSelected => {
                if let (Some(Selected::Thing(thing)), Some(scene)) = (&state.selected, self.scene())
                {
                    let mut things = scene.phantoms.iter().chain(&scene.virtuals);
                    let found = things.find(|found| found.name == *thing);
                    if let Some(visible) = found.map(|found| !found.visible) {
                        let thing = thing.clone();
                        self.commit(&Edit::Show { thing, visible });
                    }
                }
            }
            SceneCommand::RemoveSelected => {
                if let Some(selected) = &state.selected {
                    self.remove(selected, Some(selected));
                }
            }
            SceneCommand::Add(wanted) => self.add(&wanted),
            SceneCommand::GiveUpReading(name) => self.give_up_reading(&name),
            SceneCommand::DuplicateSelected => {
                if let Some(Selected::Thing(name)) = &state.selected {
                    self.duplicate(name);
                }
            }
            SceneCommand::Rename { thing, name } => self.rename(&thing, &name),
        }
    }

    pub(super) fn preview(&mut self, edit: &Edit) {
        if let Some(scene) = self.scene.open_mut()
            && scene.document.preview(edit)
        {
            scene.previewed = Some(edit.clone());
            self.scene_changed(false);
        }
    }

    /// Makes an edit; tells whether it could be made.
    pub(super) fn commit(&mut self, edit: &Edit) -> bool {
        self.edit(|document| document.commit(edit))
    }

    pub(super) fn edit(
        &mut self,
        change: impl FnOnce(&mut SceneDocument) -> Result<(), EditError>,
    ) -> bool {
        let Some(scene) = self.scene.open_mut() else {
            return false;
        };
        scene.previewed = None;
        let changed = change(&mut scene.document);
        let is_done = changed.is_ok();
        if let Err(error) = changed {
            self.tell(Weight::Trouble, error.to_string());
        }
        self.scene_changed(true);
        is_done
    }

    /// The scene is another: what depends on it follows.
    pub(super) fn scene_changed(&mut self, lasting: bool) {
        let Some(document) = self.document() else {
            return;
        };
        let scene = Arc::new(document.scene().clone());
        self.pipeline.set_plan(plan_of(Some(document)));
        self.canvas.set_scene(scene, lasting);
        self.picture.draw_again();
    }

    pub(super) fn take_scene_news(&mut self) {
        while let Some(scene) = self.scene.open_mut() {
            match scene.watch.next() {
                None => return,
                Some(SceneNews::Mistaken(error)) => self.notices.scene = Some(error.to_string()),
                Some(SceneNews::Changed(change)) => {
                    if !scene.document.take(*change) {
                        continue;
                    }
                    scene.watch = watch(&scene.document, &self.wake);
                    let is_same_camera = same_camera(&scene.document.scene().camera, &self.camera);
                    self.notices.scene = None;
                    self.scene_changed(true);
                    if !is_same_camera {
                        self.tell(
                            Weight::Trouble,
                            "The scene's [camera] was changed: start again to take it.",
                        );
                    }
                }
            }
        }
    }

    pub(super) fn take_clicks(&mut self, step: Clicks, state: &WindowState) {
        let (Some(document), Some(tracked)) = (self.document(), self.picture()) else {
            return self.tell(Weight::Trouble, "There is no picture of the scene yet.");
        };
        match step {
            Clicks::Begin => {
                let clicks = ShadowClicks::begin(document.scene(), tracked);
                let sees_world = clicks.is_some();
                self.picture.set_clicks(clicks);
                if !sees_world {
                    self.tell(Weight::Trouble, "The world's markers are not seen.");
                }
            }
            Clicks::Cancel => self.picture.set_clicks(None),
            Clicks::Find(freedom) => {
                let clicks = self.clicks();
                match clicks.map(|clicks| clicks.find(tracked, freedom)) {
                    None => {}
                    Some(Err(reason)) => self.tell(Weight::Trouble, reason),
                    Some(Ok(found)) => {
                        let index = match state.selected {
                            Some(Selected::Light(index)) => index,
                            _ => 0,
                        };
                        let edits = shadow_clicks::edits(document.scene(), index, &found);
                        self.picture.set_clicks(None);
                        for edit in edits {
                            self.commit(&edit);
                        }
                        self.tell(Weight::Done, shadow_clicks::in_words(&found));
                    }
                }
            }
            Clicks::At(_) | Clicks::TakeBack => {
                let PictureState::FindingLight(_, clicks) = &mut self.picture else {
                    return;
                };
                match step {
                    Clicks::At(pixel) => {
                        if let Err(reason) = clicks.click(pixel) {
                            self.tell(Weight::Trouble, reason);
                        }
                    }
                    _ => clicks.take_back(),
                }
            }
        }
    }

    pub(super) fn demonstrate(&mut self, id: u32, size_m: f64) {
        let made = Demonstration::make(&self.camera, id, size_m)
            .map_err(anyhow::Error::from)
            .and_then(|made| Ok((SceneDocument::open(&made.path())?, made)));
        match made {
            Ok((document, made)) => {
                let origin = Origin::Unsaved { folder: made };
                self.scene = SceneState::opened(document, origin, &self.wake);
                self.scene_changed(true);
            }
            Err(error) => self.tell(Weight::Trouble, format!("{error:#}")),
        }
    }

    pub(super) fn save(&mut self, path: &Path) {
        let Some(document) = self.document() else {
            return;
        };
        let saved = demonstration::save(document.text(), path)
            .map_err(anyhow::Error::from)
            .and_then(|()| Ok(SceneDocument::open(path)?));
        match saved {
            Ok(document) => {
                self.scene = SceneState::opened(document, Origin::Saved, &self.wake);
                self.scene_changed(true);
                self.tell(Weight::Done, format!("{} saved", path.display()));
            }
            Err(error) => self.tell(Weight::Trouble, format!("{error:#}")),
        }
    }
}
