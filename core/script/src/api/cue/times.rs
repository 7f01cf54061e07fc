//! Start and end times of cues, for scripts.

use crate::call::{ApiError, Call, Reply};
use crate::cue_times::times_of_cue;
use crate::value::CueRef;
use choreo_stage::Repeat;
use rhai::Dynamic;

pub(super) fn length(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let length = c.stage_draft().cue(this.0)?.length();
    Ok(Dynamic::from_float(length.as_secs()))
}

pub(super) fn start(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    c.stage_draft().cue(this.0)?;
    let (start, _) = times_of_cue(&c.stage_draft(), this.0);
    Ok(Dynamic::from_float((start - c.stage_draft().sequence_start).as_secs()))
}

pub(super) fn end(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    c.stage_draft().cue(this.0)?;
    let (_, end) = times_of_cue(&c.stage_draft(), this.0);
    let end = end.ok_or_else(|| {
        ApiError::new("end: this cue repeats without end").hint("give it an end with .until(time)")
    })?;
    Ok(Dynamic::from_float((end - c.stage_draft().sequence_start).as_secs()))
}

pub(super) fn time_of(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let count = if c.len() > 1 { c.number_in(1, 1.0, 1e6)? as i128 } else { 1 };
    let value = c.value(0);
    let draft = c.stage_draft().cue(this.0)?.clone();
    let at = if value.is_string() {
        crate::api::markers::clip_marker(c, &draft.cue.clip, &c.text(0)?)?
    } else {
        c.duration(0)?
    };
    let (start, end) = draft.trim_or_whole();
    let name = &draft.cue.clip.name;
    if at < start || at > end {
        return Err(ApiError::new(format!(
            "time_of: {} s is not in the part of clip \"{name}\" that is played, {} s to {} s",
            at.as_secs(),
            start.as_secs(),
            end.as_secs()
        )));
    }
    let stage_draft = c.stage_draft();
    let (from, until) = times_of_cue(&stage_draft, this.0);
    let repeat = draft.repeat_mode(stage_draft.chains[draft.chain].is_layer());
    let length = i128::from((end - start).0);
    let into = i128::from((if draft.reverse { end - at } else { at - start }).0);
    let played = match repeat {
        Repeat::Once => (count == 1).then_some(into),
        Repeat::Loop => Some(into + (count - 1) * length),
        // Even passes of a ping-pong run backwards, so the clip time is reached that much before their end.
        Repeat::PingPong if count % 2 == 1 => Some(into + (count - 1) * length),
        Repeat::PingPong => Some(count * length - into),
    };
    let when = played.and_then(|played| draft.cue(from).time_of_played(played));
    let when = when.filter(|when| until.is_none_or(|until| *when <= until)).ok_or_else(|| {
        ApiError::new(format!("time_of: clip \"{name}\" does not reach this time {count} times"))
            .hint("it ends earlier; to play it longer, use .loop() and .until(time)")
    })?;
    Ok(Dynamic::from_float((when - stage_draft.sequence_start).as_secs()))
}
