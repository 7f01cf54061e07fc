//! Packages, `.usdz`: files in a ZIP archive without compression, each at a multiple of 64 bytes (the USDZ specification).

use crate::file::Out;
use choreo_plugin::ExportError;

/// A file of an archive, with what its head states about it.
pub struct Entry {
    pub name: String,
    pub checksum: u32,
    pub length: u64,
}

/// Files begin at multiples of it.
const ALIGNMENT: u64 = 64;
/// 1980-01-01, so that the same scene has the same bytes.
const DATE: u16 = 1 << 5 | 1;

#[derive(Default)]
pub struct Archive {
    /// Entries with the places of their heads.
    entries: Vec<(Entry, u64)>,
}

impl Archive {
    /// Begins a file, whose bytes follow.
    ///
    /// # Errors
    /// Archives of this kind hold 4 GiB.
    pub fn begin(&mut self, out: &mut Out<'_>, entry: Entry) -> Result<(), ExportError> {
        let at = out.position();
        let end = at.saturating_add(entry.length).saturating_add(1 << 20);
        if u32::try_from(end).is_err() || self.entries.len() >= usize::from(u16::MAX) {
            let what = "a .usdz holds at most 4 GiB, and this scene has more; write a .usdc";
            return Err(ExportError::Format(what.into()));
        }
        let bare = at + 30 + entry.name.len() as u64;
        let mut padding = (ALIGNMENT - bare % ALIGNMENT) % ALIGNMENT;
        if padding > 0 && padding < 4 {
            padding += ALIGNMENT;
        }
        out.put(b"PK\x03\x04")?;
        out.put(&common(&entry, padding as u16))?;
        out.put(entry.name.as_bytes())?;
        if padding > 0 {
            // An extra field that no program knows.
            out.put(&0x1986u16.to_le_bytes())?;
            out.put(&(padding as u16 - 4).to_le_bytes())?;
            out.put(&vec![0; padding as usize - 4])?;
        }
        self.entries.push((entry, at));
        Ok(())
    }

    /// Writes the directory of the archive.
    pub fn finish(self, out: &mut Out<'_>) -> Result<(), ExportError> {
        let from = out.position();
        for (entry, at) in &self.entries {
            out.put(b"PK\x01\x02\x0a\x00")?;
            out.put(&common(entry, 0))?;
            // Comment, disk, attributes.
            out.put(&[0; 10])?;
            out.put(&(*at as u32).to_le_bytes())?;
            out.put(entry.name.as_bytes())?;
        }
        let length = out.position() - from;
        let count = (self.entries.len() as u16).to_le_bytes();
        out.put(b"PK\x05\x06\0\0\0\0")?;
        out.put(&count)?;
        out.put(&count)?;
        out.put(&(length as u32).to_le_bytes())?;
        out.put(&(from as u32).to_le_bytes())?;
        out.put(&[0; 2])?;
        Ok(())
    }
}

/// What both heads of a file have: version, flags, method, date, checksum, lengths.
fn common(entry: &Entry, padding: u16) -> Vec<u8> {
    let mut out = Vec::with_capacity(26);
    // Version 1.0, names in UTF-8, stored, at midnight.
    for word in [10, 1 << 11, 0, 0, DATE] {
        out.extend(u16::to_le_bytes(word));
    }
    out.extend(entry.checksum.to_le_bytes());
    out.extend([(entry.length as u32).to_le_bytes(); 2].concat());
    out.extend((entry.name.len() as u16).to_le_bytes());
    out.extend(padding.to_le_bytes());
    out
}
