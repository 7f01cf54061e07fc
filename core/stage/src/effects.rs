//! Effects in use: on what, while what, with which parameters at a time.

use crate::edits::FrameEdits;
use crate::stage::{Channel, Stage};
use choreo_motion::Time;

/// An effect plugin in use, with its parameters as given in the script.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EffectUse {
    pub plugin: String,
    /// Sorted by name.
    pub parameters: Vec<(String, f64)>,
    /// `Property::Parameter` over stage time, in place of those in `parameters`; sorted by name.
    pub keys: Vec<(String, Channel)>,
    pub start: Time,
    pub end: Option<Time>,
    /// On these only, sorted; empty: on everything.
    pub on: Vec<EffectTarget>,
    /// Only while one of these of `Stage::cameras` is on, sorted; empty: whichever is.
    pub cameras: Vec<usize>,
}

/// What of the stage has an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EffectTarget {
    /// Index into `Stage::actors`.
    pub actor: usize,
    /// Of the actor's asset; `None`: all of them.
    pub material: Option<u32>,
}

/// An effect that is on at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectState {
    /// Index into `Stage::effects`.
    pub effect: usize,
    /// What the script gives it, as it is now; sorted by name. A spline may have left the parameter's range.
    pub parameters: Vec<(String, f64)>,
}

/// A parameter for one frame, by a callback.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectEdit {
    /// Index into `Stage::effects`.
    pub effect: usize,
    pub parameter: String,
    pub value: f64,
}

impl EffectTarget {
    /// Whether surfaces of this actor and this material of its asset are among these; all are where there are none.
    pub fn among(targets: &[EffectTarget], actor: usize, material: Option<u32>) -> bool {
        let covers = |t: &EffectTarget| t.actor == actor && (t.material.is_none() || t.material == material);
        targets.is_empty() || targets.iter().any(covers)
    }
}

impl EffectUse {
    /// Its parameters at a time, callbacks left out.
    pub fn parameters_at(&self, time: Time) -> Vec<(String, f64)> {
        let mut now = self.parameters.clone();
        for (name, keys) in &self.keys {
            if let Some(value) = keys.at(time) {
                put(&mut now, name, value[0]);
            }
        }
        now
    }
}

fn put(parameters: &mut Vec<(String, f64)>, name: &str, value: f64) {
    match parameters.binary_search_by(|(n, _)| n.as_str().cmp(name)) {
        Ok(at) => parameters[at].1 = value,
        Err(at) => parameters.insert(at, (name.to_string(), value)),
    }
}

/// `camera`: the one that is on.
pub(crate) fn evaluate(
    stage: &Stage,
    edits: &FrameEdits,
    time: Time,
    camera: Option<usize>,
    out: &mut Vec<EffectState>,
) {
    out.clear();
    for (effect, used) in stage.effects.iter().enumerate() {
        let in_time = used.start <= time && used.end.is_none_or(|end| time < end);
        let in_view = used.cameras.is_empty() || camera.is_some_and(|c| used.cameras.contains(&c));
        if !in_time || !in_view {
            continue;
        }
        let mut parameters = used.parameters_at(time);
        for edit in edits.effects.iter().filter(|e| e.effect == effect) {
            put(&mut parameters, &edit.parameter, edit.value);
        }
        out.push(EffectState { effect, parameters });
    }
}
