//! A session on its own thread.

use crate::{SceneSource, SceneVersion, Session, Waker, WatchError, WatchEvent};
use choreo_plugin::Registry;
use choreo_script::Imports;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Worker thread that reports every version of the scene as soon as it is built. Dropping it ends the thread.
pub struct SessionThread {
    waker: Waker,
    imports: Imports,
    ended: Arc<AtomicBool>,
    worker: Option<JoinHandle<()>>,
}

impl SessionThread {
    /// Starts the thread. `report` is called on that thread, first with the first version. It is not called again if the system stops reporting
    /// changes.
    pub fn start(
        source: SceneSource,
        plugins: &Registry,
        mut report: impl FnMut(SceneVersion) + Send + 'static,
    ) -> Result<SessionThread, WatchError> {
        let mut session = Session::new(source, plugins, true)?;
        let waker = session.waker().ok_or(WatchError::Gone)?;
        let imports = session.imports();
        let ended = Arc::new(AtomicBool::new(false));
        let stop = ended.clone();
        let work = move || {
            report(session.build(BTreeSet::new()));
            while !stop.load(Ordering::SeqCst) {
                match session.wait(None) {
                    Ok(WatchEvent::Changed(files)) => report(session.build(files)),
                    Ok(WatchEvent::Woken | WatchEvent::TimedOut) => {}
                    Err(_) => return,
                }
            }
        };
        let worker = std::thread::Builder::new().name("session".into()).spawn(work);
        let worker = worker.map_err(|e| WatchError::System(notify::Error::io(e)))?;
        Ok(SessionThread { waker, imports, ended, worker: Some(worker) })
    }

    /// Progress of the files that are being imported.
    pub fn imports(&self) -> &Imports {
        &self.imports
    }
}

impl Drop for SessionThread {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::SeqCst);
        self.imports.cancel();
        self.waker.wake();
        if let Some(worker) = self.worker.take() {
            // Panics are already reported on the worker thread.
            let _ = worker.join();
        }
    }
}
