//! Start of the program's threads, with a clear message if the system refuses them: rayon panics if its first use finds no threads.

use crate::failure::Failure;
use rayon::{ThreadBuilder, ThreadPoolBuilder};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

/// Stack in bytes of the thread that runs the script.
const SCRIPT_STACK_BYTES: usize = 64 << 20;
/// Threads that a command starts after the pool: the script's, one that plans frames, one that encodes them, and two that watch the memory.
const RESERVED_THREADS: usize = 5;
/// Threads that a Vulkan driver starts in addition to one per core.
const DRIVER_THREADS: usize = 4;
static THREADS_FOR_A_DRIVER: OnceLock<bool> = OnceLock::new();

/// Number of threads that run at the same time on this machine.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Starts the threads of the pool for all parallel work: `requested`, or as many as the system allows. Room is left for the threads that are
/// started later.
pub(crate) fn start_pool(requested: Option<usize>) -> Result<(), Failure> {
    let requested = requested.unwrap_or_else(cores).max(1);
    let held: Vec<HeldThread> = (0..RESERVED_THREADS)
        .map_while(|i| hold_thread(if i == 0 { SCRIPT_STACK_BYTES } else { 2 << 20 }))
        .collect();
    let mut workers: Vec<Sender<ThreadBuilder>> =
        (0..requested).map_while(|_| start_rayon_worker()).collect();
    let started = held.len() + workers.len();
    // Tested while no other threads start, because they would be refused during the test.
    let driver: Vec<HeldThread> = (0..cores() + DRIVER_THREADS).map_while(|_| hold_thread(2 << 20)).collect();
    let _ = THREADS_FOR_A_DRIVER.set(driver.len() == cores() + DRIVER_THREADS);
    for (end, thread) in held.into_iter().chain(driver) {
        drop(end);
        // The thread cannot panic. It is joined because the system counts it until it has ended.
        let _ = thread.join();
    }
    if started <= RESERVED_THREADS {
        return Err(too_few_threads(&format!(
            "{started} threads can be started and {} are needed",
            RESERVED_THREADS + 1
        )));
    }
    let pool = ThreadPoolBuilder::new().num_threads(workers.len()).spawn_handler(|thread| {
        let sent = workers.pop().map(|to| to.send(thread));
        sent.and_then(Result::ok).ok_or_else(|| std::io::Error::other("a thread has ended"))
    });
    // Fails if a program calls `run` a second time; the pool then exists already.
    let _ = pool.build_global();
    Ok(())
}

/// Whether the system allows the threads and the address space that a Vulkan driver needs. A driver that runs on the CPU waits forever for
/// a thread that it cannot start, and aborts the program if an allocation fails: lavapipe with its compiler needs over 1 GB.
pub(crate) fn enough_threads_for_a_driver() -> bool {
    #[cfg(unix)]
    if rustix::process::getrlimit(rustix::process::Resource::As).current.is_some_and(|bytes| bytes < 2 << 30)
    {
        return false;
    }
    *THREADS_FOR_A_DRIVER.get().unwrap_or(&true)
}

/// Starts a thread that does nothing until the sender is dropped.
fn hold_thread(stack: usize) -> Option<HeldThread> {
    let (end, ended): (_, Receiver<()>) = channel();
    let thread =
        std::thread::Builder::new().stack_size(stack).spawn(move || ended.recv().unwrap_or_default());
    thread.ok().map(|thread| (end, thread))
}

type HeldThread = (Sender<()>, JoinHandle<()>);

/// Starts a thread that becomes a worker of rayon's pool when it receives its builder.
fn start_rayon_worker() -> Option<Sender<ThreadBuilder>> {
    let (to, work) = channel::<ThreadBuilder>();
    let run = move || work.recv().into_iter().for_each(ThreadBuilder::run);
    let thread = std::thread::Builder::new().name("worker".into()).spawn(run);
    thread.ok().map(|_| to)
}

/// Failure for too few threads, or too little memory for their stacks. `what`: the need that was not met.
pub(crate) fn too_few_threads(what: &str) -> Failure {
    Failure::Machine(format!(
        "too few threads: {what}\n    hint: end other programs, or raise the limits of processes and of address space (ulimit -u, ulimit -v)"
    ))
}
