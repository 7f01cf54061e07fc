//! Time, skeletons, clips and poses: sample, blend, local-to-model, skin. No I/O, no GPU, no script.
//!
//! Conventions: metres, seconds, radians, +Y up, right-handed, column vectors; `a_from_b` maps
//! coordinates of space `b` to space `a`. "Joint" means any node of an asset's node tree, skinned
//! or not: one tree carries skins, meshes, cameras and lights, so one clip can move them all.
//!
//! Each step is a job: a struct of borrowed inputs and outputs, whose `check()` names the field that is wrong and whose
//! `run()` allocates nothing. No state is kept between frames, so that a seek costs as much as the next frame, and
//! every machine gives the same bits (module `simd`).
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
//! // Forwards and backwards forever, at double speed; after 0.75 s on stage the clip is on its way back, at 0.5 s.
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
//! [`Crossfade`] blends two clips, [`WeightedBlend`] any number in any order, and [`AdditiveLayers`] are added on top.
//! [`bind_clip`] binds a clip to another skeleton by joint names. `cargo bench -p choreo-motion` measures speed and error of all
//! this.

#![warn(missing_docs)]

pub mod clip;
mod compress;
pub mod contacts;
pub mod edit;
mod error_texts;
pub mod facing;
pub mod ik;
pub(crate) mod input_error;
pub mod math;
mod mirror;
mod pose;
pub mod retarget;
mod root_motion;
#[allow(
    unsafe_code,
    reason = "registers of AVX2 and AVX-512, gathers without a look at each index, and points as arrays"
)]
mod simd;
pub mod skeleton;
pub mod skinning;
mod slerp_series;
pub mod spring;
mod time;

pub use clip::crossfade::Crossfade;
pub use clip::property_curve::{MaterialProperty, PropertyCurve, PropertyTarget};
pub use clip::sample::Sample;
pub use clip::{Clip, ClipError, CompressionReport, Curve, CurveError, ExpressionCurve, Interpolation, Path};
pub use compress::CompressError;
pub use contacts::Contacts;
pub use contacts::phase_matching::{Footsteps, PhaseMatchedFade};
pub use edit::bake::{BakeDeviation, BakeError};
pub use edit::{EditError, Offset};
pub use facing::{Facing, FacingEvidence, Front};
pub use input_error::InputError;
pub use math::planar::Planar;
pub use math::rotation::slerp;
pub use math::transform::Transform;
pub use mirror::Mirror;
pub use pose::Pose;
pub use pose::additive::AdditiveLayers;
pub use pose::blend::{Blend, BlendOnto, RotationBlend};
pub use pose::inertialization::{Inertialization, WeightInertialization};
pub use pose::local_to_model::LocalToModel;
pub use pose::weighted_blend::WeightedBlend;
pub use retarget::bind::{bind_by_name, bind_clip};
pub use retarget::joint_map::JointMap;
pub use retarget::{Retarget, bind_or_retarget};
pub use root_motion::{RootMotion, RootParts};
pub use simd::Level;
pub use skeleton::humanoid::{HumanBone, Humanoid};
pub use skeleton::humanoid_joints::HumanoidJoints;
pub use skeleton::symmetry::{MirrorError, MirrorMap};
pub use skeleton::{Skeleton, SkeletonError};
pub use skinning::dual::{DualQuaternion, DualQuaternionSkinning, stretch_matrix};
pub use skinning::dual_quaternion::{Skinning, StretchedDualQuaternion};
pub use skinning::linear::{LinearSkinning, SkinMatrices};
pub use skinning::morph::Morph;
pub use time::ease::{Ease, Shape};
pub use time::playback::{Playback, Repeat};
pub use time::{FrameRate, FrameRateError, Time};
