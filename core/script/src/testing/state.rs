//! What the calls of one run have said about tests so far.

use super::{Claim, Expectation, PlanOptions, SectionInfo, Subject, When};
use super::{Flag, Quantity, RotationQuantity, SameWhat, TextsQuantity, Value, VectorQuantity};
use crate::call::Place;
use crate::value::DEAD;
use choreo_motion::Time;
use choreo_stage::Stage;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Default)]
pub struct TestState {
    /// Sections in the order of the script.
    pub sections: Vec<SectionInfo>,
    /// Line and column of the call for each of them.
    pub calls: Vec<(usize, usize)>,
    /// A call of `test` was wrong.
    pub refused: bool,
    /// The section to be run, where all of the file are known: the calls for others are passed over.
    pub wanted: Option<SectionInfo>,
    /// The section that was asked for is being run.
    pub running: bool,
    pub ran: bool,
    pub expectations: Vec<Expectation>,
    /// Calls of `expect`, with the number of comparisons made.
    pub asked: Vec<(Place, usize)>,
    /// Made with `stage_of`, in order.
    pub stages: Vec<Arc<Stage>>,
    /// 0: the section's own stage is being built; n: the n-th of `stages`.
    pub current_stage: usize,
    /// The other script that is being run.
    pub scene: Option<Scene>,
    /// Other scripts by their names in messages, with the place of the call that ran them.
    pub scenes: Vec<(String, Place)>,
    /// Place of the call of `scene` for the stage being built.
    pub scene_at: Option<Place>,
    /// Last line of each function of the script.
    pub ends: Arc<BTreeMap<String, usize>>,
}

/// Another script while it runs.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Canonical.
    pub folder: PathBuf,
    /// Parameters in place of `--set`.
    pub set: Vec<(String, String)>,
}

/// An `expect(…)` on its way to a comparison.
#[derive(Clone, Debug)]
pub struct ExpectRef {
    /// Index into `TestState::asked`.
    pub id: usize,
    pub stage: usize,
    pub measure: Measure,
    pub when: When,
    pub step: Option<Time>,
    pub negated: bool,
    pub sometime: bool,
}

/// What is compared.
#[derive(Clone, Debug)]
pub enum Measure {
    Number(Quantity),
    Vector(VectorQuantity),
    Rotation(RotationQuantity),
    Events(Option<Subject>),
    Texts(TextsQuantity),
    Value(Value),
    Whole(SameWhat),
    Plan(PlanOptions),
}

impl ExpectRef {
    pub fn dead() -> ExpectRef {
        ExpectRef {
            id: DEAD,
            stage: 0,
            measure: Measure::Value(Value::Nothing),
            when: When::Always,
            step: None,
            negated: false,
            sometime: false,
        }
    }

    /// As recorded; `source` is the line of the script.
    pub fn expectation(&self, claim: Claim, place: Place, source: String) -> Expectation {
        Expectation {
            place,
            source,
            stage: self.stage,
            when: self.when,
            step: self.step,
            negated: self.negated,
            sometime: self.sometime,
            claim,
        }
    }
}

impl Measure {
    /// The word used in messages.
    pub fn word(&self) -> &'static str {
        match self {
            Measure::Number(_) => "a number",
            Measure::Vector(VectorQuantity::Tint(_) | VectorQuantity::LightColor(_)) => "a color",
            Measure::Vector(_) => "a point",
            Measure::Rotation(_) => "a rotation",
            Measure::Events(_) => "events",
            Measure::Texts(_) => "lines of text",
            Measure::Value(Value::Text(_)) => "a text",
            Measure::Value(Value::List(_)) => "an array",
            Measure::Value(Value::Bool(_)) => "true or false",
            Measure::Value(_) => "a value",
            Measure::Whole(SameWhat::Stage) => "a stage",
            Measure::Whole(SameWhat::Pose(_)) => "a pose",
            Measure::Plan(_) => "a plan",
        }
    }
}

impl Claim {
    /// Judged look by look.
    pub fn graded(&self) -> bool {
        matches!(
            self,
            Claim::Number { .. }
                | Claim::Vector { .. }
                | Claim::Rotation { .. }
                | Claim::Flag(_)
                | Claim::InFrame(_)
        )
    }

    /// Whether the time plays no part in it.
    pub fn timeless(&self) -> bool {
        match self {
            Claim::Events { .. } | Claim::Value { .. } | Claim::Cost { .. } | Claim::Picture(_) => true,
            Claim::Texts { texts, .. } => matches!(texts, TextsQuantity::Warnings | TextsQuantity::Printed),
            Claim::Number { quantity, .. } => matches!(quantity, Quantity::Count(_)),
            Claim::Flag(Flag::Visible(_) | Flag::On(_) | Flag::Effect(_) | Flag::OnFloor(_)) => false,
            Claim::Vector { .. } | Claim::Rotation { .. } | Claim::InFrame(_) | Claim::Same { .. } => false,
        }
    }
}
