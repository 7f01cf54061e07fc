//! Walks to a point, as keyframes of the actor and cues of its base layer: turn, start, walk and stop.

use super::cue::bind_clip;
use crate::build::{ActorDraft, Chain, CueDraft, RootMotionDraft, RootMotionUse, StageDraft, check_limit};
use crate::call::{ApiError, Call, Options, Reply, api};
use crate::cue_times::times_of_cue;
use crate::value::{ActorRef, ClipRef, CueRef};
use crate::walk::{Walk, WalkPace, WalkPlan, channels};
use choreo_asset::Asset;
use choreo_motion::{Clip, Repeat, RootMotion, RootParts, Time};
use choreo_stage::{Property, Target};
use glam::{DQuat, DVec3};
use rhai::Dynamic;
use std::sync::Arc;

api! {
    /// Walks to a point and stops there: the actor turns to it, starts, walks straight ahead, and takes a last step;
    /// feet on the ground are locked. Returns the cue of the walk; its .end() is the time of arrival.
    /// - Options: clip (the clip in which it walks; default: the file's own clip "Walk"), idle (the clip in which it
    ///   stands before and after; default: the clip that it plays when it starts), from (time at which it begins to
    ///   turn and walk; default: the end of the walk before, its last turn included, else 0), speed (metres per second;
    ///   default: that of the clip), arrive (time of arrival, instead of a speed), fade (seconds to start and to stop,
    ///   0.1 to 3, default 0.5), face (an actor or a point: it turns there while it stops, with steps; the position of
    ///   an actor is where it is placed, or where its last walk has ended).
    /// - The walk begins where the actor has been placed so far, or where the walk before ended. At the time of
    ///   arrival its position is the point.
    Actor.walk_to("point, options?") -> Cue = walk_to;
}

/// Speed in metres per second below which a clip does not walk.
const SLOWEST: f64 = 0.01;
/// A clip is played at up to this many times its own speed, or at its inverse.
const FASTEST: f64 = 4.0;

fn walk_to(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let point = c.point(0)?;
    let o = c.options(1, &["clip", "idle", "from", "speed", "arrive", "fade", "face"])?;
    let own_walk = || this.asset.clips.iter().find(|clip| clip.name.eq_ignore_ascii_case("walk")).cloned();
    let clip = clip_option(c, &o, "clip", &this.asset)?.or_else(own_walk).ok_or_else(|| {
        ApiError::new(format!("walk_to: clip is missing, and \"{}\" has no clip \"Walk\"", this.asset.name))
            .hint("name the clip: walk_to(point, #{ clip: moves.clip(\"Stroll\") })")
    })?;
    let own_idle = clip_option(c, &o, "idle", &this.asset)?;
    let stage_time = |name: &str| o.get(name).map(|v| c.stage_time(&v, &o.label(name))).transpose();
    let (from, arrive) = (stage_time("from")?, stage_time("arrive")?);
    let speed = o.number_in("speed", 1e-3, 1e3)?;
    if speed.is_some() && arrive.is_some() {
        return Err(ApiError::new("walk_to: speed and arrive exclude each other")
            .hint("the speed follows from arrive"));
    }
    let fade = Time::from_secs(o.number_in("fade", 0.1, 3.0)?.unwrap_or(0.5));
    let face = o.target("face")?;
    check_limit(c.stage_draft().cues.len() + 2, "cues", &c.context.limits)?;
    let mut stage_draft = c.stage_draft();
    let origin = stage_draft.sequence_start;
    let face = match face {
        None => None,
        Some(Target::Point(point)) => Some(point),
        Some(Target::Actor(other) | Target::Joint { actor: other, .. }) if other == this.id => {
            return Err(ApiError::new("walk_to: face: an actor cannot face itself"));
        }
        Some(Target::Actor(other) | Target::Joint { actor: other, .. }) => {
            let other = stage_draft.actor(other)?;
            Some(other.walks.last().map_or(other.actor.transform.translation, |walk| walk.point))
        }
    };
    let draft = stage_draft.actor(this.id)?;
    let (start, rotation) = start_placement(draft)?;
    let from = from.or(draft.walks.last().map(|walk| walk.turned_until)).unwrap_or(origin);
    if let Some(before) = draft.walks.last().filter(|walk| from < walk.turned_until) {
        let text = format!("walk_to: begins at {} s, before the last walk ends", from.as_secs());
        return Err(ApiError::new(text)
            .hint(format!("give the option from: {} or later", before.turned_until.as_secs())));
    }
    let own_speed = clip_speed(&this.asset, &clip) * draft.actor.transform.scale.z.abs();
    if own_speed < SLOWEST {
        let text = format!("walk_to: clip \"{}\" contains no walk", clip.name);
        return Err(ApiError::new(text).hint("name a clip of a walk or run, in place or not"));
    }
    let pace = match arrive {
        Some(arrive) => WalkPace::Arrive(arrive),
        None => WalkPace::Speed(speed.unwrap_or(own_speed)),
    };
    let front = this.asset.front().direction();
    let walk = Walk::new(WalkPlan { from, start, rotation, point, front, fade, pace, face })?;
    let factor = walk.speed / own_speed;
    if !(1.0 / FASTEST..=FASTEST).contains(&factor) {
        let text = format!(
            "walk_to: the actor would walk at {:.3} m/s, but its clip walks at {own_speed:.3}",
            walk.speed
        );
        return Err(ApiError::new(text).hint("choose another time or speed, or a clip that runs"));
    }
    draft.walks.push(walk.clone());
    draft.is_placed = true;
    let channels = channels(&draft.walks);
    super::keys::replace_channels(&mut draft.actor.channels, channels.into());
    let playing = base_clip_at(&stage_draft, this.id, from);
    let idle = own_idle.or_else(|| playing.clone()).ok_or_else(|| {
        let hint = "play the clip for standing before, or name it: #{ idle: hero.clip(\"Idle\") }";
        ApiError::new("walk_to: the actor plays no clip when it starts").hint(hint)
    })?;
    if playing.is_none() {
        add_in_place_cue(&mut stage_draft, c, this.id, (&idle, origin), Time::ZERO);
    }
    let id = add_in_place_cue(&mut stage_draft, c, this.id, (&clip, walk.accelerates_from), fade);
    let walking = stage_draft.cue(id)?;
    (walking.until, walking.repeat) = (Some(walk.until), Some(Repeat::Loop));
    walking.cue.speed = factor;
    add_in_place_cue(&mut stage_draft, c, this.id, (&idle, walk.decelerates_from), fade);
    Ok(Dynamic::from(CueRef(id)))
}

/// The clip that an option names, bound to the skeleton of an asset.
fn clip_option(c: &Call, o: &Options, name: &str, asset: &Arc<Asset>) -> Result<Option<Arc<Clip>>, ApiError> {
    let Some(value) = o.get(name) else { return Ok(None) };
    let Some(given) = value.clone().try_cast::<ClipRef>() else {
        return Err(crate::call::wrong(&value, &o.label(name), "a Clip, as in asset.clip(\"name\")"));
    };
    bind_clip(c, &given, asset).map(Some)
}

/// Position and rotation at which the next walk begins.
///
/// # Errors
/// Returns an error if keyframes, a path or `.face` set them.
fn start_placement(draft: &ActorDraft) -> Result<(DVec3, DQuat), ApiError> {
    if let Some(walk) = draft.walks.last() {
        return Ok((walk.point, walk.final_rotation()));
    }
    let has_keys =
        draft.actor.channels.iter().any(|c| matches!(c.property, Property::Translation | Property::Rotation));
    if has_keys
        || draft.actor.path_following.is_some()
        || draft.actor.face.is_some()
        || draft.face_point.is_some()
    {
        let text = "walk_to: the actor is moved or turned by keyframes, a path or .face already";
        return Err(ApiError::new(text)
            .hint("walk_to sets position and rotation itself; place it with .at and .turn"));
    }
    Ok((draft.actor.transform.translation, draft.actor.transform.rotation))
}

/// Walking speed of a clip in metres per second.
fn clip_speed(asset: &Asset, clip: &Arc<Clip>) -> f64 {
    let motion =
        RootMotion::new(&asset.skeleton, clip, None, RootParts::default(), (Time::ZERO, clip.duration));
    motion.map_or(0.0, |motion| motion.velocity().with_y(0.0).length())
}

/// The clip of the last cue of an actor's base layer that has begun by a time.
fn base_clip_at(stage_draft: &StageDraft, actor: usize, time: Time) -> Option<Arc<Clip>> {
    let is_on_base_layer = |id: &usize| {
        let chain = &stage_draft.chains[stage_draft.cues[*id].chain];
        chain.actor == actor && !chain.is_layer()
    };
    let starts =
        (0..stage_draft.cues.len()).filter(is_on_base_layer).map(|id| (times_of_cue(stage_draft, id).0, id));
    let last = starts.filter(|(start, _)| *start <= time).max()?;
    Some(stage_draft.cues[last.1].cue.clip.clone())
}

/// Adds a cue that plays in place to the base layer of an actor.
fn add_in_place_cue(
    stage_draft: &mut StageDraft,
    c: &Call,
    actor: usize,
    (clip, start): (&Arc<Clip>, Time),
    fade: Time,
) -> usize {
    stage_draft.chains.push(Chain::new(actor));
    let mut cue = CueDraft::new(stage_draft.chains.len() - 1, clip.clone(), c.place.clone());
    cue.start = Some(start);
    cue.cue.fade_in = fade;
    cue.root =
        Some(RootMotionDraft { joint: None, parts: RootParts::default(), used: RootMotionUse::InPlace });
    stage_draft.cues.push(cue);
    stage_draft.cues.len() - 1
}
