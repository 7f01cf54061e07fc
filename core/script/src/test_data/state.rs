//! State of the tests during one run of a script.

use super::{Expectation, SectionInfo};
use crate::api_error::Place;
use choreo_stage::Stage;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Sections, expectations and stages of a test file during one run.
#[derive(Default)]
pub(crate) struct TestState {
    /// Sections in the order of the script.
    pub sections: Vec<SectionInfo>,
    /// Line and column of the call of `test` for each section.
    pub calls: Vec<(usize, usize)>,
    /// A call of `test` has failed with an error.
    pub has_failed_test_call: bool,
    /// The section to be run, if the sections of the file are known. Calls of `test` for other sections are skipped.
    pub wanted_section: Option<SectionInfo>,
    /// The function of the section to be run is running.
    pub is_running: bool,
    /// The function of the section to be run has been called.
    pub has_started: bool,
    pub expectations: Vec<Expectation>,
    pub pending_expects: Vec<PendingExpect>,
    /// The stages made with `stage_of`, in order.
    pub stages: Vec<Arc<Stage>>,
    /// 0: the section's own stage is being built; n: the n-th of `stages`.
    pub current_stage: usize,
    /// The script that a call of `scene` is running, if any.
    pub scene: Option<RunningScript>,
    /// Scripts that `scene` has run: name in messages, and place of the call.
    pub scenes: Vec<(String, Place)>,
    /// Place of the call of `scene` for the stage being built.
    pub scene_at: Option<Place>,
    /// Last line of each function of the script.
    pub function_ends: Arc<BTreeMap<String, usize>>,
}

impl TestState {
    /// Counts a comparison for a call of `expect`, also a comparison that has failed with an error.
    pub(crate) fn count_comparison(&mut self, expect: usize) {
        if let Some(pending) = self.pending_expects.get_mut(expect) {
            pending.comparisons += 1;
            pending.unused_modifier = None;
        }
    }
}

/// A call of `expect`.
pub(crate) struct PendingExpect {
    pub place: Place,
    /// Comparisons made, or refused with an error of their own.
    pub comparisons: usize,
    /// The last modifier, such as `not`, that no comparison has used yet.
    pub unused_modifier: Option<(&'static str, Place)>,
}

/// A script that a call of `scene` runs.
#[derive(Clone, Debug)]
pub(crate) struct RunningScript {
    /// Canonical path of the folder of the script.
    pub folder: PathBuf,
    /// Names and values of parameters, which replace those given with `--set`.
    pub set_parameters: Vec<(String, String)>,
}
