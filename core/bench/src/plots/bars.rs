//! Bar charts of amounts, the largest first.

use super::number::bytes;
use super::svg::{Anchor, BLUE, GRAY, INK, Svg, text_width};

const WIDTH: f64 = 900.0;
const ROW: f64 = 22.0;
const TOP: f64 = 60.0;
/// Largest number of bars; the last one sums up the remaining amounts.
const MAX_BARS: usize = 24;

/// Bar chart of memory by its use, as (name, bytes). SVG.
pub fn byte_bars(title: &str, amounts: &[(String, u64)]) -> String {
    let mut sorted: Vec<(String, u64)> = amounts.iter().filter(|a| a.1 > 0).cloned().collect();
    sorted.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let total: u64 = sorted.iter().map(|a| a.1).sum();
    if sorted.len() > MAX_BARS {
        let rest = sorted.split_off(MAX_BARS - 1);
        sorted.push((format!("{} smaller ones", rest.len()), rest.iter().map(|a| a.1).sum()));
    }
    let left = sorted.iter().map(|a| text_width(&a.0, 12.0)).fold(60.0, f64::max).min(420.0) + 24.0;
    let right = WIDTH - 90.0;
    let largest = sorted.iter().map(|a| a.1).max().unwrap_or(1) as f64;
    let mut svg = Svg::new(WIDTH, TOP + ROW * sorted.len() as f64 + 16.0);
    svg.text((20.0, 26.0), title, 15.0, INK, Anchor::Start);
    svg.text((20.0, 44.0), &format!("{} in all", bytes(total as f64)), 12.0, GRAY, Anchor::Start);
    for (row, (name, amount)) in sorted.iter().enumerate() {
        let y = TOP + ROW * row as f64;
        let mut name = name.clone();
        while text_width(&name, 12.0) > left - 24.0 && name.pop().is_some() {}
        svg.text((left - 8.0, y + 15.0), &name, 12.0, INK, Anchor::End);
        let width = (*amount as f64 / largest * (right - left)).max(1.0);
        svg.rect((left, y + 3.0), (width, ROW - 6.0), BLUE);
        svg.text((left + width + 6.0, y + 15.0), &bytes(*amount as f64), 11.0, GRAY, Anchor::Start);
    }
    svg.finish()
}

#[cfg(test)]
mod tests {
    #[test]
    fn bars_are_sorted_and_small_amounts_are_summed_up() {
        let amounts: Vec<(String, u64)> = (1..=40).map(|i| (format!("n{i}"), i * 1000)).collect();
        let svg = super::byte_bars("t", &amounts);
        assert!(svg.contains("820 kB in all") && svg.contains("17 smaller ones"));
        assert!(svg.find(">n40<") < svg.find(">n39<"));
    }
}
