//! Numbers as text for people: three significant digits, and units that fit.

/// Three significant digits; `1.20e-7` below 0.001, and from a million on.
pub fn quantity(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return if value.is_nan() {
            "–".into()
        } else {
            format!("{}∞", if value < 0.0 { "−" } else { "" })
        };
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.2e}");
    }
    // Digits before the point; rounding 9.995 up to 10.0 is a digit more and does not matter here.
    let before = (libm::log10(size).floor() as i32).max(-4);
    let decimals = (2 - before).clamp(0, 6) as usize;
    format!("{value:.decimals$}")
}

/// Nanoseconds as ns, µs, ms or s.
pub fn duration(nanos: f64) -> String {
    with_unit(nanos, &[(1e9, "s"), (1e6, "ms"), (1e3, "µs"), (1.0, "ns")])
}

/// Bytes as B, kB, MB or GB (powers of ten).
pub fn bytes(count: f64) -> String {
    with_unit(count, &[(1e9, "GB"), (1e6, "MB"), (1e3, "kB"), (1.0, "B")])
}

fn with_unit(value: f64, units: &[(f64, &str)]) -> String {
    let fits = units.iter().find(|(size, _)| value.abs() >= *size * 0.9995).or(units.last());
    fits.map_or_else(|| quantity(value), |(size, unit)| format!("{} {unit}", quantity(value / size)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_three_digits_and_a_fitting_unit() {
        let cases = [
            (0.0, "0"),
            (1.0, "1.00"),
            (12.345, "12.3"),
            (123.4, "123"),
            (0.01234, "0.0123"),
            (1.2e-7, "1.20e-7"),
        ];
        for (value, expected) in cases {
            assert_eq!(quantity(value), expected);
        }
        assert_eq!(
            (duration(1200.0), duration(0.5), duration(2.5e9)),
            ("1.20 µs".into(), "0.500 ns".into(), "2.50 s".into())
        );
        assert_eq!((bytes(999.6), bytes(12.0)), ("1.000 kB".into(), "12.0 B".into()));
        assert_eq!(quantity(f64::INFINITY), "∞");
    }
}
