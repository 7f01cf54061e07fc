//! Record of the finished frames that are kept if the program ends before the video is complete.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Number of kept frames, their folder, and the command that resumes the render.
static KEPT: Mutex<Option<(usize, PathBuf, String)>> = Mutex::new(None);

fn kept() -> MutexGuard<'static, Option<(usize, PathBuf, String)>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Records that this many frames are kept in a folder if a signal ends the program now.
pub fn set(frames: usize, folder: PathBuf, command_to_resume: String) {
    *kept() = Some((frames, folder, command_to_resume));
}

/// Records that no frames are kept.
pub fn clear() {
    *kept() = None;
}

/// Takes the message about the kept frames; the next call returns `None`.
pub(crate) fn take_message() -> Option<String> {
    let (frames, place, again) = kept().take()?;
    let plural = if frames == 1 { "frame is" } else { "frames are" };
    Some(format!("{frames} {plural} kept in {}; to go on with them: {again}", place.display()))
}
