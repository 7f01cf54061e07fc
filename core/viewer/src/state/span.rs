//! Time span that the sequencer shows, with conversion between times and positions on the screen.

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Times at the left and the right edge, seconds.
    pub from: f64,
    pub to: f64,
}

impl Span {
    pub fn whole(length: f64) -> Span {
        Span { from: 0.0, to: length.max(1e-3) }
    }

    /// Position of a time. `width`: width of the lane in points, here and below.
    pub(crate) fn x_of(&self, secs: f64, width: f32) -> f32 {
        ((secs - self.from) / (self.to - self.from) * f64::from(width)) as f32
    }

    pub(crate) fn secs_at(&self, x: f32, width: f32) -> f64 {
        self.from + f64::from(x) / f64::from(width.max(1.0)) * (self.to - self.from)
    }

    /// Zooms about the position `x`. A factor above 1 shows less.
    pub fn zoom(&mut self, factor: f64, x: f32, width: f32, length: f64) {
        let at = self.secs_at(x, width);
        let (longest, shortest) = (length.max(1e-3) * 2.0, 1e-2_f64.min(length.max(1e-3)));
        let wanted = ((self.to - self.from) / factor.max(1e-6)).clamp(shortest, longest);
        let part = f64::from(x) / f64::from(width.max(1.0));
        *self = Span { from: at - wanted * part, to: at + wanted * (1.0 - part) };
        self.keep_inside(length);
    }

    pub fn pan(&mut self, points: f32, width: f32, length: f64) {
        let by = f64::from(points) / f64::from(width.max(1.0)) * (self.to - self.from);
        *self = Span { from: self.from - by, to: self.to - by };
        self.keep_inside(length);
    }

    /// Keeps at least half of the span inside the scene.
    fn keep_inside(&mut self, length: f64) {
        let half = (self.to - self.from) / 2.0;
        let shift = (-half - self.from).max(0.0) - (self.to - length - half).max(0.0);
        *self = Span { from: self.from + shift, to: self.to + shift };
    }

    /// Distance of the ruler's lines, seconds: 1, 2 or 5 times a power of ten, at least `points` apart.
    pub fn ruler_interval(&self, width: f32, points: f32) -> f64 {
        let least = f64::from(points / width.max(1.0)) * (self.to - self.from);
        let mut step = 1e-3;
        loop {
            for factor in [1.0, 2.0, 5.0] {
                if step * factor >= least {
                    return step * factor;
                }
            }
            step *= 10.0;
            if step > 1e9 {
                return step;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_and_position_conversions_are_inverse() {
        let span = Span { from: 1.0, to: 3.0 };
        for x in [0.0, 17.0, 400.0] {
            assert!((span.x_of(span.secs_at(x, 400.0), 400.0) - x).abs() < 1e-3);
        }
        assert_eq!(span.secs_at(200.0, 400.0), 2.0);
    }

    #[test]
    fn zooming_keeps_the_time_under_the_pointer() {
        let mut span = Span::whole(10.0);
        span.zoom(2.0, 100.0, 400.0, 10.0);
        assert!((span.secs_at(100.0, 400.0) - 2.5).abs() < 1e-9);
        assert!((span.to - span.from - 5.0).abs() < 1e-9);
        span.zoom(1e-9, 100.0, 400.0, 10.0);
        assert!(span.to - span.from <= 20.0 + 1e-9, "not without end: {span:?}");
        span.zoom(1e12, 100.0, 400.0, 10.0);
        assert!(span.to - span.from >= 1e-2 - 1e-9);
    }

    #[test]
    fn panning_keeps_the_middle_of_the_span_within_the_scene() {
        let mut span = Span::whole(10.0);
        span.pan(1e9, 400.0, 10.0);
        assert_eq!((span.from, span.to), (-5.0, 5.0));
        span.pan(-1e9, 400.0, 10.0);
        assert_eq!((span.from, span.to), (5.0, 15.0));
    }

    #[test]
    fn ruler_intervals_are_round_and_wide_enough() {
        assert_eq!(Span::whole(10.0).ruler_interval(500.0, 60.0), 2.0);
        assert_eq!(Span::whole(0.5).ruler_interval(500.0, 60.0), 0.1);
        assert_eq!(Span { from: 0.0, to: 1e12 }.ruler_interval(500.0, 60.0), 1e10);
    }
}
