//! Joints of actors: look-up by name, rotations for a frame, and keyframes.

use super::joint_names::find_joint;
use super::{clip_edit, keys};
use crate::call::{ApiError, Call, Reply, api, euler, radians};
use crate::frame_callback;
use crate::value::{ActorRef, JointRef};
use choreo_stage::{ActorEdit, Placement};
use glam::{DQuat, DVec3};
use rhai::Dynamic;

api! {
    /// Returns a joint (bone) by name, as a target, as a parent or for rotations of its own. Joints of humanoids whose
    /// names are known also have those of Mixamo and VRM, without a prefix: "LeftHand", "Spine1", "leftLowerArm".
    Actor.joint("name") -> Joint = joint, in_frames;
    /// Returns the names of the joints (bones).
    Actor.joints("") -> "array of texts" = joints;
    /// Rotates the joint about its own y axis, in degrees, on top of the clips. Only inside `on_frame`.
    Joint.turn("degrees") = joint_turn, in_frames;
    /// Rotates the joint about its own x, then y, then z axis, in degrees, on top of the clips. Only inside
    /// `on_frame`.
    Joint.rotate("x, y, z") = joint_rotate, in_frames;
    /// Animates the joint with keyframes [[time, value], …] in stage time, added on top of its clips. `how`, easing and
    /// tangents as in Actor.key.
    /// - Properties: "rotation" (degrees [x, y, z] about the axes of the joint), "position" (metres along the axes
    ///   of the model), "scale" (a factor, or one per axis).
    Joint.key("property, keys, how?") = key;
    /// Returns the name of the joint.
    Joint.name("") -> "text" = joint_name, in_frames;
}

fn joint(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let joint = find_joint(&this.asset, &c.text(0)?)?;
    Ok(Dynamic::from(JointRef { actor: this.id, joint, asset: this.asset }))
}

fn joints(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    Ok(Dynamic::from_array(this.asset.skeleton.names().iter().map(|n| Dynamic::from(n.clone())).collect()))
}

fn turn_joint_in_frame(c: &Call, rotation: DQuat) -> Reply {
    let this: JointRef = c.this()?;
    if !c.in_frame {
        return Err(ApiError::new(format!("{} of a joint works inside on_frame only", c.def.name))
            .hint("on_frame(|t| actor.joint(\"…\").turn(10.0 * sin(t)))"));
    }
    let rotation = rotation.as_quat().normalize();
    frame_callback::edit_frame(|e| {
        e.actors.push((this.actor, ActorEdit::TurnJoint { joint: this.joint, rotation }))
    });
    c.receiver()
}

fn joint_turn(c: &mut Call) -> Reply {
    let degrees = c.number(0)?;
    turn_joint_in_frame(c, DQuat::from_rotation_y(radians(degrees)))
}

fn joint_rotate(c: &mut Call) -> Reply {
    let degrees = DVec3::new(c.number(0)?, c.number(1)?, c.number(2)?);
    turn_joint_in_frame(c, euler(degrees))
}

fn key(c: &mut Call) -> Reply {
    let this: JointRef = c.this()?;
    let channel = keys::channel(c, keys::named_property(c, &keys::keyed_properties::<Placement>())?, 1)?;
    let mut stage_draft = c.stage_draft();
    let drafts = &mut stage_draft.actor(this.actor)?.joint_keys;
    let curve = clip_edit::curve_in_parent_space(&this.asset, this.joint, &channel);
    drafts.retain(|(c, _)| (c.joint, c.path) != (curve.joint, curve.path));
    drafts.push((curve, c.place.clone()));
    c.receiver()
}

fn joint_name(c: &mut Call) -> Reply {
    let this: JointRef = c.this()?;
    let name = this.asset.skeleton.names().get(this.joint as usize).cloned().unwrap_or_default();
    Ok(Dynamic::from(name))
}
