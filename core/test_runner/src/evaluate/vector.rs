//! Judges points, directions and colors over time.

use super::band::{Band, Series, judge_band};
use super::judge_error::JudgeError;
use super::number::target_position;
use super::snapshot_cache::{SnapshotCache, rotation_of};
use super::text_format::{self, number_with_unit, tolerance_ratio};
use super::{Judgment, frame};
use crate::outcome::Trace;
use choreo_motion::Time;
use choreo_script::testing::{Expectation, Subject, VectorGoal, VectorQuantity, VectorTest, When};
use glam::DVec3;

pub(super) fn unit(quantity: &VectorQuantity) -> &'static str {
    match quantity {
        VectorQuantity::Position(..) | VectorQuantity::Size(_) => "m",
        _ => "",
    }
}

/// Name of a subject in messages: `anna`, `anna Head`, `camera wide`, `light 0`.
pub(super) fn subject_name(snapshots: &SnapshotCache, subject: Subject) -> String {
    let stage = &snapshots.stage;
    match subject {
        Subject::Actor(actor) => stage.actors.get(actor).map_or("an actor".into(), |a| a.name.clone()),
        Subject::Joint { actor, joint } => match stage.actors.get(actor) {
            Some(a) => {
                let joint = a.asset.skeleton.names().get(joint as usize).map_or("", String::as_str);
                format!("{} {joint}", a.name)
            }
            None => "a joint".into(),
        },
        Subject::Camera(camera) => {
            format!("camera {}", stage.cameras.get(camera).map_or("", |c| c.name.as_str()))
        }
        Subject::Light(light) => format!("light {light}"),
    }
}

pub(super) fn label(snapshots: &SnapshotCache, quantity: &VectorQuantity) -> String {
    let (subject, what) = match quantity {
        VectorQuantity::Position(subject, _) => (*subject, ""),
        VectorQuantity::Scale(subject) => (*subject, " scale"),
        VectorQuantity::Direction(subject) => (*subject, " direction"),
        VectorQuantity::Tint(actor) => (Subject::Actor(*actor), " tint"),
        VectorQuantity::LightColor(light) => (Subject::Light(*light), " color"),
        VectorQuantity::Size(actor) => (Subject::Actor(*actor), " size"),
        VectorQuantity::InImage(subject, _) => (*subject, " in the image"),
    };
    format!("{}{what}", subject_name(snapshots, subject))
}

pub(super) fn vector_at(
    snapshots: &mut SnapshotCache,
    quantity: &VectorQuantity,
    time: Time,
) -> Result<DVec3, JudgeError> {
    Ok(match quantity {
        VectorQuantity::Position(subject, relative_to) => {
            let place = snapshots.world_from_subject(*subject, time)?.translation;
            match relative_to {
                None => place,
                Some(to) => snapshots.world_from_attachment(to, time)?.inverse().transform_point3(place),
            }
        }
        VectorQuantity::Scale(subject) => {
            let m = snapshots.world_from_subject(*subject, time)?.matrix3;
            DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
        }
        VectorQuantity::Direction(subject) => {
            let rotation = rotation_of(&snapshots.world_from_subject(*subject, time)?.matrix3);
            rotation
                * match subject {
                    Subject::Camera(_) | Subject::Light(_) => DVec3::NEG_Z,
                    Subject::Actor(actor) => {
                        let actor = snapshots.stage.actors.get(*actor);
                        actor.map_or(DVec3::Z, |actor| actor.asset.front().rotation() * DVec3::Z)
                    }
                    Subject::Joint { .. } => DVec3::Z,
                }
        }
        VectorQuantity::Tint(actor) => match snapshots.at(time)?.actors.get(*actor) {
            Some(state) => state.tint.truncate().as_dvec3(),
            None => DVec3::NAN,
        },
        VectorQuantity::LightColor(light) => {
            snapshots.light_state(*light, time)?.map_or(DVec3::NAN, |state| state.light.color.as_dvec3())
        }
        VectorQuantity::Size(actor) => {
            let (min, max) = frame::posed_bounds(snapshots, *actor, time)?;
            max - min
        }
        VectorQuantity::InImage(subject, camera) => {
            if is_own_camera(snapshots, *subject, *camera, time)? {
                return Ok(DVec3::NAN);
            }
            let place = snapshots.world_from_subject(*subject, time)?.translation;
            frame::CameraView::new(snapshots, *camera, time)?.project(place)
        }
    })
}

/// Whether a subject is the camera that draws the image. Its position in its own image is undefined. `None` stands for the active camera.
fn is_own_camera(
    snapshots: &mut SnapshotCache,
    subject: Subject,
    camera: Option<usize>,
    time: Time,
) -> Result<bool, JudgeError> {
    let Subject::Camera(own) = subject else { return Ok(false) };
    let camera_of_image = match camera {
        None => snapshots.at(time)?.camera.camera,
        given => given,
    };
    Ok(camera_of_image == Some(own))
}

/// Reason why a quantity has no value at a time.
pub(crate) fn reason_for_no_value(
    snapshots: &mut SnapshotCache,
    quantity: &VectorQuantity,
    time: Time,
) -> Result<String, JudgeError> {
    if let VectorQuantity::InImage(subject, camera) = quantity {
        if is_own_camera(snapshots, *subject, *camera, time)? {
            return Ok(format!(
                "{} is the camera of this image, so it has no position in it; name another camera: \
                 in_picture(camera)",
                subject_name(snapshots, *subject)
            ));
        }
        if snapshots.world_from_subject(*subject, time)?.translation.is_finite() {
            return Ok("at this time it is behind the camera".into());
        }
    }
    Ok("at this time it is hidden, or is a light that is off".into())
}

pub(super) fn judge(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &VectorQuantity,
    test: &VectorTest,
) -> Judgment {
    let label = label(snapshots, quantity);
    match try_judge(snapshots, e, quantity, test, &label) {
        Ok(judged) => judged,
        Err(why) => Judgment::impossible(format!("{label} to be known"), why),
    }
}

fn try_judge(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &VectorQuantity,
    test: &VectorTest,
    label: &str,
) -> Result<Judgment, JudgeError> {
    let unit = unit(quantity);
    let times = snapshots.times_and_ends(e)?;
    let got = vectors_at(snapshots, quantity, &times)?;
    // Distance to the goal, and lowest and highest allowed point, at each time.
    let (distances, goals, tolerance, expected): (Vec<f64>, Vec<[DVec3; 2]>, f64, String) = match test {
        VectorTest::Near { goal, tolerance } => {
            let goals = times
                .iter()
                .map(|t| goal_at(snapshots, quantity, goal, *t))
                .collect::<Result<Vec<DVec3>, JudgeError>>()?;
            let off = got.iter().zip(&goals).map(|(g, goal)| g.distance(*goal)).collect();
            let shown = match goal {
                VectorGoal::Point(point) => text_format::point(*point),
                VectorGoal::Formula(_) => "the function".into(),
                VectorGoal::Subject(subject) => subject_name(snapshots, *subject),
                VectorGoal::Target(_) => "its target".into(),
            };
            let expected = format!("{shown} ± {}", number_with_unit(*tolerance, unit));
            (off, goals.iter().map(|g| [*g, *g]).collect(), *tolerance, expected)
        }
        VectorTest::Within { min, max } => {
            let off = got.iter().map(|g| (*g - g.clamp(*min, *max)).length()).collect();
            let expected = format!("{} to {}", text_format::point(*min), text_format::point(*max));
            (off, vec![[*min, *max]; times.len()], 0.0, expected)
        }
    };
    let series = Series { times, values: distances };
    let band = Band {
        allowed: vec![[f64::NEG_INFINITY, tolerance]; series.values.len()],
        distances: series.values.iter().map(|d| d - tolerance).collect(),
        expected_curve: Vec::new(),
        tolerance: 0.0,
        description: expected.clone(),
    };
    let mut judged = judge_band(&series, &band, e, label, unit);
    let worst = judged.traces.first().and_then(|trace| trace.mark).unwrap_or(0.0);
    let Some(i) = series.times.iter().position(|t| t.as_secs() == worst) else { return Ok(judged) };
    // The text shows the point itself instead of the distance.
    let when = judged.got.split_once(" at ").map_or(String::new(), |(_, when)| format!(" at {when}"));
    let point = text_format::point(got[i]);
    let unit_word = if unit.is_empty() || got[i].is_nan() { String::new() } else { format!(" {unit}") };
    judged.got = format!("{point}{unit_word}{when}");
    let goal_varies = matches!(
        test,
        VectorTest::Near {
            goal: VectorGoal::Subject(_) | VectorGoal::Target(_) | VectorGoal::Formula(_),
            ..
        }
    );
    if goal_varies && !judged.passed {
        judged.expected = format!("{}, there {}", judged.expected, text_format::point(goals[i][0]));
    }
    if !judged.passed && !e.negated && series.values[i].is_finite() {
        let off = series.values[i];
        judged.by = format!("{}{}", number_with_unit(off, unit), tolerance_ratio(off, tolerance));
    }
    if !judged.passed {
        judged.traces =
            component_traces(snapshots, e, quantity, &series.times, &got, &goals, tolerance, label, worst);
        if got[i].is_nan() {
            judged.hint = reason_for_no_value(snapshots, quantity, series.times[i])?;
        }
    }
    Ok(judged)
}

fn vectors_at(
    snapshots: &mut SnapshotCache,
    quantity: &VectorQuantity,
    times: &[Time],
) -> Result<Vec<DVec3>, JudgeError> {
    times.iter().map(|t| vector_at(snapshots, quantity, *t)).collect()
}

fn goal_at(
    snapshots: &mut SnapshotCache,
    quantity: &VectorQuantity,
    goal: &VectorGoal,
    time: Time,
) -> Result<DVec3, JudgeError> {
    match goal {
        VectorGoal::Point(point) => Ok(*point),
        VectorGoal::Target(target) => target_position(snapshots, target, time),
        // The same quantity of the other subject, or its position if it does not have that quantity.
        VectorGoal::Subject(other) => {
            let same_quantity = match quantity {
                VectorQuantity::Position(_, to) => VectorQuantity::Position(*other, *to),
                VectorQuantity::Scale(_) => VectorQuantity::Scale(*other),
                VectorQuantity::Direction(_) => VectorQuantity::Direction(*other),
                VectorQuantity::InImage(_, camera) => VectorQuantity::InImage(*other, *camera),
                VectorQuantity::Size(_) => match other {
                    Subject::Actor(actor) => VectorQuantity::Size(*actor),
                    _ => VectorQuantity::Position(*other, None),
                },
                VectorQuantity::Tint(_) | VectorQuantity::LightColor(_) => {
                    VectorQuantity::Position(*other, None)
                }
            };
            vector_at(snapshots, &same_quantity, time)
        }
        VectorGoal::Formula(formula) => {
            let v = formula.at(time).map_err(JudgeError::Formula)?;
            Ok(match v[..] {
                [x, y, z] => DVec3::new(x, y, z),
                _ => DVec3::NAN,
            })
        }
    }
}

/// Plots of the components x, y and z, each with its allowed range where it has one.
#[allow(clippy::too_many_arguments, reason = "there is one call, and its arguments do not belong together")]
fn component_traces(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &VectorQuantity,
    times: &[Time],
    got: &[DVec3],
    goals: &[[DVec3; 2]],
    tolerance: f64,
    label: &str,
    mark: f64,
) -> Vec<Trace> {
    // A failure at a single time shows the values before and after it too, without an allowed range.
    let half = Time::from_secs(0.5);
    let (mut all, mut points_of, mut allowed) = (times.to_vec(), got.to_vec(), goals.to_vec());
    if let When::At(time) = e.when {
        let wide = Expectation { when: When::During(time - half, time + half), ..e.clone() };
        if let Ok(around) = snapshots.times(&wide)
            && let Ok(near) = vectors_at(snapshots, quantity, &around)
        {
            for (t, point) in around.into_iter().zip(near) {
                let i = all.partition_point(|known| *known < t);
                if all.get(i) != Some(&t) {
                    all.insert(i, t);
                    points_of.insert(i, point);
                    allowed.insert(i, [DVec3::NAN; 2]);
                }
            }
        }
    }
    let exact = allowed.iter().all(|[a, b]| a == b || a.is_nan());
    let trace = |axis: usize| Trace {
        label: format!("{label} {}", ["x", "y", "z"][axis]),
        unit: unit(quantity).to_string(),
        times: all.iter().map(|t| t.as_secs()).collect(),
        got: points_of.iter().map(|p| p[axis]).collect(),
        expected: if exact { allowed.iter().map(|[a, _]| a[axis]).collect() } else { Vec::new() },
        band: allowed.iter().map(|[a, b]| [a[axis] - tolerance, b[axis] + tolerance]).collect(),
        mark: Some(mark),
    };
    (0..3).map(trace).collect()
}
