//! Written by us, decoded frame by frame by `image-webp`, and by libwebp where Python's Pillow is there (`core/cli/tests/exports/passes.rs`).

use choreo_importer_kit_testing::export::{SharedBytes, resumed};
use choreo_plugin::motion::FrameRate;
use choreo_plugin::{Exporter, Frame, OptionValue, VideoInfo};
use export_webp::WebpExporter;
use image_webp::{LoopCount, WebPDecoder};
use std::io::Cursor;

const W: u32 = 41;
const H: u32 = 24;

/// A square, half transparent, that moves and stands still for a frame, on a gradient; the last frame changes everything.
fn scene(frame: u32) -> Frame {
    let at = [3, 9, 9, 20, 39][frame as usize];
    let mut rgba = Vec::new();
    for y in 0..H {
        for x in 0..W {
            let square = (5..15).contains(&y) && (at..at + 8).contains(&x);
            let color = if square { [100, 40, 30, 128] } else { [x as u8 * 4, y as u8 * 8, 77, 255] };
            rgba.extend(if frame == 4 { [color[2], color[0], color[1], 255] } else { color });
        }
    }
    Frame { width: W, height: H, rgba }
}

fn info(frames: u64) -> VideoInfo {
    let provenance = vec![("Software".into(), "choreo – <test>".into())];
    let fps = FrameRate { num: 30_000, den: 1001 };
    VideoInfo { width: W, height: H, fps, frames, provenance, options: Default::default() }
}

fn encode(frames: &[Frame], info: &VideoInfo) -> Vec<u8> {
    let out = SharedBytes::default();
    let mut sink = WebpExporter.begin(info, Box::new(out.clone())).unwrap();
    frames.iter().for_each(|frame| sink.frame(frame).unwrap());
    [sink.finish().unwrap(), out.bytes()].concat()
}

#[test]
fn decoded_frames_equal_the_source() {
    let frames: Vec<Frame> = (0..5).map(scene).collect();
    let bytes = encode(&frames, &info(5));
    let mut decoder = WebPDecoder::new(Cursor::new(&bytes)).unwrap();
    assert!(decoder.is_animated() && decoder.has_alpha() && decoder.dimensions() == (W, H));
    assert_eq!((decoder.num_frames(), decoder.loop_count()), (5, LoopCount::Forever));
    let mut begins = 0;
    for (number, frame) in (1..).zip(&frames) {
        let mut pixels = vec![0; decoder.output_buffer_size().unwrap()];
        begins += decoder.read_frame(&mut pixels).unwrap();
        assert!(pixels == *frame.straight(), "frame {number}");
        let exact = 1001.0 / 30.0 * f64::from(number);
        assert!((f64::from(begins) - exact).abs() <= 0.5, "frame {number} ends at {begins} ms, {exact}");
    }
    let about = String::from_utf8(decoder.xmp_metadata().unwrap().unwrap()).unwrap();
    assert!(about.contains("Software: choreo – &lt;test&gt;"), "{about}");
    // A frame without change is a pixel.
    let still: Vec<Frame> = (0..5).map(|_| scene(0)).collect();
    let (one, five) = (encode(&still[..1], &info(1)).len(), encode(&still, &info(5)).len());
    assert!(five - one < 4 * 120, "{one} bytes, {five} for five frames");
}

#[test]
fn a_resumed_animation_has_the_same_bytes() {
    let frames: Vec<Frame> = (0..5).map(scene).collect();
    let whole = encode(&frames, &info(5));
    for cut in 1..=5 {
        assert!(resumed(&WebpExporter, &info(5), &frames, cut).unwrap() == whole, "after {cut} frames");
    }
}

#[test]
fn wrong_frame_sizes_and_counts_are_errors() {
    let frames = [scene(0), scene(1)];
    let mut thrice = info(2);
    thrice.options.0.insert("plays".into(), OptionValue::Number(3.0));
    let bytes = encode(&frames, &thrice);
    let decoder = WebPDecoder::new(Cursor::new(&bytes)).unwrap();
    assert!(matches!(decoder.loop_count(), LoopCount::Times(times) if times.get() == 3));
    let mut sink = WebpExporter.begin(&info(2), Box::new(Vec::new())).unwrap();
    let error = sink.frame(&Frame { width: 1, height: 1, rgba: vec![0; 4] }).unwrap_err();
    assert_eq!(error.to_string(), "a frame of 1×1 in a WebP of 41×24");
    sink.frame(&frames[0]).unwrap();
    assert_eq!(sink.finish().unwrap_err().to_string(), "the WebP needs 2 frames, but got 1");
    let wide = VideoInfo { width: 16_385, ..info(1) };
    assert!(WebpExporter.begin(&wide, Box::new(Vec::new())).is_err());
}
