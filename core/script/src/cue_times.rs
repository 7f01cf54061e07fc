//! Start and end times of cues.

use crate::build::{CueDraft, StageDraft};
use choreo_motion::Time;
use choreo_stage::{Cue, Repeat};

impl CueDraft {
    /// The cue as it is put on stage, with its start time.
    pub fn cue(&self, start: Time) -> Cue {
        Cue {
            start,
            speed: if self.reverse { -self.cue.speed } else { self.cue.speed },
            trim: self.part(),
            ..self.cue.clone()
        }
    }

    /// Start and end of the played part of the clip, in clip time.
    pub fn part(&self) -> (Time, Time) {
        self.trim.unwrap_or((Time::ZERO, self.cue.clip.duration))
    }

    /// Duration of the trimmed part, played once at its speed.
    pub fn length(&self) -> Time {
        let (start, end) = self.part();
        (end - start).scaled(1.0 / self.cue.speed)
    }

    /// The repeat mode that the script sets. By default a layer plays once, and so does a cue without `until` that another cue
    /// follows; all other cues loop.
    pub fn repeats(&self, layer: bool) -> Repeat {
        let once = layer || (self.has_successor && self.until.is_none());
        self.repeat.unwrap_or(if once { Repeat::Once } else { Repeat::Loop })
    }
}

/// Start and end of every cue; `None` for one that repeats without end.
pub(crate) fn all_times(build: &StageDraft) -> Vec<(Time, Option<Time>)> {
    let mut times: Vec<(Time, Option<Time>)> = Vec::with_capacity(build.cues.len());
    // A cue comes later in the list than its predecessor.
    for cue in &build.cues {
        let follows = cue.predecessor.map(|before| (&build.cues[before], times[before]));
        times.push(cue_times(build, cue, follows));
    }
    times
}

/// Start and end of one cue. `follows`: its predecessor in the chain, with start and end.
fn cue_times(
    build: &StageDraft,
    cue: &CueDraft,
    follows: Option<(&CueDraft, (Time, Option<Time>))>,
) -> (Time, Option<Time>) {
    let start = match follows {
        None => cue.origin,
        Some((_, (start, None))) => start,
        Some((before, (_, Some(end)))) => {
            // If the clip of the predecessor plays to its end, this cue fades in before that end.
            let natural = before.until.is_none();
            end - if natural { cue.cue.fade_in.min(before.length()) } else { Time::ZERO }
        }
    };
    let start = cue.start.unwrap_or(start);
    let layer = build.chains[cue.chain].is_layer();
    let natural = match cue.repeats(layer) {
        Repeat::Once if cue.cue.is_even() => Some(start + cue.length()),
        Repeat::Once => cue.cue(start).first_play_end(),
        _ => None,
    };
    (start, cue.until.or(natural))
}

/// Start and end of the cue with this index.
pub fn times(build: &StageDraft, id: usize) -> (Time, Option<Time>) {
    // Goes to the front of the chain and back without recursion, because chains can be long.
    let mut walk = vec![id];
    while let Some(before) = walk.last().and_then(|id| build.cues[*id].predecessor) {
        walk.push(before);
    }
    let mut last = None;
    for id in walk.into_iter().rev() {
        let cue = &build.cues[id];
        last = Some((cue, cue_times(build, cue, last)));
    }
    last.map_or((Time::ZERO, None), |(_, times)| times)
}
