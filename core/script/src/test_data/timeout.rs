//! How long a section may take, everything counted: its script, its files, its frames and its images.

use std::time::{Duration, Instant};

/// A point in time, and how it is printed.
#[derive(Clone, Copy, Debug)]
pub struct Timeout {
    /// `None`: beyond what the clock can count to.
    at: Option<Instant>,
    seconds: f64,
}

impl Timeout {
    /// A timeout that starts now.
    pub fn after(seconds: f64) -> Timeout {
        let span = Duration::try_from_secs_f64(seconds).ok();
        Timeout { at: span.and_then(|span| Instant::now().checked_add(span)), seconds }
    }

    /// An error once the time is used up.
    pub fn check(&self) -> Result<(), TimeUsedUp> {
        if self.at.is_some_and(|at| Instant::now() > at) { Err(TimeUsedUp(*self)) } else { Ok(()) }
    }

    /// The error after the time is used up, with a hint.
    pub fn error(&self) -> (String, &'static str) {
        let what = format!("this section takes longer than {} s", self.seconds);
        (what, "make it shorter, or raise the time with --timeout SECONDS")
    }
}

/// The time of a section is used up: what is wrong, with what to do.
#[derive(Clone, Copy, Debug)]
pub struct TimeUsedUp(Timeout);

impl std::fmt::Display for TimeUsedUp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (what, hint) = self.0.error();
        write!(f, "{what}\n    hint: {hint}")
    }
}

impl std::error::Error for TimeUsedUp {}
