//! Interpolation of rotations between two keyframes.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity, time};
use choreo_bench::reference::{ErrorStats, angle_between};
use choreo_bench::rotation::{Eight, Interpolate, METHODS, Rotations, lane, rows, unit};
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_motion::{Clip, Curve, Interpolation, Level, Path, Pose, Sample, Time};
use glam::{DQuat, DVec3, Quat};
use std::sync::Arc;

const DEGREES_BETWEEN_KEYS: [f64; 8] = [1.0, 5.0, 10.0, 20.0, 45.0, 90.0, 135.0, 179.0];
const STEPS_PER_SPAN: usize = 64;
const AXIS_COUNT: usize = 12;
const CHOSEN_METHOD: &str = "Sample (power series, as many terms as the keys need)";
const SPLINE_METHOD: &str = "cubic spline with the true tangents";

pub(crate) fn section() -> Result<Section, String> {
    let names: Vec<&str> = METHODS.iter().map(|w| w.0).chain([SPLINE_METHOD, CHOSEN_METHOD]).collect();
    let mut by_degrees = vec![vec![ErrorStats::default(); DEGREES_BETWEEN_KEYS.len()]; names.len()];
    let mut all = vec![ErrorStats::default(); names.len()];
    let mut places = vec![String::new(); names.len()];
    for (d, degrees) in DEGREES_BETWEEN_KEYS.iter().enumerate() {
        let mut random = Random(7);
        for _ in 0..AXIS_COUNT {
            let turn = TestRotation { start: random.rotation(), axis: random.direction(), degrees: *degrees };
            let ours = turn.clip()?;
            for step in 1..STEPS_PER_SPAN {
                let t = step as f64 / STEPS_PER_SPAN as f64;
                let exact = turn.at(t);
                for method in 0..names.len() {
                    let got = match METHODS.get(method) {
                        Some((_, method)) => turn.between(*method, t),
                        None if names[method] == SPLINE_METHOD => turn.spline(t),
                        None => sample_clip(&ours, t),
                    };
                    let error = angle_between(got.as_dquat(), exact).to_degrees();
                    by_degrees[method][d].add(error);
                    if all[method].add(error) {
                        places[method] = format!("keys {degrees}° apart, {t:.2} of the way");
                    }
                }
            }
        }
    }
    let mut choice = Choice::new("rotation", "How is a rotation between two keys computed?");
    choice.error_unit = "°";
    choice.reference =
        "a turn at even speed about one axis, a closed form in f64; keys 1° to 179° apart".into();
    choice.per =
        "rotation, keys 30° apart; each way computes eight at once for one time, in the same portable \
         instructions"
            .into();
    let (nanos, best) = measure_times(&names)?;
    for (((name, error), place), nanos) in names.iter().zip(&all).zip(places).zip(nanos) {
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).at(place).nanos(nanos));
    }
    choice.choose(
        CHOSEN_METHOD,
        "as exact as f32 allows at any distance; joints that share key times share its coefficients",
    );
    let titles: Vec<String> = DEGREES_BETWEEN_KEYS.iter().map(|d| format!(">{d}°")).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in degrees, keys apart by", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "degrees")));
    let mut table = Table::new("By the distance of the keys", &columns);
    for (name, errors) in names.iter().zip(&by_degrees) {
        let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
        table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
    }
    let mut levels = Table::new(
        "The default, on the widest registers of this machine",
        &[("instructions", "level"), (">a rotation", "nanos")],
    );
    let portable = choice.rows[names.len() - 1].nanos.unwrap_or_default();
    levels.rows.push(vec![Cell::text("portable, as above"), time(portable)]);
    levels.rows.push(vec![Cell::text(format!("{:?}", Level::best())), time(best)]);
    Ok(Section {
        title: "Rotations between keys",
        text: "glTF asks for slerp. Files from capture have keys a few degrees apart, where every way is \
               good enough; hand-made clips have keys up to half a turn apart, where nlerp lags by up to \
               8°. The series needs more terms the wider its keys are, at most 26; a clip knows how far \
               apart its keys are, but two poses that are blended do not."
            .into(),
        choices: vec![choice],
        tables: vec![table, levels],
        off_front: vec![(
            "rotation",
            "every other way is exact only for keys near each other, or computes terms that these keys do \
             not need.",
        )],
    })
}

/// A rotation with constant angular velocity within one second.
struct TestRotation {
    start: DQuat,
    axis: DVec3,
    degrees: f64,
}

impl TestRotation {
    fn at(&self, t: f64) -> DQuat {
        DQuat::from_axis_angle(self.axis, self.degrees.to_radians() * t) * self.start
    }

    /// First and last rotation, in the same hemisphere.
    fn ends(&self) -> [Quat; 2] {
        let (a, b) = (self.at(0.0).as_quat(), self.at(1.0).as_quat());
        [a, if a.dot(b) < 0.0 { -b } else { b }]
    }

    /// Derivatives of the quaternion, ½ ω q, at both ends: the tangents of glTF's CUBICSPLINE.
    fn tangents(&self) -> [Quat; 2] {
        let omega = self.axis * (self.degrees.to_radians() * 0.5);
        let omega = DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0);
        [0.0, 1.0].map(|t| (omega * self.at(t)).as_quat())
    }

    fn between(&self, method: Interpolate, t: f64) -> Quat {
        let [a, b] = self.ends().map(|q| rows(&[q; 8]));
        lane(&method(&a, &b, t as f32), 0)
    }

    fn spline(&self, t: f64) -> Quat {
        let (a, b) = (self.at(0.0).as_quat(), self.at(1.0).as_quat());
        let [m0, m1] = self.tangents();
        lane(&spline(&[a, m0, b, m1].map(|q| rows(&[q; 8])), t as f32), 0)
    }

    /// A clip in which eight joints all make this rotation, from 0 s to 1 s.
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

fn sample_clip(clip: &Clip, t: f64) -> Quat {
    let mut pose = Pose::identity(8);
    Sample { clip, time: Time::from_secs(t), pose: &mut pose }.run();
    pose.get(0).rotation
}

/// glTF's CUBICSPLINE for eight rotations at once: value and tangent of the first and of the second keyframe.
fn spline([a, m0, b, m1]: &[Rotations; 4], t: f32) -> Rotations {
    let (t2, t3) = (t * t, t * t * t);
    let [of_a, of_m0] = [2.0 * t3 - 3.0 * t2 + 1.0, t3 - 2.0 * t2 + t];
    let [of_b, of_m1] = [3.0 * t2 - 2.0 * t3, t3 - t2];
    let row = |row: usize| -> Eight {
        std::array::from_fn(|i| {
            (a[row][i] * of_a + m0[row][i] * of_m0) + (b[row][i] * of_b + m1[row][i] * of_m1)
        })
    };
    unit(&std::array::from_fn(row))
}

/// Time of each method for keyframes 30° apart, as in fast parts of a clip with twelve poses per second; and time of [`CHOSEN_METHOD`] with the
/// widest registers.
fn measure_times(names: &[&str]) -> Result<(Vec<Nanos>, Nanos), String> {
    const PAIRS: usize = 256;
    const AT: f32 = 0.37;
    let mut random = Random(3);
    let turns: Vec<TestRotation> = (0..PAIRS)
        .map(|_| TestRotation { start: random.rotation(), axis: random.direction(), degrees: 30.0 })
        .collect();
    let eights = turns.as_chunks::<8>().0;
    let rows_of =
        |eight: &[TestRotation; 8], of: &dyn Fn(&TestRotation) -> Quat| rows(&eight.each_ref().map(of));
    let keys: Vec<[Rotations; 2]> =
        eights.iter().map(|eight| [0, 1].map(|end| rows_of(eight, &|turn| turn.ends()[end]))).collect();
    let splines: Vec<[Rotations; 4]> = eights
        .iter()
        .map(|eight| {
            [
                rows_of(eight, &|turn| turn.at(0.0).as_quat()),
                rows_of(eight, &|turn| turn.tangents()[0]),
                rows_of(eight, &|turn| turn.at(1.0).as_quat()),
                rows_of(eight, &|turn| turn.tangents()[1]),
            ]
        })
        .collect();
    let clip = clip_of_turns(&turns)?;
    let mut cases: Vec<Case> = Vec::new();
    for (_, method) in METHODS {
        let keys = &keys;
        let mut out = vec![[[0.0; 8]; 4]; keys.len()];
        cases.push(Case::new(PAIRS, move || {
            for ([a, b], out) in keys.iter().zip(&mut out) {
                *out = method(a, b, AT);
            }
            std::hint::black_box(&out);
        }));
    }
    let mut out = vec![[[0.0; 8]; 4]; splines.len()];
    let splines = &splines;
    cases.push(Case::new(PAIRS, move || {
        for (keys, out) in splines.iter().zip(&mut out) {
            *out = spline(keys, AT);
        }
        std::hint::black_box(&out);
    }));
    for level in [Level::Portable, Level::best()] {
        let (clip, mut pose) = (&clip, Pose::identity(PAIRS));
        cases.push(Case::new(PAIRS, move || {
            Sample { clip, time: Time::from_secs(f64::from(AT)), pose: &mut pose }.run_on(level);
            std::hint::black_box(&pose);
        }));
    }
    assert_eq!(cases.len(), names.len() + 1);
    let mut nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    let best = nanos.pop().unwrap_or_default();
    Ok((nanos, best))
}

/// A clip with one joint for each rotation.
fn clip_of_turns(turns: &[TestRotation]) -> Result<Clip, String> {
    let times: Arc<[Time]> = [Time::ZERO, Time::from_secs(1.0)].into();
    let curve = |(joint, turn): (usize, &TestRotation)| Curve {
        joint: joint as u32,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: times.clone(),
        values: [turn.at(0.0), turn.at(1.0)].iter().flat_map(|q| q.as_quat().to_array()).collect(),
    };
    Clip::new("turns".into(), turns.len(), turns.iter().enumerate().map(curve).collect())
        .map_err(|e| e.to_string())
}
