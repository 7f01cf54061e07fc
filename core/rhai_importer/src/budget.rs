//! Memory budget of a single import. Bytes are counted, not measured, so that the same file always succeeds or fails the same
//! way.

use rhai::{EvalAltResult, Position};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that the arrays of an import may take in addition to 16 times the size of the file.
const BASE_BYTES: u64 = 64 << 20;

/// Bytes that one import may still allocate for arrays. Clones share the count.
#[derive(Clone, Debug)]
pub(crate) struct Budget {
    remaining: Arc<AtomicU64>,
    total: u64,
}

/// Error of a native function that a script calls.
pub(crate) type NativeError = Box<EvalAltResult>;

/// An error of a native function: the interpreter adds the place of the call.
pub(crate) fn native_error(text: impl Into<String>) -> NativeError {
    Box::new(EvalAltResult::ErrorRuntime(text.into().into(), Position::NONE))
}

impl Budget {
    /// Budget for a source file of this size in bytes: 64 MiB plus 16 times the size.
    pub(crate) fn for_file(bytes: usize) -> Budget {
        let total = BASE_BYTES + 16 * bytes as u64;
        Budget { remaining: Arc::new(AtomicU64::new(total)), total }
    }

    /// Takes bytes from the budget for the rest of the import, before they are allocated. Error: too few are left.
    pub(crate) fn charge(&self, bytes: usize) -> Result<(), NativeError> {
        let taken = self
            .remaining
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(bytes as u64));
        taken.map(drop).map_err(|_| {
            native_error(format!(
                "too much memory: all arrays together may take {} MB, 64 MB plus 16 times the file's size",
                self.total >> 20
            ))
        })
    }

    /// Takes bytes like [`Budget::charge`], and gives the bytes back when the share is dropped.
    pub(crate) fn reserve(&self, bytes: usize) -> Result<BudgetShare, NativeError> {
        self.charge(bytes)?;
        Ok(BudgetShare { budget: self.clone(), bytes })
    }
}

/// Bytes of a budget that one array holds.
#[derive(Debug)]
pub(crate) struct BudgetShare {
    pub budget: Budget,
    bytes: usize,
}

impl BudgetShare {
    /// Takes further bytes for the same array before they are allocated. Error: too few are left.
    pub(crate) fn grow(&mut self, bytes: usize) -> Result<(), NativeError> {
        self.budget.charge(bytes)?;
        self.bytes += bytes;
        Ok(())
    }
}

impl Drop for BudgetShare {
    fn drop(&mut self) {
        self.budget.remaining.fetch_add(self.bytes as u64, Ordering::Relaxed);
    }
}
