//! Start and end times of cues.

use crate::build::{CueDraft, StageDraft};
use choreo_motion::Time;
use choreo_stage::{Cue, Repeat};

impl CueDraft {
    /// The cue of the stage, with its start time, signed speed and trim.
    pub(crate) fn cue(&self, start: Time) -> Cue {
        Cue {
            start,
            speed: if self.reverse { -self.cue.speed } else { self.cue.speed },
            trim: self.trim_or_whole(),
            ..self.cue.clone()
        }
    }

    /// Start and end of the played part of the clip, in clip time: the trim, else the whole clip.
    pub(crate) fn trim_or_whole(&self) -> (Time, Time) {
        self.trim.unwrap_or((Time::ZERO, self.cue.clip.duration))
    }

    /// Duration of the trimmed part, played once at its speed.
    pub(crate) fn length(&self) -> Time {
        let (start, end) = self.trim_or_whole();
        (end - start).scaled(1.0 / self.cue.speed)
    }

    /// Repeat mode that the script sets, else the default: a layer plays once, and so does a cue without `until` that another
    /// cue follows; all other cues loop.
    pub(crate) fn repeat_mode(&self, is_layer: bool) -> Repeat {
        let once = is_layer || (self.has_successor && self.until.is_none());
        self.repeat.unwrap_or(if once { Repeat::Once } else { Repeat::Loop })
    }
}

/// Start and end of every cue; `None` for one that repeats without end.
pub(crate) fn times_of_cues(stage_draft: &StageDraft) -> Vec<(Time, Option<Time>)> {
    let mut times: Vec<(Time, Option<Time>)> = Vec::with_capacity(stage_draft.cues.len());
    // A cue comes later in the list than its predecessor.
    for cue in &stage_draft.cues {
        let predecessor = cue.predecessor.map(|before| (&stage_draft.cues[before], times[before]));
        times.push(start_and_end(stage_draft, cue, predecessor));
    }
    times
}

/// Start and end of one cue. `predecessor`: the cue before it in the chain, with start and end.
fn start_and_end(
    stage_draft: &StageDraft,
    cue: &CueDraft,
    predecessor: Option<(&CueDraft, (Time, Option<Time>))>,
) -> (Time, Option<Time>) {
    let start = match predecessor {
        None => cue.origin,
        Some((_, (start, None))) => start,
        Some((before, (_, Some(end)))) => {
            // If the clip of the predecessor plays to its end, this cue fades in before that end.
            let plays_to_end = before.until.is_none();
            end - if plays_to_end { cue.cue.fade_in.min(before.length()) } else { Time::ZERO }
        }
    };
    let start = cue.start.unwrap_or(start);
    let is_layer = stage_draft.chains[cue.chain].is_layer();
    let end_of_clip = match cue.repeat_mode(is_layer) {
        Repeat::Once if cue.cue.plays_at_constant_speed() => Some(start + cue.length()),
        Repeat::Once => cue.cue(start).first_play_end(),
        _ => None,
    };
    (start, cue.until.or(end_of_clip))
}

/// Start and end of the cue with this index.
pub(crate) fn times_of_cue(stage_draft: &StageDraft, id: usize) -> (Time, Option<Time>) {
    // The cue and its predecessors, last to first. Chains can be too long for recursion.
    let mut ids = vec![id];
    while let Some(before) = ids.last().and_then(|id| stage_draft.cues[*id].predecessor) {
        ids.push(before);
    }
    let mut last = None;
    for id in ids.into_iter().rev() {
        let cue = &stage_draft.cues[id];
        last = Some((cue, start_and_end(stage_draft, cue, last)));
    }
    last.map_or((Time::ZERO, None), |(_, times)| times)
}
