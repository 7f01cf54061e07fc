//! Edits of the script by dragging. The file stays the only document, and each change is one edit that can be undone. A value is not changed if it
//! is computed, stands in a module or belongs to several objects; a message gives the reason and, if possible, offers a line with the same effect.
//! If the file has changed on disk meanwhile, the user decides, with the difference shown.

mod adding;
mod ambient;
pub mod constraining;
mod cues;
mod cuts;
pub(crate) mod difference;
mod documents;
mod error;
mod fields;
mod idle_clip;
mod keys;
mod layers;
mod next_clip;
mod objects;
pub mod placing;
mod renaming;
mod room;
mod rows;
mod scene_icons;
mod shared;
mod strips;
mod trimming;

pub use adding::ClipSource;
pub use ambient::Ambient;
pub use choreo_session::edit::expression;
pub use error::EditError;
pub(crate) use error::file_name;
pub use fields::{FieldChange, StatedCall};
pub use keys::ValueDrag;

use crate::app::Viewer;
use crate::state::history::{AppliedEdit, Offer};
use crate::state::keyed::KeyRef;
use crate::state::selection::Selected;
use choreo_files::{WriteError, containing_folder, write_whole};
use choreo_script::{Place, Severity};
use choreo_session::Problem;
use choreo_session::edit::{
    CueTime, Edit, EditRefused, EditTime, ScriptObject, ScriptText, TypedNumber, set_marker, set_time,
};
use std::path::Path;
use std::sync::Arc;

/// An edit of the call at a line and column.
type MakeEdit<'m> = Box<dyn Fn(&str, usize, usize) -> Result<Edit, EditRefused> + 'm>;

/// One part of an edit: a change of the call at one position.
pub(crate) struct Step<'m> {
    pub place: Place,
    pub siblings: usize,
    pub make: MakeEdit<'m>,
    /// Position of keys in a script function, which all siblings share, if it differs from `place`.
    pub shared_keys_place: Option<Place>,
    /// A line that makes the change for this object alone.
    pub separate_line: Option<Edit>,
}

impl<'m> Step<'m> {
    pub(crate) fn new(
        place: Place,
        siblings: usize,
        make: impl Fn(&str, usize, usize) -> Result<Edit, EditRefused> + 'm,
    ) -> Step<'m> {
        Step { place, siblings, make: Box::new(make), shared_keys_place: None, separate_line: None }
    }

    /// The same step that keeps a number as it was typed.
    pub(crate) fn keeping_number(self, typed: &TypedNumber) -> Step<'m> {
        let (make, typed) = (self.make, typed.clone());
        let make = move |text: &str, line, column| typed.keep(text, make(text, line, column));
        Step { make: Box::new(make), ..self }
    }

    /// The same step that keeps a time as it was typed. `fps`: frame rate of the stage.
    pub(crate) fn keeping_time(self, typed: &TypedNumber, fps: f64) -> Step<'m> {
        let (make, typed) = (self.make, typed.clone());
        let make = move |text: &str, line, column| typed.keep_time(text, make(text, line, column), fps);
        Step { make: Box::new(make), ..self }
    }

    fn shared_place(&self) -> &Place {
        self.shared_keys_place.as_ref().unwrap_or(&self.place)
    }
}

impl Viewer {
    /// Sets a time of a cue, an effect or a title, seconds.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn set_cue_time(&mut self, what: &Selected, part: CueTime, secs: f64) -> Result<(), EditError> {
        self.set_typed_cue_time(what, part, &secs.into())
    }

    /// Like [`Viewer::set_cue_time`], for a typed time.
    pub(crate) fn set_typed_cue_time(
        &mut self,
        what: &Selected,
        part: CueTime,
        typed: &TypedNumber,
    ) -> Result<(), EditError> {
        let (bar, secs) = (self.find_bar(what)?, typed.value);
        let place = bar.place.clone();
        if part == CueTime::Start {
            self.check_start(&place, &bar.label, secs)?;
            if let Some(before) = self.followed_bar(what) {
                // The boundary of two clips is written as the end of the first one.
                self.check_boundary(Some(&before), &bar, secs)?;
                let note = self.moved_end_note(what, &[], secs - bar.start.as_secs());
                self.set_typed_cue_time(&before.what, CueTime::End, typed)?;
                self.note = note;
                return Ok(());
            }
        }
        let siblings = self.bars().filter(|other| other.place == place).count();
        match part {
            CueTime::Start => self.check_boundary(None, &bar, secs)?,
            CueTime::End if secs <= bar.start.as_secs() => {
                let start = bar.start.as_secs();
                let why = format!("{} would end at {secs:.3} s, but it begins at {start:.3} s", bar.label);
                return Err(EditError::refused_at(&place, &why));
            }
            _ => {}
        }
        let time = self.edit_time(secs);
        self.edit_call(&place, siblings, |text| {
            let made = match (what, part) {
                (Selected::Effect(_) | Selected::Title(_), part) => {
                    let object = ScriptObject::at(text, place.line, place.column)?;
                    match part {
                        CueTime::Start => object.set_time("from", time),
                        CueTime::End => object.set_time("until", time),
                        CueTime::FadeIn | CueTime::FadeOut => object.set("fade", &[secs]),
                    }
                }
                _ => set_time(text, place.line, place.column, part, time),
            };
            typed.keep_time(text, made, time.fps)
        })
    }

    /// A time for edits: seconds, with the frame rate of the stage.
    pub(crate) fn edit_time(&self, secs: f64) -> EditTime {
        EditTime { secs, fps: self.playhead.fps().as_fps() }
    }

    /// Text of the displayed version of the script, split into tokens.
    fn script_text(&self) -> Option<&ScriptText> {
        self.scene.as_ref()?.script_text()
    }

    /// Text of the displayed version of the script.
    fn displayed_text(&self) -> Option<Arc<str>> {
        let places = &self.scene.as_ref()?.places;
        places.sources.get(&places.main).cloned()
    }

    /// Moves a marker to a time in seconds.
    pub fn set_marker(&mut self, name: &str, secs: f64) -> Result<(), EditError> {
        let scene = self.scene.as_ref().ok_or(EditError::NothingShown)?;
        let place = Place { file: scene.places.main.clone(), line: 1, ..Place::default() };
        let time = self.edit_time(secs);
        self.edit_call(&place, 1, |text| set_marker(text, name, time))
    }

    /// Adds a line at the end of the script.
    pub(crate) fn add_line(&mut self, line: &str) -> Result<(), EditError> {
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let text = read_script(&path)?;
        let blank = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
        self.write_edit(&path, &text, Edit { range: text.len()..text.len(), text: format!("{blank}{line}") })
    }

    /// Edits the call at a position. `siblings`: number of objects that it creates.
    pub(crate) fn edit_call(
        &mut self,
        place: &Place,
        siblings: usize,
        mut make: impl FnMut(&str) -> Result<Edit, EditRefused>,
    ) -> Result<(), EditError> {
        if let Err(error) = self.check_place(place, siblings) {
            let is_shared = matches!(error, EditError::SharedLine { .. });
            let made = self.displayed_text().filter(|_| is_shared).map(|known| make(&known));
            return Err(self.offer_shared_edit(error, place, made, None));
        }
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let places = &scene.places;
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let text = read_script(&path)?;
        let known = places.sources.get(&places.main).cloned().unwrap_or_default();
        let made = make(&known);
        if *known != *text || self.is_faulty {
            // The edit was made for the displayed text, and the file has changed since.
            let carried = made.ok().and_then(|edit| edit.carried_over(&known, &text));
            if let Some(edit) = carried {
                let difference = difference::diff_lines(&known, &edit.apply(&text));
                let why = "the file has changed on disk since it was shown; with both changes it would be:"
                    .to_string();
                let label = "Write both".into();
                self.offer = Some(Offer { why, label, difference, edit, text, ..Offer::default() });
            }
            return Err(if self.is_faulty { EditError::FaultyScript } else { EditError::ChangedOnDisk });
        }
        match made {
            Ok(edit) => self.write_edit(&path, &text, edit),
            Err(EditRefused { why, line, alternative, alternative_label, .. }) => {
                let why = format!("{}: {why}", file_name(&places.main));
                if let Some(edit) = alternative {
                    let difference = difference::diff_lines(&text, &edit.apply(&text));
                    let (why, label) = (why.clone(), alternative_label.into());
                    self.offer = Some(Offer { why, label, difference, edit, text, ..Offer::default() });
                }
                Err(EditError::Refused { why, line })
            }
        }
    }

    /// Makes several steps as one edit; those at one position in their order.
    pub(crate) fn apply_steps(&mut self, mut steps: Vec<Step>) -> Result<(), EditError> {
        // Edits go from the end of the text to its start, so that none moves a call that is still to be edited.
        steps.sort_by_key(|step| std::cmp::Reverse((step.place.line, step.place.column)));
        let first = steps.first().ok_or(EditError::ObjectGone)?.place.clone();
        let shared = steps.iter().find_map(|step| {
            let place = step.shared_place();
            Some((self.check_place(place, step.siblings).err()?, place.clone()))
        });
        if let Some((error, place)) = shared {
            let is_shared = matches!(error, EditError::SharedLine { .. });
            let made = self.displayed_text().filter(|_| is_shared).map(|known| combine_steps(&steps, &known));
            let alone = if let [step] = &mut steps[..] { step.separate_line.take() } else { None };
            return Err(self.offer_shared_edit(error, &place, made, alone));
        }
        self.edit_call(&first, 1, |text| combine_steps(&steps, text))
    }

    /// Fails if the object created at a position cannot be edited alone.
    pub(crate) fn check_place(&self, place: &Place, siblings: usize) -> Result<(), EditError> {
        let main = &self.scene.as_ref().ok_or(EditError::NothingShown)?.places.main;
        let (file, line) = (file_name(&place.file).to_string(), place.line);
        match place.line {
            0 => Err(EditError::NotFromScript),
            _ if place.file != *main => Err(EditError::CreatedInModule { file, line }),
            _ if siblings > 1 => Err(EditError::SharedLine { file, line, objects: siblings }),
            _ => Ok(()),
        }
    }

    /// Fails if the row of an actor is locked.
    pub(crate) fn check_unlocked(&self, name: &str) -> Result<(), EditError> {
        match self.toggles.locked.contains(name) {
            true => Err(EditError::refused(locked_row_message(name))),
            false => Ok(()),
        }
    }

    /// Makes an edit of the script. A refusal is shown at the pointer.
    pub fn edit(&mut self, change: impl FnOnce(&mut Viewer) -> Result<(), EditError>) {
        self.note = None;
        let done = change(self);
        self.report(done);
    }

    pub(crate) fn report(&mut self, result: Result<(), EditError>) {
        let error = result.err();
        self.refusals += u64::from(error.is_some());
        self.message_line = error.as_ref().and_then(EditError::line);
        self.message = error.map(|error| error.to_string());
    }

    fn write_edit(&mut self, path: &Path, text: &str, edit: Edit) -> Result<(), EditError> {
        let after = edit.apply(text);
        if after == text {
            (self.dragging, self.placement_override) = (None, None);
            return Ok(());
        }
        write_script(path, &after)?;
        let keys = self.selection_and_keys();
        self.history.pending_text = Some(after.clone());
        self.history.done.push(AppliedEdit { inverse: edit.inverse(text), text: after, keys });
        self.history.undone.clear();
        Ok(())
    }

    /// Makes the offered edit.
    pub(crate) fn accept_offer(&mut self) -> Result<(), EditError> {
        let offer =
            self.offer.take().ok_or(EditError::TextChanged("there is no suggested change to accept"))?;
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let now = read_script(&path)?;
        let edit =
            if now == offer.text { Some(offer.edit) } else { offer.edit.carried_over(&offer.text, &now) };
        let edit = edit.ok_or(EditError::TextChanged(
            "the script was edited meanwhile; wait until the viewer has reloaded it, then try again",
        ))?;
        for (from, to) in &offer.copies {
            adding::copy_file(from, to)?;
        }
        self.write_edit(&path, &now, edit)?;
        self.selection = offer.selects.or(self.selection.take());
        let writes_out = offer.label == shared::UNROLL_LABEL;
        self.pending_edit_after_unroll =
            self.pending_edit_after_unroll.take().filter(|_| writes_out).map(|(change, _)| (change, true));
        Ok(())
    }

    /// Undoes the newest edit, even if the file has since changed elsewhere.
    ///
    /// # Errors
    /// Fails as [`Viewer::set_cue_time`] does, or if there is no edit to undo.
    pub fn undo(&mut self) -> Result<(), EditError> {
        let last = self.history.done.last().ok_or(EditError::NothingToUndo)?;
        let opposite_edit = self.apply_inverse(&last.inverse, &last.text)?;
        let undone = self.history.done.pop();
        self.restore_keys(undone, &opposite_edit);
        self.history.undone.push(opposite_edit);
        Ok(())
    }

    /// Redoes the edit that was undone last.
    ///
    /// # Errors
    /// Fails as [`Viewer::undo`] does.
    pub fn redo(&mut self) -> Result<(), EditError> {
        let last = self.history.undone.last().ok_or(EditError::NothingToRedo)?;
        let opposite_edit = self.apply_inverse(&last.inverse, &last.text)?;
        let redone = self.history.undone.pop();
        self.restore_keys(redone, &opposite_edit);
        self.history.done.push(opposite_edit);
        Ok(())
    }

    /// Undoes the newest edit if the script no longer loads because of it, and reports why. Returns whether it did.
    pub(crate) fn undo_faulty_edit(&mut self, problems: &[Problem]) -> bool {
        let is_loaded = self.scene.is_some() && !self.is_faulty;
        let Some(text) = self.history.pending_text.take().filter(|_| is_loaded) else { return false };
        let is_newest = self.history.done.last().is_some_and(|done| done.text == text);
        let is_there =
            self.path.as_ref().and_then(|path| read_script(path).ok()).is_some_and(|now| now == text);
        if !is_newest || !is_there || self.undo().is_err() {
            return false;
        }
        self.history.undone.pop();
        self.pending_edit_after_unroll = None;
        (self.dragging, self.placement_override) = (None, None);
        let error = problems.iter().find(|problem| problem.severity == Severity::Error);
        let (message, line) = error.map_or(("", 0), |error| (error.message.as_str(), error.line));
        let why = format!("undone, because the script would not load: {message}");
        self.report(Err(EditError::Refused { why, line: Some(line).filter(|line| *line > 0) }));
        true
    }

    /// Called when a version is displayed: makes the edit that waited for its loop to be unrolled.
    pub(crate) fn apply_edit_after_unroll(&mut self) {
        let Some(places) = self.scene.as_ref().map(|scene| &scene.places) else { return };
        let shown = places.sources.get(&places.main).map(|text| text.to_string());
        if self.history.pending_text.is_some() && self.history.pending_text != shown {
            return;
        }
        self.history.pending_text = None;
        if let Some((change, _)) = self.pending_edit_after_unroll.take_if(|(_, is_agreed)| *is_agreed) {
            change(self);
        }
    }

    fn apply_inverse(&self, inverse: &Edit, from: &str) -> Result<AppliedEdit, EditError> {
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let now = read_script(&path)?;
        let inverse = if now == from { Some(inverse.clone()) } else { inverse.carried_over(from, &now) };
        let inverse =
            inverse.ok_or(EditError::TextChanged("the line has changed since; undo it in the editor"))?;
        let after = inverse.apply(&now);
        write_script(&path, &after)?;
        Ok(AppliedEdit { inverse: inverse.inverse(&now), text: after, keys: self.selection_and_keys() })
    }

    fn selection_and_keys(&self) -> (Option<Selected>, Vec<KeyRef>) {
        (self.selection.clone(), self.selected_keys().to_vec())
    }

    /// Selects the keys again that were selected before an undone edit, once that text is displayed, unless something else is selected.
    fn restore_keys(&mut self, undone_edit: Option<AppliedEdit>, opposite_edit: &AppliedEdit) {
        let keys = undone_edit.map(|done| done.keys).filter(|(beside, _)| *beside == self.selection);
        self.history.restored = keys.map(|(_, keys)| (opposite_edit.text.clone(), keys));
    }
}

/// Message that the row of an actor is locked.
pub(crate) fn locked_row_message(name: &str) -> String {
    format!("the row of {name} is locked; press the lock beside its name to unlock it")
}

/// Combines several steps into one edit.
fn combine_steps(steps: &[Step], text: &str) -> Result<Edit, EditRefused> {
    let (mut after, mut edits, mut refused) = (text.to_string(), Vec::new(), None);
    for Step { place, make, .. } in steps {
        // A refusal refers to lines of the text that the user sees.
        let made = make(&after, place.line, place.column).map_err(|refused| refused.before(text, &edits));
        let edit = match made {
            Ok(edit) => edit,
            // The remaining steps are applied to the offered edit.
            Err(EditRefused {
                alternative: Some(alternative),
                why,
                line,
                alternative_label,
                is_computed,
            }) => {
                refused.get_or_insert(EditRefused {
                    alternative: None,
                    why,
                    line,
                    alternative_label,
                    is_computed,
                });
                alternative
            }
            Err(refused) => return Err(refused),
        };
        after = edit.apply(&after);
        edits.push(edit);
    }
    let edit = Edit::between(text, &after);
    match refused {
        Some(refused) => Err(EditRefused { alternative: Some(edit), ..refused }),
        None => Ok(edit),
    }
}

/// Byte order mark, which some editors write. Positions in scripts do not count it, so that edits must not either.
const BYTE_ORDER_MARK: &str = "\u{feff}";

/// A script's text without a byte order mark.
pub(crate) fn read_script(path: &Path) -> Result<String, EditError> {
    let text = read_with_byte_order_mark(path)?;
    Ok(text.strip_prefix(BYTE_ORDER_MARK).map(str::to_string).unwrap_or(text))
}

fn read_with_byte_order_mark(path: &Path) -> Result<String, EditError> {
    /// Limit of the size of a script.
    const MAX_BYTES: u64 = 64 << 20;
    let bytes = choreo_files::read(path, MAX_BYTES)
        .map_err(|source| EditError::Read { path: path.to_path_buf(), source })?;
    String::from_utf8(bytes).map_err(|_| EditError::NotText(path.to_path_buf()))
}

/// Writes a file completely or not at all. A symbolic link within its folder stays a link, and a byte order mark is kept.
pub(crate) fn write_script(path: &Path, text: &str) -> Result<(), EditError> {
    let failed = |source: WriteError| EditError::Write { path: path.to_path_buf(), source };
    let place = path.canonicalize().map_err(|e| failed(e.into()))?;
    let folder = containing_folder(path);
    if path.is_symlink() && folder.canonicalize().is_ok_and(|folder| !place.starts_with(folder)) {
        return Err(EditError::LinkOutside { path: path.to_path_buf(), target: place });
    }
    let mark = if read_with_byte_order_mark(&place).is_ok_and(|old| old.starts_with(BYTE_ORDER_MARK)) {
        BYTE_ORDER_MARK
    } else {
        ""
    };
    write_whole(&place, format!("{mark}{text}").as_bytes()).map_err(failed)
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::write_script;
    use std::fs::{self, hard_link};
    use std::os::unix::fs::{PermissionsExt, symlink};

    /// A symbolic link within the folder stays a link; one that leads outside is not followed.
    #[test]
    fn a_symlinked_script_is_accepted_only_within_its_folder() {
        let dir = tempfile::tempdir().unwrap();
        let (inside, outside) = (dir.path().join("scene"), dir.path().join("bashrc"));
        fs::create_dir_all(inside.join("versions")).unwrap();
        fs::write(inside.join("versions/2.rhai"), "old").unwrap();
        fs::write(&outside, "mine").unwrap();
        let script = inside.join("s.rhai");
        symlink("versions/2.rhai", &script).unwrap();
        write_script(&script, "new").unwrap();
        assert_eq!(fs::read_to_string(inside.join("versions/2.rhai")).unwrap(), "new");
        assert!(script.is_symlink());
        fs::remove_file(&script).unwrap();
        symlink(&outside, &script).unwrap();
        let expected = format!(
            "{}: cannot write: it is a symbolic link to {}, outside its folder; open that file itself",
            script.display(),
            outside.canonicalize().unwrap().display()
        );
        assert_eq!(write_script(&script, "new").unwrap_err().to_string(), expected);
        fs::remove_file(&script).unwrap();
        // A second hard link keeps the old text, and the file keeps its permissions.
        hard_link(&outside, &script).unwrap();
        fs::set_permissions(&outside, PermissionsExt::from_mode(0o640)).unwrap();
        write_script(&script, "new").unwrap();
        assert_eq!(fs::read_to_string(&outside).unwrap(), "mine");
        assert_eq!(fs::metadata(&script).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(fs::read_dir(&inside).unwrap().count(), 2);
    }
}
