//! Files that the window can open (recent files, lessons, templates, folders) and their thumbnails. No UI toolkit is used here.

pub mod documents;
pub mod file_dialog;
pub mod folder;
pub mod lessons;
pub mod templates;
mod thumbnail_file;
pub mod thumbnails;
