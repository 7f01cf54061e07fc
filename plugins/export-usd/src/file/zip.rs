//! Packages, `.usdz`: files in a ZIP archive without compression, each at a multiple of 64 bytes (the USDZ specification).

use crate::file::Out;
use choreo_plugin::ExportError;

/// Checksum and length of a file, as its header in the archive states them.
#[derive(Clone, Copy, Default)]
pub(crate) struct Contents {
    /// CRC-32.
    pub checksum: u32,
    pub length: u64,
}

/// A file of an archive.
struct Entry {
    name: String,
    contents: Contents,
    /// Position of the file's local header in the archive.
    at: u64,
}

/// The content of each file begins at a multiple of this many bytes.
const ALIGNMENT: u64 = 64;
/// The date 1980-01-01 for every file, so that the same scene gives the same bytes.
const DATE: u16 = 1 << 5 | 1;

/// Offset of the checksum in a local file header.
const CHECKSUM_OFFSET: u64 = 14;

#[derive(Default)]
pub(crate) struct Archive {
    entries: Vec<Entry>,
}

impl Archive {
    /// Begins a file, whose bytes the caller writes next. [`Archive::end`] states a checksum and length that are not known yet.
    ///
    /// # Errors
    /// The archive would exceed 4 GiB or 65,535 files.
    pub(crate) fn begin(
        &mut self,
        out: &mut Out<'_>,
        name: String,
        contents: Contents,
    ) -> Result<(), ExportError> {
        let at = out.position();
        let entry = Entry { name, contents, at };
        entry.check_length(contents.length)?;
        if self.entries.len() >= usize::from(u16::MAX) {
            return Err(too_large());
        }
        let bare = at + 30 + entry.name.len() as u64;
        let mut padding = (ALIGNMENT - bare % ALIGNMENT) % ALIGNMENT;
        if padding > 0 && padding < 4 {
            padding += ALIGNMENT;
        }
        out.put(b"PK\x03\x04")?;
        out.put(&common_fields(&entry, padding as u16))?;
        out.put(entry.name.as_bytes())?;
        if padding > 0 {
            // Padding as an extra field whose id no program uses.
            out.put(&0x1986u16.to_le_bytes())?;
            out.put(&(padding as u16 - 4).to_le_bytes())?;
            out.put(&vec![0; padding as usize - 4])?;
        }
        self.entries.push(entry);
        Ok(())
    }

    /// Sets the contents of the last file that was begun. Returns the position in the archive, and the header bytes to put there.
    ///
    /// # Errors
    /// The archive would exceed 4 GiB.
    pub(crate) fn end(&mut self, contents: Contents) -> Result<(u64, Vec<u8>), ExportError> {
        let Some(entry) = self.entries.last_mut() else { return Ok((0, Vec::new())) };
        entry.check_length(contents.length)?;
        entry.contents = contents;
        Ok((entry.at + CHECKSUM_OFFSET, contents.checksum_and_lengths()))
    }

    /// Writes the central directory of the archive.
    pub(crate) fn finish(self, out: &mut Out<'_>) -> Result<(), ExportError> {
        let from = out.position();
        for entry in &self.entries {
            out.put(b"PK\x01\x02\x0a\x00")?;
            out.put(&common_fields(entry, 0))?;
            // Comment, disk number and attributes, all 0.
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
    /// Fails where the file's `length` bytes and the central directory after them (1 MiB reserved) would exceed 4 GiB.
    fn check_length(&self, length: u64) -> Result<(), ExportError> {
        let end = self.at.saturating_add(length).saturating_add(1 << 20);
        u32::try_from(end).map(|_| ()).map_err(|_| too_large())
    }
}

impl Contents {
    /// Checksum, stored length and original length, as both headers have them.
    fn checksum_and_lengths(self) -> Vec<u8> {
        let length = (self.length as u32).to_le_bytes();
        [self.checksum.to_le_bytes(), length, length].concat()
    }
}

fn too_large() -> ExportError {
    ExportError::Format("a .usdz holds at most 4 GiB, and this scene has more; write a .usdc".into())
}

/// The fields that the local header and the central directory share: version, flags, method, date, checksum, lengths.
fn common_fields(entry: &Entry, padding: u16) -> Vec<u8> {
    let mut out = Vec::with_capacity(26);
    // Version 1.0, names in UTF-8, stored, at midnight.
    for word in [10, 1 << 11, 0, 0, DATE] {
        out.extend(u16::to_le_bytes(word));
    }
    out.extend(entry.contents.checksum_and_lengths());
    out.extend((entry.name.len() as u16).to_le_bytes());
    out.extend(padding.to_le_bytes());
    out
}
