//! Mode ATTRIBUTES: blocks of up to 256 elements, byte by byte as differences from the element before, in groups of 16 of equal
//! width. Version 1 (KHR) adds widths for each byte of a block and differences of 16 and 32 bits.

use super::{Bytes, version};

const MARK: u8 = 0xa0;
/// Elements of a group.
const GROUP: usize = 16;
/// Bits a value of a group, by its two header bits; version 1 takes four in a row out of five.
const WIDTHS_0: [u32; 4] = [0, 2, 4, 8];
const WIDTHS_1: [u32; 5] = [0, 1, 2, 4, 8];
/// The tail (an element to start from, and version 1's channels) is padded to this.
const TAIL_0: usize = 32;
const TAIL_1: usize = 24;

fn block_elements(stride: usize) -> usize {
    ((8192 / stride) & !(GROUP - 1)).min(256)
}

pub fn least(count: usize, stride: usize) -> u64 {
    // Version 1's all-zero bytes take two bits a block.
    let blocks = count.div_ceil(block_elements(stride)) as u64;
    1 + blocks * (stride as u64 / 4) + TAIL_1 as u64
}

pub fn unpack(count: usize, stride: usize, data: &[u8]) -> Result<Vec<u8>, String> {
    let mut body = Bytes(data);
    let version = version(body.byte()?, MARK, 1)?;
    let tail = if version == 0 { stride } else { stride + stride / 4 };
    let padded = tail.max(if version == 0 { TAIL_0 } else { TAIL_1 });
    let Some((blocks, tail_bytes)) = body.0.split_at_checked(body.0.len().wrapping_sub(padded)) else {
        return Err(format!("{} bytes cannot hold the {padded} of the tail", data.len()));
    };
    let (first, channels) = tail_bytes[padded - tail..].split_at(stride);
    let mut block =
        Block { version, stride, channels, last: first.to_vec(), planes: [[0; 256]; 4], body: Bytes(blocks) };
    let mut out = vec![0; count * stride];
    for elements in out.chunks_mut(block_elements(stride) * stride) {
        block.unpack(elements)?;
    }
    block.body.end()?;
    Ok(out)
}

struct Block<'a> {
    version: u8,
    stride: usize,
    /// Version 1: what the differences of four bytes each are.
    channels: &'a [u8],
    /// The element before.
    last: Vec<u8>,
    /// Four bytes of every element of the block, byte by byte.
    planes: [[u8; 256]; 4],
    body: Bytes<'a>,
}

impl Block<'_> {
    fn unpack(&mut self, out: &mut [u8]) -> Result<(), String> {
        let count = out.len() / self.stride;
        let control = if self.version == 0 { &[][..] } else { self.body.take(self.stride / 4)? };
        for quad in 0..self.stride / 4 {
            for plane in 0..4 {
                let kind = control.get(quad).map_or(0, |c| c >> (2 * plane) & 3);
                self.plane(plane, kind, count)?;
            }
            match self.channels.get(quad).map_or(0, |c| c & 3) {
                0 => self.add::<1>(quad, count, out),
                1 => self.add::<2>(quad, count, out),
                2 => self.turn(quad, count, out),
                _ => {
                    return Err(format!(
                        "bytes {} to {} are of an unknown channel type 3",
                        quad * 4,
                        quad * 4 + 3
                    ));
                }
            }
        }
        self.last.copy_from_slice(&out[(count - 1) * self.stride..]);
        Ok(())
    }

    /// One byte of every element of the block.
    fn plane(&mut self, plane: usize, kind: u8, count: usize) -> Result<(), String> {
        let out = &mut self.planes[plane];
        let widths = match (self.version, kind) {
            (0, _) => &WIDTHS_0[..],
            (_, 3) => {
                out[..count].copy_from_slice(self.body.take(count)?);
                return Ok(());
            }
            (_, 2) => {
                out.fill(0);
                return Ok(());
            }
            (_, shift) => &WIDTHS_1[usize::from(shift)..],
        };
        let groups = count.div_ceil(GROUP);
        let header = self.body.take(groups.div_ceil(4))?;
        for (g, group) in out.as_chunks_mut::<GROUP>().0[..groups].iter_mut().enumerate() {
            let width = widths[usize::from(header[g / 4] >> (g % 4 * 2) & 3)];
            unpack_group(&mut self.body, width, group)?;
        }
        Ok(())
    }

    /// Differences of `N`-byte numbers, zigzag.
    fn add<const N: usize>(&self, quad: usize, count: usize, out: &mut [u8]) {
        for part in (0..4).step_by(N) {
            let at = quad * 4 + part;
            let mut value = number(&self.last[at..at + N]);
            for i in 0..count {
                let mut bytes = [0; 4];
                for (b, byte) in bytes[..N].iter_mut().enumerate() {
                    *byte = self.planes[part + b][i];
                }
                let coded = u32::from_le_bytes(bytes);
                value = value.wrapping_add(coded >> 1 ^ (coded & 1).wrapping_neg());
                out[i * self.stride + at..][..N].copy_from_slice(&value.to_le_bytes()[..N]);
            }
        }
    }

    /// Bits of a 32-bit number that differ, turned.
    fn turn(&self, quad: usize, count: usize, out: &mut [u8]) {
        let bits = u32::from(self.channels[quad] >> 4);
        let at = quad * 4;
        let mut value = number(&self.last[at..at + 4]);
        for i in 0..count {
            let coded = u32::from_le_bytes([0, 1, 2, 3].map(|b| self.planes[b][i]));
            value ^= coded.rotate_right(bits);
            out[i * self.stride + at..][..4].copy_from_slice(&value.to_le_bytes());
        }
    }
}

fn number(little_endian: &[u8]) -> u32 {
    little_endian.iter().rev().fold(0, |n, byte| n << 8 | u32::from(*byte))
}

/// 16 values of `width` bits. The largest value stands for one that does not fit: its byte follows the group.
fn unpack_group(body: &mut Bytes<'_>, width: u32, out: &mut [u8; GROUP]) -> Result<(), String> {
    if width == 0 {
        out.fill(0);
        return Ok(());
    }
    let packed = body.take(GROUP * width as usize / 8)?;
    if width == 8 {
        out.copy_from_slice(packed);
        return Ok(());
    }
    let escape = (1u8 << width) - 1;
    let each = 8 / width as usize;
    for (i, value) in out.iter_mut().enumerate() {
        // Bits in order from the lowest, wider values from the highest.
        let place = if width == 1 { i % each } else { each - 1 - i % each };
        *value = packed[i / each] >> (place * width as usize) & escape;
    }
    for value in out.iter_mut().filter(|v| **v == escape) {
        *value = body.byte()?;
    }
    Ok(())
}
