//! The folder of an unpacked scene, which goes when the program ends.

use crate::scene::pack::Unpacked;
use std::sync::{Mutex, PoisonError};

static UNPACKED: Mutex<Option<Unpacked>> = Mutex::new(None);

/// Keeps the folder until the program ends.
pub(crate) fn keep(unpacked: Option<Unpacked>) {
    *UNPACKED.lock().unwrap_or_else(PoisonError::into_inner) = unpacked;
}

/// Removes the folder.
pub(crate) fn remove() {
    keep(None);
}
