//! Advances all springs of a character by a step.

use super::{BoneState, Drive, RigBone, SpringRig, WorldCollider};
use crate::input_error::InputError;
use crate::skeleton::Skeleton;
use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3, Mat3, Mat3A, Vec3, Vec3A};

/// Sticks shorter than this, in metres, have no direction and stay as they are animated.
const MIN_STICK_LENGTH_M: f64 = 1e-7;

/// Positions and velocities of a rig's bones. Empty: not begun; the first step puts the bones at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpringState {
    /// One per bone of the rig; `None` = not begun, or without a direction.
    bones: Vec<Option<BoneState>>,
}

impl SpringState {
    /// The state of each bone of the rig.
    pub fn bones(&self) -> &[Option<BoneState>] {
        &self.bones
    }

    /// Copies another state, without allocating if there is room.
    pub fn copy_from(&mut self, other: &SpringState) {
        self.bones.clear();
        self.bones.extend_from_slice(&other.bones);
    }

    /// Bytes that a copy takes.
    pub fn size(&self) -> usize {
        self.bones.len() * size_of::<Option<BoneState>>()
    }
}

/// Buffers; their content on entry does not matter.
#[derive(Clone, Debug, Default)]
pub struct SpringScratch {
    /// Rigid motion of each joint by the springs so far.
    joint_motions: Vec<Option<RigidMotion>>,
    world_colliders: Vec<Option<WorldCollider>>,
}

/// A rigid motion in model space.
#[derive(Clone, Copy, Debug)]
struct RigidMotion {
    rotation: DQuat,
    translation: DVec3,
}

impl RigidMotion {
    const IDENTITY: RigidMotion = RigidMotion { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    fn point(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.translation
    }
}

/// Advances the springs by a step and turns their joints. Allocates only if the buffers have held less so far.
///
/// Colliders move with their joints as animated. If `world_from_model` cannot be inverted (a scale of 0), nothing swings.
pub struct SpringStep<'a> {
    /// The springs.
    pub rig: &'a SpringRig,
    /// Parents and rest pose.
    pub skeleton: &'a Skeleton,
    /// Transform of the model at the end of the step.
    pub world_from_model: DAffine3,
    /// Velocity of the air, metres per second, in world space.
    pub wind: DVec3,
    /// Length of the step, seconds, ≥ 0.
    pub seconds: f64,
    /// Input and output: state of the bones.
    pub state: &'a mut SpringState,
    /// Buffers.
    pub scratch: &'a mut SpringScratch,
    /// One per joint. Input: as animated at the end of the step. Output: with the springs' joints and all joints below them
    /// turned.
    pub model_from_joint: &'a mut [Affine3A],
}

impl SpringStep<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let (joints, matrices) = (self.skeleton.len(), self.model_from_joint.len());
        InputError::check_lengths(&[("SpringStep.model_from_joint", matrices, joints)])?;
        self.rig
            .check(joints)
            .map_err(|e| InputError::Nested { field: "SpringStep.rig", error: e.to_string() })?;
        let forward = self.seconds >= 0.0 && self.seconds.is_finite();
        InputError::check_value(forward, "SpringStep.seconds", self.seconds, "finite and ≥ 0")?;
        InputError::check_value(self.wind.is_finite(), "SpringStep.wind", self.wind, "finite")
    }

    /// Runs the step.
    pub fn run(&mut self) {
        let joints = self.skeleton.len().min(self.model_from_joint.len());
        self.state.bones.resize(self.rig.bones().len(), None);
        let model_from_world = self.world_from_model.matrix3.inverse();
        let placed = self.world_from_model.is_finite() && model_from_world.is_finite();
        if !placed || self.rig.is_empty() {
            self.state.bones.fill(None);
            return;
        }
        self.update_world_colliders();
        let mut joint_motions = std::mem::take(&mut self.scratch.joint_motions);
        let mut states = std::mem::take(&mut self.state.bones);
        joint_motions.clear();
        joint_motions.resize(joints, None);
        let mut bones = self.rig.bones().iter().zip(&mut states).peekable();
        let first = self.rig.bones()[0].joint as usize;
        let mut space = (None, InertiaSpace::WORLD);
        for joint in first..joints {
            let mut motion = self.skeleton.parents()[joint].and_then(|p| joint_motions[p as usize]);
            if let Some((bone, state)) = bones.next_if(|(bone, _)| bone.joint as usize == joint) {
                if space.0 != bone.center {
                    space = (bone.center, self.inertia_space(bone.center));
                }
                motion = self.step_bone(bone, state, &space.1, motion, &model_from_world).or(motion);
            }
            joint_motions[joint] = motion;
            if let Some(motion) = motion {
                let m = &mut self.model_from_joint[joint];
                let at = motion.point(Vec3::from(m.translation).as_dvec3());
                let turn = Mat3A::from(Mat3::from_quat(motion.rotation.as_quat()));
                *m = Affine3A { matrix3: turn * m.matrix3, translation: Vec3A::from(at.as_vec3()) };
            }
        }
        self.scratch.joint_motions = joint_motions;
        self.state.bones = states;
    }

    /// Simulates one bone; returns how its joint moves, or `None` where it has no direction.
    fn step_bone(
        &self,
        bone: &RigBone,
        state: &mut Option<BoneState>,
        space: &InertiaSpace,
        parent: Option<RigidMotion>,
        model_from_world: &DMat3,
    ) -> Option<RigidMotion> {
        let follows = parent.is_some();
        let parent = parent.unwrap_or(RigidMotion::IDENTITY);
        let animated = &self.model_from_joint[bone.joint as usize];
        let animated_head = Vec3::from(animated.translation).as_dvec3();
        let head = parent.point(animated_head);
        let stick = parent.rotation * Vec3::from(animated.matrix3 * Vec3A::from(bone.tail)).as_dvec3();
        let world_stick = self.world_from_model.matrix3 * stick;
        let length = world_stick.length();
        let world_head = self.world_from_model.transform_point3(head);
        if !(length > MIN_STICK_LENGTH_M && length.is_finite() && world_head.is_finite()) {
            *state = None;
            return None;
        }
        let drive = Drive {
            head: space.point_from_world(self.world_from_model.transform_point3(animated_head)),
            follows,
            target: space.vector_from_world(world_stick / length),
            length,
            gravity: space.vector_from_world(bone.gravity),
            pull: space.vector_from_world(bone.pull),
            wind: space.vector_from_world(self.wind),
        };
        match state {
            Some(state) => bone.spring.step(state, &drive, self.seconds),
            None => *state = Some(bone.spring.settled(&drive)),
        }
        let bone_state = state.as_mut()?;
        let mut direction = space.vector_to_world(bone_state.direction);
        if !bone.colliders.is_empty() || self.rig.ground.is_some() {
            let mut velocity = space.vector_to_world(bone_state.velocity);
            let radius = bone.hit_radius * (length / f64::from(bone.tail.length()));
            if self.push_out_of_colliders(bone, world_head, length, radius, &mut direction, &mut velocity) {
                bone_state.direction = space.vector_from_world(direction);
                bone_state.velocity = space.vector_from_world(velocity);
            }
        }
        let new_direction = (*model_from_world * direction).try_normalize()?;
        let turn = DQuat::from_rotation_arc(stick.normalize(), new_direction);
        if !turn.is_finite() {
            return None;
        }
        let rotation = (turn * parent.rotation).normalize();
        Some(RigidMotion { rotation, translation: turn * (parent.translation - head) + head })
    }

    fn push_out_of_colliders(
        &self,
        bone: &RigBone,
        head: DVec3,
        length: f64,
        radius: f64,
        direction: &mut DVec3,
        velocity: &mut DVec3,
    ) -> bool {
        let mut touched = false;
        let ground = self.rig.ground.map(|y| WorldCollider::Plane { point: DVec3::Y * y, normal: DVec3::Y });
        // Pushing a tail out of one collider may push it into another. The ground comes last, so that it always holds.
        for _ in 0..2 {
            let colliders =
                bone.colliders.iter().filter_map(|c| self.scratch.world_colliders.get(*c as usize)?.as_ref());
            let before = touched;
            touched = false;
            for collider in colliders.chain(&ground) {
                touched |= collider.push_out(head, length, radius, direction, velocity);
            }
            if !touched {
                return before;
            }
        }
        touched
    }

    fn update_world_colliders(&mut self) {
        let world_colliders = &mut self.scratch.world_colliders;
        world_colliders.clear();
        for collider in self.rig.colliders() {
            let joint = self.model_from_joint.get(collider.joint as usize);
            let world_from_joint = joint.map(|j| self.world_from_model * to_f64(j));
            world_colliders.push(world_from_joint.and_then(|w| WorldCollider::new(&collider.shape, &w)));
        }
    }

    /// The space in which inertia is measured: it turns and moves with a joint, but is never scaled.
    fn inertia_space(&self, center: Option<u32>) -> InertiaSpace {
        let Some(joint) = center.and_then(|c| self.model_from_joint.get(c as usize)) else {
            return InertiaSpace::WORLD;
        };
        let world = self.world_from_model * to_f64(joint);
        let back = world.matrix3.z_axis.try_normalize();
        let right = back.and_then(|z| world.matrix3.y_axis.cross(z).try_normalize());
        match (right, back) {
            (Some(x), Some(z)) if world.is_finite() => {
                let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
                InertiaSpace { world_from_space: rotation, origin: world.translation }
            }
            _ => InertiaSpace::WORLD,
        }
    }
}

struct InertiaSpace {
    world_from_space: DQuat,
    origin: DVec3,
}

impl InertiaSpace {
    const WORLD: InertiaSpace = InertiaSpace { world_from_space: DQuat::IDENTITY, origin: DVec3::ZERO };

    fn point_from_world(&self, p: DVec3) -> DVec3 {
        self.world_from_space.inverse() * (p - self.origin)
    }
    fn vector_from_world(&self, v: DVec3) -> DVec3 {
        self.world_from_space.inverse() * v
    }
    fn vector_to_world(&self, v: DVec3) -> DVec3 {
        self.world_from_space * v
    }
}

fn to_f64(a: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: Mat3::from(a.matrix3).as_dmat3(), translation: Vec3::from(a.translation).as_dvec3() }
}
