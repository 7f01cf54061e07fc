//! Exact solution of the damped oscillator under a load that changes linearly in time.

/// Response over a step of `h` seconds of `u'' + κ u' + K u = F₀ + F₁ t`, from `u(0) = 0` and `u'(0) = v`:
///
/// ```text
/// u (h) = v · g  + F₀ · ∫g + F₁ · ∬g
/// u'(h) = v · g' + F₀ ·  g + F₁ · ∫g
/// ```
///
/// where g is the response to a unit impulse. For steps of any length and springs of any stiffness, the only error is rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// g', without unit.
    pub impulse_rate: f64,
    /// g, seconds.
    pub impulse: f64,
    /// ∫g, seconds².
    pub load: f64,
    /// ∬g, seconds³.
    pub ramp: f64,
}

impl Response {
    /// `stiffness` K in 1/s², `damping` κ in 1/s, `seconds` h; all finite, ≥ 0 and at most 1e18.
    ///
    /// Three formulas are used, each where it loses no digits: the power series for short steps, two exponentials for strong
    /// damping, and otherwise the damped sine.
    pub fn new(stiffness: f64, damping: f64, seconds: f64) -> Response {
        let (kh, kh2) = (damping * seconds, stiffness * seconds * seconds);
        let half = 0.5 * kh;
        let discriminant = half * half - kh2;
        if kh <= 3.0 && kh2 <= 1.0 {
            series_response(kh, kh2, seconds)
        } else if discriminant > 1.0 {
            overdamped_response(half, kh2, discriminant, seconds)
        } else {
            damped_sine_response(stiffness, damping, half, discriminant, seconds)
        }
    }
}

/// g = h Σ cₙ with c₁ = 1, by the recurrence that the equation itself gives.
fn series_response(kh: f64, kh2: f64, h: f64) -> Response {
    let (mut before, mut now) = (0.0, 1.0);
    let mut sums = [0.0f64; 4];
    let mut n = 1.0;
    // κh ≤ 3 and Kh² ≤ 1: the fortieth term is below 1e-20.
    while n < 40.0 {
        sums[0] += n * now;
        sums[1] += now;
        sums[2] += now / (n + 1.0);
        sums[3] += now / ((n + 1.0) * (n + 2.0));
        let next = -(kh * n * now + kh2 * before) / (n * (n + 1.0));
        (before, now) = (now, next);
        if before.abs() + now.abs() < 1e-19 {
            break;
        }
        n += 1.0;
    }
    Response { impulse_rate: sums[0], impulse: h * sums[1], load: h * h * sums[2], ramp: h * h * h * sums[3] }
}

/// Two real roots x₁ > x₂ (times h), more than 2 apart.
fn overdamped_response(half: f64, kh2: f64, discriminant: f64, h: f64) -> Response {
    let x2 = -(half + discriminant.sqrt());
    // The second root comes from the product of both: the sum would cancel the digits of the small one.
    let x1 = kh2 / x2;
    let apart = x1 - x2;
    let (e1, e2) = (libm::exp(x1), libm::exp(x2));
    Response {
        impulse_rate: (x1 * e1 - x2 * e2) / apart,
        impulse: h * (e1 - e2) / apart,
        load: h * h * (exp_minus_one_over_x(x1) - exp_minus_one_over_x(x2)) / apart,
        ramp: h * h * h * (exp_remainder_over_x_squared(x1) - exp_remainder_over_x_squared(x2)) / apart,
    }
}

fn damped_sine_response(stiffness: f64, damping: f64, half: f64, discriminant: f64, h: f64) -> Response {
    let (cos, sinc) = if discriminant.abs() < 1e-4 {
        // Both are one series in the discriminant, whichever sign it has.
        let d = discriminant;
        (
            1.0 + d / 2.0 * (1.0 + d / 12.0 * (1.0 + d / 30.0)),
            1.0 + d / 6.0 * (1.0 + d / 20.0 * (1.0 + d / 42.0)),
        )
    } else if discriminant > 0.0 {
        let root = discriminant.sqrt();
        (libm::cosh(root), libm::sinh(root) / root)
    } else {
        let root = (-discriminant).sqrt();
        (libm::cos(root), libm::sin(root) / root)
    };
    let fall = libm::exp(-half);
    let impulse_rate = fall * (cos - half * sinc);
    let impulse = h * fall * sinc;
    // Kh² > 1 here, so nothing cancels.
    let load = (1.0 - impulse_rate - damping * impulse) / stiffness;
    let ramp = (h - impulse - damping * load) / stiffness;
    Response { impulse_rate, impulse, load, ramp }
}

/// (eˣ − 1) / x
fn exp_minus_one_over_x(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { libm::expm1(x) / x }
}

/// (eˣ − 1 − x) / x²
fn exp_remainder_over_x_squared(x: f64) -> f64 {
    if x.abs() > 0.5 {
        return (libm::expm1(x) - x) / (x * x);
    }
    let (mut sum, mut term) = (0.0, 0.5);
    for n in 3..20 {
        sum += term;
        term *= x / f64::from(n);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference solution: 20,000 steps of the classical fourth-order Runge–Kutta method.
    fn runge_kutta_reference(stiffness: f64, damping: f64, h: f64, v: f64, f0: f64, f1: f64) -> [f64; 2] {
        let steps = 20_000;
        let dt = h / f64::from(steps);
        let mut y = [0.0, v];
        let rate = |t: f64, y: [f64; 2]| [y[1], f0 + f1 * t - damping * y[1] - stiffness * y[0]];
        for i in 0..steps {
            let t = f64::from(i) * dt;
            let add = |k: [f64; 2], s: f64| [y[0] + k[0] * s, y[1] + k[1] * s];
            let k1 = rate(t, y);
            let k2 = rate(t + dt / 2.0, add(k1, dt / 2.0));
            let k3 = rate(t + dt / 2.0, add(k2, dt / 2.0));
            let k4 = rate(t + dt, add(k3, dt));
            for i in 0..2 {
                y[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
        y
    }

    #[test]
    fn response_equals_many_small_runge_kutta_steps() {
        let h = 0.5;
        let (v, f0, f1) = (0.7, -3.0, 5.0);
        for stiffness in [0.0, 1e-9, 0.5, 3.9, 4.1, 10.0, 400.0, 2500.0] {
            for damping in [0.0, 1e-9, 1.0, 5.9, 6.1, 40.0, 100.0, 300.0] {
                let r = Response::new(stiffness, damping, h);
                let got = [
                    v * r.impulse + f0 * r.load + f1 * r.ramp,
                    v * r.impulse_rate + f0 * r.impulse + f1 * r.load,
                ];
                let exact = runge_kutta_reference(stiffness, damping, h, v, f0, f1);
                for i in 0..2 {
                    let off = (got[i] - exact[i]).abs();
                    assert!(off < 1e-9, "K {stiffness}, κ {damping}: {got:?}, must be {exact:?}");
                }
            }
        }
    }

    #[test]
    fn formulas_agree_where_their_ranges_meet() {
        let near = |a: Response, b: Response| {
            let pairs = [
                (a.impulse_rate, b.impulse_rate),
                (a.impulse, b.impulse),
                (a.load, b.load),
                (a.ramp, b.ramp),
            ];
            pairs.iter().all(|(a, b)| (a - b).abs() < 1e-9)
        };
        let step = 1.0 + 1e-11;
        for damping in [0.0, 0.5, 1.999, 2.0, 2.5] {
            assert!(near(Response::new(1.0, damping, 1.0), Response::new(step, damping, 1.0)));
        }
        for stiffness in [0.0, 0.1, 0.99, 1.0] {
            assert!(near(Response::new(stiffness, 3.0, 1.0), Response::new(stiffness, 3.0 * step, 1.0)));
        }
        // Critical damping, from both sides, and where the two exponentials begin.
        for (stiffness, damping) in [(25.0, 10.0), (24.0, 10.0)] {
            assert!(near(
                Response::new(stiffness, damping, 1.0),
                Response::new(stiffness * step, damping, 1.0)
            ));
        }
    }

    #[test]
    fn response_is_finite_and_gains_no_energy_for_any_parameters() {
        for k in -12..=18 {
            for c in -12..=18 {
                for h in [0.0, 1e-6, 1.0 / 60.0, 10.0] {
                    let (stiffness, damping) = (libm::pow(10.0, f64::from(k)), libm::pow(10.0, f64::from(c)));
                    let r = Response::new(stiffness, damping, h);
                    let all = [r.impulse_rate, r.impulse, r.load, r.ramp];
                    assert!(all.iter().all(|v| v.is_finite()), "{stiffness} {damping} {h}: {r:?}");
                    // Energy after a unit impulse: at most what it was.
                    let energy = r.impulse_rate * r.impulse_rate + stiffness * r.impulse * r.impulse;
                    assert!(energy <= 1.0 + 1e-9, "{stiffness} {damping} {h}: {energy}");
                }
            }
        }
    }
}
