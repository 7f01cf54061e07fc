//! Where bytes go: into a file, into a checksum, or nowhere, where only their number is of interest.

use std::io::{Result, Write};

/// Bytes that are collected before they go on.
const CHUNK: usize = 1 << 16;

enum Target<'w> {
    Nowhere,
    Checksum(crc32fast::Hasher),
    File(&'w mut dyn Write),
}

pub struct Out<'w> {
    target: Target<'w>,
    position: u64,
    /// Where the file within a package begins.
    origin: u64,
    pending: Vec<u8>,
}

impl<'w> Out<'w> {
    pub fn file(file: &'w mut dyn Write) -> Out<'w> {
        Out::new(Target::File(file))
    }

    /// Counts bytes.
    pub fn nowhere() -> Out<'w> {
        Out::new(Target::Nowhere)
    }

    /// Makes a CRC-32.
    pub fn checksum() -> Out<'w> {
        Out::new(Target::Checksum(crc32fast::Hasher::new()))
    }

    fn new(target: Target<'w>) -> Out<'w> {
        Out { target, position: 0, origin: 0, pending: Vec::with_capacity(CHUNK) }
    }

    /// Bytes so far, of the file within a package where one has begun.
    pub fn position(&self) -> u64 {
        self.position - self.origin
    }

    /// Positions count from here on.
    pub fn begin_file(&mut self) {
        self.origin = self.position;
    }

    /// Positions count from the start of the package again.
    pub fn end_file(&mut self) {
        self.origin = 0;
    }

    pub fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.position += bytes.len() as u64;
        if matches!(self.target, Target::Nowhere) {
            return Ok(());
        }
        self.pending.extend_from_slice(bytes);
        if self.pending.len() >= CHUNK { self.send() } else { Ok(()) }
    }

    /// Bytes of a known length, which are made only where they are needed.
    pub fn made(&mut self, length: u64, make: impl FnOnce(&mut Out<'w>) -> Result<()>) -> Result<()> {
        if matches!(self.target, Target::Nowhere) {
            self.position += length;
            return Ok(());
        }
        let from = self.position;
        make(self)?;
        debug_assert_eq!(self.position - from, length);
        Ok(())
    }

    fn send(&mut self) -> Result<()> {
        match &mut self.target {
            Target::Nowhere => {}
            Target::Checksum(hasher) => hasher.update(&self.pending),
            Target::File(file) => file.write_all(&self.pending)?,
        }
        self.pending.clear();
        Ok(())
    }

    /// Hands over what is pending; the checksum of all, where there is one.
    pub fn finish(mut self) -> Result<Option<crc32fast::Hasher>> {
        self.send()?;
        match self.target {
            Target::Checksum(hasher) => Ok(Some(hasher)),
            Target::File(file) => file.flush().map(|()| None),
            Target::Nowhere => Ok(None),
        }
    }
}
