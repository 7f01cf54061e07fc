//! Root motion accumulated over many loops of a clip.

use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Planar;
use glam::{DVec2, DVec3, Vec2};

const CHOSEN_METHOD: &str = "power in closed form, f64 (Planar::power)";
const METHODS: [&str; 4] =
    [CHOSEN_METHOD, "a step each loop, f64", "a step each frame, f64", "a step each loop, f32"];
/// Numbers of loops of one second, and their total time.
const LOOP_COUNTS: [(i64, &str); 4] = [(60, "1 min"), (3600, "1 h"), (36_000, "10 h"), (360_000, "100 h")];
const FRAMES_PER_LOOP: i64 = 30;
/// Rotation per loop as a fraction of a turn, and metres forward per loop: a walk along a circle, nearly straight ahead, and almost on the
/// spot.
const WALKS: [((i64, i64), f64); 3] = [((1, 997), 1.4), ((1, 100_003), 1.4), ((17, 64), 0.9)];

fn angle_of_fraction((turns, parts): (i64, i64)) -> f64 {
    std::f64::consts::TAU * turns as f64 / parts as f64
}

fn rotated(v: DVec2, angle: f64) -> DVec2 {
    let (sin, cos) = angle.sin_cos();
    DVec2::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x)
}

/// Reference position. Complete cycles of directions sum to zero, so only the steps of the last, incomplete cycle are added, with angles
/// reduced in integers and Kahan's compensated summation.
fn reference_position((turns, parts): (i64, i64), metres: f64, loops: i64) -> DVec2 {
    let (mut sum, mut lost) = (DVec2::ZERO, DVec2::ZERO);
    for step in 0..loops % parts {
        let direction = angle_of_fraction(((step * turns) % parts, parts));
        let add = rotated(DVec2::new(0.0, metres), direction) - lost;
        let next = sum + add;
        lost = (next - sum) - add;
        sum = next;
    }
    sum
}

fn accumulated_position(method: usize, turn: f64, metres: f64, loops: i64) -> DVec2 {
    match method {
        0 => {
            let step = Planar { translation: DVec3::new(0.0, 0.0, metres), yaw: turn };
            let place = step.power(loops).translation;
            DVec2::new(place.x, place.z)
        }
        1 => {
            let (mut place, mut yaw) = (DVec2::ZERO, 0.0);
            for _ in 0..loops {
                place += rotated(DVec2::new(0.0, metres), yaw);
                yaw += turn;
            }
            place
        }
        2 => {
            // The loop is split into equal parts whose positions lie on the same circle.
            let part = turn / FRAMES_PER_LOOP as f64;
            let chord = metres * (part / 2.0).sin() / (turn / 2.0).sin();
            let step = rotated(DVec2::new(0.0, chord), -(turn - part) / 2.0);
            let (mut place, mut yaw) = (DVec2::ZERO, 0.0);
            for _ in 0..loops * FRAMES_PER_LOOP {
                place += rotated(step, yaw);
                yaw += part;
            }
            place
        }
        _ => {
            let (mut place, mut yaw) = (Vec2::ZERO, 0.0f32);
            for _ in 0..loops {
                let (sin, cos) = yaw.sin_cos();
                place += Vec2::new(sin, cos) * metres as f32;
                yaw += turn as f32;
            }
            place.as_dvec2()
        }
    }
}

pub(crate) fn section() -> Result<Section, String> {
    let mut errors = [[0.0f64; LOOP_COUNTS.len()]; METHODS.len()];
    for (fraction, metres) in WALKS {
        for (at, (loops, _)) in LOOP_COUNTS.iter().enumerate() {
            let truth = reference_position(fraction, metres, *loops);
            for (method, errors) in errors.iter_mut().enumerate() {
                let difference = (accumulated_position(method, angle_of_fraction(fraction), metres, *loops)
                    - truth)
                    .length()
                    * 1e3;
                errors[at] = errors[at].max(difference);
            }
        }
    }
    let mut choice =
        Choice::new("root_motion", "How is the root motion of many loops of a clip accumulated?");
    choice.error_unit = "mm";
    choice.reference = format!(
        "{} into walks of a step a second along circles of {} steps: sums of the last circle's steps, angles reduced in whole numbers",
        LOOP_COUNTS[1].1, WALKS[0].0.1
    );
    choice.per = format!("place after {}, without knowing an earlier frame", LOOP_COUNTS[1].1);
    let (fraction, metres) = WALKS[0];
    let case = |method: usize| {
        Case::new(1, move || {
            let turn = std::hint::black_box(angle_of_fraction(fraction));
            std::hint::black_box(accumulated_position(method, turn, metres, LOOP_COUNTS[1].0));
        })
    };
    let nanos =
        interleaved(Clock::Thread, BUDGET_SECS, &mut (0..METHODS.len()).map(case).collect::<Vec<_>>());
    for (method, name) in METHODS.into_iter().enumerate() {
        choice.rows.push(Row::new(name).error(errors[method][1], f64::NAN).nanos(nanos[method]));
    }
    choice.choose(CHOSEN_METHOD, "any frame directly, at the same cost, and rounding does not accumulate");
    let titles: Vec<String> = LOOP_COUNTS.iter().map(|l| format!(">after {}", l.1)).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in mm", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "loops")));
    let mut table = Table::new("By the time on the timeline", &columns);
    for (name, errors) in METHODS.iter().zip(errors) {
        let cells = errors.iter().map(|e| Cell::number(quantity(*e), *e));
        table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
    }
    Ok(Section {
        title: "Root motion",
        text: "A character walks on where the last loop ended. If steps are added one by one, every frame \
               needs all earlier steps, and rounding grows with the time; in f32 a walker along a circle is \
               metres off after hours."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: Vec::new(),
    })
}
