//! Handling of panics and aborts: a message and a documented exit code in place of Rust's own text, both for bugs of the program and for
//! memory that the system refuses.

use crate::failure::Failure;
use choreo_plugin::PluginPanic;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, resume_unwind, set_hook, take_hook};
use std::sync::{Mutex, PoisonError};

/// The latest panic.
static LATEST_PANIC: Mutex<Option<String>> = Mutex::new(None);

/// The panic text of a thread scope after one of its threads has panicked; it does not name the cause.
const SCOPE_PANIC_TEXT: &str = "a scoped thread panicked";

/// Records panics instead of printing them. With RUST_BACKTRACE they are also printed.
pub(crate) fn install() {
    set_exit_code_of_abort();
    let is_backtrace_wanted = std::env::var_os("RUST_BACKTRACE").is_some_and(|value| value != "0");
    let previous_hook = is_backtrace_wanted.then(take_hook);
    set_hook(Box::new(move |panic| {
        if panic.payload_as_str() != Some(SCOPE_PANIC_TEXT) {
            *LATEST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = Some(describe_panic(panic));
        }
        previous_hook.iter().for_each(|previous_hook| previous_hook(panic));
    }));
}

/// Makes an abort end the process with a documented exit code. Rust raises SIGABRT if an allocation fails ("memory allocation of 4096 bytes
/// failed") or a stack overflows. If the address space has a limit, memory is assumed to be the cause; without one, the system ends
/// programs that need too much memory by SIGKILL. [`crate::run`] calls this too; call it earlier if plugins are created before.
pub fn set_exit_code_of_abort() {
    #[cfg(unix)]
    static ONCE: std::sync::Once = std::sync::Once::new();
    #[cfg(unix)]
    ONCE.call_once(|| {
        use rustix::process::{Resource, getrlimit};
        let limited = getrlimit(Resource::As).current.is_some();
        let why = if limited { Failure::Machine(String::new()) } else { Failure::Internal(String::new()) };
        let always = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
        // Fails only for signals that no program may handle.
        let _ = signal_hook::flag::register_conditional_shutdown(
            signal_hook::consts::SIGABRT,
            i32::from(why.exit_code()),
            always,
        );
    });
}

fn describe_panic(panic: &PanicHookInfo<'_>) -> String {
    let text = panic.payload_as_str().unwrap_or("no message");
    match panic.location() {
        Some(at) => format!("{text} ({}:{})", at.file(), at.line()),
        None => text.to_string(),
    }
}

/// Runs the work, and turns the panic of a plugin into a failure. Other panics are passed on.
pub(crate) fn catch_plugin_panics<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| match payload.downcast::<PluginPanic>() {
        Ok(panic) => Err(Failure::input(panic.to_string())),
        Err(payload) => resume_unwind(payload),
    })
}

/// Runs the work, and turns any panic into a failure.
pub(crate) fn catch_panics(work: impl FnOnce() -> Result<(), Failure>) -> Result<(), Failure> {
    catch_unwind(AssertUnwindSafe(|| catch_plugin_panics(work))).unwrap_or_else(|_| {
        let latest = LATEST_PANIC.lock().unwrap_or_else(PoisonError::into_inner).take();
        Err(Failure::Internal(latest.unwrap_or_else(|| "no message".into())))
    })
}
