//! Progress of an import for a progress bar, and its cancellation.

use crate::images::CANCELLED;
use crate::{Problem, Result};
use choreo_plugin::Files;
use std::cell::Cell;

/// Number of progress steps; smaller steps would be invisible.
const STEPS: usize = 256;

/// Progress of reading a file from its beginning to its end.
pub struct Progress<'f> {
    files: &'f dyn Files,
    total: usize,
    next: Cell<usize>,
}

impl<'f> Progress<'f> {
    pub fn new(files: &'f dyn Files, total: usize) -> Progress<'f> {
        Progress { files, total, next: Cell::new(0) }
    }

    /// Reports progress when `done` bytes reach the next step. An error if the import was cancelled.
    #[inline]
    pub fn reach(&self, done: usize) -> Result<()> {
        if done < self.next.get() { Ok(()) } else { self.report_step(done) }
    }

    #[cold]
    fn report_step(&self, done: usize) -> Result<()> {
        self.next.set(done + self.total / STEPS + 1);
        match self.files.progress(done as f32 / self.total.max(1) as f32) {
            true => Ok(()),
            false => Err(Problem::new(format!("byte {done}"), CANCELLED)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::sync::Arc;

    struct ProgressRecorder(RefCell<Vec<f32>>);

    impl Files for ProgressRecorder {
        fn read(&self, name: &str) -> std::result::Result<Arc<Vec<u8>>, String> {
            Err(format!("{name}: not found"))
        }

        fn progress(&self, part: f32) -> bool {
            self.0.borrow_mut().push(part);
            part < 0.5
        }
    }

    #[test]
    fn progress_is_reported_in_steps_until_it_is_cancelled() {
        let bar = ProgressRecorder(RefCell::default());
        let progress = Progress::new(&bar, 1_000_000);
        let end = (0..=1_000_000).find_map(|done| progress.reach(done).err());
        assert_eq!(end.unwrap().what, "the import was cancelled");
        let reported = bar.0.into_inner();
        assert!(reported.is_sorted() && (100..=128).contains(&(reported.len() - 1)), "{}", reported.len());
        assert!((0.5..0.51).contains(reported.last().unwrap()));
    }
}
