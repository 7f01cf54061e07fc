//! Buffered output to a file, with byte positions and a checksum for the files within a package.

use std::io::{Result, Write};

/// Bytes that are collected before they are written.
const CHUNK_BYTES: usize = 1 << 16;

pub(crate) struct Out<'w> {
    file: &'w mut dyn Write,
    position: u64,
    /// The position in the output at which the current file of a package begins.
    origin: u64,
    /// The checksum of all bytes since [`Out::begin_sum`].
    sum: Option<crc32fast::Hasher>,
    pending: Vec<u8>,
}

impl<'w> Out<'w> {
    pub(crate) fn file(file: &'w mut dyn Write) -> Out<'w> {
        Out { file, position: 0, origin: 0, sum: None, pending: Vec::with_capacity(2 * CHUNK_BYTES) }
    }

    /// Bytes written so far, counted from the start of the current file of a package, or of the whole output where none has
    /// begun.
    pub(crate) fn position(&self) -> u64 {
        self.position - self.origin
    }

    /// Begins a file of a package: positions count from here on.
    pub(crate) fn begin_file(&mut self) {
        self.origin = self.position;
    }

    /// Ends a file of a package: positions count from the start of the output again.
    pub(crate) fn end_file(&mut self) {
        self.origin = 0;
    }

    /// Starts a CRC-32 over all bytes that follow.
    pub(crate) fn begin_sum(&mut self) -> Result<()> {
        self.send()?;
        self.sum = Some(crc32fast::Hasher::new());
        Ok(())
    }

    /// Ends the CRC-32 that [`Out::begin_sum`] started, over all bytes since then.
    pub(crate) fn end_sum(&mut self) -> Result<crc32fast::Hasher> {
        self.send()?;
        Ok(self.sum.take().unwrap_or_default())
    }

    pub(crate) fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.position += bytes.len() as u64;
        self.pending.extend_from_slice(bytes);
        if self.pending.len() >= CHUNK_BYTES { self.send() } else { Ok(()) }
    }

    fn send(&mut self) -> Result<()> {
        if let Some(sum) = &mut self.sum {
            sum.update(&self.pending);
        }
        self.file.write_all(&self.pending)?;
        self.pending.clear();
        Ok(())
    }

    /// Writes the pending bytes and flushes the output.
    pub(crate) fn finish(mut self) -> Result<()> {
        self.send()?;
        self.file.flush()
    }
}
