//! Keyboard shortcuts: those of a preset, and the user's own from a small JSON file next to the settings:
//!
//! ```json
//! { "preset": "blender", "keys": { "split": "Shift+Y", "hide": "" } }
//! ```
//! A value is one key or several, separated by a comma and a blank; an empty value removes the key. `PRESETS` lists the presets.

use choreo_files::write_whole_beneath;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

/// A key with modifiers.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Chord {
    /// Ctrl, or Command on a Mac.
    pub ctrl: bool,
    pub shift: bool,
    pub alt: bool,
    /// Name of the key in the toolkit.
    pub key: String,
}

impl Chord {
    /// Parses a text such as `Ctrl+Shift+Z`.
    pub fn parse(text: &str) -> Option<Chord> {
        let mut chord = Chord { ctrl: false, shift: false, alt: false, key: String::new() };
        let (held, key) = text.trim().rsplit_once('+').unwrap_or(("", text.trim()));
        for word in held.split('+').filter(|word| !word.is_empty()) {
            match word.trim().to_lowercase().as_str() {
                "ctrl" | "cmd" | "command" => chord.ctrl = true,
                "shift" => chord.shift = true,
                "alt" | "option" => chord.alt = true,
                _ => return None,
            }
        }
        chord.key = key.trim().to_string();
        (!chord.key.is_empty()).then_some(chord)
    }

    /// Text that [`Chord::parse`] parses.
    pub fn to_text(&self) -> String {
        let held = [(self.ctrl, "Ctrl+"), (self.alt, "Alt+"), (self.shift, "Shift+")];
        let held: String = held.into_iter().filter(|(is_held, _)| *is_held).map(|(_, name)| name).collect();
        held + self.key.as_str()
    }

    /// Number of modifiers.
    pub fn modifier_count(&self) -> usize {
        [self.ctrl, self.shift, self.alt].into_iter().filter(|held| *held).count()
    }
}

impl fmt::Display for Chord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (held, name) in [(self.ctrl, "Ctrl"), (self.alt, "Alt"), (self.shift, "Shift")] {
            if held {
                write!(f, "{name} ")?;
            }
        }
        let shown = match self.key.as_str() {
            "PageUp" => "PgUp",
            "PageDown" => "PgDn",
            "Escape" => "Esc",
            "Plus" => "+",
            "Minus" => "−",
            key => key,
        };
        f.write_str(shown)
    }
}

fn parse_chords(text: &str) -> Vec<Chord> {
    text.split(", ").filter_map(Chord::parse).collect()
}

/// Name in the file, title, and keys that replace the default ones.
pub type Preset = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

pub(crate) const PRESETS: [Preset; 3] = [
    ("choreo", "choreo", &[]),
    (
        "blender",
        "Blender",
        &[
            ("scale", "S"),
            ("duplicate", "Shift+D"),
            ("delete", "X, Delete"),
            ("set_keys", "I"),
            ("camera", "0"),
            ("focus", "Period"),
            ("first_frame", "Shift+Left, Home"),
            ("last_frame", "Shift+Right, End"),
            ("next_event", "Up"),
            ("previous_event", "Down"),
            ("range_from", "Ctrl+Home"),
            ("range_to", "Ctrl+End"),
            ("screenshot", "F12"),
            ("palette", "F3, Ctrl+P"),
            ("redo", "Ctrl+Shift+Z"),
        ],
    ),
    (
        "unity",
        "Unity",
        &[
            ("move", "W"),
            ("turn", "E"),
            ("scale", "R"),
            ("split", "S"),
            ("previous_frame", "Comma, Left"),
            ("next_frame", "Period, Right"),
            ("first_frame", "Shift+Comma, Home"),
            ("last_frame", "Shift+Period, End"),
            ("previous_event", "Alt+Comma, Up"),
            ("next_event", "Alt+Period, Down"),
            ("palette", "Ctrl+K, Ctrl+P"),
            ("redo", "Ctrl+Y, Ctrl+Shift+Z"),
        ],
    ),
];

/// The user's keyboard shortcuts.
#[derive(Clone, Debug, PartialEq)]
pub struct Shortcuts {
    /// Name of the preset.
    pub preset: String,
    /// The user's own keys by action, as written in the file.
    pub user_keys: BTreeMap<String, String>,
    /// Actions whose keys were changed in this window and are not saved yet.
    pub changed: BTreeSet<String>,
}

impl Default for Shortcuts {
    fn default() -> Shortcuts {
        let (own, changed) = Default::default();
        Shortcuts { preset: PRESETS[0].0.to_string(), user_keys: own, changed }
    }
}

impl Shortcuts {
    /// Name of the file next to the settings.
    pub const FILE: &'static str = "shortcuts.json";

    /// Keys of an action. `default_keys`: its default keys.
    pub fn chords_of(&self, action: &str, default_keys: &str) -> Vec<Chord> {
        let preset = PRESETS.iter().find(|(name, ..)| *name == self.preset);
        let preset = preset.and_then(|(.., keys)| keys.iter().find(|(name, _)| *name == action));
        let preset = preset.map_or(default_keys, |(_, keys)| keys);
        parse_chords(self.user_keys.get(action).map_or(preset, String::as_str))
    }

    /// Sets the user's own keys of an action. `None`: those of the preset.
    pub fn set(&mut self, action: &str, keys: Option<String>) {
        match keys {
            Some(keys) => drop(self.user_keys.insert(action.to_string(), keys)),
            None => drop(self.user_keys.remove(action)),
        }
        self.changed.insert(action.to_string());
    }

    /// Keys of an action for display. `default_keys`: its default keys.
    pub fn display_text(&self, action: &str, default_keys: &str) -> String {
        self.chords_of(action, default_keys).iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
    }

    /// Reads a file, and returns a message if it has an error. A missing file gives the default shortcuts.
    pub fn read(file: &Path) -> (Shortcuts, Option<String>) {
        let bytes = match choreo_files::read(file, 1 << 20) {
            Ok(bytes) => bytes,
            Err(_) if !file.exists() => return Default::default(),
            Err(error) => return (Shortcuts::default(), Some(format!("{}: {error}", file.display()))),
        };
        match serde_json::from_slice::<Value>(&bytes) {
            Ok(value) => {
                let (shortcuts, problem) = Shortcuts::from_json(&value);
                (shortcuts, problem.map(|problem| format!("{}: {problem}", file.display())))
            }
            Err(error) => (Shortcuts::default(), Some(format!("{}: {error}", file.display()))),
        }
    }

    fn from_json(value: &Value) -> (Shortcuts, Option<String>) {
        let mut shortcuts = Shortcuts::default();
        let mut problem = None;
        if let Some(preset) = value["preset"].as_str() {
            match PRESETS.iter().any(|(name, ..)| *name == preset) {
                true => shortcuts.preset = preset.to_string(),
                false => {
                    let known = PRESETS.map(|(name, ..)| name).join(", ");
                    problem = Some(format!("unknown preset \"{preset}\"; presets: {known}"));
                }
            }
        }
        for (action, keys) in value["keys"].as_object().into_iter().flatten() {
            match keys.as_str() {
                Some(keys) => drop(shortcuts.user_keys.insert(action.clone(), keys.to_string())),
                None => problem = Some(format!("{action}: keys must be a string, such as \"Ctrl+D\"")),
            }
        }
        (shortcuts, problem)
    }

    /// Writes the preset and the keys that were changed in this window. Other keys in the file may have been edited since it was read and are kept.
    /// Returns the error of a file that cannot be parsed, which is not overwritten. Failure to write is ignored: the next window then has the
    /// former keys.
    pub fn write(&mut self, file: &Path) -> Option<String> {
        let changed = std::mem::take(&mut self.changed);
        let (in_file, problem) = Shortcuts::read(file);
        if problem.is_some() {
            return problem;
        }
        let mut own = in_file.user_keys;
        for action in changed {
            match self.user_keys.get(&action) {
                Some(keys) => drop(own.insert(action, keys.clone())),
                None => drop(own.remove(&action)),
            }
        }
        self.user_keys = own;
        let value = json!({ "preset": self.preset, "keys": self.user_keys });
        if let (Some(folder), Some(name)) = (file.parent(), file.file_name()) {
            let _ = write_whole_beneath(folder, name.as_ref(), format!("{value:#}\n").as_bytes());
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The user edits the file while a window is open: the window only changes its preset and the keys that were chosen in it.
    #[test]
    fn user_shortcuts_in_the_file_are_kept_when_others_change() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(Shortcuts::FILE);
        std::fs::write(&file, r#"{ "preset": "choreo", "keys": { "split": "Shift+Y" } }"#).unwrap();
        let (mut shortcuts, problem) = Shortcuts::read(&file);
        assert_eq!(problem, None);
        std::fs::write(&file, r#"{ "preset": "choreo", "keys": { "split": "Shift+U" } }"#).unwrap();
        shortcuts.preset = "blender".to_string();
        assert_eq!(shortcuts.write(&file), None);
        let (kept, problem) = Shortcuts::read(&file);
        assert_eq!(
            (kept.preset.as_str(), kept.user_keys["split"].as_str(), problem),
            ("blender", "Shift+U", None)
        );
        assert_eq!(shortcuts, kept);
        // The user sets one key in the window, resets another to the preset, and edits a third in the file.
        std::fs::write(&file, r#"{ "keys": { "split": "Shift+U", "hide": "F7", "turn": "F8" } }"#).unwrap();
        let (mut shortcuts, _) = Shortcuts::read(&file);
        let chord = Chord::parse("shift+alt+ctrl+Z").unwrap();
        assert_eq!(Chord::parse(&chord.to_text()), Some(chord.clone()));
        shortcuts.set("hide", Some(chord.to_text()));
        shortcuts.set("turn", None);
        std::fs::write(&file, r#"{ "keys": { "split": "Y", "hide": "F7", "turn": "F8" } }"#).unwrap();
        assert_eq!(shortcuts.write(&file), None);
        let own =
            [("hide", "Ctrl+Alt+Shift+Z"), ("split", "Y")].map(|(a, keys)| (a.to_string(), keys.to_string()));
        assert_eq!(Shortcuts::read(&file).0.user_keys, BTreeMap::from(own));
        assert_eq!(shortcuts, Shortcuts::read(&file).0);
        // A file that cannot be parsed is not overwritten.
        std::fs::write(&file, "{ half").unwrap();
        shortcuts.set("hide", None);
        assert!(shortcuts.write(&file).is_some());
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "{ half");
    }
}
