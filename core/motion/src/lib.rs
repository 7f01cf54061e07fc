//! Time, skeletons, clips and poses: sample, blend, local-to-model. No I/O, no GPU, no script.
//!
//! Conventions: metres, seconds, radians, +Y up, right-handed, column vectors; `a_from_b` maps
//! coordinates of space `b` to space `a`. "Joint" means any node of an asset's node tree, skinned
//! or not: one tree carries skins, meshes, cameras and lights, so one clip can move them all.

pub mod clip;
pub mod skeleton;
pub mod time;
pub mod transform;

pub use clip::{Clip, ClipError, Curve, Interpolation, Path};
pub use skeleton::{Skeleton, SkeletonError};
pub use time::{FrameRate, Time};
pub use transform::Transform;
