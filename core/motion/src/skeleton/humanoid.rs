//! Bones of a humanoid as joints of a skeleton, and the T-pose in which rotations of two of them are compared.
//!
//! Bones and their names: VRM 1.0, `VRMC_vrm.humanoid` ("humanoid.md"). VRM 0.x has the same but for the thumbs: its proximal,
//! intermediate and distal are 1.0's metacarpal, proximal and distal.

use crate::math::transform::Transform;
use crate::skeleton::Skeleton;
use glam::{DAffine3, DMat3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Declares the bones: variant, name in VRM 1.0, name in [`crate::skeleton::joint_names::humanoid_name`] ("" if that has none),
/// parent.
macro_rules! bones {
    ($(($variant:ident, $spec:literal, $choreo_name:literal, $parent:ident)),* $(,)?) => {
        /// A humanoid bone of VRM 1.0.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "the variants are VRM's names")]
        pub enum HumanBone { $($variant),* }

        impl HumanBone {
            /// All bones, parents first.
            pub const ALL: [HumanBone; BONES] = [$(HumanBone::$variant),*];

            /// Name in VRM 1.0: `leftUpperArm`.
            pub fn name(self) -> &'static str {
                match self { $(HumanBone::$variant => $spec),* }
            }

            /// Parent bone in a humanoid that has all bones; the hips are their own parent.
            fn parent_or_self(self) -> HumanBone {
                match self { $(HumanBone::$variant => HumanBone::$parent),* }
            }

            pub(crate) fn choreo_name(self) -> &'static str {
                match self { $(HumanBone::$variant => $choreo_name),* }
            }
        }
    };
}

/// Number of bones that a humanoid can have.
pub const BONES: usize = 55;

bones![
    (Hips, "hips", "hips", Hips),
    (Spine, "spine", "spine", Hips),
    (Chest, "chest", "spine1", Spine),
    (UpperChest, "upperChest", "spine2", Chest),
    (Neck, "neck", "neck", UpperChest),
    (Head, "head", "head", Neck),
    (LeftEye, "leftEye", "left eye", Head),
    (RightEye, "rightEye", "right eye", Head),
    (Jaw, "jaw", "jaw", Head),
    (LeftUpperLeg, "leftUpperLeg", "left upleg", Hips),
    (LeftLowerLeg, "leftLowerLeg", "left leg", LeftUpperLeg),
    (LeftFoot, "leftFoot", "left foot", LeftLowerLeg),
    (LeftToes, "leftToes", "left toebase", LeftFoot),
    (RightUpperLeg, "rightUpperLeg", "right upleg", Hips),
    (RightLowerLeg, "rightLowerLeg", "right leg", RightUpperLeg),
    (RightFoot, "rightFoot", "right foot", RightLowerLeg),
    (RightToes, "rightToes", "right toebase", RightFoot),
    (LeftShoulder, "leftShoulder", "left shoulder", UpperChest),
    (LeftUpperArm, "leftUpperArm", "left arm", LeftShoulder),
    (LeftLowerArm, "leftLowerArm", "left forearm", LeftUpperArm),
    (LeftHand, "leftHand", "left hand", LeftLowerArm),
    (RightShoulder, "rightShoulder", "right shoulder", UpperChest),
    (RightUpperArm, "rightUpperArm", "right arm", RightShoulder),
    (RightLowerArm, "rightLowerArm", "right forearm", RightUpperArm),
    (RightHand, "rightHand", "right hand", RightLowerArm),
    (LeftThumbMetacarpal, "leftThumbMetacarpal", "left handthumb1", LeftHand),
    (LeftThumbProximal, "leftThumbProximal", "left handthumb2", LeftThumbMetacarpal),
    (LeftThumbDistal, "leftThumbDistal", "left handthumb3", LeftThumbProximal),
    (LeftIndexProximal, "leftIndexProximal", "left handindex1", LeftHand),
    (LeftIndexIntermediate, "leftIndexIntermediate", "left handindex2", LeftIndexProximal),
    (LeftIndexDistal, "leftIndexDistal", "left handindex3", LeftIndexIntermediate),
    (LeftMiddleProximal, "leftMiddleProximal", "left handmiddle1", LeftHand),
    (LeftMiddleIntermediate, "leftMiddleIntermediate", "left handmiddle2", LeftMiddleProximal),
    (LeftMiddleDistal, "leftMiddleDistal", "left handmiddle3", LeftMiddleIntermediate),
    (LeftRingProximal, "leftRingProximal", "left handring1", LeftHand),
    (LeftRingIntermediate, "leftRingIntermediate", "left handring2", LeftRingProximal),
    (LeftRingDistal, "leftRingDistal", "left handring3", LeftRingIntermediate),
    (LeftLittleProximal, "leftLittleProximal", "left handpinky1", LeftHand),
    (LeftLittleIntermediate, "leftLittleIntermediate", "left handpinky2", LeftLittleProximal),
    (LeftLittleDistal, "leftLittleDistal", "left handpinky3", LeftLittleIntermediate),
    (RightThumbMetacarpal, "rightThumbMetacarpal", "right handthumb1", RightHand),
    (RightThumbProximal, "rightThumbProximal", "right handthumb2", RightThumbMetacarpal),
    (RightThumbDistal, "rightThumbDistal", "right handthumb3", RightThumbProximal),
    (RightIndexProximal, "rightIndexProximal", "right handindex1", RightHand),
    (RightIndexIntermediate, "rightIndexIntermediate", "right handindex2", RightIndexProximal),
    (RightIndexDistal, "rightIndexDistal", "right handindex3", RightIndexIntermediate),
    (RightMiddleProximal, "rightMiddleProximal", "right handmiddle1", RightHand),
    (RightMiddleIntermediate, "rightMiddleIntermediate", "right handmiddle2", RightMiddleProximal),
    (RightMiddleDistal, "rightMiddleDistal", "right handmiddle3", RightMiddleIntermediate),
    (RightRingProximal, "rightRingProximal", "right handring1", RightHand),
    (RightRingIntermediate, "rightRingIntermediate", "right handring2", RightRingProximal),
    (RightRingDistal, "rightRingDistal", "right handring3", RightRingIntermediate),
    (RightLittleProximal, "rightLittleProximal", "right handpinky1", RightHand),
    (RightLittleIntermediate, "rightLittleIntermediate", "right handpinky2", RightLittleProximal),
    (RightLittleDistal, "rightLittleDistal", "right handpinky3", RightLittleIntermediate),
];

impl HumanBone {
    /// Finds a bone by its exact name in VRM 1.0.
    pub fn from_name(name: &str) -> Option<HumanBone> {
        HumanBone::ALL.into_iter().find(|b| b.name() == name)
    }

    /// Finds a bone by the name of a joint in any family of skeletons, VRM 1.0's among them: `mixamorig:LeftArm`, `upperarm.l`.
    pub(crate) fn of_joint(name: &str) -> Option<HumanBone> {
        HumanBone::from_name(name).or_else(|| {
            let ours = crate::skeleton::joint_names::humanoid_name(name)?;
            HumanBone::ALL.into_iter().find(|b| b.choreo_name() == ours)
        })
    }

    /// Short name as in Mixamo, without the prefix: `LeftUpLeg`.
    pub(crate) fn short_name(self) -> Option<String> {
        let capital = |word: &str| {
            let (first, rest) = word.split_at_checked(1)?;
            Some(format!("{}{rest}", first.to_ascii_uppercase()))
        };
        // Compound words are split.
        let parts = |word: &str| {
            let split = ["up", "fore", "toe", "hand"].into_iter().find_map(|first| {
                let rest = word.strip_prefix(first).filter(|rest| !rest.is_empty())?;
                Some(format!("{}{}", capital(first)?, capital(rest)?))
            });
            split.or_else(|| capital(word))
        };
        self.choreo_name()
            .split_whitespace()
            .map(parts)
            .collect::<Option<String>>()
            .filter(|name| !name.is_empty())
    }

    /// Parent bone in a humanoid that has all bones; [`Humanoid::parent`] skips missing bones.
    pub fn parent(self) -> Option<HumanBone> {
        Some(self.parent_or_self()).filter(|above| *above != self)
    }
}

/// The bones of one skeleton, and its T-pose: upright, facing +Z, arms straight out to ±X, palms down (VRM 1.0, "tpose.md").
#[derive(Clone, Debug, PartialEq)]
pub struct Humanoid {
    joints: [Option<u32>; BONES],
    /// parent-from-joint of every joint of the skeleton; `None` if its rest pose is the T-pose, as in every VRM.
    t_pose: Option<Arc<[Transform]>>,
}

/// The reason why joints do not form a humanoid; the message has the names.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum HumanoidError {
    Twice { joint: u32, first: &'static str, second: &'static str },
    Again { bone: &'static str, first: u32, second: u32 },
    OutOfRange { bone: &'static str, joint: u32, joints: usize },
    TPose { given: usize, joints: usize },
}

crate::error_texts! { HumanoidError:
    Self::Twice { joint, first, second } => "joint {joint} is both {first} and {second}";
    Self::Again { bone, first, second } => "{bone} is given twice, as joint {first} and as joint {second}";
    Self::OutOfRange { bone, joint, joints } => "{bone} is joint {joint}, which does not exist; number of the skeleton's joints: {joints}";
    Self::TPose { given, joints } => "the number of transforms of the T-pose is {given}, must be {joints}, one per joint of the skeleton";
}

impl Humanoid {
    /// Makes a humanoid of bones and their joints, each at most once. Its T-pose is the skeleton's rest pose.
    pub fn new(bones: impl IntoIterator<Item = (HumanBone, u32)>) -> Result<Humanoid, HumanoidError> {
        let mut joints = [None; BONES];
        let mut bone_of = BTreeMap::new();
        for (bone, joint) in bones {
            if let Some(first) = joints[bone as usize].replace(joint) {
                return Err(HumanoidError::Again { bone: bone.name(), first, second: joint });
            }
            if let Some(first) = bone_of.insert(joint, bone) {
                return Err(HumanoidError::Twice { joint, first: first.name(), second: bone.name() });
            }
        }
        Ok(Humanoid { joints, t_pose: None })
    }

    /// Sets the T-pose of a skeleton that does not rest in one: parent-from-joint of every joint.
    pub fn with_t_pose(self, t_pose: impl Into<Arc<[Transform]>>) -> Humanoid {
        Humanoid { t_pose: Some(t_pose.into()), ..self }
    }

    /// The bones that joint names indicate ([`HumanBone::of_joint`]). A bone that several joints are named for is left out. The
    /// rest pose counts as T-pose.
    pub(crate) fn from_names(skeleton: &Skeleton) -> Humanoid {
        let mut found: BTreeMap<HumanBone, Option<u32>> = BTreeMap::new();
        for (joint, name) in (0u32..).zip(skeleton.names()) {
            if let Some(bone) = HumanBone::of_joint(name) {
                found.entry(bone).and_modify(|j| *j = None).or_insert(Some(joint));
            }
        }
        let mut joints = [None; BONES];
        for (bone, joint) in found {
            joints[bone as usize] = joint;
        }
        Humanoid { joints, t_pose: None }
    }

    pub(crate) fn check(&self, joints: usize) -> Result<(), HumanoidError> {
        for (bone, joint) in self.bones() {
            if joint as usize >= joints {
                return Err(HumanoidError::OutOfRange { bone: bone.name(), joint, joints });
            }
        }
        match &self.t_pose {
            Some(pose) if pose.len() != joints => Err(HumanoidError::TPose { given: pose.len(), joints }),
            _ => Ok(()),
        }
    }

    /// The joint of a bone, if any.
    pub fn joint(&self, bone: HumanBone) -> Option<u32> {
        self.joints[bone as usize]
    }

    /// The bone of a joint, if any.
    pub fn bone(&self, joint: u32) -> Option<HumanBone> {
        HumanBone::ALL.into_iter().find(|b| self.joints[*b as usize] == Some(joint))
    }

    /// The nearest ancestor of a bone that this humanoid has.
    pub fn parent(&self, bone: HumanBone) -> Option<HumanBone> {
        std::iter::successors(bone.parent(), |b| b.parent()).find(|b| self.joint(*b).is_some())
    }

    /// Existing bones and their joints, parents first.
    pub fn bones(&self) -> impl Iterator<Item = (HumanBone, u32)> + '_ {
        HumanBone::ALL.into_iter().filter_map(|b| Some((b, self.joint(b)?)))
    }

    /// The T-pose if it differs from the rest pose: parent-from-joint of every joint.
    pub fn t_pose(&self) -> Option<&[Transform]> {
        self.t_pose.as_deref()
    }

    /// model-from-joint of every joint in the T-pose, in f64. `skeleton`: the skeleton of this humanoid.
    pub(crate) fn model_from_t_pose(&self, skeleton: &Skeleton) -> Vec<DAffine3> {
        let local = self.t_pose().filter(|p| p.len() == skeleton.len()).unwrap_or(skeleton.rest());
        let mut model: Vec<DAffine3> = Vec::with_capacity(local.len());
        for (transform, parent) in local.iter().zip(skeleton.parents()) {
            let parent_from_joint = DAffine3 {
                matrix3: DMat3::from_quat(transform.rotation.as_dquat().normalize())
                    * DMat3::from_diagonal(transform.scale.as_dvec3()),
                translation: transform.translation.as_dvec3(),
            };
            model.push(parent.map_or(parent_from_joint, |p| model[p as usize] * parent_from_joint));
        }
        model
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_are_found_by_names_of_vrm_and_other_families() {
        for (index, bone) in HumanBone::ALL.into_iter().enumerate() {
            assert_eq!(bone as usize, index);
            assert_eq!(HumanBone::from_name(bone.name()), Some(bone));
            assert_eq!(HumanBone::of_joint(bone.name()), Some(bone));
            // Parents come first, and every bone hangs on the hips.
            assert!(bone.parent().is_none_or(|p| p < bone), "{bone:?}");
            assert_eq!(std::iter::successors(Some(bone), |b| b.parent()).last(), Some(HumanBone::Hips));
        }
        let rows = [
            ("mixamorig:LeftHandThumb1", HumanBone::LeftThumbMetacarpal),
            ("mixamorig:RightHandPinky3", HumanBone::RightLittleDistal),
            ("Bip01 L UpperArm", HumanBone::LeftUpperArm),
            ("upperleg.r", HumanBone::RightUpperLeg),
            ("J_Bip_C_UpperChest", HumanBone::UpperChest),
        ];
        for (name, bone) in rows {
            assert_eq!(HumanBone::of_joint(name), Some(bone), "{name}");
        }
        assert_eq!(HumanBone::of_joint("Tail"), None);
    }

    #[test]
    fn a_bone_or_joint_that_is_given_twice_is_an_error() {
        let two = [(HumanBone::Hips, 0), (HumanBone::Spine, 0)];
        assert_eq!(Humanoid::new(two).unwrap_err().to_string(), "joint 0 is both hips and spine");
        let again = [(HumanBone::Head, 1), (HumanBone::Head, 2)];
        assert_eq!(
            Humanoid::new(again).unwrap_err().to_string(),
            "head is given twice, as joint 1 and as joint 2"
        );
        let body = Humanoid::new([(HumanBone::Hips, 4), (HumanBone::Head, 2)]).unwrap();
        assert_eq!(body.parent(HumanBone::Head), Some(HumanBone::Hips));
        assert_eq!((body.bone(2), body.bone(0)), (Some(HumanBone::Head), None));
        assert!(body.check(4).is_err() && body.check(5).is_ok());
    }
}
