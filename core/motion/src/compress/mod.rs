//! Compression of clips to fewer bytes, within a stated error of any joint in model space, sampled as fast as other clips.
//!
//! The ideas are ACL's (N. Frechette, "Animation Compression: Uniformly Sampled", nfrechette.github.io, 2016, and its series):
//! uniform sampling, so that any time is found at once; range reduction of each track; as few bits as the tolerance needs; an
//! error that is measured in model space, at points beside the joints, on decoded data. The layout is for eight joints at once:
//!
//! - Keys are taken at an even rate that contains all of the clip's own, so that interpolation between keys stays as authored.
//! - Curves that are constant within the tolerance are stored once.
//! - Other curves become uniform cubic B-splines, fitted by least squares, with one knot for every 1 to 8 keys, whichever takes
//!   the fewest bytes within the tolerance. A key is decoded from four knots; two neighboring keys are decoded and interpolated
//!   as in any clip, so that a seek costs as much as the next frame.
//! - Knots are quantized to 0 to 16 bits in the range of each joint's component.
//!
//! The error allowed at a joint follows from the distance of the joints below it. Then the clip is decoded and measured, and the
//! allowed errors are redistributed, until the bound holds and little tolerance is left. The reported error is the measured one.

mod fit;
mod grid;
mod pack;

use crate::clip::{Clip, CompressionReport, Curve, Interpolation, Path};
use crate::edit::reduce::{JointReach, joint_errors, key_bytes};
use crate::skeleton::Skeleton;
use fit::CurveFits;
use grid::Grid;
use pack::pack_curves;
use std::sync::Arc;

/// The reason why a clip cannot be compressed; the message has the numbers.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum CompressError {
    Tolerance(f64),
    Joints { clip: String, joints: usize, expected: usize },
}

crate::error_texts! { CompressError:
    Self::Tolerance(tolerance) => "the tolerance of {tolerance} m must be from 0.000001 m to 0.1 m";
    Self::Joints { clip, joints, expected } => "the numbers of joints differ: {joints} in the clip \"{clip}\", {expected} in the skeleton";
}

/// Largest number of rounds that lower the tolerances of all curves until the error is within the bound.
const MAX_LOWERING_ROUNDS: usize = 13;
/// Factor by which tolerances are lowered each time.
const TOLERANCE_FACTOR: f64 = 0.8;
/// Largest number of later rounds that redistribute tolerances between joints to save bytes.
const MAX_REDISTRIBUTION_ROUNDS: usize = 8;

/// Redistributes tolerances: joints get more if all joints below them are within the bound, and less if one is beyond it.
fn redistribute_tolerances(skeleton: &Skeleton, errors_m: &[f64], tolerance_m: f64, allowed_m: &mut [f64]) {
    let mut below = errors_m.to_vec();
    for (joint, parent) in skeleton.parents().iter().enumerate().rev() {
        if let Some(parent) = parent {
            below[*parent as usize] = below[*parent as usize].max(below[joint]);
        }
    }
    for (allowed, error) in allowed_m.iter_mut().zip(below) {
        // Tolerances grow slowly, since numbers of bits and knots change in whole steps.
        let factor = 0.97 * tolerance_m / error.max(1e-12);
        let factor = if factor > 1.0 { factor.sqrt().min(1.3) } else { factor.max(0.8) };
        *allowed = (*allowed * factor).min(10.0 * tolerance_m);
    }
}

impl Clip {
    /// The clip in fewer bytes, or the clip itself if that saves none. STEP and CUBICSPLINE curves, morph weights, expressions
    /// and properties stay as they are. Edits and exports of the clip see the decoded keys.
    pub fn compressed(
        &self,
        skeleton: &Skeleton,
        tolerance_m: f64,
    ) -> Result<(Clip, CompressionReport), CompressError> {
        if !(1e-6..=0.1).contains(&tolerance_m) {
            return Err(CompressError::Tolerance(tolerance_m));
        }
        if self.joint_count() != skeleton.len() {
            let (joints, expected) = (self.joint_count(), skeleton.len());
            return Err(CompressError::Joints { clip: self.name.clone(), joints, expected });
        }
        let before = self.stored_bytes();
        let frames = (self.duration.as_secs() * 30.0).ceil() as usize + 1;
        let dense_bytes = frames.saturating_mul(self.joint_count() * 40);
        let reach = JointReach::of(skeleton);
        for grid in Grid::candidates(self) {
            let fits = CurveFits::new(self, &grid);
            let mut allowed_m = vec![tolerance_m; skeleton.len()];
            let mut best: Option<(Clip, CompressionReport)> = None;
            let mut rounds = MAX_LOWERING_ROUNDS;
            while rounds > 0 {
                rounds -= 1;
                let clip = self.packed_on_grid(&grid, &fits, &reach, &allowed_m);
                let after = clip.stored_bytes();
                if best.is_none() && after >= before {
                    break;
                }
                let errors = joint_errors(skeleton, self, &clip, 4000);
                let worst_m = errors.iter().fold(0.0, |a: f64, b| a.max(*b));
                if worst_m <= tolerance_m && best.as_ref().is_none_or(|(_, best)| after < best.bytes[1]) {
                    rounds = if best.is_none() { MAX_REDISTRIBUTION_ROUNDS } else { rounds };
                    best = Some((clip, CompressionReport { bytes: [before, after], dense_bytes, worst_m }));
                }
                match best {
                    None => allowed_m.iter_mut().for_each(|m| *m *= TOLERANCE_FACTOR),
                    Some(_) => redistribute_tolerances(skeleton, &errors, tolerance_m, &mut allowed_m),
                }
            }
            if let Some((clip, report)) = best {
                return Ok((clip.with_compression(report), report));
            }
        }
        Ok((self.clone(), CompressionReport { bytes: [before; 2], dense_bytes, worst_m: 0.0 }))
    }

    /// Bytes of key times and values, as stored; times that curves share count once.
    pub fn stored_bytes(&self) -> usize {
        key_bytes(self) + self.packed().map_or(0, |p| p.stored_bytes())
    }

    /// Packs the clip on a grid. `allowed_m`: error in model space, metres, that each joint's own curves may cause.
    fn packed_on_grid(&self, grid: &Grid, fits: &CurveFits, reach: &JointReach, allowed_m: &[f64]) -> Clip {
        let mut raw: Vec<Curve> = Vec::new();
        let first_time: Arc<[crate::time::Time]> = [grid.start].into();
        let mut moving = Vec::new();
        for (index, curve) in self.curves().iter().enumerate() {
            let Some(fit) = fits.fit_of(index) else {
                raw.push(curve.clone());
                continue;
            };
            let allowed = curve_tolerance(curve, reach, allowed_m[curve.joint as usize]);
            match fit.constant(allowed * 0.5) {
                Some(value) => raw.push(Curve {
                    times: first_time.clone(),
                    values: value[..curve.path.width()].iter().map(|v| *v as f32).collect(),
                    interpolation: Interpolation::Linear,
                    ..curve.clone()
                }),
                None => moving.push((index, allowed)),
            }
        }
        let (packed, unpacked) = pack_curves(self, grid, fits, &moving);
        let times: Arc<[crate::time::Time]> = grid.times().collect();
        raw.extend(
            unpacked.into_iter().map(|index| fits.resampled_curve(&self.curves()[index], index, &times)),
        );
        let clip = self.with_curves(self.joint_count(), raw).with_duration(self.duration);
        let clip = clip.with_properties_of(self);
        if packed.is_empty() { clip } else { clip.with_packed(Arc::new(packed)) }
    }
}

/// Allowed error of a curve, in radians, metres of the parent's space or scale factors.
fn curve_tolerance(curve: &Curve, reach: &JointReach, tolerance_m: f64) -> f64 {
    let joint = curve.joint as usize;
    match curve.path {
        // Beyond a hundredth, quaternions would not stay near enough to length 1.
        Path::Rotation => (tolerance_m / reach.distance[joint]).min(0.01),
        Path::Scale => tolerance_m / reach.distance[joint],
        _ => tolerance_m / reach.unit[joint],
    }
}
