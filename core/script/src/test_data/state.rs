//! State of the tests during one run of a script.

use super::{Expectation, SectionInfo};
use crate::api_error::Place;
use choreo_stage::Stage;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Default)]
pub(crate) struct TestState {
    /// Sections in the order of the script.
    pub sections: Vec<SectionInfo>,
    /// Line and column of the call for each of them.
    pub calls: Vec<(usize, usize)>,
    /// A call of `test` was refused.
    pub refused: bool,
    /// The section to be run, if the sections of the file are known. Calls of `test` for other sections are skipped.
    pub wanted: Option<SectionInfo>,
    /// The function of the requested section is running.
    pub running: bool,
    pub ran: bool,
    pub expectations: Vec<Expectation>,
    pub pending_expects: Vec<PendingExpect>,
    /// The stages made with `stage_of`, in order.
    pub stages: Vec<Arc<Stage>>,
    /// 0: the section's own stage is being built; n: the n-th of `stages`.
    pub current_stage: usize,
    /// The script that a call of `scene` is running, if any.
    pub scene: Option<RunningScript>,
    /// Other scripts by their names in messages, with the place of the call that ran them.
    pub scenes: Vec<(String, Place)>,
    /// Place of the call of `scene` for the stage being built.
    pub scene_at: Option<Place>,
    /// Last line of each function of the script.
    pub ends: Arc<BTreeMap<String, usize>>,
}

impl TestState {
    /// Counts a comparison for a call of `expect`, also one that was refused.
    pub fn compared(&mut self, expect: usize) {
        if let Some(pending) = self.pending_expects.get_mut(expect) {
            pending.comparisons += 1;
            pending.unused = None;
        }
    }
}

/// A call of `expect`.
pub(crate) struct PendingExpect {
    pub place: Place,
    /// Comparisons made, or refused with an error of their own.
    pub comparisons: usize,
    /// The last modifier, such as `not`, that no comparison has used yet.
    pub unused: Option<(&'static str, Place)>,
}

/// A script that a call of `scene` runs.
#[derive(Clone, Debug)]
pub struct RunningScript {
    /// Canonical path of the folder of the script.
    pub folder: PathBuf,
    /// Parameters in place of `--set`.
    pub set: Vec<(String, String)>,
}
