//! Parser of numbers that the user types as expressions.

/// Deepest nesting of parentheses that is parsed.
const MAX_NESTING: usize = 32;

/// Value of an expression: numbers, `+ - * /`, parentheses, and `f(12)`, the time of frame 12 in seconds at `fps` frames per second. `None` if it
/// is not an expression, or its value is not finite.
pub fn evaluate(text: &str, fps: f64) -> Option<f64> {
    let mut parser = Parser { rest: text, fps, depth: 0 };
    let value = parser.parse_sum()?;
    (parser.rest.trim().is_empty() && value.is_finite()).then_some(value)
}

/// Whether a typed text counts frames, `f(12)`, and so is a time.
pub fn counts_frames(text: &str) -> bool {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices("f(").any(|(at, _)| !text[..at].ends_with(is_name))
}

/// A typed expression in script syntax: `1.0 / 3.0` for `1/3`, since a script divides numbers without a point as integers; `f(12)` for `f( 12 )`.
/// `None` for a single number and for calculations with frames.
pub fn to_script_syntax(text: &str) -> Option<String> {
    let frame = text.trim().strip_prefix("f(").and_then(|rest| rest.strip_suffix(')'));
    if let Some(frame) = frame.and_then(|frame| frame.trim().parse::<u32>().ok()) {
        return Some(format!("f({frame})"));
    }
    let (mut written, mut is_operand, mut calculates) = (String::new(), false, false);
    let mut rest = text.trim();
    while let Some(sign) = rest.chars().next() {
        let mut length = sign.len_utf8();
        match sign {
            '0'..='9' | '.' => {
                length = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
                let (whole, part) = rest[..length].split_once('.').unwrap_or((&rest[..length], ""));
                let or_zero =
                    |digits: &str| if digits.is_empty() { "0".to_string() } else { digits.to_string() };
                written += &format!("{}.{}", or_zero(whole), or_zero(part));
                is_operand = true;
            }
            '+' | '-' | '*' | '/' | '\u{2212}' => {
                let sign = if sign == '\u{2212}' { '-' } else { sign };
                written += &if is_operand { format!(" {sign} ") } else { sign.to_string() };
                calculates |= is_operand;
                is_operand = false;
            }
            '(' | ')' => {
                written.push(sign);
                is_operand = sign == ')';
            }
            ' ' => {}
            _ => return None,
        }
        rest = &rest[length..];
    }
    calculates.then_some(written)
}

/// Value of a calculation in a script, `1.0 / 3.0`. `None` if it is not a calculation with literals alone, or has a number without a decimal point,
/// which the script would treat as an integer.
pub(super) fn evaluate_literals(text: &str) -> Option<f64> {
    let written = to_script_syntax(text).filter(|_| !counts_frames(text))?;
    let signs = |text: &str| text.chars().filter(|c| *c != ' ').collect::<String>();
    // The texts differ if a number has no decimal point.
    (signs(&written) == signs(text)).then(|| evaluate(&written, 1.0)).flatten()
}

struct Parser<'t> {
    rest: &'t str,
    fps: f64,
    depth: usize,
}

impl Parser<'_> {
    /// Consumes `sign` if it comes next, and returns whether it did.
    fn consume(&mut self, sign: &str) -> bool {
        let rest = self.rest.trim_start();
        let found = rest.strip_prefix(sign);
        self.rest = found.unwrap_or(rest);
        found.is_some()
    }

    fn parse_sum(&mut self) -> Option<f64> {
        let mut value = self.parse_product()?;
        loop {
            if self.consume("+") {
                value += self.parse_product()?;
            } else if self.consume("-") {
                value -= self.parse_product()?;
            } else {
                return Some(value);
            }
        }
    }

    fn parse_product(&mut self) -> Option<f64> {
        let mut value = self.parse_signed()?;
        loop {
            if self.consume("*") {
                value *= self.parse_signed()?;
            } else if self.consume("/") {
                value /= self.parse_signed()?;
            } else {
                return Some(value);
            }
        }
    }

    fn parse_signed(&mut self) -> Option<f64> {
        // The minus sign U+2212 is accepted, too.
        let minus = self.consume("-") || self.consume("\u{2212}");
        let value = self.parse_atom()?;
        Some(if minus { -value } else { value })
    }

    fn parse_atom(&mut self) -> Option<f64> {
        let frames = self.consume("f(");
        if frames || self.consume("(") {
            self.depth += 1;
            let value = if self.depth <= MAX_NESTING { self.parse_sum()? } else { return None };
            self.depth -= 1;
            let value = if frames { value / self.fps } else { value };
            return self.consume(")").then_some(value);
        }
        let rest = self.rest.trim_start();
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        self.rest = &rest[end..];
        rest[..end].parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typed_expressions_are_converted_to_script_syntax() {
        for (typed, written) in [
            ("1/3", "1.0 / 3.0"),
            (" 2 * ( 1 - .25 )/3. ", "2.0 * (1.0 - 0.25) / 3.0"),
            ("-1/3", "-1.0 / 3.0"),
            ("1 - \u{2212}2/7", "1.0 - -2.0 / 7.0"),
            (" f( 12 ) ", "f(12)"),
        ] {
            assert_eq!(to_script_syntax(typed).as_deref(), Some(written));
            assert_eq!(evaluate(typed, 25.0), evaluate(written, 25.0), "{typed}");
        }
        for number in ["", "0.5", "-2", "(3)", "f(12)/3", "f(1.5)", "1,5"] {
            assert_eq!(to_script_syntax(number), None, "{number}");
        }
    }

    #[test]
    fn only_calls_of_f_count_frames() {
        assert!(["f(12)", "f(12) / 3", "2 * f(1)"].into_iter().all(counts_frames));
        assert!(!["half(3)", "my_f(2)", "f", "12"].into_iter().any(counts_frames));
    }

    /// A script divides whole numbers into whole ones.
    #[test]
    fn script_calculations_need_a_decimal_point_in_each_number() {
        assert_eq!(evaluate_literals("1.0 / 4.0"), Some(0.25));
        assert_eq!(evaluate_literals("-(2.0+1.0)*2.0"), Some(-6.0));
        for other in ["1 / 4", "1.0 / 4", "0.25", "f(12)", "x * 2.0"] {
            assert_eq!(evaluate_literals(other), None, "{other}");
        }
    }
}
