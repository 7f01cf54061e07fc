//! Access to files in folders whose contents are not trusted.
//!
//! A folder beside a script can contain symbolic links, pipes and devices under names that the program is about to read or
//! write. Two rules follow from that, and this crate is the one place that holds them:
//!
//! - **Reading** follows a link only to a place beneath the folder that was opened ([`Folder::open_file`]).
//! - **Writing** follows no link at all, and creates new files exclusively ([`PartFile`], [`PartFolder`], [`write_whole`]). A file
//!   appears whole or not at all; when a signal ends the program, [`remove_unfinished`] removes unfinished files.
//!
//! Reading refuses everything but regular files, writing opens a pipe or device only under the name that the user gave, and
//! neither waits for the other end of a pipe. Paths are resolved relative to an
//! open folder (`openat2` on Linux, by cap-std elsewhere), so that replacing the folder meanwhile has no effect.

mod destination;
mod entries;
mod error;
mod folder;
mod identity;
mod leftovers;
mod part;
mod part_folder;
mod pipe;
mod user_folder;
mod write_error;

pub use destination::Destination;
pub use entries::entries;
pub use error::{FileError, describe_error};
pub use folder::{Folder, containing_folder, open_file, read};
pub use identity::Identity;
pub use leftovers::remove_unfinished;
pub use part::{PartFile, part_name, write_whole, write_whole_beneath};
pub use part_folder::PartFolder;
pub use user_folder::user_folder;
pub use write_error::WriteError;
