//! Fades: the elapsed share of a time span, and easing.

use choreo_motion::{Ease, Time};

/// `elapsed / span`, clamped to 0..=1; 1 if the span is zero or negative.
pub(crate) fn elapsed_fraction(elapsed: Time, span: Time) -> f32 {
    if span <= Time::ZERO { 1.0 } else { elapsed.fraction(Time::ZERO, span).clamp(0.0, 1.0) }
}

/// The weight `w`, 0..=1, after easing.
pub(crate) fn apply_ease(ease: Ease, w: f32) -> f32 {
    match ease {
        Ease::Linear => w,
        Ease::Smooth => w * w * (3.0 - 2.0 * w),
        ease => ease.at(w.into()) as f32,
    }
}
