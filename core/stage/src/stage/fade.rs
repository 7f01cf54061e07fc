//! Fades: the elapsed share of a time span, and easing.

use choreo_motion::{Ease, Time};

/// `elapsed / span`, clamped to 0..=1; 1 if the span is zero or negative.
pub(crate) fn elapsed_fraction(elapsed: Time, span: Time) -> f32 {
    if span <= Time::ZERO { 1.0 } else { elapsed.fraction(Time::ZERO, span).clamp(0.0, 1.0) }
}

/// Smooth weights of the fade-in after `start` and of the fade-out before `end`, 0..=1; `None` outside `start..end`.
pub(crate) fn fades_at(time: Time, start: Time, end: Option<Time>, fade: Time) -> Option<[f32; 2]> {
    if time < start || end.is_some_and(|end| time >= end) {
        return None;
    }
    let eased = |elapsed: Time| apply_ease(Ease::Smooth, elapsed_fraction(elapsed, fade));
    Some([eased(time - start), end.map_or(1.0, |end| eased(end - time))])
}

/// The weight `w`, 0..=1, after easing.
pub(crate) fn apply_ease(ease: Ease, w: f32) -> f32 {
    match ease {
        Ease::Linear => w,
        Ease::Smooth => w * w * (3.0 - 2.0 * w),
        ease => ease.at(w.into()) as f32,
    }
}
