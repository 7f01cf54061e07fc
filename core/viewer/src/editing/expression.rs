//! Numbers that are typed as expressions.

/// Brackets within each other; deeper ones are no number that a person types.
const DEEPEST: usize = 32;

/// The value of an expression: numbers, `+ - * /`, parentheses, and `f(12)`, seconds of twelve frames at `fps` frames a second. `None`
/// where it is none, or not finite.
pub fn value(text: &str, fps: f64) -> Option<f64> {
    let mut parser = Parser { rest: text, fps, depth: 0 };
    let value = parser.sum()?;
    (parser.rest.trim().is_empty() && value.is_finite()).then_some(value)
}

/// Whether a typed text counts frames, `f(12)`, which gives a time.
pub fn counts_frames(text: &str) -> bool {
    text.contains("f(")
}

/// An expression as a script has it, `1.0 / 3.0` of `1/3`: each number has a point, since a script divides numbers without one as integers.
/// `None` where it is a number alone, or counts frames.
pub fn script_text(text: &str) -> Option<String> {
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

struct Parser<'t> {
    rest: &'t str,
    fps: f64,
    depth: usize,
}

impl Parser<'_> {
    /// Whether the next sign is this one; then it is passed.
    fn takes(&mut self, sign: &str) -> bool {
        let rest = self.rest.trim_start();
        let found = rest.strip_prefix(sign);
        self.rest = found.unwrap_or(rest);
        found.is_some()
    }

    fn sum(&mut self) -> Option<f64> {
        let mut value = self.product()?;
        loop {
            if self.takes("+") {
                value += self.product()?;
            } else if self.takes("-") {
                value -= self.product()?;
            } else {
                return Some(value);
            }
        }
    }

    fn product(&mut self) -> Option<f64> {
        let mut value = self.signed()?;
        loop {
            if self.takes("*") {
                value *= self.signed()?;
            } else if self.takes("/") {
                value /= self.signed()?;
            } else {
                return Some(value);
            }
        }
    }

    fn signed(&mut self) -> Option<f64> {
        // Typed with the sign that typographers use.
        let minus = self.takes("-") || self.takes("\u{2212}");
        let value = self.atom()?;
        Some(if minus { -value } else { value })
    }

    fn atom(&mut self) -> Option<f64> {
        let frames = self.takes("f(");
        if frames || self.takes("(") {
            self.depth += 1;
            let value = if self.depth <= DEEPEST { self.sum()? } else { return None };
            self.depth -= 1;
            let value = if frames { value / self.fps } else { value };
            return self.takes(")").then_some(value);
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
    fn an_expression_is_written_as_a_script_calculates_it() {
        for (typed, written) in [
            ("1/3", "1.0 / 3.0"),
            (" 2 * ( 1 - .25 )/3. ", "2.0 * (1.0 - 0.25) / 3.0"),
            ("-1/3", "-1.0 / 3.0"),
            ("1 - \u{2212}2/7", "1.0 - -2.0 / 7.0"),
        ] {
            assert_eq!(script_text(typed).as_deref(), Some(written));
            assert_eq!(value(typed, 25.0), value(written, 25.0), "{typed}");
        }
        for number in ["", "0.5", "-2", "(3)", "f(12)/3", "1,5"] {
            assert_eq!(script_text(number), None, "{number}");
        }
    }
}
