//! The binary buffer. Views and accessors are recorded while the document is made; the content is written afterwards, part by
//! part. Large parts are borrowed from the scene or computed as they are written, so the buffer is never in memory as a whole.

use crate::document::{Accessor, BufferView, Index};
use choreo_plugin::asset::ContentHash;
use choreo_plugin::asset::hash::hash_of;
use std::collections::BTreeMap;
use std::io::{Result, Write};
use std::sync::Arc;

/// Component types and buffer targets of glTF.
pub(crate) const U8: u16 = 5121;
pub(crate) const U16: u16 = 5123;
pub(crate) const U32: u16 = 5125;
pub(crate) const F32: u16 = 5126;
pub(crate) const VERTICES: u16 = 34962;
pub(crate) const INDICES: u16 = 34963;

/// Writes one part of the buffer, whose length is known.
type WritePart<'a> = Box<dyn Fn(&mut dyn Write) -> Result<()> + 'a>;

/// Rows that are computed at a time.
const CHUNK: usize = 4096;

/// One element of an accessor.
pub(crate) trait Row {
    const BYTES: u64;
    fn put(self, out: &mut Vec<u8>);
}

macro_rules! rows {
    ($($number:ty),*) => { $(
        impl<const N: usize> Row for [$number; N] {
            const BYTES: u64 = (N * size_of::<$number>()) as u64;
            fn put(self, out: &mut Vec<u8>) {
                self.into_iter().for_each(|number| out.extend_from_slice(&number.to_le_bytes()));
            }
        }
    )* };
}
rows!(f32, u32, u16, u8);

/// Passes on the bytes of the rows, chunk by chunk.
pub(crate) fn each_chunk<R: Row>(
    count: usize,
    row: impl Fn(usize) -> R,
    mut each: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let mut bytes = Vec::with_capacity(CHUNK.min(count) * R::BYTES as usize);
    for first in (0..count).step_by(CHUNK) {
        bytes.clear();
        (first..count.min(first + CHUNK)).for_each(|index| row(index).put(&mut bytes));
        each(&bytes)?;
    }
    Ok(())
}

#[derive(Default)]
pub(crate) struct Buffer<'a> {
    pub accessors: Vec<Accessor>,
    pub views: Vec<BufferView>,
    /// The content of each view, with its length in bytes.
    parts: Vec<(u64, WritePart<'a>)>,
    length: u64,
    /// Accessors by hash of the content, component type and shape.
    accessor_of_content: BTreeMap<(ContentHash, u16, &'static str), Index>,
}

impl<'a> Buffer<'a> {
    fn add(&mut self, length: u64, target: Option<u16>, part: WritePart<'a>) -> Index {
        let byte_offset = self.length;
        self.views.push(BufferView { buffer: 0, byte_offset, byte_length: length, target });
        self.parts.push((length, part));
        // Each view begins at a multiple of four bytes.
        self.length += length.next_multiple_of(4);
        self.views.len() as Index - 1
    }

    /// Adds a view of raw bytes, such as an image.
    pub(crate) fn bytes(&mut self, bytes: Arc<Vec<u8>>) -> Index {
        self.add(bytes.len() as u64, None, Box::new(move |out| out.write_all(&bytes)))
    }

    /// Adds a view whose content is computed as it is written; `make` must write exactly `length` bytes.
    pub(crate) fn add_computed(
        &mut self,
        length: u64,
        make: impl Fn(&mut dyn Write) -> Result<()> + 'a,
    ) -> Index {
        self.add(length, None, Box::new(make))
    }

    /// Adds an accessor with a view of its own, whose rows are computed as they are written. Equal content is stored once.
    pub(crate) fn array<R: Row>(
        &mut self,
        row: impl Fn(usize) -> R + 'a,
        target: Option<u16>,
        accessor: Accessor,
    ) -> Index {
        let count = accessor.count;
        let hash = hash_of(|w| {
            // Writing to memory does not fail.
            _ = each_chunk(count, &row, |bytes| {
                w.bytes(bytes);
                Ok(())
            });
        });
        let key = (hash, accessor.component_type, accessor.shape);
        if let Some(known) = self.accessor_of_content.get(&key) {
            return *known;
        }
        let write: WritePart<'a> = Box::new(move |out| each_chunk(count, &row, |bytes| out.write_all(bytes)));
        let view = self.add(count as u64 * R::BYTES, target, write);
        let index = self.accessor(Accessor { buffer_view: Some(view), ..accessor });
        self.accessor_of_content.insert(key, index);
        index
    }

    pub(crate) fn accessor(&mut self, accessor: Accessor) -> Index {
        self.accessors.push(accessor);
        self.accessors.len() as Index - 1
    }

    /// Length of the whole buffer, bytes.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    pub(crate) fn write(&self, out: &mut dyn Write) -> Result<()> {
        for (length, part) in &self.parts {
            part(out)?;
            let padding = length.next_multiple_of(4) - length;
            out.write_all(&[0; 3][..padding as usize])?;
        }
        Ok(())
    }
}

impl Accessor {
    /// An accessor without bounds, for [`Buffer::array`].
    pub(crate) fn of(component_type: u16, shape: &'static str, count: usize) -> Accessor {
        let (min, max) = (Vec::new(), Vec::new());
        Accessor { buffer_view: None, byte_offset: 0, component_type, count, shape, min, max }
    }

    /// Sets the minimum and maximum of each of `N` components.
    pub(crate) fn bounded<const N: usize>(mut self, rows: impl Iterator<Item = [f32; N]>) -> Accessor {
        let (mut min, mut max) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
        for row in rows {
            for i in 0..N {
                min[i] = min[i].min(row[i]);
                max[i] = max[i].max(row[i]);
            }
        }
        (self.min, self.max) = (min.to_vec(), max.to_vec());
        self
    }
}
