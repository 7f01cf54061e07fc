//! Root motion and paths: how actors get about.

use crate::build::{RootDraft, RootUse};
use crate::call::{ApiError, Call, Def, Gives, Reply};
use crate::value::*;
use choreo_motion::contacts::{self, Contacts, Foot};
use choreo_motion::{RootMotion, RootParts, Time};
use choreo_stage::{Pace, Path, Walk};
use rhai::{Dynamic, Map};
use std::sync::Arc;

const THIS: Gives = Gives::Itself;

const ROOT: &str = "Its clips carry it: what their root (or joint) does on the floor moves the actor, loops go on where they end, and the next clip starts where the last one ended; a clip that walks on the spot carries it as fast as its feet push the floor. Options: joint, horizontal (true), vertical (false), yaw (where the clip as a whole turns by 15° or more).";

pub const DEFS: &[Def] = &[
    Def::new(Kind::Actor, "root_motion", "options?", THIS, ROOT, actor_root),
    Def::new(
        Kind::Actor,
        "in_place",
        "options?",
        THIS,
        "Takes root motion out of its clips, so that they play on the spot; options as for root_motion.",
        actor_in_place,
    ),
    Def::new(
        Kind::Actor,
        "path",
        "points, options?",
        THIS,
        "Goes along a smooth curve through points [[x, y, z], …], counted from where it is placed, facing ahead. Options: speed in metres a second (left out: as fast as its clips walk, so that feet do not slide), from (a time), closed: true (round and round), turn: false (keeps its direction).",
        path,
    ),
    Def::new(
        Kind::Cue,
        "root_motion",
        "options?",
        THIS,
        "As for Actor.root_motion, of this clip only.",
        cue_root,
    ),
    Def::new(
        Kind::Cue,
        "in_place",
        "options?",
        THIS,
        "As for Actor.in_place, of this clip only.",
        cue_in_place,
    ),
    Def::new(
        Kind::Clip,
        "travel",
        "joint?",
        Gives::Value("float"),
        "Metres a second that the clip walks, by its root or, on the spot, by its feet.",
        travel,
    ),
    Def::new(
        Kind::Clip,
        "contacts",
        "joints?",
        Gives::Value("array of maps"),
        "When which foot stands on the floor: #{ foot, from, to } in seconds of the clip, by time; joints: the feet, where their names do not tell.",
        clip_contacts,
    ),
];

fn read(c: &Call, used: RootUse) -> Result<(Option<String>, RootDraft), ApiError> {
    let o = c.options(0, &["joint", "horizontal", "vertical", "yaw"])?;
    let parts = RootParts {
        horizontal: o.flag("horizontal")?.unwrap_or(true),
        vertical: o.flag("vertical")?.unwrap_or(false),
        yaw: o.flag("yaw")?,
    };
    Ok((o.text("joint")?, RootDraft { joint: None, parts, used }))
}

fn of_actor(c: &Call, used: RootUse) -> Reply {
    let this: ActorRef = c.this()?;
    let (joint, mut draft) = read(c, used)?;
    draft.joint = joint.map(|name| super::actor::find_joint(&this.asset, &name)).transpose()?;
    c.build().actor(this.id)?.root = Some(draft);
    c.itself()
}

fn actor_root(c: &mut Call) -> Reply {
    of_actor(c, RootUse::Carries)
}

fn actor_in_place(c: &mut Call) -> Reply {
    of_actor(c, RootUse::InPlace)
}

fn of_cue(c: &Call, used: RootUse) -> Reply {
    let this: CueRef = c.this()?;
    let (joint, mut draft) = read(c, used)?;
    let asset = {
        let mut build = c.build();
        let chain = build.cue(this.0)?.chain;
        let actor = build.chains[chain].actor;
        build.actor(actor)?.actor.asset.clone()
    };
    draft.joint = joint.map(|name| super::actor::find_joint(&asset, &name)).transpose()?;
    c.build().cue(this.0)?.root = Some(draft);
    c.itself()
}

fn cue_root(c: &mut Call) -> Reply {
    of_cue(c, RootUse::Carries)
}

fn cue_in_place(c: &mut Call) -> Reply {
    of_cue(c, RootUse::InPlace)
}

/// Points of one path: nobody writes more, and each costs some memory.
const MOST_POINTS: usize = 10_000;

fn path(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let value = c.value(0);
    let Some(rows) = value.read_lock::<rhai::Array>() else {
        return Err(c.wrong(0, "an array of points, [[x, y, z], …]"));
    };
    if rows.len() > MOST_POINTS {
        return Err(ApiError::new(format!("path: at most {MOST_POINTS} points, got {}", rows.len())));
    }
    let point = |(i, v): (usize, &Dynamic)| crate::call::point(v, &format!("path: point {i}"));
    let points = rows.iter().enumerate().map(point).collect::<Result<Vec<_>, _>>()?;
    let o = c.options(1, &["speed", "from", "closed", "turn"])?;
    let pace = match o.number_in("speed", 0.0, 1e6)? {
        Some(speed) => Pace::Constant(speed),
        None => Pace::OfClips,
    };
    let start = o.get("from").map(|v| crate::call::time(&v, "path: from")).transpose()?;
    let path = Path::new(points, o.flag("closed")?.unwrap_or(false))
        .map_err(|what| ApiError::new(format!("path: {what}")))?;
    let turns = o.flag("turn")?.unwrap_or(true);
    let walk = Walk { path, start: start.unwrap_or(Time::ZERO), pace, turns };
    let mut build = c.build();
    let draft = build.actor(this.id)?;
    draft.actor.walk = Some(Arc::new(walk));
    draft.placed = true;
    drop(build);
    c.itself()
}

fn travel(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    c.build().used(&this.asset);
    let joint = match c.len() {
        0 => None,
        _ => Some(super::actor::find_joint(&this.asset, &c.text(0)?)?),
    };
    let trim = (Time::ZERO, this.clip.duration);
    let motion = RootMotion::new(&this.asset.skeleton, &this.clip, joint, RootParts::default(), trim);
    Ok(Dynamic::from_float(motion.map_or(0.0, |motion| motion.velocity().with_y(0.0).length())))
}

fn clip_contacts(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    c.build().used(&this.asset);
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
                let joint = super::actor::find_joint(&this.asset, &crate::call::text(name, &label)?)?;
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
    for (foot, stands) in feet.iter().zip(found.iter().flat_map(|found| &found.stands)) {
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
