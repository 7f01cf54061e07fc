//! Settings kept between runs: layout, theme, scale, recent files, overlays. They are a small JSON file in the user's state folder; an unreadable
//! file is ignored.

use crate::state::tempo::Tempo;
use crate::state::view::Overlays;
use choreo_files::write_whole_beneath;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) const SCALE_RANGE: (f32, f32) = (1.0, 2.0);

#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub uses_light_theme: bool,
    /// Scale of the user interface, 1 to 2, on top of the system's scale.
    pub scale: f32,
    /// Layout as written by [`crate::panels::Panels`].
    pub layout: Option<Value>,
    /// Recent files, the newest first.
    pub recent: Vec<PathBuf>,
    /// Overlays of new viewports.
    pub overlays: Overlays,
    /// Tempos of recent scripts, by canonical path.
    pub tempos: BTreeMap<PathBuf, Tempo>,
}

impl Default for Settings {
    fn default() -> Settings {
        let (recent, overlays, tempos) = Default::default();
        Settings { uses_light_theme: false, scale: 1.0, layout: None, recent, overlays, tempos }
    }
}

impl Settings {
    /// `$XDG_STATE_HOME/choreo/view.json` (XDG base directory specification), else a file below the user's home folder.
    pub fn file() -> Option<PathBuf> {
        Some(choreo_files::user_folder("XDG_STATE_HOME", ".local/state")?.join("choreo").join("view.json"))
    }

    pub fn read(file: &Path) -> Settings {
        let text = std::fs::metadata(file)
            .ok()
            .filter(|m| m.len() < 1 << 20)
            .and_then(|_| std::fs::read_to_string(file).ok());
        text.and_then(|t| serde_json::from_str(&t).ok())
            .map_or_else(Settings::default, |value| Settings::from_json(&value))
    }

    fn from_json(value: &Value) -> Settings {
        let recent = value["recent"].as_array().into_iter().flatten();
        let scale = value["scale"].as_f64().unwrap_or(1.0) as f32;
        let mut overlays = Overlays::default();
        for (name, _, shown) in overlays.all() {
            *shown = value["overlays"][name].as_bool().unwrap_or(*shown);
        }
        let tempos = value["tempos"].as_object().into_iter().flatten();
        Settings {
            uses_light_theme: value["light"].as_bool().unwrap_or(false),
            scale: if scale.is_finite() { scale.clamp(SCALE_RANGE.0, SCALE_RANGE.1) } else { 1.0 },
            layout: value.get("layout").filter(|l| l.is_object()).cloned(),
            recent: recent.filter_map(|file| Some(PathBuf::from(file.as_str()?))).collect(),
            overlays,
            tempos: tempos
                .filter_map(|(script, tempo)| Some((PathBuf::from(script), Tempo::from_json(tempo)?)))
                .collect(),
        }
    }

    /// Writes the settings. Failure is ignored: the next window then has the former settings.
    pub fn write(&self, file: &Path) {
        let recent: Vec<&str> = self.recent.iter().filter_map(|file| file.to_str()).collect();
        let mut overlays = self.overlays;
        let overlays: serde_json::Map<String, Value> =
            overlays.all().into_iter().map(|(name, _, shown)| (name.to_string(), json!(*shown))).collect();
        let tempos = self.tempos.iter();
        let tempos: serde_json::Map<String, Value> = tempos
            .filter_map(|(script, tempo)| Some((script.to_str()?.to_string(), tempo.to_json())))
            .collect();
        let value = json!({
            "light": self.uses_light_theme, "scale": self.scale, "layout": self.layout, "recent": recent, "overlays": overlays,
            "tempos": tempos,
        });
        if let (Some(folder), Some(name)) = (file.parent(), file.file_name()) {
            let _ = write_whole_beneath(folder, name.as_ref(), format!("{value:#}\n").as_bytes());
        }
    }
}

/// Seconds without a change after which settings are written, so that dragging a panel does not write continuously.
const QUIET_SECS: f64 = 3.0;

/// Settings in the file, and pending changes of the window's settings.
#[derive(Default)]
pub struct SettingsWriter {
    written: Settings,
    /// The changed settings, and the time since when they have not changed again, seconds.
    changed: Option<(Settings, f64)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SaveTime {
    Now,
    /// Remaining time, seconds.
    After(f64),
    Never,
}

impl SettingsWriter {
    pub fn new(written: Settings) -> SettingsWriter {
        SettingsWriter { written, changed: None }
    }

    /// When to write these settings. `now`: seconds.
    pub fn save_time(&mut self, settings: &Settings, now: f64) -> SaveTime {
        if *settings == self.written {
            self.changed = None;
            return SaveTime::Never;
        }
        let since = self.changed.as_ref().filter(|(changed, _)| changed == settings).map(|(_, since)| *since);
        let Some(since) = since else {
            self.changed = Some((settings.clone(), now));
            return SaveTime::After(QUIET_SECS);
        };
        let left = since + QUIET_SECS - now;
        if left <= 0.0 { SaveTime::Now } else { SaveTime::After(left) }
    }

    /// Writes settings if they differ from those in the file.
    pub fn write(&mut self, settings: Settings, file: &Path) {
        if settings != self.written {
            settings.write(file);
            self.written = settings;
        }
        self.changed = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_settings_are_read_again_and_garbage_gives_the_defaults() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/view.json");
        assert_eq!(Settings::read(&file), Settings::default());
        let overlays = Overlays { grid: false, onion_skins: true, ..Overlays::default() };
        let settings = Settings {
            uses_light_theme: true,
            scale: 1.5,
            layout: Some(json!({ "tabs": [1] })),
            recent: vec!["/a/b.rhai".into()],
            overlays,
            tempos: BTreeMap::from([(
                "/a/b.rhai".into(),
                Tempo { beats_per_minute: 97.5, first_beat_secs: 0.25 },
            )]),
        };
        settings.write(&file);
        assert_eq!(Settings::read(&file), settings);
        for garbage in [
            "",
            "[]",
            "{\"scale\": 1e99, \"light\": 3, \"layout\": 5}",
            "\u{0}",
            "{\"scale\": -1}",
            "{\"tempos\": { \"a\": 3, \"b\": { \"bpm\": -1, \"first\": 0 } } }",
        ] {
            std::fs::write(&file, garbage).unwrap();
            assert_eq!(Settings::read(&file), Settings::default(), "{garbage}");
        }
    }

    #[test]
    fn settings_are_saved_after_they_stop_changing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("view.json");
        let mut writing = SettingsWriter::new(Settings::default());
        assert_eq!(writing.save_time(&Settings::default(), 0.0), SaveTime::Never);
        let wide = |scale: f32| Settings { scale, ..Settings::default() };
        assert_eq!(writing.save_time(&wide(1.2), 10.0), SaveTime::After(QUIET_SECS));
        assert_eq!(writing.save_time(&wide(1.2), 11.0), SaveTime::After(QUIET_SECS - 1.0));
        assert_eq!(
            writing.save_time(&wide(1.3), 12.0),
            SaveTime::After(QUIET_SECS),
            "the settings changed again"
        );
        assert_eq!(writing.save_time(&wide(1.3), 12.0 + QUIET_SECS), SaveTime::Now);
        writing.write(wide(1.3), &file);
        assert_eq!(Settings::read(&file), wide(1.3));
        assert_eq!(writing.save_time(&wide(1.3), 30.0), SaveTime::Never);
        // A change that was reverted is not written.
        assert_eq!(writing.save_time(&wide(1.4), 31.0), SaveTime::After(QUIET_SECS));
        assert_eq!(writing.save_time(&wide(1.3), 32.0), SaveTime::Never);
        assert_eq!(writing.save_time(&wide(1.4), 40.0), SaveTime::After(QUIET_SECS));
    }

    #[test]
    #[cfg(unix)]
    fn settings_are_not_written_through_a_symlink() {
        let folder = tempfile::tempdir().unwrap();
        let (file, other) = (folder.path().join("view.json"), folder.path().join("other"));
        std::fs::write(&other, "mine").unwrap();
        std::os::unix::fs::symlink(&other, &file).unwrap();
        Settings::default().write(&file);
        assert_eq!(std::fs::read_to_string(&other).unwrap(), "mine");
        assert!(file.is_symlink(), "the link is the user's");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
