//! Whether a file is still the same.

use std::io::Read;
use std::path::Path;

/// BLAKE3 of a regular file's content, read in pieces; `None` where there is none or it cannot be read. A pipe is not waited
/// for.
pub fn content_of(path: &Path) -> Option<[u8; 32]> {
    let mut file = choreo_files::open_file(path).ok()?;
    let mut hasher = blake3::Hasher::new();
    let mut piece = vec![0; 1 << 18];
    loop {
        match file.read(&mut piece).ok()? {
            0 => return Some(*hasher.finalize().as_bytes()),
            n => hasher.update(&piece[..n]),
        };
    }
}

/// Hexadecimal digits of a hash.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
