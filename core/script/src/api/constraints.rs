//! Constraints: inverse kinematics (reach), aim, foot locking, mirroring, joint limits; and spring bones.

use super::actor::before_start_error;
use super::joint_names::find_joint;
use super::spring_bones::{collider, spring, springs, wind};
use crate::build::check_limit;
use crate::call::{ApiError, Call, Options, Reply, api, fields, radians, text};
use crate::legs::{hips, leg_of_foot, legs};
use crate::suggest::list;
use crate::value::{ActorRef, ConstraintRef, JointRef};
use choreo_motion::Time;
use choreo_stage::{
    AimConstraint, Constraint, ConstraintKind, FootLock, Leg, Limit, ReachConstraint, SpringParameters,
    Target,
};
use glam::DVec3;
use rhai::Dynamic;
use std::sync::Arc;

api! {
    /// Moves a joint, such as a hand, to an actor, a joint or a point by inverse kinematics (IK).
    /// - Options: at (offset [x, y, z] in the space of the target, beside a joint in metres), root (the first joint of the IK chain; default:
    ///   two bones up), pole (pole target, an actor, joint or point, towards which the elbow or knee bends), soft
    ///   (0 to 1: share of the reach in which the limb slows down before it is straight, default 0.05; two bones
    ///   only), keep (true: the hand keeps its rotation from the clip), weight (0 to 1, default 1), from, until, fade (as the
    ///   methods of Constraint).
    Actor.reach("joint, target, options?") -> Constraint = reach;
    /// Rotates a joint and joints above it until it points at a target (aim constraint).
    /// - Options: joints (how many joints rotate, 1 to 64, default 1; or an array of their names from the root on),
    ///   shares (an array, one number per joint: how the rotation is shared), limit (degrees, 0 to 180, default
    ///   80), weight (0 to 1, default 1), from, until, fade (as the methods of Constraint).
    Actor.aim("joint, target, options?") -> Constraint = aim;
    /// Locks feet that touch the ground in place (foot locking, against foot sliding), for bipeds and quadrupeds.
    /// - Options: feet (an array of joint names; default: found by name, else by structure), ground (an actor, or an
    ///   array of actors, whose surfaces the feet stand on), weight (0 to 1, default 1), from, until, fade (as the methods of Constraint).
    /// - Without a call, the feet step instead of sliding where a walk fades into a stand or back, if root motion,
    ///   keyframes or a path move the actor. `plant_feet(#{ weight: 0 })` turns this off.
    Actor.plant_feet("options?") -> Constraint = plant_feet;
    /// Exchanges left and right in the motion of its clips, for joints, morph targets and expressions, while the
    /// constraint is active. The path of root motion stays the same. Options: weight (0 to 1, default 1), from, until,
    /// fade (as the methods of Constraint).
    Actor.mirror("options?") -> Constraint = mirror;
    /// Sets the start time of the constraint (default 0).
    Constraint.from("time") = from;
    /// Sets the end time of the constraint.
    Constraint.until("time") = until;
    /// Sets how long the constraint takes to fade in and out, in seconds (default 0.3).
    Constraint.fade("seconds") = fade;
    /// Sets the weight of the constraint: 0 not at all, 1 fully (default 1).
    Constraint.weight("weight") = weight;
    /// Limits the rotation of the joint relative to the rest pose, whatever clips and constraints do. Options, in
    /// degrees: swing (0 to 180, a cone about axis) with twist ([low, high] about axis), or hinge ([low, high]
    /// about axis); axis (default +y).
    Joint.limit("options") = limit;
    /// Makes joints spring bones (secondary motion, jiggle). Joints: "Tail.." for a joint and all below it,
    /// `"*hair*"` for a pattern, or an array of these.
    /// - Options: {}, center (name of a joint whose motion is ignored).
    Actor.spring("joints, options?") = spring, options(|| fields::describe_options(&SpringParameters::default(), &[]));
    /// Turns the spring bones of the actor on or off; those of a VRM file are on by default. Options: ground
    /// (height of a floor that they collide with, metres), pre_roll (seconds that are simulated before time 0, 0 to
    /// 600).
    Actor.springs("on | options") = springs;
    /// Adds a collider for spring bones: a sphere at a joint, or a capsule if `to` is given. Options: radius
    /// (metres), `at` and `to` (points [x, y, z] in the space of the joint).
    Actor.collider("joint, options") = collider;
    /// Sets the wind that acts on the spring bones, a velocity in metres per second.
    Actor.wind("x, y, z | velocity") = wind, in_frames;
}

fn add_constraint(c: &Call, actor: usize, goal: Constraint) -> Reply {
    let mut stage_draft = c.stage_draft();
    let draft = stage_draft.actor(actor)?;
    check_limit(draft.actor.constraints.len(), "constraints of one actor", &c.context.limits)?;
    draft.constraint_places.push(c.place.clone());
    draft.actor.constraints.push(goal);
    Ok(Dynamic::from(ConstraintRef { actor, index: draft.actor.constraints.len() - 1 }))
}

fn constraint(c: &Call, kind: ConstraintKind, o: &Options) -> Result<Constraint, ApiError> {
    let weight = o.number_in("weight", 0.0, 1.0)?.unwrap_or(1.0) as f32;
    let goal = Constraint { weight, ..Constraint::new(kind) };
    let (start, end, fade) = fade_span(c, o, goal.start)?;
    Ok(Constraint { start, end, fade, ..goal })
}

/// The options `from`, `until` and `fade` of a constraint.
pub(super) fn fade_span(c: &Call, o: &Options, start: Time) -> Result<(Time, Option<Time>, Time), ApiError> {
    let time = |name: &str| o.get(name).map(|v| c.stage_time(&v, &o.label(name))).transpose();
    let (start, end) = (time("from")?.unwrap_or(start), time("until")?);
    if let Some(end) = end.filter(|end| *end < start) {
        return Err(before_start_error("until", end, start));
    }
    Ok((start, end, o.duration("fade")?.unwrap_or(Time::from_secs(0.3))))
}

fn reach(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let end = find_joint(&this.asset, &c.text(0)?)?;
    let target = c.target(1)?;
    let o = c.options(2, &["at", "root", "pole", "soft", "keep", "weight", "from", "until", "fade"])?;
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
        let error = format!("reach: \"{}\" is not below the root \"{}\"", name(end), name(root));
        return Err(ApiError::new(error)
            .focus(name(root))
            .hint("root must be a joint above the one that reaches"));
    }
    if joints.len() < 2 {
        let error = format!("reach: joint \"{}\" has no parent joint that could bend", name(end));
        return Err(ApiError::new(error).focus(name(end)));
    }
    if target == (Target::Joint { actor: this.id, joint: end }) {
        return Err(ApiError::new("reach: a joint cannot reach for itself"));
    }
    // Elbows bend backwards, knees forward.
    let middle = name(joints[joints.len() / 2]).to_ascii_lowercase();
    let knee = ["leg", "knee", "calf", "shin"].iter().any(|part| middle.contains(part));
    let kind = ConstraintKind::Reach(ReachConstraint {
        joints,
        target,
        offset: o.point("at")?,
        pole: o.target("pole")?,
        hint: this.asset.front().direction() * if knee { 1.0 } else { -1.0 },
        soft: o.number_in("soft", 0.0, 1.0)?.unwrap_or(0.05),
        keep_rotation: o.flag("keep")?.unwrap_or(false),
    });
    add_constraint(c, this.id, constraint(c, kind, &o)?)
}

fn aim(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let last = find_joint(&this.asset, &c.text(0)?)?;
    let target = c.target(1)?;
    let o = c.options(2, &["joints", "shares", "limit", "weight", "from", "until", "fade"])?;
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
                let numbers = crate::errors::format_count(joints.len(), "number");
                return Err(ApiError::new(format!(
                    "aim: shares must be an array of {numbers} from 0 up, one for each joint"
                )));
            }
        },
    };
    let limit = radians(o.number_in("limit", 0.0, 180.0)?.unwrap_or(80.0));
    add_constraint(
        c,
        this.id,
        constraint(c, ConstraintKind::Aim(AimConstraint { joints, shares, target, limit }), &o)?,
    )
}

fn plant_feet(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let o = c.options(0, &["feet", "ground", "weight", "from", "until", "fade"])?;
    let skeleton = &this.asset.skeleton;
    let legs: Vec<Leg> = match o.get("feet") {
        Some(names) => {
            let label = o.label("feet");
            let Some(names) = names.clone().try_cast::<rhai::Array>() else {
                return Err(crate::call::wrong(&names, &label, "an array of joints' names"));
            };
            let foot = |name: &Dynamic| find_joint(&this.asset, &text(name, &label)?);
            names.iter().map(|n| leg_of_foot(skeleton, foot(n)?)).collect::<Result<_, _>>()?
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
    let one = |given: &Dynamic| match given.read_lock::<ActorRef>() {
        Some(actor) if actor.id != this.id => Ok(actor.id),
        _ => Err(ApiError::new("plant_feet: ground must be another actor, or an array of them")),
    };
    let ground = match o.get("ground") {
        None => Vec::new(),
        Some(given) => match given.read_lock::<rhai::Array>() {
            Some(many) => many.iter().map(one).collect::<Result<_, _>>()?,
            None => vec![one(&given)?],
        },
    };
    add_constraint(
        c,
        this.id,
        constraint(c, ConstraintKind::FootLock(FootLock { legs, hips, ground, ..FootLock::default() }), &o)?,
    )
}

fn mirror(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let o = c.options(0, &["weight", "from", "until", "fade"])?;
    let mirroring = super::clip::mirroring(c, &this.asset)?;
    add_constraint(c, this.id, constraint(c, ConstraintKind::Mirror(Arc::new(mirroring)), &o)?)
}

fn change_constraint(c: &Call, change: impl FnOnce(&mut Constraint) -> Result<(), ApiError>) -> Reply {
    let this: ConstraintRef = c.this()?;
    if let Some(goal) = c.stage_draft().actor(this.actor)?.actor.constraints.get_mut(this.index) {
        change(goal)?;
    }
    c.receiver()
}

fn from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change_constraint(c, |g| {
        g.start = t;
        Ok(())
    })
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change_constraint(c, |g| {
        if t < g.start {
            return Err(before_start_error("until", t, g.start));
        }
        g.end = Some(t);
        Ok(())
    })
}

fn fade(c: &mut Call) -> Reply {
    let t = c.duration(0)?;
    change_constraint(c, |g| {
        g.fade = t;
        Ok(())
    })
}

fn weight(c: &mut Call) -> Reply {
    let w = c.number_in(0, 0.0, 1.0)? as f32;
    change_constraint(c, |g| {
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
            return Err(
                ApiError::new("limit: no limit is given").hint("give swing, twist or hinge, in degrees")
            );
        }
        (None, swing, twist) => Limit::SwingTwist {
            axis,
            swing: swing.unwrap_or(180.0).to_radians(),
            twist: twist.unwrap_or((-std::f64::consts::PI, std::f64::consts::PI)),
        },
        (Some(_), ..) => return Err(ApiError::new("limit: a hinge has no swing and no twist")),
    };
    let mut stage_draft = c.stage_draft();
    let actor = &mut stage_draft.actor(this.actor)?.actor;
    actor.limits.retain(|(joint, _)| *joint != this.joint);
    actor.limits.push((this.joint, limit));
    c.receiver()
}
