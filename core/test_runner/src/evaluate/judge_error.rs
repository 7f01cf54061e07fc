//! Reasons for which an expectation cannot be judged.

use super::snapshot_cache::MAX_SAMPLES;
use choreo_script::Diagnostic;
use choreo_script::testing::TimeUsedUp;
use choreo_stage::StageError;

#[derive(Debug, thiserror::Error)]
pub(crate) enum JudgeError {
    #[error("the {0} does not exist")]
    Missing(&'static str),
    /// Error of the stage, such as a failed callback.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The test's function of time failed.
    #[error("{0}")]
    Formula(Diagnostic),
    #[error(transparent)]
    Timeout(#[from] TimeUsedUp),
    #[error(
        "judging this section takes longer than {0} s: check fewer times, or raise --limit seconds=NUMBER"
    )]
    TooLong(f64),
    #[error("this would take {0} samples, at most {MAX_SAMPLES} are allowed: use .during or a longer .every")]
    TooManySnapshots(i64),
    #[error(
        "the span holds {found} samples, {needed} are needed: make it longer, or sample more often with \
         .every(seconds)"
    )]
    TooFewSnapshots { found: usize, needed: usize },
    #[error("{time} s is outside the stage, which lasts from 0 to {length} s")]
    OutsideStage { time: f64, length: f64 },
    #[error("a hidden actor has no pose, at {0}")]
    HiddenActor(String),
    /// The joint never touches the floor, so that any test of its sliding distance would pass.
    #[error(
        "it never touches the floor from {from} to {to}: its lowest point is {lowest} m above it; options: \
         height, speed, swing, ground"
    )]
    NeverOnFloor { from: String, to: String, lowest: String },
}
