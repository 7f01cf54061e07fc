//! The width of the terminal.

/// Columns of the terminal on standard output, or the number in `COLUMNS`; no limit for files and pipes.
pub(crate) fn columns() -> usize {
    let from_environment = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    from_environment.or_else(terminal_columns).filter(|columns| *columns > 0).unwrap_or(usize::MAX)
}

#[cfg(unix)]
fn terminal_columns() -> Option<usize> {
    rustix::termios::tcgetwinsize(std::io::stdout()).ok().map(|size| size.ws_col.into())
}

#[cfg(not(unix))]
fn terminal_columns() -> Option<usize> {
    use std::io::IsTerminal;
    // Width of a new console window.
    std::io::stdout().is_terminal().then_some(120)
}
