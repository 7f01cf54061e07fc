//! Written by us, read by ffmpeg.

use choreo_importer_kit_testing::export::{SharedBytes, joined_pieces, resumed};
use choreo_motion::FrameRate;
use choreo_plugin::{Exporter, Frame, VideoInfo};
use export_y4m::Y4mExporter;
use std::io::Write;
use std::process::{Command, Stdio};

fn info(width: u32, height: u32) -> VideoInfo {
    let fps = FrameRate { num: 30000, den: 1001 };
    VideoInfo { width, height, fps, frames: 3, provenance: vec![], options: Default::default() }
}

/// Bars of eight colors, wide enough that chroma halves cleanly, darker from frame to frame.
fn bars(width: u32, height: u32, frame: u32) -> Frame {
    let mut rgba = Vec::new();
    for _ in 0..height {
        for x in 0..width {
            let bar = x * 8 / width;
            let level = |bit: u32| if bar >> bit & 1 == 1 { 255 - 40 * frame as u8 } else { 20 };
            rgba.extend([level(2), level(1), level(0), 255]);
        }
    }
    Frame { width, height, rgba }
}

fn encode(width: u32, height: u32) -> Vec<u8> {
    let out = SharedBytes::default();
    let mut sink = Y4mExporter.begin(&info(width, height), Box::new(out.clone())).unwrap();
    for frame in 0..3 {
        sink.frame(&bars(width, height, frame)).unwrap();
    }
    sink.finish().unwrap();
    out.bytes()
}

#[test]
fn the_header_and_every_frame_have_their_length() {
    for (w, h) in [(64usize, 36usize), (63, 35), (1, 1)] {
        let bytes = encode(w as u32, h as u32);
        let header = bytes.iter().position(|b| *b == b'\n').unwrap() + 1;
        let text = std::str::from_utf8(&bytes[..header]).unwrap();
        assert!(text.starts_with(&format!("YUV4MPEG2 W{w} H{h} F30000:1001 Ip A1:1 C420mpeg2 ")), "{text}");
        let frame = 6 + w * h + 2 * w.div_ceil(2) * h.div_ceil(2);
        assert_eq!(bytes.len(), header + 3 * frame);
        for i in 0..3 {
            assert_eq!(&bytes[header + i * frame..][..6], b"FRAME\n");
        }
    }
}

#[test]
fn ffmpeg_reads_the_same_colors() {
    for (w, h, matrix) in [(640, 8, "bt601"), (1280, 8, "bt709")] {
        let spawned = Command::new("ffmpeg")
            .args(["-v", "error", "-f", "yuv4mpegpipe", "-i", "-", "-vf"])
            .arg(format!("scale=in_color_matrix={matrix}:flags=accurate_rnd+full_chroma_int"))
            .args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        let Ok(mut ffmpeg) = spawned else {
            println!("SKIP 2: ffmpeg is not installed");
            return;
        };
        let bytes = encode(w, h);
        let mut stdin = ffmpeg.stdin.take().unwrap();
        let feed = std::thread::spawn(move || stdin.write_all(&bytes));
        let out = ffmpeg.wait_with_output().unwrap();
        feed.join().unwrap().unwrap();
        let size = (w * h * 3) as usize;
        assert_eq!(out.stdout.len(), 3 * size, "{w}×{h}");
        for frame in 0..3 {
            let source = bars(w, h, frame as u32);
            for (i, pixel) in source.rgba.chunks(4).enumerate() {
                // The middle of each bar: chroma is shared between neighbors at the edges.
                let bar = w as usize / 8;
                if !(bar / 4..bar * 3 / 4).contains(&(i % w as usize % bar)) {
                    continue;
                }
                for c in 0..3 {
                    let got = i32::from(out.stdout[frame * size + i * 3 + c]);
                    assert!((got - i32::from(pixel[c])).abs() <= 4, "{pixel:?} channel {c}: {got}");
                }
            }
        }
    }
}

#[test]
fn a_frame_of_another_size_is_refused() {
    let mut sink = Y4mExporter.begin(&info(4, 4), Box::new(Vec::new())).unwrap();
    let error = sink.frame(&bars(4, 5, 0)).unwrap_err().to_string();
    assert_eq!(error, "a frame of 4×5 (80 bytes) in a video of 4×4");
}

#[test]
fn a_resumed_stream_has_the_same_bytes() {
    let frames: Vec<Frame> = (0..3).map(|f| bars(65, 33, f)).collect();
    let whole = encode(65, 33);
    for cut in 1..=3 {
        assert!(resumed(&Y4mExporter, &info(65, 33), &frames, cut).unwrap() == whole, "after {cut}");
    }
}

/// ffmpeg reads at most 95 bytes of header, so of a long identification as much as fits.
#[test]
fn the_header_has_a_short_provenance() {
    let mut info = info(16384, 16384);
    info.provenance = vec![("a".into(), "b".into()), ("choreo:id".into(), "0123456789abcdef".into())];
    for (size, id) in [(64, "0123456789abcdef"), (16384, "0123456789abc")] {
        (info.width, info.height) = (size, size);
        let out = SharedBytes::default();
        drop(Y4mExporter.begin(&info, Box::new(out.clone())).unwrap());
        let header = String::from_utf8(out.bytes()).unwrap();
        assert!(header.ends_with(&format!(" XCHOREO={id}\n")), "{header}");
        assert!(header.len() <= 96, "{header}");
    }
}

/// Frames made on several machines.
#[test]
fn joined_pieces_have_the_bytes_of_one_render() {
    let frames: Vec<Frame> = (0..3).map(|frame| bars(66, 34, frame)).collect();
    assert!(joined_pieces(&Y4mExporter, &info(66, 34), &frames) == encode(66, 34));
}
