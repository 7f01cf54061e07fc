//! Threads that compute images come after the thread of the window, which then answers the mouse while a frame takes a second.

/// Steps of niceness (`man 7 sched`): beside a thread of the window that has something to do, another gets a quarter of a core.
#[cfg(target_os = "linux")]
const STEPS: i32 = 5;

/// Lowers the priority of the calling thread and of those that share parallel work.
pub(crate) fn after_the_window() {
    lower();
    #[cfg(target_os = "linux")]
    rayon::broadcast(|_| lower());
}

/// Lowers the priority of the calling thread.
pub(crate) fn lower() {
    // On Linux niceness is that of a thread. Where it cannot be changed, all are equals.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::nice(STEPS);
}
