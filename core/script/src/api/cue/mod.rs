//! Cues: clips on the timeline of an actor.

mod clips;
pub(crate) mod layer;
mod options;
mod times;

use crate::build::{CueDraft, check_limit};
use crate::call::{ApiError, Call, Reply, api};
use crate::value::CueRef;
use choreo_stage::{Property, Repeat, TimeRemapping};
pub(crate) use clips::{bind_clip, bound_clip};
pub use layer::mask_problem;
pub(crate) use layer::reference;
use layer::{additive, layer_weight, on, priority, subtractive};
use options::change_copy;
pub(crate) use options::{DEFS as OPTION_DEFS, read_options};
use rhai::Dynamic;
use std::sync::Arc;
use times::{end, length, start, time_of};

api! {
    /// Plays another clip after this cue and returns the new cue. It starts at .until of this cue or, without
    /// .until, so that a crossfade ends with the clip.
    /// - Options, as in the methods of the same names: from, until, fade, fade_out, ease, speed, trim, reverse,
    ///   weight; repeat ("once", "loop", "ping_pong").
    /// - `in_step: true` matches the phases of both clips during the crossfade (foot-phase synchronization, such as
    ///   walk into run): feet come down together and stay where they stand, for bipeds and quadrupeds.
    /// - `inertial: seconds` makes an inertialized transition in place of a crossfade: the new clip begins at once
    ///   with full weight, and the offset from the pose before decays to zero in that time.
    Cue.then("clip, options?") -> Cue = then;
    /// Remaps time: keyframes [[time, seconds of the clip], …] map times of the stage to times of the clip. Beyond its
    /// ends the clip repeats as set by .once, .loop or .ping_pong. `how`, easing and tangents as in Actor.key.
    Cue.clip_time("keys, how?") = clip_time;
    /// Stops the clip at a time for a number of seconds, then goes on from there.
    Cue.freeze("time, seconds") = freeze;
    /// Plays once and holds the last pose, also on a layer, until .until or for good.
    Cue.hold("") = hold;
    /// Plays once. Then the base layer holds the last pose, and a layer has faded out. This is the default on
    /// layers, and for a cue without .until that another cue follows.
    Cue.once("") = once;
    /// Repeats the clip. This is the default of all other cues.
    Cue.loop("") = looped;
    /// Plays forwards and backwards in turns.
    Cue.ping_pong("") = ping_pong;
    /// Makes this cue and those that follow it a layer with a mask: it plays only on some joints.
    /// - Joints: "Spine.." for a joint and all below it, "Head" for one joint, `"*Arm*"` for a pattern, an array of
    ///   these, or an object map of them with weights from 0 to 1; where several match a joint, the most specific
    ///   one counts.
    /// - Options: soft (number of joints above the mask over which the weight falls to 0, default 0).
    Cue.on("joints, options?") = on;
    /// Makes this cue and those that follow it an additive layer: it adds the difference between the clip and a
    /// reference pose to the layers below. The reference is "first" (the first frame, the default), "rest" (the
    /// rest pose) or a time of the clip in seconds. The order of additive layers does not matter.
    Cue.additive("reference?") = additive;
    /// Makes a layer as Cue.additive does, but subtracts the difference.
    Cue.subtractive("reference?") = subtractive;
    /// Sets the weight of the whole layer (0 to 1, default 1), which multiplies the weight of each cue on it. A
    /// number, or keyframes as in Cue.weight.
    Cue.layer_weight("weight | keys, how?") = layer_weight;
    /// Makes this cue and those that follow it a layer with a priority, a whole number from 0 to 1000. A layer lies
    /// over all layers of lower priority and over those without one, which lie in the order of the script. Layers
    /// of the same priority are blended by their weights, whatever their order in the script.
    Cue.priority("number") = priority;
    /// Returns how many seconds the clip takes once, at its speed and trim.
    Cue.length("") -> "float" = length;
    /// Returns the stage time in seconds at which the clip reaches a marker or a time of the clip. For a clip that
    /// repeats, `count` says which time it does so (default 1).
    Cue.time_of("marker_or_time, count?") -> "float" = time_of;
    /// Returns the start time in seconds, as set so far.
    Cue.start("") -> "float" = start;
    /// Returns the end time in seconds. A cue that loops without .until has none, which is an error.
    Cue.end("") -> "float" = end;
}

fn change(c: &Call, change: impl FnOnce(&mut CueDraft) -> Result<(), ApiError>) -> Reply {
    let this: CueRef = c.this()?;
    change(c.stage_draft().cue(this.0)?)?;
    c.receiver()
}

fn then(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let (chain, actor) = {
        let mut stage_draft = c.stage_draft();
        let chain = stage_draft.cue(this.0)?.chain;
        (chain, stage_draft.chains[chain].actor)
    };
    let asset = c.stage_draft().actor(actor)?.actor.asset.clone();
    let clip = bound_clip(c, 0, &asset)?;
    check_limit(c.stage_draft().cues.len(), "cues", &c.context.limits)?;
    let origin = c.stage_draft().sequence_start;
    let mut cue =
        CueDraft { origin, predecessor: Some(this.0), ..CueDraft::new(chain, clip, c.place.clone()) };
    read_options(c, 1, &mut cue)?;
    let mut stage_draft = c.stage_draft();
    let before = stage_draft.cue(this.0)?;
    if before.has_successor {
        return Err(ApiError::new("then: another cue follows this cue already")
            .hint("call the next .then on the cue that follows"));
    }
    let endless = matches!(before.repeat, Some(Repeat::Loop | Repeat::PingPong)) && before.until.is_none();
    if endless && cue.start.is_none() {
        return Err(ApiError::new("then: the cue before it repeats without end")
            .hint("give it an end with .until(time)"));
    }
    before.has_successor = true;
    stage_draft.cues.push(cue);
    Ok(Dynamic::from(CueRef(stage_draft.cues.len() - 1)))
}

fn clip_time(c: &mut Call) -> Reply {
    let how = super::keys::read_interpolation(c, 1)?;
    change_copy(c, |cue| {
        let end = cue.cue.clip.duration.as_secs();
        let within = |v: &Dynamic, label: &str| crate::call::number_in(v, label, -1e6, 1e6);
        let keys =
            super::keys::scalar_channel(c, &c.value(0), "clip_time", how, Property::ClipTime, &within)?;
        if end <= 0.0 {
            return Err(ApiError::new("clip_time: the clip has no length"));
        }
        cue.cue.time_remapping = Some(Arc::new(TimeRemapping::ClipTime(keys)));
        Ok(())
    })
}

fn freeze(c: &mut Call) -> Reply {
    let (from, secs) = (c.time(0)?, c.duration(1)?);
    change(c, |cue| {
        let to = from + secs;
        if let Some(other) = cue.cue.freezes.iter().find(|f| from < f.1 && f.0 < to) {
            let (a, b) = (other.0.as_secs(), other.1.as_secs());
            return Err(ApiError::new(format!("freeze: the clip is already frozen from {a} s to {b} s")));
        }
        cue.cue.freezes.push((from, to));
        cue.cue.freezes.sort_unstable();
        Ok(())
    })
}

fn hold(c: &mut Call) -> Reply {
    change(c, |cue| {
        cue.repeat = Some(Repeat::Once);
        cue.holds_last_pose = true;
        Ok(())
    })
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
