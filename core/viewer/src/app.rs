//! Content and state of the window, independent of how it is drawn. The window feeds it scene versions, frames and the clock, and asks it for the
//! next frame to draw. No UI toolkit is used here.

use crate::commands::Commands;
use crate::commands::external_editor::Editor;
use crate::commands::queue::RenderQueue;
use crate::commands::test_run::TestRun;
use crate::geometry::gizmo::{Change, Drag, Tool};
use crate::geometry::picking;
use crate::library::documents::Documents;
use crate::state::curves::Curves;
use crate::state::dragged_icon::DraggedIcon;
use crate::state::dropped_models::DroppedModels;
use crate::state::events::Event;
use crate::state::history::{History, Offer};
use crate::state::keyed::KeyRef;
use crate::state::orbit::Orbit;
use crate::state::performance::Performance;
use crate::state::playhead::Playhead;
use crate::state::reduction::ResolutionReduction;
use crate::state::render_form::RenderForm;
use crate::state::selection::{self, Selected};
use crate::state::shortcuts::Shortcuts;
use crate::state::span::Span;
use crate::state::tempo::Tempo;
use crate::state::timeline::{Bar, Row, RowNumber, Timeline};
use crate::state::trail::{JointRef, Trails};
use crate::state::view::{FrameKey, Resolution, View, ViewCamera, fit_image_size};
use choreo_motion::Time;
use choreo_plugin::Frame;
use choreo_render::renderer::{CreatedCounts, DeviceUsage};
use choreo_script::{Place, Severity};
use choreo_session::{
    FrameInfo, FrameReply, FrameRequest, PlacementOverride, Problem, Scene, SceneVersion, ViewOverrides, Work,
};
use glam::DVec3;
use std::cell::Cell;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Largest width or height of an image in a viewport, pixels; `render` can draw larger ones.
const MAX_IMAGE_SIDE: u32 = 4096;

/// Changes of how this window shows actors, independent of the script.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Toggles {
    pub hidden: BTreeSet<String>,
    /// Actors shown alone; if empty, all actors are shown.
    pub solo: BTreeSet<String>,
    /// Actors that cannot be picked or moved with the mouse.
    pub locked: BTreeSet<String>,
    /// Actors whose upper layers are hidden in the sequencer.
    pub collapsed: BTreeSet<String>,
    /// Rows of the sequencer that show a row for each keyed property: name of the actor and the layer, else name of the row.
    pub expanded: BTreeSet<(String, Option<usize>)>,
    /// Muted layers, which do not play: actor and layer.
    pub muted: BTreeSet<(String, usize)>,
}

/// The actor that is being dragged in a viewport.
#[derive(Clone, Debug, PartialEq)]
pub struct Dragging {
    pub actor: String,
    pub drag: Drag,
    pub change: Change,
}

/// An edit that is made again later.
pub(crate) type DeferredEdit = Box<dyn FnOnce(&mut Viewer)>;

pub struct Viewer {
    /// Name of the script or model, for titles.
    pub name: String,
    /// Path of the script. `None` for a model.
    pub path: Option<PathBuf>,
    /// Files that the window can open.
    pub documents: Documents,
    pub shortcuts: Shortcuts,
    /// Program that opens lines of the script.
    pub editor: Editor,
    pub history: History,
    /// A refused edit of one of several objects of a loop, and whether it is made as soon as the loop is unrolled.
    pub(crate) pending_edit_after_unroll: Option<(DeferredEdit, bool)>,
    /// An edit that the user must accept first.
    pub offer: Option<Offer>,
    /// Whether the window is to be closed.
    pub should_close: bool,
    /// Reason why the last edit was refused.
    pub message: Option<String>,
    /// Line of the script that caused the refusal, from 1.
    pub message_line: Option<usize>,
    /// Number of refused edits so far.
    pub refusals: u64,
    /// Note about effects of the last edit that are not visible.
    pub note: Option<String>,
    /// Command lines of renders, exports and tests.
    pub commands: Commands,
    pub renders: RenderQueue,
    pub render_form: RenderForm,
    pub tests: TestRun,
    /// Script or folder whose tests are run; empty: the open script.
    pub test_path: String,
    /// The last good version.
    pub scene: Option<Arc<Scene>>,
    pub timeline: Timeline,
    /// Problems of the newest version, good or faulty, in the order of `choreo check`: first those of the run, then those found in its scene.
    pub problems: Vec<Problem>,
    /// Worst severity of each line with problems, by line number and then by file.
    severities: HashMap<usize, Vec<(String, Severity)>>,
    /// Whether the newest version is faulty, so that the previous one is displayed.
    pub is_faulty: bool,
    /// Problems of the renderer: driver failures, shaders that do not compile, callbacks that fail at the displayed time.
    pub renderer_problems: Vec<String>,
    /// Reason why the window itself is drawn on the CPU, if it is.
    pub without_vulkan: Option<String>,
    /// Device that draws the window, with the reason if it is not Vulkan.
    pub window_device: String,
    pub playhead: Playhead,
    /// Viewports, at least one.
    pub views: Vec<View>,
    /// Index of the viewport that keyboard commands apply to.
    pub active_view: usize,
    pub tool: Tool,
    pub dragging: Option<Dragging>,
    pub dragged_icon: Option<DraggedIcon>,
    /// Cache of [`Viewer::sun_target()`] for the scene.
    pub(crate) sunlit: Cell<Option<DVec3>>,
    /// Placement of a dragged icon after its release, used until the next version has it.
    pub(crate) placement_override: Option<PlacementOverride>,
    /// Joint that is selected in addition to the selection.
    pub selected_joint: Option<JointRef>,
    pub trails: Trails,
    pub toggles: Toggles,
    pub selection: Option<Selected>,
    /// Object that is being renamed in a text field.
    pub(crate) to_rename: Option<Selected>,
    /// Clipboard text of the clips copied last, one per line.
    pub(crate) copied_clips: String,
    /// Further selected objects, and the selection that they belong to.
    pub(crate) further_selected: (Option<Selected>, Vec<Selected>),
    /// The bar that was clicked to select its camera, which may have several.
    pub(crate) clicked_camera_bar: Option<Bar>,
    /// Selected keys, sorted, and the selection that they belong to.
    pub(crate) keys: (Option<Selected>, Vec<KeyRef>),
    pub curves: Curves,
    /// Times at the edges of the sequencer.
    pub visible_span: Span,
    /// Whether times are displayed in seconds and not as frames.
    pub in_seconds: bool,
    /// Whether dragged times snap, at least to whole frames.
    pub snap: bool,
    /// Beats of the music, which dragged times also snap to.
    pub tempo: Tempo,
    /// Whether the script panel has the pointer or the keyboard, so that keys typed do not change the selection.
    pub(crate) script_has_input: bool,
    /// Line that the script panel scrolls to, from 1.
    pub script_scroll_line: Option<usize>,
    /// Files dropped on the window, previewed in place of the script.
    pub previewed_files: Vec<PathBuf>,
    /// Newly dropped files; the window starts a session that previews them.
    pub dropped_files: Vec<PathBuf>,
    /// Models dropped on a viewport; the window reads them.
    pub dropped_models: Option<DroppedModels>,
    pub close_preview: bool,
    /// File that the next image of the active viewport is saved to.
    pub screenshot: Option<PathBuf>,
    pub work: Work,
    pub created_counts: CreatedCounts,
    pub device_usage: DeviceUsage,
    pub performance: Performance,
    /// Reduced resolution while the view moves.
    pub reduction: ResolutionReduction,
    /// Whether the view, the playhead or an object is being dragged.
    pub is_scrubbing: bool,
    pub build_duration: Duration,
    samples: Option<u32>,
    reloads: u64,
    ticket: u64,
    /// Last ticket of the previous viewer in this window; frames up to it are ignored.
    first_ticket: u64,
}

impl Viewer {
    pub fn new(name: impl Into<String>) -> Viewer {
        Viewer {
            name: name.into(),
            path: None,
            documents: Documents::default(),
            shortcuts: Shortcuts::default(),
            editor: Editor::of_environment(),
            history: History::default(),
            pending_edit_after_unroll: None,
            offer: None,
            message: None,
            message_line: None,
            refusals: 0,
            note: None,
            should_close: false,
            commands: Commands::default(),
            renders: RenderQueue::default(),
            render_form: RenderForm::default(),
            tests: TestRun::default(),
            test_path: String::new(),
            scene: None,
            timeline: Timeline::default(),
            problems: Vec::new(),
            severities: HashMap::new(),
            is_faulty: false,
            renderer_problems: Vec::new(),
            without_vulkan: None,
            window_device: String::new(),
            playhead: Playhead::default(),
            views: vec![View::default()],
            active_view: 0,
            tool: Tool::Move,
            dragging: None,
            dragged_icon: None,
            sunlit: Cell::default(),
            placement_override: None,
            selected_joint: None,
            trails: Trails::default(),
            toggles: Toggles::default(),
            selection: None,
            to_rename: None,
            copied_clips: String::new(),
            further_selected: (None, Vec::new()),
            clicked_camera_bar: None,
            keys: (None, Vec::new()),
            curves: Curves::default(),
            visible_span: Span::whole(1.0),
            in_seconds: true,
            snap: true,
            tempo: Tempo::default(),
            script_has_input: false,
            script_scroll_line: None,
            previewed_files: Vec::new(),
            dropped_files: Vec::new(),
            dropped_models: None,
            close_preview: false,
            screenshot: None,
            work: Work::default(),
            created_counts: CreatedCounts::default(),
            device_usage: DeviceUsage::default(),
            performance: Performance::default(),
            reduction: ResolutionReduction::default(),
            is_scrubbing: false,
            build_duration: Duration::ZERO,
            samples: None,
            reloads: 0,
            ticket: 0,
            first_ticket: 0,
        }
    }

    /// Creates the viewer of another file in the same window, which takes over documents, renders and preferences.
    pub(crate) fn for_other_file(&mut self, name: impl Into<String>) -> Viewer {
        let performance = Performance { max_fps: self.performance.max_fps, ..Performance::default() };
        Viewer {
            documents: std::mem::take(&mut self.documents),
            shortcuts: self.shortcuts.clone(),
            editor: self.editor.clone(),
            copied_clips: std::mem::take(&mut self.copied_clips),
            // Renders continue in the queue.
            commands: std::mem::take(&mut self.commands),
            renders: std::mem::take(&mut self.renders),
            without_vulkan: self.without_vulkan.take(),
            window_device: std::mem::take(&mut self.window_device),
            // Frames that are still being drawn do not belong to the views of the new viewer.
            ticket: self.ticket,
            first_ticket: self.ticket,
            reloads: self.reloads,
            in_seconds: self.in_seconds,
            snap: self.snap,
            performance,
            views: vec![View {
                resolution: self.view().resolution,
                overlays: self.view().overlays,
                ..View::default()
            }],
            ..Viewer::new(name)
        }
    }

    /// Records the opened file as the most recent one, and restores its tempo.
    pub fn record_opened(&mut self, file: &Path) {
        self.documents.record_opened(file);
        self.tempo = self.documents.tempo_of(file);
    }

    /// Takes a version. A good one replaces the scene as a whole; the playhead, playback, selection and cameras are kept.
    pub fn take_version(&mut self, version: SceneVersion) {
        if version.scene.is_none() && self.undo_faulty_edit(&version.problems) {
            return;
        }
        self.problems = version.problems;
        self.find_severities();
        self.work = version.work;
        self.documents.read_files = version.read_files;
        self.build_duration = version.build_time;
        self.is_faulty = version.scene.is_none();
        (self.dragging, self.placement_override) = (None, None);
        if version.shaders_changed {
            self.reloads += 1;
        }
        let Some(scene) = version.scene else { return };
        let settings = &scene.stage.settings;
        let length = settings.length.as_secs();
        // If the timeline showed the whole scene, it shows the whole new scene.
        if self.scene.is_none() || self.visible_span == Span::whole(self.playhead.length().as_secs()) {
            self.visible_span = Span::whole(length);
        }
        if self.scene.is_none() || self.curves.time == Span::whole(self.playhead.length().as_secs()) {
            self.curves.time = Span::whole(length);
        }
        self.playhead.set_scene(settings.fps, settings.length);
        let (is_main, further) =
            (self.further_selected.0 == self.selection, std::mem::take(&mut self.further_selected.1));
        let before: Vec<Bar> = self.bars().cloned().collect();
        self.timeline = Timeline::new(&scene);
        let found =
            |what: Selected| self.find_in_new_timeline(&before, what).filter(|what| what.is_on(&scene.stage));
        let further: Vec<Selected> = further.into_iter().filter_map(found).collect();
        let (selection, of_keys) =
            (self.selection.clone().and_then(found), self.keys.0.clone().and_then(found));
        self.selection = selection;
        // Further selected objects belong to the selection that they were added to.
        self.further_selected = (self.selection.clone(), if is_main { further } else { Vec::new() });
        self.keys.0 = of_keys;
        self.clicked_camera_bar = self.selected_shot().cloned();
        self.scene = Some(scene);
        self.sunlit.take();
        self.restore_selected_keys();
        self.check_expected_placement();
        self.apply_edit_after_unroll();
    }

    /// Adds the messages of `choreo check` about a version, which arrive after it.
    pub fn take_messages(&mut self, number: u64, messages: &[Problem]) {
        let is_shown = self.scene.as_ref().is_some_and(|scene| scene.number == number);
        if is_shown && !self.is_faulty {
            add_messages(&mut self.problems, messages);
            self.find_severities();
        }
    }

    fn find_severities(&mut self) {
        self.severities.clear();
        for problem in self.problems.iter().filter(|problem| problem.line > 0) {
            let line = self.severities.entry(problem.line).or_default();
            match line.iter_mut().find(|(file, _)| *file == problem.file) {
                Some((_, worst)) => *worst = problem.severity.min(*worst),
                None => line.push((problem.file.clone(), problem.severity)),
            }
        }
    }

    /// Worst severity of the problems in a line of the script.
    pub fn severity(&self, place: &Place) -> Option<Severity> {
        let line = self.severities.get(&place.line)?;
        line.iter().find(|(file, _)| *file == place.file).map(|(_, severity)| *severity)
    }

    /// Takes a rendered frame and returns the index of its view and its pixels. If rendering failed, the last image stays.
    pub fn take_frame(&mut self, reply: FrameReply) -> Option<(usize, Frame)> {
        if self.first_ticket > 0 && reply.ticket <= self.first_ticket {
            return None;
        }
        let index = reply.view as usize;
        let last_view = self.views.len() - 1;
        let view = self.views.get_mut(index)?;
        if reply.ticket == view.ticket {
            view.is_waiting = false;
        }
        self.created_counts = reply.created_counts;
        self.device_usage = reply.device_usage;
        self.renderer_problems = reply.notes;
        match reply.result {
            Ok((frame, shown)) => {
                self.performance.add(shown.evaluated_in, shown.planned_in, shown.drawn_in);
                let took = shown.evaluated_in + shown.planned_in + shown.drawn_in;
                let requested = view.requested.as_ref().filter(|key| key.time == shown.time);
                if requested.is_some_and(|key| key.moving) && view.resolution == Resolution::Fitted {
                    let budget = 1e3 / self.playhead.fps().as_fps();
                    self.reduction.record_duration(took.as_secs_f64() * 1e3, budget);
                }
                if index == self.active_view.min(last_view) {
                    let frame = self.playhead.frame_at(shown.time);
                    self.reduction.record_frame(frame, self.playhead.is_playing());
                }
                view.shown = Some(shown);
                Some((index, frame))
            }
            Err(error) => {
                self.renderer_problems.push(error.to_string());
                None
            }
        }
    }

    /// The next frame to request: for a view that needs another frame than the last requested one and has no pending request.
    pub fn next_request(&mut self) -> Option<FrameRequest> {
        let scene = self.scene.clone()?;
        // The default of `render` is four, too.
        let samples = self.samples.or(scene.stage.settings.samples).unwrap_or(4);
        let overrides = self.overrides(&scene);
        let moving = self.is_moving();
        let (saves, active) = (self.screenshot.is_some(), self.active_view.min(self.views.len() - 1));
        for (index, view) in self.views.iter_mut().enumerate().filter(|(_, v)| v.is_visible && !v.is_waiting)
        {
            let size = match view.resolution {
                Resolution::Full => scene.stage.settings.size.map(|s| s.clamp(1, MAX_IMAGE_SIDE)),
                Resolution::Fitted => {
                    let divisor = self.reduction.divisor(moving);
                    fit_image_size(scene.stage.settings.size, view.panel_size, divisor, MAX_IMAGE_SIDE)
                }
            };
            let key = FrameKey {
                scene_version: scene.number,
                reloads: self.reloads,
                time: self.playhead.time(),
                size,
                samples,
                viewport_camera: view.viewport_camera(&scene.stage),
                moving,
                overrides: view_overrides(&overrides, view, saves && index == active),
            };
            if view.requested.as_ref() == Some(&key) {
                continue;
            }
            self.ticket += 1;
            view.is_waiting = true;
            view.ticket = self.ticket;
            let FrameKey { time, viewport_camera, moving, overrides, .. } = key.clone();
            view.requested = Some(key);
            let ticket = self.ticket;
            return Some(FrameRequest {
                scene,
                time,
                size,
                samples,
                moving,
                view: index as u32,
                camera: viewport_camera,
                overrides,
                ticket,
            });
        }
        None
    }

    fn overrides(&self, scene: &Scene) -> ViewOverrides {
        let stage = &scene.stage;
        let unseen = |name: &String| {
            self.toggles.hidden.contains(name)
                || (!self.toggles.solo.is_empty() && !self.toggles.solo.contains(name))
        };
        let hidden =
            stage.actors.iter().enumerate().filter(|(_, a)| unseen(&a.name)).map(|(i, _)| i).collect();
        let outlined = match &self.selection {
            Some(Selected::Actor(name)) => selection::actor(stage, name),
            _ => None,
        };
        let muted = self.toggles.muted.iter();
        let muted =
            muted.filter_map(|(name, layer)| Some((selection::actor(stage, name)?, *layer))).collect();
        let dragged = self.dragged_icon.as_ref().filter(|dragged| dragged.from != dragged.to);
        let placement = dragged.and_then(|dragged| self.icon_placement(stage, dragged));
        let placement =
            placement.or_else(|| self.placement_override.clone()).or_else(|| self.dragged_placement(stage));
        ViewOverrides { hidden, outlined, muted, placement, grid: false }
    }

    /// Number of shader changes so far.
    pub fn reloads(&self) -> u64 {
        self.reloads
    }

    /// Whether images are only shown briefly.
    pub(crate) fn is_moving(&self) -> bool {
        let is_dragged =
            self.dragging.is_some() || self.dragged_icon.is_some() || self.placement_override.is_some();
        self.playhead.is_playing() || self.is_scrubbing || is_dragged
    }

    /// Whether a frame is being rendered.
    pub(crate) fn is_waiting(&self) -> bool {
        self.views.iter().any(|v| v.is_waiting)
    }

    /// The frame that the panels describe.
    pub fn shown(&self) -> Option<&FrameInfo> {
        self.view().shown.as_ref().or_else(|| self.views.iter().find_map(|v| v.shown.as_ref()))
    }

    pub fn view(&self) -> &View {
        &self.views[self.active_view.min(self.views.len() - 1)]
    }

    pub(crate) fn view_mut(&mut self) -> &mut View {
        let active = self.active_view.min(self.views.len() - 1);
        &mut self.views[active]
    }

    /// Displayed name of a light.
    pub(crate) fn light_name(&self, index: usize) -> String {
        let name = self.timeline.lights.get(index).cloned();
        name.unwrap_or_else(|| format!("light {}", index + 1))
    }

    /// Displayed name of an effect.
    pub(crate) fn effect_name(&self, index: usize) -> String {
        let scene = self.scene.as_ref();
        scene.and_then(|scene| scene.stage.effects.get(index)).map_or_else(String::new, |e| e.plugin.clone())
    }

    /// Makes the camera of a view free at its present position, so that the mouse can move it.
    pub fn free_camera(&mut self, view: usize) -> Option<&mut Orbit> {
        let near = self.point_of_interest().unwrap_or(DVec3::ZERO);
        let view = self.views.get_mut(view)?;
        if matches!(view.camera, ViewCamera::Script | ViewCamera::Named(_)) {
            let shown = view.shown.as_ref()?;
            view.camera = ViewCamera::Free(Orbit::from_camera(&shown.snapshot.camera, near));
        }
        match &mut view.camera {
            ViewCamera::Free(orbit) | ViewCamera::Follow { orbit, .. } => Some(orbit),
            ViewCamera::Script | ViewCamera::Named(_) => None,
        }
    }

    /// Center of the selected actor, else of all visible actors, world space.
    pub(crate) fn point_of_interest(&self) -> Option<DVec3> {
        let (scene, shown) = (self.scene.as_ref()?, self.shown()?);
        let selected = self.selection.as_ref().and_then(Selected::actor);
        let selected = selected.and_then(|name| selection::actor(&scene.stage, name));
        let mut actors = scene.stage.actors.iter().zip(&shown.snapshot.actors);
        let own = selected.and_then(|index| actors.nth(index));
        own.map(|(actor, state)| picking::bounds_center(&actor.asset, state))
            .or_else(|| self.center_of_actors())
    }

    /// Center of all visible actors, world space.
    pub(crate) fn center_of_actors(&self) -> Option<DVec3> {
        picking::bounds_center_of_all(&self.scene.as_ref()?.stage, &self.shown()?.snapshot)
    }

    /// Moves the playhead to the next (or the previous) start, end, event or marker.
    pub(crate) fn seek_to_next(&mut self, back: bool) {
        let next = self.timeline.next_time(self.playhead.time(), self.playhead.fps(), back);
        if let Some(time) = next {
            self.playhead.pause();
            self.playhead.seek(time);
        }
    }

    /// A time in the chosen unit, for the user.
    pub fn time_text(&self, time: Time) -> String {
        match self.in_seconds {
            true => format!("{:.3} s", time.as_secs()),
            false => format!("frame {}", self.playhead.fps().frames_in(time)),
        }
    }

    /// Further objects that are selected in addition to the selection.
    pub(crate) fn further_selected(&self) -> &[Selected] {
        if self.further_selected.0 == self.selection { &self.further_selected.1 } else { &[] }
    }

    pub(crate) fn is_selected(&self, what: &Selected) -> bool {
        self.selection.as_ref() == Some(what) || self.further_selected().contains(what)
    }

    /// Selected bars of the timeline.
    pub fn selected_bars(&self) -> Vec<Selected> {
        let all = self.selection.iter().chain(self.further_selected());
        all.filter(|what| self.bars().any(|bar| bar.what == **what)).cloned().collect()
    }

    /// Selected bars, except for a bar that is only selected because its keys are.
    pub(crate) fn explicitly_selected_bars(&self) -> Vec<Selected> {
        let bars = self.selected_bars();
        match bars.as_slice() {
            [bar] if self.selected_keys().iter().any(|key| key.what == *bar) => Vec::new(),
            _ => bars,
        }
    }

    /// Whether commands apply to the selected keys; selected bars take precedence.
    pub(crate) fn has_only_keys_selected(&self) -> bool {
        !self.selected_keys().is_empty() && self.explicitly_selected_bars().is_empty()
    }

    /// Name of a locked actor that is selected, or that a selected clip or key belongs to.
    pub(crate) fn locked_selection(&self) -> Option<&str> {
        let keys = self.selected_keys().iter().map(|key| &key.what);
        let all = self.selection.iter().chain(self.further_selected()).chain(keys);
        all.filter_map(Selected::actor).find(|name| self.toggles.locked.contains(*name))
    }

    /// Adds an object to the selection, or removes it.
    pub(crate) fn select_more(&mut self, what: Selected) {
        let mut all = self.selected_bars();
        match all.iter().position(|other| *other == what) {
            Some(at) => drop(all.remove(at)),
            None => all.push(what),
        }
        self.select_all(all);
    }

    /// Selects a bar. `adds`: adds it to the selection, or removes it.
    pub(crate) fn select_bar(&mut self, bar: Bar, adds: bool) {
        match adds {
            true => self.select_more(bar.what.clone()),
            false => self.select_all(vec![bar.what.clone()]),
        }
        self.clicked_camera_bar = Some(bar).filter(|bar| matches!(bar.what, Selected::Camera(_)));
    }

    pub(crate) fn select_all(&mut self, all: Vec<Selected>) {
        self.clicked_camera_bar = None;
        let mut all = all.into_iter();
        self.selection = all.next();
        self.further_selected = (self.selection.clone(), all.collect());
        self.keys = (None, Vec::new());
    }

    /// The selected keys.
    pub fn selected_keys(&self) -> &[KeyRef] {
        if self.keys.0 == self.selection { &self.keys.1 } else { &[] }
    }

    pub(crate) fn is_key_selected(&self, key: &KeyRef) -> bool {
        self.selected_keys().binary_search(key).is_ok()
    }

    /// Selects keys. If none of them belongs to the selection, their object is selected, too.
    pub fn select_keys(&mut self, mut keys: Vec<KeyRef>) {
        keys.sort();
        keys.dedup();
        if let Some(first) = keys.first() {
            let is_of_it = |key: &KeyRef| self.selection.as_ref() == Some(&key.what);
            if !keys.iter().any(is_of_it) {
                self.selection = Some(first.what.clone());
            }
        }
        self.keys = (self.selection.clone(), keys);
    }

    /// Selects bars together with keys.
    pub(crate) fn select_bars_and_keys(&mut self, bars: Vec<Selected>, mut keys: Vec<KeyRef>) {
        keys.sort();
        keys.dedup();
        let has_bars = !bars.is_empty();
        self.select_all(bars);
        match has_bars {
            true => self.keys = (self.selection.clone(), keys),
            false => self.select_keys(keys),
        }
    }

    /// Adds keys to the selection, or removes them if all are selected already.
    pub(crate) fn select_more_keys(&mut self, keys: &[KeyRef]) {
        let mut all = self.selected_keys().to_vec();
        match keys.iter().all(|key| all.contains(key)) {
            true => all.retain(|key| !keys.contains(key)),
            false => all.extend(keys.iter().filter(|key| !self.is_key_selected(key)).cloned()),
        }
        self.select_keys(all);
    }

    /// Moves the selection with keys that were moved, until the reload shows them. `by`: seconds.
    pub(crate) fn move_key_selection(&mut self, moved: &[KeyRef], by: f64) {
        for key in self.keys.1.iter_mut().filter(|key| moved.contains(key)) {
            key.at = Time::from_secs((key.at.as_secs() + by).max(0.0));
        }
        self.keys.1.sort();
    }

    /// Finds a clip of the previous version in the present timeline, by its position in the script if an edit has changed its index.
    fn find_in_new_timeline(&self, before: &[Bar], what: Selected) -> Option<Selected> {
        let is_cue = matches!(what, Selected::Cue { .. });
        let Some(old) = before.iter().find(|bar| is_cue && bar.what == what) else { return Some(what) };
        let is_same = |bar: &&Bar| bar.label == old.label && bar.start == old.start;
        let there = self.bars().find(|bar| bar.what == what);
        if there.as_ref().is_some_and(is_same) {
            return Some(what);
        }
        let moved = self.bars().find(|bar| bar.place == old.place && bar.label == old.label);
        moved.or(there).map(|bar| bar.what.clone())
    }

    /// Finds the selected keys in a new version by object, property and time, and drops those that no longer exist. After an undo, restores the
    /// keys that were selected before the edit.
    fn restore_selected_keys(&mut self) {
        let near = Time(self.playhead.fps().time_of(1).0 / 4);
        let events = || self.timeline.rows.iter().flat_map(|row| &row.events);
        let found = |key: &KeyRef| -> Option<KeyRef> {
            let is_it = |event: &&Event| {
                event.keys.iter().any(|of| of.what == key.what && of.property == key.property)
                    && (event.at - key.at).0.abs() <= near.0
            };
            let event = events().filter(is_it).min_by_key(|event| (event.at - key.at).0.abs())?;
            Some(KeyRef { at: event.at, ..key.clone() })
        };
        let all = |keys: &[KeyRef]| keys.iter().filter_map(found).collect::<Vec<KeyRef>>();
        let known = self.scene.as_ref().and_then(|scene| scene.places.sources.get(&scene.places.main));
        let restored =
            self.history.restored.take_if(|(text, _)| known.is_some_and(|known| **known == **text));
        let (mut now, before) = (all(&self.keys.1), restored.map_or(Vec::new(), |(_, keys)| all(&keys)));
        if !before.is_empty() && (now.is_empty() || now.len() < self.keys.1.len()) {
            self.keys.0.clone_from(&self.selection);
            now = before;
        }
        now.sort();
        self.keys.1 = now;
    }

    /// Whether a row is expanded: one sub-row for each keyed property.
    pub(crate) fn is_expanded(&self, row: &Row) -> bool {
        let expanded = &self.toggles.expanded;
        !expanded.is_empty() && !row.parts.is_empty() && expanded.contains(&row.key())
    }

    /// Rows of the timeline that are not collapsed, and the parts of expanded rows.
    pub(crate) fn shown_rows(&self) -> Vec<RowNumber> {
        let is_shown = |index: &usize| {
            let row = &self.timeline.rows[*index];
            let actor = row.what.as_ref().and_then(Selected::actor);
            row.layer.unwrap_or(0) == 0 || actor.is_none_or(|name| !self.toggles.collapsed.contains(name))
        };
        let with_parts = |row: usize| {
            let whole = &self.timeline.rows[row];
            let count = if self.is_expanded(whole) { whole.parts.len() } else { 0 };
            let parts = (0..count).map(move |part| RowNumber { row, part: Some(part) });
            std::iter::once(RowNumber::whole(row)).chain(parts)
        };
        (0..self.timeline.rows.len()).filter(is_shown).flat_map(with_parts).collect()
    }

    /// If times snap: the nearest marker, beat, edge of a bar, end of the scene or playhead within `max_distance` of a dragged time,
    /// all in seconds. `excluded`: the dragged bar.
    pub(crate) fn snap_target(&self, secs: f64, max_distance: f64, excluded: Option<&Bar>) -> Option<f64> {
        let is_other = |bar: &&Bar| {
            excluded.is_none_or(|excluded| excluded.what != bar.what || excluded.start != bar.start)
        };
        let edges = self.bars().filter(is_other).flat_map(|bar| [bar.start, bar.draggable_end, bar.end]);
        let markers = self.timeline.markers.iter().map(|(_, at)| *at);
        let all = edges.chain(markers).chain([self.playhead.time(), self.timeline.length]).map(Time::as_secs);
        let all = all.chain(self.tempo.nearest_beat(secs));
        let near = all.filter(|at| self.snap && (at - secs).abs() <= max_distance);
        near.min_by(|a, b| (a - secs).abs().total_cmp(&(b - secs).abs()))
    }

    /// A dragged time within the scene, rounded to a whole frame if times snap.
    pub fn snapped(&self, secs: f64) -> f64 {
        let fps = self.playhead.fps().as_fps();
        let secs = if self.snap { (secs * fps).round() / fps } else { secs };
        secs.clamp(0.0, self.playhead.length().as_secs())
    }
}

/// Adds the messages that are not in the list yet.
pub(crate) fn add_messages(problems: &mut Vec<Problem>, messages: &[Problem]) {
    let new: Vec<Problem> = messages.iter().filter(|message| !problems.contains(message)).cloned().collect();
    problems.extend(new);
}

/// Overrides of one view: the common ones and its grid. Saved images have neither grid nor outline.
fn view_overrides(all: &ViewOverrides, view: &View, saved: bool) -> ViewOverrides {
    match saved {
        true => ViewOverrides { outlined: None, ..all.clone() },
        false => ViewOverrides { grid: view.overlays.grid, ..all.clone() },
    }
}
