//! Formats numbers for messages, with significant digits only.

use choreo_motion::Time;
use glam::DVec3;

/// Formats a number with at most six significant digits and no trailing zeros.
pub(super) fn number(v: f64) -> String {
    if !v.is_finite() {
        return if v.is_nan() { "nothing".into() } else { format!("{v}") };
    }
    if v == 0.0 {
        return "0".into();
    }
    let size = v.abs();
    if !(1e-4..1e9).contains(&size) {
        return format!("{v:.3e}");
    }
    let whole = libm::log10(size).floor() as i32 + 1;
    let decimals = (6 - whole).clamp(0, 9) as usize;
    let text = format!("{v:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

pub(crate) fn number_with_unit(v: f64, unit: &str) -> String {
    match unit {
        _ if v.is_nan() => number(v),
        "" => number(v),
        "°" => format!("{}°", number(v)),
        unit => format!("{} {unit}", number(v)),
    }
}

pub(super) fn point(v: DVec3) -> String {
    if v.is_nan() {
        return "nothing".into();
    }
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

pub(super) fn time(t: Time) -> String {
    format!("{} s", number(t.as_secs()))
}

/// Formats the ratio to a tolerance, such as `, 14 times the tolerance`; empty if there is none.
pub(crate) fn tolerance_ratio(off: f64, tolerance: f64) -> String {
    match tolerance > 0.0 && off.is_finite() {
        true => format!(", {} times the tolerance", number((off / tolerance * 10.0).round() / 10.0)),
        false => String::new(),
    }
}

/// Whether a text matches a pattern in which `*` stands for any text and `?` for one character.
pub(super) fn matches_pattern(text: &str, pattern: &str) -> bool {
    let (text, pattern): (Vec<char>, Vec<char>) = (text.chars().collect(), pattern.chars().collect());
    let (mut t, mut p) = (0, 0);
    // Positions in the text and the pattern at which matching resumes if the last `*` must match one more character.
    let mut resume_at: Option<(usize, usize)> = None;
    while t < text.len() {
        match pattern.get(p) {
            Some('*') => {
                resume_at = Some((t, p));
                p += 1;
            }
            Some(c) if *c == '?' || *c == text[t] => {
                t += 1;
                p += 1;
            }
            _ => match resume_at {
                Some((from, star)) => {
                    resume_at = Some((from + 1, star));
                    (t, p) = (from + 1, star + 1);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_significant_digits_and_no_trailing_zeros() {
        let cases = [
            (0.1, "0.1"),
            (1.0, "1"),
            (-2.5, "-2.5"),
            (1.0 / 3.0, "0.333333"),
            (1234.5678, "1234.57"),
            (1e-9, "1.000e-9"),
        ];
        for (v, text) in cases {
            assert_eq!(number(v), text);
        }
        assert_eq!(point(DVec3::new(0.1, 0.0, -3.0)), "[0.1, 0, -3]");
    }

    #[test]
    fn a_star_matches_any_text_and_a_question_mark_one_character() {
        for (text, pattern, expected) in [
            ("anna: Walk starts", "anna: * starts", true),
            ("anna: Walk ends", "anna: * starts", false),
            ("abc", "a?c", true),
            ("abc", "a?", false),
            ("", "*", true),
            ("aXbXc", "*X*X*", true),
            ("aab", "*ab", true),
        ] {
            assert_eq!(matches_pattern(text, pattern), expected, "{text} {pattern}");
        }
    }
}
