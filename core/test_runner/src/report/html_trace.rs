//! Plots of curves over time as SVG: actual values, expected values, and the allowed range.

use super::junit::escape_xml;
use crate::outcome::Trace;
use std::fmt::Write;

const WIDTH: f64 = 680.0;
const HEIGHT: f64 = 180.0;
/// Margins of the plot, for the numbers: left, top, right, bottom.
const MARGIN: [f64; 4] = [64.0, 10.0, 12.0, 24.0];
/// Largest number of points in a curve: at the plot's width more cannot be distinguished.
const MAX_POINTS: usize = 1300;
/// Largest number of plots for one check.
const MAX_PLOTS: usize = 12;

pub(super) fn plots(traces: &[Trace]) -> String {
    let drawn: String = traces.iter().take(MAX_PLOTS).map(plot).collect();
    if drawn.is_empty() {
        return drawn;
    }
    let mut html = legend(&drawn);
    html.push_str(&drawn);
    if traces.len() > MAX_PLOTS {
        let more = traces.len() - MAX_PLOTS;
        let s = if more == 1 { "" } else { "s" };
        let _ = writeln!(html, "<p class=\"dim\">and {more} more curve{s}</p>");
    }
    html
}

/// Legend of the lines that the plots contain.
fn legend(drawn: &str) -> String {
    let keys = [
        ("got", "got"),
        ("expected", "expected"),
        ("band", "allowed"),
        ("mark", "time of the assertion, or of the worst value"),
    ];
    let present = keys.iter().filter(|(class, _)| drawn.contains(&format!("class=\"{class}\"")));
    let mut html = String::from("<p class=\"legend\">");
    for (class, words) in present {
        let shape = match *class {
            "band" => "<rect class=\"band\" x=\"1\" y=\"3\" width=\"26\" height=\"10\"/>".to_string(),
            "mark" => "<path class=\"mark\" d=\"M14 1V15\"/>".to_string(),
            class => format!("<path class=\"{class}\" d=\"M1 8H27\"/>"),
        };
        let _ = write!(
            html,
            "<span><svg viewBox=\"0 0 28 16\" aria-hidden=\"true\">{shape}</svg> {words}</span> "
        );
    }
    html.push_str("</p>\n");
    html
}

fn plot(trace: &Trace) -> String {
    let count = trace.times.len().min(trace.got.len());
    let finite = |v: &f64| v.is_finite();
    let times: Vec<f64> = trace.times.iter().copied().filter(finite).collect();
    let values: Vec<f64> = (trace.got.iter().chain(&trace.expected).copied())
        .chain(trace.band.iter().flatten().copied())
        .filter(finite)
        .collect();
    if count == 0 || times.is_empty() || values.is_empty() {
        return String::new();
    }
    let axes = Axes { times: padded_range(&times, 0.0), values: padded_range(&values, 0.08) };
    let drawn = drawn_points(trace, count);
    let unit = if trace.unit.is_empty() { String::new() } else { format!(", {}", trace.unit) };
    let mut svg = format!(
        "<figure class=\"trace\"><figcaption>{}{}</figcaption><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">",
        escape_xml(&trace.label),
        escape_xml(&unit),
        escape_xml(&trace.label)
    );
    axes.draw_grid(&mut svg);
    axes.draw_band(&mut svg, trace, &drawn);
    axes.draw_curves(&mut svg, trace, &drawn);
    let (t0, t1) = axes.times;
    if let Some(mark) = trace.mark.filter(|m| (t0..=t1).contains(m)) {
        let [_, top, _, bottom] = MARGIN;
        let _ = write!(svg, "<path class=\"mark\" d=\"M{:.1} {top}V{}\"/>", axes.x(mark), HEIGHT - bottom);
    }
    svg.push_str("</svg></figure>\n");
    svg
}

/// Range from the lowest to the highest value, extended by a fraction of its size on both sides.
fn padded_range(values: &[f64], pad: f64) -> (f64, f64) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let size = high - low;
    // A constant curve is drawn in the middle.
    let extra = if size > 0.0 { size * pad } else { (high.abs() * 0.01).max(1e-6) };
    (low - extra, high + extra)
}

/// Ranges of a plot's axes.
struct Axes {
    times: (f64, f64),
    values: (f64, f64),
}

impl Axes {
    fn x(&self, t: f64) -> f64 {
        let ([left, _, right, _], (t0, t1)) = (MARGIN, self.times);
        left + (t - t0) / (t1 - t0) * (WIDTH - left - right)
    }

    fn y(&self, v: f64) -> f64 {
        let ([_, top, _, bottom], (v0, v1)) = (MARGIN, self.values);
        HEIGHT - bottom - (v.clamp(v0, v1) - v0) / (v1 - v0) * (HEIGHT - top - bottom)
    }

    fn draw_grid(&self, svg: &mut String) {
        let [left, top, right, bottom] = MARGIN;
        let ((v0, v1), (t0, t1)) = (self.values, self.times);
        for v in ticks(v0, v1, 5) {
            let at = self.y(v);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{left} {at:.1}H{}\"/><text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                WIDTH - right,
                left - 6.0,
                at + 4.0,
                tick_label(v, v1 - v0)
            );
        }
        for t in ticks(t0, t1, 8) {
            let at = self.x(t);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{at:.1} {top}V{}\"/><text class=\"tick\" x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{} s</text>",
                HEIGHT - bottom,
                HEIGHT - 8.0,
                tick_label(t, t1 - t0)
            );
        }
    }

    fn draw_band(&self, svg: &mut String, trace: &Trace, keep: &[usize]) {
        for run in
            consecutive_runs(keep, |i| trace.band.get(i).is_some_and(|b| !b[0].is_nan() && !b[1].is_nan()))
        {
            let point =
                |i: usize, side: usize, by: f64| (self.x(trace.times[i]) + by, self.y(trace.band[i][side]));
            let points: Vec<(f64, f64)> = match run.as_slice() {
                // A single time: the bar is made wide enough to be visible.
                [i] => {
                    [(1, -4.0), (1, 4.0), (0, 4.0), (0, -4.0)].map(|(side, by)| point(*i, side, by)).to_vec()
                }
                run => {
                    let high = run.iter().map(|i| point(*i, 1, 0.0));
                    high.chain(run.iter().rev().map(|i| point(*i, 0, 0.0))).collect()
                }
            };
            let _ = write!(svg, "<path class=\"band\" d=\"{}Z\"/>", path_data(&points));
        }
    }

    fn draw_curves(&self, svg: &mut String, trace: &Trace, keep: &[usize]) {
        for (class, values) in [("expected", &trace.expected), ("got", &trace.got)] {
            for run in consecutive_runs(keep, |i| values.get(i).is_some_and(|v| v.is_finite())) {
                let points: Vec<(f64, f64)> =
                    run.iter().map(|i| (self.x(trace.times[*i]), self.y(values[*i]))).collect();
                let _ = match points.as_slice() {
                    [(px, py)] => {
                        write!(svg, "<circle class=\"{class}\" cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"3\"/>")
                    }
                    _ => write!(svg, "<path class=\"{class}\" d=\"{}\"/>", path_data(&points)),
                };
            }
        }
    }
}

/// Indices of the points that are drawn: all points of a short curve, or the lowest and highest in each short range of a long one.
fn drawn_points(trace: &Trace, count: usize) -> Vec<usize> {
    if count <= MAX_POINTS {
        return (0..count).collect();
    }
    let points_per_group = count.div_ceil(MAX_POINTS / 4);
    let mut keep = Vec::new();
    for from in (0..count).step_by(points_per_group) {
        let to = (from + points_per_group).min(count);
        let by = |i: &usize, j: &usize| trace.got[*i].total_cmp(&trace.got[*j]);
        keep.push(from);
        keep.extend((from..to).min_by(by));
        keep.extend((from..to).max_by(by));
        keep.push(to - 1);
    }
    keep.sort_unstable();
    keep.dedup();
    keep
}

/// Groups of neighboring indices for which `is_drawn` is true.
fn consecutive_runs(keep: &[usize], is_drawn: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
    let groups = keep.chunk_by(|a, b| is_drawn(*a) == is_drawn(*b));
    groups.filter(|g| is_drawn(g[0])).map(<[usize]>::to_vec).collect()
}

/// Value of the attribute `d` of an SVG path through the points.
fn path_data(points: &[(f64, f64)]) -> String {
    let mut path = String::new();
    for (i, (x, y)) in points.iter().enumerate() {
        let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' });
    }
    path
}

/// Round numbers within a range, about `target_count` of them, for the ticks of an axis.
fn ticks(low: f64, high: f64, target_count: usize) -> Vec<f64> {
    let raw = (high - low) / target_count as f64;
    if !(raw.is_finite() && raw > 0.0) {
        return Vec::new();
    }
    let power = libm::pow(10.0, libm::floor(libm::log10(raw)));
    let step = [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * power).find(|s| *s >= raw).unwrap_or(raw);
    let first = libm::ceil(low / step) as i64;
    (0..=2 * target_count as i64).map(|i| (first + i) as f64 * step).take_while(|v| *v <= high).collect()
}

/// Formats a number with enough digits to distinguish two ticks.
fn tick_label(value: f64, range: f64) -> String {
    let digits = (2.0 - libm::floor(libm::log10(range.max(1e-12)))).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_cover_the_range() {
        assert_eq!(ticks(0.0, 1.0, 5), [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert_eq!(ticks(-0.013, 0.021, 5).len(), 4);
        assert_eq!(ticks(1.0, 1.0, 5), Vec::<f64>::new());
        assert_eq!((tick_label(0.6000000000000001, 1.0), tick_label(-0.0, 1.0)), ("0.6".into(), "0".into()));
    }

    #[test]
    fn curves_have_gaps_at_missing_values_and_unbounded_ranges_are_drawn() {
        let trace = Trace {
            label: "a <b>".into(),
            unit: "m".into(),
            times: vec![0.0, 1.0, 2.0, 3.0],
            got: vec![1.0, f64::NAN, 2.0, 3.0],
            expected: Vec::new(),
            band: vec![[0.0, f64::INFINITY], [0.0, f64::INFINITY], [f64::NAN; 2], [0.0, 1.0]],
            mark: Some(2.0),
        };
        let svg = plots(&[trace]);
        let (legend, svg) = svg.split_once("</p>").unwrap();
        assert!(legend.contains("allowed") && !legend.contains("expected"), "{legend}");
        assert_eq!((svg.matches("class=\"band\"").count(), svg.matches("<circle").count()), (2, 1));
        assert!(svg.contains("a &lt;b&gt;, m") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert_eq!(plots(&[Trace::default()]), "");
    }

    #[test]
    fn a_long_curve_keeps_its_spikes() {
        let count = 100_000;
        let mut trace = Trace {
            times: (0..count).map(f64::from).collect(),
            got: vec![0.0; count as usize],
            ..Trace::default()
        };
        trace.got[77_777] = 5.0;
        let keep = drawn_points(&trace, count as usize);
        assert!(keep.len() <= MAX_POINTS + 4 && keep.contains(&77_777), "{}", keep.len());
    }
}
