//! Reasons for which an expectation cannot be judged.

use super::looks::MOST;
use choreo_script::Diagnostic;
use choreo_script::testing::TimeUsedUp;
use choreo_stage::StageError;

#[derive(Debug, thiserror::Error)]
pub(crate) enum Unjudged {
    #[error("no such {0}")]
    Missing(&'static str),
    /// A callback of the stage failed, for example.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The test's own function of time failed.
    #[error("{0}")]
    Formula(Diagnostic),
    #[error(transparent)]
    Timeout(#[from] TimeUsedUp),
    #[error("judging this section takes longer than {0} s: look at less, or raise --limit seconds=NUMBER")]
    TooLong(f64),
    #[error("this would take {0} looks, {MOST} are allowed: use .during or a longer .every")]
    TooManyLooks(i64),
    #[error(
        "the span holds {found} looks, {needed} are needed: make it longer, or look more often with .every(seconds)"
    )]
    TooFewLooks { found: usize, needed: usize },
    #[error("{time} s is outside the stage, which lasts from 0 to {length} s")]
    OutsideStage { time: f64, length: f64 },
    #[error("a hidden actor has no pose, at {0}")]
    HiddenActor(String),
    /// Would not slide wherever it is.
    #[error(
        "it never touches the floor from {from} to {to}: its lowest place is {lowest} m above it; options: height, speed, swing, ground"
    )]
    NeverOnFloor { from: String, to: String, lowest: String },
}
