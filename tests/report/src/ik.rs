//! Inverse kinematics of chains with three or more bones: convergence of solvers.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::ik::{Chain, ChainBone, Limit, Solver};
use choreo_stage::SolverSettings;
use glam::{DQuat, DVec3};

const BONE_COUNT: usize = 6;
const CASE_COUNT: usize = 100;
const ITERATIONS: [usize; 5] = [4, 8, 16, 24, 64];
const SOLVERS: [(Solver, &str); 3] =
    [(Solver::Ccd, "CCD"), (Solver::Fabrik, "FABRIK"), (Solver::LeastSquares, "damped least squares")];
const CONE_LIMIT: Limit = Limit::SwingTwist { axis: DVec3::Y, swing: 0.6, twist: (-0.3, 0.3) };

/// Limit of a knee, which rotates about one axis.
const HINGE_LIMIT: Limit = Limit::Hinge { axis: DVec3::X, angle: (-0.6, 0.6) };

pub(crate) fn section() -> Result<Section, String> {
    let mut free = compare_iterations("ik", "How does a chain of joints reach its target?", Limit::Free);
    free.reference = format!(
        "forward kinematics: distance of the end from a target in reach; chains of {BONE_COUNT} bones, about 1.2 \
         m long"
    );
    free.choose(
        &default_method_name(),
        "converges quadratically near the target, and shares the bend among all joints",
    );
    let mut limited = compare_iterations(
        "ik_limits",
        "How does a chain of joints with cone limits of 34° reach its target?",
        CONE_LIMIT,
    );
    limited.reference =
        "forward kinematics: distance of the end from its place in another pose within the limits"
            .to_string();
    limited
        .choose(&default_method_name(), "the way without limits, then joint by joint where limits stop it");
    Ok(Section {
        title: "Chains that reach",
        text: "Arms and legs of two bones have a closed form. Longer chains are solved step by step, until the end is within a hundredth of a \
               millimetre: each iteration of damped least squares costs a little more than one of the \
               others, but a tail needs hundreds of theirs. Out of reach a chain comes as near as it can, \
               and within cone limits it finds a solution; where every joint turns about one axis only, no \
               way reaches the target from the start pose. The tables show how near each comes, and that no \
               joint ever exceeds its limit."
            .into(),
        choices: vec![free, limited],
        tables: vec![limits_table(), difficult_targets_table()],
        off_front: Vec::new(),
    })
}

fn solvers_and_iterations() -> Vec<(Solver, usize, String)> {
    SOLVERS
        .iter()
        .flat_map(|(solver, name)| ITERATIONS.map(|n| (*solver, n, format!("{name}, {n} iterations"))))
        .collect()
}

fn default_settings() -> SolverSettings {
    SolverSettings::default()
}

fn default_method_name() -> String {
    let chosen = |(solver, n, _): &(Solver, usize, String)| {
        (*solver, *n) == (default_settings().chain_solver, default_settings().chain_iterations)
    };
    solvers_and_iterations().into_iter().find(chosen).map(|(.., name)| name).unwrap_or_default()
}

fn compare_iterations(name: &'static str, question: &'static str, limit: Limit) -> Choice {
    let methods = solvers_and_iterations();
    let problems: Vec<(Chain, DVec3)> =
        (0..CASE_COUNT as u64).map(|seed| random_chain_and_target(seed, BONE_COUNT, limit)).collect();
    let problems = &problems;
    let mut cases: Vec<Case> = methods
        .iter()
        .map(|(solver, iterations, _)| {
            Case::new(CASE_COUNT, move || {
                for (chain, target) in problems {
                    let mut chain = chain.clone();
                    std::hint::black_box(chain.solve(
                        *target,
                        *solver,
                        *iterations,
                        default_settings().chain_tolerance,
                    ));
                }
            })
        })
        .collect();
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    let mut choice = Choice::new(name, question);
    choice.error_unit = "mm";
    choice.by_mean = true;
    choice.per = format!("solution of {BONE_COUNT} bones");
    for ((solver, iterations, name), nanos) in methods.iter().zip(nanos) {
        let mut errors = ErrorStats::default();
        for (chain, target) in problems {
            errors.add(solve_error(chain, *target, *solver, *iterations).0);
        }
        choice.rows.push(Row::new(name.clone()).error(errors.worst, errors.mean()).nanos(nanos));
    }
    choice
}

/// Distance from the target, and angle beyond the joint limits, by number of iterations.
fn limits_table() -> Table {
    let columns: [(&str, &'static str); 7] = [
        ("limited joints, after iterations", "way"),
        (">cones of 34°: worst, mm", "in reach within the limits"),
        (">mean, mm", "in reach within the limits"),
        (">beyond a limit, degrees", "any joint of any case"),
        (">hinges of ±34°: worst, mm", "in reach within the limits"),
        (">mean, mm", "in reach within the limits"),
        (">beyond a limit, degrees", "any joint of any case"),
    ];
    let mut table =
        Table::new("Iterations against the distance from the goal and from joint limits", &columns);
    for (solver, iterations, name) in solvers_and_iterations() {
        let mut cells = vec![Cell::text(name)];
        for limit in [CONE_LIMIT, HINGE_LIMIT] {
            let (mut off, mut worst_beyond) = (ErrorStats::default(), 0.0f64);
            for seed in 0..CASE_COUNT as u64 {
                let (chain, target) = random_chain_and_target(seed, BONE_COUNT, limit);
                let (distance, beyond) = solve_error(&chain, target, solver, iterations);
                off.add(distance);
                worst_beyond = worst_beyond.max(beyond);
            }
            let numbers = [off.worst, off.mean(), worst_beyond];
            cells.extend(numbers.into_iter().map(|n| Cell::number(quantity(n), n)));
        }
        table.rows.push(cells);
    }
    table
}

/// Distance to the target in millimetres, and degrees beyond a limit.
fn solve_error(chain: &Chain, target: DVec3, solver: Solver, iterations: usize) -> (f64, f64) {
    let mut chain = chain.clone();
    chain.solve(target, solver, iterations, default_settings().chain_tolerance);
    let beyond =
        chain.bones.iter().map(|b| b.limit.excess(b.rest, b.rotation).to_degrees()).fold(0.0, f64::max);
    ((chain.end() - target).length() * 1e3, beyond)
}

/// A chain, and the position of its end in another random pose within its limits.
fn random_chain_and_target(seed: u64, bones: usize, limit: Limit) -> (Chain, DVec3) {
    let mut random = Random(seed * 31 + 7);
    let mut chain = Chain { origin: DVec3::ZERO, parent: DQuat::IDENTITY, bones: Vec::new() };
    for _ in 0..bones {
        let rest = DQuat::from_axis_angle(random.direction(), random.unit() * 0.3);
        let offset = DVec3::Y * (0.2 + 0.05 * random.signed());
        chain.bones.push(ChainBone { rotation: rest, rest, offset, limit });
    }
    let mut other = chain.clone();
    for bone in &mut other.bones {
        let turned = bone.rest * DQuat::from_axis_angle(random.direction(), random.unit() * 1.2);
        bone.rotation = bone.limit.clamp(bone.rest, turned.normalize());
    }
    (chain, other.end())
}

fn straight_chain(bones: usize) -> Chain {
    let bone = ChainBone {
        rotation: DQuat::IDENTITY,
        rest: DQuat::IDENTITY,
        offset: DVec3::Y * 1.2 / bones as f64,
        limit: Limit::Free,
    };
    Chain { origin: DVec3::ZERO, parent: DQuat::IDENTITY, bones: vec![bone; bones] }
}

fn difficult_targets_table() -> Table {
    let columns: [(&str, &'static str); 7] = [
        ("worst distance in mm after 24 iterations", "way"),
        (">3 bones", "in reach"),
        (">20 bones", "in reach"),
        (">100 bones", "in reach"),
        (">cones of 34°", "in reach within the limits"),
        (">out of reach, above the minimum", "a target at three times the reach"),
        (">straight, the target on its line", "at half the reach"),
    ];
    let mut table = Table::new("Long, limited, unreachable and straight", &columns);
    for (solver, name) in SOLVERS {
        let worst = |bones: usize, limit: Limit| {
            let off = |seed| {
                let (chain, target) = random_chain_and_target(seed, bones, limit);
                let (off, beyond) = solve_error(&chain, target, solver, default_settings().chain_iterations);
                assert!(beyond < 1e-3, "a limit is broken by {beyond}°");
                off
            };
            (0..30).map(off).fold(0.0, f64::max)
        };
        let far = (0..30)
            .map(|seed| {
                let (chain, _) = random_chain_and_target(seed, BONE_COUNT, Limit::Free);
                let target = Random(seed).direction() * 3.0 * chain.reach();
                solve_error(&chain, target, solver, default_settings().chain_iterations).0
                    - 2.0e3 * chain.reach()
            })
            .fold(0.0, f64::max);
        let line = solve_error(
            &straight_chain(BONE_COUNT),
            DVec3::Y * 0.6,
            solver,
            default_settings().chain_iterations,
        )
        .0;
        let numbers = [
            worst(3, Limit::Free),
            worst(20, Limit::Free),
            worst(100, Limit::Free),
            worst(BONE_COUNT, CONE_LIMIT),
            far,
            line,
        ];
        let cells = numbers.into_iter().map(|n| Cell::number(quantity(n), n));
        table.rows.push([Cell::text(name)].into_iter().chain(cells).collect());
    }
    table
}
