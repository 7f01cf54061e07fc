//! `on_frame` callbacks: closures of the script, run as pure functions of time.

use crate::api_error::{ApiError, Place};
use crate::build::{FrameCallbackDraft, ScriptContext};
use crate::diagnostic::Severity;
use crate::errors;
use choreo_motion::Time;
use choreo_stage::{FrameEdits, FrameHook, StageError};
#[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
use rhai::NativeCallContextStore;
use rhai::{Dynamic, Engine, FnPtr};
use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::time::{Duration, Instant};

thread_local! {
    /// The edits of the callback that runs on this thread. Handle methods find them here, since a method is one
    /// function whether it is called while the stage is built or for a frame, and frames run on many threads.
    static FRAME: RefCell<Option<FrameEdits>> = const { RefCell::new(None) };
    /// The budget of the callback that runs on this thread.
    static SHARE: Cell<Share> = const { Cell::new(Share { steps: 0, until: None }) };
}

/// One callback's share of the limits of a frame.
#[derive(Clone, Copy)]
struct Share {
    steps: u64,
    until: Option<Instant>,
}

/// Name of the limit that the callback on this thread has exceeded after `steps` steps, if any.
pub fn exceeded_limit(steps: u64) -> Option<&'static str> {
    let share = SHARE.get();
    if steps > share.steps {
        return Some("frame_operations");
    }
    // A single step may copy a large array, so the clock is read often.
    let late = steps & 0x3f == 0 && share.until.is_some_and(|until| Instant::now() > until);
    late.then_some("frame_seconds")
}

pub fn in_frame() -> bool {
    FRAME.with_borrow(Option::is_some)
}

/// Notes an edit of the frame being made.
pub fn edit(change: impl FnOnce(&mut FrameEdits)) {
    FRAME.with_borrow_mut(|frame| {
        if let Some(edits) = frame {
            change(edits);
        }
    });
}

/// An `on_frame` callback or a function of time, with its place in the script.
#[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
pub(crate) struct ScriptHook {
    engine: Arc<Engine>,
    callback: FnPtr,
    context: NativeCallContextStore,
    at: Place,
    shared: Arc<ScriptContext>,
    identity: String,
    /// Number of callbacks of the stage.
    all: u64,
}

impl std::fmt::Debug for ScriptHook {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ScriptHook({}:{}:{})", self.at.file, self.at.line, self.at.column)
    }
}

impl ScriptHook {
    /// `script`: hash that identifies the script with its parameters and files.
    pub fn new(
        engine: Arc<Engine>,
        shared: Arc<ScriptContext>,
        draft: FrameCallbackDraft,
        script: &str,
        all: usize,
    ) -> ScriptHook {
        let FrameCallbackDraft { callback, context, at } = draft;
        // Captured values need no hash of their own, because they follow from the script, whose hash covers everything.
        let identity = format!("{script} {}:{}", at.line, at.column);
        ScriptHook { engine, callback, context, at, shared, identity, all: all as u64 }
    }

    /// Runs the callback, which changes `edits`.
    fn call(&self, time: Time, edits: &mut FrameEdits) -> Result<(), Box<rhai::EvalAltResult>> {
        #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
        let context = self.context.create_context(&self.engine);
        SHARE.set(self.share());
        FRAME.with_borrow_mut(|frame| *frame = Some(std::mem::take(edits)));
        let result = self.callback.call_raw(&context, None, [Dynamic::from_float(time.as_secs())]);
        if let Some(after) = FRAME.with_borrow_mut(Option::take) {
            *edits = after;
        }
        result.map(|_| ())
    }

    /// Runs the callback and returns its value; the edits are dropped.
    pub fn value_at(&self, time: Time) -> Result<Dynamic, crate::Diagnostic> {
        #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
        let context = self.context.create_context(&self.engine);
        SHARE.set(self.share());
        // The call runs as if in a frame: it cannot add to the stage, and has the limits of a frame.
        FRAME.with_borrow_mut(|frame| *frame = Some(FrameEdits::default()));
        let result = self.callback.call_raw(&context, None, [Dynamic::from_float(time.as_secs())]);
        FRAME.with_borrow_mut(|frame| *frame = None);
        result.map_err(|e| self.explain(&e))
    }

    pub(crate) fn diagnose(&self, error: &ApiError) -> crate::Diagnostic {
        self.shared.diagnose(Severity::Error, &self.at, error)
    }

    /// The limits of a frame divided equally among all callbacks, so that many of them take no longer than one.
    fn share(&self) -> Share {
        /// Shortest time share: a shorter one would be exceeded on a busy machine.
        const LEAST: Duration = Duration::from_millis(100);
        let limits = &self.shared.limits;
        let all = self.all.max(1);
        let secs = Duration::try_from_secs_f64(limits.frame_seconds / all as f64).unwrap_or(Duration::MAX);
        Share {
            steps: (limits.frame_operations / all).max(1),
            until: Instant::now().checked_add(secs.max(LEAST)),
        }
    }

    pub(crate) fn try_at(&self, time: Time) -> Result<(), crate::Diagnostic> {
        self.call(time, &mut FrameEdits::default()).map_err(|e| self.explain(&e))
    }

    fn explain(&self, error: &rhai::EvalAltResult) -> crate::Diagnostic {
        let (mut place, error) = errors::explain_error(error, &self.at.file, &self.shared);
        if place.line == 0 {
            place = self.at.clone();
        }
        self.shared.diagnose(Severity::Error, &place, &error)
    }
}

impl FrameHook for ScriptHook {
    fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
        self.call(time, edits).map_err(|e| StageError::Hook { error: Arc::new(self.explain(&e)), time })
    }

    fn identity(&self) -> String {
        self.identity.clone()
    }
}

/// The callback with copies of its captured values. A captured variable is shared between calls, so a call that changed it would
/// make the next frame depend on this one.
pub(crate) fn with_copied_captures(callback: &FnPtr) -> Result<FnPtr, ApiError> {
    let mut own = callback.clone();
    let mut left = MOST_CAPTURED;
    let curry =
        callback.curry().iter().map(|v| copy_value(v, 0, &mut left)).collect::<Result<Vec<_>, _>>()?;
    own.set_curry(curry);
    Ok(own)
}

const MOST_CAPTURED: usize = 100_000;

fn copy_value(value: &Dynamic, depth: usize, left: &mut usize) -> Result<Dynamic, ApiError> {
    // A closure that captures the variable that it is stored in would be copied without end.
    const DEEPEST: usize = 32;
    *left = left.saturating_sub(1);
    if depth > DEEPEST || *left == 0 {
        return Err(ApiError::new("on_frame: the callback captures too much").hint(format!(
            "at most {MOST_CAPTURED} values, {DEEPEST} levels deep; does a captured variable hold the callback itself?"
        )));
    }
    let flat = value.flatten_clone();
    if let Some(array) = flat.read_lock::<rhai::Array>() {
        let own = array.iter().map(|v| copy_value(v, depth + 1, left)).collect::<Result<rhai::Array, _>>()?;
        return Ok(Dynamic::from_array(own));
    }
    if let Some(map) = flat.read_lock::<rhai::Map>() {
        let own: Result<rhai::Map, ApiError> =
            map.iter().map(|(k, v)| Ok((k.clone(), copy_value(v, depth + 1, left)?))).collect();
        return Ok(Dynamic::from_map(own?));
    }
    if let Some(pointer) = flat.read_lock::<FnPtr>() {
        let mut own = pointer.clone();
        let curry =
            pointer.curry().iter().map(|v| copy_value(v, depth + 1, left)).collect::<Result<Vec<_>, _>>()?;
        own.set_curry(curry);
        return Ok(Dynamic::from(own));
    }
    Ok(flat)
}
