//! Number and folder of the finished frames that are kept if the program ends before the video is complete, for the last message.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Number of kept frames, their folder, and the command that resumes the render.
static KEPT_FRAMES: Mutex<Option<(usize, PathBuf, String)>> = Mutex::new(None);

fn lock_kept_frames() -> MutexGuard<'static, Option<(usize, PathBuf, String)>> {
    KEPT_FRAMES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Records that this many frames are kept in a folder if a signal ends the program now.
pub(crate) fn set(frames: usize, folder: PathBuf, command_to_resume: String) {
    *lock_kept_frames() = Some((frames, folder, command_to_resume));
}

/// Records that no frames are kept.
pub(crate) fn clear() {
    *lock_kept_frames() = None;
}

/// Takes the message about the kept frames; the next call returns `None`.
pub(crate) fn take_message() -> Option<String> {
    let (frames, folder, command) = lock_kept_frames().take()?;
    let plural = if frames == 1 { "frame is" } else { "frames are" };
    Some(format!("{frames} {plural} kept in {}; to resume the render: {command}", folder.display()))
}
