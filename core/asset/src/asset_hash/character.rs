//! Hashes of the parts that make a model a character: bones of a human body, expressions, springs, eyes.

use crate::expression::{ColorBind, Expression, ExpressionGroup, MorphBind, Override, UvBind};
use crate::eyes::{Eyes, EyesMovedBy, RangeMap};
use crate::hash::Writer;
use choreo_motion::Humanoid;
use choreo_motion::spring::parameters::{ColliderShape, SpringChain, SpringCollider, SpringJoint, Springs};

pub(super) fn humanoid(w: &mut Writer, humanoid: &Humanoid) {
    let bones: Vec<u32> = humanoid.bones().flat_map(|(bone, joint)| [bone as u32, joint]).collect();
    w.numbers(&bones, 4);
    w.option(&humanoid.t_pose(), |w, pose| {
        w.list(pose, |w, joint| {
            w.vec3(joint.translation);
            w.quat(joint.rotation);
            w.vec3(joint.scale);
        });
    });
}

pub(super) fn expression(w: &mut Writer, expression: &Expression) {
    let Expression { name, binary, group, morphs, colors, uvs, over_mouth, over_blink, over_gaze } =
        expression;
    w.text(name);
    w.flag(*binary);
    w.tag(match group {
        ExpressionGroup::Other => 0,
        ExpressionGroup::Mouth => 1,
        ExpressionGroup::Blink => 2,
        ExpressionGroup::Gaze => 3,
    });
    w.list(morphs, |w, MorphBind { instance, target, weight }| {
        w.u32(*instance);
        w.u32(*target);
        w.f32(*weight);
    });
    w.list(colors, |w, ColorBind { material, color, to }| {
        w.u32(*material);
        w.tag(*color as u8);
        w.vec4(*to);
    });
    w.list(uvs, |w, UvBind { material, offset, scale }| {
        w.u32(*material);
        w.f32s(&[offset.x, offset.y, scale.x, scale.y]);
    });
    for over in [over_mouth, over_blink, over_gaze] {
        w.tag(match over {
            Override::None => 0,
            Override::Block => 1,
            Override::Blend => 2,
        });
    }
}

pub(super) fn springs(w: &mut Writer, springs: &Springs) {
    let Springs { colliders, chains } = springs;
    w.list(colliders, |w, SpringCollider { joint, shape }| {
        w.u32(*joint);
        match *shape {
            ColliderShape::Sphere { offset, radius, inside } => {
                w.tag(0);
                w.vec3(offset);
                w.f32(radius);
                w.flag(inside);
            }
            ColliderShape::Capsule { offset, tail, radius, inside } => {
                w.tag(1);
                w.vec3(offset);
                w.vec3(tail);
                w.f32(radius);
                w.flag(inside);
            }
            ColliderShape::Plane { offset, normal } => {
                w.tag(2);
                w.vec3(offset);
                w.vec3(normal);
            }
        }
    });
    w.list(chains, |w, SpringChain { name, joints, colliders, center }| {
        w.text(name);
        w.list(joints, |w, joint| {
            let SpringJoint {
                joint,
                tail,
                hit_radius,
                stiffness,
                gravity_power,
                gravity_direction,
                drag_force,
            } = joint;
            w.u32(*joint);
            w.vec3(*tail);
            w.vec3(*gravity_direction);
            for value in [hit_radius, stiffness, gravity_power, drag_force] {
                w.f32(*value);
            }
        });
        w.numbers(colliders, 4);
        w.option(center, |w, joint| w.u32(*joint));
    });
}

pub(super) fn eyes(w: &mut Writer, eyes: &Eyes) {
    let Eyes { offset_from_head, moved_by, inner, outer, down, up } = eyes;
    w.vec3(*offset_from_head);
    w.tag(match moved_by {
        EyesMovedBy::Bones => 0,
        EyesMovedBy::Expressions => 1,
    });
    for RangeMap { input_max, output_scale } in [inner, outer, down, up] {
        w.f32(*input_max);
        w.f32(*output_scale);
    }
}
