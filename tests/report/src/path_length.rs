//! Arc length of a path, along which an actor walks at constant speed.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_stage::Path;
use glam::DVec3;

const CHOSEN_METHOD: &str = "Gauss–Legendre of 3 points, 32 pieces (Path)";
const METHODS: [&str; 5] = [
    CHOSEN_METHOD,
    "Gauss–Legendre of 3 points, 8 pieces",
    "Gauss–Legendre of 5 points, whole stretch",
    "Simpson, 32 pieces",
    "chords, 100 pieces",
];

/// Gauss–Legendre nodes and weights on −1..1 (Abramowitz and Stegun, table 25.4).
const GAUSS_3: &[(f64, f64)] =
    &[(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];
const GAUSS_5: &[(f64, f64)] = &[
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// A span of a centripetal Catmull–Rom spline between the inner two of four points, evaluated by Barry and Goldman's pyramid ("A recursive
/// evaluation algorithm for a class of Catmull-Rom splines", SIGGRAPH 1988), which differs from the form in the program.
#[derive(Clone, Copy)]
struct SplineSpan([DVec3; 4]);

impl SplineSpan {
    fn position(&self, u: f64) -> DVec3 {
        let p = self.0;
        let mut t = [0.0; 4];
        for i in 1..4 {
            t[i] = t[i - 1] + p[i - 1].distance(p[i]).sqrt();
        }
        let at = t[1] + u * (t[2] - t[1]);
        let mix = |a: DVec3, b: DVec3, from: f64, to: f64| {
            a * ((to - at) / (to - from)) + b * ((at - from) / (to - from))
        };
        let first: [DVec3; 3] = std::array::from_fn(|i| mix(p[i], p[i + 1], t[i], t[i + 1]));
        let second: [DVec3; 2] = std::array::from_fn(|i| mix(first[i], first[i + 1], t[i], t[i + 2]));
        mix(second[0], second[1], t[1], t[2])
    }

    /// Coefficients of the span's cubic polynomial, from four of its points.
    fn polynomial(&self) -> [DVec3; 4] {
        let [p0, p1, p2, p3] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|u| self.position(u));
        let c1 = (p0 * -11.0 + p1 * 18.0 - p2 * 9.0 + p3 * 2.0) / 2.0;
        let c2 = (p0 * 18.0 - p1 * 45.0 + p2 * 36.0 - p3 * 9.0) / 2.0;
        let c3 = (p0 * -9.0 + p1 * 27.0 - p2 * 27.0 + p3 * 9.0) / 2.0;
        [p0, c1, c2, c3]
    }
}

fn speed([_, c1, c2, c3]: &[DVec3; 4], u: f64) -> f64 {
    (*c1 + *c2 * (2.0 * u) + *c3 * (3.0 * u * u)).length()
}

fn gauss_length(c: &[DVec3; 4], nodes: &[(f64, f64)], pieces: u32) -> f64 {
    let half = 0.5 / f64::from(pieces);
    let piece =
        |i: u32| nodes.iter().map(|(x, w)| w * speed(c, half * (f64::from(2 * i + 1) + x))).sum::<f64>();
    half * (0..pieces).map(piece).sum::<f64>()
}

fn span_length(method: usize, stretch: &SplineSpan, c: &[DVec3; 4]) -> f64 {
    match method {
        0 => gauss_length(c, GAUSS_3, 32),
        1 => gauss_length(c, GAUSS_3, 8),
        2 => gauss_length(c, GAUSS_5, 1),
        3 => {
            let step = 1.0 / 32.0;
            let piece = |i: u32| {
                let u = f64::from(i) * step;
                speed(c, u) + 4.0 * speed(c, u + 0.5 * step) + speed(c, u + step)
            };
            (0..32).map(piece).sum::<f64>() * step / 6.0
        }
        _ => (0..100)
            .map(|i| {
                stretch.position(f64::from(i) / 100.0).distance(stretch.position(f64::from(i + 1) / 100.0))
            })
            .sum(),
    }
}

pub(crate) fn section() -> Result<Section, String> {
    let mut random = Random(0xA11);
    let mut stretches: Vec<SplineSpan> =
        (0..100).map(|_| SplineSpan(std::array::from_fn(|_| random.direction() * 3.0))).collect();
    // A sharp turn, in which the speed falls to nearly zero.
    let sharp = [[-4.0, 0.0], [0.0, 0.0], [0.02, 0.01], [-4.0, 0.1]].map(|[x, z]| DVec3::new(x, 0.0, z));
    stretches.push(SplineSpan(sharp));
    let mut errors = [(); METHODS.len()].map(|()| (ErrorStats::default(), String::new()));
    let mut of_program = ErrorStats::default();
    for (number, stretch) in stretches.iter().enumerate() {
        let c = stretch.polynomial();
        // Reference with 512 pieces of 5 points, whose error is only rounding.
        let exact = gauss_length(&c, GAUSS_5, 512);
        for (method, (error, place)) in errors.iter_mut().enumerate() {
            if error.add((span_length(method, stretch, &c) / exact - 1.0).abs()) {
                *place = if number == 100 { "a sharp turn".into() } else { format!("stretch {number}") };
            }
        }
        // The program's path through the four points; this span is its middle part.
        let path = |points: &[DVec3]| Path::new(points.to_vec(), false).map(|path| path.length());
        let whole = path(&stretch.0).map_err(|e| e.to_string())?;
        let mirrored = |a: DVec3, b: DVec3| a * 2.0 - b;
        let [a, b, cc, d] = stretch.0;
        let ends = [SplineSpan([mirrored(a, b), a, b, cc]), SplineSpan([b, cc, d, mirrored(d, cc)])];
        let ends: f64 = ends.iter().map(|end| gauss_length(&end.polynomial(), GAUSS_5, 512)).sum();
        of_program.add((whole / (exact + ends) - 1.0).abs());
    }
    if of_program.worst > 1e-4 {
        return Err(format!("a path of the program is off by {} of its length", of_program.worst));
    }
    let mut choice = Choice::new("path_length", "How is the length of a section of a path computed?");
    choice.error_unit = "of the length";
    choice.reference =
        "512 pieces of 5-point Gauss–Legendre of the same spline in another form, f64; 100 random stretches and a sharp turn".into();
    choice.per = "stretch".into();
    let prepared: Vec<(SplineSpan, [DVec3; 4])> = stretches.iter().map(|s| (*s, s.polynomial())).collect();
    let prepared = &prepared;
    let case = |method: usize| {
        Case::new(prepared.len(), move || {
            prepared.iter().for_each(|(s, c)| _ = std::hint::black_box(span_length(method, s, c)))
        })
    };
    let nanos =
        interleaved(Clock::Thread, BUDGET_SECS, &mut (0..METHODS.len()).map(case).collect::<Vec<_>>());
    for (method, (error, place)) in errors.into_iter().enumerate() {
        choice
            .rows
            .push(Row::new(METHODS[method]).error(error.worst, error.mean()).nanos(nanos[method]).at(place));
    }
    choice.choose(
        CHOSEN_METHOD,
        "its error makes no foot slide on any path, even in sharp turns; it is computed once, when the \
         stage is built",
    );
    Ok(Section {
        title: "Length of paths",
        text: format!(
            "An actor walks along a spline at an even speed, so the length to each place must be known. The paths of the program agree with \
             the reference to {:.1e} of their length.",
            of_program.worst
        ),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
