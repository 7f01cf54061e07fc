//! What our outputs hold beside the pictures: how a finished one was made ([`head`]), and how far one got that was stopped
//! ([`journal`]). Both read files that anybody may have written: nothing is trusted, nothing panics.

pub mod head;
pub mod journal;

pub use head::{Media, read, whole_png};

/// Keyword of the number that stands for all of a provenance where a format has no room.
pub const ID: &str = "choreo:id";
