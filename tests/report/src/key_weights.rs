//! Keyframes with weighted tangents: Bézier curves of time and value, converted to short Hermite spans.

use crate::BUDGET_SECS;
use crate::images::stage;
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::{Ease, Interpolation, Time};
use choreo_stage::{Channel, Property};

/// Numbers of parts of a span; the script API uses `API_PARTS`.
const PART_COUNTS: [u32; 5] = [4, 8, 16, 32, 64];
const API_PARTS: u32 = 32;
const BEZIER_METHOD: &str = "the Bézier curve itself, bisection";
/// Lengths of both handles, as fractions of the span.
const HANDLE_LENGTHS: [[f64; 2]; 5] = [[0.3, 0.4], [0.8, 0.8], [0.0, 0.6], [1.0, 0.0], [1.0, 1.0]];
/// Slopes per second at both ends of a span of one second, over which the value changes by 1.
const TANGENTS: [f64; 2] = [2.0, -1.0];
const STEP_COUNT: u32 = 4000;

/// Bézier control points of time and value.
fn control_points([start, end]: [f64; 2]) -> [[f64; 4]; 2] {
    [[0.0, start, 1.0 - end, 1.0], [0.0, start * TANGENTS[0], 1.0 - end * TANGENTS[1], 1.0]]
}

/// Point of a Bézier curve at a parameter, by de Casteljau's algorithm.
fn casteljau(points: [f64; 4], u: f64) -> f64 {
    let mut points = points.to_vec();
    while points.len() > 1 {
        points = points.windows(2).map(|p| p[0] + (p[1] - p[0]) * u).collect();
    }
    points[0]
}

/// Converts a Bézier span into a channel with Hermite parts at equal steps of the parameter.
fn channel_in_parts(weights: [f64; 2], parts: u32) -> Channel {
    let [time, value] = control_points(weights);
    let change = |p: [f64; 4], u: f64| {
        let [a, b, c] = [p[1] - p[0], p[2] - p[1], p[3] - p[2]];
        (1.0 - u) * (1.0 - u) * a + 2.0 * (1.0 - u) * u * b + u * u * c
    };
    let (mut times, mut values, mut slopes) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..=parts {
        let u = f64::from(i) / f64::from(parts);
        let at = Time::from_secs(casteljau(time, u));
        if times.last().is_some_and(|last| at <= *last) {
            continue;
        }
        times.push(at);
        values.push(casteljau(value, u));
        slopes.push(change(value, u) / change(time, u));
    }
    // A vertical curve has no finite slope: the slopes of the adjacent chords bound it, as in the script API.
    let chords: Vec<f64> =
        (1..times.len()).map(|i| (values[i] - values[i - 1]) / (times[i] - times[i - 1]).as_secs()).collect();
    for (i, slope) in slopes.iter_mut().enumerate() {
        let sides = [i.checked_sub(1).map(|i| chords[i]), chords.get(i).copied()];
        let most = 3.0 * sides.iter().flatten().fold(0.0, |most: f64, chord| most.max(chord.abs()));
        let chord = sides.iter().flatten().next().copied().unwrap_or(0.0);
        *slope = if slope.is_finite() { slope.clamp(-most, most) } else { chord };
    }
    let values = values.iter().zip(&slopes).flat_map(|(value, slope)| [*slope, *value, *slope]).collect();
    Channel { property: Property::Opacity, interpolation: Interpolation::CubicSpline, times, values }
}

/// Channel that the script API creates from such keyframes.
fn channel_from_script([start, end]: [f64; 2]) -> Result<Channel, String> {
    let [out, into] = TANGENTS;
    let text = format!(
        "stage(#{{ length: 2.0 }});
         cast(\"a\", load(\"choreo:mannequin\")).key(\"position\", [
             [0, [0, 0, 0], #{{ out_tangent: [{out:?}, 0, 0], out_weight: {start:?} }}],
             [1, [1, 0, 0], #{{ in_tangent: [{into:?}, 0, 0], in_weight: {end:?} }}]]);"
    );
    let stage = stage(&text, &choreo::registry())?;
    let channels = &stage.actors[0].channels;
    channels
        .iter()
        .find(|c| c.property == Property::Translation)
        .cloned()
        .ok_or("no channel of places".into())
}

/// Largest and mean error over the span, and the place of the largest.
fn errors(channel: &Channel, weights: [f64; 2]) -> Result<(ErrorStats, f64), String> {
    let [time, value] = control_points(weights);
    let (mut error, mut place) = (ErrorStats::default(), 0.0);
    for i in 0..=STEP_COUNT {
        let u = f64::from(i) / f64::from(STEP_COUNT);
        let at = Time::from_secs(casteljau(time, u));
        let found = channel.at(at).ok_or("a channel without values")?[0];
        if error.add((found - casteljau(value, u)).abs()) {
            place = at.as_secs();
        }
    }
    Ok((error, place))
}

pub(crate) fn measure_part_counts() -> Result<(Choice, Table), String> {
    let mut choice = Choice::new("key_weights", "In how many parts is a span with weighted tangents stored?");
    choice.error_unit = "of the change";
    choice.reference = format!(
        "points of the Bézier curve by de Casteljau's construction, f64, at {STEP_COUNT} parameters; weights of \
         the table below except the last, whose curve is vertical in the middle"
    );
    choice.per = "sample".into();
    let titles = HANDLE_LENGTHS.map(|[a, b]| format!(">{a} and {b}"));
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error, weights", "way")];
    columns.extend(titles.iter().map(|title| (title.as_str(), "of the change")));
    let mut table = Table::new("By the weights", &columns);
    let mut timed = Vec::new();
    for parts in PART_COUNTS {
        let channels: Vec<Channel> = match parts == API_PARTS {
            true => HANDLE_LENGTHS
                .iter()
                .map(|weights| channel_from_script(*weights))
                .collect::<Result<_, _>>()?,
            false => HANDLE_LENGTHS.iter().map(|weights| channel_in_parts(*weights, parts)).collect(),
        };
        let name = parts_name(parts);
        let (mut all, mut worst, mut place) = (0.0, 0.0f64, String::new());
        let mut cells = vec![Cell::text(name.clone())];
        for (i, (channel, weights)) in channels.iter().zip(HANDLE_LENGTHS).enumerate() {
            let (error, at) = errors(channel, weights)?;
            cells.push(Cell::number(quantity(error.worst), error.worst));
            if i + 1 == HANDLE_LENGTHS.len() {
                continue;
            }
            all += error.mean() / (HANDLE_LENGTHS.len() - 1) as f64;
            if error.worst > worst {
                (worst, place) =
                    (error.worst, format!("weights {} and {}, {at:.3} s", weights[0], weights[1]));
            }
        }
        table.rows.push(cells);
        let bytes = channels[0].times.len() * (8 + 3 * 8);
        choice.rows.push(Row::new(name).error(worst, all).at(place).bytes(bytes as f64));
        timed.push(channel_in_parts(HANDLE_LENGTHS[0], parts));
    }
    let times: Vec<Time> = (1..100).map(|i| Time::from_secs(f64::from(i) / 100.0)).collect();
    let times = &times;
    let mut cases: Vec<Case> = timed
        .iter()
        .map(|channel| {
            Case::new(times.len(), move || {
                for time in times {
                    std::hint::black_box(channel.at(std::hint::black_box(*time)));
                }
            })
        })
        .collect();
    let [along, value] = control_points(HANDLE_LENGTHS[0]);
    let ease = Ease::Bezier([along[1], 1.0 / 3.0, along[2], 2.0 / 3.0]);
    cases.push(Case::new(times.len(), move || {
        for time in times {
            let u = ease.at(std::hint::black_box(time.as_secs()));
            std::hint::black_box(casteljau(value, u));
        }
    }));
    choice.rows.push(Row::new(BEZIER_METHOD).error(0.0, 0.0).bytes(64.0));
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        &parts_name(API_PARTS),
        "at weights up to 0.8 an error of 0.01 mm in a metre, as fast as any other keys; only weighted \
         spans need it",
    );
    Ok((choice, table))
}

fn parts_name(parts: u32) -> String {
    format!("{parts} Hermite parts{}", if parts == API_PARTS { " (script API)" } else { "" })
}
