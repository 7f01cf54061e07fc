//! Easing by Bézier curves: methods to find the weight at a time.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Ease;

const CHOSEN_METHOD: &str = "bisection, 60 steps (Ease::at)";
const METHODS: [&str; 5] = [
    CHOSEN_METHOD,
    "bisection, 20 steps",
    "Newton, 4 steps",
    "table of 11 and Newton, 4 steps",
    "table of 256, linear",
];

/// One coordinate of the cubic Bézier curve with control values 0, a, b, 1.
fn bezier_coordinate(a: f64, b: f64, s: f64) -> f64 {
    let r = 1.0 - s;
    3.0 * r * r * s * a + 3.0 * r * s * s * b + s * s * s
}

fn bezier_slope(a: f64, b: f64, s: f64) -> f64 {
    let r = 1.0 - s;
    3.0 * r * r * a + 6.0 * r * s * (b - a) + 3.0 * s * s * (1.0 - b)
}

/// A curve, and the tables that the methods precompute.
struct Curve {
    points: [f64; 4],
    /// Values of x at parameters 0, 0.1, … 1.
    x_samples: [f64; 11],
    /// Values of y at x = 0, 1/255, … 1.
    y_samples: Vec<f64>,
}

impl Curve {
    fn new(points: [f64; 4]) -> Curve {
        let x_samples = std::array::from_fn(|i| bezier_coordinate(points[0], points[2], i as f64 / 10.0));
        let y_samples = (0..256).map(|i| Ease::Bezier(points).at(f64::from(i) / 255.0)).collect();
        Curve { points, x_samples, y_samples }
    }

    fn solve_by_newton(&self, mut s: f64, x: f64) -> f64 {
        let [x1, y1, x2, y2] = self.points;
        for _ in 0..4 {
            let slope = bezier_slope(x1, x2, s);
            if slope.abs() > 1e-9 {
                s = (s - (bezier_coordinate(x1, x2, s) - x) / slope).clamp(0.0, 1.0);
            }
        }
        bezier_coordinate(y1, y2, s)
    }

    fn ease(&self, method: usize, x: f64) -> f64 {
        let [x1, y1, x2, y2] = self.points;
        match method {
            0 => Ease::Bezier(self.points).at(x),
            1 => {
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..20 {
                    let middle = 0.5 * (low + high);
                    if bezier_coordinate(x1, x2, middle) < x { low = middle } else { high = middle }
                }
                bezier_coordinate(y1, y2, 0.5 * (low + high))
            }
            2 => self.solve_by_newton(x, x),
            3 => {
                let at = self.x_samples[1..10].partition_point(|start| *start <= x);
                let (from, to) = (self.x_samples[at], self.x_samples[at + 1]);
                let share = if to > from { (x - from) / (to - from) } else { 0.0 };
                self.solve_by_newton((at as f64 + share) / 10.0, x)
            }
            _ => {
                let place = x * 255.0;
                let at = (place as usize).min(254);
                self.y_samples[at] + (self.y_samples[at + 1] - self.y_samples[at]) * (place - at as f64)
            }
        }
    }
}

pub(crate) fn section() -> Result<Section, String> {
    let mut random = Random(0xEA5E);
    let mut curves: Vec<Curve> = [
        [0.25, 0.1, 0.25, 1.0],
        [0.42, 0.0, 0.58, 1.0],
        [1.0, 0.0, 0.0, 1.0],
        [0.0, 1.0, 1.0, 0.0],
        [0.9, 0.0, 1.0, 0.1],
    ]
    .map(Curve::new)
    .into();
    curves.extend((0..200).map(|_| Curve::new(std::array::from_fn(|_| random.unit()))));
    let mut errors = [(); METHODS.len()].map(|()| (ErrorStats::default(), String::new()));
    for curve in &curves {
        let [x1, y1, x2, y2] = curve.points;
        for i in 1..400 {
            // The parameter is known, so the exact time and weight are polynomials of it.
            let s = f64::from(i) / 400.0;
            let (x, y) = (bezier_coordinate(x1, x2, s), bezier_coordinate(y1, y2, s));
            for (method, (error, place)) in errors.iter_mut().enumerate() {
                if error.add((curve.ease(method, x) - y).abs()) {
                    *place = format!("Bézier [{x1:.2}, {y1:.2}, {x2:.2}, {y2:.2}] at {x:.3}");
                }
            }
        }
    }
    let mut choice = Choice::new("easing", "How is the weight of a Bézier easing computed at a time?");
    choice.error_unit = "of the way";
    choice.reference =
        "points of the curve by their parameter, f64; CSS's easings, the steepest ones and 200 random curves"
            .into();
    choice.per = "weight".into();
    let times: Vec<f64> = (1..100).map(|i| f64::from(i) / 100.0).collect();
    let (curves, times) = (&curves[..20], &times);
    let case = |method: usize| {
        Case::new(curves.len() * times.len(), move || {
            for (curve, x) in curves.iter().flat_map(|curve| times.iter().map(move |x| (curve, x))) {
                std::hint::black_box(curve.ease(method, std::hint::black_box(*x)));
            }
        })
    };
    let nanos =
        interleaved(Clock::Thread, BUDGET_SECS, &mut (0..METHODS.len()).map(case).collect::<Vec<_>>());
    for (method, (error, place)) in errors.into_iter().enumerate() {
        let row = Row::new(METHODS[method]).error(error.worst, error.mean()).nanos(nanos[method]).at(place);
        choice.rows.push(row);
    }
    choice.choose(
        CHOSEN_METHOD,
        "exact to the last bit of the time for every curve, even a vertical one; a frame needs few weights",
    );
    Ok(Section {
        title: "Easing",
        text: "A Bézier easing gives the weight for a curve parameter, which must first be found for the \
               time. Bisection needs no slope and never fails; Newton's method is faster, but wrong where \
               the curve is steep."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: vec![(
            "easing",
            "a faster way that fails for steep curves would show as jumps; the extra \
                                    time is spent a few times a frame",
        )],
    })
}
