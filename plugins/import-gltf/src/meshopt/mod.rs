//! EXT_meshopt_compression and KHR_meshopt_compression: buffer views packed by meshoptimizer's codecs.
//!
//! The crate `meshopt` decodes. Its decoders are safe for untrusted bytes as long as count and stride are checked first. The
//! filters are our own: meshoptimizer's use approximate reciprocal roots on x86 and fused multiply-adds on ARM, so one file would
//! have different normals on different processors.

mod filters;

use crate::problem::Result;

/// `mode` of the extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// `filter` of the extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    /// Only in KHR_meshopt_compression.
    Color,
}

/// Compression parameters of one view, from its JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Packed {
    pub mode: Mode,
    pub filter: Filter,
    /// Number of elements: vertices or indices.
    pub count: usize,
    /// Bytes of a decompressed element.
    pub stride: usize,
}

impl Packed {
    /// Checks the specification's rules for count and stride. The error text states the problem.
    pub(crate) fn check(&self) -> Result<()> {
        let Packed { mode, filter, count, stride } = *self;
        let strides = |allowed: bool, text: &str| match allowed {
            true => Ok(()),
            false => Err(format!("has a byteStride of {stride}; {text}").into()),
        };
        match mode {
            Mode::Attributes => {
                strides(
                    stride % 4 == 0 && (4..=256).contains(&stride),
                    "multiples of 4 up to 256 are allowed",
                )?;
            }
            Mode::Triangles | Mode::Indices => strides(stride == 2 || stride == 4, "indices have 2 or 4")?,
        }
        if mode == Mode::Triangles && count % 3 != 0 {
            return Err(format!("has {count} indices, which make no whole triangles").into());
        }
        match filter {
            _ if filter != Filter::None && mode != Mode::Attributes => {
                Err("has a filter, but no attributes".into())
            }
            Filter::Octahedral | Filter::Color => {
                strides(stride == 4 || stride == 8, "this filter needs 4 or 8")
            }
            Filter::Quaternion => strides(stride == 8, "the QUATERNION filter needs 8"),
            Filter::None | Filter::Exponential => Ok(()),
        }
    }

    /// Decompressed size in bytes. Call [`Packed::check`] first.
    pub(crate) fn bytes(&self) -> u64 {
        (self.count as u64).saturating_mul(self.stride as u64)
    }

    /// The fewest bytes that can encode this many elements. A false count is found before anything is allocated.
    pub(crate) fn min_encoded_bytes(&self) -> u64 {
        let (count, stride) = (self.count as u64, self.stride as u64);
        match self.mode {
            Mode::Attributes => {
                // Version 1: an all-zero byte stream takes two bits a block; the tail is padded to 24 bytes.
                let block = ((8192 / stride) & !15).min(256);
                1 + count.div_ceil(block) * (stride / 4) + 24
            }
            // One code byte for each triangle, and a table of 16 bytes.
            Mode::Triangles => 1 + count / 3 + 16,
            // One byte or more for each index, and 4 bytes of padding.
            Mode::Indices => 1 + count + 4,
        }
    }

    /// Decompresses. [`Packed::check`] must have passed. Fails where bytes of `data` are left over.
    pub(crate) fn unpack(&self, data: &[u8]) -> Result<Vec<u8>> {
        let Packed { mode, filter, count, stride } = *self;
        if (data.len() as u64) < self.min_encoded_bytes() {
            let (least, length) = (self.min_encoded_bytes(), data.len());
            return Err(format!("{count} elements take {least} bytes or more, but there are {length}").into());
        }
        self.check_first_byte(data[0])?;
        let unpacked = match (mode, stride) {
            (Mode::Attributes, _) => vertices(count, stride, data),
            (Mode::Triangles, 2) => meshopt::decode_index_buffer(data, count).map(short_bytes),
            (Mode::Triangles, _) => meshopt::decode_index_buffer(data, count).map(long_bytes),
            (Mode::Indices, 2) => meshopt::decode_index_sequence(data, count).map(short_bytes),
            (Mode::Indices, _) => meshopt::decode_index_sequence(data, count).map(long_bytes),
        };
        let mut out = unpacked.map_err(|error| match error {
            meshopt::Error::Native(-3) => "bytes are left over after the last element",
            _ => "the data are damaged, or end in the middle of an element",
        })?;
        filters::apply(filter, stride, &mut out);
        Ok(out)
    }

    /// Checks the first byte of the codec: mode in the upper half, version in the lower.
    fn check_first_byte(&self, head: u8) -> Result<()> {
        let mark = match self.mode {
            Mode::Attributes => 0xa0,
            Mode::Triangles => 0xe0,
            Mode::Indices => 0xd0,
        };
        if head & 0xf0 != mark {
            return Err(format!(
                "begins with byte {head:#04x}, but data of this mode begin with {mark:#04x}"
            )
            .into());
        }
        match head & 0x0f {
            0 | 1 => Ok(()),
            version => Err(format!("is of version {version}; the newest known is 1").into()),
        }
    }
}

/// One vertex of `STRIDE` bytes. The decoder requires `Default`, which arrays of more than 32 elements lack.
#[derive(Clone)]
struct Vertex<const STRIDE: usize>([u8; STRIDE]);

impl<const STRIDE: usize> Default for Vertex<STRIDE> {
    fn default() -> Self {
        Vertex([0; STRIDE])
    }
}

fn vertices_of<const STRIDE: usize>(count: usize, data: &[u8]) -> meshopt::Result<Vec<u8>> {
    let vertices: Vec<Vertex<STRIDE>> = meshopt::decode_vertex_buffer(data, count)?;
    let mut out = Vec::with_capacity(count * STRIDE);
    vertices.iter().for_each(|vertex| out.extend_from_slice(&vertex.0));
    Ok(out)
}

/// Decodes vertices. The decoder takes the stride from a type, so there is one instance for each stride that [`Packed::check`]
/// allows.
fn vertices(count: usize, stride: usize, data: &[u8]) -> meshopt::Result<Vec<u8>> {
    macro_rules! by_stride {
        ($($words:literal)*) => {
            match stride / 4 {
                $($words => vertices_of::<{ $words * 4 }>(count, data),)*
                _ => Err(meshopt::Error::Native(-1)),
            }
        };
    }
    by_stride!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
        33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
}

fn short_bytes(indices: Vec<u16>) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes()).collect()
}

fn long_bytes(indices: Vec<u32>) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests;
