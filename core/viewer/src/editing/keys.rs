//! Keys that are set, moved, changed, copied or deleted in the sequencer, the curve editor and the inspector. Keys of several objects change
//! together, as one edit. If keys are computed, a line is offered that states all of them anew.

use super::{EditError, Step, expression};
use crate::app::Viewer;
use crate::state::curves::KnownProperties;
use crate::state::events::{Event, EventKey};
use crate::state::keyed::{self, KeyRef, KeyedProperty, ValueKind, ValueText};
use crate::state::selection::{Selected, actor};
use crate::state::tangents::TangentChoice;
use choreo_motion::Time;
use choreo_script::Place;
use choreo_session::edit::{
    Edit, EditRefused, EditTime, KeyShape, KeyValue, ScriptObject, TypedNumber, copied_keys,
};
use std::collections::BTreeMap;

/// Largest number of keys that a line may state anew; more are probably samples of an easing.
const MAX_WRITTEN_KEYS: usize = 64;

/// A change of one component of the values of keys.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueDrag {
    pub property: String,
    /// Index of the component.
    pub part: usize,
    /// Amount to add, in the unit of the script.
    pub offset: f64,
}

/// An edit of the keys of one property at some times.
type Change<'c> = dyn Fn(&ScriptObject, &str, &[EditTime]) -> Result<Edit, EditRefused> + 'c;

impl Viewer {
    /// Moves keys in time and changes one component of their values, as one edit. `by`: seconds.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change. The same holds for the functions below.
    pub fn drag_keys(
        &mut self,
        keys: &[KeyRef],
        by: f64,
        value: Option<&ValueDrag>,
    ) -> Result<(), EditError> {
        let steps = self.key_drag_steps(keys, by, value)?;
        self.apply_steps(steps)?;
        self.move_key_selection(keys, by);
        Ok(())
    }

    pub(super) fn key_drag_steps(
        &self,
        keys: &[KeyRef],
        by: f64,
        value: Option<&ValueDrag>,
    ) -> Result<Vec<Step<'static>>, EditError> {
        let mut steps = Vec::new();
        if let Some(value) = value.filter(|value| value.offset != 0.0) {
            for key in keys.iter().filter(|key| key.property == value.property) {
                let keyed = self.keyed_property(&key.what, &key.property)?;
                let mut numbers = keyed.at(key.at);
                let number = numbers.get_mut(value.part).ok_or(EditError::ObjectGone)?;
                *number = (*number + value.offset).clamp(keyed.range[0], keyed.range[1]);
                steps.push(self.value_step(&keyed, key.at, &numbers)?);
            }
        }
        if by != 0.0 {
            steps.extend(self.key_move_steps(keys, by)?);
        }
        Ok(steps)
    }

    fn key_move_steps(&self, keys: &[KeyRef], by: f64) -> Result<Vec<Step<'static>>, EditError> {
        let shifted_time = move |at: EditTime| EditTime { secs: (at.secs + by).max(0.0), ..at };
        self.key_steps(
            keys,
            move |object, property, at| {
                let moves: Vec<_> = at.iter().map(|at| (*at, shifted_time(*at))).collect();
                object.move_keys(property, &moves)
            },
            &|at| Some(Time::from_secs((at.as_secs() + by).max(0.0))),
        )
    }

    /// Moves a key to a typed time.
    pub(crate) fn set_key_time(&mut self, key: &KeyRef, time: &TypedNumber) -> Result<(), EditError> {
        let (keys, by) = (std::slice::from_ref(key), time.value - key.at.as_secs());
        let (steps, fps) = (self.key_move_steps(keys, by)?, self.playhead.fps().as_fps());
        self.apply_steps(steps.into_iter().map(|step| step.keeping_time(time, fps)).collect())?;
        self.move_key_selection(keys, by);
        Ok(())
    }

    /// Sets the components of a key's value, in the units of the script. `typed`: the component that the user typed.
    pub(crate) fn set_key_value(
        &mut self,
        key: &KeyRef,
        numbers: &[f64],
        typed: &TypedNumber,
    ) -> Result<(), EditError> {
        let keyed = self.keyed_property(&key.what, &key.property)?;
        let step = self.value_step(&keyed, key.at, numbers)?;
        self.apply_steps(vec![step.keeping_number(typed)])
    }

    /// Sets the easing and the tangents of a key. `typed`: the number of them that the user typed.
    pub(crate) fn set_key_shape(
        &mut self,
        key: KeyRef,
        shape: KeyShape,
        typed: Option<&TypedNumber>,
    ) -> Result<(), EditError> {
        let steps = self.shape_steps(&[(key, shape)])?.into_iter();
        self.apply_steps(match typed {
            Some(typed) => steps.map(|step| step.keeping_number(typed)).collect(),
            None => steps.collect(),
        })
    }

    /// Deletes keys from the script.
    pub fn delete_keys(&mut self, keys: &[KeyRef]) -> Result<(), EditError> {
        let steps = self.key_delete_steps(keys)?;
        self.apply_steps(steps)?;
        self.select_keys(Vec::new());
        Ok(())
    }

    pub(super) fn key_delete_steps(&self, keys: &[KeyRef]) -> Result<Vec<Step<'static>>, EditError> {
        self.key_steps(keys, |object, property, at| object.delete_keys(property, at), &|_| None)
    }

    /// Deletes the selected clips and keys, as one edit. Objects that lose only keys stay selected.
    pub(crate) fn delete_selected(&mut self) -> Result<(), EditError> {
        let mut steps = self.key_delete_steps(self.selected_keys())?;
        let bars = self.explicitly_selected_bars();
        steps.extend(self.cue_delete_steps(&bars)?);
        self.apply_steps(steps)?;
        self.select_keys(Vec::new());
        if !bars.is_empty() {
            self.selection = None;
        }
        Ok(())
    }

    /// Sets the easing of the spans before keys, as source text. `None`: the easing of all keys of their property.
    pub fn set_key_ease(&mut self, keys: &[KeyRef], ease: Option<&str>) -> Result<(), EditError> {
        let ease = ease.map(str::to_string);
        let mut steps = Vec::new();
        for key in keys {
            let ease = ease.clone();
            let change = move |object: &ScriptObject, property: &str, at: &[EditTime]| {
                object.set_key_ease(property, at[0], ease.as_deref())
            };
            steps.extend(self.key_steps(std::slice::from_ref(key), change, &|at| Some(at))?);
        }
        self.apply_steps(steps)
    }

    /// Sets the tangents of keys, as one edit.
    pub fn set_key_tangents(&mut self, keys: &[KeyRef], choice: TangentChoice) -> Result<(), EditError> {
        let mut shapes = Vec::new();
        for key in keys {
            let keyed = self.keyed_property(&key.what, &key.property)?;
            let index = keyed.keys.iter().position(|at| *at == key.at).ok_or(EditError::ObjectGone)?;
            let shape = keyed.shape_after_choice(index, choice).ok_or_else(|| {
                let why = format!("keys of the property {} cannot have tangents", keyed.name);
                let place = self.place_of(&key.what).map(|(place, _)| place).unwrap_or_default();
                EditError::refused_at(&place, &why)
            })?;
            shapes.push((key.clone(), shape));
        }
        self.set_key_shapes(&shapes)
    }

    /// Sets easings and tangents of keys, as one edit.
    pub fn set_key_shapes(&mut self, shapes: &[(KeyRef, KeyShape)]) -> Result<(), EditError> {
        let steps = self.shape_steps(shapes)?;
        self.apply_steps(steps)
    }

    fn shape_steps(&self, shapes: &[(KeyRef, KeyShape)]) -> Result<Vec<Step<'static>>, EditError> {
        let keys: Vec<KeyRef> = shapes.iter().map(|(key, _)| key.clone()).collect();
        let mut steps = Vec::new();
        for ((what, property), times) in group_by_property(&keys) {
            let of = |at: &Time| {
                let is_shape_of_key = |(key, _): &&(KeyRef, KeyShape)| {
                    key.what == *what && key.property == property && key.at == *at
                };
                let (_, shape) = shapes.iter().find(is_shape_of_key)?;
                Some((self.edit_time(at.as_secs()), shape.clone()))
            };
            let all: Vec<(EditTime, KeyShape)> = times.iter().filter_map(of).collect();
            let change = move |object: &ScriptObject, property: &str, _: &[EditTime]| {
                object.set_key_shapes(property, &all)
            };
            let key = |at: &Time| KeyRef { what: what.clone(), property: property.to_string(), at: *at };
            let keys: Vec<KeyRef> = times.iter().map(key).collect();
            steps.extend(self.key_steps(&keys, change, &|at| Some(at))?);
        }
        Ok(steps)
    }

    /// Sets the interpolation of all keys of the properties of `keys`, as source text. `None`: linear.
    pub fn set_key_interpolation(
        &mut self,
        keys: &[KeyRef],
        interpolation: Option<&str>,
    ) -> Result<(), EditError> {
        let interpolation = interpolation.map(str::to_string);
        let change = move |object: &ScriptObject, property: &str, at: &[EditTime]| {
            object.set_key_interpolation(property, at[0].fps, interpolation.as_deref())
        };
        let steps = self.key_steps(keys, change, &|at| Some(at))?;
        self.apply_steps(steps)
    }

    /// Keys as text for the clipboard, one property per line.
    pub fn copy_keys(&self, keys: &[KeyRef]) -> Result<String, EditError> {
        let known = self.script_text().ok_or(EditError::NothingShown)?;
        let mut lines = Vec::new();
        for ((what, property), at) in group_by_property(keys) {
            let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
            self.check_place(&place, siblings)?;
            let at: Vec<EditTime> = at.iter().map(|at| self.edit_time(at.as_secs())).collect();
            let object = known.object(place.line, place.column);
            let copied = object.and_then(|object| object.copy_keys(property, &at));
            lines.push(copied.map_err(|r| EditError::Refused { why: r.why, line: r.line })?);
        }
        Ok(lines.join("\n"))
    }

    /// Adds copied keys to an object, the first one at a time in seconds.
    pub fn paste_keys(&mut self, what: &Selected, copied: &str, secs: f64) -> Result<(), EditError> {
        let all: Vec<(Selected, String)> =
            copied.lines().map(|line| (what.clone(), line.to_string())).collect();
        self.paste_copies(all, secs)
    }

    /// Copies keys so that the first one is at a time in seconds.
    pub fn duplicate_keys(&mut self, keys: &[KeyRef], secs: f64) -> Result<(), EditError> {
        let mut all = Vec::new();
        for ((what, property), at) in group_by_property(keys) {
            let key = |at: &Time| KeyRef { what: what.clone(), property: property.to_string(), at: *at };
            let keys: Vec<KeyRef> = at.iter().map(key).collect();
            all.push((what.clone(), self.copy_keys(&keys)?));
        }
        self.paste_copies(all, secs)
    }

    fn paste_copies(&mut self, all: Vec<(Selected, String)>, secs: f64) -> Result<(), EditError> {
        let fps = self.playhead.fps().as_fps();
        let mut parsed_copies = Vec::new();
        for (what, copied) in all {
            let (property, start) = copied_keys(&copied, fps)
                .ok_or_else(|| EditError::refused("the clipboard holds no keys of a timeline"))?;
            self.keyed_property(&what, &property)?;
            parsed_copies.push((what, property, copied, start));
        }
        let first = parsed_copies.iter().map(|(.., start)| *start).fold(f64::INFINITY, f64::min);
        let mut steps = Vec::new();
        for (what, property, copied, _) in parsed_copies {
            let (place, siblings) = self.place_of(&what).ok_or(EditError::ObjectGone)?;
            let by = self.edit_time(secs - first);
            let make = move |text: &str, line, column| {
                ScriptObject::at(text, line, column)?.allow_shared_edits().paste_keys(&copied, by)
            };
            steps.push(self.with_key_place(Step::new(place, siblings, make), &property, &[]));
        }
        self.apply_steps(steps)
    }

    /// Sets keys of properties at the playhead, with their present values.
    pub fn set_keys(&mut self, what: &Selected, properties: &[&str]) -> Result<(), EditError> {
        self.set_keys_at(what, properties, self.playhead.time())
    }

    /// Sets keys of properties at a time, with their values at that time.
    pub fn set_keys_at(&mut self, what: &Selected, properties: &[&str], at: Time) -> Result<(), EditError> {
        let mut steps = Vec::new();
        for property in properties {
            let keyed = self.keyed_property(what, property)?;
            let numbers = keyed.at(at);
            steps.push(self.value_step(&keyed, at, &numbers)?);
            if let Some(split) = keyed.split(at) {
                let times = [keyed.keys[split.before], at, keyed.keys[split.before + 1]];
                let key = |at| KeyRef { what: what.clone(), property: property.to_string(), at };
                let shapes: Vec<_> = times.map(key).into_iter().zip(split.shapes).collect();
                steps.extend(self.shape_steps(&shapes)?);
            }
        }
        self.apply_steps(steps)?;
        let key = |property: &&str| KeyRef { what: what.clone(), property: property.to_string(), at };
        self.select_keys(properties.iter().map(key).collect());
        Ok(())
    }

    /// Sets keys at the playhead: for all properties of the selection that have keys and are visible in the curve editor (if it is open), else for
    /// the property that is keyed most often.
    pub(crate) fn set_keys_of_selection(&mut self) -> Result<(), EditError> {
        let what = self.keyed_selection().ok_or_else(|| {
            EditError::refused(
                "first select what gets a key: an actor, a clip, a camera, a light, the sky, an effect or a title",
            )
        })?;
        let all = self.keyed_properties(&what);
        let (hidden, shown): (Vec<&KeyedProperty>, Vec<&KeyedProperty>) =
            all.iter().filter(|p| p.has_keys()).partition(|p| self.curves.hides(p));
        if !shown.is_empty() {
            let names: Vec<&str> = shown.iter().map(|p| p.name.as_str()).collect();
            return self.set_keys(&what, &names);
        }
        if !hidden.is_empty() {
            let why = "all curves of the selection are hidden in the curve editor; show the curves that should get keys";
            return Err(EditError::refused(why));
        }
        let preferred = ["intensity", "position", "fov", "opacity", "strength", ".weight"];
        let preferred = preferred.into_iter().find(|name| all.iter().any(|p| p.name == *name));
        let first = preferred.or(all.first().map(|p| p.name.as_str()));
        let first =
            first.ok_or_else(|| EditError::refused("the selection has no property that can have keys"))?;
        self.set_keys(&what, &[first])
    }

    /// The object whose keys are edited: the selection, or the actor of a selected clip without keys of its own.
    pub(crate) fn keyed_selection(&self) -> Option<Selected> {
        let what = self.selection.clone()?;
        Some(match &what {
            Selected::Cue { actor, .. } if !self.has_keys_of_cue(&what) => Selected::Actor(actor.clone()),
            _ => what,
        })
    }

    fn has_keys_of_cue(&self, what: &Selected) -> bool {
        let scene = self.scene.as_ref();
        scene.is_some_and(|scene| keyed::cue_properties(scene, what).iter().any(KeyedProperty::has_keys))
    }

    /// The properties of an object that can have keys, and those that do, cached for each version of the scene.
    pub(crate) fn known_properties(&mut self, what: &Selected) -> Option<KnownProperties> {
        let scene = self.scene.clone()?;
        let find = || keyed::properties(&scene, what);
        Some(self.curves.properties(scene.number, what, find))
    }

    /// The properties of an object that can have keys.
    pub fn keyed_properties(&self, what: &Selected) -> Vec<KeyedProperty> {
        let Some(scene) = &self.scene else { return Vec::new() };
        keyed::properties(scene, what)
    }

    pub(super) fn keyed_property(&self, what: &Selected, property: &str) -> Result<KeyedProperty, EditError> {
        if let (Selected::Actor(name), "position" | "rotation", Some(scene)) = (what, property, &self.scene)
            && let Some(found) = actor(&scene.stage, name).map(|index| &scene.stage.actors[index])
            && found.path_following.is_some()
        {
            let place = self.place_of(what).map(|(place, _)| place).unwrap_or_default();
            let why = format!("{name} follows a path, so its {property} has no keys; change the path");
            return Err(EditError::refused_at(&place, &why));
        }
        let found = self.keyed_properties(what).into_iter().find(|keyed| keyed.name == property);
        found.ok_or_else(|| {
            EditError::refused(format!("the object has no {property} that keys could animate"))
        })
    }

    /// Sets a keyed parameter of an effect at the playhead, or one component of it. `None` if it has no keys. `value`: source text.
    pub(super) fn set_keyed_parameter(
        &mut self,
        what: &Selected,
        name: &str,
        value: &str,
    ) -> Option<Result<(), EditError>> {
        let at = self.playhead.time();
        let all = self.keyed_properties(what);
        let keyed = || all.iter().filter(|p| p.has_keys());
        if let Some(whole) = keyed().find(|p| p.name == name) {
            let step = self.text_step(whole, at, ValueText::Text(value.to_string()));
            return Some(step.and_then(|step| self.apply_steps(vec![step])));
        }
        // A component of a color or a vector.
        let (of, part) = keyed().find_map(|p| Some((p, self.component_index(what, &p.name, name)?)))?;
        let mut numbers = of.at(at);
        *numbers.get_mut(part)? = expression::evaluate(value, self.playhead.fps().as_fps())?;
        let step = self.value_step(of, at, &numbers);
        Some(step.and_then(|step| self.apply_steps(vec![step])))
    }

    /// Index of a named component of an effect's option.
    fn component_index(&self, what: &Selected, option: &str, number: &str) -> Option<usize> {
        let (scene, Selected::Effect(index)) = (self.scene.as_ref()?, what) else { return None };
        let plugin = scene.registry.effect(&scene.stage.effects.get(*index)?.plugin)?;
        plugin.manifest().options.iter().find(|o| o.name == option)?.number_of(number)
    }

    /// A step that sets the components of a property at a time, in an existing or a new key.
    pub(super) fn value_step(
        &self,
        keyed: &KeyedProperty,
        at: Time,
        numbers: &[f64],
    ) -> Result<Step<'static>, EditError> {
        self.text_step(keyed, at, keyed.text(at, numbers))
    }

    /// A step that sets the value of a property at a time, in an existing or a new key.
    pub(super) fn text_step(
        &self,
        keyed: &KeyedProperty,
        at: Time,
        value: ValueText,
    ) -> Result<Step<'static>, EditError> {
        let (place, siblings) = self.place_of(&keyed.what).ok_or(EditError::ObjectGone)?;
        let (when, property) = (self.edit_time(at.as_secs()), &keyed.name);
        let has_keys = keyed.has_keys();
        let mut stated = self.keys_to_state(keyed, &|time| Some(time));
        if !stated.is_empty() {
            stated.retain(|(time, _)| (time.secs - when.secs).abs() >= 0.5 / when.fps);
            stated.push((when, value.clone()));
            stated.sort_by(|a, b| a.0.secs.total_cmp(&b.0.secs));
        }
        let (name, all) = (property.clone(), stated.clone());
        let make = move |text: &str, line, column| {
            let object = ScriptObject::at(text, line, column)?.allow_shared_edits();
            match has_keys {
                true => object
                    .set_key(&name, when, value.value())
                    .map_err(|refused| offer_all_keys_line(&object, refused, &name, &all)),
                false => object.add_keys(&name, when, value.value()),
            }
        };
        Ok(self.with_key_place(Step::new(place, siblings, make), property, &stated))
    }

    /// Adds to a step the position of the property's `.key(…)`. `stated`: all keys after the edit. Keys in a script function that is called with
    /// several objects are shared by these; a line after it states the keys of one object alone.
    fn with_key_place<'m>(
        &self,
        step: Step<'m>,
        property: &str,
        stated: &[(EditTime, ValueText)],
    ) -> Step<'m> {
        let is_main = self.scene.as_ref().is_some_and(|scene| scene.places.main == step.place.file);
        let text = self.script_text().filter(|_| is_main && step.place.line > 0);
        let object = text.and_then(|text| text.object(step.place.line, step.place.column).ok());
        let Some((object, ((line, column), uses))) =
            object.and_then(|object| object.key_place(property).map(|place| (object, place)))
        else {
            return step;
        };
        let shared_keys_place = Some(Place { line, column, ..step.place.clone() });
        match step.siblings {
            1 if uses > 1 => {
                let stated: Vec<(EditTime, KeyValue)> =
                    stated.iter().map(|(time, text)| (*time, text.value())).collect();
                Step {
                    siblings: uses,
                    separate_line: object.all_keys_line(property, &stated),
                    shared_keys_place,
                    ..step
                }
            }
            _ => Step { shared_keys_place, ..step },
        }
    }

    /// A step for each property that has some of the keys. `after`: the new time of a key, or `None` if it is deleted.
    fn key_steps<'c>(
        &self,
        keys: &[KeyRef],
        change: impl Fn(&ScriptObject, &str, &[EditTime]) -> Result<Edit, EditRefused> + 'c,
        after: &dyn Fn(Time) -> Option<Time>,
    ) -> Result<Vec<Step<'c>>, EditError> {
        let change: std::rc::Rc<Change<'c>> = std::rc::Rc::new(change);
        let mut steps = Vec::new();
        for ((what, property), at) in group_by_property(keys) {
            let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
            let keyed = self.keyed_properties(what).into_iter().find(|keyed| keyed.name == *property);
            let new_time = |time: Time| if at.contains(&time) { after(time) } else { Some(time) };
            let stated = keyed.map_or(Vec::new(), |keyed| self.keys_to_state(&keyed, &new_time));
            let at: Vec<EditTime> = at.iter().map(|at| self.edit_time(at.as_secs())).collect();
            let (name, change, all) = (property.to_string(), change.clone(), stated.clone());
            let make = move |text: &str, line, column| {
                let object = ScriptObject::at(text, line, column)?.allow_shared_edits();
                change(&object, &name, &at)
                    .map_err(|refused| offer_all_keys_line(&object, refused, &name, &all))
            };
            steps.push(self.with_key_place(Step::new(place, siblings, make), property, &stated));
        }
        if steps.is_empty() {
            return Err(EditError::refused("no key is selected"));
        }
        Ok(steps)
    }

    /// All keys of a property that the script does not state as literals, to be stated anew. `after`: the new time of a key, or `None` if it is
    /// deleted.
    fn keys_to_state(
        &self,
        keyed: &KeyedProperty,
        after: &dyn Fn(Time) -> Option<Time>,
    ) -> Vec<(EditTime, ValueText)> {
        if keyed.written.is_some() || keyed.keys.len() > MAX_WRITTEN_KEYS || keyed.kind == ValueKind::Kelvin {
            return Vec::new();
        }
        let key = |at: &Time| Some((self.edit_time(after(*at)?.as_secs()), keyed.absolute_text(*at)));
        let mut all: Vec<_> = keyed.keys.iter().filter_map(key).collect();
        all.sort_by(|a, b| a.0.secs.total_cmp(&b.0.secs));
        all
    }

    /// Position in the script of the call that creates an object, and the number of objects that it creates.
    pub(crate) fn place_of(&self, what: &Selected) -> Option<(Place, usize)> {
        keyed::place_of(self.scene.as_ref()?, what)
    }
}

impl Event {
    /// The keys that a mark stands for.
    pub fn key_refs(&self) -> Vec<KeyRef> {
        let key = |EventKey { what, property, .. }: &EventKey| KeyRef {
            what: what.clone(),
            property: property.clone(),
            at: self.at,
        };
        self.keys.iter().map(key).collect()
    }
}

fn offer_all_keys_line(
    object: &ScriptObject,
    refused: EditRefused,
    property: &str,
    stated: &[(EditTime, ValueText)],
) -> EditRefused {
    let stated: Vec<(EditTime, KeyValue)> = stated.iter().map(|(time, text)| (*time, text.value())).collect();
    object.offering_all_keys(refused, property, &stated)
}

/// Times of keys, grouped by object and property.
fn group_by_property(keys: &[KeyRef]) -> BTreeMap<(&Selected, &str), Vec<Time>> {
    let mut all: BTreeMap<(&Selected, &str), Vec<Time>> = BTreeMap::new();
    for key in keys {
        all.entry((&key.what, &key.property)).or_default().push(key.at);
    }
    all
}
