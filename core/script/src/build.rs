//! The stage while the script runs, as drafts. References and times are resolved at the end.

use crate::api_error::{ApiError, Place};
use crate::def::Defs;
use crate::diagnostic::{Diagnostic, Severity, allows};
use crate::folders::{FoundFile, LoadError};
use crate::import::Import;
use crate::limits::{Limits, raise_hint};
use crate::load::Load;
use crate::loader::{Loader, PlayedClips};
use crate::test_data::{TestState, Timeout};
use crate::walk::Walk;
use choreo_asset::Asset;
use choreo_motion::{Clip, Curve, RootParts, Time};
use choreo_stage::{
    Actor, Camera, CameraLook, Channel, Cue, Cut, EffectUse, Layer2d, LayerMode, Parenting, Placement,
    Repeat, Rig, Settings, Sky, StageLight, Target,
};
use glam::{DQuat, DVec3};
#[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
use rhai::{FnPtr, NativeCallContextStore};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::time::{Duration, Instant};

/// State that all API calls of one script share: the stage under construction, its loader and its diagnostics.
pub(crate) struct ScriptContext {
    /// The stage under construction.
    pub stage_draft: Mutex<StageDraft>,
    pub defs: &'static Defs,
    pub loader: Arc<Loader>,
    /// Places of `load` calls whose file is used for its clips only.
    pub clips_only: Mutex<BTreeSet<Place>>,
    /// Importers decode only the clips that the script names.
    pub played_clips_only: bool,
    /// The clips that importers decode; all clips while it is unset.
    pub played_clips: OnceLock<PlayedClips>,
    pub limits: Limits,
    /// Names and values of parameters given with `--set`, in order.
    pub set_parameters: Vec<(String, String)>,
    /// Unsaved texts of scripts in an editor, by canonical path.
    pub unsaved_texts: Arc<BTreeMap<PathBuf, Arc<str>>>,
    /// Text of the script and its modules by the name shown in messages.
    pub sources: Mutex<BTreeMap<String, Arc<str>>>,
    /// Functions that the script defines, with their number of arguments.
    pub functions: Mutex<Arc<Vec<(String, usize)>>>,
    /// Unknown variables of the script and its modules that have been reported.
    pub reported_variables: Mutex<BTreeSet<String>>,
    /// Line and column of the token read last.
    pub last_token: Mutex<(usize, usize)>,
    /// Time at which the script must end; `None` while it does not run. The time that loading files takes is added to it.
    pub deadline: Mutex<Option<Instant>>,
    /// Set once the engine is made. Callbacks and formulas, which run later, keep the engine alive.
    pub engine: Mutex<Weak<rhai::Engine>>,
    pub mode: RunMode,
    /// Time limit of the test section that is being run, which includes loading files.
    pub timeout: Option<Timeout>,
    pub test: Mutex<TestState>,
}

/// The task of a run of the script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RunMode {
    /// The stage of the script. Test sections are not run.
    Stage,
    /// The list of test sections.
    ListTests,
    /// The run of the test section with this index.
    RunTest(usize),
}

impl ScriptContext {
    /// Name of the time limit that the script has exceeded, if any.
    pub(crate) fn exceeded_time_limit(&self) -> Option<&'static str> {
        if self.timeout.is_some_and(|timeout| timeout.check().is_err()) {
            return Some("timeout");
        }
        let deadline = *self.deadline.lock().unwrap_or_else(PoisonError::into_inner);
        deadline.is_some_and(|d| Instant::now() > d).then_some("seconds")
    }

    pub(crate) fn test(&self) -> MutexGuard<'_, TestState> {
        self.test.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A line of the script or a module by its number from 1; empty if there is no such line.
    pub(crate) fn source_line(&self, file: &str, line: usize) -> String {
        let sources = self.sources.lock().unwrap_or_else(PoisonError::into_inner);
        let text = sources.get(file).cloned();
        text.and_then(|t| t.lines().nth(line.checked_sub(1)?).map(str::to_string)).unwrap_or_default()
    }

    /// Whether a comment `// allow: RULE` on the line of a place or on the line above silences a rule.
    fn is_rule_allowed(&self, place: &Place, rule: &str) -> bool {
        let lines = [place.line, place.line.saturating_sub(1)];
        lines.into_iter().any(|line| allows(&self.source_line(&place.file, line), rule))
    }

    /// A diagnostic at a place. The column is that of the string literal at fault, if the line contains it.
    pub(crate) fn diagnose(&self, severity: Severity, place: &Place, error: &ApiError) -> Diagnostic {
        let source_line = self.source_line(&place.file, place.line);
        let mut column = place.column;
        if let Some(focus) = error.focus.as_ref().filter(|f| !f.is_empty()) {
            let from: usize = source_line.chars().take(column.saturating_sub(1)).map(char::len_utf8).sum();
            let rest = source_line.get(from..).unwrap_or("");
            let quoted = format!("\"{focus}\"");
            let at = rest.find(&quoted).or_else(|| find_word(rest, focus));
            if let Some(at) = at {
                column += rest[..at].chars().count();
            }
        }
        Diagnostic {
            severity,
            rule: error.rule,
            file: place.file.clone(),
            line: place.line,
            column,
            source_line,
            message: error.message.clone(),
            hint: error.hint.clone(),
        }
    }

    /// Adds a diagnostic, unless its error is silent or a comment in the script allows its rule.
    pub(crate) fn add_diagnostic(&self, severity: Severity, place: &Place, error: &ApiError) {
        self.add_diagnostic_at(None, severity, place, error);
    }

    /// Adds a diagnostic. `order`: its sort key among the messages of the script; `None`: the current one.
    fn add_diagnostic_at(&self, order: Option<u64>, severity: Severity, place: &Place, error: &ApiError) {
        if error.silent || error.message.contains(crate::value::POISON) {
            return;
        }
        let diagnostic = self.diagnose(severity, place, error);
        if !error.rule.is_empty() && self.is_rule_allowed(place, error.rule) {
            return;
        }
        let mut stage_draft = self.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
        let order = order.unwrap_or(stage_draft.current_order);
        stage_draft.add_diagnostic_at(order, diagnostic);
    }

    /// Finds, before a script runs, the `load` calls whose file is used for its clips only, and remembers them.
    pub(crate) fn add_loads_of_clips_only(&self, ast: &rhai::AST, source: &str) {
        let found = crate::clips_only::find_loads_of_clips_only(ast, source);
        self.clips_only.lock().unwrap_or_else(PoisonError::into_inner).extend(found);
    }

    /// Waits for all files that are being loaded, so that errors of unused files are reported, too.
    pub(crate) fn wait_for_loads(&self) {
        let loads: Vec<Arc<Load>> = {
            let stage_draft = self.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
            stage_draft.loads.iter().map(|l| l.load.clone()).collect()
        };
        for load in loads {
            // `asset` reports a failure.
            let _ = self.asset(&load);
        }
    }

    /// Waits for the asset of a `load` call. A failed import is reported once, at the place of that call; calls that use the
    /// asset get a silent error.
    pub(crate) fn asset(&self, load: &Load) -> Result<Arc<Asset>, ApiError> {
        // Time spent loading is added to the script's deadline. Failed and finished loads add none, because a script could
        // request them without end.
        let before = Instant::now();
        let result = load.wait();
        let taken = before.elapsed();
        if let Some(deadline) = self.deadline.lock().unwrap_or_else(PoisonError::into_inner).as_mut()
            && result.is_ok()
            && taken > Duration::from_millis(1)
        {
            *deadline += taken;
        }
        result.map_err(|reason| {
            if let Some(reason) = reason {
                let error = ApiError::from(reason).focus(load.name.clone());
                self.add_diagnostic_at(Some(load.order), Severity::Error, &load.at, &error);
            }
            ApiError::silent()
        })
    }

    /// Finds a file in the script's folder or in a search path.
    pub(crate) fn find_file(&self, name: &str) -> Result<FoundFile, LoadError> {
        let start = self.test().scene.as_ref().map(|scene| scene.folder.clone());
        self.loader.find_in(self.loader.folders(), start.as_deref(), name)
    }

    /// Reads a file of the script's folder or of a search path, and records it for hot reload.
    pub(crate) fn read_file(&self, name: &str) -> Result<Vec<u8>, ApiError> {
        let read = || {
            let found = self.find_file(name)?;
            let bytes = self.loader.folders().read(&found, name)?;
            self.loader.record_file_read(&found.path, &bytes);
            Ok(bytes)
        };
        read().map_err(|e: LoadError| ApiError::from(e).focus(name))
    }
}

/// Byte offset of the first whole word `word` in `text`, such as a key of an object map.
fn find_word(text: &str, word: &str) -> Option<usize> {
    let is_word_char = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word).map(|(i, _)| i).find(|i| {
        !text[..*i].chars().next_back().is_some_and(is_word_char)
            && !text[i + word.len()..].chars().next().is_some_and(is_word_char)
    })
}

/// The stage while a script builds it: drafts of its objects, with the places of the calls that made them.
#[derive(Default)]
pub(crate) struct StageDraft {
    pub settings: Settings,
    /// Place of the call of `stage(…)`.
    pub settings_at: Option<Place>,
    /// Place of the first call of `f(frame)`, the number of calls, and the frame number and time (seconds) of the last one.
    pub frame_calls: Option<(Place, u64, f64, f64)>,
    pub actors: Vec<ActorDraft>,
    pub chains: Vec<Chain>,
    pub cues: Vec<CueDraft>,
    pub cameras: Vec<CameraDraft>,
    pub cuts: Vec<(Cut, Place)>,
    pub lights: Vec<StageLight>,
    pub light_places: Vec<Place>,
    pub layers_2d: Vec<Layer2d>,
    /// Calls of `fade_in` and `fade_out`.
    pub fades: Vec<FadeDraft>,
    pub sky: Option<Sky>,
    /// Place of the call of `sky(…)`.
    pub sky_at: Option<Place>,
    /// The script sets the ambient light by `ambient(…)` or an option of `stage`.
    pub sets_ambient: bool,
    /// Place of the call of `ambient(…)` in effect; `None` if an option of `stage` sets the ambient light.
    pub ambient_at: Option<Place>,
    pub effects: Vec<EffectUse>,
    pub effect_places: Vec<Place>,
    pub layer_2d_places: Vec<Place>,
    pub loads: Vec<LoadDraft>,
    /// Variables of the script that nothing reads.
    pub unused_variables: Vec<UnusedVariable>,
    pub frame_callbacks: Vec<FrameCallbackDraft>,
    /// Number of keyframes that calls of `key` have set.
    pub keyframe_count: u64,
    /// Number of keyframes in the clips that the script has made.
    pub clip_keyframe_count: u64,
    pub parameters: Vec<Parameter>,
    pub printed: Vec<String>,
    pub printed_bytes: u64,
    /// Number of printed lines beyond the limit.
    pub lines_beyond_limit: u64,
    pub diagnostics: Vec<Diagnostic>,
    /// Sort key of each diagnostic, ascending: a failed import is reported where it was begun, although it fails later.
    diagnostic_orders: Vec<u64>,
    /// Sort key of diagnostics that are added now.
    pub current_order: u64,
    /// Number of diagnostics beyond the limit.
    pub diagnostics_beyond_limit: usize,
    /// Clips bound to another skeleton, by the addresses of clip and asset.
    pub bound_clips: BTreeMap<(usize, usize), BoundClip>,
    /// Built-in shapes that the script has made, by kind and options.
    pub shapes: BTreeMap<String, Arc<Asset>>,
    pub procedural_totals: ProceduralTotals,
    /// Stage time at which the current `perform` sequence starts; times in calls are relative to it.
    pub sequence_start: Time,
    /// The script's annotations of clips, by the address of the clip, which is kept alive.
    pub clip_notes: BTreeMap<usize, ClipNotes>,
    /// Named times of the stage.
    pub markers: Vec<(String, Time)>,
}

/// The script's annotations of a clip.
pub(crate) struct ClipNotes {
    pub _clip: Arc<Clip>,
    /// Named times of the clip, seconds.
    pub markers: Vec<(String, Time)>,
    /// Times at which feet touch down, if the script states them with `clip.steps`.
    pub footstep_times: Option<Vec<Time>>,
}

/// Root motion options of the script.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct RootMotionDraft {
    pub joint: Option<u32>,
    pub parts: RootParts,
    pub used: RootMotionUse,
}

/// Effect of the root motion of a clip.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum RootMotionUse {
    /// The root motion is removed from the pose and moves the actor.
    MovesActor,
    /// The root motion is removed from the pose, and the actor stays in place.
    InPlace,
}

/// The result of a `load` or `shape` call.
pub(crate) struct LoadDraft {
    pub load: Arc<Load>,
    /// The asset is procedural: no file was read.
    pub is_procedural: bool,
    /// Only the clips are imported, because the script uses nothing else of the file.
    pub clips_only: bool,
    /// The script casts the asset, plays one of its clips or queries its contents.
    pub is_used: bool,
}

/// Numbers of procedural meshes, vertices and texels made so far, which are compared with limits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ProceduralTotals {
    pub meshes: usize,
    pub vertices: u64,
    pub texels: u64,
}

/// A variable of the script that nothing reads.
pub(crate) struct UnusedVariable {
    pub name: String,
    pub at: Place,
}

/// An `on_frame` callback.
#[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
pub(crate) struct FrameCallbackDraft {
    pub callback: FnPtr,
    pub native_context: NativeCallContextStore,
    pub at: Place,
}

/// A bound clip. Its source clip and asset are kept alive, so that their addresses, the key, stay valid.
pub(crate) struct BoundClip {
    pub clip: Arc<Clip>,
    pub _from: Arc<Clip>,
    pub _onto: Arc<Asset>,
}

/// A parameter that the script declares with `param(…)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pub name: String,
    /// "int", "float", "bool", "text" or "numbers".
    pub kind: &'static str,
    pub default: String,
    pub value: String,
    pub about: String,
    pub line: usize,
}

pub(crate) struct ActorDraft {
    pub actor: Actor,
    pub at: Place,
    /// The script places the actor by `.at`, `.attach` or a keyframe.
    pub is_placed: bool,
    /// Places of the calls of `actor.look_at`.
    pub look_at_places: Vec<Place>,
    /// Places of the calls that made the first constraints of the actor. Further constraints are added when the stage is resolved.
    pub constraint_places: Vec<Place>,
    /// Root motion of its clips on the base layer.
    pub root: Option<RootMotionDraft>,
    /// Keyframes of joints, added on top of the clips.
    pub joint_keys: Vec<(Curve, Place)>,
    /// Calls of `walk_to`, in order.
    pub walks: Vec<Walk>,
    /// Parents in the order of the calls.
    pub parents: Vec<ParentDraft>,
    /// Point that the actor faces. The rotation is computed at the end of the script, when the position is known.
    pub face_point: Option<DVec3>,
    /// Mesh instances that are not drawn.
    pub hidden_parts: BTreeSet<u32>,
}

/// A fade of the whole image from a color or to it.
#[derive(Clone, Copy)]
pub(crate) struct FadeDraft {
    /// Index of its panel among the 2D layers.
    pub layer: usize,
    /// True for a fade to the color, false for a fade from the color.
    pub fades_out: bool,
    /// Start of a fade from the color, end of a fade to it.
    pub at: Time,
}

/// A call of `attach` or `detach`.
pub(crate) struct ParentDraft {
    pub parent: Parenting,
    pub until: Option<Time>,
    pub at: Place,
}

impl ActorDraft {
    /// Returns an error if `walk_to` sets the position and rotation of the actor, which it does for the whole stage.
    pub(crate) fn check_not_walking(&self, what: &str) -> Result<(), ApiError> {
        let Some(walk) = self.walks.last() else { return Ok(()) };
        let after = walk.turned_until.as_secs();
        Err(ApiError::new(format!("{what}: walk_to sets position and rotation of the actor already")).hint(format!(
            "place it before walk_to; to turn to somebody on arrival, walk_to(point, #{{ face: other }}); else change it for each frame: \
             on_frame(|t| if t > {after:.2} {{ actor.turn(90.0) }})"
        )))
    }

    /// The placement that `.at`, `.move_by`, `.turn` and `.rotate` change: in the last parent with a start time, else the actor's
    /// own.
    pub(crate) fn placement_mut(&mut self) -> &mut Placement {
        match self.parents.last_mut().map(|draft| &mut draft.parent) {
            Some(parent) if parent.start > Time::MIN && parent.to.is_some() => {
                parent.keep = false;
                parent.placement.get_or_insert_default()
            }
            _ => &mut self.actor.transform,
        }
    }
}

/// The cues of a `play` call and of the `then` calls that follow it.
pub(crate) struct Chain {
    pub actor: usize,
    /// Weight of each joint, 0 to 1; `None`: no mask.
    pub mask: Option<Vec<f32>>,
    pub mode: LayerMode,
    pub priority: Option<u32>,
    /// Weight of the layer as a whole.
    pub weight_keys: Option<Arc<Channel>>,
}

impl Chain {
    pub(crate) fn new(actor: usize) -> Chain {
        Chain { actor, mask: None, mode: LayerMode::Override, priority: None, weight_keys: None }
    }

    /// Whether the chain is a layer above the base layer.
    pub(crate) fn is_layer(&self) -> bool {
        self.mask.is_some() || self.mode != LayerMode::Override || self.priority.is_some()
    }
}

/// A cue with the options that the script has set so far.
#[derive(Clone)]
pub(crate) struct CueDraft {
    /// The cue's options as the stage stores them; its speed is above 0.
    pub cue: Cue,
    pub chain: usize,
    pub at: Place,
    /// Index of the cue before this one in the chain.
    pub predecessor: Option<usize>,
    pub start: Option<Time>,
    pub until: Option<Time>,
    pub fade_out: Option<Time>,
    pub reverse: bool,
    pub trim: Option<(Time, Time)>,
    pub repeat: Option<Repeat>,
    /// Stage time at which the local time of the cue is 0.
    pub origin: Time,
    /// Holds the last pose after playing once, also on a layer.
    pub holds_last_pose: bool,
    /// Phase matching with the preceding cue during the crossfade.
    pub in_step: bool,
    pub root: Option<RootMotionDraft>,
    /// Another cue follows in the chain, so this one plays once unless it has its own repeat mode.
    pub has_successor: bool,
}

impl CueDraft {
    /// A cue of a chain with default options.
    pub(crate) fn new(chain: usize, clip: Arc<Clip>, at: Place) -> CueDraft {
        CueDraft {
            cue: Cue::new(clip),
            chain,
            at,
            predecessor: None,
            start: None,
            until: None,
            fade_out: None,
            reverse: false,
            trim: None,
            repeat: None,
            origin: Time::ZERO,
            holds_last_pose: false,
            in_step: false,
            root: None,
            has_successor: false,
        }
    }

    /// Whether the weight is above 0 at any time.
    pub(crate) fn has_weight(&self) -> bool {
        match &self.cue.weight_keys {
            Some(keys) => keys.values.iter().any(|v| *v > 0.0),
            None => self.cue.weight > 0.0,
        }
    }
}

/// A camera while the script runs. Its rig and projection are derived from the fields below when the stage is resolved;
/// everything else is in `camera`.
pub(crate) struct CameraDraft {
    pub camera: Camera,
    pub at: Place,
    pub perspective: Option<f32>,
    pub ortho: Option<f32>,
    pub near: Option<f32>,
    pub far: Option<f32>,
    pub rig: Option<Rig>,
    pub position: Option<DVec3>,
    pub rotation: DQuat,
    pub look_at: Option<Target>,
    /// Calls of `look_at` with a start time, and their end times.
    pub looks: Vec<(CameraLook, Option<Time>)>,
}

impl StageDraft {
    /// The script's annotations of a clip, or of the clip that it was bound from.
    pub(crate) fn clip_notes_of(&self, clip: &Arc<Clip>) -> Option<&ClipNotes> {
        let key = |clip: &Arc<Clip>| Arc::as_ptr(clip) as usize;
        let from = || self.bound_clips.values().find(|bound| Arc::ptr_eq(&bound.clip, clip));
        self.clip_notes.get(&key(clip)).or_else(|| self.clip_notes.get(&key(&from()?._from)))
    }

    /// Keeps a printed line. Lines beyond the limit (in bytes) are only counted.
    pub(crate) fn print(&mut self, line: &str, limit: u64) {
        let bytes = line.len() as u64 + 1;
        if self.lines_beyond_limit > 0 || self.printed_bytes + bytes > limit {
            self.lines_beyond_limit += 1;
            return;
        }
        self.printed_bytes += bytes;
        self.printed.push(crate::diagnostic::printable(line));
    }

    /// The printed lines. A last line states how many were left out.
    pub(crate) fn take_printed(&mut self, limit: u64) -> Vec<String> {
        let mut lines = std::mem::take(&mut self.printed);
        if self.lines_beyond_limit > 0 {
            let hint = raise_hint("printed", format!("{limit} bytes"));
            lines.push(format!("… and {} printed lines more; {hint}", self.lines_beyond_limit));
        }
        lines
    }

    /// Adds a diagnostic, unless an equal one has been added. Diagnostics beyond the limit are only counted.
    pub(crate) fn add_diagnostic(&mut self, diagnostic: Diagnostic) {
        self.add_diagnostic_at(self.current_order, diagnostic);
    }

    fn add_diagnostic_at(&mut self, order: u64, diagnostic: Diagnostic) {
        const MOST: usize = 50;
        if self.diagnostics.contains(&diagnostic) {
            return;
        }
        if self.diagnostics.len() >= MOST {
            self.diagnostics_beyond_limit += 1;
            return;
        }
        let at = self.diagnostic_orders.partition_point(|o| *o <= order);
        self.diagnostic_orders.insert(at, order);
        self.diagnostics.insert(at, diagnostic);
    }

    /// The error that states how many diagnostics are beyond the limit, if any.
    pub(crate) fn error_about_limit(&self) -> Option<Diagnostic> {
        let count = self.diagnostics_beyond_limit;
        let noun = if count == 1 { "message" } else { "messages" };
        (count > 0).then(|| Diagnostic::error(format!("and {count} more {noun}")))
    }

    pub(crate) fn has_errors(&self) -> bool {
        self.diagnostics.iter().any(|d| d.severity == Severity::Error)
    }

    /// The load of a procedural asset. A call at the same place that made the same asset before shares its load.
    pub(crate) fn add_procedural_load(&mut self, asset: &Arc<Asset>, at: &Place) -> Arc<Load> {
        // A loop makes the same asset many times at one place.
        let known =
            |l: &&LoadDraft| l.load.at == *at && l.load.ready().is_some_and(|a| Arc::ptr_eq(a, asset));
        if let Some(known) = self.loads.iter().find(known) {
            return known.load.clone();
        }
        let load = Arc::new(Load::procedural(asset, at));
        self.loads.push(LoadDraft {
            load: load.clone(),
            is_procedural: true,
            clips_only: false,
            is_used: false,
        });
        load
    }

    /// The load of a file that is being imported. A call at the same place that loaded the file before shares its load.
    pub(crate) fn add_import_load(&mut self, import: Arc<Import>, at: &Place, clips_only: bool) -> Arc<Load> {
        let known = |l: &&LoadDraft| l.load.at == *at && l.load.is_of(&import);
        if let Some(known) = self.loads.iter().find(known) {
            return known.load.clone();
        }
        // The load gets a sort key before all diagnostics that are added from now on.
        self.current_order += 2;
        let load = Arc::new(Load::importing(import, at, self.current_order - 1));
        self.loads.push(LoadDraft { load: load.clone(), is_procedural: false, clips_only, is_used: false });
        load
    }

    /// Marks all loads of an asset as used.
    pub(crate) fn mark_used(&mut self, asset: &Arc<Asset>) {
        let is_of_asset = |l: &&mut LoadDraft| l.load.ready().is_some_and(|a| Arc::ptr_eq(a, asset));
        self.loads.iter_mut().filter(is_of_asset).for_each(|l| l.is_used = true);
    }

    /// The draft of the actor with this index.
    pub(crate) fn actor(&mut self, id: usize) -> Result<&mut ActorDraft, ApiError> {
        // Handles of another stage should not get here. The index is checked all the same, so that nothing can panic.
        self.actors.get_mut(id).ok_or_else(|| ApiError::new("this actor is not on this stage"))
    }

    pub(crate) fn cue(&mut self, id: usize) -> Result<&mut CueDraft, ApiError> {
        self.cues.get_mut(id).ok_or_else(|| ApiError::new("this cue is not on this stage"))
    }

    pub(crate) fn camera(&mut self, id: usize) -> Result<&mut CameraDraft, ApiError> {
        self.cameras.get_mut(id).ok_or_else(|| ApiError::new("this camera is not on this stage"))
    }

    pub(crate) fn light(&mut self, id: usize) -> Result<&mut StageLight, ApiError> {
        self.lights.get_mut(id).ok_or_else(|| ApiError::new("this light is not on this stage"))
    }

    pub(crate) fn layer_2d(&mut self, id: usize) -> Result<&mut Layer2d, ApiError> {
        self.layers_2d.get_mut(id).ok_or_else(|| ApiError::new("this 2D layer is not on this stage"))
    }

    pub(crate) fn sky(&mut self) -> Result<&mut Sky, ApiError> {
        self.sky.as_mut().ok_or_else(|| ApiError::new("this sky is not on this stage"))
    }

    pub(crate) fn effect(&mut self, id: usize) -> Result<&mut EffectUse, ApiError> {
        self.effects.get_mut(id).ok_or_else(|| ApiError::new("this effect is not on this stage"))
    }
}

/// Returns an error if `count` objects of the kind `what` already reach the limit.
pub(crate) fn check_limit(count: usize, what: &str, limits: &Limits) -> Result<(), ApiError> {
    let (name, limit) = match what {
        "actors" => ("actors", limits.actors),
        "cameras" => ("cameras", limits.cameras),
        "lights" => ("lights", limits.lights),
        "cues" => ("cues", limits.cues),
        "effects" => ("effects", limits.effects),
        "on_frame callbacks" => ("callbacks", limits.callbacks),
        _ => ("things", limits.things),
    };
    if (count as u64) < limit {
        return Ok(());
    }
    let error = ApiError::new(format!("too many {what}: this would be number {}", count + 1))
        .hint(raise_hint(name, limit));
    Err(ApiError { fatal: true, ..error })
}
