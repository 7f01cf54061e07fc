//! Reading and writing in untrusted folders.
#![cfg(unix)]

mod untrusted;
mod writing;
