//! Interpolation of keyframes on the stage: tangents of cubic curves.

use crate::{BUDGET_SECS, Random, Section, key_weights};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_motion::Time;
use choreo_stage::Tangents;
use std::f64::consts::TAU;

const CHOSEN_METHOD: &str = "\"cubic\": limited by the changes beside the key, positions as vectors";
const CATMULL_ROM: &str = "\"catmull_rom\": the parabola through the neighbors";
const METHODS: [(&str, TangentMethod); 4] = [
    (CHOSEN_METHOD, |times, values| same_tangent_on_both_sides(Tangents::Limited.of(times, values, true))),
    (CATMULL_ROM, |times, values| same_tangent_on_both_sides(Tangents::CatmullRom.of(times, values, true))),
    ("Fritsch–Carlson, each component", |times, values| {
        same_tangent_on_both_sides(fritsch_carlson_tangents(times, values))
    }),
    ("centripetal Catmull–Rom", centripetal_tangents),
];
/// Number of steps in which a curve between two keyframes is sampled.
const STEPS_PER_SPAN: u32 = 64;

type Values = Vec<Vec<f64>>;
/// Computes tangents per second, incoming and outgoing, for each keyframe.
type TangentMethod = fn(&[Time], &[Vec<f64>]) -> [Values; 2];

/// Reference motion in metres, and the times of its keyframes in seconds.
struct Reference {
    name: &'static str,
    at: fn(f64) -> Vec<f64>,
    times: Vec<f64>,
}

pub(crate) fn section() -> Result<Section, String> {
    let references = references();
    let mut all = vec![ErrorStats::default(); METHODS.len()];
    let mut places = vec![String::new(); METHODS.len()];
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in mm", "way")];
    columns.extend(references.iter().map(|r| (r.name, "mm")));
    let mut by_motion = Table::new("By the motion", &columns);
    for (method, (name, tangents)) in METHODS.iter().enumerate() {
        let mut cells = vec![Cell::text(*name)];
        for reference in &references {
            let mut own = ErrorStats::default();
            for (secs, value) in sample_curve(*tangents, reference) {
                let exact = (reference.at)(secs);
                let difference: f64 = value.iter().zip(exact).map(|(a, b)| (a - b) * (a - b)).sum();
                own.add(difference.sqrt() * 1e3);
                if all[method].add(difference.sqrt() * 1e3) {
                    places[method] = format!("{}, {secs:.2} s", reference.name.trim_start_matches('>'));
                }
            }
            cells.push(Cell::number(quantity(own.worst), own.worst));
        }
        by_motion.rows.push(cells);
    }
    let mut choice = Choice::new("keys", "How are values interpolated between \"cubic\" keys?");
    choice.error_unit = "mm";
    choice.reference =
        "a circle of 1 m radius in 4 s, a camera on a dolly with a crane, a swing that decays; closed forms"
            .into();
    choice.per = "key".into();
    for (method, nanos) in measure_times().into_iter().enumerate() {
        let (worst, mean) = (all[method].worst, all[method].mean());
        choice
            .rows
            .push(Row::new(METHODS[method].0).error(worst, mean).at(places[method].clone()).nanos(nanos));
    }
    choice.choose(
        CHOSEN_METHOD,
        "follows smooth motions like the plain spline, and short gaps cause no overshoot",
    );
    let (weights, by_weights) = key_weights::measure_part_counts()?;
    let reason = "it costs nanoseconds once for each key of a script, and is the only one without faults in either table";
    let longer = "more parts are sampled as fast, but take more memory, only to reduce an invisible error";
    Ok(Section {
        title: "Stage keys",
        text: "The parabola through a key and its neighbors follows smooth motions best, but where two keys lie close together its tangent grows \
               as 1 / gap. Limited component by component (monotone cubics), a circle is flattened wherever x or y turns. Centripetal splines \
               keep the shape of a path, but the times of keys are given, and where the gaps differ the \
               speed jumps at the key. Limited as one vector, by the changes before and after the key only, \
               a position is as exact as with the parabola; a single number becomes monotone. Where \
               tangents have weights, the time is a cubic of the curve's parameter, which is stored as \
               short Hermite spans."
            .into(),
        choices: vec![choice, weights],
        tables: vec![by_motion, faults_table(), by_weights],
        off_front: vec![("keys", reason), ("key_weights", longer)],
    })
}

fn references() -> Vec<Reference> {
    let even = |count: i32| (0..=count).map(|i| 8.0 * f64::from(i) / f64::from(count)).collect::<Vec<f64>>();
    let mut random = Random(5);
    let mut uneven = |count: i32| {
        let gaps: Vec<f64> = (0..count).map(|_| 1.0 + 0.6 * random.signed()).collect();
        let (mut at, whole) = (0.0, gaps.iter().sum::<f64>());
        let ends = gaps.iter().map(|gap| {
            at += gap;
            8.0 * at / whole
        });
        std::iter::once(0.0).chain(ends).collect::<Vec<f64>>()
    };
    let circle = |t: f64| {
        let (sin, cos) = libm::sincos(0.3 + TAU * t / 4.0);
        vec![cos, sin]
    };
    let camera = |t: f64| {
        let s = t / 8.0;
        let ease = s * s * (3.0 - 2.0 * s);
        vec![6.0 * ease, 1.5 + 0.4 * libm::sin(1.3 * TAU * s), 4.0 - 3.0 * ease * ease]
    };
    let swing = |t: f64| vec![libm::exp(-0.4 * t) * libm::sin(3.0 * t)];
    let reference = |name, at, times| Reference { name, at, times };
    vec![
        reference(">circle, 8 keys", circle, even(16)),
        reference(">circle, uneven keys", circle, uneven(16)),
        reference(">camera, 8 keys", camera, even(8)),
        reference(">camera, uneven keys", camera, uneven(8)),
        reference(">swing, 16 keys", swing, even(16)),
    ]
}

/// Times and values of a curve through the keyframes of a motion. Two spans at each end are left out, because curves come to rest there.
fn sample_curve(method: TangentMethod, reference: &Reference) -> Vec<(f64, Vec<f64>)> {
    let times: Vec<Time> = reference.times.iter().map(|t| Time::from_secs(*t)).collect();
    let values: Values = reference.times.iter().map(|t| (reference.at)(*t)).collect();
    let tangents = method(&times, &values);
    let spans = 3..times.len() - 2;
    let steps = spans.flat_map(|key| {
        (0..STEPS_PER_SPAN).map(move |step| (key, f64::from(step) / f64::from(STEPS_PER_SPAN)))
    });
    let at = |(key, s): (usize, f64)| {
        let secs = reference.times[key - 1] + s * (reference.times[key] - reference.times[key - 1]);
        (secs, hermite(&times, &values, &tangents, key, s))
    };
    steps.map(at).collect()
}

/// Cubic Hermite interpolation at the fraction `s` of the span that ends at `key`.
fn hermite(times: &[Time], values: &[Vec<f64>], [into, out]: &[Values; 2], key: usize, s: f64) -> Vec<f64> {
    let span = (times[key] - times[key - 1]).as_secs();
    let (s2, s3) = (s * s, s * s * s);
    let component = |n: usize| {
        (2.0 * s3 - 3.0 * s2 + 1.0) * values[key - 1][n]
            + span * (s3 - 2.0 * s2 + s) * out[key - 1][n]
            + (3.0 * s2 - 2.0 * s3) * values[key][n]
            + span * (s3 - s2) * into[key][n]
    };
    (0..values[key].len()).map(component).collect()
}

/// Effects of a short gap between keyframes: overshoot beyond their range, and change of speed at a keyframe.
fn faults_table() -> Table {
    const GAPS: [(f64, &str); 3] = [(0.1, ">gap of 0.1 s"), (1e-3, ">gap of 1 ms"), (1e-6, ">gap of 1 µs")];
    let mut columns: Vec<(&str, &'static str)> = vec![("overshoot of 0, 1, 2, 3 m", "way")];
    columns.extend(GAPS.iter().map(|(_, title)| (*title, "m")));
    columns.extend([(">corner in 1 ms", "m"), (">jump of speed, uneven circle", "m/s")]);
    let mut table = Table::new("Effect of short and uneven gaps", &columns);
    for (name, method) in METHODS {
        let mut numbers: Vec<f64> =
            GAPS.iter().map(|(gap, _)| overshoot(method, *gap, value_on_line)).collect();
        numbers.push(overshoot(method, 1e-3, |i| vec![[0.0, 1.0, 1.0, 2.0][i], [0.0, 0.0, 1.0, 1.0][i]]));
        let uneven = &references()[1];
        let times: Vec<Time> = uneven.times.iter().map(|t| Time::from_secs(*t)).collect();
        let values: Values = uneven.times.iter().map(|t| (uneven.at)(*t)).collect();
        let [into, out] = method(&times, &values);
        let jumps = into.iter().zip(&out).map(|(i, o)| (i[0] - o[0]).hypot(i[1] - o[1]));
        numbers.push(jumps.fold(0.0, f64::max));
        let cells = numbers.into_iter().map(|n| Cell::number(quantity(n), n));
        table.rows.push([Cell::text(name)].into_iter().chain(cells).collect());
    }
    table
}

fn value_on_line(key: usize) -> Vec<f64> {
    vec![key as f64]
}

/// Largest overshoot of a component beyond the range of its two keyframes; keyframes are one second apart, except for the gap in the
/// middle.
fn overshoot(method: TangentMethod, gap: f64, value: fn(usize) -> Vec<f64>) -> f64 {
    let times = [0.0, 1.0, 1.0 + gap, 2.0 + gap].map(Time::from_secs);
    let values: Values = (0..4).map(value).collect();
    let tangents = method(&times, &values);
    let mut worst: f64 = 0.0;
    for key in 1..4 {
        for step in 0..=STEPS_PER_SPAN {
            let at = hermite(&times, &values, &tangents, key, f64::from(step) / f64::from(STEPS_PER_SPAN));
            for (n, value) in at.into_iter().enumerate() {
                let (a, b) = (values[key - 1][n], values[key][n]);
                worst = worst.max(a.min(b) - value).max(value - a.max(b));
            }
        }
    }
    worst
}

fn same_tangent_on_both_sides(tangents: Values) -> [Values; 2] {
    [tangents.clone(), tangents]
}

/// Fritsch and Carlson 1980, "Monotone piecewise cubic interpolation", §3 and §4, starting from the tangents of the parabola.
fn fritsch_carlson_tangents(times: &[Time], values: &[Vec<f64>]) -> Values {
    let mut tangents = Tangents::CatmullRom.of(times, values, false);
    let width = values.first().map_or(0, Vec::len);
    for n in 0..width {
        let change =
            |key: usize| (values[key + 1][n] - values[key][n]) / (times[key + 1] - times[key]).as_secs();
        for (key, tangent) in tangents.iter_mut().enumerate().take(times.len() - 1).skip(1) {
            if change(key - 1) * change(key) <= 0.0 {
                tangent[n] = 0.0;
            }
        }
        for key in 0..times.len() - 1 {
            let (a, b) = (tangents[key][n] / change(key), tangents[key + 1][n] / change(key));
            if change(key) != 0.0 && a.hypot(b) > 3.0 {
                tangents[key][n] *= 3.0 / a.hypot(b);
                tangents[key + 1][n] *= 3.0 / a.hypot(b);
            }
        }
    }
    tangents
}

/// Centripetal parametrization: knot distances are the square roots of the distances of keyframes (Yuksel, Schaefer and Keyser 2011),
/// mapped to the given times.
fn centripetal_tangents(times: &[Time], values: &[Vec<f64>]) -> [Values; 2] {
    let knots = |key: usize| {
        let squares = values[key].iter().zip(&values[key + 1]).map(|(a, b)| (b - a) * (b - a));
        squares.sum::<f64>().sqrt().sqrt().max(1e-9)
    };
    let span = |key: usize| (times[key + 1] - times[key]).as_secs();
    let mut both = same_tangent_on_both_sides(values.iter().map(|v| vec![0.0; v.len()]).collect());
    for key in 1..times.len() - 1 {
        let (left, right) = (knots(key - 1), knots(key));
        for n in 0..values[key].len() {
            let before = (values[key][n] - values[key - 1][n]) / left;
            let after = (values[key + 1][n] - values[key][n]) / right;
            let tangent = (before * right + after * left) / (left + right);
            both[0][key][n] = tangent * left / span(key - 1);
            both[1][key][n] = tangent * right / span(key);
        }
    }
    both
}

/// Nanoseconds per keyframe for the tangents of 64 keyframes of a position. The curve between them costs the same for all methods.
fn measure_times() -> Vec<Nanos> {
    const KEYS: usize = 64;
    let mut random = Random(9);
    let times: Vec<Time> = (0..KEYS).map(|i| Time::from_secs(i as f64)).collect();
    let values: Values = (0..KEYS).map(|_| (0..3).map(|_| random.unit()).collect()).collect();
    let case = |(_, method): (&str, TangentMethod)| {
        let (times, values) = (&times, &values);
        Case::new(KEYS, move || {
            std::hint::black_box(method(times, values));
        })
    };
    interleaved(Clock::Thread, BUDGET_SECS, &mut METHODS.map(case))
}
