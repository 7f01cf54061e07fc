//! Modes TRIANGLES and INDICES: triangles by edges and vertices met shortly before, and plain lists by differences.

use super::{Bytes, version};

const TRIANGLES: u8 = 0xe0;
const SEQUENCE: u8 = 0xd0;
/// Bytes of the table at the end of triangles.
pub const TABLE: usize = 16;
/// Padding after a sequence.
pub const TAIL: usize = 4;

/// The last 16 things, newest first by [`Recent::back`].
struct Recent<T> {
    ring: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn new(unset: T) -> Recent<T> {
        Recent { ring: [unset; 16], next: 0 }
    }

    fn push(&mut self, value: T) {
        self.ring[self.next & 15] = value;
        self.next = self.next.wrapping_add(1);
    }

    /// The `n`-th newest, from 1.
    fn back(&self, n: u8) -> T {
        self.ring[self.next.wrapping_sub(usize::from(n)) & 15]
    }
}

struct Triangles<'a> {
    data: Bytes<'a>,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
    /// The first index that has not occurred yet.
    fresh: u32,
    /// The last index that was stored as a difference.
    stored: u32,
}

/// `count` indices, a multiple of 3.
pub fn triangles(count: usize, data: &[u8]) -> Result<Vec<u32>, String> {
    let mut data = Bytes(data);
    let version = version(data.byte()?, TRIANGLES, 1)?;
    let codes = data.take(count / 3)?;
    let Some((body, table)) = data.0.split_last_chunk::<TABLE>() else {
        return Err(format!("{} bytes cannot hold the table of {TABLE}", data.0.len()));
    };
    // Version 1: 13 and 14 are the neighbours of the last stored index.
    let stored_from = if version == 0 { 15 } else { 13 };
    let mut state = Triangles {
        data: Bytes(body),
        edges: Recent::new([u32::MAX; 2]),
        vertices: Recent::new(u32::MAX),
        fresh: 0,
        stored: 0,
    };
    let mut out = Vec::with_capacity(count);
    for code in codes {
        let triangle = match code {
            0xf0..=0xfd => state.new_triangle(0, table[usize::from(code & 15)])?,
            0xfe | 0xff => {
                let corners = state.data.byte()?;
                if corners == 0 {
                    state.fresh = 0;
                }
                state.new_triangle(if *code == 0xfe { 0 } else { 15 }, corners)?
            }
            _ => state.on_edge(code >> 4, code & 15, stored_from)?,
        };
        out.extend(triangle);
    }
    state.data.end()?;
    Ok(out)
}

impl Triangles<'_> {
    /// On one of the last edges, with a third corner that is new, one of the last, or stored.
    fn on_edge(&mut self, edge: u8, corner: u8, stored_from: u8) -> Result<[u32; 3], String> {
        let [a, b] = self.edges.back(edge + 1);
        let c = match corner {
            0 => self.take_fresh(),
            n if n < stored_from => self.vertices.back(n + 1),
            13 => self.stored.wrapping_sub(1),
            14 => self.stored.wrapping_add(1),
            _ => self.difference()?,
        };
        if corner >= stored_from {
            self.stored = c;
        }
        if corner == 0 || corner >= stored_from {
            self.vertices.push(c);
        }
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// Corner by corner: 0 new, 15 stored, else one of the last.
    fn new_triangle(&mut self, first: u8, others: u8) -> Result<[u32; 3], String> {
        let kinds = [first, others >> 4, others & 15];
        // What is new is numbered before the stored are read, and both before any is remembered.
        let mut corners = kinds.map(|kind| match kind {
            0 => self.take_fresh(),
            n => self.vertices.back(n),
        });
        for (corner, kind) in corners.iter_mut().zip(kinds) {
            if kind == 15 {
                *corner = self.difference()?;
                self.stored = *corner;
            }
        }
        for (corner, kind) in corners.iter().zip(kinds) {
            if kind == 0 || kind == 15 {
                self.vertices.push(*corner);
            }
        }
        let [a, b, c] = corners;
        for edge in [[b, a], [c, b], [a, c]] {
            self.edges.push(edge);
        }
        Ok(corners)
    }

    fn take_fresh(&mut self) -> u32 {
        self.fresh = self.fresh.wrapping_add(1);
        self.fresh.wrapping_sub(1)
    }

    fn difference(&mut self) -> Result<u32, String> {
        Ok(self.stored.wrapping_add(unzigzag(varint(&mut self.data)?)))
    }
}

pub fn sequence(count: usize, data: &[u8]) -> Result<Vec<u32>, String> {
    let mut data = Bytes(data);
    version(data.byte()?, SEQUENCE, 1)?;
    let Some((body, _)) = data.0.split_last_chunk::<TAIL>() else {
        return Err(format!("{} bytes cannot hold the padding of {TAIL}", data.0.len()));
    };
    let mut data = Bytes(body);
    // Two lists of differences, interleaved: of strips and fans, one for the near and one for the far side.
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let coded = varint(&mut data)?;
        let slot = &mut last[(coded & 1) as usize];
        *slot = slot.wrapping_add(unzigzag(coded >> 1));
        out.push(*slot);
    }
    data.end()?;
    Ok(out)
}

fn unzigzag(v: u32) -> u32 {
    v >> 1 ^ (v & 1).wrapping_neg()
}

/// Seven bits a byte, the lowest first, five bytes at most.
fn varint(data: &mut Bytes<'_>) -> Result<u32, String> {
    let mut value = 0u32;
    for shift in (0..35).step_by(7) {
        let byte = data.byte()?;
        value |= u32::from(byte & 127) << shift;
        if byte < 128 {
            break;
        }
    }
    Ok(value)
}
