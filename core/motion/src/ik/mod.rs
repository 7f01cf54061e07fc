//! Inverse kinematics: joints turned so that a point of the body goes where it should.
//!
//! All in f64 and in one space, usually the model's. [`TwoBone`] is a closed form; [`Chain`] holds any number of bones with
//! limits, and three ways to solve it; [`Aim`] shares a turn among several joints. Nothing is remembered between frames: the
//! answer depends on the pose before it and the goal alone, so that frames can be evaluated in any order.

mod aim;
mod ccd;
mod chain;
mod fabrik;
mod least_squares;
mod limit;
mod settle;
mod two_bone;

pub use aim::{Aim, AimJoint};
pub use chain::{Chain, ChainBone, ChainResult, Solver};
pub use limit::Limit;
pub use two_bone::{TwoBone, TwoBoneSolution};
