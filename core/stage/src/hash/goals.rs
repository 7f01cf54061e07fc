//! Goals, limits and springs.

use super::writer::Writer;
use crate::goals::*;
use choreo_motion::ik::Limit;
use choreo_motion::spring::{ColliderShape, RigBone, SpringBone};

impl Writer {
    pub(super) fn goal(&mut self, goal: &Goal) {
        let Goal { kind, start, end, fade, weight } = goal;
        self.time(*start);
        self.option(end, |w, end| w.time(*end));
        self.time(*fade);
        self.f32(*weight);
        match kind {
            GoalKind::Reach(Reach { joints, target, offset, pole, hint, soft, keep_rotation }) => {
                self.tag(0);
                self.list(joints, |w, j| w.u32(*j));
                self.target(target);
                self.option(offset, |w, offset| w.dvec3(*offset));
                self.option(pole, |w, pole| w.target(pole));
                self.dvec3(*hint);
                self.f64(*soft);
                self.flag(*keep_rotation);
            }
            GoalKind::Aim(AimGoal { joints, shares, target, limit }) => {
                self.tag(1);
                self.list(joints, |w, j| w.u32(*j));
                self.list(shares, |w, s| w.f64(*s));
                self.target(target);
                self.f64(*limit);
            }
            GoalKind::Plant(Plant { legs, hips, ground, only }) => {
                self.tag(2);
                self.list(legs, |w, Leg { hip, knee, foot, toe }| {
                    [hip, knee, foot].into_iter().for_each(|j| w.u32(*j));
                    w.option(toe, |w, toe| w.u32(*toe));
                });
                self.option(hips, |w, hips| w.u32(*hips));
                self.list(ground, |w, ground| w.count(*ground));
                self.list(only, |w, (from, to)| [from, to].into_iter().for_each(|t| w.time(*t)));
            }
            // What it exchanges follows from the asset.
            GoalKind::Mirror(_) => self.tag(3),
        }
    }

    pub(super) fn limit(&mut self, limit: &Limit) {
        match limit {
            Limit::Free => self.tag(0),
            Limit::SwingTwist { axis, swing, twist } => {
                self.tag(1);
                self.dvec3(*axis);
                [*swing, twist.0, twist.1].into_iter().for_each(|v| self.f64(v));
            }
            Limit::Hinge { axis, angle } => {
                self.tag(2);
                self.dvec3(*axis);
                [angle.0, angle.1].into_iter().for_each(|v| self.f64(v));
            }
        }
    }

    pub(super) fn springs(&mut self, springs: &ActorSprings) {
        let ActorSprings { rig, wind, pre_roll } = springs;
        self.dvec3(*wind);
        self.time(*pre_roll);
        self.option(&rig.ground, |w, ground| w.f64(*ground));
        self.list(rig.bones(), |w, bone| {
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
        self.list(rig.colliders(), |w, collider| {
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
}
