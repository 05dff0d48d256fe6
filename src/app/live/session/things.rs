//! Things come, are copied and renamed: models are read beside the picture, which goes on meanwhile.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use glam::DVec3;

use super::super::adding::{
    self, WantedShape, WantedThing, allowed_name, free_name, free_place, named_file,
};
use super::super::command::{Selected, WindowCommand};
use super::LiveSession;
use crate::app::authoring::{Edit, EditError, NewForm, NewThing, SceneDocument};
use crate::app::window::notices::Weight;
use crate::scene::{LoadStage, Loading, Scene};

/// How far beside a thing its copy stands, metres.
const COPY_BESIDE: DVec3 = DVec3::new(0.06, 0.0, 0.0);

/// A model that is being read.
pub(super) struct ReadAhead {
    thing: NewThing,
    loading: Loading,
    given: Receiver<Result<Scene, EditError>>,
}

impl LiveSession {
    /// Adds a thing, at once or when its model is read.
    pub(super) fn add(&mut self, wanted: &WantedThing) {
        let Some(scene) = self.scene.open_mut() else {
            return self.tell(Weight::Trouble, "There is no scene yet to add anything to.");
        };
        let document = &scene.document;
        let folder = document.path().parent().unwrap_or(Path::new(""));
        // (What is being read has its name already.)
        let is_read = |name: &str| scene.reading.iter().any(|other| other.thing.name == name);
        let thing = wanted.in_scene(document.scene(), folder, is_read);
        match &wanted.shape {
            WantedShape::Model(file) => match adding::no_model(&named_file(folder, file)) {
                None => self.read(thing),
                Some(reason) => self.tell(Weight::Trouble, reason),
            },
            _ => self.add_thing(thing),
        }
    }

    /// Begins to read a thing's model beside the picture.
    fn read(&mut self, thing: NewThing) {
        let wake = Arc::clone(&self.wake);
        let Some(scene) = self.scene.open_mut() else {
            return;
        };
        let (giver, given) = channel();
        let loading = Loading::default();
        let edit = Edit::AddThing(thing.clone());
        let read = scene
            .document
            .read_ahead(&edit, loading.clone(), move |read| {
                // (Nobody waits for it where the window has closed meanwhile.)
                _ = giver.send(read);
                wake();
            });
        match read {
            Ok(()) => scene.reading.push(ReadAhead {
                thing,
                loading,
                given,
            }),
            Err(error) => self.tell(Weight::Trouble, error.to_string()),
        }
    }

    /// The models that are being read: what they will be called, and how far they are.
    pub fn models_being_read(&self) -> impl Iterator<Item = (&str, LoadStage)> {
        let reading = self
            .scene
            .open()
            .into_iter()
            .flat_map(|scene| &scene.reading);
        reading.map(|reading| (reading.thing.name.as_str(), reading.loading.stage()))
    }

    /// Reads a model no further.
    pub(super) fn give_up_reading(&mut self, name: &str) {
        let Some(scene) = self.scene.open_mut() else {
            return;
        };
        scene.reading.retain(|reading| {
            let stays = reading.thing.name != name;
            if !stays {
                reading.loading.give_up();
            }
            stays
        });
    }

    /// Adds what has been read.
    pub(super) fn take_read(&mut self) {
        let Some(scene) = self.scene.open_mut() else {
            return;
        };
        let (mut ready, mut unread) = (Vec::new(), Vec::new());
        let mut index = 0;
        while let Some(waiting) = scene.reading.get(index) {
            match waiting.given.try_recv() {
                Ok(read) => ready.push((scene.reading.remove(index).thing, read)),
                Err(TryRecvError::Empty) => index += 1,
                // (Its thread has panicked, which was told where it happened.)
                Err(TryRecvError::Disconnected) => unread.push(scene.reading.remove(index).thing),
            }
        }
        for thing in unread {
            let text = format!("\"{}\" could not be read.", thing.name);
            self.tell(Weight::Trouble, text);
        }
        for (mut thing, read) in ready {
            match read {
                Ok(scene) => {
                    let things = scene.phantoms.iter().chain(&scene.virtuals);
                    let found = things.clone().find(|found| found.name == thing.name);
                    if let (Some(wanted), NewForm::Mesh { fit_m, .. }) =
                        (found.and_then(adding::fit_m), &mut thing.form)
                    {
                        *fit_m = Some(wanted);
                        let text = format!(
                            "The numbers of \"{}\" cannot be metres: it is scaled to {} cm (fit_m).",
                            thing.name,
                            wanted * 100.0
                        );
                        self.tell(Weight::Trouble, text);
                        // What is scaled is another model: it is read beside the picture, too.
                        self.read(thing);
                        continue;
                    }
                    self.place_again(&mut thing);
                    self.add_thing(thing);
                }
                Err(error) => {
                    let text = self.why_unread(&thing, &error);
                    self.tell(Weight::Trouble, text);
                }
            }
        }
    }

    /// Why a model cannot be added, without the line that it would have had in the scene's file.
    fn why_unread(&self, thing: &NewThing, error: &EditError) -> String {
        let path = self.document().map(SceneDocument::path);
        match (error, &thing.form) {
            (EditError::Scene(error), NewForm::Mesh { file, .. })
                if Some(error.file.as_path()) == path =>
            {
                // `virtual.mesh = "…": ` would be said of the scene's file.
                let reason = error.message.split_once("\": ");
                let reason = reason.map_or(error.message.as_str(), |(_, reason)| reason);
                format!("{file}: {reason}")
            }
            _ => error.to_string(),
        }
    }

    /// Gives a thing a place that is free by now.
    fn place_again(&self, thing: &mut NewThing) {
        let Some(scene) = self.scene() else {
            return;
        };
        let anchor = scene
            .anchors
            .iter()
            .position(|anchor| anchor.name == thing.on);
        let place = &mut thing.placement.position_m;
        *place = free_place(scene, anchor.unwrap_or(0), *place);
    }

    fn add_thing(&mut self, thing: NewThing) {
        let name = thing.name.clone();
        self.commit_named(&Edit::AddThing(thing), name);
    }

    /// Copies a thing.
    pub(super) fn duplicate(&mut self, thing: &str) {
        let (Some(scene), Some(place)) = (self.scene(), self.place(thing)) else {
            return;
        };
        let mut things = scene.phantoms.iter().chain(&scene.virtuals);
        let Some(anchor) = things
            .find(|found| found.name == thing)
            .map(|found| found.stands_on())
        else {
            return;
        };
        let name = free_name(scene, thing, |_| false);
        let edit = Edit::Duplicate {
            thing: thing.to_owned(),
            name: name.clone(),
            position_m: free_place(scene, anchor, place.placement().position_m + COPY_BESIDE),
        };
        self.commit_named(&edit, name);
    }

    /// Gives a thing another name.
    pub(super) fn rename(&mut self, thing: &str, name: &str) {
        if name.trim().is_empty() {
            return self.tell(Weight::Trouble, "A thing has a name.");
        }
        let name = allowed_name(name);
        if name != thing {
            let edit = Edit::Rename {
                thing: thing.to_owned(),
                name: name.clone(),
            };
            self.commit_named(&edit, name);
        }
    }

    /// Makes an edit by which a thing gets a name, and selects it.
    fn commit_named(&mut self, edit: &Edit, name: String) {
        if self.commit(edit) {
            self.selection = Some(WindowCommand::Select(Some(Selected::Thing(name))));
        }
    }

    /// Takes a thing or a light away, of which `selected` may be one.
    pub(super) fn remove(&mut self, removed: &Selected, selected: Option<&Selected>) {
        let is_done = self.commit(&match removed {
            Selected::Thing(name) => Edit::RemoveThing(name.clone()),
            Selected::Light(index) => Edit::RemoveLight(*index),
        });
        let selects = match (removed, selected) {
            _ if !is_done => return,
            (removed, Some(selected)) if removed == selected => None,
            // The lights behind it move up.
            (Selected::Light(removed), Some(Selected::Light(index))) if removed < index => {
                Some(Selected::Light(index - 1))
            }
            _ => return,
        };
        self.selection = Some(WindowCommand::Select(selects));
    }

    /// What is to be selected from now on, once.
    pub fn take_selection(&mut self) -> Option<WindowCommand> {
        self.selection.take()
    }
}
