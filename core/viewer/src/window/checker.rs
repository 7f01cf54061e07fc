//! The messages of `choreo check` about the newest version, found on a thread of its own that comes after the window's.

use super::priority;
use crate::commands::check;
use choreo_session::{Problem, Scene, SceneSource};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub(super) struct Checker {
    /// One thread, which shares no work with those that draw. Where it cannot be started, the messages are those of the run.
    thread: Option<ThreadPool>,
    /// Number of the scene that is wanted; an earlier one is given up.
    wanted: Arc<AtomicU64>,
}

impl Checker {
    pub fn new() -> Checker {
        let thread = ThreadPoolBuilder::new().num_threads(1).thread_name(|_| "check".into());
        let thread = thread.start_handler(|_| priority::lower()).build().ok();
        Checker { thread, wanted: Arc::default() }
    }

    /// Gives up what is being examined.
    pub fn cancel(&self) -> u64 {
        self.wanted.fetch_add(1, Ordering::SeqCst) + 1
    }

    /// Examines a scene in place of the one before; `report` is called on its thread, unless another is wanted meanwhile.
    pub fn start(
        &self,
        scene: Arc<Scene>,
        source: SceneSource,
        report: impl FnOnce(Vec<Problem>) + Send + 'static,
    ) {
        let (number, wanted) = (self.cancel(), self.wanted.clone());
        let Some(thread) = &self.thread else { return };
        thread.spawn(move || {
            let goes_on = || wanted.load(Ordering::SeqCst) == number;
            // A plugin that fails has said so on its thread, and leaves the scene without these messages.
            let found = catch_unwind(AssertUnwindSafe(|| check::messages(&scene, &source, &goes_on)));
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
