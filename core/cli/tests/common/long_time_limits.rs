//! Scripts that no clock stops.

use choreo_script::{Limits, ScriptOptions};

/// Beside other work a lesson can take longer than the 20 s of the default.
pub fn script_options() -> ScriptOptions {
    let limits = Limits { seconds: 900.0, frame_seconds: 900.0, ..Limits::default() };
    ScriptOptions { limits, ..ScriptOptions::default() }
}
