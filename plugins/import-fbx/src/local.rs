//! The local transform of a node from its translation, Euler angles and scale, with pivots, offsets, pre- and post-rotation, and
//! what ufbx adds for units and axes; and its rate of change. Computed in f64 with libm, so that every machine gets the same
//! bits.

use choreo_motion::Transform;
use glam::{DAffine3, DQuat, DVec3};
use ufbx::{MirrorAxis, Node, PropFlags, RotationOrder};

pub(crate) const TRANSLATION: &str = "Lcl Translation";
pub(crate) const ROTATION: &str = "Lcl Rotation";
pub(crate) const SCALING: &str = "Lcl Scaling";
/// All properties that the local transform depends on.
pub(crate) const TRANSFORM_INPUTS: [&str; 10] = [
    TRANSLATION,
    ROTATION,
    SCALING,
    "PreRotation",
    "PostRotation",
    "RotationOffset",
    "RotationOrder",
    "RotationPivot",
    "ScalingOffset",
    "ScalingPivot",
];

/// T · Roff · Rp · Rpre · R · Rpost⁻¹ · Rp⁻¹ · Soff · Sp · S · Sp⁻¹ (FBX SDK, "Computing transformation matrices").
#[derive(Clone, Debug)]
pub(crate) struct LocalTransform {
    /// Translation, rotation and scale at rest, in the file's units and degrees.
    pub translation: DVec3,
    pub rotation: DVec3,
    pub scaling: DVec3,
    /// Rotation axes in the order in which they are applied; `None`: no rotation.
    rotation_axis_order: Option<[usize; 3]>,
    /// Fixed rotations to the left and to the right of the Euler rotation; `axes_turn` converts the file's axes, and does not
    /// apply to offsets.
    left_rotation: DQuat,
    right_rotation: DQuat,
    post_rotation: DQuat,
    axes_turn: DQuat,
    /// Soff + Sp − Rp, and −Sp: the lever arms that the rotation swings, without and with the scale.
    lever_arm: DVec3,
    scaled_lever_arm: DVec3,
    /// Rp + Roff.
    offset: DVec3,
    metres: f64,
    scale_factor: f64,
    mirror_axis: Option<usize>,
    /// The node is a helper that holds its parent's scale for children that inherit it.
    pub is_scale_helper: bool,
    /// Factors at rest from scale that is not inherited: of the translation, and of the scale.
    factors: [DVec3; 2],
}

/// An Euler rotation, with the partial products that its rate of change needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EulerRotation {
    parts: [DQuat; 3],
    /// Product of the first two rotations, and of all three.
    first_two: DQuat,
    product: DQuat,
}

fn vector(v: &ufbx::Vec3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

fn quaternion(q: &ufbx::Quat) -> DQuat {
    DQuat::from_xyzw(q.x, q.y, q.z, q.w)
}

/// A property of the node at rest; `None` where it has none.
pub(crate) fn property(node: &Node, name: &str) -> Option<DVec3> {
    let prop = node.element.props.find_prop(name)?;
    let v = &prop.value_vec4;
    (!prop.flags.has_any(PropFlags::NO_VALUE)).then(|| DVec3::new(v.x, v.y, v.z))
}

impl LocalTransform {
    /// `None` for the root, whose transform ufbx makes up.
    pub(crate) fn new(node: &Node) -> Option<LocalTransform> {
        if node.is_root {
            return None;
        }
        let helper = |n: &Node| n.scale_helper.as_ref().map(|h| vector(&h.local_transform.scale));
        let parent = node.parent.as_ref();
        let factors = match node.is_scale_helper {
            true => [None, parent.and_then(|p| p.inherit_scale_node.as_ref()).and_then(|n| helper(n))],
            false => [parent.and_then(|p| helper(p)), None],
        };
        let at = |name| property(node, name).unwrap_or(DVec3::ZERO);
        let space = node.use_rotation_space;
        let order = if space { node.rotation_order } else { RotationOrder::Xyz };
        let (pre, post_rotation) = match space {
            true => (euler(at("PreRotation")), euler(at("PostRotation")).conjugate()),
            false => (DQuat::IDENTITY, DQuat::IDENTITY),
        };
        let mut local = LocalTransform {
            translation: at(TRANSLATION),
            rotation: at(ROTATION),
            scaling: property(node, SCALING).unwrap_or(DVec3::ONE),
            rotation_axis_order: axes(order),
            left_rotation: pre,
            right_rotation: post_rotation,
            post_rotation,
            axes_turn: DQuat::IDENTITY,
            lever_arm: at("ScalingOffset") + at("ScalingPivot") - at("RotationPivot"),
            scaled_lever_arm: -at("ScalingPivot"),
            offset: at("RotationPivot") + at("RotationOffset"),
            metres: 1.0,
            scale_factor: 1.0,
            mirror_axis: match node.adjust_mirror_axis {
                MirrorAxis::None => None,
                MirrorAxis::X => Some(0),
                MirrorAxis::Y => Some(1),
                MirrorAxis::Z => Some(2),
            },
            is_scale_helper: node.is_scale_helper,
            factors: factors.map(|f| f.unwrap_or(DVec3::ONE)),
        };
        if node.has_adjust_transform {
            local.axes_turn = quaternion(&node.adjust_pre_rotation);
            local.right_rotation = post_rotation * quaternion(&node.adjust_post_rotation);
            local.offset += vector(&node.adjust_pre_translation);
            local.metres = node.adjust_pre_scale * node.adjust_translation_scale;
            local.scale_factor = node.adjust_pre_scale * node.adjust_post_scale;
        }
        Some(local)
    }

    /// Metres in a unit of the file.
    pub(crate) fn metres(&self) -> f64 {
        self.metres.abs()
    }

    /// Whether rotation or scale moves the node's origin, and whether scale does.
    pub(crate) fn swings(&self) -> (bool, bool) {
        let scaled = self.scaled_lever_arm != DVec3::ZERO;
        (scaled || self.lever_arm != DVec3::ZERO, scaled)
    }

    pub(crate) fn euler_rotation(&self, degrees: DVec3) -> EulerRotation {
        euler_rotation(self.rotation_axis_order, degrees)
    }

    /// The node's rotation for an Euler rotation, with the fixed rotations around it.
    pub(crate) fn rotation_of(&self, euler_rotation: &EulerRotation) -> DQuat {
        self.mirror_rotation(self.with_fixed_rotations(euler_rotation.product))
    }

    /// Derivative of the node's rotation where the angles change by `rates`, in degrees for each unit of time.
    pub(crate) fn rotation_rate(&self, euler_rotation: &EulerRotation, rates: DVec3) -> DQuat {
        self.mirror_rotation(self.with_fixed_rotations(self.euler_rate(euler_rotation, rates)))
    }

    /// Skips identities: most nodes have no axis conversion and no pre- or post-rotation.
    fn with_fixed_rotations(&self, q: DQuat) -> DQuat {
        let q = if self.right_rotation == DQuat::IDENTITY { q } else { q * self.right_rotation };
        let q = if self.left_rotation == DQuat::IDENTITY { q } else { self.left_rotation * q };
        if self.axes_turn == DQuat::IDENTITY { q } else { self.axes_turn * q }
    }

    fn mirror_rotation(&self, q: DQuat) -> DQuat {
        match self.mirror_axis {
            None => q,
            Some(kept) => {
                let mut v = (-q.xyz()).to_array();
                v[kept] = -v[kept];
                DQuat::from_xyzw(v[0], v[1], v[2], q.w)
            }
        }
    }

    fn euler_rate(&self, euler_rotation: &EulerRotation, rates: DVec3) -> DQuat {
        let Some([a, b, c]) = self.rotation_axis_order else { return DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0) };
        let half = |axis: usize| rates[axis] * HALF_RAD;
        let inner = euler_rotation.parts[2] * axis_times(b, euler_rotation.first_two);
        times_axis(euler_rotation.product, a) * half(a)
            + inner * half(b)
            + axis_times(c, euler_rotation.product) * half(c)
    }

    /// The node's translation in metres, pivots included.
    pub(crate) fn translation_at(
        &self,
        translation: DVec3,
        euler_rotation: &EulerRotation,
        scaling: DVec3,
    ) -> DVec3 {
        let swing = self.lever_arm_at(scaling);
        let turned = if swing == DVec3::ZERO {
            swing
        } else {
            self.left_rotation * euler_rotation.product * self.post_rotation * swing
        };
        self.to_metres(turned + self.offset + translation)
    }

    fn lever_arm_at(&self, scaling: DVec3) -> DVec3 {
        self.lever_arm + scaling * self.scaled_lever_arm
    }

    /// Derivative of the translation where translation, rotation and scale change.
    pub(crate) fn translation_rate(
        &self,
        at: (&EulerRotation, DVec3),
        rates: (DVec3, DVec3, DVec3),
    ) -> DVec3 {
        let ((euler_rotation, scaling), (translation, rotation, scale)) = (at, rates);
        let (swing, swing_rate) = (self.lever_arm_at(scaling), scale * self.scaled_lever_arm);
        if swing == DVec3::ZERO && swing_rate == DVec3::ZERO {
            return self.to_metres(translation);
        }
        let q = self.left_rotation * euler_rotation.product * self.post_rotation;
        let dq = self.left_rotation * self.euler_rate(euler_rotation, rotation) * self.post_rotation;
        let (v, w) = (q.xyz(), q.w);
        let (dv, dw) = (dq.xyz(), dq.w);
        // Derivative of r = s + 2 (w v×s + v×(v×s)).
        let across = v.cross(swing);
        let turned = dw * across + w * dv.cross(swing) + dv.cross(across) + v.cross(dv.cross(swing));
        self.to_metres(turned * 2.0 + q * swing_rate + translation)
    }

    fn to_metres(&self, v: DVec3) -> DVec3 {
        let turned = if self.axes_turn == DQuat::IDENTITY { v } else { self.axes_turn * v };
        let mut out = turned * self.metres;
        if let Some(axis) = self.mirror_axis {
            out[axis] = -out[axis];
        }
        out
    }

    /// The greatest distance, in metres, by which a rotation swings the node's origin about its pivot.
    pub(crate) fn lever_arm_metres(&self, scaling: DVec3) -> f64 {
        self.lever_arm_at(scaling).length() * self.metres()
    }

    pub(crate) fn scaled_lever_arm_metres(&self) -> f64 {
        self.scaled_lever_arm.length() * self.metres()
    }

    pub(crate) fn scale_at(&self, scaling: DVec3) -> DVec3 {
        scaling * self.scale_factor
    }

    /// Parent-from-node matrix at rest.
    pub(crate) fn matrix_at_rest(&self) -> DAffine3 {
        let euler_rotation = self.euler_rotation(self.rotation);
        let translation =
            self.translation_at(self.translation * self.factors[0], &euler_rotation, self.scaling);
        let scale = self.scale_at(self.scaling) * self.factors[1];
        DAffine3::from_scale_rotation_translation(scale, self.rotation_of(&euler_rotation), translation)
    }

    /// The transform at rest.
    pub(crate) fn at_rest(&self) -> Transform {
        let euler_rotation = self.euler_rotation(self.rotation);
        let rotation = self.rotation_of(&euler_rotation);
        let length = rotation.length();
        let sound = length.is_finite() && length > 1e-9;
        Transform {
            translation: self
                .translation_at(self.translation * self.factors[0], &euler_rotation, self.scaling)
                .as_vec3(),
            rotation: if sound { (rotation * (1.0 / length)).as_quat() } else { glam::Quat::IDENTITY },
            scale: (self.scale_at(self.scaling) * self.factors[1]).as_vec3(),
        }
    }
}

/// Radians of half a degree, because quaternions hold half angles.
pub(crate) const HALF_RAD: f64 = std::f64::consts::PI / 360.0;
const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

/// The axes of a rotation order; `None` for the spherical order, which ufbx does not rotate either.
fn axes(order: RotationOrder) -> Option<[usize; 3]> {
    match order {
        RotationOrder::Xyz => Some([0, 1, 2]),
        RotationOrder::Xzy => Some([0, 2, 1]),
        RotationOrder::Yzx => Some([1, 2, 0]),
        RotationOrder::Yxz => Some([1, 0, 2]),
        RotationOrder::Zxy => Some([2, 0, 1]),
        RotationOrder::Zyx => Some([2, 1, 0]),
        RotationOrder::Spheric => None,
    }
}

/// The product of a quaternion with i, j or k: a permutation of its components with signs.
fn times_axis(q: DQuat, axis: usize) -> DQuat {
    match axis {
        0 => DQuat::from_xyzw(q.w, q.z, -q.y, -q.x),
        1 => DQuat::from_xyzw(-q.z, q.w, q.x, -q.y),
        _ => DQuat::from_xyzw(q.y, -q.x, q.w, -q.z),
    }
}

fn axis_times(axis: usize, q: DQuat) -> DQuat {
    match axis {
        0 => DQuat::from_xyzw(q.w, -q.z, q.y, -q.x),
        1 => DQuat::from_xyzw(q.z, q.w, -q.x, -q.y),
        _ => DQuat::from_xyzw(-q.y, q.x, q.w, -q.z),
    }
}

/// Euler rotation about X, then Y, then Z.
pub(crate) fn euler(degrees: DVec3) -> DQuat {
    euler_rotation(Some([0, 1, 2]), degrees).product
}

fn euler_rotation(axes: Option<[usize; 3]>, degrees: DVec3) -> EulerRotation {
    let Some(axes) = axes else {
        return EulerRotation {
            parts: [DQuat::IDENTITY; 3],
            first_two: DQuat::IDENTITY,
            product: DQuat::IDENTITY,
        };
    };
    let parts = axes.map(|axis| {
        if degrees[axis] == 0.0 {
            return DQuat::IDENTITY;
        }
        let (sin, cos) = libm::sincos(degrees[axis] * HALF_RAD);
        let v = AXES[axis] * sin;
        DQuat::from_xyzw(v.x, v.y, v.z, cos)
    });
    let first_two = parts[1] * parts[0];
    EulerRotation { parts, first_two, product: parts[2] * first_two }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternion_products_with_axes_equal_full_products() {
        let q = DQuat::from_xyzw(0.1, -0.2, 0.3, 0.9);
        for (axis, v) in AXES.iter().enumerate() {
            let unit = DQuat::from_xyzw(v.x, v.y, v.z, 0.0);
            assert_eq!(times_axis(q, axis), q * unit);
            assert_eq!(axis_times(axis, q), unit * q);
        }
    }
}
