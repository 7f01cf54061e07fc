//! Start and end times of cues.

use crate::build::{Build, CueDraft};
use crate::call::{ApiError, Call, Reply};
use crate::value::CueRef;
use choreo_motion::Time;
use choreo_stage::{Cue, Repeat};
use rhai::Dynamic;

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

    /// Whether the clip plays at one constant speed.
    pub fn is_even(&self) -> bool {
        self.cue.time_remapping.is_none() && self.cue.freezes.is_empty()
    }

    pub fn part(&self) -> (Time, Time) {
        self.trim.unwrap_or((Time::ZERO, self.cue.clip.duration))
    }

    /// Duration of the trimmed part, played once at its speed.
    pub fn length(&self) -> Time {
        let (start, end) = self.part();
        (end - start).scaled(1.0 / self.cue.speed)
    }

    /// The repeat mode of the script. By default layers and cues that another follows play once; others loop.
    pub fn repeats(&self, layer: bool) -> Repeat {
        let once = layer || (self.followed && self.until.is_none());
        self.repeat.unwrap_or(if once { Repeat::Once } else { Repeat::Loop })
    }
}

/// Start and end of every cue; `None` for one that repeats without end.
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
        None => cue.origin,
        Some((_, (start, None))) => start,
        Some((before, (_, Some(end)))) => {
            // Where the one before is not cut off but ends by itself, this one comes in while it still moves.
            let natural = before.until.is_none();
            end - if natural { cue.cue.fade_in.min(before.length()) } else { Time::ZERO }
        }
    };
    let start = cue.start.unwrap_or(start);
    let layer = build.chains[cue.chain].is_layer();
    let natural = match cue.repeats(layer) {
        Repeat::Once if cue.is_even() => Some(start + cue.length()),
        Repeat::Once => cue.cue(start).played_through(),
        _ => None,
    };
    (start, cue.until.or(natural))
}

/// Start and end of the cue with this index.
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
    Ok(Dynamic::from_float((start - c.build().offset).as_secs()))
}

pub fn end(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    c.build().cue(this.0)?;
    let (_, end) = times(&c.build(), this.0);
    let end = end.ok_or_else(|| {
        ApiError::new("end: this cue repeats without end").hint("say when it is over, with .until(time)")
    })?;
    Ok(Dynamic::from_float((end - c.build().offset).as_secs()))
}

pub fn time_of(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let count = if c.len() > 1 { c.number_in(1, 1.0, 1e6)? as i128 } else { 1 };
    let value = c.value(0);
    let draft = c.build().cue(this.0)?.clone();
    let at = if value.is_string() {
        super::super::sequences::clip_marker(c, &draft.cue.clip, &c.text(0)?)?
    } else {
        c.duration(0)?
    };
    let (start, end) = draft.part();
    let name = &draft.cue.clip.name;
    if at < start || at > end {
        return Err(ApiError::new(format!(
            "time_of: {} s is not in the part of clip \"{name}\" that is played, {} s to {} s",
            at.as_secs(),
            start.as_secs(),
            end.as_secs()
        )));
    }
    let build = c.build();
    let (from, until) = times(&build, this.0);
    let repeat = draft.repeats(build.chains[draft.chain].is_layer());
    let length = i128::from((end - start).0);
    let into = i128::from((if draft.reverse { end - at } else { at - start }).0);
    let played = match repeat {
        Repeat::Once => (count == 1).then_some(into),
        Repeat::Loop => Some(into + (count - 1) * length),
        // There and back again.
        Repeat::PingPong if count % 2 == 1 => Some(into + (count - 1) * length),
        Repeat::PingPong => Some(count * length - into),
    };
    let when = played.and_then(|played| draft.cue(from).time_of_played(played));
    let when = when.filter(|when| until.is_none_or(|until| *when <= until)).ok_or_else(|| {
        ApiError::new(format!("time_of: clip \"{name}\" does not get there {count} times"))
            .hint("it ends before; .loop() and .until(time) say for how long it is played")
    })?;
    Ok(Dynamic::from_float((when - build.offset).as_secs()))
}
