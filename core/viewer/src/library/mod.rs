//! Files that the window can show next: recent ones, lessons, templates, folders, and their images. No toolkit here.

pub mod documents;
pub mod file_dialog;
pub mod folder;
pub mod lessons;
pub mod templates;
mod thumbnail_file;
pub mod thumbnails;
