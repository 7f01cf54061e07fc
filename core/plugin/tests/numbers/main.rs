//! Numbers that plugins read from files.

mod binary;
mod text_numbers;
