//! Cues: clips placed on an actor's timeline.

mod clips;
mod layer;
mod options;
mod times;

use crate::build::{CueDraft, room};
use crate::call::{ApiError, Call, Def, Gives, Reply};
use crate::value::*;
use choreo_stage::{Property, Repeat, Warp};
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
    Def::new(Kind::Cue, "from", "time", THIS, "When the clip starts.", from),
    Def::new(
        Kind::Cue,
        "until",
        "time",
        THIS,
        "When it is over: the next takes its place, a layer is gone by then.",
        until,
    ),
    Def::new(
        Kind::Cue,
        "then",
        "clip, options?",
        Gives::A(Kind::Cue),
        "What follows, at .until, or as the clip ends; options: fade, fade_out, speed, ease, trim, repeat (\"once\", \"loop\", \"ping_pong\"), reverse, weight, from, until; in_step: true (while it fades in, feet come down as those of the clip before and stay where they stand, on two legs or four: walk into run), inertial: seconds (begins at once, and what the pose before was away from it dies down; no fade).",
        then,
    ),
    Def::new(
        Kind::Cue,
        "fade",
        "seconds",
        THIS,
        "How long it takes to come in, and, on a layer, to go.",
        fade,
    ),
    Def::new(Kind::Cue, "fade_out", "seconds", THIS, "How long a layer takes to go.", fade_out),
    Def::new(
        Kind::Cue,
        "ease",
        "how",
        THIS,
        "How it fades: \"linear\", \"smooth\", in_, out_ or in_out_ with sine, quad, cubic, quart, quint, expo or circ (\"in_out_cubic\"), or a Bézier curve [x1, y1, x2, y2] as in CSS.",
        ease,
    ),
    Def::new(
        Kind::Cue,
        "speed",
        "factor | keys, how?",
        THIS,
        "Clip seconds a second; negative plays backwards. Or keys of it over time, [[time, factor], …]; how as for Actor.key.",
        speed,
    ),
    Def::new(
        Kind::Cue,
        "clip_time",
        "keys, how?",
        THIS,
        "Where in the clip it is when, [[time, seconds of the clip], …]; beyond its ends as it repeats.",
        clip_time,
    ),
    Def::new(
        Kind::Cue,
        "freeze",
        "time, seconds",
        THIS,
        "The clip stands still from then for so long, and goes on where it was.",
        freeze,
    ),
    Def::new(
        Kind::Cue,
        "hold",
        "",
        THIS,
        "Plays once and holds the last pose, a layer too, until .until or for good.",
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
        "Plays once and holds the last pose; a layer goes away. What cues do that another follows without .until, and layers.",
        once,
    ),
    Def::new(Kind::Cue, "loop", "", THIS, "Plays again and again. What other cues do.", looped),
    Def::new(Kind::Cue, "ping_pong", "", THIS, "Plays there and back, again and again.", ping_pong),
    Def::new(
        Kind::Cue,
        "weight",
        "weight | keys, how?",
        THIS,
        "How much it counts: 0 not at all, 1 fully, or keys of it over time, [[time, weight], …]; how as for Actor.key.",
        weight,
    ),
    Def::new(
        Kind::Cue,
        "on",
        "joints, options?",
        THIS,
        "Makes this cue and those that follow a layer over some joints: \"Spine..\" a joint and all below it, \"Head\" one joint, \"*Arm*\" a pattern, an array of these, or an object map of them with weights, where the closest name counts; options: soft (so many joints above take part too, less and less).",
        on,
    ),
    Def::new(
        Kind::Cue,
        "additive",
        "reference?",
        THIS,
        "Makes this cue and those that follow a layer that adds to what is below what its clip does beyond a pose: its \"first\" frame (left out), the \"rest\" pose, or the clip at a time in seconds. Such layers come out the same in any order.",
        additive,
    ),
    Def::new(Kind::Cue, "subtractive", "reference?", THIS, "As additive, but takes it away.", subtractive),
    Def::new(
        Kind::Cue,
        "layer_weight",
        "weight | keys, how?",
        THIS,
        "How much its layer counts as a whole, times the weight of each clip on it: a number, or keys over time as for weight.",
        layer_weight,
    ),
    Def::new(
        Kind::Cue,
        "priority",
        "number",
        THIS,
        "Makes this cue and those that follow a layer that lies over all of a lower number and over those without, which lie in the order of the script; layers of one number are mixed by their weights, in whatever order they are written.",
        priority,
    ),
    Def::new(
        Kind::Cue,
        "length",
        "",
        Gives::Value("float"),
        "Seconds that the clip takes once, at its speed and trim.",
        length,
    ),
    Def::new(
        Kind::Cue,
        "time_of",
        "marker_or_time, count?",
        Gives::Value("float"),
        "When on stage the clip gets to a marker or to a time of the clip, in seconds; of clips that repeat, the count-th time (1).",
        time_of,
    ),
    Def::new(
        Kind::Cue,
        "start",
        "",
        Gives::Value("float"),
        "When it starts, in seconds, as far as said.",
        start,
    ),
    Def::new(
        Kind::Cue,
        "end",
        "",
        Gives::Value("float"),
        "When it is over, in seconds; an error for a cue that loops without .until.",
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

/// Changes a copy, so that reading the script's values may look at the build too.
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
        cue.warp = Some(Arc::new(Warp::ClipTime(keys)));
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
