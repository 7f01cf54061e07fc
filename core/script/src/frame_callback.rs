//! `on_frame` callbacks: closures of the script, run as pure functions of time.

use crate::api_error::{ApiError, Place};
use crate::build::{FrameCallbackDraft, ScriptContext};
use crate::diagnostic::Severity;
use crate::errors;
use choreo_motion::Time;
use choreo_stage::{FrameCallback, FrameEdits, StageError};
#[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
use rhai::NativeCallContextStore;
use rhai::{Dynamic, Engine, FnPtr};
use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::time::{Duration, Instant};

thread_local! {
    /// The edits of the callback that runs on this thread. Methods of handles write to them, because the same function is called
    /// while the stage is built and for a frame, and frames are evaluated on many threads.
    static FRAME_EDITS: RefCell<Option<FrameEdits>> = const { RefCell::new(None) };
    /// The budget of the callback that runs on this thread.
    static BUDGET: Cell<Budget> = const { Cell::new(Budget { steps: 0, until: None }) };
}

/// The limits of one callback: its share of the limits of a frame.
#[derive(Clone, Copy)]
struct Budget {
    steps: u64,
    until: Option<Instant>,
}

/// Name of the limit that the callback on this thread has exceeded after `steps` steps, if any.
pub(crate) fn exceeded_limit(steps: u64) -> Option<&'static str> {
    let budget = BUDGET.get();
    if steps > budget.steps {
        return Some("frame_operations");
    }
    // A single step may copy a large array, so the clock is read often.
    let is_late = steps & 0x3f == 0 && budget.until.is_some_and(|until| Instant::now() > until);
    is_late.then_some("frame_seconds")
}

/// Whether a callback runs on this thread.
pub(crate) fn in_frame() -> bool {
    FRAME_EDITS.with_borrow(Option::is_some)
}

/// Changes the edits of the callback that runs on this thread, if any.
pub(crate) fn edit_frame(change: impl FnOnce(&mut FrameEdits)) {
    FRAME_EDITS.with_borrow_mut(|frame| {
        if let Some(edits) = frame {
            change(edits);
        }
    });
}

/// An `on_frame` callback or a function of time, with its place in the script.
#[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
pub(crate) struct ScriptCallback {
    engine: Arc<Engine>,
    callback: FnPtr,
    native_context: NativeCallContextStore,
    at: Place,
    context: Arc<ScriptContext>,
    identity: String,
    /// Number of callbacks of the stage.
    callback_count: u64,
}

impl std::fmt::Debug for ScriptCallback {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ScriptCallback({}:{}:{})", self.at.file, self.at.line, self.at.column)
    }
}

impl ScriptCallback {
    /// A callback. `script`: hash that identifies the script with its parameters and files; `callback_count`: number of callbacks
    /// of the stage, which share the limits of a frame.
    pub(crate) fn new(
        engine: Arc<Engine>,
        context: Arc<ScriptContext>,
        draft: FrameCallbackDraft,
        script: &str,
        callback_count: usize,
    ) -> ScriptCallback {
        let FrameCallbackDraft { callback, native_context, at } = draft;
        // Captured values need no hash of their own, because they follow from the script, whose hash covers everything.
        let identity = format!("{script} {}:{}", at.line, at.column);
        let callback_count = callback_count as u64;
        ScriptCallback { engine, callback, native_context, at, context, identity, callback_count }
    }

    /// Runs the callback, which adds to `edits`.
    fn run_callback(&self, time: Time, edits: &mut FrameEdits) -> Result<(), Box<rhai::EvalAltResult>> {
        #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
        let native_context = self.native_context.create_context(&self.engine);
        BUDGET.set(self.budget());
        FRAME_EDITS.with_borrow_mut(|frame| *frame = Some(std::mem::take(edits)));
        let result = self.callback.call_raw(&native_context, None, [Dynamic::from_float(time.as_secs())]);
        if let Some(new_edits) = FRAME_EDITS.with_borrow_mut(Option::take) {
            *edits = new_edits;
        }
        result.map(|_| ())
    }

    /// Runs the callback and returns its value; the edits are dropped.
    pub(crate) fn value_at(&self, time: Time) -> Result<Dynamic, crate::Diagnostic> {
        #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
        let native_context = self.native_context.create_context(&self.engine);
        BUDGET.set(self.budget());
        // The callback runs as if for a frame: it cannot change the stage, and has the limits of a frame.
        FRAME_EDITS.with_borrow_mut(|frame| *frame = Some(FrameEdits::default()));
        let result = self.callback.call_raw(&native_context, None, [Dynamic::from_float(time.as_secs())]);
        FRAME_EDITS.with_borrow_mut(|frame| *frame = None);
        result.map_err(|e| self.explain_error(&e))
    }

    /// The diagnostic of an error, at the place of the callback.
    pub(crate) fn diagnose(&self, error: &ApiError) -> crate::Diagnostic {
        self.context.diagnose(Severity::Error, &self.at, error)
    }

    /// The limits of a frame divided equally among all callbacks, so that many of them take no longer than one.
    fn budget(&self) -> Budget {
        /// Minimum time of a callback. A busy machine would exceed a shorter time.
        const MIN_TIME: Duration = Duration::from_millis(100);
        let limits = &self.context.limits;
        let count = self.callback_count.max(1);
        let secs = Duration::try_from_secs_f64(limits.frame_seconds / count as f64).unwrap_or(Duration::MAX);
        Budget {
            steps: (limits.frame_operations / count).max(1),
            until: Instant::now().checked_add(secs.max(MIN_TIME)),
        }
    }

    /// Runs the callback at a time, to find its errors; the edits are dropped.
    pub(crate) fn check_at(&self, time: Time) -> Result<(), crate::Diagnostic> {
        self.run_callback(time, &mut FrameEdits::default()).map_err(|e| self.explain_error(&e))
    }

    fn explain_error(&self, error: &rhai::EvalAltResult) -> crate::Diagnostic {
        let (mut place, error) = errors::explain_error(error, &self.at.file, &self.context);
        if place.line == 0 {
            place = self.at.clone();
        }
        self.context.diagnose(Severity::Error, &place, &error)
    }
}

impl FrameCallback for ScriptCallback {
    fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
        let run = self.run_callback(time, edits);
        run.map_err(|e| StageError::Callback { error: Arc::new(self.explain_error(&e)), time })
    }

    fn identity(&self) -> String {
        self.identity.clone()
    }
}

/// The callback with copies of its captured values. A captured variable is shared between calls, so a call that changed it would
/// make the next frame depend on this one.
pub(crate) fn with_copied_captures(callback: &FnPtr) -> Result<FnPtr, ApiError> {
    let mut copy = callback.clone();
    let mut remaining = MAX_CAPTURED_VALUES;
    let captures =
        callback.curry().iter().map(|v| copy_value(v, 0, &mut remaining)).collect::<Result<Vec<_>, _>>()?;
    copy.set_curry(captures);
    Ok(copy)
}

/// Maximum number of values that a callback captures, those in arrays, maps and functions included.
const MAX_CAPTURED_VALUES: usize = 100_000;

/// A copy of a value that shares nothing with it. `remaining`: number of values that may still be copied.
fn copy_value(value: &Dynamic, depth: usize, remaining: &mut usize) -> Result<Dynamic, ApiError> {
    // The copy of a closure that captures its own variable would never end.
    const MAX_DEPTH: usize = 32;
    *remaining = remaining.saturating_sub(1);
    if depth > MAX_DEPTH || *remaining == 0 {
        return Err(ApiError::new("on_frame: the callback captures too much").hint(format!(
            "at most {MAX_CAPTURED_VALUES} values, {MAX_DEPTH} levels deep; does a captured variable contain the callback itself?"
        )));
    }
    let flat = value.flatten_clone();
    if let Some(array) = flat.read_lock::<rhai::Array>() {
        let copy =
            array.iter().map(|v| copy_value(v, depth + 1, remaining)).collect::<Result<rhai::Array, _>>()?;
        return Ok(Dynamic::from_array(copy));
    }
    if let Some(map) = flat.read_lock::<rhai::Map>() {
        let copy: Result<rhai::Map, ApiError> =
            map.iter().map(|(k, v)| Ok((k.clone(), copy_value(v, depth + 1, remaining)?))).collect();
        return Ok(Dynamic::from_map(copy?));
    }
    if let Some(pointer) = flat.read_lock::<FnPtr>() {
        let mut copy = pointer.clone();
        let captures = pointer
            .curry()
            .iter()
            .map(|v| copy_value(v, depth + 1, remaining))
            .collect::<Result<Vec<_>, _>>()?;
        copy.set_curry(captures);
        return Ok(Dynamic::from(copy));
    }
    Ok(flat)
}
