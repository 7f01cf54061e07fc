//! Script limits whose time limit is never reached.

use choreo_script::{Limits, ScriptOptions};

/// A lesson can take longer than the default limit of 20 s on a busy machine.
pub(crate) fn script_options() -> ScriptOptions {
    let limits = Limits { seconds: 900.0, frame_seconds: 900.0, ..Limits::default() };
    ScriptOptions { limits, ..ScriptOptions::default() }
}
