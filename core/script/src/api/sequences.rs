//! Markers of clips and of the stage, footsteps of clips, and sequences for several actors.

use super::markers::{clip_marker, find_marker};
use crate::build::{ClipNotes, StageDraft};
use crate::call::{ApiError, Call, Reply, api};
use crate::value::{ActorRef, ClipRef};
use choreo_motion::{Clip, Time};
use rhai::{Dynamic, FnPtr};
use std::sync::{Arc, MutexGuard};

api! {
    /// Returns the time of a marker in seconds of the clip. With a time, sets the marker and returns the clip.
    Clip.marker("name | name, time") -> "float, or the Clip with a time" = marker_of_clip;
    /// Sets the footsteps for phase matching (in_step of Cue.then): the times of the clip in seconds at which feet
    /// come down, one foot after the other. By default they are found from the motion.
    Clip.steps("times") = steps;
    /// Returns the time of a marker of the stage in seconds. With a time, sets the marker.
    marker("name | name, time") -> "float" = marker_of_stage;
    /// Calls a function |actor| … for an actor, or for each actor of an array. Times inside count from the start of
    /// its sequence. Options: from (start time of the sequence, default 0), stagger (delay of each further actor,
    /// default 0).
    perform("who, what, options?") -> () = perform;
}

/// The largest number of markers of one clip, and of the stage.
const MAX_MARKERS: usize = 10_000;

fn clip_notes_mut<'a>(
    stage_draft: &'a mut MutexGuard<'_, StageDraft>,
    clip: &Arc<Clip>,
) -> &'a mut ClipNotes {
    let notes = || ClipNotes { _clip: clip.clone(), markers: Vec::new(), footstep_times: None };
    stage_draft.clip_notes.entry(Arc::as_ptr(clip) as usize).or_insert_with(notes)
}

fn check_within_clip(clip: &Clip, time: Time, label: &str) -> Result<Time, ApiError> {
    if time <= clip.duration {
        return Ok(time);
    }
    let (at, end) = (time.as_secs(), clip.duration.as_secs());
    Err(ApiError::new(format!("{label} at {at} s is after the end of clip \"{}\", {end} s", clip.name)))
}

fn set_marker(markers: &mut Vec<(String, Time)>, name: String, time: Time) -> Result<(), ApiError> {
    markers.retain(|(known, _)| *known != name);
    if markers.len() >= MAX_MARKERS {
        return Err(ApiError::new(format!("marker: at most {MAX_MARKERS} markers")));
    }
    markers.push((name, time));
    Ok(())
}

fn marker_of_clip(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    let name = c.name(0)?;
    if c.len() == 1 {
        return Ok(Dynamic::from_float(clip_marker(c, &this.clip, &name)?.as_secs()));
    }
    let time = check_within_clip(&this.clip, c.duration(1)?, "marker")?;
    set_marker(&mut clip_notes_mut(&mut c.stage_draft(), &this.clip).markers, name, time)?;
    c.receiver()
}

fn steps(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    let value = c.value(0);
    let rows = value.read_lock::<rhai::Array>().filter(|rows| (2..=1000).contains(&rows.len()));
    let rows = rows.ok_or_else(|| c.wrong(0, "an array of at least two times of the clip"))?;
    let time = |v: &Dynamic| check_within_clip(&this.clip, crate::call::duration(v, "steps: time")?, "steps");
    let times = rows.iter().map(time).collect::<Result<Vec<_>, ApiError>>()?;
    if times.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Err(ApiError::new("steps: the times must increase"));
    }
    clip_notes_mut(&mut c.stage_draft(), &this.clip).footstep_times = Some(times);
    c.receiver()
}

fn marker_of_stage(c: &mut Call) -> Reply {
    let name = c.name(0)?;
    let time = match c.len() {
        1 => find_marker(&c.stage_draft().markers, &name, "")?,
        _ => {
            let time = c.time(1)?;
            set_marker(&mut c.stage_draft().markers, name, time)?;
            time
        }
    };
    Ok(Dynamic::from_float((time - c.stage_draft().sequence_start).as_secs()))
}

fn perform(c: &mut Call) -> Reply {
    let who = c.value(0);
    let actors: Vec<Dynamic> = match who.read_lock::<rhai::Array>() {
        Some(array) => array.iter().map(Dynamic::flatten_clone).collect(),
        None => vec![who.flatten_clone()],
    };
    if actors.is_empty() || !actors.iter().all(|a| a.is::<ActorRef>()) {
        return Err(c.wrong(0, "an Actor or an array of them"));
    }
    let Some(what) = c.value(1).try_cast::<FnPtr>() else {
        return Err(c.wrong(1, "a function, |actor| …"));
    };
    let o = c.options(2, &["from", "stagger"])?;
    let from = o.get("from").map(|v| crate::call::time(&v, "perform: from")).transpose()?;
    let stagger = o.get("stagger").map(|v| crate::call::time(&v, "perform: stagger")).transpose()?;
    let before = c.stage_draft().sequence_start;
    let mut begin = before + from.unwrap_or(Time::ZERO);
    for actor in actors {
        c.stage_draft().sequence_start = begin;
        let result = what.call_within_context::<Dynamic>(c.native_context, (actor,));
        c.stage_draft().sequence_start = before;
        if let Err(error) = result {
            return super::test::report_failure(c, *error);
        }
        begin += stagger.unwrap_or(Time::ZERO);
    }
    Ok(Dynamic::UNIT)
}
