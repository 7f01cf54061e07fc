//! Dragging writes the script: the file stays the only document. One change is one undoable edit; what is computed, what stands
//! in a module, and what has changed on disk meanwhile is not touched, and said.

use crate::app::Viewer;
use crate::selection::Selected;
use choreo_live::edit::{Edit, Part, set_time};
use std::path::{Path, PathBuf};

/// Changes that can be taken back, the newest last.
#[derive(Default)]
pub struct History {
    done: Vec<Done>,
}

struct Done {
    /// What takes it back.
    back: Edit,
    /// The text that it takes back from.
    text: String,
}

impl Viewer {
    /// Sets a time of a cue in the script's file, in seconds.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn set_cue(&mut self, what: &Selected, part: Part, secs: f64) -> Result<(), String> {
        let scene = self.scene.as_ref().ok_or("there is nothing to change yet")?;
        let places = &scene.places;
        let bar = self.timeline.rows.iter().flat_map(|row| &row.bars).find(|bar| bar.what == *what);
        let place = &bar.ok_or("it is no longer there")?.place;
        if place.line == 0 {
            return Err("it does not come from a script".into());
        }
        if place.file != places.main {
            return Err(format!("{}:{}: it stands in a module; change it there", place.file, place.line));
        }
        let bars = self.timeline.rows.iter().flat_map(|row| &row.bars);
        let twins = bars.filter(|b| b.place == *place).count();
        if twins > 1 {
            return Err(format!(
                "{}:{}: this line makes {twins} bars; change it there",
                place.file, place.line
            ));
        }
        let path = self.path.clone().ok_or("there is no script")?;
        let text = read(&path)?;
        if places.sources.get(&places.main).is_none_or(|known| **known != *text) || self.faulty {
            return Err("the file has changed on disk; wait until it is shown, and try again".into());
        }
        let edit = set_time(&text, place.line, place.column, part, secs)
            .map_err(|why| format!("{}: {why}", places.main))?;
        let after = edit.apply(&text);
        if after == text {
            return Ok(());
        }
        write(&path, &after)?;
        self.history.done.push(Done { back: edit.inverse(&text), text: after });
        Ok(())
    }

    /// Takes the newest change back, also where the file has since been changed elsewhere.
    ///
    /// # Errors
    /// As for [`Viewer::set_cue`]; that there is none.
    pub fn undo(&mut self) -> Result<(), String> {
        let path = self.path.clone().ok_or("there is no script")?;
        let last = self.history.done.last().ok_or("there is nothing to take back")?;
        let now = read(&path)?;
        let back = match now == last.text {
            true => Some(last.back.clone()),
            false => last.back.carried_over(&last.text, &now),
        };
        let back = back.ok_or("the line has been changed since; take it back in the editor")?;
        write(&path, &back.apply(&now))?;
        self.history.done.pop();
        Ok(())
    }
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: cannot read: {e}", path.display()))
}

/// Beside it and renamed: whole or not at all. A link stays one.
fn write(path: &Path, text: &str) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: cannot write: {e}", path.display());
    let place = path.canonicalize().map_err(failed)?;
    let name = place.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let part: PathBuf = place.with_file_name(format!(".{name}.{}.part", std::process::id()));
    let written = std::fs::write(&part, text)
        .and_then(|()| std::fs::set_permissions(&part, std::fs::metadata(&place)?.permissions()))
        .and_then(|()| std::fs::rename(&part, &place));
    written.map_err(|e| {
        let _ = std::fs::remove_file(&part);
        failed(e)
    })
}
