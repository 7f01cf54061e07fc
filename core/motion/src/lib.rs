//! Time, skeletons, clips and poses: sample, blend, local-to-model. No I/O, no GPU, no script.
//!
//! Conventions: metres, seconds, radians, +Y up, right-handed, column vectors; `a_from_b` maps
//! coordinates of space `b` to space `a`. "Joint" means any node of an asset's node tree, skinned
//! or not: one tree carries skins, meshes, cameras and lights, so one clip can move them all.

pub mod bind;
pub mod blend;
pub mod clip;
pub mod crossfade;
pub mod local_to_model;
pub mod playback;
pub mod pose;
pub mod sample;
pub mod simd;
pub mod skeleton;
pub mod skin;
mod slerp;
pub mod time;
mod timeline;
mod tracks;
pub mod transform;

pub use bind::bind_clip;
pub use blend::{Blend, BlendOnto};
pub use clip::{Clip, ClipError, Curve, Interpolation, Path};
pub use crossfade::Crossfade;
pub use local_to_model::LocalToModel;
pub use playback::{Playback, Repeat};
pub use pose::{LANES, Lane, Pose, PoseBlock};
pub use sample::Sample;
pub use simd::Level;
pub use skeleton::{Skeleton, SkeletonError};
pub use skin::{Morph, Skin, SkinMatrices};
pub use time::{FrameRate, Time};
pub use transform::Transform;
