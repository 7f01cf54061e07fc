//! Inverse kinematics (IK): joints are turned so that a point of the character reaches a target.
//!
//! Solvers work in f64 and in one space, usually the model's. [`TwoBone`] is a closed form; [`Chain`] has any number of bones
//! with limits, and three iterative solvers; [`Aim`] shares a rotation among several joints. No state is kept between frames: a
//! result depends on the input pose and the target only, so that frames can be evaluated in any order.

mod aim;
mod ccd;
mod chain;
mod coordinate_descent;
mod fabrik;
mod least_squares;
mod limit;
mod two_bone;

pub use aim::{Aim, AimJoint};
pub use chain::{Chain, ChainBone, ChainResult, Solver};
pub use limit::Limit;
pub use two_bone::{TwoBone, TwoBoneSolution};
