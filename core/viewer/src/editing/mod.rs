//! Dragging writes the script: the file stays the only document. One change is one undoable edit. What is computed, what stands
//! in a module or makes several things is not touched, and said, with a line that would do it where there is one. A file that has
//! changed on disk meanwhile is asked about, with the difference.

pub(crate) mod difference;
pub(crate) mod external_editor;
pub mod placing;

use crate::app::Viewer;
use crate::state::history::{Done, Offer};
use crate::state::selection::{Selected, actor};
use choreo_files::{WriteError, write_whole};
use choreo_script::Place;
use choreo_session::edit::{
    CueTime, Edit, EditRefused, ScriptObject, follows, format_number, set_marker, set_time,
};
use choreo_stage::Actor;
use std::path::Path;
use std::sync::Arc;

impl Viewer {
    /// Sets a time of a cue or an effect in the script's file, in seconds.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn set_cue(&mut self, what: &Selected, part: CueTime, secs: f64) -> Result<(), String> {
        let bars = || self.timeline.rows.iter().flat_map(|row| &row.bars);
        let place = bars().find(|bar| bar.what == *what).ok_or("it is no longer there")?.place.clone();
        if let (Selected::Cue { actor, layer, cue: 1.. }, CueTime::Start) = (what, part)
            && self.known().is_some_and(|text| follows(&text, place.line, place.column))
            && let Selected::Cue { cue, .. } = what
        {
            // Where two clips meet is written as the end of the first.
            let before = Selected::Cue { actor: actor.clone(), layer: *layer, cue: cue - 1 };
            return self.set_cue(&before, CueTime::End, secs);
        }
        let twins = bars().filter(|b| b.place == place).count();
        self.change(&place, twins, |text| match (what, part) {
            (Selected::Effect(_), CueTime::Start) => {
                ScriptObject::at(text, place.line, place.column)?.time("from", secs)
            }
            (Selected::Effect(_), _) => ScriptObject::at(text, place.line, place.column)?.time("until", secs),
            _ => set_time(text, place.line, place.column, part, secs),
        })
    }

    /// The script's text as it was when what is shown was made.
    fn known(&self) -> Option<Arc<str>> {
        let places = &self.scene.as_ref()?.places;
        places.sources.get(&places.main).cloned()
    }

    /// Moves a cut; `index` of the stage's cuts.
    pub fn set_cut(&mut self, index: usize, secs: f64) -> Result<(), String> {
        let scene = self.scene.as_ref().ok_or("there is nothing to change yet")?;
        let place = scene.places.cuts.get(index).ok_or("it is no longer there")?.clone();
        let twins = scene.places.cuts.iter().filter(|p| **p == place).count();
        self.change(&place, twins, |text| {
            choreo_session::edit::set_call(text, place.line, place.column, secs)
        })
    }

    /// Moves a named time of the stage.
    pub fn set_marker(&mut self, name: &str, secs: f64) -> Result<(), String> {
        let scene = self.scene.as_ref().ok_or("there is nothing to change yet")?;
        let place = Place { file: scene.places.main.clone(), line: 1, ..Place::default() };
        self.change(&place, 1, |text| set_marker(text, name, secs))
    }

    /// Lets an actor play a clip of its file from a time on.
    pub(crate) fn add_clip(&mut self, name: &str, clip: &str, secs: f64) -> Result<(), String> {
        let scene = self.scene.clone().ok_or("there is nothing to change yet")?;
        let index = actor(&scene.stage, name).ok_or("it is no longer there")?;
        let place = scene.places.actors.get(index).cloned().unwrap_or_default();
        let twins = scene.places.actors.iter().filter(|p| **p == place).count();
        let plays = scene.stage.actors[index].layers.first().is_some_and(|l| !l.cues.is_empty());
        let options = if plays { ", #{ fade: 0.3 }" } else { "" };
        self.change(&place, twins, |text| {
            ScriptObject::at(text, place.line, place.column)?.play(clip, secs, options)
        })
    }

    /// Puts files that were dropped on stage: a line each at the end of the script, as one change; several where they are shown.
    ///
    /// # Errors
    /// What is not added, and why: files that cannot be read, or lie outside the script's folder; the others are.
    pub fn add_guests(&mut self) -> Result<(), String> {
        let path = self.path.clone().ok_or("there is no script that it could be added to")?;
        let folder =
            path.canonicalize().ok().and_then(|p| Some(p.parent()?.to_path_buf())).unwrap_or_default();
        let mut text = read(&path)?;
        let (before, begins) = (text.clone(), text.len());
        if !text.is_empty() && !text.ends_with('\n') {
            text.push('\n');
        }
        let scene = self.scene.clone().filter(|_| !self.faulty).ok_or("what was dropped cannot be read")?;
        let (mut shown, mut refused) = (scene.stage.actors.iter().peekable(), Vec::new());
        for guest in &self.guests {
            // In the order in which they were dropped, without those that cannot be read.
            let is_it = |actor: &&Actor| guest.file_name().is_some_and(|name| *name == *actor.asset.name);
            let Some(actor) = shown.next_if(is_it) else {
                refused.push(format!("{}: it cannot be read", guest.display()));
                continue;
            };
            let file = guest.canonicalize().unwrap_or_else(|_| guest.clone());
            match file.strip_prefix(&folder) {
                Ok(inside) => text.push_str(&guest_line(inside, actor.transform.translation.x, &text)),
                Err(_) => refused.push(format!(
                    "{}: it lies outside the script's folder, where load(…) may not read; put it there first",
                    file.display()
                )),
            }
        }
        if refused.len() < self.guests.len() {
            let edit = Edit { range: begins..begins, text: text.split_off(begins) };
            self.write_edit(&path, &before, edit)?;
            self.guests_leave = true;
        }
        if refused.is_empty() { Ok(()) } else { Err(refused.join("; ")) }
    }

    /// Adds a line at the end of the script.
    pub(crate) fn add_line(&mut self, line: &str) -> Result<(), String> {
        let path = self.path.clone().ok_or("there is no script")?;
        let text = read(&path)?;
        let blank = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
        self.write_edit(&path, &text, Edit { range: text.len()..text.len(), text: format!("{blank}{line}") })
    }

    /// `twins`: how many things come from this place.
    pub(crate) fn change(
        &mut self,
        place: &Place,
        twins: usize,
        mut make: impl FnMut(&str) -> Result<Edit, EditRefused>,
    ) -> Result<(), String> {
        let scene = self.scene.clone().ok_or("there is nothing to change yet")?;
        let places = &scene.places;
        if place.line == 0 {
            return Err("it does not come from a script".into());
        }
        if place.file != places.main {
            return Err(format!("{}:{}: it stands in a module; change it there", place.file, place.line));
        }
        if twins > 1 {
            return Err(format!(
                "{}:{}: this line makes {twins} of them; change it there",
                place.file, place.line
            ));
        }
        let path = self.path.clone().ok_or("there is no script")?;
        let text = read(&path)?;
        let known = places.sources.get(&places.main).cloned().unwrap_or_default();
        let made = make(&known);
        if *known != *text || self.faulty {
            // For what is shown; the file has something else by now.
            let carried = made.ok().and_then(|edit| edit.carried_over(&known, &text));
            if let Some(edit) = carried {
                let difference = difference::lines(&known, &edit.apply(&text));
                let why = "the file has changed on disk since it was shown; with both changes it would be:"
                    .to_string();
                self.offer = Some(Offer { why, agree: "Write both".into(), difference, edit, text });
            }
            return Err("the file has changed on disk; wait until it is shown, and try again".into());
        }
        match made {
            Ok(edit) => self.write_edit(&path, &text, edit),
            Err(EditRefused { why, over, agree }) => {
                let why = format!("{}: {why}", places.main);
                if let Some(edit) = over {
                    let difference = difference::lines(&text, &edit.apply(&text));
                    self.offer =
                        Some(Offer { why: why.clone(), agree: agree.into(), difference, edit, text });
                }
                Err(why)
            }
        }
    }

    fn write_edit(&mut self, path: &Path, text: &str, edit: Edit) -> Result<(), String> {
        let after = edit.apply(text);
        if after == text {
            self.dragging = None;
            return Ok(());
        }
        write(path, &after)?;
        self.history.done.push(Done { back: edit.inverse(text), text: after });
        self.history.undone.clear();
        Ok(())
    }

    /// Makes the change that was offered.
    pub(crate) fn accept_offer(&mut self) -> Result<(), String> {
        let offer = self.offer.take().ok_or("nothing was offered")?;
        let path = self.path.clone().ok_or("there is no script")?;
        let now = read(&path)?;
        let edit =
            if now == offer.text { Some(offer.edit) } else { offer.edit.carried_over(&offer.text, &now) };
        let edit = edit.ok_or("the file has changed once more; try again when it is shown")?;
        self.write_edit(&path, &now, edit)
    }

    /// Takes the newest change back, also where the file has since been changed elsewhere.
    ///
    /// # Errors
    /// As for [`Viewer::set_cue`]; that there is none.
    pub fn undo(&mut self) -> Result<(), String> {
        let last = self.history.done.last().ok_or("there is nothing to take back")?;
        let again = self.take_back(&last.back, &last.text)?;
        self.history.done.pop();
        self.history.undone.push(again);
        Ok(())
    }

    /// Makes the change again that was taken back last.
    ///
    /// # Errors
    /// As for [`Viewer::undo`].
    pub fn redo(&mut self) -> Result<(), String> {
        let last = self.history.undone.last().ok_or("there is nothing to do again")?;
        let again = self.take_back(&last.back, &last.text)?;
        self.history.undone.pop();
        self.history.done.push(again);
        Ok(())
    }

    fn take_back(&self, back: &Edit, from: &str) -> Result<Done, String> {
        let path = self.path.clone().ok_or("there is no script")?;
        let now = read(&path)?;
        let back = if now == from { Some(back.clone()) } else { back.carried_over(from, &now) };
        let back = back.ok_or("the line has been changed since; take it back in the editor")?;
        let after = back.apply(&now);
        write(&path, &after)?;
        Ok(Done { back: back.inverse(&now), text: after })
    }
}

/// The line that casts a file of the script's folder at `x`, under a name that `text` has not yet.
fn guest_line(file: &Path, x: f64, text: &str) -> String {
    let stem = choreo_session::model::name(file);
    let name = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' });
    let mut name: String = name.collect();
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) {
        name = format!("a_{name}");
    }
    let taken = |name: &str| text.contains(&format!("\"{name}\"")) || text.contains(&format!("let {name} "));
    let free = (1..).map(|n| if n == 1 { name.clone() } else { format!("{name}_{n}") }).find(|n| !taken(n));
    let name = free.unwrap_or(name);
    let shown = file.to_string_lossy().replace('\\', "/").replace('"', "\\\"");
    let at = if x == 0.0 { String::new() } else { format!(".at({}, 0.0, 0.0)", format_number(x)) };
    format!("let {name} = cast(\"{name}\", load(\"{shown}\")){at};\n")
}

/// Some editors write it before a text; places in scripts do not count it, so that edits must not either.
const MARK: &str = "\u{feff}";

/// A script's text without a byte order mark.
pub(crate) fn read(path: &Path) -> Result<String, String> {
    let text = read_all(path)?;
    Ok(text.strip_prefix(MARK).map(str::to_string).unwrap_or(text))
}

fn read_all(path: &Path) -> Result<String, String> {
    /// More than a script may have.
    const MOST_BYTES: u64 = 64 << 20;
    let shown = path.display();
    let bytes = choreo_files::read(path, MOST_BYTES).map_err(|e| format!("{shown}: cannot read: {e}"))?;
    String::from_utf8(bytes).map_err(|_| format!("{shown}: cannot read: it is no UTF-8 text"))
}

/// Whole or not at all. A link to another file of the script's folder stays a link, and a byte order mark stays before the text.
pub(crate) fn write(path: &Path, text: &str) -> Result<(), String> {
    let failed = |e: WriteError| format!("{}: cannot write: {e}", path.display());
    let place = path.canonicalize().map_err(|e| failed(e.into()))?;
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if path.is_symlink() && folder.canonicalize().is_ok_and(|folder| !place.starts_with(folder)) {
        return Err(format!(
            "{}: cannot write: it is a symbolic link to {}, outside its folder; open that file itself",
            path.display(),
            place.display()
        ));
    }
    let mark = if read_all(&place).is_ok_and(|old| old.starts_with(MARK)) { MARK } else { "" };
    write_whole(&place, format!("{mark}{text}").as_bytes()).map_err(failed)
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::write;
    use std::fs::{self, hard_link};
    use std::os::unix::fs::{PermissionsExt, symlink};

    /// A link that the user made within the folder stays one; one that leads out of it is not followed.
    #[test]
    fn a_script_that_is_a_link_is_followed_within_its_folder_only() {
        let dir = tempfile::tempdir().unwrap();
        let (inside, outside) = (dir.path().join("scene"), dir.path().join("bashrc"));
        fs::create_dir_all(inside.join("versions")).unwrap();
        fs::write(inside.join("versions/2.rhai"), "old").unwrap();
        fs::write(&outside, "mine").unwrap();
        let script = inside.join("s.rhai");
        symlink("versions/2.rhai", &script).unwrap();
        write(&script, "new").unwrap();
        assert_eq!(fs::read_to_string(inside.join("versions/2.rhai")).unwrap(), "new");
        assert!(script.is_symlink());
        fs::remove_file(&script).unwrap();
        symlink(&outside, &script).unwrap();
        let expected = format!(
            "{}: cannot write: it is a symbolic link to {}, outside its folder; open that file itself",
            script.display(),
            outside.canonicalize().unwrap().display()
        );
        assert_eq!(write(&script, "new"), Err(expected));
        fs::remove_file(&script).unwrap();
        // A second name keeps the old text, and the file its permissions.
        hard_link(&outside, &script).unwrap();
        fs::set_permissions(&outside, PermissionsExt::from_mode(0o640)).unwrap();
        write(&script, "new").unwrap();
        assert_eq!(fs::read_to_string(&outside).unwrap(), "mine");
        assert_eq!(fs::metadata(&script).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(fs::read_dir(&inside).unwrap().count(), 2);
    }
}
