//! Spring bones (secondary motion), their colliders, and wind.

use super::joint_names::find_joint;
use crate::call::{ApiError, Call, Reply, fields, text};
use crate::frame_callback;
use crate::suggest::list;
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

pub fn spring(c: &mut Call) -> Reply {
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

pub fn springs(c: &mut Call) -> Reply {
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

pub fn collider(c: &mut Call) -> Reply {
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

pub fn wind(c: &mut Call) -> Reply {
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
                now[joint] = matches_wildcards(&name.to_ascii_lowercase(), &parts);
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

/// Whether a text matches a pattern that was split at `*`.
fn matches_wildcards(text: &str, parts: &[String]) -> bool {
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
    fn wildcards_match_whole_names() {
        let matches_wildcards = |text: &str, pattern: &str| {
            super::matches_wildcards(text, &pattern.split('*').map(str::to_string).collect::<Vec<_>>())
        };
        assert!(
            matches_wildcards("hair_front_1", "*hair*")
                && matches_wildcards("hair", "hair*")
                && matches_wildcards("tail3", "t*3")
        );
        assert!(
            !matches_wildcards("head", "*hair*")
                && !matches_wildcards("aba", "ab*ba")
                && matches_wildcards("abba", "ab*ba")
        );
    }
}
