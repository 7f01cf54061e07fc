//! The look-at constraint of heads and eyes: `look_at`.

use super::constraints::fade_span;
use super::joint_names::find_joint;
use crate::build::check_limit;
use crate::call::{ApiError, Call, Reply, api};
use crate::suggest::list;
use crate::value::{ActorRef, LookRef};
use choreo_asset::Asset;
use choreo_motion::{HumanBone, Time};
use choreo_stage::{LookAt, Target};
use rhai::Dynamic;

api! {
    /// Turns the head towards an actor, a joint or a point (look-at constraint), at most 80° away from the pose of
    /// the clip. The eyes of a VRM character follow within the limits of its file, by bones or morph targets.
    /// Options: joint (default: the head), weight (0 to 1, default 1), from, until, fade (as the methods of Look).
    Actor.look_at("target, options?") -> Look = look_at;
    /// Sets the start time (default 0).
    Look.from("time") = look_from;
    /// Sets the end time.
    Look.until("time") = look_until;
    /// Sets how long the head takes to turn to the target and back, in seconds (default 0.3).
    Look.fade("seconds") = look_fade;
    /// Sets how far the head turns: 0 not at all, 1 all the way (default 1).
    Look.weight("weight") = look_weight;
}

fn look_at(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let target = c.target(0)?;
    let o = c.options(1, &["joint", "weight", "from", "until", "fade"])?;
    let weight = o.number_in("weight", 0.0, 1.0)?.unwrap_or(1.0) as f32;
    let joint = match o.text("joint")? {
        Some(name) => find_joint(&this.asset, &name)?,
        None => head_joint(&this.asset).ok_or_else(|| {
            let names = this.asset.skeleton.names().iter().map(String::as_str);
            ApiError::new(format!("look_at: \"{}\" has no joint \"Head\" to turn", this.asset.name))
                .hint(format!("name another, #{{ joint: … }}: {}", list(names, 24)))
        })?,
    };
    if target == (Target::Joint { actor: this.id, joint }) {
        return Err(ApiError::new("look_at: a joint cannot look at itself"));
    }
    let offset = c.stage_draft().sequence_start;
    let (start, end, fade) = fade_span(c, &o, offset)?;
    let mut stage_draft = c.stage_draft();
    let draft = stage_draft.actor(this.id)?;
    check_limit(draft.actor.look_at.len(), "look_at targets of one actor", &c.context.limits)?;
    draft.look_at_places.push(c.place.clone());
    draft.actor.look_at.push(LookAt { joint, target, start, end, fade, weight });
    Ok(Dynamic::from(LookRef { actor: this.id, index: draft.actor.look_at.len() - 1 }))
}

/// The head that the file declares, else the joint "Head".
fn head_joint(asset: &Asset) -> Option<u32> {
    let declared = asset.skeleton.humanoid().and_then(|h| h.joint(HumanBone::Head));
    declared.or_else(|| asset.skeleton.find("Head").map(|j| j as u32))
}

fn change_look(c: &Call, change: impl FnOnce(&mut LookAt) -> Result<(), ApiError>) -> Reply {
    let this: LookRef = c.this()?;
    if let Some(look) = c.stage_draft().actor(this.actor)?.actor.look_at.get_mut(this.index) {
        change(look)?;
    }
    c.receiver()
}

fn look_from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change_look(c, |l| {
        l.start = t;
        Ok(())
    })
}

fn look_until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change_look(c, |l| {
        if t < l.start {
            return Err(before_start_error("until", t, l.start));
        }
        l.end = Some(t);
        Ok(())
    })
}

pub(crate) fn before_start_error(name: &str, t: Time, start: Time) -> ApiError {
    ApiError::new(format!("{name}: {} s is before the start, {} s", t.as_secs(), start.as_secs()))
}

fn look_fade(c: &mut Call) -> Reply {
    let t = c.duration(0)?;
    change_look(c, |l| {
        l.fade = t;
        Ok(())
    })
}

fn look_weight(c: &mut Call) -> Reply {
    let w = c.number_in(0, 0.0, 1.0)? as f32;
    change_look(c, |l| {
        l.weight = w;
        Ok(())
    })
}
