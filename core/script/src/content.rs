//! Content hashes of files.

use std::io::Read;
use std::path::Path;

/// BLAKE3 hash of a regular file, read block by block. `None` if the file is missing, unreadable or not a regular file; a pipe
/// does not block.
pub fn content_of(path: &Path) -> Option<[u8; 32]> {
    let mut file = choreo_files::open_file(path).ok()?;
    let mut hasher = blake3::Hasher::new();
    let mut block = vec![0; 1 << 18];
    loop {
        match file.read(&mut block).ok()? {
            0 => return Some(*hasher.finalize().as_bytes()),
            n => hasher.update(&block[..n]),
        };
    }
}

/// Hexadecimal digits of a hash.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Adds bytes and their number to a hash, so that two lists of texts never give the same hash by concatenation.
pub fn add_to_hash(hasher: &mut blake3::Hasher, bytes: &[u8]) {
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
}
