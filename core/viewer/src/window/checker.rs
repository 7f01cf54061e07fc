//! Runs `choreo check` on the newest scene, on a low-priority thread.

use super::priority;
use crate::commands::check;
use choreo_session::{Problem, Scene, SceneSource};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub(super) struct Checker {
    /// Pool of one thread, separate from the drawing threads. `None` if it cannot be started; then only the problems of the script's run are
    /// reported.
    thread: Option<ThreadPool>,
    /// Number of the newest check; earlier ones are abandoned.
    wanted: Arc<AtomicU64>,
}

impl Checker {
    pub(super) fn new() -> Checker {
        let thread = ThreadPoolBuilder::new().num_threads(1).thread_name(|_| "check".into());
        let thread = thread.start_handler(|_| priority::lower_thread()).build().ok();
        Checker { thread, wanted: Arc::default() }
    }

    /// Abandons the current check.
    pub(super) fn cancel(&self) -> u64 {
        self.wanted.fetch_add(1, Ordering::SeqCst) + 1
    }

    /// Checks a scene, and abandons the previous check. `report` is called on the worker thread, unless another check starts meanwhile.
    pub(super) fn start(
        &self,
        scene: Arc<Scene>,
        source: SceneSource,
        report: impl FnOnce(Vec<Problem>) + Send + 'static,
    ) {
        let (number, wanted) = (self.cancel(), self.wanted.clone());
        let Some(thread) = &self.thread else { return };
        thread.spawn(move || {
            let goes_on = || wanted.load(Ordering::SeqCst) == number;
            // A plugin that panics is already reported on its thread; the scene then gets no messages.
            let found = catch_unwind(AssertUnwindSafe(|| check::check_scene(&scene, &source, &goes_on)));
            if let Ok(Some(messages)) = found {
                report(messages);
            }
        });
    }
}

impl Drop for Checker {
    fn drop(&mut self) {
        self.cancel();
    }
}
