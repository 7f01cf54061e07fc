//! Packages, `.usdz`: files in a ZIP archive without compression, each at a multiple of 64 bytes (the USDZ specification).

use crate::file::Out;
use choreo_plugin::ExportError;

/// The checksum and length that the head of a file states.
#[derive(Clone, Copy, Default)]
pub struct Contents {
    /// CRC-32.
    pub checksum: u32,
    pub length: u64,
}

/// A file of an archive.
struct Entry {
    name: String,
    contents: Contents,
    /// The place of its head.
    at: u64,
}

/// Files begin at multiples of it.
const ALIGNMENT: u64 = 64;
/// 1980-01-01, so that the same scene has the same bytes.
const DATE: u16 = 1 << 5 | 1;

/// Offset in the head of a file at which it states its contents.
const CONTENTS_AT: u64 = 14;

#[derive(Default)]
pub struct Archive {
    entries: Vec<Entry>,
}

impl Archive {
    /// Begins a file, whose bytes follow; what is not known about them yet is stated by [`Archive::end`].
    ///
    /// # Errors
    /// Archives of this kind hold 4 GiB.
    pub fn begin(&mut self, out: &mut Out<'_>, name: String, contents: Contents) -> Result<(), ExportError> {
        let at = out.position();
        let entry = Entry { name, contents, at };
        entry.fits(contents.length)?;
        if self.entries.len() >= usize::from(u16::MAX) {
            return Err(too_large());
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
        self.entries.push(entry);
        Ok(())
    }

    /// States the contents of the last file that was begun: the bytes of its head that replace those at a place of the archive.
    ///
    /// # Errors
    /// Archives of this kind hold 4 GiB.
    pub fn end(&mut self, contents: Contents) -> Result<(u64, Vec<u8>), ExportError> {
        let Some(entry) = self.entries.last_mut() else { return Ok((0, Vec::new())) };
        entry.fits(contents.length)?;
        entry.contents = contents;
        Ok((entry.at + CONTENTS_AT, contents.stated()))
    }

    /// Writes the directory of the archive.
    pub fn finish(self, out: &mut Out<'_>) -> Result<(), ExportError> {
        let from = out.position();
        for entry in &self.entries {
            out.put(b"PK\x01\x02\x0a\x00")?;
            out.put(&common(entry, 0))?;
            // Comment, disk, attributes.
            out.put(&[0; 10])?;
            out.put(&(entry.at as u32).to_le_bytes())?;
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

impl Entry {
    /// Whether an archive has room for `length` bytes from here on, and the list of its files after them.
    fn fits(&self, length: u64) -> Result<(), ExportError> {
        let end = self.at.saturating_add(length).saturating_add(1 << 20);
        u32::try_from(end).map(|_| ()).map_err(|_| too_large())
    }
}

impl Contents {
    /// Checksum, length in the archive, length.
    fn stated(self) -> Vec<u8> {
        let length = (self.length as u32).to_le_bytes();
        [self.checksum.to_le_bytes(), length, length].concat()
    }
}

fn too_large() -> ExportError {
    ExportError::Format("a .usdz holds at most 4 GiB, and this scene has more; write a .usdc".into())
}

/// The part that both heads of a file have: version, flags, method, date, checksum, lengths.
fn common(entry: &Entry, padding: u16) -> Vec<u8> {
    let mut out = Vec::with_capacity(26);
    // Version 1.0, names in UTF-8, stored, at midnight.
    for word in [10, 1 << 11, 0, 0, DATE] {
        out.extend(u16::to_le_bytes(word));
    }
    out.extend(entry.contents.stated());
    out.extend((entry.name.len() as u16).to_le_bytes());
    out.extend(padding.to_le_bytes());
    out
}
