//! Finished frames that stay when the program ends before the video is whole.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// How many frames stay, where, and the command that goes on with them.
static KEPT: Mutex<Option<(usize, PathBuf, String)>> = Mutex::new(None);

fn kept() -> MutexGuard<'static, Option<(usize, PathBuf, String)>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Notes that this many frames stay in a folder if a signal ends the program now.
pub fn set(frames: usize, folder: PathBuf, command_to_resume: String) {
    *kept() = Some((frames, folder, command_to_resume));
}

/// Notes that no frames stay.
pub fn clear() {
    *kept() = None;
}

/// The message that names the frames that stay. The next call gives none.
pub(crate) fn take_message() -> Option<String> {
    let (frames, place, again) = kept().take()?;
    let plural = if frames == 1 { "frame is" } else { "frames are" };
    Some(format!("{frames} {plural} kept in {}; to go on with them: {again}", place.display()))
}
