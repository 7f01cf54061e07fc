//! The guide: a book for readers, made of the pages in `scripts/guide`, of pages of the repository, and of generated ones.
//!
//! ```text
//! scripts/guide/src/SUMMARY.md ─► book ◄─┬─ reference (descriptions of the API, words of the field)
//!                                        └─ gallery (lessons)
//! book ─► write: Markdown and images for mdBook            book ─► the tests: links, scripts, images
//! ```

pub mod book;
pub mod gallery;
pub mod lesson;
pub mod markdown;
pub mod page;
pub mod program;
pub mod reference;
pub mod write;

pub use book::Book;

use std::path::{Path, PathBuf};

/// The repository: this crate lies in tests/guide.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap_or(here).to_path_buf()
}
