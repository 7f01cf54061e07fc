//! The files of this crate as text, for `choreo new`. Copies of the crate do not have this module.

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

/// (path in the crate, text) of each file.
pub const FILES: &[(&str, &str)] = &[
    ("README.md", README),
    ("src/lib.rs", include_str!("lib.rs")),
    ("tests/lines.rs", include_str!("../tests/lines.rs")),
];
