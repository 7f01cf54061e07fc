//! New lines for dropped files and clips: clips of an actor's own file or of another actor's, models under the pointer, and previewed files.

use super::idle_clip::idle_clip_name;
use super::next_clip::CROSSFADE_SECS;
use super::room::{self, Footprint};
use super::{EditError, difference, read_script};
use crate::app::Viewer;
use crate::geometry::picking;
use crate::state::dropped_models::DroppedModels;
use crate::state::history::Offer;
use crate::state::orbit::Orbit;
use crate::state::selection::{Selected, actor};
use crate::state::view::ViewCamera;
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_motion::retarget::bind_or_retarget;
use choreo_script::Place;
use choreo_session::SceneVersion;
use choreo_session::edit::{AddedAt, Addition, Edit, ScriptObject, Subject, added_lines, cast_lines};
use choreo_session::model::is_built_in;
use choreo_stage::Actor;
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Values for a new camera that shows an actor.
struct Framing {
    /// Variable that holds the actor.
    variable: String,
    /// The edit that declares the variable if there is none, and the position of the actor's call.
    declaration: Option<(Place, Edit)>,
    /// Distance at which all of the actor is in the image, metres.
    distance: f64,
    /// Unit vector in world space from the actor to the camera: in front of it, a little to the side and from above.
    direction: DVec3,
}

/// Source of an added clip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ClipSource {
    /// The file of an actor, given by its name.
    Actor(String),
    /// A file in the script's folder, or a built-in asset.
    File(PathBuf),
}

/// Folder next to the script that files from elsewhere are copied to.
const ASSETS_FOLDER: &str = "assets";

impl Viewer {
    /// Plays a clip on an actor from a time on: a clip of its own file, or of another actor's (`of`), which is retargeted. If another clip begins
    /// in the same frame, which the new one would hide, the new clip follows the last one instead.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn add_clip(&mut self, name: &str, of: &str, clip: &str, secs: f64) -> Result<(), EditError> {
        let secs = Some(secs).filter(|secs| !self.clip_begins_at(name, *secs));
        self.add_clip_to_layer(name, &ClipSource::Actor(of.to_string()), clip, secs, 0)
    }

    /// Plays a clip on an actor from a time on; `None`: after the last clip. `layer`: the row that the clip was dropped on.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn add_clip_to_layer(
        &mut self,
        name: &str,
        of: &ClipSource,
        clip: &str,
        secs: Option<f64>,
        layer: usize,
    ) -> Result<(), EditError> {
        self.check_unlocked(name)?;
        let secs = secs.unwrap_or_else(|| self.start_after_last_clip(name));
        let (place, _) = self.place_of(&Selected::Actor(name.to_string())).ok_or(EditError::ObjectGone)?;
        if Time::from_secs(secs) >= self.timeline.length {
            let [begins, ends] =
                [Time::from_secs(secs), self.timeline.length].map(|time| self.time_text(time));
            let why = format!(
                "{clip} would follow the last clip at {begins}, and the scene ends at {ends}: move the playhead to where the \
                 clip should begin, or make the stage longer"
            );
            return Err(EditError::refused_at(&place, &why));
        }
        let overlap_note = self.overlap_note(name, clip, secs, layer);
        let follow = match of {
            ClipSource::Actor(of) => self.add_clip_of_actor(name, of, clip, secs)?,
            ClipSource::File(file) => self.add_clip_of_file(name, file, clip, secs).map(|()| None)?,
        };
        let notes: Vec<String> = follow.into_iter().chain(overlap_note).collect();
        self.note = (!notes.is_empty()).then(|| notes.join("; "));
        Ok(())
    }

    /// Options of a clip that follows others.
    fn options_of_next_clip(&self, name: &str) -> String {
        if self.has_base_clip(name) { format!(", #{{ fade: {CROSSFADE_SECS} }}") } else { String::new() }
    }

    /// Returns a note about how many joints follow the clip.
    fn add_clip_of_actor(
        &mut self,
        name: &str,
        of: &str,
        clip: &str,
        secs: f64,
    ) -> Result<Option<String>, EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let found = |name: &str| actor(&scene.stage, name).ok_or(EditError::ObjectGone);
        let (index, source) = (found(name)?, found(of)?);
        let place = |index: usize| scene.places.actors.get(index).cloned().unwrap_or_default();
        let (place, of_place) = (place(index), place(source));
        let follow = self.joints_that_follow(of, clip, name);
        if let Some((0, 1..)) = follow {
            return Err(EditError::refused_at(&place, &format!("no joint of {name} follows {clip} of {of}")));
        }
        let siblings = scene.places.actors.iter().filter(|p| **p == place).count();
        let (options, time) = (self.options_of_next_clip(name), self.edit_time(secs));
        self.edit_call(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            match index == source {
                true => object.play(clip, time, &options, None),
                false => {
                    let of = ScriptObject::at(text, of_place.line, of_place.column)?;
                    object.play(clip, time, &options, Some(&of))
                }
            }
        })?;
        Ok(follow.map(|(joints, moved)| {
            format!("{clip} of {of} on {name}: {joints} of {moved} animated joints are followed")
        }))
    }

    /// Plays a clip of a file in the script's folder on an actor.
    fn add_clip_of_file(&mut self, name: &str, file: &Path, clip: &str, secs: f64) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let index = actor(&scene.stage, name).ok_or(EditError::ObjectGone)?;
        let inside = load_path_within(file, &folder_of(&path)).ok_or_else(|| {
            let why = "it is outside the script's folder, and load(…) reads only inside; copy it into that folder first";
            EditError::refused(format!("{}: {why}", file.display()))
        })?;
        let place = scene.places.actors.get(index).cloned().unwrap_or_default();
        let siblings = scene.places.actors.iter().filter(|p| **p == place).count();
        let (options, time) = (self.options_of_next_clip(name), self.edit_time(secs));
        self.edit_call(&place, siblings, |text| {
            ScriptObject::at(text, place.line, place.column)?.play_file(&inside, clip, time, &options)
        })
    }

    /// Adds an object at the end of the script and selects it. It stands at a free place on the ground and begins at the playhead.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn add_object(&mut self, what: &Addition) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let stage = &scene.stage;
        let is_there =
            || scene.places.ambient.is_some() || self.written_stage_values().contains_key("ambient");
        if matches!(what, Addition::Ambient) && is_there() {
            self.selection = None;
            self.note = Some("the stage already has ambient light; its colors are in the inspector".into());
            return Ok(());
        }
        let text = super::read_script(&self.path.clone().ok_or(EditError::NoScript)?)?;
        let now = self.playhead.time();
        let framing = match what {
            Addition::Orbit(Some(name)) | Addition::Follow(name) => Some(self.framing_of(name)?),
            _ => None,
        };
        let occupied = room::footprints(stage, now);
        let own = Footprint::square(0.3);
        // Positions to the left and to the right of the center in turn.
        let x_offsets = (0..).map(|n: i32| f64::from((n + 1) / 2 * if n % 2 == 0 { -1 } else { 1 }));
        let mut places = x_offsets.take(64).map(|x| DVec3::new(x, 0.0, 0.0));
        let place = places.find(|at| room::is_free(&occupied, own.moved(*at))).unwrap_or_default();
        let [from, end] = [now.as_secs(), self.playhead.length().as_secs()];
        let at = AddedAt {
            // Lights and cameras are placed at the center.
            point: if matches!(what, Addition::Character | Addition::Shape(_)) { place } else { DVec3::ZERO },
            from: self.edit_time(from),
            until: self.edit_time((from + 2.0).min(end)),
            subject: framing.as_ref().map(|framing| Subject {
                variable: &framing.variable,
                distance: framing.distance,
                direction: framing.direction,
            }),
        };
        let (lines, name) = added_lines(&text, what, at);
        match framing.and_then(|framing| framing.declaration) {
            // The same edit declares a variable for the actor.
            Some((place, edit)) => self.edit_call(&place, 1, |text| {
                Ok(Edit::between(text, &format!("{}\n{lines}", edit.apply(text).trim_end())))
            })?,
            None => self.add_line(&lines)?,
        }
        self.selection = match what {
            Addition::Character | Addition::Shape(_) => name.map(Selected::Actor),
            Addition::Orbit(_) | Addition::Follow(_) => name.map(Selected::Camera),
            Addition::Sun | Addition::Point | Addition::Spot => Some(Selected::Light(stage.lights.len())),
            Addition::Title => Some(Selected::Title(stage.layers_2d.len())),
            Addition::Effect(_) => Some(Selected::Effect(stage.effects.len())),
            Addition::Ambient | Addition::StudioSky | Addition::Marker => self.selection.take(),
        };
        Ok(())
    }

    fn framing_of(&self, name: &str) -> Result<Framing, EditError> {
        let scene = self.scene.as_ref().ok_or(EditError::NothingShown)?;
        let stage = &scene.stage;
        let index = actor(stage, name).ok_or(EditError::ObjectGone)?;
        let what = Selected::Actor(name.to_string());
        let (place, siblings) = self.place_of(&what).ok_or(EditError::ObjectGone)?;
        self.check_place(&place, siblings)?;
        let known = self.displayed_text().ok_or(EditError::NothingShown)?;
        let object = ScriptObject::at(&known, place.line, place.column);
        let declared = object.ok().and_then(|object| object.with_variable(name));
        let (variable, declaration) = declared.ok_or_else(|| {
            EditError::refused_at(&place, "a camera needs its name in the script; write let NAME = cast(…)")
        })?;
        let line = known.lines().nth(place.line.saturating_sub(1)).unwrap_or_default();
        if line.starts_with([' ', '\t']) {
            let why = "the actor is made in a block, and its name is unknown outside; write the camera there";
            return Err(EditError::refused_at(&place, why));
        }
        let snapshot = stage.at(self.playhead.time()).ok();
        let state = snapshot.as_ref().and_then(|snapshot| snapshot.actors.get(index));
        let own = &stage.actors[index];
        let posed = state.and_then(|state| picking::bounds(&own.asset, state));
        let rest = || picking::largest_extent(&own.asset) * own.transform.scale.abs().max_element();
        let radius = posed.map_or_else(rest, |(low, high)| (high - low).length()) / 2.0;
        // The bounding sphere fits into the smaller field of view, with a margin.
        let [width, height] = stage.settings.size.map(f64::from);
        let Projection::Perspective { yfov, .. } = Projection::default() else {
            return Err(EditError::ObjectGone);
        };
        let half = f64::from(yfov) / 2.0;
        let half_fov = libm::atan(libm::tan(half) * (width / height).min(1.0));
        let distance = 1.1 * radius / libm::sin(half_fov);
        let front = state.map_or(DVec3::Z, |state| state.world_from_model.matrix3.z_axis);
        let front = DVec3::new(front.x, 0.0, front.z).normalize_or(DVec3::Z);
        let side = DVec3::Y.cross(front);
        let direction = (front + side * 0.4 + DVec3::Y * 0.15).normalize();
        Ok(Framing { variable, declaration: declaration.map(|edit| (place, edit)), distance, direction })
    }

    /// Adds a camera at the view's position, active from the playhead on.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn add_camera_of_view(&mut self) -> Result<(), EditError> {
        let near = self.point_of_interest().unwrap_or(DVec3::ZERO);
        let view = self.views.get(self.active_view).ok_or(EditError::NothingShown)?;
        let orbit = match (&view.camera, &view.shown) {
            (ViewCamera::Free(orbit) | ViewCamera::Follow { orbit, .. }, _) => *orbit,
            (_, Some(shown)) => Orbit::from_camera(&shown.snapshot.camera, near),
            (_, None) => return Err(EditError::NothingShown),
        };
        self.add_camera(&orbit)
    }

    /// Number of joints of the actor `target` that follow a clip of the actor `source`, and number of joints that the clip moves. `None` if both
    /// actors have the same asset.
    pub(crate) fn joints_that_follow(
        &self,
        source: &str,
        clip: &str,
        target: &str,
    ) -> Option<(usize, usize)> {
        let stage = &self.scene.as_ref()?.stage;
        let asset = |name: &str| Some(&stage.actors[actor(stage, name)?].asset);
        let (from, to) = (asset(source)?, asset(target)?);
        if source == target || Arc::ptr_eq(from, to) {
            return None;
        }
        let clip = from.clips.iter().find(|c| c.name == clip)?;
        let (_, coverage, _) = bind_or_retarget(clip, &from.skeleton, &to.skeleton);
        Some((coverage.followed(), coverage.moved))
    }

    /// Adds models where they were dropped, else at the nearest free places, in a row along x, each with its idle clip. `loaded`: the stage on which
    /// the models were read. The last one is selected. Files from outside the script's folder are copied into `assets/` if the user agrees.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn add_models(&mut self, dropped: &DroppedModels, loaded: &SceneVersion) -> Result<(), EditError> {
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let problems = || loaded.problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
        let scene = loaded.scene.as_ref().ok_or_else(|| EditError::refused(problems()))?;
        let folder = folder_of(&path);
        let text = super::read_script(&path)?;
        let (mut lines, mut copies, mut refused) = (String::new(), Vec::new(), Vec::new());
        let mut selects = None;
        let mut shown = scene.stage.actors.iter().peekable();
        let now = self.playhead.time();
        let mut occupied =
            self.scene.as_ref().map(|own| room::footprints(&own.stage, now)).unwrap_or_default();
        for file in &dropped.files {
            let is_from_file =
                |actor: &&Actor| file.file_name().is_some_and(|name| *name == *actor.asset.name);
            let Some(actor) = shown.next_if(is_from_file) else {
                refused.push(format!("{}: it cannot be read", file.display()));
                continue;
            };
            let file = file.canonicalize().unwrap_or_else(|_| file.clone());
            let name = load_path_within(&file, &folder).unwrap_or_else(|| {
                load_path(&asset_destination(&file, &folder, &loaded.read_files, &mut copies))
            });
            let along_x = DVec3::new(actor.transform.translation.x, 0.0, 0.0);
            let own =
                room::footprint(actor, None, Time::ZERO).unwrap_or(Footprint::square(0.5).moved(along_x));
            let own = own.moved(-along_x);
            let at = match dropped.beside {
                true => room::nearest_free(&occupied, own, dropped.at),
                false => dropped.at + along_x,
            };
            occupied.push(own.moved(at));
            let at = at.map(|v| (v * 100.0).round() / 100.0);
            let clip = idle_clip_name(&actor.asset);
            let (own, name) = cast_lines(&format!("{text}{lines}"), &name, at, clip);
            lines += &own;
            selects = Some(Selected::Actor(name));
        }
        if lines.is_empty() {
            return Err(EditError::refused(refused.join("; ")));
        }
        let break_before = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
        let edit = Edit { range: text.len()..text.len(), text: format!("{break_before}{lines}") };
        match copies.is_empty() {
            true => {
                self.write_edit(&path, &text, edit)?;
                self.selection = selects;
            }
            false => {
                let difference = difference::diff_lines(&text, &edit.apply(&text));
                let count =
                    if copies.len() == 1 { "a file".into() } else { format!("{} files", copies.len()) };
                let why = format!("{count} from outside the script's folder, copied into {ASSETS_FOLDER}/:");
                let label = "Copy and add".into();
                self.offer =
                    Some(Offer { why, label, difference, copies, edit, text, selects, ..Offer::default() });
            }
        }
        if refused.is_empty() { Ok(()) } else { Err(EditError::refused(refused.join("; "))) }
    }

    /// Adds the previewed files to the script, in one edit, with a line for each at the end. Several models stand where the preview shows them.
    ///
    /// # Errors
    /// The files that could not be added, with reasons: unreadable, or outside the script's folder. The others are added.
    pub fn add_previewed_files(&mut self) -> Result<(), EditError> {
        let path = self.path.clone().ok_or(EditError::NoScript)?;
        let folder = folder_of(&path);
        let mut text = read_script(&path)?;
        let (before, begins) = (text.clone(), text.len());
        if !text.is_empty() && !text.ends_with('\n') {
            text.push('\n');
        }
        let scene = self
            .scene
            .clone()
            .filter(|_| !self.is_faulty)
            .ok_or_else(|| EditError::refused("the dropped files cannot be read"))?;
        let (mut shown, mut refused) = (scene.stage.actors.iter().peekable(), Vec::new());
        let mut selects = None;
        for file in &self.previewed_files {
            // Actors are in the order of the dropped files, without the unreadable ones.
            let is_from_file =
                |actor: &&Actor| file.file_name().is_some_and(|name| *name == *actor.asset.name);
            let Some(actor) = shown.next_if(is_from_file) else {
                refused.push(format!("{}: it cannot be read", file.display()));
                continue;
            };
            let at = DVec3::new(actor.transform.translation.x, 0.0, 0.0);
            match load_path_within(file, &folder) {
                Some(inside) => {
                    let (lines, name) = cast_lines(&text, &inside, at, None);
                    text.push_str(&lines);
                    selects = Some(Selected::Actor(name));
                }
                None => refused.push(format!(
                    "{}: it is outside the script's folder, and load(…) reads only inside; copy it into that folder first",
                    file.display()
                )),
            }
        }
        if refused.len() < self.previewed_files.len() {
            let edit = Edit { range: begins..begins, text: text.split_off(begins) };
            self.write_edit(&path, &before, edit)?;
            self.close_preview = true;
            self.selection = selects;
        }
        if refused.is_empty() { Ok(()) } else { Err(EditError::refused(refused.join("; "))) }
    }
}

fn folder_of(script: &Path) -> PathBuf {
    script.canonicalize().ok().and_then(|p| Some(p.parent()?.to_path_buf())).unwrap_or_default()
}

/// Path of a file in a folder, or of a built-in asset, as `load` takes it. `None` for a file outside.
fn load_path_within(file: &Path, folder: &Path) -> Option<String> {
    if is_built_in(file) {
        return Some(file.to_string_lossy().into_owned());
    }
    let file = file.canonicalize().unwrap_or_else(|_| file.to_path_buf());
    file.strip_prefix(folder).ok().map(load_path)
}

/// A path as `load` takes it.
fn load_path(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

/// Destination of a file in the assets folder. Adds it and the files that it reads from its own folder (buffers, images) to `copies`.
fn asset_destination(
    file: &Path,
    folder: &Path,
    files_read: &[PathBuf],
    copies: &mut Vec<(PathBuf, PathBuf)>,
) -> PathBuf {
    let home = file.parent().unwrap_or(Path::new(""));
    let others: Vec<&PathBuf> = files_read.iter().filter(|f| *f != file && f.starts_with(home)).collect();
    // Several files get a folder of their own and keep their relative paths.
    let stem = choreo_session::model::name(file);
    let own =
        if others.is_empty() { PathBuf::from(ASSETS_FOLDER) } else { Path::new(ASSETS_FOLDER).join(stem) };
    let mut inside = PathBuf::new();
    for from in std::iter::once(file).chain(others.into_iter().map(PathBuf::as_path)) {
        let to = own.join(from.strip_prefix(home).unwrap_or(from));
        copies.push((from.to_path_buf(), folder.join(&to)));
        if from == file {
            inside = to;
        }
    }
    inside
}

/// Copies a file, unless the destination already has the same content.
pub(super) fn copy_file(from: &Path, to: &Path) -> Result<(), EditError> {
    let failed = |source| EditError::Copy { path: to.to_path_buf(), source };
    let bytes = std::fs::read(from).map_err(|source| EditError::Copy { path: from.to_path_buf(), source })?;
    if std::fs::read(to).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    if to.exists() {
        return Err(failed(std::io::Error::other("another file with this name already exists")));
    }
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    std::fs::write(to, bytes).map_err(failed)
}
