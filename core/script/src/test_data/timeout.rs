//! Time limit of a test section, which covers its script, files, frames and images.

use std::time::{Duration, Instant};

/// A point in time, and the limit in seconds for messages.
#[derive(Clone, Copy, Debug)]
pub struct Timeout {
    /// `None`: later than the clock can represent.
    at: Option<Instant>,
    seconds: f64,
}

impl Timeout {
    /// A time limit that starts now.
    pub fn after(seconds: f64) -> Timeout {
        let span = Duration::try_from_secs_f64(seconds).ok();
        Timeout { at: span.and_then(|span| Instant::now().checked_add(span)), seconds }
    }

    /// Returns an error if the time is used up.
    pub fn check(&self) -> Result<(), TimeUsedUp> {
        if self.at.is_some_and(|at| Instant::now() > at) { Err(TimeUsedUp(*self)) } else { Ok(()) }
    }

    /// Message and hint of the error that the time is used up.
    pub fn error(&self) -> (String, &'static str) {
        let what = format!("this section takes longer than {} s", self.seconds);
        (what, "make it shorter, or raise the time with --timeout SECONDS")
    }
}

/// The error that the time of a section is used up, with a hint.
#[derive(Clone, Copy, Debug)]
pub struct TimeUsedUp(Timeout);

impl std::fmt::Display for TimeUsedUp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (what, hint) = self.0.error();
        write!(f, "{what}\n    hint: {hint}")
    }
}

impl std::error::Error for TimeUsedUp {}
