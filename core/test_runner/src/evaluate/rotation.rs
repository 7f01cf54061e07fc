//! Judges rotations over time by their error in degrees.

use super::Judgment;
use super::band::{Band, Series, judge_band};
use super::judge_error::JudgeError;
use super::snapshot_cache::{SnapshotCache, angle_deg, rotation_of};
use super::text_format::{self, number_with_unit, tolerance_ratio};
use super::vector::subject_name;
use choreo_motion::Time;
use choreo_script::testing::{Expectation, RotationGoal, RotationQuantity};
use glam::{DQuat, EulerRot};

pub(super) fn label(snapshots: &SnapshotCache, quantity: &RotationQuantity) -> String {
    let RotationQuantity::Of(subject, _) = quantity;
    format!("{} rotation", subject_name(snapshots, *subject))
}

pub(super) fn rotation_at(
    snapshots: &mut SnapshotCache,
    quantity: &RotationQuantity,
    time: Time,
) -> Result<DQuat, JudgeError> {
    let RotationQuantity::Of(subject, relative_to) = quantity;
    let world = snapshots.world_from_subject(*subject, time)?;
    if world.translation.is_nan() {
        return Ok(DQuat::from_xyzw(f64::NAN, f64::NAN, f64::NAN, f64::NAN));
    }
    let rotation = rotation_of(&world.matrix3);
    Ok(match relative_to {
        None => rotation,
        Some(to) => rotation_of(&snapshots.world_from_attachment(to, time)?.matrix3).conjugate() * rotation,
    })
}

/// Rotation from Euler angles in degrees, applied about x, then y, then z, as in `.rotate`.
fn from_euler(degrees: [f64; 3]) -> DQuat {
    let [x, y, z] = degrees.map(|d| (d % 360.0).to_radians());
    DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
}

fn euler_text(q: DQuat) -> String {
    if q.is_nan() {
        return "nothing".into();
    }
    let (z, y, x) = q.to_euler(EulerRot::ZYX);
    // Rounded, so that −0 and values such as 1e-15 are not printed.
    let degrees = [x, y, z].map(|a| text_format::number((a.to_degrees() * 1e3).round() / 1e3 + 0.0));
    format!("[{}]°", degrees.join(", "))
}

pub(super) fn judge(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &RotationQuantity,
    goal: &RotationGoal,
    tolerance_deg: f64,
) -> Judgment {
    let label = label(snapshots, quantity);
    match try_judge(snapshots, e, quantity, goal, tolerance_deg, &label) {
        Ok(judged) => judged,
        Err(why) => Judgment::impossible(format!("{label} to be known"), why),
    }
}

fn try_judge(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &RotationQuantity,
    goal: &RotationGoal,
    tolerance_deg: f64,
    label: &str,
) -> Result<Judgment, JudgeError> {
    let times = snapshots.times_and_ends(e)?;
    let (mut got, mut goals) = (Vec::new(), Vec::new());
    for time in &times {
        got.push(rotation_at(snapshots, quantity, *time)?);
        goals.push(match goal {
            RotationGoal::Rotation(q) => *q,
            RotationGoal::Subject(other) => {
                let RotationQuantity::Of(_, relative_to) = quantity;
                rotation_at(snapshots, &RotationQuantity::Of(*other, *relative_to), *time)?
            }
            RotationGoal::Formula(formula) => {
                let v = formula.at(*time).map_err(JudgeError::Formula)?;
                match v[..] {
                    [y] => from_euler([0.0, y, 0.0]),
                    [x, y, z] => from_euler([x, y, z]),
                    _ => DQuat::from_xyzw(f64::NAN, f64::NAN, f64::NAN, f64::NAN),
                }
            }
        });
    }
    let values: Vec<f64> = got.iter().zip(&goals).map(|(a, b)| angle_deg(*a, *b)).collect();
    let distances = values.iter().map(|v| v - tolerance_deg).collect();
    let allowed = vec![[0.0, tolerance_deg]; values.len()];
    let series = Series { times, values };
    let band =
        Band { allowed, distances, expected_curve: Vec::new(), tolerance: 0.0, description: String::new() };
    let mut judged = judge_band(&series, &band, e, &format!("{label}, off by"), "°");
    let worst = judged.traces.first().and_then(|trace| trace.mark).unwrap_or(0.0);
    let Some(i) = series.times.iter().position(|t| t.as_secs() == worst) else { return Ok(judged) };
    let when = judged.got.split_once(" at ").map_or(String::new(), |(_, when)| format!(" at {when}"));
    judged.got = format!("{}{when}", euler_text(got[i]));
    let not = if e.negated { "not " } else { "" };
    judged.expected = format!("{not}{} ± {}", euler_text(goals[i]), number_with_unit(tolerance_deg, "°"));
    if !judged.passed && !e.negated && series.values[i].is_finite() {
        let off = series.values[i];
        judged.by = format!("{}{}", number_with_unit(off, "°"), tolerance_ratio(off, tolerance_deg));
    }
    Ok(judged)
}
