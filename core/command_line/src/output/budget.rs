//! Limit on the bytes that a render may write, over all its files.

use choreo_plugin::{ExportError, ExportOptions, Exporter, FrameSink, FrameWish, Manifest, VideoInfo};
use std::io::{Read, Write};
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Limit on the bytes of an output, and the bytes written so far by all of its files.
#[derive(Clone, Debug)]
pub(crate) struct Budget {
    limit: u64,
    written: Arc<AtomicU64>,
}

impl Budget {
    pub(crate) fn new(limit: u64) -> Budget {
        Budget { limit, written: Arc::default() }
    }

    /// Wraps a writer: its bytes count against the limit, and a write beyond it fails.
    pub(crate) fn counting_writer(&self, inner: Box<dyn Write + Send>) -> Box<dyn Write + Send> {
        Box::new(CountedWriter { budget: self.clone(), inner })
    }
}

/// Wraps an exporter, so that its bytes are counted; more bytes than the limit are an error.
pub(crate) struct BudgetedExporter {
    inner: Arc<dyn Exporter>,
    budget: Budget,
}

impl BudgetedExporter {
    pub(crate) fn new(inner: Arc<dyn Exporter>, limit: u64) -> BudgetedExporter {
        BudgetedExporter { inner, budget: Budget::new(limit) }
    }
}

type BeginResult = Result<Box<dyn FrameSink>, ExportError>;

impl Exporter for BudgetedExporter {
    fn manifest(&self) -> &Manifest {
        self.inner.manifest()
    }
    fn one_frame_per_file(&self) -> bool {
        self.inner.one_frame_per_file()
    }
    fn wish(&self, options: &ExportOptions) -> Result<FrameWish, ExportError> {
        self.inner.wish(options)
    }
    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        self.inner.notes(info)
    }
    fn head_comes_last(&self) -> bool {
        self.inner.head_comes_last()
    }
    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> BeginResult {
        self.inner.begin(info, self.budget.counting_writer(out))
    }
    fn with_provenance(
        &self,
        info: &VideoInfo,
        made: &[u8],
        out: Box<dyn Write + Send>,
    ) -> Result<bool, ExportError> {
        self.inner.with_provenance(info, made, self.budget.counting_writer(out))
    }
    fn piece(&self, info: &VideoInfo) -> Option<NonZeroU64> {
        self.inner.piece(info)
    }
    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        so_far: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> BeginResult {
        self.inner.resume(info, states, so_far, self.budget.counting_writer(out))
    }
}

struct CountedWriter {
    budget: Budget,
    inner: Box<dyn Write + Send>,
}

impl Write for CountedWriter {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let before = self.budget.written.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        if before.saturating_add(bytes.len() as u64) > self.budget.limit {
            return Err(std::io::Error::other(format!(
                "the output is too large\n    hint: {}",
                choreo_script::raise_hint("output", format!("{} bytes", self.budget.limit))
            )));
        }
        let done = self.inner.write(bytes)?;
        self.budget.written.fetch_sub((bytes.len() - done) as u64, Ordering::Relaxed);
        Ok(done)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_files_together_may_not_exceed_one_budget() {
        let budget = Budget::new(10);
        let mut a = budget.counting_writer(Box::new(Vec::new()));
        let mut b = budget.counting_writer(Box::new(Vec::new()));
        a.write_all(&[0; 6]).unwrap();
        b.write_all(&[0; 4]).unwrap();
        let error = b.write_all(&[0]).unwrap_err().to_string();
        assert_eq!(
            error,
            "the output is too large\n    hint: the limit is 10 bytes; raise it with --limit output=NUMBER if the script needs more"
        );
    }
}
