//! Line plot: shares from 0 to 1 over a logarithmic axis.

use super::number::quantity;
use super::svg::{Anchor, BLUE, GRAY, GRID, INK, RED, Svg};

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 590.0;
const TOP: f64 = 44.0;
const BOTTOM: f64 = 350.0;
const COLORS: [&str; 6] = [INK, BLUE, "#2f855a", "#b7791f", RED, "#6b46c1"];

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    pub title: String,
    /// Names of the axes.
    pub x: String,
    pub y: String,
    /// Lines by name: points (x above 0, y from 0 to 1), x increasing.
    pub lines: Vec<(String, Vec<(f64, f64)>)>,
}

impl Lines {
    pub fn svg(&self) -> String {
        let all = || self.lines.iter().flat_map(|(_, points)| points);
        let low = all().map(|(x, _)| libm::log10(*x)).fold(f64::INFINITY, f64::min);
        let high = all().map(|(x, _)| libm::log10(*x)).fold(f64::NEG_INFINITY, f64::max);
        let place = |(x, y): (f64, f64)| {
            let share = (libm::log10(x) - low) / (high - low).max(1e-9);
            (LEFT + share * (RIGHT - LEFT), BOTTOM - y.clamp(0.0, 1.0) * (BOTTOM - TOP))
        };
        let mut svg = Svg::new(WIDTH, HEIGHT);
        svg.text((LEFT, 24.0), &self.title, 15.0, INK, Anchor::Start);
        for tenth in (0..=10).step_by(2) {
            let y = f64::from(tenth) / 10.0;
            let (_, at) = place((libm::pow(10.0, low), y));
            svg.line((LEFT, at), (RIGHT, at), GRID, 1.0, "");
            svg.text((LEFT - 8.0, at + 4.0), &format!("{} %", tenth * 10), 11.0, GRAY, Anchor::End);
        }
        for decade in (low.ceil() as i32)..=(high.floor() as i32) {
            for step in [1.0, 2.0, 5.0] {
                let x = step * libm::pow(10.0, f64::from(decade));
                if libm::log10(x) > high + 1e-9 {
                    continue;
                }
                let (at, _) = place((x, 0.0));
                svg.line((at, TOP), (at, BOTTOM), GRID, 1.0, "");
                svg.text((at, BOTTOM + 18.0), &quantity(x), 11.0, GRAY, Anchor::Middle);
            }
        }
        for (number, (name, points)) in self.lines.iter().enumerate() {
            let color = COLORS[number % COLORS.len()];
            for pair in points.windows(2) {
                svg.line(place(pair[0]), place(pair[1]), color, 2.0, "");
            }
            // The names are listed in the order of the lines, because the ends of lines may overlap.
            let at = TOP + 14.0 + 20.0 * number as f64;
            svg.line((RIGHT + 12.0, at - 4.0), (RIGHT + 28.0, at - 4.0), color, 2.0, "");
            svg.text((RIGHT + 34.0, at), name, 11.0, color, Anchor::Start);
        }
        svg.text(((LEFT + RIGHT) * 0.5, HEIGHT - 14.0), &self.x, 12.0, INK, Anchor::Middle);
        svg.text_up((18.0, (TOP + BOTTOM) * 0.5), &self.y, 12.0, INK);
        svg.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_drawn_at_their_logarithmic_positions() {
        let lines = vec![("a".to_string(), vec![(1.0, 0.0), (10.0, 1.0), (100.0, 0.5)])];
        let svg = Lines { title: "t".into(), x: "x".into(), y: "y".into(), lines }.svg();
        let middle = (LEFT + RIGHT) * 0.5;
        assert!(
            svg.contains(&format!("x1=\"{LEFT:.1}\" y1=\"{BOTTOM:.1}\" x2=\"{middle:.1}\" y2=\"{TOP:.1}\"")),
            "{svg}"
        );
    }
}
