//! Written by us, read by the `gif` crate's decoder and by ffmpeg.

use choreo_importer_kit_testing::export::{SharedBytes, resumed};
use choreo_motion::FrameRate;
use choreo_plugin::{Exporter, Frame, VideoInfo};
use export_gif::GifExporter;
use std::io::Write;

const W: u32 = 96;
const H: u32 = 64;

/// A still gradient and a square that moves; `jump` changes every color.
fn scene(frame: u32, jump: bool) -> Frame {
    let mut rgba = Vec::new();
    for y in 0..H {
        for x in 0..W {
            let square = (10..30).contains(&y) && (frame * 4..frame * 4 + 20).contains(&x);
            let c =
                if square { [220, 40, 30] } else { [60 + (y * 2) as u8, 90 + (y * 2) as u8, 120 + x as u8] };
            rgba.extend(if jump { [c[2] / 2, c[0], c[1] / 3, 255] } else { [c[0], c[1], c[2], 255] });
        }
    }
    Frame { width: W, height: H, rgba }
}

fn encode(frames: &[Frame], fps: FrameRate) -> Vec<u8> {
    let out = SharedBytes::default();
    let options = Default::default();
    let info =
        VideoInfo { width: W, height: H, fps, frames: frames.len() as u64, provenance: vec![], options };
    let mut sink = GifExporter.begin(&info, Box::new(out.clone())).unwrap();
    for frame in frames {
        sink.frame(frame).unwrap();
    }
    sink.finish().unwrap();
    out.bytes()
}

/// Canvases as a player shows them, and delays.
fn decode(bytes: &[u8]) -> (Vec<Vec<u8>>, Vec<u16>) {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(bytes).unwrap();
    assert_eq!(decoder.repeat(), gif::Repeat::Infinite);
    let (mut canvas, mut all, mut delays) = (vec![0; (W * H * 4) as usize], vec![], vec![]);
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        for y in 0..usize::from(frame.height) {
            for x in 0..usize::from(frame.width) {
                let from = &frame.buffer[(y * usize::from(frame.width) + x) * 4..][..4];
                if from[3] > 0 {
                    let at = (y + usize::from(frame.top)) * W as usize + x + usize::from(frame.left);
                    canvas[at * 4..at * 4 + 4].copy_from_slice(from);
                }
            }
        }
        all.push(canvas.clone());
        delays.push(frame.delay);
    }
    (all, delays)
}

fn mean_error(a: &[u8], b: &[u8]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

fn frames() -> Vec<Frame> {
    (0..12).map(|i| scene(i, i >= 8)).collect()
}

#[test]
fn every_decoded_frame_is_close_to_its_source() {
    let frames = frames();
    let (shown, _) = decode(&encode(&frames, FrameRate { num: 30, den: 1 }));
    assert_eq!(shown.len(), frames.len());
    for (i, (shown, frame)) in shown.iter().zip(&frames).enumerate() {
        let error = mean_error(shown, &frame.rgba);
        assert!(error < 3.0, "frame {i}: mean error {error}");
        // Dithered, not flattened: a block's mean is nearer than its pixels.
        let block = |p: &[u8], c: usize| {
            let at = |x: u32, y: u32| f64::from(p[((y * W + x) * 4) as usize + c]);
            (0..64).map(|i| at(80 + i % 8, 48 + i / 8)).sum::<f64>() / 64.0
        };
        for c in 0..3 {
            assert!((block(shown, c) - block(&frame.rgba, c)).abs() < 2.5, "frame {i}, channel {c}");
        }
    }
    // The comparison can fail: the neighbor frame is not within the bound after the jump.
    assert!(mean_error(&shown[7], &frames[8].rgba) > 3.0);
}

#[test]
fn delays_add_up_to_the_frame_rate() {
    for (fps, hundredths) in [((30, 1), 40), ((25, 1), 48), ((30000, 1001), 40), ((24, 1), 50), ((60, 1), 20)]
    {
        let (_, delays) = decode(&encode(&frames(), FrameRate { num: fps.0, den: fps.1 }));
        assert_eq!(delays.iter().map(|d| u32::from(*d)).sum::<u32>(), hundredths, "{fps:?}: {delays:?}");
    }
}

#[test]
fn unchanged_frames_take_few_bytes_and_encoding_is_deterministic() {
    let still: Vec<Frame> = (0..50).map(|_| scene(0, false)).collect();
    let fps = FrameRate { num: 30, den: 1 };
    let one = encode(&still[..1], fps).len();
    let fifty = encode(&still, fps);
    assert!(fifty.len() < one + 50 * 40, "{} against {one} for one", fifty.len());
    assert_eq!(fifty, encode(&still, fps));
}

#[test]
fn ffmpeg_decodes_the_same_images() {
    let frames = frames();
    let bytes = encode(&frames, FrameRate { num: 25, den: 1 });
    let spawned = std::process::Command::new("ffmpeg")
        .args([
            "-v",
            "error",
            "-f",
            "gif",
            "-i",
            "-",
            "-vsync",
            "passthrough",
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgba",
            "-",
        ])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn();
    let Ok(mut ffmpeg) = spawned else {
        println!("SKIP 1: ffmpeg is not installed");
        return;
    };
    let mut stdin = ffmpeg.stdin.take().unwrap();
    let feed = {
        let bytes = bytes.clone();
        std::thread::spawn(move || stdin.write_all(&bytes))
    };
    let out = ffmpeg.wait_with_output().unwrap();
    feed.join().unwrap().unwrap();
    let (shown, _) = decode(&bytes);
    let shown = shown.concat();
    assert_eq!(out.stdout.len(), shown.len());
    assert_eq!(mean_error(&out.stdout, &shown), 0.0);
}

#[test]
fn too_large_sizes_and_zero_frames_are_errors() {
    let mut info = VideoInfo {
        width: 70000,
        height: 4,
        fps: FrameRate { num: 30, den: 1 },
        frames: 1,
        provenance: vec![],
        options: Default::default(),
    };
    let error = GifExporter.begin(&info, Box::new(Vec::new())).err().unwrap().to_string();
    assert_eq!(error, "GIF: 70000×4 is too large, at most 65535 each way");
    info.width = 4;
    let sink = GifExporter.begin(&info, Box::new(Vec::new())).unwrap();
    assert!(sink.finish().unwrap_err().to_string().contains("at least one image"));
}

#[test]
fn a_resumed_gif_has_the_same_bytes() {
    let frames = frames();
    let mut info = VideoInfo {
        width: W,
        height: H,
        fps: FrameRate { num: 30, den: 1 },
        frames: frames.len() as u64,
        provenance: vec![("made".into(), "a\nb".into())],
        options: Default::default(),
    };
    let whole = resumed(&GifExporter, &info, &frames, frames.len()).unwrap();
    assert!(whole.ends_with(b";"));
    for cut in 1..frames.len() {
        assert!(resumed(&GifExporter, &info, &frames, cut).unwrap() == whole, "after {cut} frames");
    }
    assert!(whole.windows(9).any(|w| w == b"made: a\nb"), "the comment tells how it was made");
    // The comparison can fail: other frames give other bytes.
    info.frames -= 1;
    assert!(resumed(&GifExporter, &info, &frames[1..], 3).unwrap() != whole);
    // A stored state that was damaged is an error.
    for state in [vec![], vec![0; 17], vec![0; 19], vec![0xff; 17 + 3]] {
        assert!(GifExporter.resume(&info, &[state], &mut &whole[..], Box::new(Vec::new())).is_err());
    }
    assert!(GifExporter.resume(&info, &[vec![1; 17 + 3]], &mut &b""[..], Box::new(Vec::new())).is_err());
}

/// `repeat` writes the same bytes as a second call of `frame` with the same image.
#[test]
fn repeated_frames_give_the_same_bytes() {
    let fps = FrameRate { num: 30, den: 1 };
    let frames: Vec<Frame> = [0, 0, 0, 3, 3, 4].map(|i| scene(i, i == 4)).to_vec();
    let out = SharedBytes::default();
    let info =
        VideoInfo { width: W, height: H, fps, frames: 6, provenance: vec![], options: Default::default() };
    let mut sink = GifExporter.begin(&info, Box::new(out.clone())).unwrap();
    let mut before: Option<&Frame> = None;
    for frame in &frames {
        match before {
            // The frame given with it is not read.
            Some(same) if same == frame => sink.repeat(&scene(9, false)).unwrap(),
            _ => sink.frame(frame).unwrap(),
        }
        before = Some(frame);
    }
    sink.finish().unwrap();
    assert!(out.bytes() == encode(&frames, fps));
}
