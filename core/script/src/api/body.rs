//! What bodies do beside their clips: reach, aim, plant their feet, keep their limits; and what swings on them.

use super::actor::{before_start, find_joint, radians};
use crate::build::room;
use crate::call::{ApiError, Call, Def, Gives, Options, Reply, text};
use crate::hook;
use crate::suggest::list;
use crate::value::*;
use choreo_motion::spring::{ColliderShape, RigBone, SpringBone, SpringCollider};
use choreo_motion::{HumanBone, Skeleton, Time};
use choreo_stage::*;
use glam::DVec3;
use rhai::Dynamic;
use std::sync::Arc;

const THIS: Gives = Gives::Itself;
const GOAL: Gives = Gives::A(Kind::Goal);
const GRAVITY: f64 = 9.81;

pub const DEFS: &[Def] = &[
    Def::new(
        Kind::Actor,
        "reach",
        "joint, target, options?",
        GOAL,
        "Brings a joint, like a hand, to an actor, joint or point; options: at ([x, y, z] in the target's space), root (the joint that the bending begins at; else two bones up), pole (what the elbow points to), soft (share of the reach, 0.05), keep (true: the hand stays turned as it is), weight.",
        reach,
    ),
    Def::new(
        Kind::Actor,
        "aim",
        "joint, target, options?",
        GOAL,
        "Turns a joint and those above it until it points at a target; options: joints (how many turn, 1), or an array of names from the root on, shares (an array, one a joint), limit (degrees, 80), weight.",
        aim,
    ),
    Def::new(
        Kind::Actor,
        "plant_feet",
        "options?",
        GOAL,
        "Feet that touch the ground stay where they are, two or four; options: feet (names of joints, else the body's), ground (an actor whose surfaces they stand on), weight.",
        plant_feet,
    ),
    Def::new(Kind::Goal, "from", "time", THIS, "When it begins.", from),
    Def::new(Kind::Goal, "until", "time", THIS, "When it is over.", until),
    Def::new(Kind::Goal, "fade", "seconds", THIS, "How long it takes to come in and to go.", fade),
    Def::new(
        Kind::Goal,
        "weight",
        "weight",
        THIS,
        "How much it counts: 0 not at all, 1 all the way.",
        weight,
    ),
    Def::new(
        Kind::Joint,
        "limit",
        "options",
        THIS,
        "How far it may turn from rest, in degrees, whatever clips and goals do: swing (a cone about axis, +y) with twist ([low, high]), or hinge ([low, high] about axis).",
        limit,
    ),
    Def::new(
        Kind::Actor,
        "spring",
        "joints, options?",
        THIS,
        "Makes joints swing after the body, \"Tail..\" a joint and all below it, \"*hair*\" a pattern, or an array; options: frequency (Hz, 2), damping (0 swings for ever, 1 not at all; 0.3), gravity (share of the Earth's, 0), radius (m, against colliders), center (a joint whose motion is not felt).",
        spring,
    ),
    Def::new(
        Kind::Actor,
        "springs",
        "on | options",
        THIS,
        "Whether anything swings: springs of a VRM file do unless this is false; options: ground (height of a floor), pre_roll (seconds that they swing before time 0).",
        springs,
    ),
    Def::new(
        Kind::Actor,
        "collider",
        "joint, options",
        THIS,
        "Keeps what swings out of a ball about a joint, or of a capsule; options: radius (m), at and to ([x, y, z] in the joint's space).",
        collider,
    ),
    Def::new(
        Kind::Actor,
        "wind",
        "x, y, z | velocity",
        THIS,
        "Speed of the air about what swings, in metres a second.",
        wind,
    )
    .in_frames(),
];

fn add(c: &Call, actor: usize, goal: Goal) -> Reply {
    let mut build = c.build();
    let draft = build.actor(actor)?;
    room(draft.actor.goals.len(), "goals of one actor", &c.shared.limits)?;
    draft.actor.goals.push(goal);
    Ok(Dynamic::from(GoalRef { actor, index: draft.actor.goals.len() - 1 }))
}

fn goal(kind: GoalKind, o: &Options) -> Result<Goal, ApiError> {
    let weight = o.number_in("weight", 0.0, 1.0)?.unwrap_or(1.0) as f32;
    Ok(Goal { fade: Time::from_secs(0.3), weight, ..Goal::new(kind) })
}

fn reach(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let end = find_joint(&this.asset, &c.text(0)?)?;
    let target = c.target(1)?;
    let o = c.options(2, &["at", "root", "pole", "soft", "keep", "weight"])?;
    let parents = this.asset.skeleton.parents();
    let names = this.asset.skeleton.names();
    let name = |joint: u32| names.get(joint as usize).map_or("", String::as_str);
    let mut joints = vec![end];
    let root = o.text("root")?.map(|root| find_joint(&this.asset, &root)).transpose()?;
    while let Some(above) = parents[joints[joints.len() - 1] as usize] {
        let done = root.map_or(joints.len() == 3, |root| joints[joints.len() - 1] == root);
        if done {
            break;
        }
        joints.push(above);
    }
    joints.reverse();
    if let Some(root) = root.filter(|root| joints[0] != *root || joints.len() < 2) {
        let error = format!("reach: \"{}\" is not below \"{}\", which is to bend", name(end), name(root));
        return Err(ApiError::new(error)
            .focus(name(root))
            .hint("root is a joint above the one that reaches"));
    }
    if joints.len() < 2 {
        let error = format!("reach: \"{}\" has no joint above it that could bend", name(end));
        return Err(ApiError::new(error).focus(name(end)));
    }
    if target == (Target::Joint { actor: this.id, joint: end }) {
        return Err(ApiError::new("reach: a joint cannot reach for itself"));
    }
    // Elbows bend backwards, knees forward.
    let middle = name(joints[joints.len() / 2]).to_ascii_lowercase();
    let knee = ["leg", "knee", "calf", "shin"].iter().any(|part| middle.contains(part));
    let kind = GoalKind::Reach(Reach {
        joints,
        target,
        offset: o.point("at")?,
        pole: o.target("pole")?,
        hint: if knee { DVec3::Z } else { DVec3::NEG_Z },
        soft: o.number_in("soft", 0.0, 1.0)?.unwrap_or(0.05),
        keep_rotation: o.flag("keep")?.unwrap_or(false),
    });
    add(c, this.id, goal(kind, &o)?)
}

fn aim(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let last = find_joint(&this.asset, &c.text(0)?)?;
    let target = c.target(1)?;
    let o = c.options(2, &["joints", "shares", "limit", "weight"])?;
    let parents = this.asset.skeleton.parents();
    let joints: Vec<u32> = match o.get("joints") {
        Some(names) if names.is_array() => {
            let names = names.into_array().unwrap_or_default();
            let one = |n: &Dynamic| find_joint(&this.asset, &text(n, &o.label("joints"))?);
            let mut joints = names.iter().map(one).collect::<Result<Vec<_>, _>>()?;
            if joints.last() != Some(&last) {
                joints.push(last);
            }
            joints
        }
        _ => {
            let count = o.number_in("joints", 1.0, 64.0)?.unwrap_or(1.0) as usize;
            let up = std::iter::successors(Some(last), |joint| parents[*joint as usize]);
            let mut joints: Vec<u32> = up.take(count).collect();
            joints.reverse();
            joints
        }
    };
    let shares = match o.get("shares") {
        None => vec![1.0; joints.len()],
        Some(given) => match crate::call::numbers(&given) {
            Some(shares)
                if shares.len() == joints.len() && shares.iter().all(|s| (0.0..=1e6).contains(s)) =>
            {
                shares
            }
            _ => {
                let count = joints.len();
                return Err(ApiError::new(format!(
                    "aim: shares must be {count} numbers from 0, one a joint"
                )));
            }
        },
    };
    let limit = radians(o.number_in("limit", 0.0, 180.0)?.unwrap_or(80.0));
    add(c, this.id, goal(GoalKind::Aim(AimGoal { joints, shares, target, limit }), &o)?)
}

fn plant_feet(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let o = c.options(0, &["feet", "ground", "weight"])?;
    let skeleton = &this.asset.skeleton;
    let legs: Vec<Leg> = match o.get("feet") {
        Some(names) => {
            let label = o.label("feet");
            let Some(names) = names.clone().try_cast::<rhai::Array>() else {
                return Err(crate::call::wrong(&names, &label, "an array of joints' names"));
            };
            let foot = |name: &Dynamic| find_joint(&this.asset, &text(name, &label)?);
            names.iter().map(|n| leg_above(skeleton, foot(n)?)).collect::<Result<_, _>>()?
        }
        None => legs(&this.asset),
    };
    if legs.is_empty() {
        let names = skeleton.names().iter().map(String::as_str);
        return Err(ApiError::new(format!(
            "plant_feet: \"{}\" has no joints \"LeftFoot\" and \"RightFoot\"",
            this.asset.name
        ))
        .hint(format!("name them, #{{ feet: [ … ] }}: {}", list(names, 24))));
    }
    let hips = hips(&this.asset, &legs);
    let ground = match o.target("ground")? {
        None => None,
        Some(Target::Actor(actor)) if actor != this.id => Some(actor),
        Some(_) => return Err(ApiError::new("plant_feet: ground must be another actor")),
    };
    add(c, this.id, goal(GoalKind::Plant(Plant { legs, hips, ground, only: Vec::new() }), &o)?)
}

/// The legs that a body is known by, or those of the feet that its file names.
pub fn legs(asset: &Asset) -> Vec<Leg> {
    let found = find_legs(&asset.skeleton);
    if !found.is_empty() {
        return found;
    }
    let feet = [HumanBone::LeftFoot, HumanBone::RightFoot];
    let feet = feet.iter().filter_map(|b| human(asset, *b));
    feet.filter_map(|foot| leg_above(&asset.skeleton, foot).ok()).collect()
}

/// What all legs hang on, where they are two: hips above four legs would take the back along.
pub fn hips(asset: &Asset, legs: &[Leg]) -> Option<u32> {
    let above = legs.first().and_then(|leg| asset.skeleton.parents()[leg.hip as usize]);
    human(asset, HumanBone::Hips).or(above).filter(|_| legs.len() <= 2)
}

fn leg_above(skeleton: &Skeleton, foot: u32) -> Result<Leg, ApiError> {
    let parents = skeleton.parents();
    let above = parents[foot as usize].and_then(|knee| Some((knee, parents[knee as usize]?)));
    let Some((knee, hip)) = above else {
        let name = skeleton.names()[foot as usize].clone();
        let error = format!("plant_feet: \"{name}\" has no leg of two joints above it");
        return Err(ApiError::new(error).focus(name));
    };
    let mut children = (0..parents.len() as u32).filter(|j| parents[*j as usize] == Some(foot));
    let toe = children.find(|j| skeleton.names()[*j as usize].to_ascii_lowercase().contains("toe"));
    Ok(Leg { hip, knee, foot, toe })
}

/// By the file's own word, else by name.
fn human(asset: &Asset, bone: HumanBone) -> Option<u32> {
    let declared = asset.skeleton.humanoid().and_then(|h| h.joint(bone));
    declared.or_else(|| asset.skeleton.find(bone.name()).map(|j| j as u32))
}

fn change(c: &Call, change: impl FnOnce(&mut Goal) -> Result<(), ApiError>) -> Reply {
    let this: GoalRef = c.this()?;
    if let Some(goal) = c.build().actor(this.actor)?.actor.goals.get_mut(this.index) {
        change(goal)?;
    }
    c.itself()
}

fn from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |g| {
        g.start = t;
        Ok(())
    })
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |g| {
        if t < g.start {
            return Err(before_start("until", t, g.start));
        }
        g.end = Some(t);
        Ok(())
    })
}

fn fade(c: &mut Call) -> Reply {
    let t = c.duration(0)?;
    change(c, |g| {
        g.fade = t;
        Ok(())
    })
}

fn weight(c: &mut Call) -> Reply {
    let w = c.number_in(0, 0.0, 1.0)? as f32;
    change(c, |g| {
        g.weight = w;
        Ok(())
    })
}

fn limit(c: &mut Call) -> Reply {
    let this: JointRef = c.this()?;
    let o = c.options(0, &["swing", "twist", "hinge", "axis"])?;
    let axis = o.point("axis")?.unwrap_or(DVec3::Y);
    let Some(axis) = axis.try_normalize() else {
        return Err(ApiError::new("limit: axis must not be [0, 0, 0]"));
    };
    let interval = |name: &str| -> Result<Option<(f64, f64)>, ApiError> {
        let Some(given) = o.get(name) else { return Ok(None) };
        match crate::call::numbers(&given).as_deref() {
            Some([low, high]) if -180.0 <= *low && low <= high && *high <= 180.0 => {
                Ok(Some((low.to_radians(), high.to_radians())))
            }
            _ => Err(crate::call::wrong(&given, &o.label(name), "[low, high] in degrees, within ±180")),
        }
    };
    let swing = o.number_in("swing", 0.0, 180.0)?;
    let limit = match (interval("hinge")?, swing, interval("twist")?) {
        (Some(angle), None, None) => Limit::Hinge { axis, angle },
        (None, None, None) => {
            return Err(ApiError::new("limit: says nothing").hint("swing, twist or hinge, in degrees"));
        }
        (None, swing, twist) => Limit::SwingTwist {
            axis,
            swing: swing.unwrap_or(180.0).to_radians(),
            twist: twist.unwrap_or((-std::f64::consts::PI, std::f64::consts::PI)),
        },
        (Some(_), ..) => return Err(ApiError::new("limit: a hinge has no swing and no twist")),
    };
    let mut build = c.build();
    let actor = &mut build.actor(this.actor)?.actor;
    actor.limits.retain(|(joint, _)| *joint != this.joint);
    actor.limits.push((this.joint, limit));
    drop(build);
    c.itself()
}

/// Changes what swings on an actor; there is nothing at first where the file has no springs.
fn swinging(c: &Call, change: impl FnOnce(&mut ActorSprings)) -> Reply {
    let this: ActorRef = c.this()?;
    let mut build = c.build();
    let draft = build.actor(this.id)?;
    change(Arc::make_mut(draft.actor.springs.get_or_insert_default()));
    drop(build);
    c.itself()
}

fn spring(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let joints = matching(&this.asset, &c.value(0), &c.label(0))?;
    let o = c.options(1, &["frequency", "damping", "gravity", "radius", "center"])?;
    let frequency = o.number_in("frequency", 0.0, 1000.0)?.unwrap_or(2.0);
    let damping = o.number_in("damping", 0.0, 1000.0)?.unwrap_or(0.3);
    let gravity = o.number_in("gravity", -1000.0, 1000.0)?.unwrap_or(0.0);
    let hit_radius = o.number_in("radius", 0.0, 1000.0)?.unwrap_or(0.0);
    let center = o.text("center")?.map(|name| find_joint(&this.asset, &name)).transpose()?;
    swinging(c, |springs| {
        let colliders: Vec<u32> = (0..springs.rig.colliders().len() as u32).collect();
        for joint in joints {
            springs.rig.add(RigBone {
                joint,
                tail: tail(&this.asset, joint),
                spring: SpringBone::new(frequency, damping),
                gravity: DVec3::NEG_Y * (GRAVITY * gravity),
                pull: DVec3::ZERO,
                hit_radius,
                center,
                colliders: colliders.clone(),
            });
        }
    })
}

/// To the first joint below, else as far again as from the one above.
fn tail(asset: &Asset, joint: u32) -> glam::Vec3 {
    let (parents, rest) = (asset.skeleton.parents(), asset.skeleton.rest());
    let child = (0..parents.len()).find(|j| parents[*j] == Some(joint));
    let own = rest[joint as usize];
    child.map_or_else(|| own.rotation.inverse() * own.translation, |child| rest[child].translation)
}

fn springs(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    if let Ok(on) = c.value(0).as_bool() {
        let mut build = c.build();
        let draft = build.actor(this.id)?;
        draft.actor.springs =
            if on { draft.actor.springs.take().or(ActorSprings::of(&this.asset)) } else { None };
        drop(build);
        return c.itself();
    }
    if !c.value(0).is_map() {
        return Err(c.wrong(0, "true, false or an object map like #{ ground: 0.0 }"));
    }
    let o = c.options(0, &["ground", "pre_roll"])?;
    let (ground, pre_roll) = (o.number_in("ground", -1e9, 1e9)?, o.duration("pre_roll")?);
    if let Some(t) = pre_roll.filter(|t| *t > Time::from_secs(600.0)) {
        return Err(ApiError::new(format!(
            "springs: pre_roll must be from 0 to 600 s, got {} s",
            t.as_secs()
        )));
    }
    swinging(c, |springs| {
        springs.rig.ground = ground.or(springs.rig.ground);
        springs.pre_roll = pre_roll.unwrap_or(springs.pre_roll);
    })
}

fn collider(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let joint = find_joint(&this.asset, &c.text(0)?)?;
    let o = c.options(1, &["radius", "at", "to"])?;
    let Some(radius) = o.number_in("radius", 0.0, 1e6)? else {
        return Err(ApiError::new("collider: needs a radius").hint("#{ radius: 0.1 }"));
    };
    let offset = o.point("at")?.unwrap_or_default().as_vec3();
    let shape = match o.point("to")? {
        Some(tail) => {
            ColliderShape::Capsule { offset, tail: tail.as_vec3(), radius: radius as f32, inside: false }
        }
        None => ColliderShape::Sphere { offset, radius: radius as f32, inside: false },
    };
    swinging(c, |springs| {
        let index = springs.rig.add_collider(SpringCollider { joint, shape });
        springs.rig.bones_mut().for_each(|bone| bone.colliders.push(index));
    })
}

fn wind(c: &mut Call) -> Reply {
    let velocity = c.point(0)?.clamp_length_max(1e4);
    if c.in_frame {
        let this: ActorRef = c.this()?;
        hook::edit(|e| e.actors.push(ActorEdit::Wind { actor: this.id, wind: velocity }));
        return c.itself();
    }
    swinging(c, |springs| springs.wind = velocity)
}

/// Joints by name, "Name.." with all below, or a pattern with `*`; a text or an array of texts.
fn matching(asset: &Asset, given: &Dynamic, label: &str) -> Result<Vec<u32>, ApiError> {
    let patterns = match given.read_lock::<rhai::Array>() {
        Some(array) => array.iter().map(|v| text(v, label)).collect::<Result<Vec<_>, _>>()?,
        None => vec![text(given, label)?],
    };
    let skeleton = &asset.skeleton;
    let mut hit = vec![false; skeleton.len()];
    for pattern in patterns {
        let (name, below) = pattern.strip_suffix("..").map_or((pattern.as_str(), false), |name| (name, true));
        let mut now = vec![false; skeleton.len()];
        if name.contains('*') {
            let parts: Vec<String> = name.split('*').map(str::to_ascii_lowercase).collect();
            for (joint, name) in skeleton.names().iter().enumerate() {
                now[joint] = like(&name.to_ascii_lowercase(), &parts);
            }
            if !now.contains(&true) {
                let error = format!("no joint of skeleton \"{}\" matches \"{pattern}\"", asset.name);
                let names = list(skeleton.names().iter().map(String::as_str), 24);
                return Err(ApiError::new(error).focus(pattern.clone()).hint(format!("joints: {names}")));
            }
        } else {
            now[find_joint(asset, name).map_err(|e| e.focus(pattern.clone()))? as usize] = true;
        }
        for joint in 0..skeleton.len() {
            now[joint] |= below && skeleton.parents()[joint].is_some_and(|p| now[p as usize]);
            hit[joint] |= now[joint];
        }
    }
    Ok((0..skeleton.len() as u32).filter(|j| hit[*j as usize]).collect())
}

/// Whether a text is these parts with anything between.
fn like(text: &str, parts: &[String]) -> bool {
    let (Some(first), Some(last)) = (parts.first(), parts.last()) else { return false };
    let Some(mut rest) = text.strip_prefix(first.as_str()) else { return false };
    for part in &parts[1..parts.len() - 1] {
        let Some(at) = rest.find(part.as_str()) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.len() >= last.len() && rest.ends_with(last.as_str())
}

#[cfg(test)]
mod tests {
    #[test]
    fn patterns() {
        let like = |text: &str, pattern: &str| {
            super::like(text, &pattern.split('*').map(str::to_string).collect::<Vec<_>>())
        };
        assert!(like("hair_front_1", "*hair*") && like("hair", "hair*") && like("tail3", "t*3"));
        assert!(!like("head", "*hair*") && !like("aba", "ab*ba") && like("abba", "ab*ba"));
    }
}
