//! A session on a thread of its own.

use crate::{SceneSource, SceneVersion, Session, Waker, WatchError, WatchEvent};
use choreo_plugin::Registry;
use choreo_script::Imports;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// While it lives, every version of the scene is reported as soon as it is built.
pub struct SessionThread {
    waker: Waker,
    imports: Imports,
    ended: Arc<AtomicBool>,
    worker: Option<JoinHandle<()>>,
}

impl SessionThread {
    /// `report` is called on the worker's thread, first with the first version. Once the system no longer reports changes it is
    /// called no more.
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

    /// How far files are that are being read.
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
            // A panic was reported on its thread.
            let _ = worker.join();
        }
    }
}
