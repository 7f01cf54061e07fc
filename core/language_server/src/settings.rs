//! Settings of the client: `initializationOptions` of `initialize`, or the section `choreo` of its configuration.

use serde_json::Value;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Settings {
    /// Show start and end of cues after the calls that create them.
    pub cue_times: bool,
    /// Show lengths of clips after their names.
    pub clip_lengths: bool,
    /// Show commands above tests, the stage and camera cuts.
    pub code_lenses: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { cue_times: true, clip_lengths: true, code_lenses: true }
    }
}

impl Settings {
    /// Applies the settings that a client sends; others keep their values.
    pub(crate) fn update(&mut self, given: &Value) {
        let hints = &given["inlayHints"];
        let named = [
            (&mut self.cue_times, &hints["cueTimes"]),
            (&mut self.clip_lengths, &hints["clipLengths"]),
            (&mut self.code_lenses, &given["codeLenses"]),
        ];
        for (setting, value) in named {
            *setting = value.as_bool().unwrap_or(*setting);
        }
    }
}
