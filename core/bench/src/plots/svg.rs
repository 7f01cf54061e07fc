//! A few shapes as SVG text, and the free room for labels.

use std::fmt::Write;

pub(crate) const INK: &str = "#222831";
pub(crate) const GRAY: &str = "#8a929c";
pub(crate) const GRID: &str = "#e3e6ea";
pub(super) const BLUE: &str = "#2b6cb0";
pub(super) const RED: &str = "#c0392b";

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// An image being written; sizes in pixels.
pub(crate) struct Svg {
    body: String,
    width: f64,
    height: f64,
}

impl Svg {
    pub(super) fn new(width: f64, height: f64) -> Svg {
        Svg { body: String::new(), width, height }
    }

    pub(super) fn line(&mut self, a: (f64, f64), b: (f64, f64), color: &str, width: f64, dash: &str) {
        let dash = if dash.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{dash}\"") };
        let _ = writeln!(
            self.body,
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{color}\" stroke-width=\"{width}\"{dash}/>",
            a.0, a.1, b.0, b.1
        );
    }

    pub(super) fn circle(&mut self, at: (f64, f64), radius: f64, fill: &str, stroke: &str) {
        let _ = writeln!(
            self.body,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"1.5\"/>",
            at.0, at.1
        );
    }

    pub(super) fn rect(&mut self, at: (f64, f64), size: (f64, f64), fill: &str) {
        let _ = writeln!(
            self.body,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"2\" fill=\"{fill}\"/>",
            at.0,
            at.1,
            size.0.max(0.0),
            size.1.max(0.0)
        );
    }

    pub(super) fn triangle(&mut self, tip: (f64, f64), half: f64, fill: &str) {
        let (x, y) = tip;
        let _ = writeln!(
            self.body,
            "<polygon points=\"{x:.1},{y:.1} {:.1},{:.1} {:.1},{:.1}\" fill=\"{fill}\"/>",
            x - half,
            y - 1.8 * half,
            x + half,
            y - 1.8 * half
        );
    }

    pub(super) fn text(&mut self, at: (f64, f64), text: &str, size: f64, color: &str, anchor: Anchor) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let _ = writeln!(
            self.body,
            "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"{size}\" fill=\"{color}\" text-anchor=\"{anchor}\">{}</text>",
            at.0,
            at.1,
            escaped(text)
        );
    }

    /// Draws text that reads upwards.
    pub(crate) fn text_up(&mut self, at: (f64, f64), text: &str, size: f64, color: &str) {
        let (x, y) = at;
        let _ = writeln!(
            self.body,
            "<text transform=\"translate({x:.1} {y:.1}) rotate(-90)\" font-size=\"{size}\" fill=\"{color}\" \
             text-anchor=\"middle\">{}</text>",
            escaped(text)
        );
    }

    pub(super) fn finish(self) -> String {
        let (w, h) = (self.width, self.height);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"Helvetica, Arial, 'DejaVu Sans', sans-serif\">\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            self.body
        )
    }
}

/// Escapes text for XML, and replaces control characters, which names in files may contain.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// Approximate width of a text in a sans-serif font of this size, pixels.
pub(crate) fn text_width(text: &str, size: f64) -> f64 {
    text.chars().map(|c| if "iljt.,:'|! ".contains(c) { 0.34 } else { 0.63 }).sum::<f64>() * size
}

/// Cuts a text that is wider than `width`, and marks the cut.
fn shortened(text: &str, size: f64, width: f64) -> String {
    let mut text = text.to_string();
    if text_width(&text, size) <= width {
        return text;
    }
    while !text.is_empty() && text_width(&text, size) > width - size {
        text.pop();
    }
    text + "…"
}

/// Shrinks a text that is wider than `width`, down to three quarters of its size, and cuts it beyond that. Returns the text and its size.
pub(super) fn fitting(text: &str, size: f64, width: f64) -> (String, f64) {
    let fits = |size: f64| text_width(text, size) <= width;
    let sizes = [1.0, 0.95, 0.9, 0.85, 0.8, 0.75].map(|share| share * size);
    let size = sizes.into_iter().find(|s| fits(*s)).unwrap_or(sizes[5]);
    (shortened(text, size, width), size)
}

/// Boxes that labels already take, in pixels.
#[derive(Default)]
pub(super) struct Room(Vec<[f64; 4]>);

impl Room {
    pub(super) fn take(&mut self, at: (f64, f64), size: (f64, f64)) {
        self.0.push([at.0, at.1, at.0 + size.0, at.1 + size.1]);
    }

    /// Area of a box that is already taken, in square pixels.
    pub(super) fn overlap(&self, at: (f64, f64), size: (f64, f64)) -> f64 {
        let side = |a: f64, b: f64, c: f64, d: f64| (b.min(d) - a.max(c)).max(0.0);
        self.0
            .iter()
            .map(|b| side(at.0, at.0 + size.0, b[0], b[2]) * side(at.1, at.1 + size.1, b[1], b[3]))
            .sum()
    }
}
