//! Undo and redo of script edits, and pending effects of edits.

use crate::state::keyed::KeyRef;
use crate::state::selection::Selected;
use choreo_motion::Time;
use choreo_session::edit::Edit;
use glam::{DQuat, DVec3};
use std::path::PathBuf;

/// Edits that can be undone and redone, the newest last.
#[derive(Default)]
pub struct History {
    pub(crate) done: Vec<AppliedEdit>,
    pub(crate) undone: Vec<AppliedEdit>,
    /// Text after the newest edit, until a version of it is displayed.
    pub(crate) pending_text: Option<String>,
    /// Text that an undo has restored, until it is displayed, and the keys to select then.
    pub(crate) restored: Option<(String, Vec<KeyRef>)>,
    /// Expected placement of an actor in the next version, to detect an edit without effect.
    pub(crate) expected_placement: Option<ExpectedPlacement>,
}

pub(crate) struct AppliedEdit {
    /// The inverse edit.
    pub(crate) inverse: Edit,
    /// The text that `inverse` applies to.
    pub(crate) text: String,
    /// The selection before the edit, and the keys that were selected.
    pub(crate) keys: (Option<Selected>, Vec<KeyRef>),
}

/// An edit that is made if the user agrees.
#[derive(Default)]
pub struct Offer {
    pub why: String,
    /// Label of the button.
    pub label: String,
    /// Lines of the difference: removed (`-`), added (`+`) and unchanged (` `).
    pub difference: Vec<(char, String)>,
    /// Files to copy before the edit: source and destination.
    pub(crate) copies: Vec<(PathBuf, PathBuf)>,
    pub(crate) edit: Edit,
    /// An alternative edit.
    pub other: Option<Alternative>,
    /// The text that the edit was made for.
    pub(crate) text: String,
    /// Object to select after the edit. `None`: the selection stays.
    pub(crate) selects: Option<Selected>,
}

/// The second of two offered edits.
pub struct Alternative {
    /// Label of the button.
    pub label: String,
    /// Lines of the difference: removed (`-`), added (`+`) and unchanged (` `).
    pub difference: Vec<(char, String)>,
    pub(crate) edit: Edit,
}

/// Expected placement of an actor in the next version.
pub(crate) struct ExpectedPlacement {
    pub(crate) actor: String,
    /// Time at which the placement is compared.
    pub(crate) time: Time,
    pub(crate) at: DVec3,
    pub(crate) rotation: DQuat,
    pub(crate) line: usize,
}
