//! Solutions of inverse kinematics are checked by forward kinematics.

use crate::support::Random;
use choreo_motion::ik::{Chain, ChainBone, Limit, Solver, TwoBone};
use glam::{DQuat, DVec3};

const SOLVERS: [Solver; 3] = [Solver::Ccd, Solver::Fabrik, Solver::LeastSquares];

fn random_chain(n: &mut Random, count: usize, limit: Limit) -> Chain {
    let bones = (0..count)
        .map(|_| {
            let rotation = n.turn(0.4);
            ChainBone { rotation, rest: rotation, offset: DVec3::Y * (0.2 + 0.1 * n.signed64()), limit }
        })
        .collect();
    Chain { origin: n.vec3(), parent: n.turn(3.0), bones }
}

#[test]
fn two_bone_ik_reaches_targets_within_reach() {
    let mut n = Random(1);
    let mut reached = 0;
    for _ in 0..2000 {
        let [start, middle, end] = [n.vec3(), n.vec3(), n.vec3()];
        let limb =
            TwoBone { start, middle, end, target: n.vec3() * 1.5, pole: None, soft: 0.0, hint: DVec3::ZERO };
        let turned = limb.solve().unwrap();
        // Forward kinematics with the two turns.
        let fk_middle = start + turned.start * (middle - start);
        let fk_end = fk_middle + turned.middle * (end - middle);
        assert!(
            (fk_middle - turned.new_middle).length() < 1e-12 && (fk_end - turned.new_end).length() < 1e-12
        );
        let (a, b) = ((middle - start).length(), (end - middle).length());
        let distance = (limb.target - start).length();
        if distance < 0.06 * (a + b) {
            continue;
        }
        let expected = distance.clamp((a - b).abs(), a + b);
        assert!(((fk_end - limb.target).length() - (distance - expected).abs()).abs() < 1e-9);
        reached += usize::from(expected == distance);
        // The elbow stays on its side: unless the line to the target makes a half turn, the normal of the bend rotates with it.
        let normal = |m: DVec3, e: DVec3| (m - start).cross(e - start);
        let (before, after) = (normal(middle, end), normal(fk_middle, fk_end));
        let half_turn = (end - start).normalize().dot((limb.target - start).normalize()) < -0.95;
        if after.length() > 1e-6 && before.length() > 1e-6 && !half_turn {
            let carried = choreo_motion::math::rotation::rotation_between(end - start, limb.target - start)
                * before.normalize();
            assert!(carried.dot(after.normalize()) > 1.0 - 1e-6);
        }
    }
    assert!(reached > 500);
}

/// Largest rotation of a bone, radians, and largest movement of the elbow, metres, from one of `steps` targets to the next, on a
/// line past the start.
fn largest_changes(limb: TwoBone, way: DVec3, beside: DVec3, steps: i32) -> (f64, f64) {
    let mut before: Option<[DQuat; 2]> = None;
    let mut worst = (0.0f64, 0.0f64);
    let mut elbow_before = DVec3::ZERO;
    for i in 0..=steps {
        let target = limb.start + beside + way * (0.5 - f64::from(i) / f64::from(steps));
        let turned = TwoBone { target, ..limb }.solve().unwrap();
        let (now, elbow) = ([turned.start, turned.middle], turned.new_middle);
        if let Some(before) = before {
            for (a, b) in before.iter().zip(now) {
                worst.0 = worst.0.max(a.angle_between(b));
            }
            worst.1 = worst.1.max((elbow - elbow_before).length());
        }
        (before, elbow_before) = (Some(now), elbow);
    }
    worst
}

#[test]
fn elbows_do_not_jump_when_the_target_passes_through_the_shoulder() {
    // An arm that hangs, bent backwards; the upper arm is longer, or as long, or shorter.
    for lower in [0.25, 0.28, 0.31] {
        let (upper, bend) = (0.28, 0.3);
        let middle = DVec3::new(0.0, -upper * libm::cos(bend), -upper * libm::sin(bend));
        let limb = TwoBone {
            start: DVec3::new(0.2, 1.4, 0.0),
            middle: DVec3::new(0.2, 1.4, 0.0) + middle,
            end: DVec3::new(0.2, 1.4, 0.0)
                + middle
                + DVec3::new(0.0, -lower * libm::cos(0.2), lower * libm::sin(0.2)),
            target: DVec3::ZERO,
            pole: None,
            soft: 0.05,
            hint: DVec3::NEG_Z,
        };
        let along = (limb.end - limb.start).normalize();
        for way in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 1.0, 1.0).normalize(), along] {
            for sign in [1.0, -1.0] {
                for beside in
                    [DVec3::ZERO, way.any_orthonormal_vector() * 1e-9, way.any_orthonormal_vector() * 0.004]
                {
                    let coarse = largest_changes(limb, way * sign, beside, 2_000);
                    let fine = largest_changes(limb, way * sign, beside, 32_000);
                    // A jump has the same size for any step length. The elbow moves at up to 53 times the target's speed, and at 96
                    // times if the line passes 4 mm beside the start.
                    assert!(
                        fine.0 < 0.1 * coarse.0 + 1e-6 && fine.1 < 110.0 / 32_000.0,
                        "{lower} m, along {way} · {sign}, {beside} beside: {coarse:?}, {fine:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn elbows_bend_towards_the_pole() {
    let mut n = Random(2);
    for _ in 0..500 {
        let limb = TwoBone {
            start: DVec3::ZERO,
            middle: DVec3::new(0.3, 0.02, 0.0),
            end: DVec3::new(0.6, 0.0, 0.0),
            target: n.vec3().normalize() * 0.4,
            pole: Some(n.vec3()),
            soft: 0.0,
            hint: DVec3::ZERO,
        };
        let turned = limb.solve().unwrap();
        let line = limb.target.normalize();
        let across = |v: DVec3| (v - line * v.dot(line)).normalize();
        assert!(across(turned.new_middle).dot(across(limb.pole.unwrap())) > 1.0 - 1e-9);
        assert!((turned.new_end - limb.target).length() < 1e-12);
    }
}

#[test]
fn two_bone_ik_handles_degenerate_limbs_and_targets() {
    let x = DVec3::X;
    let straight = TwoBone {
        start: DVec3::ZERO,
        middle: x,
        end: x * 2.0,
        target: x,
        pole: None,
        soft: 0.0,
        hint: DVec3::ZERO,
    };
    let ok = |limb: TwoBone| {
        let turned = limb.solve().unwrap();
        assert!(turned.start.is_finite() && turned.middle.is_finite() && turned.new_end.is_finite());
        (turned.new_end - limb.target).length()
    };
    assert!(ok(straight) < 1e-12, "straight, the target on its line");
    assert!(ok(TwoBone { pole: Some(x * 5.0), ..straight }) < 1e-12, "the pole in line");
    assert!(ok(TwoBone { target: -x, ..straight }) < 1e-12, "the target right behind");
    assert!(ok(TwoBone { end: DVec3::ZERO, target: x * 1.5, ..straight }) < 1e-12, "folded");
    assert!((ok(TwoBone { target: x * 1e9, ..straight }) - (1e9 - 2.0)).abs() < 1.0, "far out of reach");
    let unlike = TwoBone { middle: x * 0.1, end: x * 1.1, target: x * 0.01, ..straight };
    assert!((ok(unlike) - 0.9).abs() < 0.01, "too near for unequal bones");
    // A hand at the shoulder does not jump back to the position in the clip.
    assert!(ok(TwoBone { target: DVec3::ZERO, ..straight }) < 1e-12, "the target in the start");
    assert!(
        (ok(TwoBone { target: DVec3::ZERO, ..unlike }) - 0.9).abs() < 1e-9,
        "in the start of unequal bones"
    );
    assert!(ok(TwoBone { middle: x * 1e-9, end: x * 2e-9, target: DVec3::Y * 1e-9, ..straight }) < 1e-18);
    for nothing in [
        TwoBone { middle: DVec3::ZERO, ..straight },
        TwoBone { end: x, ..straight },
        TwoBone { target: DVec3::NAN, ..straight },
        TwoBone { target: DVec3::splat(f64::INFINITY), ..straight },
        TwoBone { start: DVec3::NAN, ..straight },
    ] {
        assert!(nothing.solve().is_none(), "{nothing:?}");
    }
}

#[test]
fn chain_solvers_reach_targets_within_reach() {
    for solver in SOLVERS {
        let mut n = Random(5);
        for case in 0..300 {
            let count = 2 + case % 9;
            let mut chain = random_chain(&mut n, count, Limit::Free);
            let target =
                chain.origin + n.vec3().normalize() * chain.reach() * (0.45 + 0.4 * n.signed64().abs());
            // Two bones of different lengths cannot reach every point within their reach.
            let solved = chain.solve(target, solver, 500, 1e-6);
            assert!(solved.distance < 1e-5, "{solver:?}, case {case}, {count} bones: {solved:?}");
            assert!(((chain.end() - target).length() - solved.distance).abs() < 1e-12);
        }
    }
}

#[test]
fn joint_limits_hold_for_any_target() {
    let limits = [
        Limit::SwingTwist { axis: DVec3::Y, swing: 0.5, twist: (-0.3, 0.2) },
        Limit::Hinge { axis: DVec3::X, angle: (0.0, 1.2) },
    ];
    for solver in SOLVERS {
        for limit in limits {
            let mut n = Random(9);
            for _ in 0..60 {
                let mut chain = random_chain(&mut n, 5, limit);
                let before = (chain.end() - chain.origin).length();
                let target = chain.origin + n.vec3() * chain.reach() * 1.5;
                let start = (chain.end() - target).length();
                let solved = chain.solve(target, solver, 50, 1e-6);
                assert!(before > 0.0 && solved.distance <= start + 1e-9);
                for bone in &chain.bones {
                    assert!(limit.excess(bone.rest, bone.rotation) < 1e-6, "{solver:?} {limit:?}");
                }
            }
        }
    }
}

#[test]
fn chain_solvers_handle_degenerate_chains_and_targets() {
    let straight = |count: usize, length: f64| {
        let bone = ChainBone {
            rotation: DQuat::IDENTITY,
            rest: DQuat::IDENTITY,
            offset: DVec3::Y * length,
            limit: Limit::Free,
        };
        Chain { origin: DVec3::ZERO, parent: DQuat::IDENTITY, bones: vec![bone; count] }
    };
    for solver in SOLVERS {
        let end = |chain: &mut Chain, target: DVec3| {
            let solved = chain.solve(target, solver, 200, 1e-6);
            assert!(chain.bones.iter().all(|b| b.rotation.is_finite()), "{solver:?} {target}");
            solved.distance
        };
        assert!(end(&mut straight(6, 0.2), DVec3::Y * 0.7) < 1e-4, "{solver:?}: straight, on its line");
        assert!(end(&mut straight(6, 0.2), DVec3::NEG_Y * 0.7) < 1e-4, "{solver:?}: straight, behind");
        assert!(end(&mut straight(6, 0.2), DVec3::ZERO) < 1e-3, "{solver:?}: the target in the root");
        let far = end(&mut straight(6, 0.2), DVec3::X * 100.0);
        assert!((far - 98.8).abs() < 1e-9, "{solver:?}: out of reach: {far}");
        assert!((end(&mut straight(6, 0.2), DVec3::Y * 100.0) - 98.8).abs() < 1e-9);
        assert!(end(&mut straight(6, 0.0), DVec3::X) == 1.0, "{solver:?}: no length");
        assert!(end(&mut straight(3, 1e-9), DVec3::X * 2e-9) < 1e-5);
        assert!(end(&mut straight(0, 0.2), DVec3::X) == 1.0, "{solver:?}: no bones");
        assert!(end(&mut straight(4, 0.2), DVec3::NAN).is_nan());
        assert!(end(&mut straight(1000, 0.01), DVec3::new(3.0, 2.0, 1.0)) < 0.5, "{solver:?}: 1,000 bones");
    }
}

/// Smallest distance between the end of a chain of hinges and a target, by search: over a grid of angles, then with ever smaller
/// steps from its 20 best points.
fn nearest_distance_by_search(chain: &Chain, axes: &[DVec3], ranges: &[(f64, f64)], target: DVec3) -> f64 {
    const STEPS: usize = 24;
    let off = |angles: &[f64]| {
        let (mut at, mut turned) = (chain.origin, chain.parent);
        for ((bone, axis), angle) in chain.bones.iter().zip(axes).zip(angles) {
            turned = turned * bone.rest * DQuat::from_axis_angle(*axis, *angle);
            at += turned * bone.offset;
        }
        (at - target).length()
    };
    let count = ranges.len();
    let mut places: Vec<(f64, Vec<f64>)> = (0..(STEPS + 1).pow(count as u32))
        .map(|i| {
            let angles: Vec<f64> = (0..count)
                .map(|k| {
                    let step = i / (STEPS + 1).pow(k as u32) % (STEPS + 1);
                    ranges[k].0 + (ranges[k].1 - ranges[k].0) * step as f64 / STEPS as f64
                })
                .collect();
            (off(&angles), angles)
        })
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best = f64::INFINITY;
    for (mut far, mut angles) in places.into_iter().take(20) {
        let mut step = 0.2;
        while step > 1e-7 {
            let mut better = false;
            for k in 0..count {
                for way in [step, -step] {
                    let mut tried = angles.clone();
                    tried[k] = (tried[k] + way).clamp(ranges[k].0, ranges[k].1);
                    let now = off(&tried);
                    if now < far {
                        (far, angles, better) = (now, tried, true);
                    }
                }
            }
            if !better {
                step *= 0.5;
            }
        }
        best = best.min(far);
    }
    best
}

#[test]
fn chains_with_limits_come_near_the_global_optimum() {
    let mut worst_without = 0.0f64;
    for solver in SOLVERS {
        let mut n = Random(21);
        let mut short: Vec<f64> = Vec::new();
        for _ in 0..60 {
            let mut chain = random_chain(&mut n, 3, Limit::Free);
            let axes: Vec<DVec3> = (0..3).map(|_| n.vec3().normalize()).collect();
            let ranges: Vec<(f64, f64)> =
                (0..3).map(|_| (-n.signed64().abs() * 1.5, n.signed64().abs() * 1.5)).collect();
            for ((bone, axis), angle) in chain.bones.iter_mut().zip(&axes).zip(&ranges) {
                bone.limit = Limit::Hinge { axis: *axis, angle: *angle };
            }
            let reach = chain.reach();
            let target = chain.origin + n.vec3().normalize() * reach * (0.2 + 1.3 * n.signed64().abs());
            let nearest = nearest_distance_by_search(&chain, &axes, &ranges, target);
            worst_without = worst_without.max(((chain.end() - target).length() - nearest) / reach);
            let solved = chain.solve(target, solver, 24, 1e-5);
            short.push(((solved.distance - nearest) / reach).max(0.0));
            // No allowed pose nearby is nearer to the target.
            for _ in 0..200 {
                let mut other = chain.clone();
                for (bone, axis) in other.bones.iter_mut().zip(&axes) {
                    let turned =
                        (bone.rotation * DQuat::from_axis_angle(*axis, 1e-3 * n.signed64())).normalize();
                    bone.rotation = bone.limit.clamp(bone.rest, turned);
                }
                let gained = solved.distance - (other.end() - target).length();
                assert!(gained < 1e-5 + 1e-6 * reach, "{solver:?}: {gained} m nearer");
            }
        }
        short.sort_by(f64::total_cmp);
        let at = |share: f64| short[((short.len() - 1) as f64 * share) as usize];
        let all = short.iter().filter(|s| **s < 1e-5).count() as f64 / short.len() as f64;
        println!(
            "{solver:?}: at the nearest place of all in {:.0} of 100, else farther by up to {:.3} of the reach",
            100.0 * all,
            at(1.0)
        );
        assert!(all >= 0.85 && at(1.0) < 0.25, "{solver:?}: {all} {short:?}");
    }
    assert!(
        worst_without > 0.3,
        "the chains were already near the optimum before they were solved: {worst_without}"
    );
}
