//! Stiff and extreme cases: the quantity measured in each, and its bound. `tests/matrix.rs` runs them and prints the results.

pub mod devices;
pub mod ik_targets;
pub mod images;
pub mod poses;
pub mod springs;

/// A test case.
pub struct Case {
    pub name: &'static str,
    /// Quantity that `run` returns, with its unit.
    pub measured: &'static str,
    pub bound: f64,
    pub run: fn() -> f64,
}

impl Case {
    pub const fn new(name: &'static str, measured: &'static str, bound: f64, run: fn() -> f64) -> Case {
        Case { name, measured, bound, run }
    }

    /// Whether a value is within the bound; NaN is not.
    pub fn holds(&self, value: f64) -> bool {
        value.is_finite() && value <= self.bound
    }
}

pub fn all() -> impl Iterator<Item = &'static Case> {
    springs::CASES
        .iter()
        .chain(ik_targets::CASES)
        .chain(poses::CASES)
        .chain(images::CASES)
        .chain(devices::CASES)
}

/// 0 if the result is an error that contains `part`, as expected, else 1.
fn refused(result: Result<(), String>, part: &str) -> f64 {
    match result {
        Err(text) if text.contains(part) => 0.0,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_can_fail() {
        let case = Case::new("", "", 1e-3, || 0.0);
        assert!(case.holds(1e-3) && case.holds(0.0));
        assert!(!case.holds(2e-3) && !case.holds(f64::NAN) && !case.holds(f64::INFINITY));
        assert_eq!(
            (refused(Ok(()), "x"), refused(Err("y".into()), "x"), refused(Err("xy".into()), "x")),
            (1.0, 1.0, 0.0)
        );
    }
}
