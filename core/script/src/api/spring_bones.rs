//! Spring bones (secondary motion), their colliders, and wind.

use super::joint_names::{find_joint, joints_of_pattern};
use crate::call::{ApiError, Call, Reply, fields, texts};
use crate::frame_callback;
use crate::value::ActorRef;
use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_motion::spring::{ColliderShape, RigBone, SpringBone, SpringCollider};
use choreo_stage::{ActorEdit, ActorSprings, SpringParameters};
use glam::DVec3;
use rhai::Dynamic;
use std::sync::Arc;

const GRAVITY: f64 = 9.81;

/// Changes the spring bones of an actor, which are empty at first if its file has none.
fn change_springs(c: &Call, change: impl FnOnce(&mut ActorSprings)) -> Reply {
    let this: ActorRef = c.this()?;
    let mut stage_draft = c.stage_draft();
    let draft = stage_draft.actor(this.id)?;
    change(Arc::make_mut(draft.actor.springs.get_or_insert_default()));
    c.receiver()
}

pub(super) fn spring(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let joints = matching_joints(&this.asset, &c.value(0), &c.label(0))?;
    let mut spring = SpringParameters::default();
    let o = c.options(1, &[fields::names(&spring, &[]), vec!["center"]].concat())?;
    fields::fill(c, &o, &mut spring)?;
    let SpringParameters { frequency, damping, gravity, radius } = spring;
    let center = o.text("center")?.map(|name| find_joint(&this.asset, &name)).transpose()?;
    change_springs(c, |springs| {
        let colliders: Vec<u32> = (0..springs.rig.colliders().len() as u32).collect();
        for joint in joints {
            springs.rig.add(RigBone {
                joint,
                tail: bone_tail(&this.asset, joint),
                spring: SpringBone::new(frequency, damping),
                gravity: DVec3::NEG_Y * (GRAVITY * gravity),
                pull: DVec3::ZERO,
                hit_radius: radius,
                center,
                colliders: colliders.clone(),
            });
        }
    })
}

/// Tail of a spring bone in joint space: the position of the first child, else a continuation of the bone from the
/// parent with the same length.
fn bone_tail(asset: &Asset, joint: u32) -> glam::Vec3 {
    let (parents, rest) = (asset.skeleton.parents(), asset.skeleton.rest());
    let child = (0..parents.len()).find(|j| parents[*j] == Some(joint));
    let own = rest[joint as usize];
    child.map_or_else(|| own.rotation.inverse() * own.translation, |child| rest[child].translation)
}

pub(super) fn springs(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    if let Ok(on) = c.value(0).as_bool() {
        let mut stage_draft = c.stage_draft();
        let draft = stage_draft.actor(this.id)?;
        draft.actor.springs =
            if on { draft.actor.springs.take().or(ActorSprings::of(&this.asset)) } else { None };
        drop(stage_draft);
        return c.receiver();
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
    change_springs(c, |springs| {
        springs.rig.ground = ground.or(springs.rig.ground);
        springs.pre_roll = pre_roll.unwrap_or(springs.pre_roll);
    })
}

pub(super) fn collider(c: &mut Call) -> Reply {
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
    change_springs(c, |springs| {
        let index = springs.rig.add_collider(SpringCollider { joint, shape });
        springs.rig.bones_mut().for_each(|bone| bone.colliders.push(index));
    })
}

pub(super) fn wind(c: &mut Call) -> Reply {
    let velocity = c.point(0)?.clamp_length_max(1e4);
    if c.in_frame {
        let this: ActorRef = c.this()?;
        frame_callback::edit_frame(|e| e.actors.push((this.id, ActorEdit::Wind(velocity))));
        return c.receiver();
    }
    change_springs(c, |springs| springs.wind = velocity)
}

/// Indices of the joints that a text or an array of texts selects: a name, "Name.." with all below, or a pattern with `*`.
fn matching_joints(asset: &Asset, given: &Dynamic, label: &str) -> Result<Vec<u32>, ApiError> {
    let skeleton = &asset.skeleton;
    let mut hit = vec![false; skeleton.len()];
    for pattern in texts(given, label)? {
        let (joints, below) = joints_of_pattern(asset, &pattern)?;
        let mut now = vec![false; skeleton.len()];
        joints.into_iter().for_each(|joint| now[joint as usize] = true);
        for joint in 0..skeleton.len() {
            now[joint] |= below && skeleton.parents()[joint].is_some_and(|p| now[p as usize]);
            hit[joint] |= now[joint];
        }
    }
    Ok((0..skeleton.len() as u32).filter(|j| hit[*j as usize]).collect())
}
