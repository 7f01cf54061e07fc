//! Written by us, read by the `png` crate's decoder and by ffmpeg.

use choreo_importer_kit_testing::export::SharedBytes;
use choreo_motion::FrameRate;
use choreo_plugin::glam::Vec4;
use choreo_plugin::{Exporter, FloatFrame, Frame, FrameWish, VideoInfo};
use export_png::PngExporter;
use std::io::Write;

/// Gradients, an edge and some noise; `alpha` in the first pixel.
fn test_frame(width: u32, height: u32, alpha: u8) -> Frame {
    let mut rgba = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let noise = (x.wrapping_mul(2654435761) ^ y.wrapping_mul(40503)) >> 28;
            rgba.extend([(x * 255 / width) as u8, (y * 255 / height) as u8, (noise * 16) as u8, 255]);
        }
    }
    rgba[3] = alpha;
    Frame { width, height, rgba }
}

fn info(frame: &Frame) -> VideoInfo {
    VideoInfo {
        width: frame.width,
        height: frame.height,
        fps: FrameRate { num: 30, den: 1 },
        frames: 1,
        provenance: vec![
            ("Software".into(), "choreo".into()),
            ("choreo:script".into(), "Straße.rhai".into()),
        ],
        options: Default::default(),
    }
}

fn encode(frame: &Frame, info: &VideoInfo) -> Vec<u8> {
    let out = SharedBytes::default();
    let mut sink = PngExporter.begin(info, Box::new(out.clone())).unwrap();
    sink.frame(frame).unwrap();
    sink.finish().unwrap();
    out.bytes()
}

#[test]
fn opaque_images_are_written_as_rgb_with_text_chunks() {
    for (w, h) in [(61, 37), (1, 1), (1280, 3)] {
        let frame = test_frame(w, h, 255);
        for compression in ["fast", "small"] {
            let mut info = info(&frame);
            let value = export_png::MANIFEST.parse_option("compression", compression).unwrap();
            info.options.0.insert("compression".into(), value);
            let bytes = encode(&frame, &info);
            let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            let head = reader.info();
            assert_eq!((head.width, head.height, head.color_type), (w, h, png::ColorType::Rgb));
            assert!(head.srgb.is_some());
            assert_eq!(head.uncompressed_latin1_text[0].text, "choreo");
            assert_eq!(head.utf8_text[0].get_text().unwrap(), "Straße.rhai");
            let expected: Vec<u8> = frame.rgba.chunks(4).flat_map(|p| p[..3].to_vec()).collect();
            assert_eq!(pixels, expected);
        }
    }
}

fn with_options(frame: &Frame, options: &[(&str, &str)]) -> VideoInfo {
    let mut info = info(frame);
    for (name, value) in options {
        let value = export_png::MANIFEST.parse_option(name, value).unwrap();
        info.options.0.insert(name.to_string(), value);
    }
    info
}

#[test]
fn alpha_is_straight_unless_the_option_premultiplies_it() {
    // Light 0.2, 0.1 and 0.05 at an alpha of 0.2 is light 1, 0.5 and 0.25 that covers a fifth.
    let frame = Frame { width: 1, height: 1, rgba: vec![124, 89, 63, 51] };
    let pixel = |alpha: &str| {
        let bytes = encode(&frame, &with_options(&frame, &[("alpha", alpha)]));
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    assert_eq!(pixel("premultiplied"), frame.rgba);
    let straight = pixel("straight");
    let expected = [255, 188, 137, 51];
    assert!(straight.iter().zip(expected).all(|(is, should)| is.abs_diff(should) <= 2), "{straight:?}");
}

#[test]
fn sixteen_bits_keep_values_that_eight_bits_round() {
    let light = |i: u32| 1e-3 + 1e-5 * i as f32;
    let color: Vec<Vec4> = (0..64).map(|i| Vec4::new(light(i), 0.5 * light(i), 2.0, 1.0)).collect();
    let frame = FloatFrame { color, ..FloatFrame::new([64, 1]) };
    let mut info = with_options(&test_frame(64, 1, 255), &[("depth", "16")]);
    assert_eq!(PngExporter.wish(&info.options).unwrap(), FrameWish::Finished);
    let written = |info: &VideoInfo| {
        let out = SharedBytes::default();
        let mut sink = PngExporter.begin(info, Box::new(out.clone())).unwrap();
        sink.float_frame(&frame).unwrap();
        sink.finish().unwrap();
        out.bytes()
    };
    let bytes = written(&info);
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    assert_eq!(
        (reader.info().bit_depth, reader.info().color_type),
        (png::BitDepth::Sixteen, png::ColorType::Rgb)
    );
    for (i, pixel) in (0..64).zip(pixels.chunks(6)) {
        let code = |at: usize| f64::from(u16::from_be_bytes([pixel[at], pixel[at + 1]]));
        let expected = f64::from(light(i)) * 12.92 * 65535.0;
        assert!((code(0) - expected).abs() <= 0.51, "{i}: {} for {expected}", code(0));
        assert_eq!(code(4), 65535.0);
    }
    info.provenance.push(("choreo:time".into(), "2.5".into()));
    let out = SharedBytes::default();
    assert!(PngExporter.with_provenance(&info, &bytes, Box::new(out.clone())).unwrap());
    assert!(out.bytes() == written(&info));
}

#[test]
fn one_transparent_pixel_keeps_the_alpha_channel() {
    let frame = test_frame(20, 10, 7);
    let bytes = encode(&frame, &with_options(&frame, &[("alpha", "premultiplied")]));
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    assert_eq!(reader.info().color_type, png::ColorType::Rgba);
    assert_eq!(pixels, frame.rgba);
}

#[test]
fn ffmpeg_reads_the_same_pixels() {
    let frame = test_frame(64, 40, 200);
    let bytes = encode(&frame, &with_options(&frame, &[("alpha", "premultiplied")]));
    let spawned = std::process::Command::new("ffmpeg")
        .args(["-v", "error", "-f", "png_pipe", "-i", "-", "-f", "rawvideo", "-pix_fmt", "rgba", "-"])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn();
    let Ok(mut ffmpeg) = spawned else {
        println!("SKIP 1: ffmpeg is not installed");
        return;
    };
    ffmpeg.stdin.take().unwrap().write_all(&bytes).unwrap();
    let out = ffmpeg.wait_with_output().unwrap();
    assert!(out.status.success());
    assert_eq!(out.stdout, frame.rgba);
}

#[test]
fn two_frames_and_zero_frames_are_errors() {
    let frame = test_frame(2, 2, 255);
    let mut sink = PngExporter.begin(&info(&frame), Box::new(Vec::new())).unwrap();
    sink.frame(&frame).unwrap();
    let error = sink.frame(&frame).unwrap_err().to_string();
    assert_eq!(error, "a PNG holds one image, and this one has it already");
    let empty = PngExporter.begin(&info(&frame), Box::new(Vec::new())).unwrap();
    assert_eq!(empty.finish().unwrap_err().to_string(), "a PNG needs one image, and there was none");
    let mut sink = PngExporter.begin(&info(&frame), Box::new(Vec::new())).unwrap();
    let bad = Frame { width: 2, height: 2, rgba: vec![0; 15] };
    assert_eq!(sink.frame(&bad).unwrap_err().to_string(), "a frame of 2×2 has 15 bytes, must have 16");
}

/// A file made of another's pixels has the bytes that encoding the image gives, opaque or not.
#[test]
fn provenance_is_replaced_without_changing_the_pixels() {
    for alpha in [255, 7] {
        let frame = test_frame(61, 40, alpha);
        let encoded = |info: &VideoInfo| {
            let out = SharedBytes::default();
            let mut sink = PngExporter.begin(info, Box::new(out.clone())).unwrap();
            sink.frame(&frame).unwrap();
            sink.finish().unwrap();
            out.bytes()
        };
        let first = info(&frame);
        let mut later = first.clone();
        later.provenance.push(("choreo:time".into(), "2.5 s".into()));
        let out = SharedBytes::default();
        let made = encoded(&first);
        assert!(PngExporter.with_provenance(&later, &made, Box::new(out.clone())).unwrap());
        assert!(out.bytes() == encoded(&later) && out.bytes() != made, "alpha {alpha}");
        // Bytes that are no PNG are refused, and nothing is written.
        let out = SharedBytes::default();
        assert!(!PngExporter.with_provenance(&later, &made[..30], Box::new(out.clone())).unwrap());
        assert!(out.bytes().is_empty());
    }
}
