//! The bones of a BVH file. The format has no rest rotations, so rotations are relative to the rest pose, in world axes.

use choreo_plugin::glam::{DAffine3, DMat3, DQuat, DVec3};
use choreo_plugin::stage::{Actor, ActorState};

/// The bones of one actor, parents first.
pub(crate) struct Bones {
    pub names: Vec<String>,
    parents: Vec<Option<usize>>,
    children: Vec<Vec<usize>>,
    /// Offsets from the parent in the rest pose, in world axes, metres; those of roots are from the origin.
    pub offsets: Vec<DVec3>,
    /// Rest rotations in model space.
    rest: Vec<DQuat>,
    /// Whether each bone has position channels.
    pub has_position_channels: Vec<bool>,
    /// Whether a root was added above several roots of the skeleton.
    added_root: bool,
}

/// World positions (metres) and rotations relative to the rest pose, in the order of the bones.
pub(crate) struct Pose {
    positions: Vec<DVec3>,
    rotations: Vec<DQuat>,
}

impl Bones {
    /// The bones, scaled like the actor at the first frame. Several roots are put below an added root with the actor's name.
    pub(crate) fn of(actor: &Actor, first: &ActorState) -> Bones {
        let skeleton = &actor.asset.skeleton;
        let joint_roots = skeleton.parents().iter().filter(|parent| parent.is_none()).count();
        let added_root = joint_roots != 1;
        let shift = usize::from(added_root);
        let (size, ..) = first.world_from_model.to_scale_rotation_translation();
        let mut matrices: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
        for (local, parent) in skeleton.rest().iter().zip(skeleton.parents()) {
            let own = DAffine3::from_scale_rotation_translation(
                local.scale.as_dvec3(),
                local.rotation.as_dquat(),
                local.translation.as_dvec3(),
            );
            matrices.push(parent.map_or(own, |parent| matrices[parent as usize] * own));
        }
        let mut bones = Bones {
            names: Vec::new(),
            parents: Vec::new(),
            children: vec![Vec::new(); skeleton.len() + shift],
            offsets: Vec::new(),
            rest: Vec::new(),
            has_position_channels: Vec::new(),
            added_root,
        };
        if added_root {
            bones.push(&actor.name, None, DVec3::ZERO, DQuat::IDENTITY);
        }
        for (joint, parent) in skeleton.parents().iter().enumerate() {
            let from = parent.map_or(DVec3::ZERO, |parent| matrices[parent as usize].translation);
            let parent = parent.map(|parent| parent as usize + shift).or(added_root.then_some(0));
            let offset = (matrices[joint].translation - from) * size;
            bones.push(&skeleton.names()[joint], parent, offset, rotation(&matrices[joint]));
        }
        bones
    }

    fn push(&mut self, name: &str, parent: Option<usize>, offset: DVec3, rest: DQuat) {
        let plain = |c: char| if c.is_whitespace() || matches!(c, '{' | '}') { '_' } else { c };
        let name: String = name.chars().map(plain).collect();
        let bone = self.names.len();
        self.names.push(if name.is_empty() { format!("joint_{bone}") } else { name });
        self.parents.push(parent);
        if let Some(parent) = parent {
            self.children[parent].push(bone);
        }
        self.offsets.push(offset);
        self.rest.push(rest);
        self.has_position_channels.push(parent.is_none());
    }

    pub(crate) fn is_leaf(&self, bone: usize) -> bool {
        self.children[bone].is_empty()
    }

    /// End of a leaf bone relative to its joint: half of the bone's offset, because joints have no length.
    pub(crate) fn end_site_offset(&self, bone: usize) -> DVec3 {
        self.offsets[bone] * 0.5
    }

    /// (bone, depth), parents before children: the order of the file's hierarchy and of its frames.
    pub(crate) fn depth_first(&self) -> Vec<(usize, usize)> {
        let mut order = Vec::with_capacity(self.names.len());
        let mut open = vec![(0, 0)];
        while let Some((bone, depth)) = open.pop() {
            order.push((bone, depth));
            open.extend(self.children[bone].iter().rev().map(|child| (*child, depth + 1)));
        }
        order
    }

    /// World positions and rotations in a frame.
    pub(crate) fn pose(&self, state: &ActorState) -> Pose {
        let mut pose = Pose { positions: Vec::new(), rotations: Vec::new() };
        if self.added_root {
            pose.push(&state.world_from_model, DQuat::IDENTITY);
        }
        let first = pose.positions.len();
        for (joint, rest) in self.rest[first..].iter().enumerate() {
            pose.push(&state.world_from_joint(joint).unwrap_or(state.world_from_model), *rest);
        }
        pose
    }

    /// Marks the bones whose offset in this pose differs from rest.
    pub(crate) fn find_moving(&mut self, pose: &Pose, tolerance: f64) {
        for bone in 0..self.names.len() {
            self.has_position_channels[bone] |=
                (self.local_position(pose, bone) - self.offsets[bone]).length() > tolerance;
        }
    }

    /// Position relative to the parent, in the parent's axes; a root's position is in world space.
    pub(crate) fn local_position(&self, pose: &Pose, bone: usize) -> DVec3 {
        self.parents[bone].map_or(pose.positions[bone], |parent| {
            pose.rotations[parent].inverse() * (pose.positions[bone] - pose.positions[parent])
        })
    }

    /// Rotation relative to the parent; a root's rotation is in world space.
    pub(crate) fn local_rotation(&self, pose: &Pose, bone: usize) -> DQuat {
        self.parents[bone].map_or(pose.rotations[bone], |parent| {
            (pose.rotations[parent].inverse() * pose.rotations[bone]).normalize()
        })
    }
}

impl Pose {
    fn push(&mut self, world: &DAffine3, rest: DQuat) {
        self.positions.push(world.translation);
        self.rotations.push((rotation(world) * rest.inverse()).normalize());
    }
}

/// The rotation of a matrix, with its axes orthogonalized and mirroring removed.
fn rotation(matrix: &DAffine3) -> DQuat {
    let DMat3 { x_axis, y_axis, .. } = matrix.matrix3;
    let x = x_axis.normalize_or(DVec3::X);
    let y = (y_axis - x * x.dot(y_axis)).normalize_or(x.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)))
}
