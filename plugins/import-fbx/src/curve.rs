//! FBX curves as polynomials: a cubic in time between two keys. Weighted tangents bend time as well; such a segment becomes
//! several cubics within the tolerance.

use choreo_motion::Time;
use ufbx::{AnimCurve, Interpolation, Keyframe};

/// The cubic c₀ + c₁u + c₂u² + c₃u³, u from 0 to 1, between two times of the clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    pub from: Time,
    pub to: Time,
    pub c: [f64; 4],
    /// The piece begins with a jump one tick after its key, not before it.
    pub jumps_after_key: bool,
}

/// Halvings of a weighted segment, at most.
const MAX_DEPTH: u32 = 10;
/// Tolerance for the default tangent weight 1/3, which FBX writes with six digits.
const DEFAULT_WEIGHT_TOLERANCE: f64 = 2e-6;

/// Range of a clip on the file's timeline.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub begin: Time,
    pub end: Time,
}

impl Span {
    pub(crate) fn length(self) -> Time {
        self.end - self.begin
    }
}

/// Appends the curve over the whole clip, without gaps. The first and last values hold outside the keys. `tolerance` is in the
/// curve's own unit.
pub(crate) fn pieces(
    curve: Option<&AnimCurve>,
    constant: f64,
    span: Span,
    tolerance: f64,
    out: &mut Vec<Piece>,
) {
    let keys: &[Keyframe] = curve.map_or(&[], |c| &c.keyframes);
    let mut list = PieceList { span, out, end: Time::ZERO };
    let [first, .., last] = keys else {
        list.hold_value(span.length(), keys.first().map_or(constant, |k| k.value), false);
        return;
    };
    list.hold_value(Time::from_secs(first.time) - span.begin, first.value, false);
    for pair in keys.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let (from, to) = (Time::from_secs(a.time) - span.begin, Time::from_secs(b.time) - span.begin);
        if to <= from || to <= Time::ZERO || from >= span.length() {
            continue;
        }
        match a.interpolation {
            Interpolation::ConstantPrev => list.add_cubic(from, to, [a.value, 0.0, 0.0, 0.0], false),
            Interpolation::ConstantNext => list.add_cubic(from, to, [b.value, 0.0, 0.0, 0.0], true),
            Interpolation::Linear => list.add_cubic(from, to, [a.value, b.value - a.value, 0.0, 0.0], false),
            Interpolation::Cubic => {
                let bezier = Bezier::new(a, b);
                if bezier.is_cubic_in_time(tolerance) {
                    list.add_cubic(from, to, bezier.to_cubic(), false);
                } else {
                    bezier.approximate(0.0, 1.0, tolerance, MAX_DEPTH, &mut |x, next, c| {
                        let at = |x: f64| Time(from.0 + ((to.0 - from.0) as f64 * x).round() as i64);
                        list.add_cubic(at(x), at(next), c, false);
                    });
                }
            }
        }
    }
    list.hold_value(span.length(), last.value, false);
}

struct PieceList<'a> {
    span: Span,
    out: &'a mut Vec<Piece>,
    end: Time,
}

impl PieceList<'_> {
    fn hold_value(&mut self, to: Time, value: f64, jumps_after_key: bool) {
        let to = to.min(self.span.length());
        if to > self.end {
            self.out.push(Piece { from: self.end, to, c: [value, 0.0, 0.0, 0.0], jumps_after_key });
            self.end = to;
        }
    }

    /// Appends a piece, clipped to the time range of the clip.
    fn add_cubic(&mut self, from: Time, to: Time, c: [f64; 4], jumps_after_key: bool) {
        let (start, end) = (from.max(self.end), to.min(self.span.length()));
        if end <= start {
            return;
        }
        let whole = Piece { from, to, c, jumps_after_key: jumps_after_key && start == from };
        self.out.push(whole.part(start, end));
        self.end = end;
    }
}

impl Piece {
    pub(crate) fn start(&self) -> f64 {
        self.c[0]
    }

    pub(crate) fn end(&self) -> f64 {
        ((self.c[3] + self.c[2]) + self.c[1]) + self.c[0]
    }

    /// The same polynomial on a part of the piece's time range.
    pub(crate) fn part(&self, from: Time, to: Time) -> Piece {
        if from == self.from && to == self.to {
            return *self;
        }
        let span = (self.to.0 - self.from.0) as f64;
        let (u, w) = ((from.0 - self.from.0) as f64 / span, (to.0 - from.0) as f64 / span);
        let [a, b, c, d] = self.c;
        let c = [
            a + u * (b + u * (c + u * d)),
            w * (b + u * (2.0 * c + 3.0 * u * d)),
            w * w * (c + 3.0 * u * d),
            w * w * w * d,
        ];
        Piece { from, to, c, jumps_after_key: self.jumps_after_key && from == self.from }
    }
}

/// Time and value as cubic Béziers of a common parameter.
struct Bezier {
    /// Times of the inner control points, 0 to 1.
    x: [f64; 2],
    y: [f64; 4],
}

impl Bezier {
    fn new(a: &Keyframe, b: &Keyframe) -> Bezier {
        let span = b.time - a.time;
        let (right, left) = (&a.right, &b.left);
        let x = [f64::from(right.dx) / span, 1.0 - f64::from(left.dx) / span].map(|x| x.clamp(0.0, 1.0));
        Bezier { x, y: [a.value, a.value + f64::from(right.dy), b.value - f64::from(left.dy), b.value] }
    }

    /// Whether the value is, within the tolerance, a cubic in time.
    fn is_cubic_in_time(&self, tolerance: f64) -> bool {
        let off = (self.x[0] - 1.0 / 3.0).abs().max((self.x[1] - 2.0 / 3.0).abs());
        let steepest = (1..4).map(|i| (self.y[i] - self.y[i - 1]).abs()).fold(0.0, f64::max);
        off <= DEFAULT_WEIGHT_TOLERANCE || off * 3.0 * steepest <= 0.1 * tolerance
    }

    fn to_cubic(&self) -> [f64; 4] {
        let [a, b, c, d] = self.y;
        [a, 3.0 * (b - a), 3.0 * (c - 2.0 * b + a), (d - a) + 3.0 * (b - c)]
    }

    /// The value at a time.
    fn at(&self, x: f64) -> f64 {
        cubic(self.y, self.parameter(x))
    }

    /// The slope of the value at a time.
    fn slope(&self, x: f64) -> f64 {
        let t = self.parameter(x);
        let (dx, dy) = (cubic_slope([0.0, self.x[0], self.x[1], 1.0], t), cubic_slope(self.y, t));
        // A vertical tangent has an infinite slope, so the slope is limited.
        dy / dx.max(1e-6)
    }

    /// The parameter at a time, by Newton's method with bisection as fallback: x never decreases.
    fn parameter(&self, x: f64) -> f64 {
        let (mut low, mut high, mut t) = (0.0, 1.0, x);
        let points = [0.0, self.x[0], self.x[1], 1.0];
        for _ in 0..60 {
            let off = cubic(points, t) - x;
            if off.abs() <= 1e-15 {
                break;
            }
            if off > 0.0 {
                high = t
            } else {
                low = t
            }
            let next = t - off / cubic_slope(points, t);
            t = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        t
    }

    /// Approximates the curve by cubics in time with its values and slopes at their ends, halved until the points between are
    /// close enough.
    fn approximate(
        &self,
        from: f64,
        to: f64,
        tolerance: f64,
        depth: u32,
        add: &mut impl FnMut(f64, f64, [f64; 4]),
    ) {
        let span = to - from;
        let (a, b) = (self.at(from), self.at(to));
        let (m, n) = (self.slope(from) * span, self.slope(to) * span);
        let c = [a, m, 3.0 * (b - a) - 2.0 * m - n, 2.0 * (a - b) + m + n];
        let off = |u: f64| ((c[0] + u * (c[1] + u * (c[2] + u * c[3]))) - self.at(from + u * span)).abs();
        let close = [0.2, 0.5, 0.8].iter().all(|u| off(*u) <= 0.1 * tolerance);
        if depth == 0 || close {
            // No cubic is close to a vertical tangent, but a line of this length is.
            add(from, to, if close { c } else { [a, b - a, 0.0, 0.0] });
            return;
        }
        let middle = 0.5 * (from + to);
        self.approximate(from, middle, tolerance, depth - 1, add);
        self.approximate(middle, to, tolerance, depth - 1, add);
    }
}

fn cubic([a, b, c, d]: [f64; 4], t: f64) -> f64 {
    let u = 1.0 - t;
    u * u * u * a + 3.0 * (u * u * t * b + u * t * t * c) + t * t * t * d
}

fn cubic_slope([a, b, c, d]: [f64; 4], t: f64) -> f64 {
    let u = 1.0 - t;
    3.0 * (u * u * (b - a) + 2.0 * u * t * (c - b) + t * t * (d - c))
}
