//! Effects: what they compute, what is refused, and with which words.

mod deep;
mod effects;
mod forms;
mod mistakes;
