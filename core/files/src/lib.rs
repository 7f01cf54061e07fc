//! Access to files in folders that strangers may have filled.
//!
//! A folder beside a script can contain symbolic links, pipes and devices under names that the program is about to read or
//! write. Two rules follow from that, and this crate is the one place that holds them:
//!
//! - **Reading** follows a link only to a place beneath the folder that was opened ([`Folder::open_file`]).
//! - **Writing** follows no link at all, and creates new files exclusively ([`Folder::create_new`]).
//!
//! Both refuse everything but regular files, and neither waits for the other end of a pipe. Paths are resolved relative to an
//! open folder (`openat2` on Linux, by cap-std elsewhere), so that a folder that is replaced meanwhile changes nothing.

mod error;
mod folder;

pub use error::FileError;
pub use folder::{Folder, open_file, read};
