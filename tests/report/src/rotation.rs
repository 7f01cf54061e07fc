//! Rotations between two keys.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::rotation::{Interpolate, WAYS};
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_bench::truth::{Spread, angle_between};
use choreo_motion::{Clip, Curve, Interpolation, Path, Pose, Sample, Time};
use glam::{DQuat, DVec3, Quat};
use std::sync::Arc;

const DEGREES: [f64; 8] = [1.0, 5.0, 10.0, 20.0, 45.0, 90.0, 135.0, 179.0];
const STEPS: usize = 64;
const AXES: usize = 12;
const OURS: &str = "Sample (power series, 8 joints at once)";
const SPLINE: &str = "cubic spline with the true tangents";

pub fn section() -> Result<Section, String> {
    let names: Vec<&str> = WAYS.iter().map(|w| w.0).chain([SPLINE, OURS]).collect();
    let mut by_degrees = vec![vec![Spread::default(); DEGREES.len()]; names.len()];
    let mut all = vec![Spread::default(); names.len()];
    let mut places = vec![String::new(); names.len()];
    for (d, degrees) in DEGREES.iter().enumerate() {
        let mut random = Random(7);
        for _ in 0..AXES {
            let turn = Turn { start: random.rotation(), axis: random.direction(), degrees: *degrees };
            let ours = turn.clip()?;
            for step in 1..STEPS {
                let t = step as f64 / STEPS as f64;
                let exact = turn.at(t);
                for way in 0..names.len() {
                    let got = match WAYS.get(way) {
                        Some((_, way)) => turn.between(*way, t),
                        None if names[way] == SPLINE => turn.spline(t),
                        None => sampled(&ours, t),
                    };
                    let error = angle_between(got.as_dquat(), exact).to_degrees();
                    by_degrees[way][d].add(error);
                    if all[way].add(error) {
                        places[way] = format!("keys {degrees}° apart, {t:.2} of the way");
                    }
                }
            }
        }
    }
    let mut choice = Choice::new("rotation", "How is a rotation between two keys found?");
    choice.error_unit = "°";
    choice.reference =
        "a turn at even speed about one axis, a closed form in f64; keys 1° to 179° apart".into();
    choice.per = "rotation".into();
    let nanos = times(&names)?;
    for (((name, error), place), nanos) in names.iter().zip(&all).zip(places).zip(nanos) {
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).at(place).nanos(nanos));
    }
    choice.choose(
        OURS,
        "as exact as f32 allows at any distance; joints that share key times share its coefficients",
    );
    let titles: Vec<String> = DEGREES.iter().map(|d| format!(">{d}°")).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in degrees, keys apart by", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "degrees")));
    let mut table = Table::new("By the distance of the keys", &columns);
    for (name, errors) in names.iter().zip(&by_degrees) {
        let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
        table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
    }
    Ok(Section {
        title: "Rotations between keys",
        text: "glTF asks for slerp. Files from capture have keys a few degrees apart, where every way will do; hand-made clips have \
               keys up to half a turn apart, where nlerp lags by up to 8°. The series needs more terms the wider its keys are, at most 26."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: Vec::new(),
    })
}

/// A turn at even speed within one second.
struct Turn {
    start: DQuat,
    axis: DVec3,
    degrees: f64,
}

impl Turn {
    fn at(&self, t: f64) -> DQuat {
        DQuat::from_axis_angle(self.axis, self.degrees.to_radians() * t) * self.start
    }

    fn between(&self, way: Interpolate, t: f64) -> Quat {
        let (a, b) = (self.at(0.0).as_quat(), self.at(1.0).as_quat());
        way(a, if a.dot(b) < 0.0 { -b } else { b }, t as f32)
    }

    /// glTF's CUBICSPLINE, with the derivative of the quaternion, ½ ω q, as its tangents.
    fn spline(&self, t: f64) -> Quat {
        let omega = self.axis * (self.degrees.to_radians() * 0.5);
        let tangent = |q: DQuat| (DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0) * q).as_quat();
        let (a, b) = (self.at(0.0), self.at(1.0));
        let (m0, m1) = (tangent(a), tangent(b));
        let (a, b) = (a.as_quat(), b.as_quat());
        let t = t as f32;
        let (t2, t3) = (t * t, t * t * t);
        let q = a * (2.0 * t3 - 3.0 * t2 + 1.0)
            + m0 * (t3 - 2.0 * t2 + t)
            + b * (3.0 * t2 - 2.0 * t3)
            + m1 * (t3 - t2);
        q.normalize()
    }

    /// Eight joints that all turn so, from 0 s to 1 s.
    fn clip(&self) -> Result<Clip, String> {
        let times: Arc<[Time]> = [Time::ZERO, Time::from_secs(1.0)].into();
        let values: Vec<f32> =
            [self.at(0.0), self.at(1.0)].iter().flat_map(|q| q.as_quat().to_array()).collect();
        let curve = |joint| Curve {
            joint,
            path: Path::Rotation,
            interpolation: Interpolation::Linear,
            times: times.clone(),
            values: values.clone().into(),
        };
        Clip::new("turn".into(), 8, (0..8).map(curve).collect()).map_err(|e| e.to_string())
    }
}

fn sampled(clip: &Clip, t: f64) -> Quat {
    let mut pose = Pose::identity(8);
    Sample { clip, time: Time::from_secs(t), pose: &mut pose }.run();
    pose.get(0).rotation
}

/// Keys 30° apart, as a clip of twelve poses a second has them in quick parts.
fn times(names: &[&str]) -> Result<Vec<Nanos>, String> {
    const PAIRS: usize = 256;
    let mut random = Random(3);
    let turns: Vec<Turn> = (0..PAIRS)
        .map(|_| Turn { start: random.rotation(), axis: random.direction(), degrees: 30.0 })
        .collect();
    let keys: Vec<(Quat, Quat, f32)> = turns
        .iter()
        .map(|turn| {
            let (a, b) = (turn.at(0.0).as_quat(), turn.at(1.0).as_quat());
            (a, if a.dot(b) < 0.0 { -b } else { b }, random.unit() as f32)
        })
        .collect();
    let clip = many(&turns)?;
    let mut pose = Pose::identity(PAIRS);
    let mut cases: Vec<Case> = Vec::new();
    for (_, way) in WAYS {
        let keys = &keys;
        cases.push(Case::new(PAIRS, move || {
            for (a, b, t) in keys {
                std::hint::black_box(way(*a, *b, *t));
            }
        }));
    }
    let turns = &turns;
    let tangents: Vec<(Quat, Quat)> = turns
        .iter()
        .map(|turn| {
            let omega = turn.axis * (turn.degrees.to_radians() * 0.5);
            let tangent = |q: DQuat| (DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0) * q).as_quat();
            (tangent(turn.at(0.0)), tangent(turn.at(1.0)))
        })
        .collect();
    let keys = &keys;
    cases.push(Case::new(PAIRS, move || {
        for ((a, b, t), (m0, m1)) in keys.iter().zip(&tangents) {
            let (t2, t3) = (t * t, t * t * t);
            let q = *a * (2.0 * t3 - 3.0 * t2 + 1.0)
                + *m0 * (t3 - 2.0 * t2 + t)
                + *b * (3.0 * t2 - 2.0 * t3)
                + *m1 * (t3 - t2);
            std::hint::black_box(q.normalize());
        }
    }));
    cases.push(Case::new(PAIRS, move || {
        Sample { clip: &clip, time: Time::from_secs(0.37), pose: &mut pose }.run();
        std::hint::black_box(&pose);
    }));
    assert_eq!(cases.len(), names.len());
    Ok(interleaved(Clock::Thread, BUDGET_SECS, &mut cases))
}

/// A joint for each turn.
fn many(turns: &[Turn]) -> Result<Clip, String> {
    let times: Arc<[Time]> = [Time::ZERO, Time::from_secs(1.0)].into();
    let curve = |(joint, turn): (usize, &Turn)| Curve {
        joint: joint as u32,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: times.clone(),
        values: [turn.at(0.0), turn.at(1.0)].iter().flat_map(|q| q.as_quat().to_array()).collect(),
    };
    Clip::new("turns".into(), turns.len(), turns.iter().enumerate().map(curve).collect())
        .map_err(|e| e.to_string())
}
