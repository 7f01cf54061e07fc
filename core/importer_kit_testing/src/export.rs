//! Tests of exporters: bytes that they write, resumed renders, and joined pieces.

use choreo_plugin::{Exporter, Frame, Mark, VideoInfo};
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

/// A writer whose bytes can be read while an exporter owns a copy of it.
#[derive(Clone, Debug, Default)]
pub struct SharedBytes(Arc<Mutex<Vec<u8>>>);

impl SharedBytes {
    /// The bytes written so far.
    pub fn bytes(&self) -> Vec<u8> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Write for SharedBytes {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Encodes a video whose render is stopped after `cut` frames and resumed from its last settled mark. `None` if nothing was settled by
/// then. Panics if the exporter cannot resume.
pub fn resumed(exporter: &dyn Exporter, info: &VideoInfo, frames: &[Frame], cut: usize) -> Option<Vec<u8>> {
    let out = SharedBytes::default();
    let mut sink = exporter.begin(info, Box::new(out.clone())).unwrap();
    let (mut states, mut settled, mut length, mut open) = (vec![], 0, 0, vec![]);
    for (i, frame) in frames[..cut].iter().enumerate() {
        sink.frame(frame).unwrap();
        match sink.mark() {
            Mark::Nothing => panic!("frame {i}: the exporter cannot resume after it"),
            Mark::Settled(state) => {
                states.push(state);
                (settled, length) = (i + 1, out.bytes().len());
                open.clear();
            }
            Mark::Open(parts) => open.push(parts.concat()),
        }
    }
    assert_eq!(settled + open.len(), cut);
    if states.is_empty() {
        return None;
    }
    // The exporter's writes after the cut are lost.
    let so_far = out.bytes()[..length].to_vec();
    drop(sink);
    let mut out = SharedBytes::default();
    out.write_all(&so_far).unwrap();
    let mut sink = exporter.resume(info, &states, &mut &so_far[..], Box::new(out.clone())).unwrap();
    for kept in &open {
        sink.again(kept).unwrap();
    }
    for frame in &frames[cut..] {
        sink.frame(frame).unwrap();
    }
    let mut bytes = sink.finish().unwrap();
    bytes.extend_from_slice(&out.bytes());
    Some(bytes)
}

/// Encodes the pieces of a video separately, the last first, and joins them; the frames behind the last whole piece follow. The bytes are
/// those of one render, unless a frame depends on another piece. Panics if the format has no pieces.
pub fn joined_pieces(exporter: &dyn Exporter, info: &VideoInfo, frames: &[Frame]) -> Vec<u8> {
    let length = exporter.piece(info).expect("the format has pieces").get() as usize;
    let mut out = SharedBytes::default();
    drop(exporter.begin(info, Box::new(out.clone())).unwrap());
    let pieces = frames.chunks_exact(length);
    let rest = pieces.remainder();
    let alone = |frames: &[Frame]| {
        let out = SharedBytes::default();
        let mut sink = exporter.resume(info, &[], &mut std::io::empty(), Box::new(out.clone())).unwrap();
        for (i, frame) in frames.iter().enumerate() {
            sink.frame(frame).unwrap();
            match sink.mark() {
                Mark::Settled(state) if i + 1 == length => return (state, out.bytes()),
                Mark::Open(_) if i + 1 < length => {}
                mark => panic!("frame {i} of a piece of {length}: {mark:?}"),
            }
        }
        unreachable!("a piece has at least one frame")
    };
    let mut made: Vec<(Vec<u8>, Vec<u8>)> = pieces.rev().map(alone).collect();
    made.reverse();
    let (states, bodies): (Vec<_>, Vec<_>) = made.into_iter().unzip();
    bodies.iter().for_each(|body| out.write_all(body).unwrap());
    let mut sink = exporter.resume(info, &states, &mut std::io::empty(), Box::new(out.clone())).unwrap();
    rest.iter().for_each(|frame| sink.frame(frame).unwrap());
    let mut bytes = sink.finish().unwrap();
    bytes.extend_from_slice(&out.bytes());
    bytes
}
