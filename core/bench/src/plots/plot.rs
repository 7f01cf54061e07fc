//! Plot of error against cost, both logarithmic: each method is a labeled point, the Pareto front a dashed line, the chosen method a
//! filled point.

use super::choice::{Choice, Row};
use super::number::{bytes, duration, quantity};
use super::svg::{Anchor, BLUE, GRAY, GRID, INK, RED, Room, Svg, fitting, text_width};

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 440.0;
/// Left, top, right and bottom margin, pixels.
const MARGIN: [f64; 4] = [78.0, 54.0, 24.0, 58.0];
/// Height of the strip for exact methods: an error of zero has no place on a logarithmic axis.
const EXACT_STRIP_HEIGHT: f64 = 26.0;
const LABEL_SIZE: f64 = 12.0;

/// A logarithmic axis over a range of pixels.
struct Axis {
    low: f64,
    high: f64,
    pixels: (f64, f64),
}

impl Axis {
    /// Range that holds the values, at least one decade.
    fn new(values: impl Iterator<Item = f64> + Clone, pixels: (f64, f64)) -> Axis {
        let logs = values.filter(|v| *v > 0.0 && v.is_finite()).map(libm::log10);
        let low = logs.clone().fold(f64::INFINITY, f64::min);
        let high = logs.fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            return Axis { low: 0.0, high: 1.0, pixels };
        }
        // A margin on both sides; a whole decade if all values are nearly equal.
        let air = ((high - low) * 0.08).max(0.12);
        let (mut low, mut high) = (low - air, high + air);
        if high - low < 1.0 {
            let middle = (low + high) * 0.5;
            (low, high) = (middle - 0.5, middle + 0.5);
        }
        Axis { low, high, pixels }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (libm::log10(value) - self.low) / (self.high - self.low);
        self.pixels.0 + share * (self.pixels.1 - self.pixels.0)
    }

    /// Ticks at whole decades, and at 2 and 5 times them if there are few.
    fn ticks(&self) -> Vec<f64> {
        let steps: &[f64] = if self.high - self.low < 2.2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = ((self.high - self.low) / 8.0).ceil().max(1.0) as i32;
        let mut ticks = Vec::new();
        for decade in (self.low.floor() as i32)..=(self.high.ceil() as i32) {
            if decade.rem_euclid(every) == 0 {
                ticks.extend(steps.iter().map(|s| s * libm::pow(10.0, f64::from(decade))));
            }
        }
        ticks.retain(|t| (self.low..=self.high).contains(&libm::log10(*t)));
        ticks
    }
}

/// Frame around the points: the question, the axes and their labels.
struct Frame<'a> {
    choice: &'a Choice,
    x: &'a Axis,
    y: &'a Axis,
    /// The cost is a time, else a size in bytes.
    timed: bool,
    /// Some methods are exact: their error is 0.
    exact: bool,
    /// Lowest y of the axis of errors, pixels.
    floor: f64,
}

impl Frame<'_> {
    fn draw(&self, svg: &mut Svg) {
        let Frame { choice, x, y, timed, exact, floor } = *self;
        let (left, right) = (MARGIN[0], WIDTH - MARGIN[2]);
        let (top, bottom) = (MARGIN[1], HEIGHT - MARGIN[3]);
        let (question, size) = fitting(&choice.question, 15.0, right - left);
        svg.text((left, 24.0), &question, size, INK, Anchor::Start);
        if !choice.why.is_empty() {
            let chosen = choice.chosen.map_or("", |c| choice.rows[c].name.as_str());
            let (text, size) = fitting(&format!("chosen: {chosen}, {}", choice.why), 12.0, right - left);
            svg.text((left, 42.0), &text, size, GRAY, Anchor::Start);
        }
        for tick in x.ticks() {
            let at = x.at(tick);
            svg.line((at, top), (at, bottom), GRID, 1.0, "");
            let text = if timed { duration(tick) } else { bytes(tick) };
            svg.text((at, bottom + 18.0), &round_tick_text(&text), 11.0, GRAY, Anchor::Middle);
        }
        for tick in y.ticks() {
            let at = y.at(tick);
            svg.line((left, at), (right, at), GRID, 1.0, "");
            svg.text((left - 8.0, at + 4.0), &round_tick_text(&quantity(tick)), 11.0, GRAY, Anchor::End);
        }
        if exact {
            svg.text((left - 8.0, bottom - EXACT_STRIP_HEIGHT * 0.4 + 4.0), "exact", 11.0, GRAY, Anchor::End);
            svg.line((left, floor), (right, floor), GRAY, 0.5, "2 3");
        }
        svg.line((left, top), (left, bottom), GRAY, 1.0, "");
        svg.line((left, bottom), (right, bottom), GRAY, 1.0, "");
        let what = if timed { "time" } else { "size" };
        let per = if choice.per.is_empty() || !timed {
            what.to_string()
        } else {
            format!("time of one {}", choice.per)
        };
        svg.text(((left + right) * 0.5, HEIGHT - 14.0), &per, 12.0, INK, Anchor::Middle);
        let unit =
            if choice.error_unit.is_empty() { String::new() } else { format!(", {}", choice.error_unit) };
        svg.text_up(
            (20.0, (top + bottom) * 0.5),
            &format!("{} error{unit}", if choice.by_mean { "mean" } else { "worst" }),
            12.0,
            INK,
        );
    }
}

/// The image of a choice as SVG; `None` where no row has both an error and a cost.
pub fn plot(choice: &Choice) -> Option<String> {
    let points: Vec<(usize, &Row, f64)> = choice
        .rows
        .iter()
        .enumerate()
        .filter_map(|(i, row)| Some((i, row, row.cost()?)))
        .filter(|(_, row, cost)| choice.error_of(row).is_finite() && *cost > 0.0)
        .collect();
    if points.is_empty() {
        return None;
    }
    let timed = points.iter().any(|(_, row, _)| row.nanos.is_some());
    let (left, right) = (MARGIN[0], WIDTH - MARGIN[2]);
    let (top, bottom) = (MARGIN[1], HEIGHT - MARGIN[3]);
    let exact = points.iter().any(|(_, row, _)| choice.error_of(row) <= 0.0);
    let floor = if exact { bottom - EXACT_STRIP_HEIGHT } else { bottom };
    let x = Axis::new(points.iter().map(|p| p.2), (left, right));
    let y = Axis::new(points.iter().map(|p| choice.error_of(p.1)), (floor, top));
    let place = |row: &Row, cost: f64| {
        let error = choice.error_of(row);
        (x.at(cost), if error > 0.0 { y.at(error) } else { bottom - EXACT_STRIP_HEIGHT * 0.4 })
    };

    let mut svg = Svg::new(WIDTH, HEIGHT);
    Frame { choice, x: &x, y: &y, timed, exact, floor }.draw(&mut svg);

    let mut front: Vec<(f64, f64)> = Vec::new();
    for i in choice.front() {
        front.extend(points.iter().filter(|p| p.0 == i).map(|(_, row, cost)| place(row, *cost)));
    }
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    for pair in front.windows(2) {
        svg.line(pair[0], pair[1], GRAY, 1.0, "4 4");
    }
    let mut room = Room::default();
    for (_, row, cost) in &points {
        let at = place(row, *cost);
        room.take((at.0 - 6.0, at.1 - 6.0), (12.0, 12.0));
    }
    // The chosen point is drawn last, so that it covers points that are as good.
    let (last, first): (Vec<_>, Vec<_>) = points.iter().partition(|p| choice.chosen == Some(p.0));
    for (i, row, cost) in first.into_iter().chain(last).copied() {
        let at = place(row, cost);
        let chosen = choice.chosen == Some(i);
        svg.circle(
            at,
            if chosen { 6.5 } else { 4.5 },
            if chosen { RED } else { "#ffffff" },
            if chosen { RED } else { BLUE },
        );
        let color = if chosen { RED } else { INK };
        draw_label(&mut svg, &mut room, at, &row.name, color, (left, right, top, bottom));
    }
    Some(svg.finish())
}

/// Stacks several images below each other into one.
pub fn stacked(images: &[String]) -> String {
    let height = HEIGHT * images.len().max(1) as f64;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\">\n"
    );
    for (i, image) in images.iter().enumerate() {
        let top = HEIGHT * i as f64;
        out += &image.replacen("<svg ", &format!("<svg x=\"0\" y=\"{top}\" "), 1);
    }
    out + "</svg>\n"
}

/// Draws the label of a point beside, above or below it, where it covers the least.
fn draw_label(
    svg: &mut Svg,
    room: &mut Room,
    at: (f64, f64),
    text: &str,
    color: &str,
    frame: (f64, f64, f64, f64),
) {
    let size = (text_width(text, LABEL_SIZE), LABEL_SIZE + 3.0);
    let mut best: Option<(f64, (f64, f64))> = None;
    for (dx, dy) in [
        (9.0, -8.0),
        (-9.0 - size.0, -8.0),
        (-size.0 * 0.5, -24.0),
        (-size.0 * 0.5, 9.0),
        (9.0, 6.0),
        (9.0, -24.0),
        (-9.0 - size.0, 8.0),
        (-9.0 - size.0, -24.0),
    ] {
        let corner = (at.0 + dx, at.1 + dy);
        let (left, right, top, bottom) = frame;
        let outside = (left - corner.0).max(0.0)
            + (corner.0 + size.0 - right).max(0.0)
            + (top - corner.1).max(0.0)
            + (corner.1 + size.1 - bottom).max(0.0);
        let cost = room.overlap(corner, size) + outside * 50.0;
        if best.is_none_or(|(least, _)| cost < least) {
            best = Some((cost, corner));
        }
    }
    if let Some((_, corner)) = best {
        room.take(corner, size);
        svg.text((corner.0, corner.1 + LABEL_SIZE), text, LABEL_SIZE, color, Anchor::Start);
    }
}

/// Text of a tick, which is a round number: "1.00 ms" becomes "1 ms".
fn round_tick_text(text: &str) -> String {
    let (number, unit) = text.split_once(' ').unwrap_or((text, ""));
    let number = match number.split_once('e') {
        Some((mantissa, exponent)) => format!("{}e{exponent}", without_trailing_zeros(mantissa)),
        None => without_trailing_zeros(number).to_string(),
    };
    if unit.is_empty() { number } else { format!("{number} {unit}") }
}

fn without_trailing_zeros(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_methods_are_drawn_and_the_chosen_one_is_marked() {
        let mut c = Choice::new("c", "Which <way>?");
        c.rows.push(Row::new("a & b").error(0.0, 0.0).nanos(100.0));
        c.rows.push(Row::new("rough").error(1e-3, 1e-4).nanos(3.0));
        c.rows.push(Row::new("unmeasured").error(1.0, 1.0));
        c.choose("rough", "it is cheap");
        let svg = plot(&c).unwrap();
        assert!(svg.contains("a &amp; b") && svg.contains("Which &lt;way&gt;?") && svg.contains(">exact<"));
        assert!(!svg.contains("unmeasured"));
        assert_eq!(svg.matches("<circle").count(), 2);
        assert_eq!(svg.matches(&format!("fill=\"{RED}\" stroke")).count(), 1);
        assert_eq!(plot(&Choice::new("none", "?")), None);
    }

    #[test]
    fn ticks_are_round() {
        let axis = Axis::new([3.0, 4000.0].into_iter(), (0.0, 1.0));
        assert_eq!(axis.ticks(), [10.0, 100.0, 1000.0]);
        assert_eq!(
            (round_tick_text("1.00 ms"), round_tick_text("1.00e-5"), round_tick_text("100 ns")),
            ("1 ms".into(), "1e-5".into(), "100 ns".into())
        );
        let one = Axis::new([5.0].into_iter(), (0.0, 100.0));
        assert!((one.at(5.0) - 50.0).abs() < 1e-9);
    }
}
