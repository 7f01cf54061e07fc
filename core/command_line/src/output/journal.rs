//! The journal of a video's finished frames in its part folder, from which a killed render resumes.
//!
//! The file `journal` is a magic line followed by records: length, CRC-32 and bytes. The first record holds the identity of the render;
//! each further one stands for a finished frame, and is written after all data that it refers to. Checksums find records that are truncated
//! or corrupt, and only the records before them are used.

use std::io::{self, BufReader, Read, Write};

pub(crate) const MAGIC: &[u8] = b"choreo journal 1\n";

/// One finished frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Length of the body in bytes, up to the end of this frame.
    pub body: u64,
    /// CRC-32 of the bytes added to the body since the previous record.
    pub crc: u32,
    pub kept: KeptFrame,
}

/// Form in which a finished frame is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeptFrame {
    /// The frame is complete in the body; state of the exporter after it, from `Mark::Settled`.
    Settled(Vec<u8>),
    /// Frame that the encoder still holds (`Mark::Open`): place of its bytes in the file `frames`.
    Open(Span),
}

/// Place of a delta-encoded frame in the file `frames`, and its checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Offset in the file `frames`, and length in bytes.
    pub offset: u64,
    pub length: u32,
    pub crc: u32,
    /// Lengths in bytes of the three parts of the decoded frame.
    pub part_lengths: [u32; 3],
}

impl Record {
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.body.to_le_bytes().to_vec();
        bytes.extend(self.crc.to_le_bytes());
        match &self.kept {
            KeptFrame::Settled(state) => {
                bytes.push(b'S');
                bytes.extend(state);
            }
            KeptFrame::Open(span) => {
                bytes.push(b'O');
                bytes.extend(span.offset.to_le_bytes());
                for number in [span.length, span.crc].iter().chain(&span.part_lengths) {
                    bytes.extend(number.to_le_bytes());
                }
            }
        }
        bytes
    }

    fn read(bytes: &[u8]) -> Option<Record> {
        let (body, rest) = bytes.split_first_chunk::<8>()?;
        let (crc, rest) = rest.split_first_chunk::<4>()?;
        let (kind, rest) = rest.split_first()?;
        let kept = match kind {
            b'S' => KeptFrame::Settled(rest.to_vec()),
            b'O' => {
                let (at, rest) = rest.split_first_chunk::<8>()?;
                let numbers: &[u8; 20] = rest.try_into().ok()?;
                let mut numbers = numbers.as_chunks::<4>().0.iter().map(|n| u32::from_le_bytes(*n));
                let mut next = || numbers.next();
                KeptFrame::Open(Span {
                    offset: u64::from_le_bytes(*at),
                    length: next()?,
                    crc: next()?,
                    part_lengths: [next()?, next()?, next()?],
                })
            }
            _ => return None,
        };
        Some(Record { body: u64::from_le_bytes(*body), crc: u32::from_le_bytes(*crc), kept })
    }
}

/// Identity of a render, as (keyword, text). Two renders may share a journal if their identities are equal.
pub type Identity = Vec<(String, String)>;

/// Encodes the start of a journal: the magic and the first record, which holds the identity.
pub fn encode_head(identity: &Identity) -> Vec<u8> {
    let mut text = Vec::new();
    for (keyword, value) in identity {
        for part in [keyword, value] {
            text.extend((part.len() as u32).to_le_bytes());
            text.extend(part.as_bytes());
        }
    }
    [MAGIC, &with_length_and_crc(&text)].concat()
}

fn read_identity(mut bytes: &[u8]) -> Option<Identity> {
    let mut texts = Vec::new();
    while !bytes.is_empty() {
        let (length, rest) = bytes.split_first_chunk::<4>()?;
        let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        texts.push(String::from_utf8(text.to_vec()).ok()?);
        bytes = rest;
    }
    let (pairs, []) = texts.as_chunks::<2>() else { return None };
    Some(pairs.iter().cloned().map(|[keyword, value]| (keyword, value)).collect())
}

/// Appends a frame in one write, so that a kill leaves the record complete or truncated, never mixed with another.
pub fn append(out: &mut impl Write, record: &Record) -> io::Result<()> {
    out.write_all(&with_length_and_crc(&record.bytes()))
}

/// Encodes one record: length, CRC-32 and bytes.
fn with_length_and_crc(bytes: &[u8]) -> Vec<u8> {
    let mut all = (bytes.len() as u32).to_le_bytes().to_vec();
    all.extend(crc32fast::hash(bytes).to_le_bytes());
    all.extend(bytes);
    all
}

/// The intact records of a journal.
#[derive(Debug, PartialEq, Eq)]
pub struct Journal {
    pub identity: Identity,
    /// Records, each with the length of the journal up to its end.
    pub records: Vec<(Record, u64)>,
    /// Length of the head in bytes.
    pub head: u64,
}

impl Journal {
    /// Number of records up to the last settled one whose lengths and checksums match the body.
    pub fn settled_count(&self, body: impl Read) -> usize {
        let mut body = BufReader::with_capacity(1 << 16, body);
        let (mut at, mut settled) = (0, 0);
        for (i, (record, _)) in self.records.iter().enumerate() {
            let Some(gained) = record.body.checked_sub(at) else { break };
            let mut crc = CrcWriter(crc32fast::Hasher::new());
            match io::copy(&mut body.by_ref().take(gained), &mut crc) {
                Ok(n) if n == gained && crc.0.finalize() == record.crc => {}
                _ => break,
            }
            at = record.body;
            if matches!(record.kept, KeptFrame::Settled(_)) {
                settled = i + 1;
            }
        }
        settled
    }
}

/// A writer that only updates a checksum.
struct CrcWriter(crc32fast::Hasher);

impl Write for CrcWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Reads a journal; `None` if its head is not complete.
pub fn read(mut from: impl Read) -> Option<Journal> {
    let mut magic = [0; MAGIC.len()];
    from.read_exact(&mut magic).ok()?;
    if magic != MAGIC {
        return None;
    }
    let mut length = MAGIC.len() as u64;
    let mut next = || -> Option<(Vec<u8>, u64)> {
        let (mut size, mut crc) = ([0; 4], [0; 4]);
        from.read_exact(&mut size).ok()?;
        from.read_exact(&mut crc).ok()?;
        let size = u64::from(u32::from_le_bytes(size));
        // The buffer grows with the bytes that are there, not with the length that a corrupt record states.
        let mut bytes = Vec::new();
        from.by_ref().take(size).read_to_end(&mut bytes).ok()?;
        length += 8 + size;
        let whole = bytes.len() as u64 == size && crc32fast::hash(&bytes) == u32::from_le_bytes(crc);
        whole.then_some((bytes, length))
    };
    let (bytes, head) = next()?;
    let identity = read_identity(&bytes)?;
    let mut records = Vec::new();
    while let Some((bytes, end)) = next() {
        let Some(record) = Record::read(&bytes) else { break };
        records.push((record, end));
    }
    Some(Journal { identity, records, head })
}

/// Delta encoder and decoder of the frames that an encoder still holds. A frame is stored as one bit for each block of 256 bytes, which is set
/// if the block differs from the previous frame, and then the blocks that differ. With a static camera only the moving parts take space.
#[derive(Default)]
pub struct FrameDelta {
    last: Vec<u8>,
}

const BLOCK_BYTES: usize = 256;

impl FrameDelta {
    /// Forgets the previous frame, so that the next one is stored whole.
    pub fn restart(&mut self) {
        self.last.clear();
    }

    /// Encodes the next frame into `out`, whose content is replaced.
    pub fn encode(&mut self, parts: &[&[u8]; 3], out: &mut Vec<u8>) {
        let length = parts.iter().map(|p| p.len()).sum();
        self.last.resize(length, 0);
        let blocks: usize = parts.iter().map(|p| p.len().div_ceil(BLOCK_BYTES)).sum();
        out.clear();
        out.resize(blocks.div_ceil(8), 0);
        let (mut at, mut block) = (0, 0);
        for bytes in parts.iter().flat_map(|p| p.chunks(BLOCK_BYTES)) {
            let last = &mut self.last[at..at + bytes.len()];
            if last != bytes {
                last.copy_from_slice(bytes);
                out[block / 8] |= 1 << (block % 8);
                out.extend_from_slice(bytes);
            }
            (at, block) = (at + bytes.len(), block + 1);
        }
    }

    /// Decodes the next frame. `lengths`: lengths of its parts, in total at most `max_bytes`. `None` if the bytes do not fit.
    pub fn decode(&mut self, bytes: &[u8], lengths: &[u32; 3], max_bytes: u64) -> Option<&[u8]> {
        if lengths.iter().map(|l| u64::from(*l)).sum::<u64>() > max_bytes {
            return None;
        }
        let lengths = lengths.map(|l| l as usize);
        let blocks: usize = lengths.iter().map(|l| l.div_ceil(BLOCK_BYTES)).sum();
        let (bits, mut rest) = bytes.split_at_checked(blocks.div_ceil(8))?;
        self.last.resize(lengths.iter().sum(), 0);
        let (mut at, mut block) = (0, 0);
        for length in lengths {
            let end = at + length;
            while at < end {
                let size = BLOCK_BYTES.min(end - at);
                if bits[block / 8] & (1 << (block % 8)) != 0 {
                    let (bytes, more) = rest.split_at_checked(size)?;
                    self.last[at..at + size].copy_from_slice(bytes);
                    rest = more;
                }
                (at, block) = (at + size, block + 1);
            }
        }
        rest.is_empty().then_some(&self.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> (Vec<u8>, Vec<Record>) {
        let identity = vec![("a".to_string(), "b".to_string()), (String::new(), "ü\n".to_string())];
        let span = Span { offset: 7, length: 9, crc: 11, part_lengths: [1, 2, 3] };
        let records = vec![
            Record { body: 10, crc: 1, kept: KeptFrame::Settled(vec![]) },
            Record { body: 20, crc: 2, kept: KeptFrame::Open(span) },
            Record { body: 1 << 40, crc: 3, kept: KeptFrame::Settled((0..200).collect()) },
        ];
        let mut bytes = encode_head(&identity);
        records.iter().for_each(|r| append(&mut bytes, r).unwrap());
        (bytes, records)
    }

    #[test]
    fn an_appended_journal_is_read_back_equal() {
        let (bytes, records) = sample();
        let journal = read(&bytes[..]).unwrap();
        assert_eq!(journal.identity[1].1, "ü\n");
        assert_eq!(journal.records.iter().map(|(r, _)| r.clone()).collect::<Vec<_>>(), records);
        assert_eq!(journal.records[2].1, bytes.len() as u64);
    }

    /// A journal that is truncated or corrupt at any byte gives the intact records before it.
    #[test]
    fn records_before_a_damaged_byte_are_read() {
        let (bytes, records) = sample();
        let whole = read(&bytes[..]).unwrap();
        let ends: Vec<u64> = whole.records.iter().map(|(_, end)| *end).collect();
        let expected = |good: usize| ends.iter().filter(|e| **e <= good as u64).count();
        for at in 0..bytes.len() {
            let cut = read(&bytes[..at]);
            assert_eq!(cut.is_some(), at as u64 >= whole.head, "cut at {at}");
            assert_eq!(cut.map_or(0, |j| j.records.len()), expected(at), "cut at {at}");
            for bit in 0..8 {
                let mut bent = bytes.clone();
                bent[at] ^= 1 << bit;
                let found = read(&bent[..]);
                let found: Vec<Record> = found.into_iter().flat_map(|j| j.records).map(|(r, _)| r).collect();
                assert_eq!(found, records[..expected(at)], "bit {bit} of byte {at}");
            }
        }
    }

    #[test]
    fn delta_encoded_frames_decode_to_the_same_bytes() {
        let lengths = [1000u32, 256, 10];
        let frame = |n: usize| -> Vec<u8> {
            (0..1266).map(|i| if i / 250 == n % 5 { (i * n) as u8 } else { 7 }).collect()
        };
        let (mut to, mut from, mut out) = (FrameDelta::default(), FrameDelta::default(), Vec::new());
        let mut sizes = Vec::new();
        for n in [1, 1, 2, 3, 7] {
            let f = frame(n);
            to.encode(&[&f[..1000], &f[1000..1256], &f[1256..]], &mut out);
            assert_eq!(from.decode(&out, &lengths, 1266).unwrap(), f);
            sizes.push(out.len());
            for cut in 0..out.len() {
                assert!(FrameDelta::default().decode(&out[..cut], &lengths, 1266).is_none());
            }
        }
        assert!(from.decode(&out, &lengths, 1265).is_none(), "the frame is larger than `max_bytes`");
        assert_eq!(sizes[1], 1, "nothing changed");
        assert!(sizes[2] < 1100);
        to.restart();
        let f = frame(7);
        to.encode(&[&f[..1000], &f[1000..1256], &f[1256..]], &mut out);
        assert!(out.len() >= 1266, "a restart writes everything again");
    }
}
