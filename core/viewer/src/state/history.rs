//! Edits of the script that can be undone and redone, and what is pending of them.

use crate::state::keyed::KeyRef;
use crate::state::selection::Selected;
use choreo_motion::Time;
use choreo_session::edit::Edit;
use glam::{DQuat, DVec3};
use std::path::PathBuf;

/// Changes that can be taken back and made again, the newest last.
#[derive(Default)]
pub struct History {
    pub(crate) done: Vec<Done>,
    pub(crate) undone: Vec<Done>,
    /// The text of the newest change, until a version shows it.
    pub(crate) unshown: Option<String>,
    /// The text that an undo has brought back, until it is shown, and the keys that were selected in it.
    pub(crate) restored: Option<(String, Vec<KeyRef>)>,
    /// The placement that the next version must show, if the change had its effect.
    pub(crate) wanted: Option<ExpectedPlacement>,
}

pub(crate) struct Done {
    /// The edit that undoes it.
    pub(crate) back: Edit,
    /// The text that it takes back from.
    pub(crate) text: String,
    /// The selection before the change, and the keys that were selected beside it.
    pub(crate) keys: (Option<Selected>, Vec<KeyRef>),
}

/// A change that is made if the user agrees.
#[derive(Default)]
pub struct Offer {
    pub why: String,
    /// Label of the button.
    pub agree: String,
    /// Lines that go (`-`), come (`+`) and stay (` `).
    pub difference: Vec<(char, String)>,
    /// Files that are copied first, from and to.
    pub(crate) copies: Vec<(PathBuf, PathBuf)>,
    pub(crate) edit: Edit,
    /// Another change in place of it.
    pub other: Option<Alternative>,
    /// The text that the edit was made for.
    pub(crate) text: String,
    /// Object that is selected once the change is made; `None`: the selection stays.
    pub(crate) selects: Option<Selected>,
}

/// The second of two changes that are offered.
pub struct Alternative {
    /// Label of the button.
    pub agree: String,
    /// Lines that go (`-`), come (`+`) and stay (` `).
    pub difference: Vec<(char, String)>,
    pub(crate) edit: Edit,
}

/// The placement of an actor that the next version must show.
pub(crate) struct ExpectedPlacement {
    pub(crate) actor: String,
    /// Time of the keys.
    pub(crate) time: Time,
    pub(crate) at: DVec3,
    pub(crate) rotation: DQuat,
    pub(crate) line: usize,
}
