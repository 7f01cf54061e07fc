//! The memory budget and the warnings of one import.

use crate::problem::Result;
use choreo_asset::Warning;
use std::cell::{Cell, RefCell};

/// Largest number of warnings of one file; further ones are counted in one line.
const MAX_WARNINGS: usize = 100;

/// Bytes that may still be decoded from one file.
#[derive(Debug)]
pub struct Budget {
    limit: u64,
    left: Cell<u64>,
}

impl Budget {
    pub fn new(limit: u64) -> Budget {
        Budget { limit, left: Cell::new(limit) }
    }

    /// Takes `count` elements of `size` bytes from the budget, before they are allocated. The error names the limit.
    pub fn charge(&self, count: u64, size: usize) -> Result<()> {
        match self.left.get().checked_sub(count.saturating_mul(size as u64)) {
            Some(left) => {
                self.left.set(left);
                Ok(())
            }
            None => Err(format!(
                "the file's data take more than {} MiB when decoded, which is the limit",
                self.limit.div_ceil(1 << 20)
            )
            .into()),
        }
    }

    pub fn left(&self) -> u64 {
        self.left.get()
    }
}

/// The warnings of one import.
#[derive(Debug, Default)]
pub struct Notes(RefCell<Vec<Warning>>);

impl Notes {
    pub fn warn(&self, place: impl Into<String>, text: impl Into<String>) {
        let mut warnings = self.0.borrow_mut();
        if warnings.len() == MAX_WARNINGS {
            warnings.push(Warning { place: String::new(), text: "further warnings are left out".into() });
        } else if warnings.len() < MAX_WARNINGS {
            warnings.push(Warning { place: place.into(), text: text.into() });
        }
    }

    pub fn into_warnings(self) -> Vec<Warning> {
        self.0.into_inner()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exhausted_budget_is_an_error_with_its_limit() {
        let budget = Budget::new(3 << 20);
        assert_eq!(budget.charge(1 << 20, 2), Ok(()));
        let refused = "the file's data take more than 3 MiB when decoded, which is the limit";
        assert_eq!(budget.charge(u64::MAX, 16), Err(refused.into()));
        assert_eq!(budget.left(), 1 << 20);
    }

    #[test]
    fn surplus_warnings_become_one_note() {
        let notes = Notes::default();
        (0..MAX_WARNINGS + 5).for_each(|i| notes.warn(format!("nodes[{i}]"), "odd"));
        let warnings = notes.into_warnings();
        assert_eq!(warnings.len(), MAX_WARNINGS + 1);
        assert_eq!(warnings[MAX_WARNINGS].text, "further warnings are left out");
    }
}
