//! A node tree in parent-first order with a rest pose. The bind pose, in which meshes are attached to joints, belongs to a skin
//! (`inverse_bind` in `core/asset/src/asset.rs`) and may differ from the rest pose.

pub mod humanoid;
pub(crate) mod humanoid_joints;
pub mod joint_names;
pub(crate) mod model_rest_pose;
pub mod sides;
pub(crate) mod symmetry;

use crate::math::transform::Transform;
use crate::skeleton::humanoid::{HumanBone, Humanoid, HumanoidError};
use glam::Affine3A;
use std::sync::Arc;

/// Joints in parent-first order: `parents[i]` is `None` or smaller than `i`. Any number of roots and joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    names: Vec<String>,
    parents: Vec<Option<u32>>,
    rest: Vec<Transform>,
    /// (joint, parent) of all joints but roots, by depth.
    by_depth: Vec<[u32; 2]>,
    humanoid: Option<Arc<Humanoid>>,
}

/// The reason why joints do not form a skeleton; the message has the names.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum SkeletonError {
    Lengths { names: usize, parents: usize, rest: usize },
    NotParentFirst { joint: usize, name: String, parent: u32 },
    NotFinite { joint: usize, name: String },
    Humanoid(HumanoidError),
}

crate::error_texts! { SkeletonError:
    Self::Lengths { names, parents, rest } => "skeleton lists differ in length: {names} names, {parents} parents, {rest} rest transforms";
    Self::NotParentFirst { joint, name, parent } => "joint {joint} (\"{name}\") comes before its parent {parent}; joints must be in parent-first order";
    Self::NotFinite { joint, name } => "rest transform of joint {joint} (\"{name}\") is not finite";
    Self::Humanoid(error) => "{error}";
}

impl From<HumanoidError> for SkeletonError {
    fn from(error: HumanoidError) -> SkeletonError {
        SkeletonError::Humanoid(error)
    }
}

impl Skeleton {
    /// Makes a skeleton of lists of equal length, one entry per joint, parents first. `rest[i]` is parent-from-joint.
    pub fn new(
        names: Vec<String>,
        parents: Vec<Option<u32>>,
        rest: Vec<Transform>,
    ) -> Result<Skeleton, SkeletonError> {
        if names.len() != parents.len() || names.len() != rest.len() {
            return Err(SkeletonError::Lengths {
                names: names.len(),
                parents: parents.len(),
                rest: rest.len(),
            });
        }
        for (joint, parent) in parents.iter().enumerate() {
            if let Some(parent) = *parent
                && parent as usize >= joint
            {
                return Err(SkeletonError::NotParentFirst { joint, name: names[joint].clone(), parent });
            }
            if !rest[joint].is_finite() {
                return Err(SkeletonError::NotFinite { joint, name: names[joint].clone() });
            }
        }
        let by_depth = sort_by_depth(&parents);
        Ok(Skeleton { names, parents, rest, by_depth, humanoid: None })
    }

    /// Sets the humanoid bones that the file declares; they take precedence over names.
    pub fn with_humanoid(self, humanoid: Humanoid) -> Result<Skeleton, SkeletonError> {
        humanoid.check(self.len())?;
        Ok(Skeleton { humanoid: Some(Arc::new(humanoid)), ..self })
    }

    /// The humanoid bones, if the file declares them; `Humanoid::from_names` finds those of other files.
    pub fn humanoid(&self) -> Option<&Humanoid> {
        self.humanoid.as_deref()
    }

    /// Number of joints.
    pub fn len(&self) -> usize {
        self.names.len()
    }
    /// Whether there are no joints.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
    /// Name of each joint.
    pub fn names(&self) -> &[String] {
        &self.names
    }
    /// Parent of each joint, before it in the order; `None` for roots.
    pub fn parents(&self) -> &[Option<u32>] {
        &self.parents
    }
    /// Local transform of each joint at rest.
    pub fn rest(&self) -> &[Transform] {
        &self.rest
    }
    /// Matrix model-from-joint of each joint at rest.
    pub fn rest_model_from_joint(&self) -> Vec<Affine3A> {
        let mut all: Vec<Affine3A> = Vec::with_capacity(self.len());
        for (parent, rest) in self.parents.iter().zip(&self.rest) {
            let local = rest.to_affine();
            all.push(parent.map_or(local, |p| all[p as usize] * local));
        }
        all
    }

    /// (joint, parent) of all joints but roots, sorted by depth. Parents come before children, but neighbors are mostly
    /// unrelated: out-of-order execution need not wait for the parent as it does along a chain.
    pub(crate) fn by_depth(&self) -> &[[u32; 2]] {
        &self.by_depth
    }

    /// Short names of humanoid joints that [`Skeleton::find`] accepts: `Hips`, `LeftHand`, `RightUpLeg`.
    pub fn short_names(&self) -> Vec<String> {
        let names = HumanBone::ALL.into_iter().filter_map(HumanBone::short_name);
        names.filter(|name| self.find(name).is_some()).collect()
    }

    /// Index of the joint with this exact name; else of the only joint whose `plain_name` matches; else of the bone of this name
    /// in the skeleton's [`Humanoid`]; else of the only joint with the same name in other families of skeletons
    /// (`crate::skeleton::joint_names::humanoid_name`).
    pub fn find(&self, name: &str) -> Option<usize> {
        if let Some(i) = self.names.iter().position(|n| n == name) {
            return Some(i);
        }
        let wanted = plain_name(name);
        let mut hits = self.names.iter().enumerate().filter(|(_, n)| plain_name(n) == wanted);
        match (hits.next(), hits.next()) {
            (Some((i, _)), None) => return Some(i),
            (Some(_), Some(_)) => return None,
            (None, _) => {}
        }
        let declared = self.humanoid().zip(HumanBone::of_joint(name));
        if let Some(joint) = declared.and_then(|(humanoid, bone)| humanoid.joint(bone)) {
            return Some(joint as usize);
        }
        let wanted = crate::skeleton::joint_names::humanoid_name(name)?;
        let has_wanted_name =
            |n: &String| crate::skeleton::joint_names::humanoid_name(n).as_ref() == Some(&wanted);
        let mut hits = self.names.iter().enumerate().filter(|(_, n)| has_wanted_name(n));
        match (hits.next(), hits.next()) {
            (Some((i, _)), None) => Some(i),
            _ => None,
        }
    }

    /// Name of a joint without its rig's prefix (`Hips` of `mixamorig:Hips`) if [`Skeleton::find`] finds the joint by it, else
    /// the whole name; empty if there is no such joint.
    pub fn short_name(&self, joint: usize) -> &str {
        let whole = self.names.get(joint).map_or("", String::as_str);
        let short = without_rig_prefix(whole);
        if self.find(short) == Some(joint) { short } else { whole }
    }
}

/// (joint, parent) of all joints but roots, sorted by depth.
fn sort_by_depth(parents: &[Option<u32>]) -> Vec<[u32; 2]> {
    let mut depths: Vec<u32> = Vec::with_capacity(parents.len());
    for parent in parents {
        depths.push(parent.map_or(0, |p| depths[p as usize] + 1));
    }
    let pairs = (0u32..).zip(parents).filter_map(|(joint, parent)| parent.map(|p| [joint, p]));
    let mut pairs: Vec<[u32; 2]> = pairs.collect();
    pairs.sort_by_key(|[joint, _]| depths[*joint as usize]);
    pairs
}

/// A joint name without namespace prefixes: `mixamorig:Hips`, `mixamorig1:Hips`, `mixamorigHips` and `Armature|Hips` are `hips`.
pub(crate) fn plain_name(name: &str) -> String {
    without_rig_prefix(name).to_ascii_lowercase()
}

/// A joint's name without namespace and without Mixamo's prefix.
pub(crate) fn without_rig_prefix(name: &str) -> &str {
    const MIXAMO: &str = "mixamorig";
    let tail = name.rsplit([':', '|']).next().unwrap_or(name);
    match tail.split_at_checked(MIXAMO.len()) {
        Some((prefix, rest)) if prefix.eq_ignore_ascii_case(MIXAMO) => {
            let rest = rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == '_');
            if rest.is_empty() { tail } else { rest }
        }
        _ => tail,
    }
}
