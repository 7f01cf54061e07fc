//! Representation of times on the timeline.

use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_motion::{FrameRate, Time};

const HOURS: [(f64, &str); 5] =
    [(1.0 / 3600.0, "1 s"), (1.0 / 60.0, "1 min"), (1.0, "1 h"), (100.0, "100 h"), (1000.0, "1000 h")];
const TYPICAL_HOURS: usize = 2;
const NTSC: FrameRate = FrameRate { num: 30_000, den: 1001 };
const CHOSEN_METHOD: &str = "ticks of 1/705 600 000 s";
const METHODS: [&str; 5] = [
    CHOSEN_METHOD,
    "f64 seconds",
    "f32 seconds",
    "f64, a frame's time added each frame",
    "f32, a frame's time added each frame",
];

pub(crate) fn section() -> Result<Section, String> {
    let mut by_length = vec![vec![ErrorStats::default(); HOURS.len()]; METHODS.len()];
    let mut added = (0.0f64, 0.0f32);
    let (step64, step32) = (1001.0 / 30_000.0, 1001.0f32 / 30_000.0);
    let mut frame: i64 = 0;
    for (at, (hours, _)) in HOURS.iter().enumerate() {
        let last = (hours * 3600.0 * NTSC.as_fps()).round() as i64;
        // Compares the last frames only; sums go through all frames.
        let first = (last - 200).max(1);
        while frame < last {
            frame += 1;
            added.0 += step64;
            added.1 += step32;
            if frame < first {
                continue;
            }
            let held = [
                NTSC.time_of(frame).0 as f64 / Time::TICKS_PER_SECOND as f64,
                frame as f64 * 1001.0 / 30_000.0,
                f64::from(frame as f32 * 1001.0 / 30_000.0),
                added.0,
                f64::from(added.1),
            ];
            for (method, held) in held.into_iter().enumerate() {
                by_length[method][at].add(match method {
                    // Ticks are compared as integers: frame · 1001 / 30 000 s is a whole number of ticks.
                    0 => {
                        let exact = i128::from(frame) * 1001 * i128::from(Time::TICKS_PER_SECOND);
                        let difference = exact - i128::from(NTSC.time_of(frame).0) * 30_000;
                        difference.unsigned_abs() as f64 / 30_000.0 / Time::TICKS_PER_SECOND as f64 * 1e6
                    }
                    _ => error_in_microseconds(held, frame),
                });
            }
        }
    }
    let mut choice = Choice::new("time", "How is a time on the timeline stored?");
    choice.error_unit = "µs";
    choice.reference = format!(
        "frame · 1001 / 30 000 s as a fraction of whole numbers; {} into the timeline",
        HOURS[TYPICAL_HOURS].1
    );
    choice.per = "frame number turned into a time".into();
    let nanos = measure_times();
    for (method, name) in METHODS.iter().enumerate() {
        let error = &by_length[method][TYPICAL_HOURS];
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).nanos(nanos[method]));
    }
    choice.choose(
        CHOSEN_METHOD,
        "exact for every common frame rate, at any time; a time computed in two ways is the same",
    );
    let titles: Vec<String> = HOURS.iter().map(|h| format!(">after {}", h.1)).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in µs", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "hours")));
    let mut table = Table::new("By the time on the timeline (NTSC, 29.97 frames a second)", &columns);
    for (name, errors) in METHODS.iter().zip(&by_length) {
        let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
        table.rows.push([Cell::text(*name)].into_iter().chain(cells).collect());
    }
    Ok(Section {
        title: "Time",
        text: "A frame lasts 33 367 µs. f32 seconds are wrong by nearly a frame after 100 hours, sums in \
               f32 by 80 frames after one. f64 would be exact enough for images, but the times of a frame \
               and of a key at the same place would differ, and rounding would decide whether a cut comes \
               before or after a frame."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: Vec::new(),
    })
}

/// Error in microseconds of a time in f64. f64 holds its whole part and 1001 · frame exactly, so the difference is computed in integers.
fn error_in_microseconds(held: f64, frame: i64) -> f64 {
    let whole = held.floor();
    // Remainder of frame · 1001 / 30 000 beyond the whole seconds, exact.
    let exact = i128::from(frame) * 1001;
    let left = exact - whole as i128 * 30_000;
    // Both parts are at most a few seconds, for which f64 is precise to 1e-16 of the value.
    ((left as f64 / 30_000.0) - (held - whole)).abs() * 1e6
}

fn measure_times() -> Vec<Nanos> {
    const FRAMES: i64 = 1000;
    let mut cases = vec![
        Case::new(FRAMES as usize, || {
            for frame in 0..FRAMES {
                std::hint::black_box(NTSC.time_of(std::hint::black_box(frame)));
            }
        }),
        Case::new(FRAMES as usize, || {
            for frame in 0..FRAMES {
                std::hint::black_box(std::hint::black_box(frame) as f64 * 1001.0 / 30_000.0);
            }
        }),
        Case::new(FRAMES as usize, || {
            for frame in 0..FRAMES {
                std::hint::black_box(std::hint::black_box(frame) as f32 * 1001.0 / 30_000.0);
            }
        }),
        Case::new(FRAMES as usize, || {
            let mut sum = 0.0f64;
            for _ in 0..FRAMES {
                sum = std::hint::black_box(sum + 1001.0 / 30_000.0);
            }
        }),
        Case::new(FRAMES as usize, || {
            let mut sum = 0.0f32;
            for _ in 0..FRAMES {
                sum = std::hint::black_box(sum + 1001.0 / 30_000.0);
            }
        }),
    ];
    interleaved(Clock::Thread, BUDGET_SECS, &mut cases)
}
