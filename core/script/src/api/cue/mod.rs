//! Cues: clips on the timeline of an actor.

mod clips;
mod layer;
mod options;
mod times;

use crate::build::{CueDraft, room};
use crate::call::{ApiError, Call, Def, Gives, Reply};
use crate::value::*;
use choreo_stage::{Property, Repeat, TimeRemapping};
pub use clips::bound_clip;
pub use layer::reference;
use layer::{additive, layer_weight, on, priority, subtractive};
pub use options::{ease_of, read_options};
use options::{set_speed, set_trim, set_weight};
use rhai::Dynamic;
use std::sync::Arc;
pub use times::all_times;
use times::{end, length, start, time_of};

const THIS: Gives = Gives::Itself;
pub const DEFS: &[Def] = &[
    Def::new(Kind::Cue, "from", "time", THIS, "Sets the start time of the cue.", from),
    Def::new(
        Kind::Cue,
        "until",
        "time",
        THIS,
        "Sets the end time of the cue. On the base layer the next cue takes over, or the pose is held; on other layers the cue has faded out by then.",
        until,
    ),
    Def::new(
        Kind::Cue,
        "then",
        "clip, options?",
        Gives::A(Kind::Cue),
        "Plays another clip after this cue and returns the new cue. It starts at .until of this cue or, without .until, so that a crossfade ends with the clip.\n\
         Options, as in the methods of the same names: from, until, fade, fade_out, ease, speed, trim, repeat (\"once\", \"loop\", \"ping_pong\"), reverse, weight.\n\
         `in_step: true` matches the phases of both clips during the crossfade (foot-phase synchronization, such as walk into run): feet come down together and stay where they stand, for bipeds and quadrupeds.\n\
         `inertial: seconds` makes an inertialized transition in place of a crossfade: the new clip begins at once with full weight, and the offset from the pose before decays to zero in that time.",
        then,
    ),
    Def::new(
        Kind::Cue,
        "fade",
        "seconds",
        THIS,
        "Sets the duration of the crossfade or fade-in in seconds (default 0); on a layer also that of the fade-out.",
        fade,
    ),
    Def::new(
        Kind::Cue,
        "fade_out",
        "seconds",
        THIS,
        "Sets the duration of the fade-out of a layer in seconds.",
        fade_out,
    ),
    Def::new(
        Kind::Cue,
        "ease",
        "how",
        THIS,
        "Sets the easing of the fades: \"linear\" (the default), \"smooth\", one of in_, out_ or in_out_ with sine, quad, cubic, quart, quint, expo or circ (\"in_out_cubic\"), or a Bézier curve [x1, y1, x2, y2] as in CSS.",
        ease,
    ),
    Def::new(
        Kind::Cue,
        "speed",
        "factor | keys, how?",
        THIS,
        "Sets the playback speed: clip seconds per second (default 1, 0.001 to 1000; negative plays backwards). Or keyframes of it, [[time, factor], …]; `how` as in Actor.key.",
        speed,
    ),
    Def::new(
        Kind::Cue,
        "clip_time",
        "keys, how?",
        THIS,
        "Remaps time: keyframes [[time, seconds of the clip], …] say which time of the clip is shown when. Beyond its ends the clip repeats as set by .once, .loop or .ping_pong. `how` as in Actor.key.",
        clip_time,
    ),
    Def::new(
        Kind::Cue,
        "freeze",
        "time, seconds",
        THIS,
        "Stops the clip at a time for a number of seconds, then goes on from there.",
        freeze,
    ),
    Def::new(
        Kind::Cue,
        "hold",
        "",
        THIS,
        "Plays once and holds the last pose, also on a layer, until .until or for good.",
        hold,
    ),
    Def::new(Kind::Cue, "reverse", "", THIS, "Plays backwards.", reverse),
    Def::new(
        Kind::Cue,
        "trim",
        "start, end",
        THIS,
        "Plays only this part of the clip, in seconds of the clip.",
        trim,
    ),
    Def::new(
        Kind::Cue,
        "once",
        "",
        THIS,
        "Plays once. Then the base layer holds the last pose, and a layer has faded out. This is the default on layers, and for a cue without .until that another cue follows.",
        once,
    ),
    Def::new(Kind::Cue, "loop", "", THIS, "Repeats the clip. This is the default of all other cues.", looped),
    Def::new(Kind::Cue, "ping_pong", "", THIS, "Plays forwards and backwards in turns.", ping_pong),
    Def::new(
        Kind::Cue,
        "weight",
        "weight | keys, how?",
        THIS,
        "Sets the weight of the cue: 0 not at all, 1 fully (default 1). Or keyframes of it, [[time, weight], …]; `how` as in Actor.key.",
        weight,
    ),
    Def::new(
        Kind::Cue,
        "on",
        "joints, options?",
        THIS,
        "Makes this cue and those that follow it a layer with a mask: it plays only on some joints.\n\
         Joints: \"Spine..\" for a joint and all below it, \"Head\" for one joint, `\"*Arm*\"` for a pattern, an array of these, or an object map of them with weights from 0 to 1; where several match a joint, the most specific one counts.\n\
         Options: soft (number of joints above the mask over which the weight falls to 0, default 0).",
        on,
    ),
    Def::new(
        Kind::Cue,
        "additive",
        "reference?",
        THIS,
        "Makes this cue and those that follow it an additive layer: it adds the difference between the clip and a reference pose to the layers below. The reference is \"first\" (the first frame, the default), \"rest\" (the rest pose) or a time of the clip in seconds. The order of additive layers does not matter.",
        additive,
    ),
    Def::new(
        Kind::Cue,
        "subtractive",
        "reference?",
        THIS,
        "Makes a layer as Cue.additive does, but takes the difference away.",
        subtractive,
    ),
    Def::new(
        Kind::Cue,
        "layer_weight",
        "weight | keys, how?",
        THIS,
        "Sets the weight of the whole layer (0 to 1, default 1), which multiplies the weight of each cue on it. A number, or keyframes as in Cue.weight.",
        layer_weight,
    ),
    Def::new(
        Kind::Cue,
        "priority",
        "number",
        THIS,
        "Makes this cue and those that follow it a layer with a priority, a whole number from 0 to 1000. A layer lies over all layers of lower priority and over those without one, which lie in the order of the script. Layers of the same priority are blended by their weights, whatever their order in the script.",
        priority,
    ),
    Def::new(
        Kind::Cue,
        "length",
        "",
        Gives::Value("float"),
        "Returns how many seconds the clip takes once, at its speed and trim.",
        length,
    ),
    Def::new(
        Kind::Cue,
        "time_of",
        "marker_or_time, count?",
        Gives::Value("float"),
        "Returns the stage time in seconds at which the clip reaches a marker or a time of the clip. For a clip that repeats, `count` says which time it does so (default 1).",
        time_of,
    ),
    Def::new(
        Kind::Cue,
        "start",
        "",
        Gives::Value("float"),
        "Returns the start time in seconds, as set so far.",
        start,
    ),
    Def::new(
        Kind::Cue,
        "end",
        "",
        Gives::Value("float"),
        "Returns the end time in seconds. A cue that loops without .until has none, which is an error.",
        end,
    ),
];

fn change(c: &Call, change: impl FnOnce(&mut CueDraft) -> Result<(), ApiError>) -> Reply {
    let this: CueRef = c.this()?;
    change(c.build().cue(this.0)?)?;
    c.itself()
}

fn from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |cue| {
        cue.start = Some(t);
        Ok(())
    })
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |cue| {
        cue.until = Some(t);
        Ok(())
    })
}

fn then(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let (chain, actor) = {
        let mut build = c.build();
        let chain = build.cue(this.0)?.chain;
        (chain, build.chains[chain].actor)
    };
    let asset = c.build().actor(actor)?.actor.asset.clone();
    let clip = bound_clip(c, 0, &asset)?;
    room(c.build().cues.len(), "cues", &c.shared.limits)?;
    let origin = c.build().offset;
    let mut cue = CueDraft { origin, after: Some(this.0), ..CueDraft::new(chain, clip, c.place.clone()) };
    read_options(c, 1, &mut cue)?;
    let mut build = c.build();
    let before = build.cue(this.0)?;
    if before.followed {
        return Err(ApiError::new("then: something follows this cue already")
            .hint("chain the next .then to that one"));
    }
    let endless = matches!(before.repeat, Some(Repeat::Loop | Repeat::PingPong)) && before.until.is_none();
    if endless && cue.start.is_none() {
        return Err(ApiError::new("then: the cue before repeats without end")
            .hint("say when it is over, with .until(time)"));
    }
    before.followed = true;
    build.cues.push(cue);
    Ok(Dynamic::from(CueRef(build.cues.len() - 1)))
}

fn fade(c: &mut Call) -> Reply {
    let t = c.duration(0)?;
    change(c, |cue| {
        cue.fade_in = t;
        cue.fade_out = Some(t);
        Ok(())
    })
}

fn fade_out(c: &mut Call) -> Reply {
    let t = c.duration(0)?;
    change(c, |cue| {
        cue.fade_out = Some(t);
        Ok(())
    })
}

fn ease(c: &mut Call) -> Reply {
    let how = ease_of(&c.value(0), &c.label(0))?;
    change(c, |cue| {
        cue.ease = how;
        Ok(())
    })
}

/// Changes a copy of the cue, so that the build stays accessible while the values of the script are read.
fn change_copy(c: &Call, change: impl FnOnce(&mut CueDraft) -> Result<(), ApiError>) -> Reply {
    let this: CueRef = c.this()?;
    let mut draft = c.build().cue(this.0)?.clone();
    change(&mut draft)?;
    *c.build().cue(this.0)? = draft;
    c.itself()
}

fn how(c: &Call) -> Result<&'static str, ApiError> {
    if c.len() > 1 { super::keys::how(c, 1) } else { Ok("linear") }
}

fn speed(c: &mut Call) -> Reply {
    let how = how(c)?;
    let label = if c.value(0).is_array() { "speed" } else { "speed: factor" };
    change_copy(c, |cue| set_speed(c, cue, &c.value(0), how, label))
}

fn clip_time(c: &mut Call) -> Reply {
    let how = how(c)?;
    change_copy(c, |cue| {
        let end = cue.clip.duration.as_secs();
        let within = |v: &Dynamic, label: &str| crate::call::number_in(v, label, -1e6, 1e6);
        let keys = super::keys::scalars(c, &c.value(0), "clip_time", how, Property::ClipTime, &within)?;
        if end <= 0.0 {
            return Err(ApiError::new("clip_time: the clip has no length"));
        }
        cue.time_remapping = Some(Arc::new(TimeRemapping::ClipTime(keys)));
        Ok(())
    })
}

fn freeze(c: &mut Call) -> Reply {
    let (from, secs) = (c.time(0)?, c.duration(1)?);
    change(c, |cue| {
        let to = from + secs;
        if let Some(other) = cue.freezes.iter().find(|f| from < f.1 && f.0 < to) {
            let (a, b) = (other.0.as_secs(), other.1.as_secs());
            return Err(ApiError::new(format!("freeze: it stands still from {a} s to {b} s already")));
        }
        cue.freezes.push((from, to));
        cue.freezes.sort_unstable();
        Ok(())
    })
}

fn hold(c: &mut Call) -> Reply {
    change(c, |cue| {
        cue.repeat = Some(Repeat::Once);
        cue.hold = true;
        Ok(())
    })
}

fn reverse(c: &mut Call) -> Reply {
    change(c, |cue| {
        cue.reverse = !cue.reverse;
        Ok(())
    })
}

fn trim(c: &mut Call) -> Reply {
    let (start, end) = (c.duration(0)?, c.duration(1)?);
    change(c, |cue| set_trim(cue, start, end))
}

fn repeat(c: &Call, repeat: Repeat) -> Reply {
    change(c, |cue| {
        cue.repeat = Some(repeat);
        Ok(())
    })
}

fn once(c: &mut Call) -> Reply {
    repeat(c, Repeat::Once)
}

fn looped(c: &mut Call) -> Reply {
    repeat(c, Repeat::Loop)
}

fn ping_pong(c: &mut Call) -> Reply {
    repeat(c, Repeat::PingPong)
}

fn weight(c: &mut Call) -> Reply {
    let how = how(c)?;
    change_copy(c, |cue| set_weight(c, cue, &c.value(0), how, "weight: weight"))
}
