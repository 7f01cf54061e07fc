//! Files, what is read of them, and what is refused.

mod bad_input;
mod obj;
mod samples;
