//! The files of a render that was killed: journals of any bytes, journals cut or bent, kept frames, and exporters that go on from
//! their own states (the same file as without the stop) or from any bytes.
#![no_main]

use choreo_command_line::output::journal::{self, FrameDelta, Identity, KeptFrame, Record, Span};
use choreo_motion::FrameRate;
use choreo_plugin::{Exporter, Frame, FrameSink, Mark, VideoInfo};
use export_gif::GifExporter;
use export_mp4::Mp4Exporter;
use export_y4m::Y4mExporter;
use libfuzzer_sys::arbitrary::{Result, Unstructured};
use libfuzzer_sys::fuzz_target;
use std::io::Write;
use std::sync::{Arc, Mutex};

/// A journal that is read is exactly the one that would be written.
fn any_journal(bytes: &[u8]) {
    let Some(found) = journal::read(bytes) else { return };
    let mut again = journal::encode_head(&found.identity);
    assert!(found.head == again.len() as u64);
    for (record, end) in &found.records {
        journal::append(&mut again, record).expect("writing to a vector cannot fail");
        assert!(*end == again.len() as u64);
    }
    assert!(bytes.starts_with(&again));
    assert!(found.settled_count(bytes) <= found.records.len());
}

fn text(u: &mut Unstructured) -> Result<String> {
    let length = u.int_in_range(0..=20)?;
    Ok(String::from_utf8_lossy(u.bytes(length)?).into_owned())
}

fn record(u: &mut Unstructured) -> Result<Record> {
    let kept = match u.arbitrary()? {
        true => {
            let length = u.int_in_range(0..=40)?;
            KeptFrame::Settled(u.bytes(length)?.to_vec())
        }
        false => KeptFrame::Open(Span {
            offset: u.arbitrary()?,
            length: u.arbitrary()?,
            crc: u.arbitrary()?,
            part_lengths: u.arbitrary()?,
        }),
    };
    Ok(Record { body: u.arbitrary()?, crc: u.arbitrary()?, kept })
}

/// Cut, or with a bit turned over: what lies whole before the damage comes back, and nothing else.
fn damaged_journal(u: &mut Unstructured) -> Result<()> {
    let pairs = u.int_in_range(0..=3)?;
    let identity = (0..pairs).map(|_| Ok((text(u)?, text(u)?))).collect::<Result<Identity>>()?;
    let count = u.int_in_range(0..=5)?;
    let records = (0..count).map(|_| record(u)).collect::<Result<Vec<_>>>()?;
    let mut bytes = journal::encode_head(&identity);
    let mut ends = vec![bytes.len()];
    for record in &records {
        journal::append(&mut bytes, record).expect("writing to a vector cannot fail");
        ends.push(bytes.len());
    }
    let at = u.choose_index(bytes.len())?;
    match u.arbitrary()? {
        true => bytes.truncate(at),
        false => bytes[at] ^= 1 << u.int_in_range(0..=7)?,
    }
    any_journal(&bytes);
    let whole = ends.iter().filter(|e| **e <= at).count();
    match journal::read(&bytes[..]) {
        None => assert_eq!(whole, 0),
        Some(found) => {
            assert_eq!(found.identity, identity);
            assert_eq!(found.records.len(), whole - 1);
            assert!(found.records.iter().zip(&records).all(|((a, _), b)| a == b));
        }
    }
    Ok(())
}

fn kept_frames(u: &mut Unstructured) -> Result<()> {
    let lengths = [u.int_in_range(0..=1000u32)?, u.int_in_range(0..=600)?, u.int_in_range(0..=600)?];
    let total: usize = lengths.iter().map(|l| *l as usize).sum();
    let (mut to, mut from, mut out) = (FrameDelta::default(), FrameDelta::default(), Vec::new());
    let mut frame = vec![0u8; total];
    for _ in 0..u.int_in_range(1..=4)? {
        for _ in 0..u.int_in_range(0..=3)? {
            let changed = u.int_in_range(0..=total)?;
            frame[changed..].iter_mut().take(300).for_each(|b| *b = b.wrapping_mul(7).wrapping_add(1));
        }
        let (a, rest) = frame.split_at(lengths[0] as usize);
        let (b, c) = rest.split_at(lengths[1] as usize);
        to.encode(&[a, b, c], &mut out);
        assert_eq!(from.decode(&out, &lengths, total as u64), Some(&frame[..]));
    }
    let parts: [u32; 3] = u.arbitrary()?;
    if let Some(frame) = from.decode(u.peek_bytes(u.len()).unwrap_or_default(), &parts, 10_000) {
        assert!(frame.len() <= 10_000);
    }
    Ok(())
}

#[derive(Clone, Default)]
struct Bytes(Arc<Mutex<Vec<u8>>>);

impl Bytes {
    fn all(&self) -> Vec<u8> {
        self.0.lock().expect("no thread panics with it").clone()
    }
}

impl Write for Bytes {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().expect("no thread panics with it").extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Images that move a little, or a lot.
fn random_frames(u: &mut Unstructured, [width, height]: [u32; 2]) -> Result<Vec<Frame>> {
    let mut rgba = vec![255; (width * height * 4) as usize];
    let mut frames = Vec::new();
    for _ in 0..u.int_in_range(1..=5)? {
        for _ in 0..u.int_in_range(0..=4)? {
            let (from, to) = (u.choose_index(rgba.len())?, u.choose_index(rgba.len())?);
            let (value, step) = (u.arbitrary::<u8>()?, u.arbitrary::<u8>()?);
            for (i, byte) in rgba[from.min(to)..].iter_mut().take(from.abs_diff(to)).enumerate() {
                *byte = value.wrapping_add(step.wrapping_mul(i as u8));
            }
        }
        frames.push(Frame { width, height, rgba: rgba.clone() });
    }
    Ok(frames)
}

/// The length of the body at the last settled mark, the states up to there, and the frames kept since.
#[derive(Clone, Default)]
struct Stopped {
    length: usize,
    states: Vec<Vec<u8>>,
    kept: Vec<Vec<u8>>,
}

fn going_on(u: &mut Unstructured) -> Result<()> {
    let exporters: [&dyn Exporter; 3] = [&GifExporter, &Y4mExporter, &Mp4Exporter];
    let exporter = exporters[[0, 0, 0, 0, 0, 1, 1, 2][u.choose_index(8)?]];
    // H.264 begins at 16 pixels.
    let least = if exporter.head_comes_last() { 16 } else { 1 };
    let size = [u.int_in_range(least..=20)?, u.int_in_range(least..=20)?];
    let frames = random_frames(u, size)?;
    let info = VideoInfo {
        width: size[0],
        height: size[1],
        fps: FrameRate { num: 30, den: 1 },
        frames: frames.len() as u64,
        provenance: vec![("choreo:source".into(), "fuzz".into())],
        options: exporter.manifest().complete(&Default::default()).expect("the defaults"),
    };
    let whole = Bytes::default();
    let mut sink = exporter.begin(&info, Box::new(whole.clone())).expect("writing to a vector cannot fail");
    let (mut stops, mut stop) = (Vec::new(), Stopped::default());
    for frame in &frames {
        sink.frame(frame).expect("a frame of the right size");
        match sink.mark() {
            Mark::Nothing => {}
            Mark::Settled(state) => {
                stop.states.push(state);
                (stop.length, stop.kept) = (whole.all().len(), Vec::new());
            }
            Mark::Open(parts) => stop.kept.push(parts.concat()),
        }
        stops.push(stop.clone());
    }
    let finished = |sink: Box<dyn FrameSink>, body: &Bytes| -> Vec<u8> {
        let head = sink.finish().expect("it has frames");
        [head, body.all()].concat()
    };
    let whole = (finished(sink, &whole), whole.all());
    let at = u.choose_index(stops.len())?;
    let stop = &stops[at];
    let body = Bytes::default();
    let mut so_far = &whole.1[..stop.length];
    let mut sink = if stop.states.is_empty() {
        exporter.begin(&info, Box::new(body.clone()))
    } else {
        exporter.resume(&info, &stop.states, &mut so_far, Box::new(body.clone()))
    }
    .expect("our own state");
    // The resumed program appends to the existing bytes.
    let before = if stop.states.is_empty() { 0 } else { stop.length };
    stop.kept.iter().for_each(|kept| sink.again(kept).expect("our own frame"));
    frames[at + 1..].iter().for_each(|frame| sink.frame(frame).expect("a frame of the right size"));
    let head = sink.finish().expect("it has frames");
    let again = [&head, &whole.1[..before], &body.all()].concat();
    assert!(again == whole.0, "{}: other bytes after {} frames", exporter.manifest().name, at + 1);

    // States and a body that nobody has written.
    let count = u.int_in_range(1..=3)?;
    let mut states = stops[at].states.clone();
    for _ in 0..count {
        let length = u.int_in_range(0..=60)?;
        states.push(u.bytes(length)?.to_vec());
    }
    let mut bent = whole.1[..stop.length].to_vec();
    if let (false, Ok(index)) = (bent.is_empty(), u.choose_index(bent.len())) {
        bent[index] = u.arbitrary()?;
    }
    if u.arbitrary()? {
        // Only the body is wrong.
        states = stops[at].states.clone();
    }
    if let Ok(mut sink) = exporter.resume(&info, &states, &mut &bent[..], Box::new(Bytes::default())) {
        let length = u.int_in_range(0..=100)?;
        let _ = sink.again(u.bytes(length)?);
        let _ = sink.frame(&frames[0]);
        let _ = sink.finish();
    }
    Ok(())
}

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, rest)) = bytes.split_first() else { return };
    let mut u = Unstructured::new(rest);
    // Too few bytes is no finding.
    let _ = match kind % 8 {
        0 => Ok(any_journal(rest)),
        1..3 => damaged_journal(&mut u),
        3..5 => kept_frames(&mut u),
        _ => going_on(&mut u),
    };
});
