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
