//! The options of `play` and `then`. Most of them are also methods of a cue, declared from the same table.

use crate::api::easing::ease_of;
use crate::api::keys;
use crate::build::CueDraft;
use crate::call::{ApiError, Call, Function, Reply, number, number_in, numbers, wrong};
use crate::def::{Def, ResultType};
use crate::value::{CueRef, HandleKind};
use choreo_motion::Time;
use choreo_stage::{Channel, Property, Repeat, SpeedCurve, TimeRemapping};
use rhai::Dynamic;
use std::sync::Arc;

/// An option of `play` and `then`.
struct CueOption {
    pub name: &'static str,
    set: fn(&Call, &mut CueDraft, &CueOptionValue) -> Result<(), ApiError>,
}

/// The value of an option, or the argument of the method of the same name.
struct CueOptionValue {
    value: Dynamic,
    label: String,
    /// The interpolation, where the value is an array of keyframes.
    how: keys::KeyInterpolation,
}

impl CueOptionValue {
    fn duration(&self) -> Result<Time, ApiError> {
        crate::call::duration(&self.value, &self.label)
    }
    fn flag(&self) -> Result<bool, ApiError> {
        self.value.as_bool().map_err(|_| wrong(&self.value, &self.label, "true or false"))
    }
}

/// Declares options with their methods as in [`api!`](crate::call::api); `option` declares one without a method.
macro_rules! options {
    ($($(#[doc = $doc:literal])+ $name:ident($args:literal) = $set:expr;)* $(option $only:ident = $only_set:expr;)*) => {
        const OPTIONS: &[CueOption] = &[
            $(CueOption { name: stringify!($name), set: $set },)*
            $(CueOption { name: stringify!($only), set: $only_set },)*
        ];
        pub(crate) const DEFS: &[Function] = &[$(Function {
            def: Def {
                on: HandleKind::Cue,
                name: stringify!($name),
                args: $args,
                returns: ResultType::Receiver,
                doc: &[$($doc),+],
                options: None,
                is_for_frames: false,
                is_for_tests: false,
            },
            run: method,
        }),*];
    };
}

// The order is that in which options are applied: a negative speed comes before `reverse`.
options! {
    /// Sets the start time of the cue.
    from("time") = |c, cue, given| {
        cue.start = Some(c.stage_time(&given.value, &given.label)?);
        Ok(())
    };
    /// Sets the end time of the cue. On the base layer the next cue takes over, or the pose is held; on other
    /// layers the cue has faded out by then.
    until("time") = |c, cue, given| {
        cue.until = Some(c.stage_time(&given.value, &given.label)?);
        Ok(())
    };
    /// Sets the duration of the crossfade or fade-in in seconds (default 0); on a layer also that of the fade-out.
    fade("seconds") = |_, cue, given| {
        cue.cue.fade_in = given.duration()?;
        cue.fade_out = Some(cue.cue.fade_in);
        Ok(())
    };
    /// Sets the duration of the fade-out of a layer in seconds.
    fade_out("seconds") = |_, cue, given| {
        cue.fade_out = Some(given.duration()?);
        Ok(())
    };
    /// Sets the easing of the fades: "linear" (the default), "smooth", one of in_, out_ or in_out_ with sine, quad,
    /// cubic, quart, quint, expo or circ ("in_out_cubic"), or a Bézier curve [x1, y1, x2, y2] as in CSS.
    ease("how") = |_, cue, given| {
        cue.cue.ease = ease_of(&given.value, &given.label)?;
        Ok(())
    };
    /// Sets the playback speed: clip seconds per second (default 1, 0.001 to 1000; negative plays backwards). Or
    /// keyframes of it, [[time, factor], …]; `how`, easing and tangents as in Actor.key.
    speed("factor | keys, how?") = speed;
    /// Plays only this part of the clip, in seconds of the clip.
    trim("start, end") = trim;
    /// Plays backwards.
    reverse("") = |_, cue, given| {
        cue.reverse ^= given.flag()?;
        Ok(())
    };
    /// Sets the weight of the cue: 0 not at all, 1 fully (default 1). Or keyframes of it, [[time, weight], …];
    /// `how`, easing and tangents as in Actor.key.
    weight("weight | keys, how?") = |c, cue, given| {
        if given.value.is_array() {
            cue.cue.weight_keys = Some(Arc::new(weight_keys(c, given)?));
        } else {
            cue.cue.weight = number_in(&given.value, &given.label, 0.0, 1.0)? as f32;
            cue.cue.weight_keys = None;
        }
        Ok(())
    };
    option repeat = |_, cue, given| {
        cue.repeat = Some(match crate::call::one_of(&given.value, &given.label, &["once", "loop", "ping_pong"])? {
            "once" => Repeat::Once,
            "loop" => Repeat::Loop,
            _ => Repeat::PingPong,
        });
        Ok(())
    };
    option in_step = |_, cue, given| {
        cue.in_step = given.flag()?;
        Ok(())
    };
    option inertial = |_, cue, given| {
        cue.cue.inertialization = given.duration()?;
        Ok(())
    };
}

/// Reads the option map at `i` into a cue.
pub(crate) fn read_options(c: &Call, i: usize, cue: &mut CueDraft) -> Result<(), ApiError> {
    let names: Vec<&str> = OPTIONS.iter().map(|option| option.name).collect();
    let o = c.options(i, &names)?;
    for option in OPTIONS {
        if let Some(value) = o.get(option.name) {
            (option.set)(
                c,
                cue,
                &CueOptionValue { value, label: o.label(option.name), how: keys::KeyInterpolation::LINEAR },
            )?;
        }
    }
    Ok(())
}

/// Runs the method with the name of an option.
fn method(c: &mut Call) -> Reply {
    let Some(option) = OPTIONS.iter().find(|option| option.name == c.def.name) else { return c.receiver() };
    let how = match c.def.args.ends_with("how?") {
        true => keys::read_interpolation(c, 1)?,
        false => keys::KeyInterpolation::LINEAR,
    };
    let (value, label) = match c.len() {
        0 => (Dynamic::TRUE, option.name.to_string()),
        2 if c.def.args == "start, end" => (vec![c.value(0), c.value(1)].into(), option.name.to_string()),
        _ if c.value(0).is_array() => (c.value(0), option.name.to_string()),
        _ => (c.value(0), c.label(0)),
    };
    change_copy(c, |cue| (option.set)(c, cue, &CueOptionValue { value, label, how }))
}

/// Changes a copy of the cue, so that the build stays accessible while the values of the script are read.
pub(crate) fn change_copy(c: &Call, change: impl FnOnce(&mut CueDraft) -> Result<(), ApiError>) -> Reply {
    let this: CueRef = c.this()?;
    let mut draft = c.stage_draft().cue(this.0)?.clone();
    change(&mut draft)?;
    *c.stage_draft().cue(this.0)? = draft;
    c.receiver()
}

fn weight_keys(c: &Call, given: &CueOptionValue) -> Result<Channel, ApiError> {
    let within = |v: &Dynamic, label: &str| number_in(v, label, 0.0, 1.0);
    keys::scalar_channel(c, &given.value, &given.label, given.how, Property::Weight, &within)
}

/// Sets the playback speed: a factor, or keyframes of it over stage time.
fn speed(c: &Call, cue: &mut CueDraft, given: &CueOptionValue) -> Result<(), ApiError> {
    let CueOptionValue { value, label, how } = given;
    if value.is_array() {
        let within = |v: &Dynamic, label: &str| number_in(v, label, -1000.0, 1000.0);
        let keys = keys::scalar_channel(c, value, label, *how, Property::Speed, &within)?;
        cue.cue.time_remapping = Some(Arc::new(TimeRemapping::Speed(SpeedCurve::new(keys))));
        return Ok(());
    }
    let speed = number(value, label)?;
    if !(0.001..=1000.0).contains(&speed.abs()) {
        return Err(ApiError::new(format!(
            "{label} must be from 0.001 to 1000 (or negative, backwards), got {speed:?}"
        )));
    }
    cue.cue.time_remapping = None;
    cue.cue.speed = speed.abs();
    cue.reverse = speed < 0.0;
    Ok(())
}

fn trim(_: &Call, cue: &mut CueDraft, given: &CueOptionValue) -> Result<(), ApiError> {
    let ends = numbers(&given.value).filter(|ends| ends.len() == 2);
    let ends = ends.ok_or_else(|| wrong(&given.value, &given.label, "[start, end]"))?;
    let (start, end) = (Time::from_secs(ends[0]), Time::from_secs(ends[1]));
    let clip = &cue.cue.clip;
    if start < Time::ZERO || end > clip.duration || start >= end {
        return Err(ApiError::new(format!(
            "trim: from {} s to {} s is not a part of clip \"{}\", which runs from 0 s to {} s",
            start.as_secs(),
            end.as_secs(),
            clip.name,
            clip.duration.as_secs()
        )));
    }
    cue.trim = Some((start, end));
    Ok(())
}
