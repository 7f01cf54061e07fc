//! Choices about spring bones and IK chains: steps per second, solvers and iterations.

use super::{Limits, MeasuredScene, SceneChoices, choose_row};
use crate::error::BenchError;
use crate::plots::{Choice, Row};
use crate::reference::ErrorStats;
use crate::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_motion::ik::Solver;
use choreo_stage::{Actor, ConstraintKind, Evaluator, ReachConstraint, Snapshot, SolverSettings, Stage};
use glam::DVec3;
use std::sync::Arc;

/// Longest time from its beginning over which a simulation is followed, seconds.
const MAX_SECS: f64 = 10.0;
/// Number of times at which joints are compared.
const COMPARED_TIMES: i64 = 8;
const RATES: [i64; 4] = [30, 60, 120, 240];
const EXACT_RATE: i64 = 960;
const SOLVERS: [(Solver, &str); 3] =
    [(Solver::LeastSquares, "damped least squares"), (Solver::Ccd, "CCD"), (Solver::Fabrik, "FABRIK")];
const ITERATIONS: [usize; 4] = [4, 8, 24, 64];
const LIMITS: Limits = Limits { rounding: 0.01, visible: 1.0, visible_text: "1 mm" };

/// (actor, joint) pairs whose positions are compared.
type Joints = Vec<(usize, u32)>;

pub fn springs(scene: &MeasuredScene) -> Result<SceneChoices, BenchError> {
    let joints = joints_of(scene.stage, |actor| {
        actor.springs.iter().flat_map(|s| s.rig.bones()).map(|bone| bone.joint).collect()
    });
    if joints.is_empty() {
        return Ok(SceneChoices::None("no actor has springs".into()));
    }
    let ours = scene.stage.solvers;
    let with = |spring_rate: i64| SolverSettings { spring_rate, ..ours };
    let name = |rate: i64| format!("{rate} steps a second");
    let methods: Vec<(String, SolverSettings)> =
        RATES.iter().map(|rate| (name(*rate), with(*rate))).collect();
    let mut choice = Choice::new("springs", "How many steps a second do springs take?");
    choice.reference =
        format!("{EXACT_RATE} steps a second; all joints with springs, positions in world space");
    let until = scene.at.min(Time::from_secs(MAX_SECS)).max(Time::from_secs(0.5));
    choice.per = format!("{:.2} s of the scene, all its poses", until.as_secs() / COMPARED_TIMES as f64);
    let window = (Time(until.0 / COMPARED_TIMES), until);
    add_rows(&mut choice, scene, &methods, with(EXACT_RATE), &joints, window)?;
    choice.choose(&name(ours.spring_rate), "the rate at which other programs tune spring parameters");
    Ok(SceneChoices::Choices(vec![choice]))
}

pub fn chains(scene: &MeasuredScene) -> Result<SceneChoices, BenchError> {
    let joints = joints_of(scene.stage, |actor| chain_ends(actor).collect());
    if joints.is_empty() {
        let why = "no IK chain of three or more bones, or with limits, reaches for a target; two bones \
            have a closed form";
        return Ok(SceneChoices::None(why.into()));
    }
    let ours = scene.stage.solvers;
    let with = |chain_solver: Solver, chain_iterations: usize| SolverSettings {
        chain_solver,
        chain_iterations,
        ..ours
    };
    let methods: Vec<(String, SolverSettings)> = SOLVERS
        .iter()
        .flat_map(|(solver, name)| ITERATIONS.map(|n| (format!("{name}, {n} iterations"), with(*solver, n))))
        .collect();
    let mut choice = Choice::new("ik", "How do IK chains of joints reach their targets?");
    choice.by_mean = true;
    choice.reference = "damped least squares, 1000 iterations to 1e-9 m; the last joint of each chain".into();
    choice.per = "frame, all its poses".into();
    let exact = SolverSettings { chain_tolerance: 1e-9, ..with(Solver::LeastSquares, 1000) };
    let last = Time((scene.stage.settings.length.0 - 1).max(0));
    add_rows(&mut choice, scene, &methods, exact, &joints, (Time::ZERO, last))?;
    choose_row(&mut choice, &LIMITS);
    Ok(SceneChoices::Choices(vec![choice]))
}

/// End joints of the IK chains that have no closed form: more than three joints, or joint limits.
fn chain_ends(actor: &Actor) -> impl Iterator<Item = u32> {
    let limited =
        |reach: &ReachConstraint| reach.joints.iter().any(|j| actor.limits.iter().any(|(l, _)| l == j));
    actor.constraints.iter().filter_map(move |constraint| match &constraint.kind {
        ConstraintKind::Reach(reach) if reach.joints.len() > 3 || limited(reach) => {
            reach.joints.last().copied()
        }
        _ => None,
    })
}

fn joints_of(stage: &Stage, of: impl Fn(&Actor) -> Vec<u32>) -> Joints {
    let actors = stage.actors.iter().enumerate();
    actors.flat_map(|(index, actor)| of(actor).into_iter().map(move |joint| (index, joint))).collect()
}

/// Adds a row for each of `methods`: the distance of the joints from their places with the exact settings, and the time that the poses
/// take.
fn add_rows(
    choice: &mut Choice,
    scene: &MeasuredScene,
    methods: &[(String, SolverSettings)],
    exact: SolverSettings,
    joints: &Joints,
    (first, last): (Time, Time),
) -> Result<(), BenchError> {
    choice.error_unit = "mm";
    let stage_with = |solvers: SolverSettings| Arc::new(Stage { solvers, ..(**scene.stage).clone() });
    let times: Vec<Time> =
        (0..COMPARED_TIMES).map(|i| first + Time((last - first).0 / (COMPARED_TIMES - 1) * i)).collect();
    let truth = joint_positions(&stage_with(exact), &times, joints)?;
    let stages: Vec<Arc<Stage>> = methods.iter().map(|(_, solvers)| stage_with(*solvers)).collect();
    for ((name, _), stage) in methods.iter().zip(&stages) {
        let (mut error, mut place) = (ErrorStats::default(), String::new());
        for (i, (got, exact)) in joint_positions(stage, &times, joints)?.iter().zip(&truth).enumerate() {
            if error.add((*got - *exact).length() * 1e3) {
                let (actor, joint) = joints[i % joints.len()];
                let (actor, secs) = (&scene.stage.actors[actor], times[i / joints.len()].as_secs());
                let joint = &actor.asset.skeleton.names()[joint as usize];
                place = format!("{}, {joint} at {secs:.2} s", actor.name);
            }
        }
        choice.rows.push(Row::new(name).error(error.worst, error.mean()).at(place));
    }
    let mut cases: Vec<Case> = Vec::new();
    for stage in &stages {
        let times = &times;
        cases.push(Case::new(times.len(), move || {
            _ = std::hint::black_box(joint_positions(stage, times, &Vec::new()))
        }));
    }
    let nanos = interleaved(Clock::Thread, scene.budget_secs, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    Ok(())
}

/// World positions of the joints at each time, from a new evaluator, so that springs are simulated from the beginning.
fn joint_positions(stage: &Arc<Stage>, times: &[Time], joints: &Joints) -> Result<Vec<DVec3>, BenchError> {
    let mut evaluator = Evaluator::new(stage.clone()).posing_hidden();
    let (mut snapshot, mut out) = (Snapshot::default(), Vec::new());
    for time in times {
        evaluator.at_into(*time, &mut snapshot)?;
        out.extend(joints.iter().map(|(actor, joint)| {
            let state = &snapshot.actors[*actor];
            let in_model = state.model_from_joint[*joint as usize].translation;
            state.world_from_model.transform_point3(glam::Vec3::from(in_model).as_dvec3())
        }));
    }
    Ok(out)
}
