//! Written by us, decoded frame by frame.

use choreo_importer_kit_testing::export::SharedBytes;
use choreo_motion::FrameRate;
use choreo_plugin::{Exporter, Frame, VideoInfo};
use export_apng::ApngExporter;
use image::codecs::png::PngDecoder;
use image::{AnimationDecoder, ImageDecoder};
use std::io::Cursor;

const W: u32 = 40;
const H: u32 = 24;

/// A square, half transparent, that moves and stands still for a frame, on a transparent gradient; the last frame changes everything.
fn scene(frame: u32) -> Frame {
    let at = [3, 9, 9, 20, 39][frame as usize];
    let mut rgba = Vec::new();
    for y in 0..H {
        for x in 0..W {
            let square = (5..15).contains(&y) && (at..at + 8).contains(&x);
            let color = if square { [200, 40, 30, 128] } else { [x as u8 * 4, y as u8 * 8, 77, x as u8] };
            rgba.extend(if frame == 4 { [color[2], color[0], color[1], 255] } else { color });
        }
    }
    Frame { width: W, height: H, rgba }
}

fn encode(frames: &[Frame], plays: Option<f64>) -> Vec<u8> {
    let out = SharedBytes::default();
    let mut info = VideoInfo {
        width: W,
        height: H,
        fps: FrameRate { num: 30_000, den: 1001 },
        frames: frames.len() as u64,
        provenance: vec![("Software".into(), "choreo – test".into())],
        options: Default::default(),
    };
    info.options.0.extend(plays.map(|plays| ("plays".into(), choreo_plugin::OptionValue::Number(plays))));
    let mut sink = ApngExporter.begin(&info, Box::new(out.clone())).unwrap();
    for frame in frames {
        sink.frame(frame).unwrap();
    }
    sink.finish().unwrap();
    out.bytes()
}

#[test]
fn decoded_frames_equal_the_source() {
    let frames: Vec<Frame> = (0..5).map(scene).collect();
    let bytes = encode(&frames, None);
    let decoder = PngDecoder::new(Cursor::new(&bytes)).unwrap();
    assert!(decoder.is_apng().unwrap() && decoder.dimensions() == (W, H));
    let read = decoder.apng().unwrap().into_frames().collect_frames().unwrap();
    assert_eq!(read.len(), frames.len());
    for (number, (read, frame)) in read.iter().zip(&frames).enumerate() {
        assert!(read.buffer().as_raw()[..] == *frame.straight(), "frame {number}");
        let (num, den) = read.delay().numer_denom_ms();
        assert!((f64::from(num) / f64::from(den) - 1001.0 / 30.0).abs() < 0.01, "{num}/{den}");
    }
    let text = |needle: &str| bytes.windows(needle.len()).any(|w| w == needle.as_bytes());
    assert!(text("choreo – test"));
    // A frame without change is a pixel.
    let still: Vec<Frame> = (0..5).map(|_| scene(0)).collect();
    let (one, five) = (encode(&still[..1], None).len(), encode(&still, None).len());
    assert!(five - one < 4 * 120, "{one} bytes, {five} for five frames");
}

#[test]
fn wrong_frame_sizes_and_counts_are_errors() {
    let frames = [scene(0), scene(1)];
    let bytes = encode(&frames, Some(3.0));
    // The chunk acTL: number of frames, number of plays.
    let at = bytes.windows(4).position(|w| w == b"acTL").unwrap() + 4;
    assert_eq!(bytes[at..at + 8], [0, 0, 0, 2, 0, 0, 0, 3]);
    let fps = FrameRate { num: 30, den: 1 };
    let (provenance, options) = (Vec::new(), Default::default());
    let info = VideoInfo { width: W, height: H, fps, frames: 2, provenance, options };
    let mut sink = ApngExporter.begin(&info, Box::new(Vec::new())).unwrap();
    let error = sink.frame(&Frame { width: 1, height: 1, rgba: vec![0; 4] }).unwrap_err();
    assert_eq!(error.to_string(), "a frame of 1×1 in an APNG of 40×24");
    sink.frame(&frames[0]).unwrap();
    assert!(sink.finish().is_err(), "one frame of two");
}
