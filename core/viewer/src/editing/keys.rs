//! Keys that are moved or deleted in the sequencer.

use super::{EditError, Step};
use crate::app::Viewer;
use crate::state::events::{Event, KeyOf};
use crate::state::selection::{Selected, actor};
use choreo_motion::Time;
use choreo_script::Place;
use choreo_session::edit::{Edit, EditRefused, EditTime, ScriptObject};

impl Viewer {
    /// Moves the keys of a mark in the sequencer to another time.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn move_keys(&mut self, event: &Event, secs: f64) -> Result<(), EditError> {
        let to = self.edit_time(secs);
        self.change_keys(event, |object, property, from| object.move_key(property, from, to))
    }

    /// Deletes the keys of a mark in the sequencer.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn delete_keys(&mut self, event: &Event) -> Result<(), EditError> {
        self.change_keys(event, |object, property, at| object.delete_key(property, at))
    }

    fn change_keys(
        &mut self,
        event: &Event,
        change: impl Fn(&ScriptObject, &str, EditTime) -> Result<Edit, EditRefused>,
    ) -> Result<(), EditError> {
        if event.keys.is_empty() {
            let why = "it is no key that can be moved; its line states the time";
            return Err(EditError::refused_at(&event.place, why));
        }
        let at = self.edit_time(event.at.as_secs());
        let mut steps: Vec<Step> = Vec::new();
        for KeyOf { what, property } in &event.keys {
            let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
            let change = &change;
            let make =
                move |text: &str, line, column| change(&ScriptObject::at(text, line, column)?, property, at);
            steps.push(Step { place, siblings, make: Box::new(make) });
        }
        self.change_all(steps)
    }

    /// Place in the script that makes something, and how many things that place makes.
    pub(crate) fn place_of(&self, what: &Selected) -> Option<(Place, usize)> {
        let scene = self.scene.as_ref()?;
        let (stage, places) = (&scene.stage, &scene.places);
        let (all, index) = match what {
            Selected::Actor(name) => (&places.actors, actor(stage, name)?),
            Selected::Camera(name) => (&places.cameras, stage.cameras.iter().position(|c| c.name == *name)?),
            Selected::Light(index) => (&places.lights, *index),
            Selected::Effect(index) => (&places.effects, *index),
            Selected::Title(index) => (&places.layers_2d, *index),
            Selected::Cue { .. } => {
                let bars = || self.timeline.rows.iter().flat_map(|row| &row.bars);
                let place = bars().find(|bar| bar.what == *what)?.place.clone();
                let siblings = bars().filter(|bar| bar.place == place).count();
                return Some((place, siblings));
            }
        };
        let place = all.get(index)?.clone();
        let siblings = all.iter().filter(|other| **other == place).count();
        Some((place, siblings))
    }

    /// The mark at a time in the row of something.
    pub fn event_at(&self, what: &Selected, at: Time) -> Option<Event> {
        let is_it = |event: &&Event| event.at == at && event.keys.iter().any(|key| key.what == *what);
        self.timeline.rows.iter().flat_map(|row| &row.events).find(is_it).cloned()
    }
}
