//! Time, skeletons, clips and poses: sample, blend, local-to-model, skin. No I/O, no GPU, no script.
//!
//! Conventions: metres, seconds, radians, +Y up, right-handed, column vectors; `a_from_b` maps
//! coordinates of space `b` to space `a`. "Joint" means any node of an asset's node tree, skinned
//! or not: one tree carries skins, meshes, cameras and lights, so one clip can move them all.
//!
//! Each step is a job: a struct of borrowed inputs and outputs, whose `check()` names the field that is wrong and whose
//! `run()` allocates nothing. Nothing is remembered between frames, so any time costs what the next frame costs, and
//! every machine gives the same bits (see [`simd`]).
//!
//! ```
//! use choreo_motion::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // An upper arm and, 30 cm along it, a forearm that bends by 90° within a second.
//! let arm = Transform { translation: glam::Vec3::X * 0.3, ..Transform::IDENTITY };
//! let names = vec!["Arm".to_string(), "ForeArm".to_string()];
//! let skeleton = Skeleton::new(names, vec![None, Some(0)], vec![Transform::IDENTITY, arm])?;
//! let bend = Curve {
//!     joint: 1,
//!     path: Path::Rotation,
//!     interpolation: Interpolation::Linear,
//!     times: [Time::ZERO, Time::from_secs(1.0)].into(),
//!     values: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.70710677, 0.70710677].into(),
//! };
//! let clip = Clip::new("bend".into(), skeleton.len(), vec![bend])?;
//!
//! // There and back for ever, at double speed; after 0.75 s on stage the clip is on its way back, at 0.5 s.
//! let play = Playback { speed: 2.0, repeat: Repeat::PingPong, ..Playback::whole(clip.duration) };
//! let time = play.clip_time(Time::from_secs(0.75));
//! assert_eq!(time, Time::from_secs(0.5));
//!
//! let mut pose = Pose::rest(&skeleton);
//! Sample { clip: &clip, time, pose: &mut pose }.run();
//! let mut matrices = [glam::Affine3A::IDENTITY; 2];
//! LocalToModel { skeleton: &skeleton, pose: &pose, model_from_joint: &mut matrices }.run();
//! let wrist = matrices[1].transform_point3(glam::Vec3::X * 0.3);
//! assert!(wrist.abs_diff_eq(glam::Vec3::new(0.512132, 0.212132, 0.0), 1e-6));
//! # Ok(()) }
//! ```
//!
//! Two clips at once: [`Crossfade`]; many, in any order: [`Mix`] and, on top, [`Deltas`]. Names of another skeleton: [`bind_clip`]. `cargo bench -p choreo-motion` says how
//! fast and how exact all this is.

pub mod additive;
pub mod bake;
pub mod bind;
pub mod blend;
pub mod clip;
pub mod compress;
pub mod contacts;
pub mod crossfade;
pub mod dual_quaternion;
pub mod ease;
pub mod edit;
mod exact;
pub mod human;
pub mod humanoid;
pub mod ik;
pub mod inertial;
pub mod joint_map;
pub mod joint_names;
pub mod local_to_model;
pub mod mirror;
pub mod mix;
pub mod phase;
pub mod planar;
pub mod playback;
pub mod pose;
pub mod property;
pub mod reduce;
mod rest;
pub mod retarget;
pub mod root_motion;
pub mod sample;
pub mod sides;
#[allow(unsafe_code, reason = "registers of AVX2 and AVX-512, and gathers without a look at each index")]
pub mod simd;
pub mod skeleton;
pub mod skin;
pub mod skin_dual;
mod slerp;
pub mod spring;
mod t_pose;
pub mod time;
mod timeline;
mod tracks;
pub mod transform;

pub use additive::Deltas;
pub use bake::{BakeError, BakeTooLarge};
pub use bind::bind_clip;
pub use blend::{Blend, BlendOnto};
pub use clip::{Clip, ClipError, Curve, ExpressionCurve, Interpolation, Path};
pub use compress::{CompressError, Compressed};
pub use contacts::Contacts;
pub use crossfade::Crossfade;
pub use dual_quaternion::{Carrier, Skinning};
pub use ease::{Ease, Shape};
pub use edit::{EditError, Offset};
pub use human::Human;
pub use humanoid::{HumanBone, Humanoid};
pub use inertial::{Inertia, WeightInertia};
pub use joint_map::JointMap;
pub use local_to_model::LocalToModel;
pub use mirror::{Mirror, MirrorError, MirrorMap};
pub use mix::Mix;
pub use phase::{PhaseFade, Steps};
pub use planar::Planar;
pub use playback::{Playback, Repeat};
pub use pose::{LANES, Lane, Pose, PoseBlock};
pub use property::{MaterialProperty, PropertyCurve, PropertyTarget};
pub use retarget::{Retarget, bind_or_retarget};
pub use root_motion::{RootMotion, RootParts};
pub use sample::Sample;
pub use simd::Level;
pub use skeleton::{Skeleton, SkeletonError};
pub use skin::{Morph, Skin, SkinMatrices};
pub use skin_dual::{DualQuaternion, SkinDual, stretch_of};
pub use time::{FrameRate, Time};
pub use transform::Transform;
