//! SIGTERM closes the window like Quit; a second SIGTERM ends the program at once.

use signal_hook::consts::SIGTERM;
use signal_hook::{flag, low_level};
use std::io::{self, Read};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Calls `close` once on the first signal, on a thread of its own.
pub(super) fn watch_signals(close: impl FnOnce() + Send + 'static) -> io::Result<()> {
    let closes = Arc::new(AtomicBool::new(false));
    flag::register_conditional_default(SIGTERM, closes.clone())?;
    let (mut reader, writer) = UnixStream::pair()?;
    low_level::pipe::register(SIGTERM, writer)?;
    let wait = move || {
        if reader.read_exact(&mut [0]).is_ok() {
            closes.store(true, Ordering::SeqCst);
            close();
        }
    };
    std::thread::Builder::new().name("signals".into()).stack_size(256 << 10).spawn(wait)?;
    Ok(())
}
