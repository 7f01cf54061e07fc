//! Imports on worker threads: a script that loads four files waits for each only when it uses the contents.
//!
//! ```text
//! Loader::start ─► Import (queued) ─► a worker of the pool, or whoever waits for it first ─► Arc<Asset> or LoadError
//!                        ╰─ phase, progress, cancel: for a bar, or for a viewer that goes on meanwhile
//! ```

use crate::folders::LoadError;
use choreo_asset::Asset;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};

/// Handle of a running import, usable on any thread.
pub struct Import {
    name: String,
    state: Mutex<ImportState>,
    changed: Condvar,
    bytes: AtomicU64,
    /// Progress from 0 to 1, as the bits of an f32.
    progress_bits: AtomicU32,
    cancelled: AtomicBool,
    /// The list that this import belongs to, which can cancel all of its imports.
    list: Weak<ImportList>,
}

pub(crate) type Job = Box<dyn FnOnce(&Import) -> Result<Arc<Asset>, LoadError> + Send>;

enum ImportState {
    Queued(Job),
    Running,
    Done(Result<Arc<Asset>, LoadError>),
}

/// Phase of an import.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// No worker has begun the import.
    Queued,
    /// The file is being read and imported.
    Running,
    Done,
    /// The import has failed or was cancelled.
    Failed,
}

impl Import {
    pub(crate) fn new(name: &str, imports: &Imports, job: Job) -> Arc<Import> {
        let import = Arc::new(Import {
            name: name.to_string(),
            state: Mutex::new(ImportState::Queued(job)),
            changed: Condvar::new(),
            bytes: AtomicU64::new(0),
            progress_bits: AtomicU32::new(0),
            cancelled: AtomicBool::new(false),
            list: Arc::downgrade(&imports.0),
        });
        imports.add(&import);
        import
    }

    /// The path as the script wrote it.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn phase(&self) -> Phase {
        match &*self.state() {
            ImportState::Queued(_) => Phase::Queued,
            ImportState::Running => Phase::Running,
            ImportState::Done(Ok(_)) => Phase::Done,
            ImportState::Done(Err(_)) => Phase::Failed,
        }
    }

    /// Size of the file in bytes; 0 until it is known, and for built-in assets.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Progress from 0 to 1, as reported by the importer; 1 once it is done or has failed.
    pub fn progress(&self) -> f32 {
        match self.phase() {
            Phase::Done | Phase::Failed => 1.0,
            _ => f32::from_bits(self.progress_bits.load(Ordering::Relaxed)),
        }
    }

    pub(crate) fn set_bytes(&self, bytes: u64) {
        self.bytes.store(bytes, Ordering::Relaxed);
    }

    /// Raises the progress, 0 to 1. A lower value is ignored, because threads that decode at the same time may report in any
    /// order. (The bits of non-negative floats have the order of the floats.)
    pub(crate) fn raise_progress(&self, progress: f32) {
        self.progress_bits.fetch_max(progress.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }

    /// Cancels the import. A running importer ends at the next file or progress step that it reports.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_cancelled(&self) -> bool {
        let is_list_cancelled =
            || self.list.upgrade().is_some_and(|list| list.cancelled.load(Ordering::Relaxed));
        self.cancelled.load(Ordering::Relaxed) || is_list_cancelled()
    }

    /// The asset or the error; `None` until the import has ended.
    pub fn result(&self) -> Option<Result<Arc<Asset>, LoadError>> {
        match &*self.state() {
            ImportState::Done(result) => Some(result.clone()),
            _ => None,
        }
    }

    /// Waits for the asset. Runs the import on this thread if no worker has begun it.
    ///
    /// # Errors
    /// Returns an error if the file, its importer or its options are at fault, or if the import was cancelled.
    pub fn wait(&self) -> Result<Arc<Asset>, LoadError> {
        self.run();
        let mut state = self.state();
        loop {
            match &*state {
                ImportState::Done(result) => return result.clone(),
                _ => state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    /// Runs the import on this thread if no thread has begun it.
    fn run(&self) {
        let job = {
            let mut state = self.state();
            match std::mem::replace(&mut *state, ImportState::Running) {
                ImportState::Queued(job) => job,
                other => {
                    *state = other;
                    return;
                }
            }
        };
        let result = match self.is_cancelled() {
            true => Err(self.cancelled_error()),
            // A panic becomes an error, so that waiting threads wake up.
            false => catch_unwind(AssertUnwindSafe(|| job(self))).unwrap_or_else(|_| {
                Err(LoadError::new(format!("cannot read \"{}\": its importer has panicked", self.name)))
            }),
        };
        let result = if self.is_cancelled() { Err(self.cancelled_error()) } else { result };
        *self.state() = ImportState::Done(result);
        self.changed.notify_all();
    }

    fn cancelled_error(&self) -> LoadError {
        LoadError::new(format!("cannot read \"{}\": the import was cancelled", self.name))
    }

    fn state(&self) -> MutexGuard<'_, ImportState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// List of imports, shared by clones, to show their progress and to cancel them.
#[derive(Clone, Default)]
pub struct Imports(Arc<ImportList>);

#[derive(Default)]
struct ImportList {
    list: Mutex<Vec<Weak<Import>>>,
    cancelled: AtomicBool,
}

/// Progress of a list of imports.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportProgress {
    pub files: usize,
    pub done: usize,
    /// Bytes of all files whose size is known.
    pub bytes: u64,
    pub bytes_done: u64,
    /// Names of the files being read.
    pub names: Vec<String>,
}

impl Imports {
    /// Adds an import and removes those that no longer exist.
    fn add(&self, import: &Arc<Import>) {
        let mut list = self.0.list.lock().unwrap_or_else(PoisonError::into_inner);
        list.retain(|i| i.strong_count() > 0);
        list.push(Arc::downgrade(import));
    }

    /// All imports in the order in which they were begun.
    pub fn all(&self) -> Vec<Arc<Import>> {
        let list = self.0.list.lock().unwrap_or_else(PoisonError::into_inner);
        list.iter().filter_map(Weak::upgrade).collect()
    }

    /// Sums over all imports of the list.
    pub fn progress(&self) -> ImportProgress {
        let mut sum = ImportProgress::default();
        for import in self.all() {
            let phase = import.phase();
            sum.files += 1;
            sum.done += usize::from(matches!(phase, Phase::Done | Phase::Failed));
            sum.bytes += import.bytes();
            sum.bytes_done += (f64::from(import.progress()) * import.bytes() as f64) as u64;
            if phase == Phase::Running {
                sum.names.push(import.name.clone());
            }
        }
        sum
    }

    /// Cancels all imports, including those added later.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }
}

impl std::fmt::Debug for Imports {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.progress())
    }
}

/// Lists are equal if they are the same one.
impl PartialEq for Imports {
    fn eq(&self, other: &Imports) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// Queue of the imports that wait for a worker, and number of running workers.
struct Pool {
    queue: VecDeque<Arc<Import>>,
    workers: usize,
}

static POOL: Mutex<Pool> = Mutex::new(Pool { queue: VecDeque::new(), workers: 0 });

fn pool() -> MutexGuard<'static, Pool> {
    POOL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Queues an import for the workers of the process: one per core, at least two. Workers end when the queue is empty.
pub(crate) fn submit(import: &Arc<Import>) {
    /// Stack size in bytes, as for the script's own thread: importers recurse into node trees.
    const STACK: usize = 64 << 20;
    // Two workers at least, so that one can read while the other computes.
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).max(2);
    let mut pool = pool();
    pool.queue.push_back(import.clone());
    if pool.workers < cores {
        let worker = std::thread::Builder::new().name("import".into()).stack_size(STACK).spawn(run_worker);
        // If no worker could be started, the waiting thread runs the import.
        pool.workers += usize::from(worker.is_ok());
    }
}

/// Runs queued imports until the queue is empty.
fn run_worker() {
    loop {
        let next = {
            let mut pool = pool();
            match pool.queue.pop_front() {
                Some(next) => next,
                None => {
                    pool.workers -= 1;
                    return;
                }
            }
        };
        next.run();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;
    use std::time::{Duration, Instant};

    fn asset(name: &str) -> Arc<Asset> {
        Arc::new(Asset { name: name.into(), ..Asset::default() })
    }

    #[test]
    fn an_import_runs_once_for_eight_waiting_threads() {
        let (all, runs) = (Imports::default(), Arc::new(AtomicUsize::new(0)));
        let counted = runs.clone();
        let import = Import::new(
            "a",
            &all,
            Box::new(move |import| {
                counted.fetch_add(1, Ordering::Relaxed);
                import.set_bytes(10);
                Ok(asset("a"))
            }),
        );
        assert_eq!((import.phase(), import.result().is_none()), (Phase::Queued, true));
        submit(&import);
        std::thread::scope(|s| {
            for _ in 0..8 {
                s.spawn(|| assert_eq!(import.wait().unwrap().name, "a"));
            }
        });
        assert_eq!((runs.load(Ordering::Relaxed), import.phase(), import.progress()), (1, Phase::Done, 1.0));
        let p = all.progress();
        assert_eq!((p.files, p.done, p.bytes, p.bytes_done), (1, 1, 10, 10));
    }

    #[test]
    fn workers_run_imports_for_which_no_thread_waits() {
        let all = Imports::default();
        let imports: Vec<_> = (0..20).map(|_| Import::new("a", &all, Box::new(|_| Ok(asset("a"))))).collect();
        imports.iter().for_each(submit);
        let end = Instant::now() + Duration::from_secs(300);
        while all.progress().done < 20 {
            assert!(Instant::now() < end, "{:?}", all.progress());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn a_cancelled_import_fails_whether_queued_or_running() {
        let all = Imports::default();
        let never = Import::new("a", &all, Box::new(|_| panic!("a cancelled import has run")));
        never.cancel();
        assert!(never.wait().unwrap_err().message.contains("cancelled"));
        let stopped = Import::new(
            "b",
            &all,
            Box::new(|import| {
                while !import.is_cancelled() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Ok(asset("b"))
            }),
        );
        submit(&stopped);
        all.cancel();
        assert!(stopped.wait().is_err() && stopped.phase() == Phase::Failed);
    }

    #[test]
    fn a_panic_of_an_importer_becomes_an_error() {
        let import = Import::new("a", &Imports::default(), Box::new(|_| panic!("planted")));
        submit(&import);
        assert_eq!(import.wait().unwrap_err().message, "cannot read \"a\": its importer has panicked");
    }
}
