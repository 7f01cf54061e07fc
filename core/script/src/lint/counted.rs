//! Steps of the rules, counted in tests: characters read, names and places compared. What a rule takes must grow with a script, not with
//! its square. Every loop of a rule that a long script makes long counts here.

/// Adds to the count of this thread.
#[cfg(not(test))]
#[inline(always)]
pub(super) fn count(_: usize) {}

#[cfg(test)]
pub(super) use counted::{count, taken};

#[cfg(test)]
mod counted {
    use std::cell::Cell;

    thread_local! {
        static STEPS: Cell<usize> = const { Cell::new(0) };
    }

    pub(in super::super) fn count(steps: usize) {
        STEPS.set(STEPS.get() + steps);
    }

    /// The steps since the last call.
    pub(in super::super) fn taken() -> usize {
        STEPS.take()
    }
}
