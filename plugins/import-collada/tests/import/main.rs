//! Files, what is read of them, and what is refused.

mod bad_input;
mod features;
mod motion;
mod properties;
