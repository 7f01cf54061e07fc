//! Changes of the inspector: values of cues, lights, cameras, titles and actors, each stated as the script does already, and taken away
//! again, so that the default counts.

use super::EditError;
use crate::app::Viewer;
use crate::state::selection::{Selected, actor};
use choreo_script::{Place, mask_problem};
use choreo_session::edit::{
    Anew, CueTime, Edit, EditRefused, EditTime, KeyValue, ScriptObject, Typed, expression, format_as_meant,
    set_time, set_trim,
};
use choreo_stage::{Camera, Property};
use glam::DVec3;
use std::collections::BTreeMap;

/// A change of one value by its name in scripts.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldChange {
    /// A time of a cue, effect or title, seconds.
    Time(CueTime, Typed),
    /// A value as it is written, where the script does not compute it.
    Value(&'static str, String, Anew),
    /// A text of the script, in place of whatever is there.
    Text(&'static str, String, Anew),
    /// Takes these away.
    Reset(Vec<&'static str>),
    /// The part of a clip that is played, seconds, and the end of it that was typed.
    Trim([f64; 2], Typed),
    /// `once`, `loop` or `ping_pong`.
    Repeat(&'static str),
    Clip(String),
    /// Words of a title.
    Words(String),
    /// Millimetres, and as they are written.
    FocalLength(f64, String),
    /// An option of the shape or the built-in character that an actor is cast from.
    Material(&'static str, Option<String>),
    /// A value in the map of an option, such as `size` in `shadow`; `None` takes it away.
    Within(&'static str, &'static str, Option<String>),
    /// An argument of a call, from 0.
    Argument(usize, String),
    /// The key of a point at the playhead, by the name of its property, and the number of it that was typed.
    KeyedPoint(&'static str, DVec3, Typed),
}

/// A call of the script that states something of an actor: a constraint, an attachment, springs.
#[derive(Clone, Debug)]
pub struct StatedCall {
    pub place: Place,
    /// How many things the line makes.
    pub siblings: usize,
    /// Name and arguments of the call.
    pub title: String,
    /// Its first two arguments: the target of a camera and the offset from it.
    pub arguments: [Option<String>; 2],
    /// Options and methods of the call, as they are written.
    pub written: BTreeMap<String, String>,
}

/// Methods that say how a clip goes on.
const REPEATS: [&str; 5] = ["repeat", "once", "loop", "ping_pong", "hold"];

impl Viewer {
    /// Changes a value of what is selected.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub(crate) fn change_field(&mut self, what: &Selected, change: &FieldChange) -> Result<(), EditError> {
        let done = self.change_field_once(what, change);
        let (what, change) = (what.clone(), change.clone());
        self.or_written_out(done, move |viewer| viewer.change_field(&what, &change))
    }

    fn change_field_once(&mut self, what: &Selected, change: &FieldChange) -> Result<(), EditError> {
        match change {
            FieldChange::Time(CueTime::FadeIn, time) if matches!(what, Selected::Cue { .. }) => {
                let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
                let when = self.edit_time(time.value);
                self.change(&place, siblings, |text| {
                    let (line, column) = (place.line, place.column);
                    let made = in_place_of(text, (line, column), &["inertial"], |text| {
                        set_time(text, line, column, CueTime::FadeIn, when)
                    });
                    time.keep_time(text, made, when.fps)
                })
            }
            FieldChange::Time(part, time) => self.set_typed_cue(what, *part, time),
            FieldChange::FocalLength(length, text) => self.set_focal_length(what, *length, text),
            FieldChange::KeyedPoint(name, point, typed) => {
                let keyed = self.keyed(what, name)?;
                let step = self.value_step(&keyed, self.playhead.time(), &point.to_array())?;
                self.change_all(vec![step.keeping(typed)])
            }
            FieldChange::Trim(trim, typed) => {
                let fps = self.playhead.fps().as_fps();
                let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
                self.change(&place, siblings, |text| {
                    typed.keep_time(text, set_trim(text, place.line, place.column, *trim, fps), fps)
                })
            }
            change => {
                let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
                if let Some(why) = self.problem_of_mask(what, change).or_else(|| problem_of_speed(change)) {
                    return Err(EditError::refused_at(&place, &why));
                }
                if let Some(shared) = self.offer_of_layer(what, change) {
                    return Err(shared);
                }
                if matches!(change, FieldChange::Material(..))
                    && let Some(shared) =
                        self.offer_of_asset(what, &place, |object, text| changed(object, text, change))
                {
                    return Err(shared);
                }
                self.change(&place, siblings, |text| {
                    changed(&ScriptObject::at(text, place.line, place.column)?, text, change)
                })
            }
        }
    }

    /// Takes an option of what is selected out of the script.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_field`] does.
    pub(crate) fn unstate(&mut self, what: &Selected, name: &str) -> Result<(), EditError> {
        let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
        self.change(&place, siblings, |text| {
            Ok(ScriptObject::at(text, place.line, place.column)?.unstate(&[name]))
        })
    }

    /// Why the mask that a change writes fits the joints of the actor not.
    fn problem_of_mask(&self, what: &Selected, change: &FieldChange) -> Option<String> {
        let FieldChange::Text("on", mask, _) = change else { return None };
        let stage = &self.scene.as_ref()?.stage;
        let asset = &stage.actors[actor(stage, what.actor()?)?].asset;
        mask_problem(asset, mask)
    }

    /// Changes a setting of the stage; a script that states none gets the call of `stage`, before all but its first comments.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn change_stage(&mut self, change: &FieldChange) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let place = &scene.places.settings;
        if place.line > 0 {
            let fps = self.playhead.fps().as_fps();
            return self.change(place, 1, |text| {
                let object = ScriptObject::at(text, place.line, place.column)?;
                match change {
                    FieldChange::Value("length", length, anew) => {
                        let in_frames = stage_length(&object, text, length, fps);
                        in_frames.unwrap_or_else(|| object.state("length", length, *anew))
                    }
                    change => changed(&object, text, change),
                }
            });
        }
        let FieldChange::Value(name, value, _) = change else { return Ok(()) };
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let text = super::read(&path)?;
        let comments = text.split_inclusive('\n').take_while(|line| line.starts_with("//"));
        let at = comments.map(str::len).sum();
        let edit = Edit { range: at..at, text: format!("stage(#{{ {name}: {value} }});\n") };
        self.write_edit(&path, &text, edit)
    }

    /// The settings of the stage that the script states, by name.
    pub fn stage_written(&self) -> BTreeMap<String, String> {
        let all = || {
            let place = &self.scene.as_ref()?.places.settings;
            Some(self.text()?.object(place.line, place.column).ok()?.all_written())
        };
        all().unwrap_or_default()
    }

    /// Changes a value of a constraint, an attachment or springs, which a call at a place states.
    ///
    /// # Errors
    /// Fails as `Viewer::change_field` does.
    pub fn change_call(&mut self, call: &StatedCall, change: &FieldChange) -> Result<(), EditError> {
        let fps = self.playhead.fps().as_fps();
        self.change(&call.place, call.siblings, |text| {
            let object = ScriptObject::at(text, call.place.line, call.place.column)?;
            match change {
                FieldChange::Time(part, time) => {
                    let name = match part {
                        CueTime::Start => "from",
                        CueTime::End => "until",
                        CueTime::FadeIn | CueTime::FadeOut => "fade",
                    };
                    let made = object.state_time(name, EditTime { secs: time.value, fps }, Anew::Option);
                    time.keep_time(text, made, fps)
                }
                change => changed(&object, text, change),
            }
        })
    }

    /// Calls of these names that the script states for something, which it makes alone.
    pub fn stated_calls(&self, what: &Selected, names: &[&str]) -> Vec<StatedCall> {
        let Some((place, siblings)) = self.place_of(what) else {
            return Vec::new();
        };
        let places = self.read_object(&place, siblings, |object| Some(object.places_of(names)));
        let call = |(line, column)| self.stated_call(&Place { line, column, ..place.clone() }, 1, "");
        places.unwrap_or_default().into_iter().map(call).collect()
    }

    /// The call at a place; `name` where its text cannot be edited.
    pub fn stated_call(&self, place: &Place, siblings: usize, name: &str) -> StatedCall {
        let call = |title: String, arguments, written| {
            let place = place.clone();
            StatedCall { place, siblings, title, arguments, written }
        };
        let read = self.read_object(place, siblings, |object| {
            let title = format!("{} {}", object.made_by(), object.arguments());
            let arguments = [0, 1].map(|number| object.argument(number).map(str::to_string));
            Some(call(title.trim().to_string(), arguments, object.all_written()))
        });
        read.unwrap_or_else(|| call(name.to_string(), [None, None], BTreeMap::new()))
    }

    /// The values in the map of an option, by name.
    pub fn written_within(&self, what: &Selected, option: &str) -> BTreeMap<String, String> {
        self.read_selected(what, |object| Some(object.within_option(option)?.all_written()))
            .unwrap_or_default()
    }

    /// The arguments or the option of that name, as the script states them of something that it makes alone.
    pub fn written(&self, what: &Selected, name: &str) -> Option<String> {
        self.read_selected(what, |object| object.written(name).map(str::to_string))
    }

    /// Everything that the script states of something that it makes alone: options and arguments of methods, by name.
    pub fn all_written(&self, what: &Selected) -> BTreeMap<String, String> {
        self.read_selected(what, |object| Some(object.all_written())).unwrap_or_default()
    }

    /// The name of the call that makes the asset of an actor, its arguments before the options, and the options as they are written; `None`
    /// where the asset is made in another way.
    pub(crate) fn written_asset(
        &self,
        what: &Selected,
    ) -> Option<(String, String, BTreeMap<String, String>)> {
        self.read_selected(what, |object| {
            let asset = object.asset_object().ok()?;
            Some((asset.made_by().to_string(), asset.arguments().to_string(), asset.all_written()))
        })
    }

    /// Reads the call at a place, in the text of the script that is shown; `None` where it makes several things or is elsewhere.
    pub(super) fn read_object<R>(
        &self,
        place: &Place,
        siblings: usize,
        read: impl FnOnce(&ScriptObject) -> Option<R>,
    ) -> Option<R> {
        self.check_place(place, siblings).ok()?;
        read(&self.text()?.object(place.line, place.column).ok()?)
    }

    /// Reads the call that makes what is selected.
    pub(super) fn read_selected<R>(
        &self,
        what: &Selected,
        read: impl FnOnce(&ScriptObject) -> Option<R>,
    ) -> Option<R> {
        let (place, siblings) = self.place_of(what)?;
        self.read_object(&place, siblings, read)
    }

    /// Sets the lens of a camera, in millimetres where the script states them or nothing, else as the same field of view.
    fn set_focal_length(&mut self, what: &Selected, length: f64, length_text: &str) -> Result<(), EditError> {
        let Selected::Camera(name) = what else { return Err(EditError::refused("only cameras have a lens")) };
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let camera = scene.stage.cameras.iter().find(|c| c.name == *name).ok_or(EditError::Gone)?;
        let keyed = |property| camera.channels.iter().any(|c| c.property == property);
        let in_degrees = keyed(Property::FieldOfView)
            || self.written(what, "fov").is_some() && self.written(what, "focal_length").is_none();
        if in_degrees {
            let degrees = Camera::yfov(length).to_degrees();
            let is_meant = |read: f64| is_as_shown(Camera::focal_length(read.to_radians()), length);
            return self.set_field_of_view(name, degrees, &format_as_meant(degrees, is_meant));
        }
        let when = self.edit_time(self.playhead.time().as_secs());
        let is_keyed = keyed(Property::FocalLength);
        let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
        self.change(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            match is_keyed {
                true => object.set_key("focal_length", when, KeyValue::Text(length_text)),
                false => object.state("focal_length", length_text, Anew::Method),
            }
        })
    }
}

/// Why a clip cannot have the speed that a change writes.
fn problem_of_speed(change: &FieldChange) -> Option<String> {
    let FieldChange::Value("speed", speed, _) = change else { return None };
    let stands = expression::value(speed, 1.0)?.abs() < 1e-3;
    stands.then(|| format!("a clip has a speed of at least 0.001, or at most -0.001 backwards, not {speed}"))
}

/// The change of the length of the stage to the nearest frame, where the script counts it in frames.
fn stage_length(
    object: &ScriptObject,
    text: &str,
    length: &str,
    fps: f64,
) -> Option<Result<Edit, EditRefused>> {
    object.written("length").filter(|written| expression::counts_frames(written))?;
    let secs = expression::value(length, fps)?;
    let frame = EditTime { secs: (secs * fps).round().max(1.0) / fps, fps };
    let made = object.state_time("length", frame, Anew::Option);
    // An expression is kept as it was typed.
    let typed = Typed { value: frame.secs, text: length.to_string() };
    let is_number = length.parse::<f64>().is_ok();
    Some(if is_number { made } else { typed.keep_time(text, made, fps) })
}

/// Whether two numbers are the same as fields show them, to the thousandth, also once single precision has rounded them.
pub(super) fn is_as_shown(a: f64, b: f64) -> bool {
    (a - b).abs() < 2e-5
}

/// A change that excludes other values of the call at a place, which it takes away. `make` gives it for the text without those.
fn in_place_of(
    text: &str,
    (line, column): (usize, usize),
    others: &[&str],
    make: impl Fn(&str) -> Result<Edit, EditRefused>,
) -> Result<Edit, EditRefused> {
    let object = ScriptObject::at(text, line, column)?;
    if others.iter().all(|other| object.written(other).is_none()) {
        return make(text);
    }
    // Nothing before the call has changed.
    let unstated = object.unstate(others);
    let plain = unstated.apply(text);
    let edit = make(&plain).map_err(|refused| refused.before(text, &[unstated]))?;
    Ok(Edit::between(text, &edit.apply(&plain)))
}

/// The edit that makes a change of what a call makes.
pub(super) fn changed(object: &ScriptObject, text: &str, change: &FieldChange) -> Result<Edit, EditRefused> {
    match change {
        FieldChange::Value("inertial", value, anew) => {
            let (line, column) = object.place();
            in_place_of(text, (line, column), &["fade", "in_step"], |text| {
                ScriptObject::at(text, line, column)?.state("inertial", value, *anew)
            })
        }
        FieldChange::Value(name, value, anew) => object.state(name, value, *anew),
        FieldChange::Text(name, value, anew) => object.state_over(name, value, *anew),
        FieldChange::Reset(names) => Ok(object.unstate(names)),
        FieldChange::Clip(name) => object.state_clip(name),
        FieldChange::Words(words) => object.state_words(words),
        FieldChange::Repeat(how) => {
            let (line, column) = object.place();
            let value = format!("\"{how}\"");
            in_place_of(text, (line, column), &REPEATS, |text| {
                ScriptObject::at(text, line, column)?.state("repeat", &value, Anew::Option)
            })
        }
        FieldChange::Within(option, name, value) => match value {
            Some(value) => object.state_within(option, name, value),
            None => Ok(object.unstate_within(option, name)),
        },
        FieldChange::Material(name, value) => {
            let asset = object.asset_object()?;
            match value {
                Some(value) => asset.state(name, value, Anew::Option),
                // A strength alone is refused.
                None if *name == "emissive" => Ok(asset.unstate(&["emissive", "emissive_strength"])),
                None => Ok(asset.unstate(&[name])),
            }
        }
        FieldChange::Argument(number, value) => object.state_argument(*number, value),
        FieldChange::Time(..)
        | FieldChange::Trim(..)
        | FieldChange::FocalLength(..)
        | FieldChange::KeyedPoint(..) => Err(EditRefused::from("it is changed in another way".to_string())),
    }
}
