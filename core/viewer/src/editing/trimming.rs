//! The part of a clip that a bar plays: trim its start, roll the edge to the previous bar, slip the content between its ends.

use super::strips::MIN_CLIP_SECS;
use super::{EditError, Step};
use crate::app::Viewer;
use crate::state::selection::Selected;
use crate::state::timeline::{Bar, Strip};
use choreo_motion::Repeat;
use choreo_session::edit::{CueTime, has_end, set_trim};

impl Viewer {
    /// Trims the start of a clip: it begins at another time, and its content stays in place. If it follows or meets the end of another clip, that
    /// end moves with it (a roll edit).
    ///
    /// A clip that repeats is not trimmed, since that would shorten each round; a roll only moves the boundary. The previous clip then continues up
    /// to the boundary, with more or fewer rounds if it repeats, and this clip begins its first round there.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change. The same holds for the functions below.
    pub fn trim_cue(&mut self, what: &Selected, secs: f64) -> Result<(), EditError> {
        let (bar, strip) = self.find_strip(what)?;
        let known = self.displayed_text().ok_or(EditError::NothingShown)?;
        let layer = self.layer_bars(what);
        let at = layer.iter().position(|other| other.what == *what).ok_or(EditError::ObjectGone)?;
        let followed = self.followed_bars(&layer)[at];
        let is_chained = followed.is_some();
        let before = followed.or(at.checked_sub(1)).map(|before| &layer[before]);
        let meets = before.is_some_and(|before| before.meets(&bar));
        let trim = match strip.repeat {
            Repeat::Once => Some(trim_for_start(&bar, &strip, secs)?),
            _ if is_chained || meets => None,
            _ => {
                let why = "the clip repeats, so a trim would shorten every repetition; drag without Alt, or write .once()";
                return Err(EditError::refused_at(&bar.place, why));
            }
        };
        self.check_boundary(before.filter(|_| is_chained || meets), &bar, secs)?;
        let mut steps = match before.filter(|_| is_chained) {
            Some(before) => vec![self.bar_time_step(before, CueTime::End, secs)],
            None => vec![self.bar_time_step(&bar, CueTime::Start, secs)],
        };
        if let Some(before) = before.filter(|_| meets && !is_chained)
            && has_end(&known, before.place.line, before.place.column)
        {
            // The two bars meet, so the end of the first one moves, too.
            steps.push(self.bar_time_step(before, CueTime::End, secs));
        }
        steps.extend(trim.map(|trim| self.trim_step(&bar, trim)));
        self.apply_steps(steps)
    }

    /// Moves the end of a bar. The end of a clip cannot move beyond the start of a clip that takes over, where it would not be visible.
    pub(crate) fn set_bar_end(&mut self, bar: &Bar, secs: f64) -> Result<(), EditError> {
        let layer = self.layer_bars(&bar.what);
        let at = layer.iter().position(|other| other.what == bar.what);
        let next =
            at.and_then(|at| layer.get(at + 1).filter(|_| self.followed_bars(&layer)[at + 1] != Some(at)));
        let next = next.filter(|next| bar.meets(next) && secs > next.start.as_secs());
        if let Some(next) = next {
            let (label, start) = (&next.label, self.time_text(next.start));
            let why = format!(
                "{label} takes over from it at {start}: move that start instead, with Alt where the bars meet"
            );
            return Err(EditError::refused_at(&bar.place, &why));
        }
        self.set_cue_time(&bar.what, CueTime::End, secs)
    }

    /// Fails if one of the clips at a moved boundary would have no length.
    pub(super) fn check_boundary(&self, before: Option<&Bar>, bar: &Bar, secs: f64) -> Result<(), EditError> {
        let shown = |secs: f64| self.time_text(choreo_motion::Time::from_secs(secs));
        let has_stated_end =
            self.displayed_text().is_some_and(|text| has_end(&text, bar.place.line, bar.place.column));
        if let Some(before) = before.filter(|before| secs <= before.start.as_secs() + MIN_CLIP_SECS) {
            let (label, start) = (&before.label, shown(before.start.as_secs()));
            let why = format!("{label}, the clip before it, begins at {start} and would have no length");
            return Err(EditError::refused_at(&bar.place, &why));
        }
        if has_stated_end && secs >= bar.draggable_end.as_secs() - MIN_CLIP_SECS {
            let why = format!(
                "{} would begin at {}, but it ends at {}",
                bar.label,
                shown(secs),
                shown(bar.draggable_end.as_secs())
            );
            return Err(EditError::refused_at(&bar.place, &why));
        }
        Ok(())
    }

    /// Slips a clip: shows content `by` seconds later in the clip between the same ends, in playing direction. A clip without a trim gets one.
    pub fn slip_cue(&mut self, what: &Selected, by: f64) -> Result<(), EditError> {
        let (bar, strip) = self.find_strip(what)?;
        let trim = slipped_trim(&bar, &strip, by).ok_or_else(|| {
            let why = match strip.repeat {
                Repeat::Once => "the clip is played whole: there is nothing beyond its ends",
                _ => "the bar repeats its whole clip: make the bar shorter than one repetition, or write .once()",
            };
            EditError::refused_at(&bar.place, why)
        })?;
        self.apply_steps(vec![self.trim_step(&bar, trim)])
    }

    fn trim_step(&self, bar: &Bar, trim: [f64; 2]) -> Step<'static> {
        let fps = self.playhead.fps().as_fps();
        let trim = bar.strip.map_or(trim, |strip| clamp_trim(&strip, trim, fps));
        self.bar_step(bar, move |text, line, column| set_trim(text, line, column, trim, fps))
    }
}

/// Trim of a clip played once that begins at another time and keeps its content in place, clip seconds.
fn trim_for_start(bar: &Bar, strip: &Strip, secs: f64) -> Result<[f64; 2], EditError> {
    let played = (secs - bar.start.as_secs()) * strip.speed.abs();
    let [mut from, mut to] = strip.trim;
    match strip.speed < 0.0 {
        false => from += played,
        true => to -= played,
    }
    if from < -MIN_CLIP_SECS || to > strip.clip_secs + MIN_CLIP_SECS || to - from < MIN_CLIP_SECS {
        let why = format!("the clip has nothing there: it runs from 0 s to {:.3} s", strip.clip_secs);
        return Err(EditError::refused_at(&bar.place, &why));
    }
    Ok([from, to])
}

/// Trim after a slip, clip seconds. `None` if the whole clip is visible.
fn slipped_trim(bar: &Bar, strip: &Strip, by: f64) -> Option<[f64; 2]> {
    let [from, to] = strip.trim;
    let length = to - from;
    // A repeating clip must not start again before the next clip has faded in.
    let (visible_secs, fits) = match strip.repeat {
        Repeat::Once => ((bar.draggable_end - bar.start).as_secs() * strip.speed.abs(), true),
        _ => {
            let visible_secs = (bar.end - bar.start).as_secs() * strip.speed.abs();
            (visible_secs, visible_secs <= length + MIN_CLIP_SECS)
        }
    };
    // Keys decide the visible part of a keyed clip, and a repeating clip shows all of it, so the trim moves as a whole.
    if strip.is_keyed || !fits {
        let by = (by * strip.speed.signum()).clamp(-from, strip.clip_secs - to);
        return (by.abs() > MIN_CLIP_SECS).then_some([from + by, to + by]);
    }
    // Only the visible part must stay within the clip.
    let (before, after) = (strip.secs_before_trim(), strip.clip_secs - length - strip.secs_before_trim());
    let slipped = (before + by).clamp(0.0, (strip.clip_secs - visible_secs.min(length)).max(0.0));
    let rest = if after < MIN_CLIP_SECS { 0.0 } else { (after + before - slipped).max(0.0) };
    let part =
        if strip.speed < 0.0 { [rest, strip.clip_secs - slipped] } else { [slipped, strip.clip_secs - rest] };
    ((slipped - before).abs() > MIN_CLIP_SECS).then_some(part)
}

/// A trim that also lies within the clip after it is rounded to 3 decimal places, unless it ends on a frame.
pub(super) fn clamp_trim(strip: &Strip, [from, to]: [f64; 2], fps: f64) -> [f64; 2] {
    let is_frame = ((to * fps).round() - to * fps).abs() < 1e-4;
    let is_beyond = !is_frame && (to * 1e3).round() / 1e3 > strip.clip_secs;
    [from.max(0.0), if is_beyond { (strip.clip_secs * 1e3).floor() / 1e3 } else { to }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_motion::Time;
    use choreo_script::Place;

    fn bar(length: f64, strip: Strip) -> Bar {
        let end = Time::from_secs(1.0 + length);
        Bar {
            label: "Walk".into(),
            what: Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 },
            start: Time::from_secs(1.0),
            end,
            draggable_end: end,
            fade_in: Time::ZERO,
            fade_out: Time::ZERO,
            holds_from: None,
            place: Place::default(),
            cut: None,
            color_index: 0,
            strip: Some(strip),
        }
    }

    fn strip(trim: [f64; 2], speed: f64, repeat: Repeat) -> Strip {
        Strip { trim, clip_secs: 3.0, speed, repeat, weight: 1.0, is_keyed: false }
    }

    /// The visible part stays within the clip, and the content follows the pointer.
    #[test]
    fn a_slip_moves_the_trim_range_within_the_clip() {
        let slip = |length, trim, speed, repeat, by| {
            let strip = strip(trim, speed, repeat);
            slipped_trim(&bar(length, strip), &strip, by)
        };
        for repeat in [Repeat::Once, Repeat::Loop, Repeat::PingPong] {
            // The visible part of a clip without a trim, cut short by the end of the bar, keeps its length.
            assert_eq!(slip(1.0, [0.0, 3.0], 1.0, repeat, 0.25), Some([0.25, 3.0]));
            assert_eq!(slip(1.0, [0.0, 3.0], 1.0, repeat, 9.0), Some([2.0, 3.0]));
            assert_eq!(slip(1.0, [0.0, 3.0], 2.0, repeat, 9.0), Some([1.0, 3.0]));
            assert_eq!(slip(1.0, [0.0, 3.0], 1.0, repeat, -0.5), None);
            assert_eq!(slip(1.0, [0.5, 2.0], 1.0, repeat, 0.25), Some([0.75, 2.25]));
            assert_eq!(slip(1.0, [0.5, 2.0], 1.0, repeat, -1.0), Some([0.0, 1.5]));
            // A clip played backwards begins at its end.
            assert_eq!(slip(1.0, [0.0, 3.0], -1.0, repeat, 0.25), Some([0.0, 2.75]));
            assert_eq!(slip(1.0, [0.0, 3.0], -1.0, repeat, 9.0), Some([0.0, 1.0]));
        }
        // All rounds are visible as a whole.
        assert_eq!(slip(4.0, [0.0, 3.0], 1.0, Repeat::Loop, 0.25), None);
        assert_eq!(slip(4.0, [0.5, 2.0], 1.0, Repeat::Loop, 0.25), Some([0.75, 2.25]));
        assert_eq!(slip(3.0, [0.0, 3.0], 1.0, Repeat::Once, 0.25), None);
    }

    #[test]
    fn a_trim_ends_within_the_clip_when_it_is_written() {
        let odd = Strip { clip_secs: 2.0 / 3.0, ..strip([0.0, 2.0 / 3.0], 1.0, Repeat::Once) };
        assert_eq!(clamp_trim(&odd, [0.25, 2.0 / 3.0], 25.0), [0.25, 0.666]);
        assert_eq!(clamp_trim(&odd, [0.25, 2.0 / 3.0], 30.0), [0.25, 2.0 / 3.0]);
        assert_eq!(clamp_trim(&odd, [0.0, 0.5], 25.0), [0.0, 0.5]);
    }
}
