//! Lowers the priority of rendering threads, so that the window's thread answers the mouse while a frame takes a second.

/// Increase of the nice value (`man 7 sched`): next to a busy window thread, such a thread gets a quarter of a core.
#[cfg(target_os = "linux")]
const NICE_INCREMENT: i32 = 5;

/// Lowers the priority of the calling thread and of the thread pool for parallel work.
pub(crate) fn lower_for_background_work() {
    lower_thread();
    #[cfg(target_os = "linux")]
    rayon::broadcast(|_| lower_thread());
}

/// Lowers the priority of the calling thread.
pub(crate) fn lower_thread() {
    // Each thread has its own nice value on Linux. If it cannot be changed, all threads have equal priority.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::nice(NICE_INCREMENT);
}
