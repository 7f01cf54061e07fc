//! The left and right joints of a skeleton, and how a joint takes over the mirrored motion of its partner.

use crate::math::rotation::normalize_or_identity;
use crate::math::transform::Transform;
use crate::skeleton::Skeleton;
use crate::skeleton::model_rest_pose::ModelRestPose;
use crate::skeleton::sides::{Side, side_of};
use glam::{DQuat, DVec3, Quat, Vec3};
use std::collections::BTreeMap;

/// Why a skeleton cannot be mirrored.
#[derive(Clone, Debug, PartialEq)]
pub enum MirrorError {
    /// No two joints are named as left and right.
    NoPairs,
}

crate::error_texts! { MirrorError:
    Self::NoPairs => "no joint of the left has a partner on the right by its name (LeftArm and RightArm, arm.l and arm.r, …)";
}

/// Mirroring of a skeleton: the partner of each joint, and the rotations between their axes.
#[derive(Clone, Debug, PartialEq)]
pub struct MirrorMap {
    /// Mirroring of each joint; `None` if it has no partner and stays at rest.
    pub(crate) joints: Vec<Option<MirroredJoint>>,
    rest: Vec<Transform>,
    /// Normal of the character's middle plane: 0 = x, 1 = y, 2 = z.
    axis: usize,
    unpaired: Vec<u32>,
    asymmetry: (f64, u32),
}

/// How a joint takes its transform from its partner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MirroredJoint {
    /// Index of the partner; central joints are their own partners.
    pub(crate) partner: u32,
    /// Rotations C_parent⁻¹ and C, see module `mirror`.
    before: DQuat,
    after: DQuat,
    /// Axis of the partner that, reflected, lies along each axis of the joint.
    axes: [usize; 3],
    /// Unit of the partner's parent space divided by that of the joint's parent space.
    unit: f64,
}

impl MirrorMap {
    /// Pairs joints by their names ([`side_of`]), and if names are not enough, by sides and position in the hierarchy. The
    /// parents of two partners are always partners, too.
    pub fn new(skeleton: &Skeleton) -> Result<MirrorMap, MirrorError> {
        let partners = find_partners(skeleton);
        let pairs = || partners.iter().enumerate().filter_map(|(j, p)| Some((j, (*p)? as usize)));
        if !pairs().any(|(joint, partner)| joint != partner) {
            return Err(MirrorError::NoPairs);
        }
        let rest = ModelRestPose::of(skeleton);
        // The axis along which partners are farthest apart; x if several are equal.
        let mut distances = DVec3::ZERO;
        for (joint, partner) in pairs() {
            distances += (rest.positions[joint] - rest.positions[partner]).abs();
        }
        let axis = if distances.z > distances.x && distances.z > distances.y {
            2
        } else if distances.y > distances.x {
            1
        } else {
            0
        };
        let reflected = |joint: usize| reflect_rotation(rest.rotations[joint], axis);
        let c = |joint: usize, partner: usize| {
            normalize_or_identity(reflected(partner).conjugate() * rest.rotations[joint])
        };
        let joint = |(joint, partner): (usize, Option<u32>)| {
            let partner = partner?;
            let (before, units) = match skeleton.parents()[joint] {
                Some(parent) => {
                    let across = partners[parent as usize]?;
                    let (parent, across) = (parent as usize, across as usize);
                    (c(parent, across).conjugate(), rest.scales[across] / rest.scales[parent])
                }
                None => (DQuat::IDENTITY, 1.0),
            };
            let after = c(joint, partner as usize);
            let unit = if units.is_finite() && units > 0.0 { units } else { 1.0 };
            Some(MirroredJoint { partner, before, after, axes: nearest_axes(after), unit })
        };
        let joints = partners.iter().copied().enumerate().map(joint).collect();
        let unpaired = (0u32..).zip(&partners).filter(|(_, p)| p.is_none()).map(|(j, _)| j).collect();
        let asymmetry = largest_asymmetry(&rest, &pairs().collect::<Vec<_>>(), axis);
        Ok(MirrorMap { joints, rest: skeleton.rest().to_vec(), axis, unpaired, asymmetry })
    }

    /// Number of joints of the skeleton.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// (left, right) of all pairs, in the order of the left joints; sides by names.
    pub fn pairs(&self, skeleton: &Skeleton) -> Vec<(u32, u32)> {
        let is_left = |joint: u32| {
            let name = skeleton.names().get(joint as usize);
            name.and_then(|n| side_of(n)).is_some_and(|(side, _)| side == Side::Left)
        };
        let all = (0u32..).zip(&self.joints).filter_map(|(j, m)| Some((j, m.as_ref()?.partner)));
        all.filter(|(joint, partner)| {
            joint != partner && (is_left(*joint) || !is_left(*partner) && joint < partner)
        })
        .collect()
    }

    /// Partner of a joint: a central joint itself; `None` if it has no partner and stays at rest.
    pub fn partner(&self, joint: u32) -> Option<u32> {
        self.joints.get(joint as usize)?.as_ref().map(|j| j.partner)
    }

    /// Joints with a side, or below one, but without a partner: they stay at rest.
    pub fn unpaired(&self) -> &[u32] {
        &self.unpaired
    }

    /// Normal of the middle plane: 0 = x, 1 = y, 2 = z of the model.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Largest distance at rest between a joint and its partner's reflection, metres, and that joint. An asymmetric rest pose is
    /// kept all the same.
    pub fn asymmetry(&self) -> (f64, u32) {
        self.asymmetry
    }

    pub(crate) fn transform(&self, joint: usize, partner: &Transform) -> Transform {
        let Some(map) = &self.joints[joint] else { return self.rest[joint] };
        let r = partner.rotation;
        Transform {
            translation: Vec3::from_array(self.translation(joint, map, partner.translation.to_array())),
            rotation: Quat::from_array(self.rotation(map, r.to_array())),
            scale: Vec3::from_array(self.scale(joint, map, partner.scale.to_array())),
        }
    }

    pub(crate) fn rotation(&self, map: &MirroredJoint, q: [f32; 4]) -> [f32; 4] {
        let q = reflect_rotation(DQuat::from_array(q.map(f64::from)), self.axis);
        (map.before * q * map.after).to_array().map(|v| v as f32)
    }

    pub(crate) fn offset(&self, map: &MirroredJoint, offset: DVec3) -> DVec3 {
        map.before * (reflect(offset, self.axis) * map.unit)
    }

    pub(crate) fn translation(&self, joint: usize, map: &MirroredJoint, t: [f32; 3]) -> [f32; 3] {
        let from_rest =
            DVec3::from_array(t.map(f64::from)) - self.rest[map.partner as usize].translation.as_dvec3();
        let at = self.rest[joint].translation.as_dvec3() + self.offset(map, from_rest);
        at.to_array().map(|v| v as f32)
    }

    /// Mirrors scales relative to those of the rest pose, unless these are zero.
    pub(crate) fn scale(&self, joint: usize, map: &MirroredJoint, s: [f32; 3]) -> [f32; 3] {
        let (own, partner) =
            (self.rest[joint].scale.to_array(), self.rest[map.partner as usize].scale.to_array());
        [0, 1, 2].map(|i| {
            let from = map.axes[i];
            let ratio = f64::from(own[i]) / f64::from(partner[from]);
            let ratio = if ratio.is_finite() { ratio } else { 1.0 };
            (f64::from(s[from]) * ratio) as f32
        })
    }
}

fn reflect(v: DVec3, axis: usize) -> DVec3 {
    let mut v = v.to_array();
    v[axis] = -v[axis];
    DVec3::from_array(v)
}

/// Reflected rotation M R M: the axis is reflected, and the angle reversed.
fn reflect_rotation(q: DQuat, axis: usize) -> DQuat {
    let q = q.to_array();
    let sign = |i: usize| if i == axis { 1.0 } else { -1.0 };
    DQuat::from_xyzw(q[0] * sign(0), q[1] * sign(1), q[2] * sign(2), q[3])
}

/// Axis that each rotated axis is nearest to; the identity if that is no permutation.
pub(crate) fn nearest_axes(rotation: DQuat) -> [usize; 3] {
    let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (rotation * axis).abs().to_array());
    let largest =
        |column: [f64; 3]| (0..3).fold(0, |best, i| if column[i] > column[best] + 1e-9 { i } else { best });
    let axes = columns.map(largest);
    let mut sorted = axes;
    sorted.sort_unstable();
    if sorted == [0, 1, 2] { axes } else { [0, 1, 2] }
}

/// Partner of each joint; central joints are their own. Parents come first, so that the parents of a pair are paired already.
pub(crate) fn find_partners(skeleton: &Skeleton) -> Vec<Option<u32>> {
    let count = skeleton.len();
    let sides: Vec<Option<(Side, String)>> = skeleton.names().iter().map(|n| side_of(n)).collect();
    let mut children: Vec<Vec<u32>> = vec![Vec::new(); count];
    let mut roots = Vec::new();
    for (joint, parent) in (0u32..).zip(skeleton.parents()) {
        match parent {
            Some(p) => children[*p as usize].push(joint),
            None => roots.push(joint),
        }
    }
    let mut partners: Vec<Option<u32>> = vec![None; count];
    pair_children(&roots, &roots, &sides, &mut partners);
    for joint in 0..count {
        if let Some(partner) = partners[joint]
            && partner as usize >= joint
        {
            pair_children(&children[joint], &children[partner as usize], &sides, &mut partners);
        }
    }
    partners
}

/// Pairs the children of two partners, or of one central joint (then `a` and `b` are the same).
fn pair_children(a: &[u32], b: &[u32], sides: &[Option<(Side, String)>], partners: &mut [Option<u32>]) {
    let middle = a == b;
    // `None` = several of the same name and side.
    let index = |list: &[u32]| {
        let mut by_name: BTreeMap<(Side, String), Option<u32>> = BTreeMap::new();
        for &joint in list {
            if let Some(sided) = &sides[joint as usize] {
                by_name.entry(sided.clone()).and_modify(|j| *j = None).or_insert(Some(joint));
            }
        }
        by_name
    };
    let (own, across) = (index(a), index(b));
    let mut left_over: [Vec<u32>; 2] = [Vec::new(), Vec::new()];
    for &joint in a {
        let Some((side, name)) = &sides[joint as usize] else { continue };
        let unique = own.get(&(*side, name.clone())) == Some(&Some(joint));
        match across.get(&(side.other(), name.clone())) {
            Some(Some(partner)) if unique => {
                partners[joint as usize] = Some(*partner);
                partners[*partner as usize] = Some(joint);
            }
            _ => left_over[0].push(joint),
        }
    }
    left_over[1]
        .extend(b.iter().filter(|j| sides[**j as usize].is_some() && partners[**j as usize].is_none()));
    // Names that differ in more than the side: the only two that are left, one of each side.
    for side in [Side::Left, Side::Right] {
        let only = |list: &[u32], side: Side| {
            let mut found = list.iter().filter(|j| sides[**j as usize].as_ref().is_some_and(|s| s.0 == side));
            match (found.next(), found.next()) {
                (Some(joint), None) => Some(*joint),
                _ => None,
            }
        };
        if let (Some(joint), Some(partner)) = (only(&left_over[0], side), only(&left_over[1], side.other()))
            && partners[joint as usize].is_none()
            && partners[partner as usize].is_none()
        {
            partners[joint as usize] = Some(partner);
            partners[partner as usize] = Some(joint);
        }
    }
    // Joints without a side: below a central joint each is its own partner; below a pair they are paired in order, if both sides
    // have as many.
    let plain = |list: &[u32]| -> Vec<u32> {
        list.iter().copied().filter(|j| sides[*j as usize].is_none()).collect()
    };
    let (a, b) = (plain(a), plain(b));
    if middle || a.len() == b.len() {
        for (joint, partner) in a.into_iter().zip(b) {
            partners[joint as usize] = Some(partner);
            partners[partner as usize] = Some(joint);
        }
    }
}

/// The largest distance between a joint and its partner's reflection, metres, and that joint.
fn largest_asymmetry(rest: &ModelRestPose, pairs: &[(usize, usize)], axis: usize) -> (f64, u32) {
    let coordinate = |p: DVec3| p.to_array()[axis];
    let sum: f64 = pairs.iter().map(|(j, _)| coordinate(rest.positions[*j])).sum();
    let middle = sum / pairs.len().max(1) as f64;
    let mut worst = (0.0, 0);
    for &(joint, partner) in pairs {
        let mut across = rest.positions[partner].to_array();
        across[axis] = 2.0 * middle - across[axis];
        let distance = (DVec3::from_array(across) - rest.positions[joint]).length();
        if distance > worst.0 {
            worst = (distance, joint as u32);
        }
    }
    worst
}
