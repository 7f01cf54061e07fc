//! Edits of the inspector: values of cues, lights, cameras, titles and actors. A value is written in the style that the script already uses, or
//! removed so that the default applies.

use super::EditError;
use crate::app::Viewer;
use crate::state::selection::{Selected, actor};
use choreo_script::{Place, mask_problem};
use choreo_session::edit::{
    CueTime, Edit, EditRefused, EditTime, KeyValue, NewValueSyntax, ScriptObject, TypedNumber, expression,
    format_as_meant, set_time, set_trim,
};
use choreo_stage::{Camera, Property};
use glam::DVec3;
use std::collections::BTreeMap;

/// A change of one value by its name in scripts.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldChange {
    /// A time of a cue, effect or title, seconds.
    Time(CueTime, TypedNumber),
    /// A value as source text. Computed values are not overwritten.
    Value(&'static str, String, NewValueSyntax),
    /// A value as source text that also overwrites a computed one.
    Overwrite(&'static str, String, NewValueSyntax),
    /// Removes these values.
    Reset(Vec<&'static str>),
    /// Trimmed part of a clip, clip seconds, and the end of it that the user typed.
    Trim([f64; 2], TypedNumber),
    /// `once`, `loop` or `ping_pong`.
    Repeat(&'static str),
    Clip(String),
    /// Words of a title.
    TitleText(String),
    /// Focal length in millimetres, and its source text.
    FocalLength(f64, String),
    /// An option of the shape or the built-in character that an actor is cast from.
    AssetOption(&'static str, Option<String>),
    /// A value in the map of an option, such as `size` in `shadow`. `None` removes it.
    ValueInOption(&'static str, &'static str, Option<String>),
    /// An argument of the creating call, counted from 0, as source text.
    Argument(usize, String),
    /// A key of a point at the playhead: property name, new value, and the component that the user typed.
    KeyedPoint(&'static str, DVec3, TypedNumber),
}

/// A call in the script that belongs to an actor or a camera: a constraint, an attachment, springs, or a camera motion.
#[derive(Clone, Debug)]
pub struct StatedCall {
    pub place: Place,
    /// Number of objects that the line creates.
    pub siblings: usize,
    /// Name and arguments of the call.
    pub title: String,
    /// Source text of the first two arguments: the target of a camera and the offset from it.
    pub arguments: [Option<String>; 2],
    /// Source text of the options and methods of the call, by name.
    pub values: BTreeMap<String, String>,
}

/// Methods that set how a clip repeats.
const REPEAT_METHODS: [&str; 5] = ["repeat", "once", "loop", "ping_pong", "hold"];

impl Viewer {
    /// Changes a value of an object.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub(crate) fn change_field(&mut self, what: &Selected, change: &FieldChange) -> Result<(), EditError> {
        let done = self.change_field_once(what, change);
        let (what, change) = (what.clone(), change.clone());
        self.retry_after_unroll(done, move |viewer| viewer.change_field(&what, &change))
    }

    fn change_field_once(&mut self, what: &Selected, change: &FieldChange) -> Result<(), EditError> {
        match change {
            FieldChange::Time(CueTime::FadeIn, time) if matches!(what, Selected::Cue { .. }) => {
                let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
                let when = self.edit_time(time.value);
                self.edit_call(&place, siblings, |text| {
                    let (line, column) = (place.line, place.column);
                    let made = edit_replacing(text, (line, column), &["inertial"], |text| {
                        set_time(text, line, column, CueTime::FadeIn, when)
                    });
                    time.keep_time(text, made, when.fps)
                })
            }
            FieldChange::Time(part, time) => self.set_typed_cue_time(what, *part, time),
            FieldChange::FocalLength(length, text) => self.set_focal_length(what, *length, text),
            FieldChange::KeyedPoint(name, point, typed) => {
                let keyed = self.keyed_property(what, name)?;
                let step = self.value_step(&keyed, self.playhead.time(), &point.to_array())?;
                self.apply_steps(vec![step.keeping_number(typed)])
            }
            FieldChange::Trim(trim, typed) => {
                let fps = self.playhead.fps().as_fps();
                let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
                self.edit_call(&place, siblings, |text| {
                    typed.keep_time(text, set_trim(text, place.line, place.column, *trim, fps), fps)
                })
            }
            change => {
                let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
                if let Some(why) = self.mask_refusal(what, change).or_else(|| speed_refusal(change)) {
                    return Err(EditError::refused_at(&place, &why));
                }
                if let Some(shared) = self.offer_layer_edit(what, change) {
                    return Err(shared);
                }
                if matches!(change, FieldChange::AssetOption(..))
                    && let Some(shared) = self.offer_asset_edit(what, &place, |object, text| {
                        field_change_edit(object, text, change)
                    })
                {
                    return Err(shared);
                }
                self.edit_call(&place, siblings, |text| {
                    field_change_edit(&ScriptObject::at(text, place.line, place.column)?, text, change)
                })
            }
        }
    }

    /// Removes an option of an object from the script.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_field`] does.
    pub(crate) fn remove_parameter(&mut self, what: &Selected, name: &str) -> Result<(), EditError> {
        let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
        self.edit_call(&place, siblings, |text| {
            Ok(ScriptObject::at(text, place.line, place.column)?.remove_values(&[name]))
        })
    }

    /// Reason why the mask in a change does not fit the joints of the actor, if it does not.
    fn mask_refusal(&self, what: &Selected, change: &FieldChange) -> Option<String> {
        let FieldChange::Overwrite("on", mask, _) = change else { return None };
        let stage = &self.scene.as_ref()?.stage;
        let asset = &stage.actors[actor(stage, what.actor()?)?].asset;
        mask_problem(asset, mask)
    }

    /// Changes a setting of the stage. If the script has no call of `stage`, it is added after the comments at its beginning.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn change_stage(&mut self, change: &FieldChange) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let place = &scene.places.settings;
        if place.line > 0 {
            let fps = self.playhead.fps().as_fps();
            return self.edit_call(place, 1, |text| {
                let object = ScriptObject::at(text, place.line, place.column)?;
                match change {
                    FieldChange::Value("length", length, syntax) => {
                        let in_frames = stage_length_edit(&object, text, length, fps);
                        in_frames.unwrap_or_else(|| object.set_value("length", length, *syntax))
                    }
                    change => field_change_edit(&object, text, change),
                }
            });
        }
        let FieldChange::Value(name, value, _) = change else { return Ok(()) };
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let text = super::read_script(&path)?;
        let comments = text.split_inclusive('\n').take_while(|line| line.starts_with("//"));
        let at = comments.map(str::len).sum();
        let edit = Edit { range: at..at, text: format!("stage(#{{ {name}: {value} }});\n") };
        self.write_edit(&path, &text, edit)
    }

    /// Source text of the settings of the stage that the script states, by name.
    pub fn written_stage_values(&self) -> BTreeMap<String, String> {
        let all = || {
            let place = &self.scene.as_ref()?.places.settings;
            Some(self.script_text()?.object(place.line, place.column).ok()?.all_written())
        };
        all().unwrap_or_default()
    }

    /// Changes a value of a constraint, an attachment or springs, stated by a call of its own.
    ///
    /// # Errors
    /// Fails as `Viewer::change_field` does.
    pub fn change_call(&mut self, call: &StatedCall, change: &FieldChange) -> Result<(), EditError> {
        let fps = self.playhead.fps().as_fps();
        self.edit_call(&call.place, call.siblings, |text| {
            let object = ScriptObject::at(text, call.place.line, call.place.column)?;
            match change {
                FieldChange::Time(part, time) => {
                    let name = match part {
                        CueTime::Start => "from",
                        CueTime::End => "until",
                        CueTime::FadeIn | CueTime::FadeOut => "fade",
                    };
                    let made = object.set_time_value(
                        name,
                        EditTime { secs: time.value, fps },
                        NewValueSyntax::Option,
                    );
                    time.keep_time(text, made, fps)
                }
                change => field_change_edit(&object, text, change),
            }
        })
    }

    /// Calls with these names that belong to an object. Empty if the script creates the object together with others.
    pub fn stated_calls(&self, what: &Selected, names: &[&str]) -> Vec<StatedCall> {
        let Some((place, siblings)) = self.place_of(what) else {
            return Vec::new();
        };
        let places = self.read_object(&place, siblings, |object| Some(object.places_of(names)));
        let call = |(line, column)| self.stated_call(&Place { line, column, ..place.clone() }, 1, "");
        places.unwrap_or_default().into_iter().map(call).collect()
    }

    /// The call at a position. `name`: its title if the text cannot be edited.
    pub fn stated_call(&self, place: &Place, siblings: usize, name: &str) -> StatedCall {
        let call = |title: String, arguments, values| {
            let place = place.clone();
            StatedCall { place, siblings, title, arguments, values }
        };
        let read = self.read_object(place, siblings, |object| {
            let title = format!("{} {}", object.creating_function(), object.arguments_before_options());
            let arguments = [0, 1].map(|number| object.argument(number).map(str::to_string));
            Some(call(title.trim().to_string(), arguments, object.all_written()))
        });
        read.unwrap_or_else(|| call(name.to_string(), [None, None], BTreeMap::new()))
    }

    /// Source text of the values in the map of an option, by name.
    pub fn values_in_option(&self, what: &Selected, option: &str) -> BTreeMap<String, String> {
        self.read_selected(what, |object| Some(object.within_option(option)?.all_written()))
            .unwrap_or_default()
    }

    /// Source text of a method's arguments or of an option. `None` if the script creates the object together with others.
    pub fn written_value(&self, what: &Selected, name: &str) -> Option<String> {
        self.read_selected(what, |object| object.written(name).map(str::to_string))
    }

    /// Source text of all options and methods of an object, by name. Empty if the script creates the object together with others.
    pub fn written_values(&self, what: &Selected) -> BTreeMap<String, String> {
        self.read_selected(what, |object| Some(object.all_written())).unwrap_or_default()
    }

    /// The call that makes the asset of an actor: its name, its arguments before the options, and its options as source text. `None` if the asset
    /// is made in another way.
    pub(crate) fn written_asset(
        &self,
        what: &Selected,
    ) -> Option<(String, String, BTreeMap<String, String>)> {
        self.read_selected(what, |object| {
            let asset = object.asset_object().ok()?;
            Some((
                asset.creating_function().to_string(),
                asset.arguments_before_options().to_string(),
                asset.all_written(),
            ))
        })
    }

    /// Reads the call at a position of the displayed script. `None` if it creates several objects or stands in a module.
    pub(super) fn read_object<R>(
        &self,
        place: &Place,
        siblings: usize,
        read: impl FnOnce(&ScriptObject) -> Option<R>,
    ) -> Option<R> {
        self.check_place(place, siblings).ok()?;
        read(&self.script_text()?.object(place.line, place.column).ok()?)
    }

    /// Reads the call that creates an object.
    pub(super) fn read_selected<R>(
        &self,
        what: &Selected,
        read: impl FnOnce(&ScriptObject) -> Option<R>,
    ) -> Option<R> {
        let (place, siblings) = self.place_of(what)?;
        self.read_object(&place, siblings, read)
    }

    /// Sets the lens of a camera: in millimetres, unless the script states the field of view.
    fn set_focal_length(&mut self, what: &Selected, length: f64, length_text: &str) -> Result<(), EditError> {
        let Selected::Camera(name) = what else { return Err(EditError::refused("only cameras have a lens")) };
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let camera = scene.stage.cameras.iter().find(|c| c.name == *name).ok_or(EditError::ObjectGone)?;
        let keyed = |property| camera.channels.iter().any(|c| c.property == property);
        let in_degrees = keyed(Property::FieldOfView)
            || self.written_value(what, "fov").is_some()
                && self.written_value(what, "focal_length").is_none();
        if in_degrees {
            let degrees = Camera::yfov(length).to_degrees();
            let is_meant = |read: f64| is_as_shown(Camera::focal_length(read.to_radians()), length);
            return self.set_field_of_view(name, degrees, &format_as_meant(degrees, is_meant));
        }
        let when = self.edit_time(self.playhead.time().as_secs());
        let is_keyed = keyed(Property::FocalLength);
        let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
        self.edit_call(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            match is_keyed {
                true => object.set_key("focal_length", when, KeyValue::Text(length_text)),
                false => object.set_value("focal_length", length_text, NewValueSyntax::Method),
            }
        })
    }
}

/// Reason why a clip cannot have the speed in a change, if it cannot.
fn speed_refusal(change: &FieldChange) -> Option<String> {
    let FieldChange::Value("speed", speed, _) = change else { return None };
    let stands = expression::evaluate(speed, 1.0)?.abs() < 1e-3;
    stands.then(|| format!("a clip has a speed of at least 0.001, or at most -0.001 backwards, not {speed}"))
}

/// The edit that rounds the length of the stage to a whole frame. `None` if the script does not count the length in frames.
fn stage_length_edit(
    object: &ScriptObject,
    text: &str,
    length: &str,
    fps: f64,
) -> Option<Result<Edit, EditRefused>> {
    object.written("length").filter(|written| expression::counts_frames(written))?;
    let secs = expression::evaluate(length, fps)?;
    let frame = EditTime { secs: (secs * fps).round().max(1.0) / fps, fps };
    let made = object.set_time_value("length", frame, NewValueSyntax::Option);
    // An expression stays as it was typed.
    let typed = TypedNumber { value: frame.secs, text: length.to_string() };
    let is_number = length.parse::<f64>().is_ok();
    Some(if is_number { made } else { typed.keep_time(text, made, fps) })
}

/// Whether two numbers are equal as displayed, with 3 decimal places, despite rounding to single precision.
pub(super) fn is_as_shown(a: f64, b: f64) -> bool {
    (a - b).abs() < 2e-5
}

/// A change that also removes the values in `others`, which exclude the new one. `make` gets the text without them.
fn edit_replacing(
    text: &str,
    (line, column): (usize, usize),
    others: &[&str],
    make: impl Fn(&str) -> Result<Edit, EditRefused>,
) -> Result<Edit, EditRefused> {
    let object = ScriptObject::at(text, line, column)?;
    if others.iter().all(|other| object.written(other).is_none()) {
        return make(text);
    }
    // Text before the call has not changed.
    let removal = object.remove_values(others);
    let plain = removal.apply(text);
    let edit = make(&plain).map_err(|refused| refused.before(text, &[removal]))?;
    Ok(Edit::between(text, &edit.apply(&plain)))
}

/// The edit for a change of an object.
pub(super) fn field_change_edit(
    object: &ScriptObject,
    text: &str,
    change: &FieldChange,
) -> Result<Edit, EditRefused> {
    match change {
        FieldChange::Value("inertial", value, syntax) => {
            let (line, column) = object.place();
            edit_replacing(text, (line, column), &["fade", "in_step"], |text| {
                ScriptObject::at(text, line, column)?.set_value("inertial", value, *syntax)
            })
        }
        FieldChange::Value(name, value, syntax) => object.set_value(name, value, *syntax),
        FieldChange::Overwrite(name, value, syntax) => object.overwrite_value(name, value, *syntax),
        FieldChange::Reset(names) => Ok(object.remove_values(names)),
        FieldChange::Clip(name) => object.set_clip(name),
        FieldChange::TitleText(words) => object.set_words(words),
        FieldChange::Repeat(how) => {
            let (line, column) = object.place();
            let value = format!("\"{how}\"");
            edit_replacing(text, (line, column), &REPEAT_METHODS, |text| {
                ScriptObject::at(text, line, column)?.set_value("repeat", &value, NewValueSyntax::Option)
            })
        }
        FieldChange::ValueInOption(option, name, value) => match value {
            Some(value) => object.set_value_in_option(option, name, value),
            None => Ok(object.remove_value_in_option(option, name)),
        },
        FieldChange::AssetOption(name, value) => {
            let asset = object.asset_object()?;
            match value {
                Some(value) => asset.set_value(name, value, NewValueSyntax::Option),
                // `emissive_strength` without `emissive` is an error in scripts.
                None if *name == "emissive" => Ok(asset.remove_values(&["emissive", "emissive_strength"])),
                None => Ok(asset.remove_values(&[name])),
            }
        }
        FieldChange::Argument(number, value) => object.set_argument(*number, value),
        FieldChange::Time(..)
        | FieldChange::Trim(..)
        | FieldChange::FocalLength(..)
        | FieldChange::KeyedPoint(..) => {
            Err(EditRefused::from("this field cannot be changed by replacing one value".to_string()))
        }
    }
}
