//! Root motion, in-place playback and path following.

use crate::build::{RootMotionDraft, RootMotionUse};
use crate::call::{ApiError, Call, Reply, api};
use crate::value::{ActorRef, ClipRef, CueRef};
use choreo_motion::contacts::{self, Contacts, Foot};
use choreo_motion::{RootMotion, RootParts, Time};
use choreo_stage::{Pace, Path, PathFollowing};
use rhai::{Dynamic, Map};
use std::sync::Arc;

api! {
    /// Moves the actor by the root motion of its clips. The motion of the root joint along the floor moves the actor,
    /// loops continue where they end, and the next clip starts where the last one ended. A clip that walks in place
    /// moves the actor as fast as its feet push the floor back.
    /// - Options: joint (name of the root joint; found automatically by default), horizontal (default true),
    ///   vertical (default false), yaw (default: true if the whole clip turns by 15° or more).
    Actor.root_motion("options?") = actor_root;
    /// Removes root motion from the actor's clips, so that they play in place. Options as in Actor.root_motion.
    Actor.in_place("options?") = actor_in_place;
    /// Moves the actor along a smooth curve (path following) through points [[x, y, z], …], relative to its
    /// position and rotation, facing forwards.
    /// - Options: speed (metres per second; default: as fast as its clips walk, so that feet do not slide), from
    ///   (start time in seconds, default 0), closed (true: the path is a loop), turn (false: the actor keeps its
    ///   rotation).
    Actor.path("points, options?") = path;
    /// Does the same as Actor.root_motion, for this cue only.
    Cue.root_motion("options?") = cue_root;
    /// Does the same as Actor.in_place, for this cue only.
    Cue.in_place("options?") = cue_in_place;
    /// Returns the walking speed of the clip in metres per second: that of its root joint or, in place, that of its
    /// feet. `joint` is the root joint.
    Clip.travel("joint?") -> "float" = travel;
    /// Returns the foot contacts: for each time that a foot stands on the floor #{ foot, from, to } in seconds of
    /// the clip, sorted by time. `joints` are the names of the feet, needed where they are not found by name.
    Clip.contacts("joints?") -> "array of maps" = clip_contacts;
}

fn read_root_motion(c: &Call, used: RootMotionUse) -> Result<(Option<String>, RootMotionDraft), ApiError> {
    let o = c.options(0, &["joint", "horizontal", "vertical", "yaw"])?;
    let parts = RootParts {
        horizontal: o.flag("horizontal")?.unwrap_or(true),
        vertical: o.flag("vertical")?.unwrap_or(false),
        yaw: o.flag("yaw")?,
    };
    Ok((o.text("joint")?, RootMotionDraft { joint: None, parts, used }))
}

fn set_of_actor(c: &Call, used: RootMotionUse) -> Reply {
    let this: ActorRef = c.this()?;
    let (joint, mut draft) = read_root_motion(c, used)?;
    draft.joint = joint.map(|name| super::joint_names::find_joint(&this.asset, &name)).transpose()?;
    c.stage_draft().actor(this.id)?.root = Some(draft);
    c.receiver()
}

fn actor_root(c: &mut Call) -> Reply {
    set_of_actor(c, RootMotionUse::MovesActor)
}

fn actor_in_place(c: &mut Call) -> Reply {
    set_of_actor(c, RootMotionUse::InPlace)
}

fn set_of_cue(c: &Call, used: RootMotionUse) -> Reply {
    let this: CueRef = c.this()?;
    let (joint, mut draft) = read_root_motion(c, used)?;
    let asset = {
        let mut stage_draft = c.stage_draft();
        let chain = stage_draft.cue(this.0)?.chain;
        let actor = stage_draft.chains[chain].actor;
        stage_draft.actor(actor)?.actor.asset.clone()
    };
    draft.joint = joint.map(|name| super::joint_names::find_joint(&asset, &name)).transpose()?;
    c.stage_draft().cue(this.0)?.root = Some(draft);
    c.receiver()
}

fn cue_root(c: &mut Call) -> Reply {
    set_of_cue(c, RootMotionUse::MovesActor)
}

fn cue_in_place(c: &mut Call) -> Reply {
    set_of_cue(c, RootMotionUse::InPlace)
}

/// The largest number of points of a path. Each point costs memory, and hand-written paths are far shorter.
const MAX_POINTS: usize = 10_000;

fn path(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let value = c.value(0);
    let Some(rows) = value.read_lock::<rhai::Array>() else {
        return Err(c.wrong(0, "an array of points, [[x, y, z], …]"));
    };
    if rows.len() > MAX_POINTS {
        return Err(ApiError::new(format!("path: at most {MAX_POINTS} points, got {}", rows.len())));
    }
    let point = |(i, v): (usize, &Dynamic)| crate::call::point(v, &format!("path: point {i}"));
    let points = rows.iter().enumerate().map(point).collect::<Result<Vec<_>, _>>()?;
    let o = c.options(1, &["speed", "from", "closed", "turn"])?;
    let pace = match o.number_in("speed", 0.0, 1e6)? {
        Some(speed) => Pace::Constant(speed),
        None => Pace::FromRootMotion,
    };
    let start = o.get("from").map(|v| crate::call::time(&v, "path: from")).transpose()?;
    let path = Path::new(points, o.flag("closed")?.unwrap_or(false))
        .map_err(|what| ApiError::new(format!("path: {what}")))?;
    let turns = o.flag("turn")?.unwrap_or(true);
    let path_following = PathFollowing { path, start: start.unwrap_or(Time::ZERO), pace, turns };
    let mut stage_draft = c.stage_draft();
    let draft = stage_draft.actor(this.id)?;
    draft.check_not_walking("path")?;
    draft.actor.path_following = Some(Arc::new(path_following));
    draft.is_placed = true;
    c.receiver()
}

fn travel(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    c.stage_draft().mark_used(&this.asset);
    let joint = match c.len() {
        0 => None,
        _ => Some(super::joint_names::find_joint(&this.asset, &c.text(0)?)?),
    };
    let trim = (Time::ZERO, this.clip.duration);
    let motion = RootMotion::new(&this.asset.skeleton, &this.clip, joint, RootParts::default(), trim);
    Ok(Dynamic::from_float(motion.map_or(0.0, |motion| motion.velocity().with_y(0.0).length())))
}

fn clip_contacts(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    c.stage_draft().mark_used(&this.asset);
    let skeleton = &this.asset.skeleton;
    let feet = match c.len() {
        0 => contacts::find_feet(skeleton),
        _ => {
            let label = c.label(0);
            let value = c.value(0);
            let Some(names) = value.read_lock::<rhai::Array>() else {
                return Err(c.wrong(0, "an array of joint names"));
            };
            let foot = |name: &Dynamic| {
                let joint = super::joint_names::find_joint(&this.asset, &crate::call::text(name, &label)?)?;
                Ok(Foot { joints: vec![joint] })
            };
            names.iter().map(foot).collect::<Result<Vec<_>, ApiError>>()?
        }
    };
    if feet.is_empty() {
        return Err(ApiError::new(format!(
            "contacts: \"{}\" has no joints that are feet by name",
            this.asset.name
        ))
        .hint("name them: contacts([\"LeftFoot\", \"RightFoot\"])"));
    }
    let found = Contacts::find(skeleton, &this.clip, (Time::ZERO, this.clip.duration), &feet);
    let mut rows: Vec<(Time, Map)> = Vec::new();
    for (foot, stands) in feet.iter().zip(found.iter().flat_map(|found| &found.intervals)) {
        let name = foot.joints.first().and_then(|j| skeleton.names().get(*j as usize));
        for stand in stands {
            let mut row = Map::new();
            row.insert("foot".into(), name.cloned().unwrap_or_default().into());
            row.insert("from".into(), Dynamic::from_float(stand.from.as_secs()));
            row.insert("to".into(), Dynamic::from_float(stand.to.as_secs()));
            rows.push((stand.from, row));
        }
    }
    rows.sort_by_key(|(from, _)| *from);
    Ok(Dynamic::from_array(rows.into_iter().map(|(_, row)| Dynamic::from_map(row)).collect()))
}
