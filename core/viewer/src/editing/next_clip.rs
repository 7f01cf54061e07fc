//! Start of a clip that is added to an actor, and its effect on the clips that already play.

use crate::app::Viewer;
use crate::state::selection::actor;
use choreo_motion::{Repeat, Time};
use choreo_stage::Cue;

/// Duration of the crossfade into an added clip, seconds.
pub(super) const CROSSFADE_SECS: f64 = 0.3;

/// End of a clip, stated or because it plays once. `None` if it repeats.
fn cue_end(cue: &Cue) -> Option<Time> {
    cue.end.or_else(|| cue.first_play_end().filter(|_| cue.repeat == Repeat::Once))
}

impl Viewer {
    /// Cues of an actor's base layer in the order of their starts.
    fn base_cues(&self, name: &str) -> Vec<&Cue> {
        let stage = self.scene.as_ref().map(|scene| &scene.stage);
        let layer = stage.and_then(|stage| stage.actors[actor(stage, name)?].layers.first());
        let mut cues: Vec<&Cue> = layer.into_iter().flat_map(|layer| &layer.cues).collect();
        cues.sort_by_key(|cue| cue.start);
        cues
    }

    /// Whether an actor has a clip on its base layer.
    pub(super) fn has_base_clip(&self, name: &str) -> bool {
        !self.base_cues(name).is_empty()
    }

    /// Whether a clip on the base layer of an actor begins in the frame at a time.
    pub(super) fn clip_begins_at(&self, name: &str, secs: f64) -> bool {
        let (fps, at) = (self.playhead.fps(), Time::from_secs(secs));
        self.base_cues(name).iter().any(|cue| fps.frames_in(cue.start) == fps.frames_in(at))
    }

    /// Start of a clip that follows all others of an actor, seconds: the stated end of the last clip, or its natural end less the crossfade. A last
    /// clip without an end is followed at the playhead, if that is later; else after one round, or halfway to the end of the scene if the round
    /// would not end before. Without clips, the playhead.
    pub(super) fn start_after_last_clip(&self, name: &str) -> f64 {
        let now = self.playhead.time();
        let cues = self.base_cues(name);
        let Some(last) = cues.last() else { return now.as_secs() };
        let begins = last.start.as_secs();
        match (last.end, cue_end(last)) {
            (Some(end), _) => end.as_secs(),
            (None, Some(end)) => {
                let end = end.as_secs();
                end - CROSSFADE_SECS.min((end - begins) / 2.0)
            }
            _ if now > last.start => now.as_secs(),
            _ => {
                let (from, to) = last.trim;
                let round_end = begins + (to - from).as_secs() / last.speed.abs().max(1e-9);
                let length = self.timeline.length.as_secs();
                if round_end < length { round_end } else { ((begins + length) * 5.0).round() / 10.0 }
            }
        }
    }

    /// Note about the effect of an added clip on other clips of the actor, since only one of them can have the whole body. `layer`: the row that
    /// the clip was dropped on.
    pub(super) fn overlap_note(&self, name: &str, clip: &str, secs: f64, layer: usize) -> Option<String> {
        let at = Time::from_secs(secs);
        let cues = self.base_cues(name);
        let before = cues.iter().rev().find(|cue| cue.start <= at);
        // A clip that merely crossfades at its end is not overridden.
        let overridden =
            before.filter(|cue| cue_end(cue).is_none_or(|end| end.as_secs() > secs + CROSSFADE_SECS + 1e-3));
        let next = cues.iter().find(|cue| cue.start > at);
        let mut parts = Vec::new();
        if layer > 0 {
            parts.push(format!("{clip} has no mask, unlike row +{layer}: it plays on all joints of {name}"));
        }
        let time = |time: Time| self.time_text(time);
        match (overridden, next) {
            (Some(overridden), next) => {
                let until = next.map(|next| format!(" until {} at {}", next.clip.name, time(next.start)));
                let until = until.unwrap_or_default();
                parts.push(format!("{clip} takes over from {} at {}{until}", overridden.clip.name, time(at)));
            }
            (None, Some(next)) => {
                parts.push(format!(
                    "{clip} plays until {} takes over at {}",
                    next.clip.name,
                    time(next.start)
                ));
            }
            (None, None) => {}
        }
        if overridden.is_some() || layer > 0 {
            parts.push("set a mask (on, in the inspector) to play both at the same time".to_string());
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
