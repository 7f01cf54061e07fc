//! Spring bones: methods of integration.

use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::spring::sphere::{exp, log};
use choreo_motion::spring::{
    BoneState, Drive, RigBone, SpringBone, SpringRig, SpringScratch, SpringState, SpringStep,
};
use choreo_motion::{Skeleton, Transform};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Vec3};
use std::f64::consts::PI;

const CHOSEN_METHOD: &str = "closed form (SpringBone)";
/// Name, steps per frame, method.
const METHODS: [(&str, u32, Method); 9] = [
    ("explicit Euler", 1, Method::Explicit),
    ("semi-implicit Euler", 1, Method::SemiImplicit),
    ("semi-implicit Euler, 8 steps a frame", 8, Method::SemiImplicit),
    ("semi-implicit Euler, 64 steps a frame", 64, Method::SemiImplicit),
    ("implicit Euler", 1, Method::Implicit),
    ("implicit Euler, 64 steps a frame", 64, Method::Implicit),
    ("RK4", 1, Method::Rk4),
    ("RK4, 8 steps a frame", 8, Method::Rk4),
    (CHOSEN_METHOD, 1, Method::ClosedForm),
];
const FREQUENCIES: [f64; 5] = [0.1, 1.0, 10.0, 100.0, 1000.0];
const DAMPING_RATIOS: [f64; 6] = [0.0, 0.1, 0.5, 1.0, 3.0, 10.0];
const FRAME_RATES: [u32; 6] = [12, 24, 30, 60, 120, 240];
/// Duration of a swing in seconds.
const SWING_SECS: f64 = 2.0;
/// Initial angle in radians.
const START_ANGLE: f64 = 1.0;

#[derive(Clone, Copy, PartialEq)]
enum Method {
    Explicit,
    SemiImplicit,
    Implicit,
    Rk4,
    ClosedForm,
}

pub(crate) fn section() -> Result<Section, String> {
    let mut free = vec![ErrorStats::default(); METHODS.len()];
    let mut worst_at = vec![(0.0, String::new()); METHODS.len()];
    let mut by_rate = vec![vec![ErrorStats::default(); FRAME_RATES.len()]; METHODS.len()];
    let mut by_frequency = vec![vec![ErrorStats::default(); FREQUENCIES.len()]; METHODS.len()];
    let mut by_ratio = vec![vec![ErrorStats::default(); DAMPING_RATIOS.len()]; METHODS.len()];
    for (method_index, (_, steps, method)) in METHODS.iter().enumerate() {
        for (f, frequency) in FREQUENCIES.iter().enumerate() {
            for (z, ratio) in DAMPING_RATIOS.iter().enumerate() {
                for (r, rate) in FRAME_RATES.iter().enumerate() {
                    let (difference, time) = free_swing(*method, *steps, *frequency, *ratio, *rate);
                    by_frequency[method_index][f].add(difference);
                    by_ratio[method_index][z].add(difference);
                    by_rate[method_index][r].add(difference);
                    free[method_index].add(difference);
                    if difference > worst_at[method_index].0 {
                        worst_at[method_index] =
                            (difference, format!("{frequency} Hz, ratio {ratio}, {rate} fps, {time:.2} s"));
                    }
                }
            }
        }
    }
    let drive = drive_at_rest();
    let bone = SpringBone::new(2.0, 0.2);
    let mut cases: Vec<Case> = METHODS
        .iter()
        .map(|(_, steps, method)| {
            let mut state = state_at_angle(START_ANGLE, &drive);
            Case::new(1, move || advance_frame(*method, *steps, &bone, &mut state, &drive, 1.0 / 60.0))
        })
        .collect();
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    let mut choice = Choice::new("springs", "How is a spring bone stepped?");
    choice.error_unit = "rad";
    choice.reference =
        "a free swing from 1 rad for 2 s in closed form; 0.1–1000 Hz, damping ratio 0–10, 12–240 \
                        frames a second; π where it diverges"
            .into();
    choice.per = "frame of one bone".into();
    for (method_index, (name, ..)) in METHODS.iter().enumerate() {
        let row = Row::new(*name)
            .error(free[method_index].worst, free[method_index].mean())
            .nanos(nanos[method_index]);
        choice.rows.push(row.at(worst_at[method_index].1.clone()));
    }
    choice.choose(
        CHOSEN_METHOD,
        "exact at any frequency, damping and rate, and as cheap as one step of any other",
    );
    let table = |title: &str, what: &str, titles: Vec<String>, errors: &[Vec<ErrorStats>]| {
        let titles: Vec<String> = titles.iter().map(|t| format!(">{t}")).collect();
        let mut columns: Vec<(&str, &'static str)> = vec![(what, "way")];
        columns.extend(titles.iter().map(|t| (t.as_str(), "case")));
        let mut table = Table::new(title, &columns);
        for ((name, ..), errors) in METHODS.iter().zip(errors) {
            let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
            table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
        }
        table
    };
    let worst = "worst error in radians";
    Ok(Section {
        title: "Springs",
        text: "Hair and tails are oscillators of one to ten hertz, skirts of a hundred. Explicit steps \
               diverge, implicit ones are stable but wrong, and both give another motion at another frame \
               rate. The closed form computes each step exactly, whatever its length; the remaining error \
               of a moving character is that its pose is sampled 60 times a second. Along a chain each bone \
               follows the one before it and the motion of the character, and passes on no more swing than \
               it received: chains of any length converge, to first order under drag."
            .into(),
        choices: vec![choice],
        tables: vec![
            table(
                "By the frame rate",
                worst,
                FRAME_RATES.iter().map(|r| format!("{r} fps")).collect(),
                &by_rate,
            ),
            table(
                "By the frequency",
                worst,
                FREQUENCIES.iter().map(|f| format!("{f} Hz")).collect(),
                &by_frequency,
            ),
            table(
                "By the damping ratio",
                worst,
                DAMPING_RATIOS.iter().map(|z| format!("{z}")).collect(),
                &by_ratio,
            ),
            moving_target_table(),
            chains_table()?,
        ],
        off_front: Vec::new(),
    })
}

fn drive_at_rest() -> Drive {
    let zero = DVec3::ZERO;
    Drive {
        head: zero,
        follows: false,
        target: DVec3::NEG_Y,
        length: 0.2,
        gravity: zero,
        pull: zero,
        wind: zero,
    }
}

fn state_at_angle(angle: f64, drive: &Drive) -> BoneState {
    let direction = DVec3::new(libm::sin(angle), -libm::cos(angle), 0.0);
    BoneState {
        direction,
        velocity: DVec3::ZERO,
        head: drive.head,
        head_velocity: DVec3::ZERO,
        target: drive.target,
    }
}

/// One frame: every method integrates the same equation in the tangent plane, and moves along the same sphere.
fn advance_frame(
    method: Method,
    steps: u32,
    bone: &SpringBone,
    state: &mut BoneState,
    drive: &Drive,
    seconds: f64,
) {
    if method == Method::ClosedForm {
        bone.step(state, drive, seconds);
        return;
    }
    let h = seconds / f64::from(steps);
    let (k, c) = (bone.stiffness, bone.damping);
    let from = state.target;
    for step in 1..=steps {
        // The target moves linearly; each step uses the target at its end.
        let target = from.lerp(drive.target, f64::from(step) / f64::from(steps)).normalize();
        let bent = log(state.direction, target);
        let v = state.velocity;
        let rate = |u: DVec3, w: DVec3| (bent - u) * k - w * c;
        let (displacement, after) = match method {
            Method::Explicit => (v * h, v + rate(DVec3::ZERO, v) * h),
            Method::SemiImplicit => {
                let after = v + rate(DVec3::ZERO, v) * h;
                (after * h, after)
            }
            Method::Implicit => {
                let after = (v + bent * (k * h)) / (1.0 + c * h + k * h * h);
                (after * h, after)
            }
            _ => {
                let (u1, w1) = (v, rate(DVec3::ZERO, v));
                let (u2, w2) = (v + w1 * (h / 2.0), rate(u1 * (h / 2.0), v + w1 * (h / 2.0)));
                let (u3, w3) = (v + w2 * (h / 2.0), rate(u2 * (h / 2.0), v + w2 * (h / 2.0)));
                let (u4, w4) = (v + w3 * h, rate(u3 * h, v + w3 * h));
                ((u1 + (u2 + u3) * 2.0 + u4) * (h / 6.0), v + (w1 + (w2 + w3) * 2.0 + w4) * (h / 6.0))
            }
        };
        // A diverged spring is clamped to stay finite; its error counts as π.
        let displacement = displacement.clamp_length_max(1e6);
        (state.direction, state.velocity) = exp(state.direction, displacement, after.clamp_length_max(1e12));
    }
    (state.head, state.target) = (drive.head, drive.target);
}

/// Worst error of a free swing in radians, and its time in seconds.
fn free_swing(method: Method, steps: u32, frequency: f64, ratio: f64, rate: u32) -> (f64, f64) {
    let (bone, drive) = (SpringBone::new(frequency, ratio), drive_at_rest());
    let mut state = state_at_angle(START_ANGLE, &drive);
    let mut worst = (0.0, 0.0);
    for i in 1..=(SWING_SECS * f64::from(rate)) as u32 {
        advance_frame(method, steps, &bone, &mut state, &drive, 1.0 / f64::from(rate));
        let t = f64::from(i) / f64::from(rate);
        let angle = libm::atan2(state.direction.x, -state.direction.y);
        let difference = (angle - reference_angle(frequency, ratio, t)).abs();
        let difference =
            if difference.is_finite() && state.velocity.length() < 1e9 { difference.min(PI) } else { PI };
        if difference > worst.0 {
            worst = (difference, t);
        }
    }
    worst
}

/// Closed-form angle of a damped oscillator released from rest.
fn reference_angle(frequency: f64, ratio: f64, t: f64) -> f64 {
    let w = 2.0 * PI * frequency;
    let fall = libm::exp(-ratio * w * t);
    if ratio < 1.0 {
        let wd = w * (1.0 - ratio * ratio).sqrt();
        START_ANGLE * fall * (libm::cos(wd * t) + ratio * w / wd * libm::sin(wd * t))
    } else if ratio == 1.0 {
        START_ANGLE * fall * (1.0 + w * t)
    } else {
        let root = (ratio * ratio - 1.0).sqrt();
        let (a, b) = (-w / (ratio + root), -w * (ratio + root));
        START_ANGLE * (b * libm::exp(a * t) - a * libm::exp(b * t)) / (b - a)
    }
}

/// A moving target that is sampled at frames only; the reference uses a thousand times as many samples.
fn moving_target_table() -> Table {
    let target = |t: f64| {
        DQuat::from_rotation_z(0.6 * libm::sin(8.0 * t))
            * DQuat::from_rotation_x(0.4 * libm::cos(5.0 * t))
            * DVec3::NEG_Y
    };
    let run = |method: Method, steps: u32, bone: &SpringBone, rate: u32, every: u32| {
        let mut state = state_at_angle(0.0, &Drive { target: target(0.0), ..drive_at_rest() });
        let mut seen = Vec::new();
        for i in 1..=rate * 2 {
            let drive = Drive { target: target(f64::from(i) / f64::from(rate)), ..drive_at_rest() };
            advance_frame(method, steps, bone, &mut state, &drive, 1.0 / f64::from(rate));
            if i.is_multiple_of(every) {
                seen.push(state.direction);
            }
        }
        seen
    };
    let titles: Vec<String> = FRAME_RATES.iter().map(|r| format!(">{r} fps")).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in radians, 3 Hz, ratio 0.2", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "rate")));
    let mut table = Table::new("A moving character", &columns);
    let bone = SpringBone::new(3.0, 0.2);
    let truths: Vec<Vec<DVec3>> =
        FRAME_RATES.iter().map(|r| run(Method::ClosedForm, 1, &bone, r * 1000, 1000)).collect();
    for (name, steps, method) in METHODS {
        let mut cells = vec![Cell::text(name)];
        for (rate, truth) in FRAME_RATES.iter().zip(&truths) {
            let got = run(method, steps, &bone, *rate, 1);
            let difference = got.iter().zip(truth).map(|(a, b)| log(*a, *b).length()).fold(0.0, f64::max);
            let difference = if difference.is_finite() { difference } else { PI };
            cells.push(Cell::number(quantity(difference), difference));
        }
        table.rows.push(cells);
    }
    table
}

/// A tail with a shaking root: 60 and more steps per second, against 60,000.
fn chains_table() -> Result<Table, String> {
    const LENGTHS: [usize; 4] = [1, 4, 20, 100];
    const STEPS: [u32; 4] = [60, 120, 240, 480];
    let titles: Vec<String> = LENGTHS.iter().map(|n| format!(">{n} bones")).collect();
    let mut columns: Vec<(&str, &'static str)> =
        vec![("worst error of the tip in mm, bones of 5 cm, 2 Hz, ratio 0.4", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "bones")));
    let mut table = Table::new("Chains at a root that shakes by ±10 cm", &columns);
    let tips = |count: usize, rate: u32| -> Result<Vec<Vec3>, String> {
        let rest = |i: usize| Transform {
            translation: if i == 0 { Vec3::ZERO } else { Vec3::NEG_Y * 0.05 },
            ..Transform::IDENTITY
        };
        let names = (0..=count + 1).map(|i| i.to_string()).collect();
        let parents = (0..=count + 1).map(|i| i.checked_sub(1).map(|p| p as u32)).collect();
        let skeleton =
            Skeleton::new(names, parents, (0..=count + 1).map(rest).collect()).map_err(|e| e.to_string())?;
        let mut rig = SpringRig::default();
        for joint in 1..=count as u32 {
            rig.add(RigBone {
                joint,
                tail: Vec3::NEG_Y * 0.05,
                spring: SpringBone::new(2.0, 0.4),
                gravity: DVec3::NEG_Y * 9.81,
                pull: DVec3::ZERO,
                hit_radius: 0.0,
                center: None,
                colliders: Vec::new(),
            });
        }
        let model: Vec<Affine3A> =
            (0..=count + 1).map(|i| Affine3A::from_translation(Vec3::NEG_Y * 0.05 * i as f32)).collect();
        let (mut state, mut scratch, mut seen) =
            (SpringState::default(), SpringScratch::default(), Vec::new());
        for i in 0..=rate * 2 {
            let mut out = model.clone();
            let t = f64::from(i) / f64::from(rate);
            SpringStep {
                rig: &rig,
                skeleton: &skeleton,
                world_from_model: DAffine3::from_translation(DVec3::X * 0.1 * (1.0 - libm::cos(9.0 * t))),
                wind: DVec3::ZERO,
                seconds: 1.0 / f64::from(rate),
                state: &mut state,
                scratch: &mut scratch,
                model_from_joint: &mut out,
            }
            .run();
            if i.is_multiple_of(rate / 60) {
                seen.push(Vec3::from(out[count + 1].translation));
            }
        }
        Ok(seen)
    };
    let mut rows: Vec<Vec<Cell>> =
        STEPS.iter().map(|s| vec![Cell::text(format!("{s} steps a second"))]).collect();
    for count in LENGTHS {
        let truth = tips(count, 60_000)?;
        for (row, steps) in rows.iter_mut().zip(STEPS) {
            let got = tips(count, steps)?;
            let difference =
                got.iter().zip(&truth).map(|(a, b)| f64::from((*a - *b).length()) * 1e3).fold(0.0, f64::max);
            row.push(Cell::number(quantity(difference), difference));
        }
    }
    table.rows = rows;
    Ok(table)
}
