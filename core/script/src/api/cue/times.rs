//! When cues start and end.

use crate::build::{Build, CueDraft};
use crate::call::{ApiError, Call, Reply};
use crate::value::CueRef;
use choreo_motion::Time;
use choreo_stage::Repeat;
use rhai::Dynamic;

impl CueDraft {
    pub fn part(&self) -> (Time, Time) {
        self.trim.unwrap_or((Time::ZERO, self.clip.duration))
    }

    /// How long the part takes, once, at its speed.
    pub fn length(&self) -> Time {
        let (start, end) = self.part();
        (end - start).scaled(1.0 / self.speed)
    }

    /// What the script said, else: once for layers and for cues that another follows, else again and again.
    pub fn repeats(&self, layer: bool) -> Repeat {
        let once = layer || (self.followed && self.until.is_none());
        self.repeat.unwrap_or(if once { Repeat::Once } else { Repeat::Loop })
    }
}

/// Start and end of every cue; no end where one repeats without.
pub fn all_times(build: &Build) -> Vec<(Time, Option<Time>)> {
    let mut times: Vec<(Time, Option<Time>)> = Vec::with_capacity(build.cues.len());
    // A cue comes later in the list than the one it follows.
    for cue in &build.cues {
        let follows = cue.after.map(|before| (&build.cues[before], times[before]));
        times.push(cue_times(build, cue, follows));
    }
    times
}

/// Start and end of one cue, given the one before it in its chain and that one's times.
fn cue_times(
    build: &Build,
    cue: &CueDraft,
    follows: Option<(&CueDraft, (Time, Option<Time>))>,
) -> (Time, Option<Time>) {
    let start = match follows {
        None => Time::ZERO,
        Some((_, (start, None))) => start,
        Some((before, (_, Some(end)))) => {
            // Where the one before is not cut off but ends by itself, this one comes in while it still moves.
            let natural = before.until.is_none();
            end - if natural { cue.fade_in.min(before.length()) } else { Time::ZERO }
        }
    };
    let start = cue.start.unwrap_or(start);
    let layer = build.chains[cue.chain].is_layer();
    let natural = (cue.repeats(layer) == Repeat::Once).then(|| start + cue.length());
    (start, cue.until.or(natural))
}

/// Start and end of one cue.
fn times(build: &Build, id: usize) -> (Time, Option<Time>) {
    // To the front of the chain and back again, without recursion.
    let mut walk = vec![id];
    while let Some(before) = walk.last().and_then(|id| build.cues[*id].after) {
        walk.push(before);
    }
    let mut last = None;
    for id in walk.into_iter().rev() {
        let cue = &build.cues[id];
        last = Some((cue, cue_times(build, cue, last)));
    }
    last.map_or((Time::ZERO, None), |(_, times)| times)
}

pub fn length(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let length = c.build().cue(this.0)?.length();
    Ok(Dynamic::from_float(length.as_secs()))
}

pub fn start(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    c.build().cue(this.0)?;
    let (start, _) = times(&c.build(), this.0);
    Ok(Dynamic::from_float(start.as_secs()))
}

pub fn end(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    c.build().cue(this.0)?;
    let (_, end) = times(&c.build(), this.0);
    let end = end.ok_or_else(|| {
        ApiError::new("end: this cue repeats without end").hint("say when it is over, with .until(time)")
    })?;
    Ok(Dynamic::from_float(end.as_secs()))
}

