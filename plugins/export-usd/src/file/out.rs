//! The place that bytes go to: a file, with positions and a checksum of a file within a package.

use std::io::{Result, Write};

/// Bytes that are collected before they go on.
const CHUNK: usize = 1 << 16;

pub struct Out<'w> {
    file: &'w mut dyn Write,
    position: u64,
    /// The position at which the file within a package begins.
    origin: u64,
    /// The checksum of all bytes since [`Out::begin_sum`].
    sum: Option<crc32fast::Hasher>,
    pending: Vec<u8>,
}

impl<'w> Out<'w> {
    pub fn file(file: &'w mut dyn Write) -> Out<'w> {
        Out { file, position: 0, origin: 0, sum: None, pending: Vec::with_capacity(2 * CHUNK) }
    }

    /// Bytes so far, of the file within a package where one has begun.
    pub fn position(&self) -> u64 {
        self.position - self.origin
    }

    /// Positions count from here on.
    pub(crate) fn begin_file(&mut self) {
        self.origin = self.position;
    }

    /// Positions count from the start of the package again.
    pub(crate) fn end_file(&mut self) {
        self.origin = 0;
    }

    /// Begins a CRC-32 of what follows.
    pub(crate) fn begin_sum(&mut self) -> Result<()> {
        self.send()?;
        self.sum = Some(crc32fast::Hasher::new());
        Ok(())
    }

    /// The CRC-32 of all bytes since it has begun.
    pub(crate) fn end_sum(&mut self) -> Result<crc32fast::Hasher> {
        self.send()?;
        Ok(self.sum.take().unwrap_or_default())
    }

    pub fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.position += bytes.len() as u64;
        self.pending.extend_from_slice(bytes);
        if self.pending.len() >= CHUNK { self.send() } else { Ok(()) }
    }

    fn send(&mut self) -> Result<()> {
        if let Some(sum) = &mut self.sum {
            sum.update(&self.pending);
        }
        self.file.write_all(&self.pending)?;
        self.pending.clear();
        Ok(())
    }

    /// Hands over what is pending.
    pub fn finish(mut self) -> Result<()> {
        self.send()?;
        self.file.flush()
    }
}
