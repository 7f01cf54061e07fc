//! The survey of a stage: finds parts of it that have no visible effect, by evaluating it at some times, without drawing.
//!
//! Boxes are conservative (never smaller than what they hold), so "never in the image" is true where it is reported; something
//! that hides behind another thing, or whose box alone is in the image, is not found.

mod camera_view;
mod facts;
mod reaches;

use crate::evaluate::Evaluator;
use crate::snapshot::Snapshot;
use crate::stage::channel::{Channel, Property};
use crate::stage::{Stage, StageError};
use choreo_motion::Time;
use facts::SurveyFacts;

/// The subject of a finding; indices into the stage's lists.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// The stage as a whole.
    Stage,
    /// Index into `Stage::actors`.
    Actor(usize),
    /// Index into `Actor::look_at`.
    Look { actor: usize, look: usize },
    /// Index into `Actor::constraints`.
    Constraint { actor: usize, constraint: usize },
    /// Index into `Stage::cameras`.
    Camera(usize),
    /// Index into `Stage::cuts`.
    Cut(usize),
    /// Index into `Stage::lights`.
    Light(usize),
    /// Index into `Stage::effects`.
    Effect(usize),
}

/// A part of the stage that is valid, but probably not intended.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// A fixed name of the kind of finding: `never_in_picture`.
    pub rule: &'static str,
    /// Whether this is often intended, and reported as a note instead of a warning.
    pub note: bool,
    /// The part of the stage that the finding is about.
    pub subject: Subject,
    /// The message, one sentence.
    pub text: String,
    /// A remedy, where there is one.
    pub hint: Option<String>,
}

/// Limit of the cost of a survey, in poses; a callback costs [`CALLBACK_COST`]. About 20 ms for characters of 50 joints.
const MAX_COST: usize = 3000;
const CALLBACK_COST: usize = 20;

impl Stage {
    /// Finds all parts of the stage that have no visible effect, in the order of the stage. Evaluates frames spread over the whole length
    /// until each part has been visible, or until `MAX_COST` is reached. Fails if a frame cannot be evaluated.
    pub fn survey(self: &std::sync::Arc<Stage>) -> Result<Vec<Finding>, StageError> {
        self.survey_while(&|| true)
    }

    /// Surveys the stage as [`Stage::survey`] does, but stops, without findings, once `goes_on` returns false.
    pub fn survey_while(
        self: &std::sync::Arc<Stage>,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Vec<Finding>, StageError> {
        let mut evaluator = Evaluator::new(self.clone());
        let mut snapshot = Snapshot::default();
        let mut facts = SurveyFacts::new(self);
        let rate = self.settings.fps;
        let frames = rate.frames_in(self.settings.length).max(1);
        let mut cost = 0;
        for frame in bit_reversed_order(frames) {
            if !goes_on() {
                return Ok(Vec::new());
            }
            let time = rate.time_of(frame);
            evaluator.at_into(time, &mut snapshot)?;
            facts.record(self, evaluator.edits(), &snapshot, time);
            cost +=
                evaluator.poses() + self.actors.len() / 8 + CALLBACK_COST * self.frame_callbacks.len() + 1;
            if !facts.may_change(self) {
                break;
            }
            if cost > MAX_COST {
                facts.stopped_early = facts.times < frames as usize;
                break;
            }
        }
        let mut findings = facts.findings(self);
        find_unused_parts(self, &mut findings);
        findings.sort_by_key(|f| f.subject);
        Ok(findings)
    }
}

/// The numbers of `0..count`, each once, in bit-reversed order: 0, then always the middles of the largest gaps.
fn bit_reversed_order(count: i64) -> impl Iterator<Item = i64> {
    let bits = (count as u64).next_power_of_two().trailing_zeros();
    let reversed = move |i: u64| if bits == 0 { 0 } else { (i.reverse_bits() >> (64 - bits)) as i64 };
    (0..1u64 << bits).map(reversed).filter(move |i| *i < count)
}

/// Findings from the stage's lists alone, without evaluating a frame.
fn find_unused_parts(stage: &Stage, findings: &mut Vec<Finding>) {
    let length = stage.settings.length;
    let warn = |rule, subject, text: String, hint: &str| Finding {
        rule,
        note: false,
        subject,
        text,
        hint: (!hint.is_empty()).then(|| hint.to_string()),
    };
    let on = active_durations(stage);
    for (index, camera) in stage.cameras.iter().enumerate() {
        if on[index] > Time::ZERO {
            continue;
        }
        let name = &camera.name;
        let cut_to = stage.cuts.iter().any(|c| c.camera == index);
        let text = match cut_to {
            true => format!(
                "camera \"{name}\" is never on: the cut to another camera comes before its first frame"
            ),
            false => format!("camera \"{name}\" is never on: there is no cut to it"),
        };
        let hint = if cut_to { "" } else { "the first camera is on from the start, others from .cut(time)" };
        findings.push(warn("camera_never_on", Subject::Camera(index), text, hint));
    }
    for (index, cut) in stage.cuts.iter().enumerate() {
        let before = match index {
            0 => 0,
            _ => stage.cuts[index - 1].camera,
        };
        if before == cut.camera && cut.at > Time::ZERO && cut.at < length {
            let name = stage.cameras.get(cut.camera).map_or("", |c| c.name.as_str());
            let text = format!("camera \"{name}\" is on already at {} s", cut.at.as_secs());
            findings.push(Finding { note: true, ..warn("cut_to_itself", Subject::Cut(index), text, "") });
        }
    }
    for (index, effect) in stage.effects.iter().enumerate() {
        let end = effect.end.unwrap_or(length);
        if effect.start >= length || end <= effect.start.max(Time::ZERO) {
            let text = format!(
                "effect \"{}\" is never on: it runs from {} s to {} s, the stage from 0 s to {} s",
                effect.plugin,
                effect.start.as_secs(),
                end.as_secs(),
                length.as_secs()
            );
            findings.push(warn("effect_never_on", Subject::Effect(index), text, ""));
        }
    }
    let late_keys_text = |channels: &[Channel]| -> Option<String> {
        let starts_after_end =
            |c: &&Channel| c.times.first().is_some_and(|t| *t >= length) && c.times.len() > 1;
        let first = channels.iter().find(starts_after_end)?;
        let at = first.times.first().map_or(0.0, |t| t.as_secs());
        Some(format!(
            "all keys of {} come after the end of the stage: the first at {at} s, the end at {} s",
            property_name(first.property),
            length.as_secs()
        ))
    };
    let lists = stage.actors.iter().enumerate().map(|(i, a)| (Subject::Actor(i), &a.name, &a.channels));
    let lists = lists
        .chain(stage.cameras.iter().enumerate().map(|(i, c)| (Subject::Camera(i), &c.name, &c.channels)))
        .chain(stage.lights.iter().enumerate().map(|(i, l)| (Subject::Light(i), &l.name, &l.channels)));
    let of_effects = stage.effects.iter().enumerate().flat_map(|(i, e)| {
        e.keys.iter().map(move |(_, keys)| (Subject::Effect(i), &e.plugin, std::slice::from_ref(keys)))
    });
    let sky_name = "sky".to_string();
    let of_sky = stage.sky.iter().map(|sky| (Subject::Stage, &sky_name, sky.channels.as_slice()));
    let lists = lists.map(|(s, n, c)| (s, n, c.as_slice())).chain(of_effects).chain(of_sky);
    for (subject, name, channels) in lists {
        if let Some(text) = late_keys_text(channels) {
            findings.push(warn("keys_after_end", subject, format!("\"{name}\": {text}"), ""));
        }
    }
}

fn property_name(property: Property) -> &'static str {
    match property {
        Property::Translation => "the position",
        Property::Rotation => "the rotation",
        Property::Scale => "the scale",
        Property::Visible => "the visibility",
        Property::Tint => "the tint",
        Property::LineWidth => "the width",
        Property::Copies => "the count",
        Property::Morph { .. } => "a morph target",
        Property::Expression { .. } => "an expression",
        Property::FieldOfView => "the field of view",
        Property::FocalLength => "the focal length",
        Property::Intensity => "the intensity",
        Property::Color => "the color",
        Property::Weight => "the weight",
        Property::Speed => "the speed",
        Property::ClipTime => "the clip time",
        Property::Parameter => "a parameter",
        Property::Turn => "the turn",
        Property::Opacity => "the opacity",
        Property::Range => "the range",
        Property::Cone => "the cone",
    }
}

/// Time for which each camera is active within the stage's length.
fn active_durations(stage: &Stage) -> Vec<Time> {
    let length = stage.settings.length;
    let mut on = vec![Time::ZERO; stage.cameras.len()];
    let starts = std::iter::once((Time::ZERO, 0)).chain(stage.cuts.iter().map(|c| (c.at, c.camera)));
    // The camera before a cut stays on while that dissolves.
    let ends = stage.cuts.iter().map(|c| c.at + c.dissolve).chain([length]);
    for ((start, camera), end) in starts.zip(ends) {
        let (start, end) = (start.max(Time::ZERO), end.min(length));
        if let Some(on) = on.get_mut(camera)
            && end > start
        {
            *on += end - start;
        }
    }
    on
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bit_reversed_order_holds_each_number_once() {
        for count in [1, 2, 3, 8, 100, 257] {
            let order: Vec<i64> = bit_reversed_order(count).collect();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..count).collect::<Vec<_>>());
        }
        assert_eq!(bit_reversed_order(8).collect::<Vec<_>>(), [0, 4, 2, 6, 1, 5, 3, 7]);
    }
}
