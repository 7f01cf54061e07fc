//! Goals, limits and springs.

use crate::hash::stage::write_target;
use crate::stage::constraint::*;
use crate::stage::springs::ActorSprings;
use choreo_asset::hash::Writer;
use choreo_motion::ik::Limit;
use choreo_motion::spring::{ColliderShape, RigBone, SpringBone};

pub(super) fn write_goal(w: &mut Writer, goal: &Goal) {
    let Goal { kind, start, end, fade, weight } = goal;
    w.time(*start);
    w.option(end, |w, end| w.time(*end));
    w.time(*fade);
    w.f32(*weight);
    match kind {
        GoalKind::Reach(Reach { joints, target, offset, pole, hint, soft, keep_rotation }) => {
            w.tag(0);
            w.list(joints, |w, j| w.u32(*j));
            write_target(w, target);
            w.option(offset, |w, offset| w.dvec3(*offset));
            w.option(pole, |w, pole| write_target(w, pole));
            w.dvec3(*hint);
            w.f64(*soft);
            w.flag(*keep_rotation);
        }
        GoalKind::Aim(AimGoal { joints, shares, target, limit }) => {
            w.tag(1);
            w.list(joints, |w, j| w.u32(*j));
            w.list(shares, |w, s| w.f64(*s));
            write_target(w, target);
            w.f64(*limit);
        }
        GoalKind::Plant(Plant { legs, hips, ground, only }) => {
            w.tag(2);
            w.list(legs, |w, Leg { hip, knee, foot, toe }| {
                [hip, knee, foot].into_iter().for_each(|j| w.u32(*j));
                w.option(toe, |w, toe| w.u32(*toe));
            });
            w.option(hips, |w, hips| w.u32(*hips));
            w.list(ground, |w, ground| w.count(*ground));
            w.list(only, |w, (from, to)| [from, to].into_iter().for_each(|t| w.time(*t)));
        }
        // What it exchanges follows from the asset.
        GoalKind::Mirror(_) => w.tag(3),
    }
}

pub(super) fn write_limit(w: &mut Writer, limit: &Limit) {
    match limit {
        Limit::Free => w.tag(0),
        Limit::SwingTwist { axis, swing, twist } => {
            w.tag(1);
            w.dvec3(*axis);
            [*swing, twist.0, twist.1].into_iter().for_each(|v| w.f64(v));
        }
        Limit::Hinge { axis, angle } => {
            w.tag(2);
            w.dvec3(*axis);
            [angle.0, angle.1].into_iter().for_each(|v| w.f64(v));
        }
    }
}

pub(super) fn write_springs(w: &mut Writer, springs: &ActorSprings) {
    let ActorSprings { rig, wind, pre_roll } = springs;
    w.dvec3(*wind);
    w.time(*pre_roll);
    w.option(&rig.ground, |w, ground| w.f64(*ground));
    w.list(rig.bones(), |w, bone| {
        let RigBone { joint, tail, spring, gravity, pull, hit_radius, center, colliders } = bone;
        let SpringBone { stiffness, damping } = spring;
        w.u32(*joint);
        w.vec3(*tail);
        [*stiffness, *damping, *hit_radius].into_iter().for_each(|v| w.f64(v));
        w.dvec3(*gravity);
        w.dvec3(*pull);
        w.option(center, |w, center| w.u32(*center));
        w.list(colliders, |w, c| w.u32(*c));
    });
    w.list(rig.colliders(), |w, collider| {
        w.u32(collider.joint);
        match collider.shape {
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
}
