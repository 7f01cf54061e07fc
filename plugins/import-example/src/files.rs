//! The text of this crate, for `choreo new`: a copy has no such file.

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

/// Path in the crate and text.
pub const FILES: &[(&str, &str)] = &[
    ("README.md", README),
    ("src/lib.rs", include_str!("lib.rs")),
    ("tests/sample.rs", include_str!("../tests/sample.rs")),
    ("tests/sample.example", include_str!("../tests/sample.example")),
];
