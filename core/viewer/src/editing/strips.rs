//! Clips as strips: split, duplicate, copy and paste, disable, change the speed or the weight.

use super::trimming::clamp_trim;
use super::{EditError, Step};
use crate::app::Viewer;
use crate::state::selection::{Selected, actor};
use crate::state::timeline::{Bar, Strip};
use choreo_motion::Repeat;
use choreo_session::edit::{
    CueTime, EditTime, ScriptObject, SecondHalf, copied_cues, copied_start, copy_cue, duplicate_cue, has_end,
    paste_cue, set_disabled, set_number, split_cue,
};

/// Clip durations below this are treated as zero, seconds.
pub(super) const MIN_CLIP_SECS: f64 = 1e-6;

impl Viewer {
    /// Splits clips at a time into two clips that together show the same.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change. The same holds for the functions below.
    pub fn split_cues(&mut self, all: &[Selected], at: f64) -> Result<(), EditError> {
        let mut steps = Vec::new();
        for what in all {
            let (bar, strip) = self.find_strip(what)?;
            if at <= bar.start.as_secs() + MIN_CLIP_SECS || at >= bar.draggable_end.as_secs() - MIN_CLIP_SECS
            {
                return Err(EditError::refused_at(&bar.place, "the playhead is not within this clip"));
            }
            let rest = match second_half(&bar, &strip, at)? {
                SecondHalf::Trim(trim) => {
                    SecondHalf::Trim(clamp_trim(&strip, trim, self.playhead.fps().as_fps()))
                }
                rest => rest,
            };
            let upper = matches!(what, Selected::Cue { layer: 1.., .. });
            let fade_out = Some(bar.fade_out.as_secs()).filter(|fade| upper && *fade > 0.0);
            let time = self.edit_time(at);
            steps.push(self.bar_step(&bar, move |text, line, column| {
                split_cue(text, line, column, time, rest, fade_out)
            }));
        }
        self.apply_steps(steps)
    }

    /// Adds a copy of a clip right after it; later clips of the layer move back.
    pub fn duplicate_cue(&mut self, what: &Selected) -> Result<(), EditError> {
        let (bar, strip) = self.find_strip(what)?;
        let known = self.displayed_text().ok_or(EditError::NothingShown)?;
        let has_stated_end = has_end(&known, bar.place.line, bar.place.column);
        if !has_stated_end && strip.repeat != Repeat::Once {
            let why = "the clip repeats to the end of the scene; give it an end first";
            return Err(EditError::refused_at(&bar.place, why));
        }
        let length = match has_stated_end {
            true => (bar.draggable_end - bar.start).as_secs(),
            false => strip.round_secs(),
        };
        let layer = self.layer_bars(what);
        let at = layer.iter().position(|other| other.what == *what).ok_or(EditError::ObjectGone)?;
        let copy_start =
            if has_stated_end { bar.draggable_end.as_secs() } else { bar.start.as_secs() + length };
        self.check_start(&bar.place, &bar.label, copy_start)?;
        let until = has_stated_end.then(|| self.edit_time(bar.draggable_end.as_secs() + length));
        let by = self.edit_time(length);
        let mut steps =
            vec![self.bar_step(&bar, move |text, line, column| duplicate_cue(text, line, column, by, until))];
        let moved = self.move_steps(&layer, &|index| index > at, length)?;
        // Cues that follow the end of the clip now follow the end of the copy.
        let is_followed = self.followed_bars(&layer).contains(&Some(at));
        steps.extend(moved.into_iter().filter(|step| !(is_followed && step.place == bar.place)));
        let note = self.hidden_bars_note(&layer[at + 1..], length);
        self.apply_steps(steps)?;
        self.note = note;
        Ok(())
    }

    /// Clips as text for the clipboard, one per line.
    pub fn copy_cues(&self, all: &[Selected]) -> Result<String, EditError> {
        let mut bars: Vec<Bar> = Vec::new();
        for what in all {
            bars.push(self.find_strip(what)?.0);
        }
        bars.sort_by_key(|bar| bar.start);
        let all = bars.iter().map(|bar| self.clip_text(bar));
        Ok(all.collect::<Result<Vec<_>, _>>()?.join("\n"))
    }

    /// Moves clips to another actor, all by the same time, like cutting and pasting. If the skeletons differ, the clips are retargeted.
    pub fn move_cues_to(&mut self, all: &[Selected], name: &str, by: f64) -> Result<(), EditError> {
        let (place, siblings) =
            self.place_of(&Selected::Actor(name.to_string())).ok_or(EditError::ObjectGone)?;
        let (mut steps, mut note) = (self.cue_delete_steps(all)?, None);
        let mut bars: Vec<Bar> = Vec::new();
        for what in all {
            bars.push(self.find_strip(what)?.0);
        }
        bars.sort_by_key(|bar| bar.start);
        for bar in bars {
            let (clip, of) = (&bar.label, bar.what.actor().unwrap_or_default());
            match self.joints_that_follow(of, clip, name) {
                Some((0, 1..)) => {
                    let why = format!("no joint of {name} follows {clip} of {of}");
                    return Err(EditError::refused_at(&bar.place, &why));
                }
                Some((joints, moved)) => {
                    note = Some(format!(
                        "{clip} of {of} on {name}: {joints} of {moved} animated joints are followed"
                    ));
                }
                None => {}
            }
            self.check_place(&bar.place, self.bars().filter(|other| other.place == bar.place).count())?;
            let copied = self.clip_text(&bar)?;
            let from = self.edit_time((bar.start.as_secs() + by).max(0.0));
            self.check_start(&bar.place, clip, from.secs)?;
            let make = move |text: &str, line, column| paste_cue(text, line, column, &copied, from);
            steps.push(Step::new(place.clone(), siblings, make));
        }
        self.apply_steps(steps)?;
        self.note = note;
        self.selection = Some(Selected::Actor(name.to_string()));
        Ok(())
    }

    /// A clip as text for the clipboard.
    pub(super) fn clip_text(&self, bar: &Bar) -> Result<String, EditError> {
        let known = self.displayed_text().ok_or(EditError::NothingShown)?;
        let (line, column) = (bar.place.line, bar.place.column);
        let until = has_end(&known, line, column).then(|| self.edit_time(bar.draggable_end.as_secs()));
        copy_cue(&known, line, column, self.edit_time(bar.start.as_secs()), until)
            .map_err(|refused| EditError::Refused { why: refused.why, line: refused.line })
    }

    /// Pastes copied clips on an actor, the first one at a time.
    pub fn paste_cues(&mut self, name: &str, copied: &str, secs: f64) -> Result<(), EditError> {
        self.check_unlocked(name)?;
        let (place, siblings) =
            self.place_of(&Selected::Actor(name.to_string())).ok_or(EditError::ObjectGone)?;
        let fps = self.playhead.fps().as_fps();
        let cues: Vec<String> = copied_cues(copied).into_iter().map(str::to_string).collect();
        let starts: Vec<f64> = cues.iter().map(|cue| copied_start(cue, fps).unwrap_or(0.0)).collect();
        let first = starts.iter().copied().fold(f64::INFINITY, f64::min);
        if cues.is_empty() {
            return Err(EditError::refused("the clipboard holds no clip of a timeline"));
        }
        let stage = &self.scene.as_ref().ok_or(EditError::NothingShown)?.stage;
        let asset = actor(stage, name).map(|index| &stage.actors[index].asset);
        if asset.is_some_and(|asset| asset.skeleton.len() < 2 && asset.clips.is_empty()) {
            return Err(EditError::refused_at(
                &place,
                &format!("{name} has no joints that a clip could move"),
            ));
        }
        let last = starts.iter().copied().fold(secs, |last, start| last.max(secs + start - first));
        self.check_start(&place, "the last pasted clip", last)?;
        let steps = cues.into_iter().zip(starts).map(|(copied, start)| {
            let from = self.edit_time(secs + start - first);
            let make = move |text: &str, line, column| paste_cue(text, line, column, &copied, from);
            Step::new(place.clone(), siblings, make)
        });
        let steps = steps.collect();
        self.apply_steps(steps)
    }

    /// Disables clips (weight 0), or enables them again if all are disabled.
    pub fn toggle_cues(&mut self, all: &[Selected]) -> Result<(), EditError> {
        let mut strips = Vec::new();
        for what in all {
            let (bar, strip) = self.find_strip(what)?;
            if matches!(what, Selected::Cue { layer: 0, cue: 0, .. }) {
                let why =
                    "the first clip of the base layer always has full weight; delete it, or hide the actor";
                return Err(EditError::refused_at(&bar.place, why));
            }
            strips.push((bar, strip));
        }
        let off = strips.iter().any(|(_, strip)| strip.weight > 0.0);
        let changed = strips.iter().filter(|(_, strip)| (strip.weight > 0.0) == off);
        let steps = changed.map(|(bar, _)| {
            self.bar_step(bar, move |text, line, column| set_disabled(text, line, column, off))
        });
        let steps = steps.collect();
        self.apply_steps(steps)
    }

    /// Changes the speed of a clip so that its present end, or the pose that it holds, is reached at the time `end`.
    pub fn stretch_cue(&mut self, what: &Selected, end: f64) -> Result<(), EditError> {
        let (bar, strip) = self.find_strip(what)?;
        let known = self.displayed_text().ok_or(EditError::NothingShown)?;
        let has_stated_end = bar.holds_from.is_none() && has_end(&known, bar.place.line, bar.place.column);
        let start = bar.start.as_secs();
        let length = bar.played_until().as_secs() - start;
        if end - start < MIN_CLIP_SECS || strip.is_keyed {
            let why = if strip.is_keyed {
                "keys set the time of the clip"
            } else {
                "the clip would have no length"
            };
            return Err(EditError::refused_at(&bar.place, why));
        }
        let speed = strip.speed * length / (end - start);
        let mut steps = vec![
            self.bar_step(&bar, move |text, line, column| set_number(text, line, column, "speed", speed)),
        ];
        if has_stated_end {
            steps.push(self.bar_time_step(&bar, CueTime::End, end));
        }
        self.apply_steps(steps)
    }

    pub(crate) fn set_weight(&mut self, what: &Selected, weight: f64) -> Result<(), EditError> {
        let (bar, _) = self.find_strip(what)?;
        let weight = weight.clamp(0.0, 1.0);
        let steps = vec![
            self.bar_step(&bar, move |text, line, column| set_number(text, line, column, "weight", weight)),
        ];
        self.apply_steps(steps)
    }

    /// A step that sets a time of an effect or a title.
    pub(super) fn object_time_step(&self, bar: &Bar, part: CueTime, secs: f64) -> Step<'static> {
        let time: EditTime = self.edit_time(secs.max(0.0));
        let name = if part == CueTime::Start { "from" } else { "until" };
        self.bar_step(bar, move |text, line, column| {
            ScriptObject::at(text, line, column)?.set_time(name, time)
        })
    }

    /// The actor that copied clips are pasted on: that of the selection, else the first.
    pub(crate) fn paste_target(&self) -> Option<String> {
        let stage = &self.scene.as_ref()?.stage;
        let selected = self.selection.as_ref().and_then(Selected::actor).map(str::to_string);
        selected
            .filter(|name| actor(stage, name).is_some())
            .or_else(|| Some(stage.actors.first()?.name.clone()))
    }

    pub(super) fn find_strip(&self, what: &Selected) -> Result<(Bar, Strip), EditError> {
        let bar = self.find_bar(what)?;
        match bar.strip {
            Some(strip) => Ok((bar, strip)),
            None => {
                Err(EditError::refused_at(&bar.place, "only the clips of actors can be changed like this"))
            }
        }
    }
}

/// Content of the second half of a clip that is split at a time.
fn second_half(bar: &Bar, strip: &Strip, at: f64) -> Result<SecondHalf, EditError> {
    let refuse = |why: &str| Err(EditError::refused_at(&bar.place, why));
    let played = (at - bar.start.as_secs()) * strip.speed.abs();
    let [from, to] = strip.trim;
    let length = to - from;
    if strip.is_keyed {
        return refuse("keys set the time of the clip; split it in the script");
    }
    match strip.repeat {
        Repeat::Once if played >= length - MIN_CLIP_SECS => {
            refuse("the clip has ended before that time; the last pose is held")
        }
        Repeat::Once if strip.speed < 0.0 => Ok(SecondHalf::Trim([from, to - played])),
        Repeat::Once => Ok(SecondHalf::Trim([from + played, to])),
        Repeat::Loop if strip.speed > 0.0 && length > MIN_CLIP_SECS => {
            let played_in_round = played % length;
            // Times are written with 3 decimal places.
            if played_in_round < 5e-4 || length - played_in_round < 5e-4 {
                return Ok(SecondHalf::LikeFirstHalf);
            }
            // The rest, up to the end of the crossfade into the next clip, fits into this round.
            if (bar.end.as_secs() - at) * strip.speed <= length - played_in_round {
                return Ok(SecondHalf::Trim([from + played_in_round, to]));
            }
            let end = bar.end.as_secs().max(at + 1.0);
            Ok(SecondHalf::ClipTime([
                [at, from + played_in_round],
                [end, from + played_in_round + (end - at) * strip.speed],
            ]))
        }
        _ => refuse("the clip plays as ping-pong, or backwards in a loop; split it in the script"),
    }
}
