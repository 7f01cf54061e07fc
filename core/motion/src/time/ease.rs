//! Easing curves: a weight that goes from 0 to 1 over time.
//!
//! All curves start at 0, end at 1 and never decrease, so that they are weights; curves that overshoot (back, elastic,
//! bounce) are left out. The shapes are R. Penner's ("Motion, Tweening, and Easing", 2002); `Bezier` is CSS's
//! `cubic-bezier` (CSS Easing Functions Level 2, §2.3).

use crate::input_error::InputError;
/// An easing curve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Ease {
    /// The weight equals the elapsed fraction w of the time.
    #[default]
    Linear,
    /// Smoothstep: 3w² − 2w³.
    Smooth,
    /// Slow at the start.
    In(Shape),
    /// Slow at the end: `1 − in(1 − w)`.
    Out(Shape),
    /// Slow at both ends: `In` at half size, then `Out`.
    InOut(Shape),
    /// Bézier curve from (0, 0) to (1, 1) with the control points (x1, y1) and (x2, y2), all from 0 to 1.
    Bezier([f64; 4]),
}

/// Shape of an ease. Formulas are those of `In`, as functions of w.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// 1 − cos(wπ/2)
    Sine,
    /// w²
    Quad,
    /// w³
    Cubic,
    /// w⁴
    Quart,
    /// w⁵
    Quint,
    /// (2^(10w) − 1) / 1023
    Expo,
    /// 1 − √(1 − w²)
    Circ,
}

impl Shape {
    /// All shapes with their names in scripts.
    pub const ALL: [(&'static str, Shape); 7] = [
        ("sine", Shape::Sine),
        ("quad", Shape::Quad),
        ("cubic", Shape::Cubic),
        ("quart", Shape::Quart),
        ("quint", Shape::Quint),
        ("expo", Shape::Expo),
        ("circ", Shape::Circ),
    ];

    fn ease_in(self, w: f64) -> f64 {
        match self {
            Shape::Sine => 1.0 - libm::cos(w * std::f64::consts::FRAC_PI_2),
            Shape::Quad => w * w,
            Shape::Cubic => w * w * w,
            Shape::Quart => (w * w) * (w * w),
            Shape::Quint => (w * w) * (w * w) * w,
            Shape::Expo => (libm::exp2(10.0 * w) - 1.0) / 1023.0,
            Shape::Circ => 1.0 - (1.0 - w * w).max(0.0).sqrt(),
        }
    }

    /// The integral of `ease_in` from 0 to w.
    fn area_in(self, w: f64) -> f64 {
        match self {
            Shape::Sine => w - libm::sin(w * std::f64::consts::FRAC_PI_2) / std::f64::consts::FRAC_PI_2,
            Shape::Quad => w * w * w / 3.0,
            Shape::Cubic => (w * w) * (w * w) / 4.0,
            Shape::Quart => (w * w) * (w * w) * w / 5.0,
            Shape::Quint => (w * w * w) * (w * w * w) / 6.0,
            Shape::Expo => ((libm::exp2(10.0 * w) - 1.0) / (10.0 * std::f64::consts::LN_2) - w) / 1023.0,
            Shape::Circ => w - 0.5 * (w * (1.0 - w * w).max(0.0).sqrt() + libm::asin(w)),
        }
    }
}

impl Ease {
    /// The weight at `w`, both 0..=1; exactly 0 at 0 and 1 at 1.
    pub fn at(self, w: f64) -> f64 {
        if w.is_nan() || w <= 0.0 {
            return 0.0;
        }
        if w >= 1.0 {
            return 1.0;
        }
        let eased = match self {
            Ease::Linear => w,
            Ease::Smooth => w * w * (3.0 - 2.0 * w),
            Ease::In(shape) => shape.ease_in(w),
            Ease::Out(shape) => 1.0 - shape.ease_in(1.0 - w),
            Ease::InOut(shape) if w < 0.5 => 0.5 * shape.ease_in(2.0 * w),
            Ease::InOut(shape) => 1.0 - 0.5 * shape.ease_in(2.0 - 2.0 * w),
            Ease::Bezier([x1, y1, x2, y2]) => bezier_coordinate(y1, y2, bezier_parameter(x1, x2, w)),
        };
        eased.clamp(0.0, 1.0)
    }

    /// The integral of the weight from 0 to `w`; beyond 1 the weight is 1.
    pub fn area(self, w: f64) -> f64 {
        if w.is_nan() || w <= 0.0 {
            return 0.0;
        }
        if w > 1.0 {
            return self.area(1.0) + (w - 1.0);
        }
        match self {
            Ease::Linear => w * w / 2.0,
            Ease::Smooth => w * w * w * (1.0 - 0.5 * w),
            Ease::In(shape) => shape.area_in(w),
            Ease::Out(shape) => w - (shape.area_in(1.0) - shape.area_in(1.0 - w)),
            Ease::InOut(shape) if w < 0.5 => 0.25 * shape.area_in(2.0 * w),
            Ease::InOut(shape) => (w - 0.5) + 0.25 * shape.area_in(2.0 - 2.0 * w),
            Ease::Bezier([x1, y1, x2, y2]) => {
                // ∫ y dx = ∫ y(s) x'(s) ds, a polynomial of degree 6.
                let s = bezier_parameter(x1, x2, w);
                let y = [3.0 * y1, 3.0 * y2 - 6.0 * y1, 3.0 * y1 - 3.0 * y2 + 1.0];
                let dx = [3.0 * x1, 6.0 * x2 - 12.0 * x1, 3.0 * (3.0 * x1 - 3.0 * x2 + 1.0)];
                let mut area = 0.0;
                for (i, y) in y.iter().enumerate() {
                    for (j, dx) in dx.iter().enumerate() {
                        let degree = (i + 1 + j + 1) as i32;
                        area += y * dx * integer_power(s, degree) / f64::from(degree);
                    }
                }
                area
            }
        }
    }

    /// Fails if a control point is outside 0..=1.
    pub fn check(self) -> Result<(), InputError> {
        let Ease::Bezier(points) = self else { return Ok(()) };
        match points.into_iter().find(|p| !(0.0..=1.0).contains(p)) {
            Some(point) => InputError::check_value(false, "Ease::Bezier control point", point, "0..=1"),
            None => Ok(()),
        }
    }
}

fn integer_power(s: f64, n: i32) -> f64 {
    (0..n).fold(1.0, |product, _| product * s)
}

/// One coordinate of the Bézier curve 0, a, b, 1.
fn bezier_coordinate(a: f64, b: f64, s: f64) -> f64 {
    let r = 1.0 - s;
    3.0 * r * r * s * a + 3.0 * r * s * s * b + s * s * s
}

/// The parameter where the curve has this x: bisection, since x never decreases; to the last bit.
fn bezier_parameter(x1: f64, x2: f64, x: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if bezier_coordinate(x1, x2, middle) < x { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_eases() -> Vec<Ease> {
        let shaped = Shape::ALL.iter().flat_map(|(_, s)| [Ease::In(*s), Ease::Out(*s), Ease::InOut(*s)]);
        let others = [
            Ease::Linear,
            Ease::Smooth,
            Ease::Bezier([0.25, 0.1, 0.25, 1.0]),
            Ease::Bezier([1.0, 0.0, 0.0, 1.0]),
            Ease::Bezier([0.0, 1.0, 1.0, 0.0]),
        ];
        shaped.chain(others).collect()
    }

    #[test]
    fn every_ease_rises_from_0_to_1_and_area_is_its_integral() {
        for ease in all_eases() {
            assert_eq!((ease.at(0.0), ease.at(1.0)), (0.0, 1.0), "{ease:?}");
            // Simpson's rule at 4000 steps; Circ and the steepest Bézier have an infinite slope at one point.
            let (steps, mut sum, mut before) = (4000, 0.0, 0.0);
            for i in 0..steps {
                let (a, b) = (f64::from(i) / f64::from(steps), f64::from(i + 1) / f64::from(steps));
                let now = ease.at(b);
                assert!(now >= before, "{ease:?} falls at {b}");
                sum += (b - a) / 6.0 * (ease.at(a) + 4.0 * ease.at(0.5 * (a + b)) + now);
                before = now;
                if i % 400 == 399 {
                    assert!((ease.area(b) - sum).abs() < 2e-6, "{ease:?} at {b}: {} {sum}", ease.area(b));
                }
            }
        }
    }

    #[test]
    fn bezier_eases_match_css() {
        // CSS `ease` at its half, by bisection in forty decimal digits.
        assert!((Ease::Bezier([0.25, 0.1, 0.25, 1.0]).at(0.5) - 0.802_403_387_584_857).abs() < 1e-12);
        let line = Ease::Bezier([1.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]);
        assert!((line.at(0.3) - 0.3).abs() < 1e-12);
        assert!(Ease::Bezier([0.0, 0.0, 1.5, 1.0]).check().is_err());
    }
}
