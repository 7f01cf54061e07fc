//! Inverse kinematics.

use crate::{Case, refused};
use choreo_motion::ik::{Aim, AimJoint, Chain, ChainBone, Limit, TwoBone};
use choreo_stage::SolverSettings;
use glam::{DQuat, DVec3};

const TARGET_DISTANCE: &str = "metres from the target";

pub const CASES: &[Case] = &[
    Case::new("two bones, target at the shoulder", "metres off the folded limb's reach", 1e-12, || {
        let limb = arm(DVec3::ZERO, None);
        let folded = (limb.middle.length() - (limb.end - limb.middle).length()).abs();
        (target_distance(limb) - folded).abs()
    }),
    Case::new("two bones, target at the elbow", TARGET_DISTANCE, 1e-12, || {
        target_distance(arm(DVec3::new(0.3, 0.0, 0.0), None))
    }),
    Case::new("two bones, target at the hand", TARGET_DISTANCE, 1e-12, || {
        target_distance(arm(DVec3::new(0.5, 0.1, 0.0), None))
    }),
    Case::new("two bones, target 1e9 m away", "metres short of full reach", 1e-9, || {
        let limb = arm(DVec3::Y * 1e9, None);
        let turned = limb.solve().map_or(f64::NAN, |t| t.new_end.length());
        (turned - (limb.middle.length() + (limb.end - limb.middle).length())).abs()
    }),
    Case::new("two bones, pole in line", TARGET_DISTANCE, 1e-12, || {
        target_distance(arm(DVec3::X * 0.4, Some(DVec3::X * 3.0)))
    }),
    Case::new("two bones, pole in the shoulder", TARGET_DISTANCE, 1e-12, || {
        target_distance(arm(DVec3::X * 0.4, Some(DVec3::ZERO)))
    }),
    Case::new("two bones, straight, target on its line", TARGET_DISTANCE, 1e-12, || {
        target_distance(TwoBone { end: DVec3::X * 0.6, ..arm(DVec3::X * 0.4, None) })
    }),
    Case::new("two bones, one of no length", "turned (0 or 1)", 0.0, || {
        f64::from(TwoBone { end: DVec3::X * 0.3, ..arm(DVec3::Y * 0.3, None) }.solve().is_some())
    }),
    Case::new("two bones of 1e-9 m", TARGET_DISTANCE, 1e-18, || {
        let limb = arm(DVec3::Y * 4e-10, None);
        target_distance(TwoBone { middle: limb.middle * 1e-9, end: limb.end * 1e-9, ..limb })
    }),
    Case::new("two bones, target NaN", "turned (0 or 1)", 0.0, || {
        f64::from(arm(DVec3::NAN, None).solve().is_some())
    }),
    Case::new("chain of 1,000 bones", TARGET_DISTANCE, 1e-3, || {
        chain_target_distance(1000, 0.01, DVec3::new(3.0, 2.0, 1.0))
    }),
    Case::new("chain, straight, target on its line", TARGET_DISTANCE, 1e-4, || {
        chain_target_distance(6, 0.2, DVec3::Y * 0.5)
    }),
    Case::new("chain, straight, target right behind", TARGET_DISTANCE, 1e-4, || {
        chain_target_distance(6, 0.2, DVec3::NEG_Y * 0.5)
    }),
    Case::new("chain, target at its root", TARGET_DISTANCE, 1e-3, || {
        chain_target_distance(6, 0.2, DVec3::ZERO)
    }),
    Case::new("chain, target 1 km away", "metres short of full reach", 0.05, || {
        chain_target_distance(6, 0.2, DVec3::X * 1000.0) - (1000.0 - 1.2)
    }),
    Case::new("chain of bones without length", "metres moved", 0.0, || {
        (chain_target_distance(6, 0.0, DVec3::X) - 1.0).abs()
    }),
    Case::new("aim at the joint itself", "radians turned", 0.0, || aimed(DVec3::Y)),
    Case::new("aim straight behind", "radians turned", 1e-9, || aimed(DVec3::Y - DVec3::Z)),
    Case::new("aim at NaN", "radians turned", 0.0, || aimed(DVec3::NAN)),
    Case::new("limit with an axis of no length", "named error (0) or not (1)", 0.0, || {
        refused(
            Limit::Hinge { axis: DVec3::ZERO, angle: (0.0, 1.0) }.check().map_err(|e| e.to_string()),
            "`Limit.axis` is of length 0",
        )
    }),
];

fn arm(target: DVec3, pole: Option<DVec3>) -> TwoBone {
    TwoBone {
        start: DVec3::ZERO,
        middle: DVec3::X * 0.3,
        end: DVec3::new(0.5, 0.1, 0.0),
        target,
        pole,
        hint: DVec3::ZERO,
        soft: 0.0,
    }
}

/// Remaining distance to the target in metres, by forward kinematics.
fn target_distance(limb: TwoBone) -> f64 {
    limb.solve().map_or(f64::NAN, |turned| {
        let middle = limb.start + turned.start * (limb.middle - limb.start);
        (middle + turned.middle * (limb.end - limb.middle) - limb.target).length()
    })
}

fn chain_target_distance(count: usize, length: f64, target: DVec3) -> f64 {
    let rotation = DQuat::IDENTITY;
    let bone = ChainBone { rotation, rest: rotation, offset: DVec3::Y * length, limit: Limit::Free };
    let mut chain = Chain { origin: DVec3::ZERO, parent: rotation, bones: vec![bone; count] };
    let solvers = SolverSettings::default();
    // A chain of a thousand bones needs more iterations than a hand.
    let iterations = if count > 100 { 200 } else { solvers.chain_iterations };
    chain.solve(target, solvers.chain_solver, iterations, solvers.chain_tolerance);
    (chain.end() - target).length()
}

fn aimed(target: DVec3) -> f64 {
    let mut joints =
        [AimJoint { position: DVec3::ZERO, share: 1.0 }, AimJoint { position: DVec3::Y, share: 1.0 }];
    let mut turns = [DQuat::IDENTITY; 2];
    Aim { joints: &mut joints, forward: DVec3::Z, target, limit: 1.4, weight: 1.0 }.run(&mut turns);
    turns.iter().map(|t| 2.0 * libm::atan2(t.xyz().length(), t.w.abs())).fold(0.0, f64::max)
}
