//! `.usdz` packages: files in a ZIP archive without compression.

use choreo_importer_kit::{Problem, Result};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

pub(crate) struct Archive {
    bytes: Arc<Vec<u8>>,
    /// Byte range of each file.
    files: BTreeMap<String, Range<usize>>,
    /// Name of the first file, which is the root layer.
    pub first: String,
}

pub(crate) fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

fn damaged(what: &str) -> Problem {
    Problem::new("archive", what)
}

fn word(bytes: &[u8], at: usize) -> Result<usize> {
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk::<2>());
    found.map(|b| usize::from(u16::from_le_bytes(*b))).ok_or_else(|| damaged("ends too early"))
}

fn long(bytes: &[u8], at: usize) -> Result<usize> {
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk::<4>());
    found.map(|b| u32::from_le_bytes(*b) as usize).ok_or_else(|| damaged("ends too early"))
}

impl Archive {
    /// Reads the central directory at the end of the archive.
    pub(crate) fn open(bytes: Arc<Vec<u8>>) -> Result<Archive> {
        let from = bytes.len().saturating_sub(65_557);
        let end = bytes[from..].windows(4).rposition(|w| w == b"PK\x05\x06");
        let end = from + end.ok_or_else(|| damaged("has no directory; the file is cut off"))?;
        let (count, mut at) = (word(&bytes, end + 10)?, long(&bytes, end + 16)?);
        let mut out = Archive { bytes: bytes.clone(), files: BTreeMap::new(), first: String::new() };
        let mut lowest = usize::MAX;
        for _ in 0..count {
            if bytes.get(at..at.saturating_add(4)) != Some(b"PK\x01\x02") {
                return Err(damaged("has a damaged directory"));
            }
            let (method, length) = (word(&bytes, at + 10)?, long(&bytes, at + 20)?);
            let sizes = [28, 30, 32].map(|place| word(&bytes, at + place));
            let [name_length, extra, comment] = sizes;
            let (name_length, head) = (name_length?, long(&bytes, at + 42)?);
            let name = bytes.get(at + 46..at + 46 + name_length).ok_or_else(|| damaged("ends too early"))?;
            let name = String::from_utf8_lossy(name).into_owned();
            if method != 0 {
                return Err(damaged(&format!("holds \"{name}\" compressed, which a .usdz must not")));
            }
            let begin = head + 30 + word(&bytes, head.saturating_add(26))? + word(&bytes, head + 28)?;
            let range = begin..begin.saturating_add(length);
            if bytes.get(range.clone()).is_none() {
                return Err(damaged(&format!("is too short for \"{name}\"")));
            }
            if head < lowest {
                lowest = head;
                out.first.clone_from(&name);
            }
            out.files.insert(name, range);
            at += 46 + name_length + extra? + comment?;
        }
        match out.first.is_empty() {
            true => Err(damaged("is empty")),
            false => Ok(out),
        }
    }

    pub(crate) fn read(&self, name: &str) -> Option<Arc<Vec<u8>>> {
        let range = self.files.get(name)?;
        Some(Arc::new(self.bytes[range.clone()].to_vec()))
    }
}
