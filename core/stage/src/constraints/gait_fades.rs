//! Phase-matched fades between two gaits: the height at which feet stand meanwhile.
//!
//! Strides of quadrupeds are matched as a whole, so the mean of both gaits may lift a foot that should stand, or drag a foot that should be
//! in the air. During the fade each foot stands as high as in the gaits alone, and in the air it is kept higher than that.

use crate::constraints::foot_lock::{Contact, smoothstep};
use crate::constraints::foot_samples::FootSamples;
use crate::constraints::footsteps::hurried_secs;
use crate::stage::constraint::FootLock;
use choreo_motion::Time;

/// Margin before and after a fade in which contacts count, too, and in which the clearance of feet in the air fades in and out: a foot is
/// almost on the ground before its clip has a contact.
pub(super) const FADE_MARGIN: Time = Time(Time::TICKS_PER_SECOND / 10);

/// Whether a locked span is a fade between gaits: it does not overlap a fade to or from standing.
pub(super) fn is_gait_fade(foot_lock: &FootLock, (from, to): (Time, Time)) -> bool {
    !foot_lock.standing_fades.iter().any(|fade| fade.from <= to && fade.to >= from)
}

/// A fade between two gaits.
#[derive(Debug)]
pub(super) struct GaitFade {
    span: (Time, Time),
    /// World heights at which each foot stands before and after the fade; `None` if neither gait has it stand.
    heights: Vec<Option<[f64; 2]>>,
}

impl GaitFade {
    /// The gait fades of a constraint. `contacts`: contacts in the clips, by leg.
    pub(super) fn find_all(
        foot_lock: &FootLock,
        samples: &FootSamples,
        contacts: &[Vec<(Time, Time)>],
    ) -> Vec<GaitFade> {
        let of_leg = |span: (Time, Time), leg: usize| {
            let height = |(from, to): &(Time, Time)| {
                let (first, last) = samples.samples_between((*from, *to));
                let places = &samples.feet[leg][first..=last];
                places.iter().map(|place| place.y).sum::<f64>() / places.len() as f64
            };
            let before = contacts[leg].iter().rfind(|contact| contact.1 < span.0 - FADE_MARGIN).map(height);
            let after = contacts[leg].iter().find(|contact| contact.0 > span.1 + FADE_MARGIN).map(height);
            Some([before.or(after)?, after.or(before)?])
        };
        let fade = |span: &(Time, Time)| {
            let heights = (0..contacts.len()).map(|leg| of_leg(*span, leg)).collect();
            GaitFade { span: *span, heights }
        };
        foot_lock.locked_spans.iter().filter(|span| is_gait_fade(foot_lock, **span)).map(fade).collect()
    }

    /// World height of a standing foot at a time of the fade, or shortly before or after it.
    fn standing_height(&self, leg: usize, time: Time) -> Option<f64> {
        let [before, after] = self.heights.get(leg).copied().flatten()?;
        let (from, to) = self.span;
        Some(before + (after - before) * smoothstep((time - from).as_secs() / (to - from).as_secs()))
    }

    /// Upper limit of the world height of a contact; infinite outside gait fades.
    pub(super) fn max_contact_height(fades: &[GaitFade], leg: usize, (from, to): (Time, Time)) -> f64 {
        let fade =
            fades.iter().find(|fade| from <= fade.span.1 + FADE_MARGIN && to >= fade.span.0 - FADE_MARGIN);
        fade.and_then(|fade| fade.standing_height(leg, from.middle(to))).unwrap_or(f64::INFINITY)
    }

    /// Shortest time in which a foot goes from one contact to the next in a gait fade: that of a hurried step, or less for a short
    /// distance; zero outside gait fades. Contacts may be closer together if the feet of two gaits land in different orders.
    pub(super) fn min_gap(fades: &[GaitFade], leg: usize, leg_length: f64, ends: [&Contact; 2]) -> Time {
        let [Some(start), Some(end)] = ends.map(|contact| contact.position) else { return Time::ZERO };
        if GaitFade::ground_height(fades, leg, ends[0].to.middle(ends[1].from)).is_none() {
            return Time::ZERO;
        }
        let way = (end - start).with_y(0.0).length();
        Time::from_secs(hurried_secs(leg_length) * (way / leg_length).min(1.0))
    }

    /// World height of the ground under a foot in a gait fade, and the share of the clearance that applies, 0..=1.
    pub(super) fn ground_height(fades: &[GaitFade], leg: usize, time: Time) -> Option<(f64, f64)> {
        let (from, to) = (time - FADE_MARGIN, time + FADE_MARGIN);
        let fade = fades.iter().find(|fade| from < fade.span.1 && fade.span.0 < to)?;
        let inside = (to - fade.span.0).min(fade.span.1 - from);
        Some((fade.standing_height(leg, time)?, smoothstep(inside.as_secs() / FADE_MARGIN.as_secs())))
    }
}
