//! Temporary folders of the process, which are removed when the program ends.

use std::any::Any;
use std::sync::{Mutex, PoisonError};

static FOLDER_OWNER: Mutex<Option<Box<dyn Any + Send>>> = Mutex::new(None);

/// Keeps the owner of a folder until the program ends; its drop removes the folder.
pub(crate) fn keep_until_exit(owner: impl Any + Send) {
    *FOLDER_OWNER.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(owner));
}

/// Drops the owner that was kept, which removes its folder.
pub(crate) fn remove_folder() {
    *FOLDER_OWNER.lock().unwrap_or_else(PoisonError::into_inner) = None;
}
