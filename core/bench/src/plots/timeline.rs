//! Cue sheet as an image: bars on tracks over time.

use super::svg::{Anchor, GRAY, GRID, INK, RED, Svg, fitting, text_width};

#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    pub label: String,
    /// Start and end in seconds.
    pub start: f64,
    pub end: f64,
    /// Duration of the fade-in, seconds.
    pub fade: f64,
    pub color: &'static str,
}

/// A moment of a track that is marked with a label.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    pub at: f64,
    pub label: String,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    pub name: String,
    pub bars: Vec<Bar>,
    pub marks: Vec<Mark>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    pub title: String,
    /// Length in seconds; bars beyond it are cut.
    pub length: f64,
    pub tracks: Vec<Track>,
}

const WIDTH: f64 = 960.0;
const LEFT: f64 = 150.0;
const RIGHT: f64 = 930.0;
const TOP: f64 = 62.0;
const ROW: f64 = 26.0;

impl Timeline {
    pub fn svg(&self) -> String {
        let bottom = TOP + ROW * self.tracks.len() as f64;
        let mut svg = Svg::new(WIDTH, bottom + 24.0);
        let (title, size) = fitting(&self.title, 15.0, RIGHT - 20.0);
        svg.text((20.0, 26.0), &title, size, INK, Anchor::Start);
        let length = self.length.max(1e-9);
        let x = |t: f64| LEFT + (t / length).clamp(0.0, 1.0) * (RIGHT - LEFT);
        let step = round_step(length);
        for i in 0..=((length / step + 1e-9) as usize) {
            let at = i as f64 * step;
            svg.line((x(at), TOP - 4.0), (x(at), bottom), GRID, 1.0, "");
            svg.text(
                (x(at), TOP - 10.0),
                &format!("{} s", (at * 1000.0).round() / 1000.0),
                11.0,
                GRAY,
                Anchor::Middle,
            );
        }
        for (row, track) in self.tracks.iter().enumerate() {
            let y = TOP + ROW * row as f64;
            let (name, size) = fitting(&track.name, 12.0, LEFT - 18.0);
            svg.text((LEFT - 10.0, y + 17.0), &name, size, INK, Anchor::End);
            for bar in &track.bars {
                let (from, to) = (x(bar.start), x(bar.end));
                if to <= from {
                    continue;
                }
                svg.rect((from, y + 4.0), (to - from, ROW - 8.0), bar.color);
                let faded = x(bar.start + bar.fade).min(to);
                if bar.fade > 0.0 && faded > from {
                    svg.line((from, y + ROW - 4.0), (faded, y + 4.0), "#ffffff", 1.5, "");
                }
                let start = if bar.fade > 0.0 { faded } else { from } + 5.0;
                if text_width(&bar.label, 11.0) < to - start {
                    svg.text((start, y + 17.0), &bar.label, 11.0, "#ffffff", Anchor::Start);
                }
            }
            for mark in &track.marks {
                let at = x(mark.at);
                svg.triangle((at, y + 11.0), 5.0, RED);
                if text_width(&mark.label, 10.0) < RIGHT - at {
                    svg.text((at + 8.0, y + 8.0), &mark.label, 10.0, RED, Anchor::Start);
                } else {
                    svg.text((at - 8.0, y + 8.0), &mark.label, 10.0, RED, Anchor::End);
                }
            }
        }
        svg.finish()
    }
}

/// Step between about ten ticks: 1, 2 or 5 times a power of ten.
fn round_step(length: f64) -> f64 {
    let rough = length / 10.0;
    let decade = libm::pow(10.0, libm::log10(rough).floor());
    [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * decade).find(|s| *s >= rough * 0.999).unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_and_marks_are_drawn_at_their_times() {
        assert_eq!((round_step(10.0), round_step(8.0), round_step(0.3)), (1.0, 1.0, 0.05));
        let bar =
            |label: &str, start, end| Bar { label: label.into(), start, end, fade: 0.0, color: "#123456" };
        let track = Track {
            name: "anna".into(),
            bars: vec![bar("Walk", 0.0, 5.0), bar("beyond", 12.0, 14.0)],
            marks: vec![Mark { at: 5.0, label: "gap".into() }],
        };
        let svg = Timeline { title: "t".into(), length: 10.0, tracks: vec![track] }.svg();
        // A bar of half of the time has half of the width; bars beyond the end are not drawn.
        assert_eq!(svg.matches("#123456").count(), 1);
        assert!(svg.contains("width=\"390.0\"") && svg.contains(">gap<"));
    }

    #[test]
    fn long_names_are_shortened_to_fit() {
        let title =
            "At which quality is a frame written as MP4? (the first dance, 1280×720, its first image)";
        let (text, size) = fitting(title, 15.0, 618.0);
        assert!(text == title && size < 15.0 && text_width(&text, size) <= 618.0);
        let (text, size) = fitting(&"somebody ".repeat(20), 12.0, 132.0);
        assert!(text.ends_with('…') && size < 12.0 && text_width(&text, size) <= 132.0, "{text} {size}");
        assert_eq!(fitting("ada", 12.0, 132.0), ("ada".to_string(), 12.0));
    }
}
