//! Damped least squares on the Jacobian.

use super::Chain;
use super::chain::SolverScratch;
use glam::{DMat3, DQuat, DVec3};

/// One step of Levenberg–Marquardt. A joint at pᵢ turned by ωᵢ moves the end by ωᵢ × rᵢ, rᵢ = end − pᵢ, so that J Jᵀ is the 3×3
/// sum of |rᵢ|² − rᵢ rᵢᵀ however long the chain, and the least-norm step is ωᵢ = rᵢ × (J Jᵀ + λ)⁻¹ e.
pub(super) fn iterate(chain: &mut Chain, target: DVec3, scratch: &mut SolverScratch) {
    /// Largest rotation in a step, radians: rotations are nearly linear only up to a good part of a radian.
    const MAX_STEP_RAD: f64 = 1.0;
    const MAX_ATTEMPTS: usize = 6;
    chain.positions(&mut scratch.positions);
    scratch.before.clone_from(&chain.bones);
    let end = *scratch.positions.last().unwrap_or(&chain.origin);
    let error = target - end;
    let reach = chain.reach();
    let mut square = DMat3::ZERO;
    for p in &scratch.positions[..chain.bones.len()] {
        let r = end - *p;
        square += DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer_product(r);
    }
    for _ in 0..MAX_ATTEMPTS {
        let damping = scratch.damping * reach * reach;
        let solved = (square + DMat3::from_diagonal(DVec3::splat(damping))).inverse() * error;
        if !solved.is_finite() {
            scratch.damping = (scratch.damping * 10.0).max(1e-12);
            continue;
        }
        let mut parent = chain.parent;
        for (index, bone) in chain.bones.iter_mut().enumerate() {
            *bone = scratch.before[index];
            let turn = (end - scratch.positions[index]).cross(solved).clamp_length_max(MAX_STEP_RAD);
            // The step is linear: each joint turns as if the joints before it had not turned yet.
            bone.turn(DQuat::from_scaled_axis(turn), parent);
            parent *= scratch.before[index].rotation;
        }
        if (target - chain.end()).length() < error.length() {
            scratch.damping = (scratch.damping * 0.1).max(1e-9);
            return;
        }
        scratch.damping *= 10.0;
    }
    chain.bones.clone_from(&scratch.before);
    scratch.stuck = scratch.damping > 1e6;
}

fn outer_product(r: DVec3) -> DMat3 {
    DMat3::from_cols(r * r.x, r * r.y, r * r.z)
}
