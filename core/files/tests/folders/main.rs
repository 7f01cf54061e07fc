//! Files and folders of strangers.
#![cfg(unix)]

mod strangers;
mod writing;
