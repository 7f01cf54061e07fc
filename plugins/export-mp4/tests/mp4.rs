//! Written by us, read by ffprobe and ffmpeg.

use choreo_importer_kit_testing::export::{SharedBytes, joined_pieces, resumed};
use choreo_motion::FrameRate;
use choreo_plugin::{Exporter, Frame, Mark, OptionValue, VideoInfo};
use export_mp4::Mp4Exporter;
use std::path::{Path, PathBuf};
use std::process::Command;

fn info(width: u32, height: u32, fps: (u32, u32), frames: u64) -> VideoInfo {
    let fps = FrameRate { num: fps.0, den: fps.1 };
    let provenance = vec![("script".into(), "dance.rhai".into())];
    VideoInfo { width, height, fps, frames, provenance, options: Default::default() }
}

/// A soft gradient, color bars and a disc that moves.
fn scene(width: u32, height: u32, frame: u32) -> Frame {
    const BARS: [[u8; 3]; 4] = [[230, 30, 30], [30, 200, 40], [40, 60, 220], [240, 240, 240]];
    let mut rgba = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (dx, dy) = (x as i32 - 40 - 5 * frame as i32, y as i32 - height as i32 / 3);
            let c = if y > height * 3 / 4 {
                BARS[(x * 4 / width) as usize]
            } else if dx * dx + dy * dy < 900 {
                [250, 180, 40]
            } else {
                [90 + (y * 60 / height) as u8, 110 + (y * 60 / height) as u8, 150]
            };
            rgba.extend([c[0], c[1], c[2], 255]);
        }
    }
    Frame { width, height, rgba }
}

fn encode(info: &VideoInfo) -> Vec<u8> {
    let out = SharedBytes::default();
    let mut sink = Mp4Exporter.begin(info, Box::new(out.clone())).unwrap();
    for frame in 0..info.frames {
        sink.frame(&scene(info.width, info.height, frame as u32)).unwrap();
    }
    let mut bytes = sink.finish().unwrap();
    bytes.extend_from_slice(&out.bytes());
    bytes
}

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = std::env::temp_dir().join(format!("choreo-mp4-test-{}-{name}.mp4", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    path
}

fn ffprobe(path: &Path, entries: &str) -> Option<String> {
    let out = Command::new("ffprobe")
        .args(["-v", "error", "-count_frames", "-show_entries", entries, "-of", "default=nk=0:nw=1"])
        .arg(path)
        .output();
    let Ok(out) = out else {
        println!("SKIP 1: ffprobe is not installed");
        return None;
    };
    assert!(out.status.success() && out.stderr.is_empty(), "{}", String::from_utf8_lossy(&out.stderr));
    Some(String::from_utf8(out.stdout).unwrap())
}

#[test]
fn players_see_rate_size_colors_and_provenance() {
    for (fps, rate) in [((30, 1), "30/1"), ((30000, 1001), "30000/1001"), ((24000, 1001), "24000/1001")] {
        let path = file(&rate.replace('/', "-"), &encode(&info(320, 180, fps, 12)));
        let entries = "stream=codec_name,width,height,r_frame_rate,avg_frame_rate,nb_read_frames,pix_fmt,\
                       color_range,color_space,color_transfer,color_primaries,duration_ts:format_tags=comment";
        let Some(text) = ffprobe(&path, entries) else { return };
        for line in [
            "codec_name=h264",
            "width=320",
            "height=180",
            "pix_fmt=yuv420p",
            "color_range=tv",
            "color_space=bt709",
            "color_transfer=bt709",
            "color_primaries=bt709",
            &format!("r_frame_rate={rate}"),
            &format!("avg_frame_rate={rate}"),
            &format!("duration_ts={}", 12 * fps.1),
            "nb_read_frames=12",
            "TAG:comment=script: dance.rhai",
        ] {
            assert!(text.lines().any(|l| l == line), "no {line} in\n{text}");
        }
        std::fs::remove_file(path).unwrap();
    }
}

#[test]
fn the_index_precedes_the_frames_and_encoding_is_deterministic() {
    let bytes = encode(&info(64, 48, (30, 1), 5));
    let place = |name: &[u8]| bytes.windows(4).position(|w| w == name).unwrap();
    assert!(place(b"ftyp") < place(b"moov") && place(b"moov") < place(b"mdat"));
    assert!(bytes == encode(&info(64, 48, (30, 1), 5)));
}

/// Patterns of all sizes that scroll: what a finer quantizer keeps more of, everywhere.
fn texture(width: u32, height: u32, frame: u32) -> Frame {
    let mut rgba = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let wave = |period: u32, by: u32| {
                let at = (x + 2 * frame + by * y) % period;
                (at.min(period - at) * 80 / period) as u8
            };
            let shade = 60 + wave(7, 1) + wave(23, 3) + wave(90, 2);
            rgba.extend([shade, shade.wrapping_add(wave(31, 0)), 200 - shade, 255]);
        }
    }
    Frame { width, height, rgba }
}

/// Mean error of the decoded images against their sources, levels of 255.
fn decoded_error(info: &VideoInfo, shift: u32) -> Option<(f64, usize)> {
    decoded_error_of(info, shift, scene)
}

fn decoded_error_of(info: &VideoInfo, shift: u32, scene: fn(u32, u32, u32) -> Frame) -> Option<(f64, usize)> {
    let frames: Vec<Frame> =
        (0..info.frames).map(|frame| scene(info.width, info.height, frame as u32)).collect();
    let bytes = encode_frames(info, &frames);
    let path = file(&format!("q{}x{}s{shift}", info.width, info.options.0.len()), &bytes);
    let out = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(&path)
        .args(["-vf", "scale=in_color_matrix=bt709:flags=accurate_rnd+full_chroma_int+bilinear"])
        .args(["-f", "rawvideo", "-pix_fmt", "rgba", "-"])
        .output();
    let _ = std::fs::remove_file(&path);
    let Ok(out) = out else {
        println!("SKIP 1: ffmpeg is not installed");
        return None;
    };
    let (w, h) = (info.width.next_multiple_of(2) as usize, info.height.next_multiple_of(2) as usize);
    assert_eq!(out.stdout.len(), w * h * 4 * info.frames as usize);
    let (mut sum, mut n) = (0.0, 0.0);
    for (f, shown) in out.stdout.chunks(w * h * 4).enumerate() {
        let source = scene(info.width, info.height, f as u32 + shift);
        for y in 0..info.height as usize {
            for x in 0..info.width as usize {
                for c in 0..3 {
                    let a = source.rgba[(y * info.width as usize + x) * 4 + c];
                    sum += f64::from(a.abs_diff(shown[(y * w + x) * 4 + c]));
                    n += 1.0;
                }
            }
        }
    }
    Some((sum / n, bytes.len()))
}

#[test]
fn decoded_frames_have_the_colors_of_the_source() {
    for (w, h) in [(320, 180), (321, 181)] {
        let Some((error, _)) = decoded_error(&info(w, h, (30, 1), 8), 0) else { return };
        assert!(error < 1.5, "{w}×{h}: mean error {error}");
    }
    // The comparison can fail: images two frames off are not within the bound.
    let (error, _) = decoded_error(&info(320, 180, (30, 1), 8), 2).unwrap();
    assert!(error > 1.5, "{error}");
}

#[test]
fn quality_trades_size_for_error() {
    let of = |quality: f64, scene: fn(u32, u32, u32) -> Frame| {
        let mut info = info(320, 180, (30, 1), 8);
        info.options.0.insert("quality".into(), OptionValue::Number(quality));
        decoded_error_of(&info, 0, scene)
    };
    let (Some(low), Some(high)) = (of(20.0, scene), of(95.0, scene)) else { return };
    let at = |quality: f64| of(quality, texture);
    assert!(low.0 > 1.3 * high.0 && low.1 * 2 < high.1, "{low:?} {high:?}");
    // Each integer quality from 95 to 100 has its own quantizer: 17, 16, … 12.
    let all: Vec<(f64, usize)> = (95..=100).map(|quality| at(f64::from(quality)).unwrap()).collect();
    println!("error and size from quality 95 to 100: {all:?}");
    assert!(all.is_sorted_by(|a, b| a.0 > b.0 && a.1 < b.1), "{all:?}");
    // And the numbers between the default and these are no better than them.
    let default = at(75.0).unwrap();
    assert!(
        default.0 > all[0].0 && default.1 < all[0].1 && at(94.0).unwrap() == all[0],
        "{default:?} {all:?}"
    );
}

#[test]
fn sizes_out_of_range_are_errors_and_odd_sizes_are_noted() {
    let large = info(8000, 4000, (30, 1), 1);
    let error = Mp4Exporter.begin(&large, Box::new(Vec::new())).err().unwrap().to_string();
    assert!(
        error.starts_with("MP4: 8000×4000 is outside the sizes that the H.264 encoder accepts"),
        "{error}"
    );
    let notes = Mp4Exporter.notes(&info(641, 480, (30, 1), 1));
    assert_eq!(notes, ["MP4 needs even sizes: 641×480 becomes 642×480, the last column or row is repeated"]);
    assert!(Mp4Exporter.notes(&info(640, 480, (30, 1), 1)).is_empty());
    let sink = Mp4Exporter.begin(&info(64, 64, (30, 1), 1), Box::new(Vec::new())).unwrap();
    assert!(sink.finish().unwrap_err().to_string().contains("at least one image"));
}

/// The video stops in the middle of a segment, at its ends, and in the first one.
#[test]
fn a_resumed_video_has_the_same_bytes() {
    let mut info = info(96, 64, (30, 1), 60);
    info.options.0.insert("keyframes".into(), OptionValue::Number(0.4));
    // Segments of 24 frames, key frames at every 12th and where the scene changes.
    let frames: Vec<Frame> =
        (0..60).map(|f| scene(96, 64, if f < 31 { f % 14 } else { 2 * f % 9 })).collect();
    let whole = encode_frames(&info, &frames);
    assert_eq!(resumed(&Mp4Exporter, &info, &frames, 23), None);
    for cut in [24, 25, 30, 31, 36, 47, 48, 49, 59, 60] {
        assert!(resumed(&Mp4Exporter, &info, &frames, cut).unwrap() == whole, "after {cut} frames");
    }
    // The comparison can fail.
    let mut other = frames.clone();
    other.swap(40, 41);
    assert!(resumed(&Mp4Exporter, &info, &other, 41).unwrap() != whole);
    // Every state cut short is an error or, cut between two frames, another video; never a panic.
    let mut sink = Mp4Exporter.begin(&info, Box::new(Vec::new())).unwrap();
    let mut state = Vec::new();
    for frame in &frames[..24] {
        sink.frame(frame).unwrap();
        if let Mark::Settled(s) = sink.mark() {
            state = s;
        }
    }
    for cut in 0..state.len() {
        let cut = vec![state[..cut].to_vec()];
        if let Ok(sink) = Mp4Exporter.resume(&info, &cut, &mut &b""[..], Box::new(Vec::new())) {
            let _ = sink.finish();
        }
    }
    let mut sink = Mp4Exporter.begin(&info, Box::new(Vec::new())).unwrap();
    assert_eq!(sink.again(&[0; 77]).unwrap_err().to_string(), "a saved frame of 77 bytes is not 96×64");
}

fn encode_frames(info: &VideoInfo, frames: &[Frame]) -> Vec<u8> {
    let out = SharedBytes::default();
    let mut sink = Mp4Exporter.begin(info, Box::new(out.clone())).unwrap();
    frames.iter().for_each(|frame| sink.frame(frame).unwrap());
    let mut bytes = sink.finish().unwrap();
    bytes.extend_from_slice(&out.bytes());
    bytes
}

/// Several encoders, one after the other, in one file: a decoder shows every frame without a complaint.
#[test]
fn segments_join_without_a_seam() {
    let mut info = info(160, 96, (30, 1), 60);
    info.options.0.insert("keyframes".into(), OptionValue::Number(0.0));
    for keyframes in [0.0, 0.4, 1.0] {
        info.options.0.insert("keyframes".into(), OptionValue::Number(keyframes));
        let frames: Vec<Frame> = (0..60).map(|f| scene(160, 96, f)).collect();
        let path = file(&format!("seam{keyframes}"), &encode_frames(&info, &frames));
        let Some(text) = ffprobe(&path, "stream=nb_read_frames") else { return };
        assert_eq!(text.trim(), "nb_read_frames=60");
        let keys = Command::new("ffprobe")
            .args(["-v", "error", "-show_entries", "packet=flags", "-of", "csv=p=0"])
            .arg(&path)
            .output()
            .unwrap();
        let keys: Vec<usize> = String::from_utf8_lossy(&keys.stdout)
            .lines()
            .enumerate()
            .filter(|(_, l)| l.starts_with('K'))
            .map(|(i, _)| i)
            .collect();
        let every = ((keyframes * 30.0) as usize).max(1);
        assert_eq!(keys, (0..60).step_by(every).collect::<Vec<_>>(), "every {keyframes} s");
        std::fs::remove_file(path).unwrap();
    }
}

/// `repeat` writes the same bytes as a second call of `frame` with the same image, also across the end of a segment.
#[test]
fn repeated_frames_give_the_same_bytes() {
    let info = info(64, 48, (10, 1), 60);
    let bytes = |repeat: bool| {
        let out = SharedBytes::default();
        let mut sink = Mp4Exporter.begin(&info, Box::new(out.clone())).unwrap();
        for number in 0..60 {
            let frame = scene(64, 48, number / 20);
            match repeat && number % 20 > 0 {
                // The frame given with it is not read.
                true => sink.repeat(&scene(64, 48, 50)).unwrap(),
                false => sink.frame(&frame).unwrap(),
            }
        }
        let head = sink.finish().unwrap();
        [head, out.bytes()].concat()
    };
    assert!(bytes(true) == bytes(false));
}

/// Segments made on several machines, and the frames behind the last whole one: 24 and 32 frames, key frames that divide them or not.
#[test]
fn joined_segments_have_the_bytes_of_one_render() {
    for (keyframes, frames) in [(0.8, 24), (0.8, 55), (16.0 / 30.0, 70), (0.0, 49)] {
        let mut info = info(64, 48, (30, 1), frames);
        info.options.0.insert("keyframes".into(), OptionValue::Number(keyframes));
        let images: Vec<Frame> = (0..frames).map(|frame| scene(64, 48, frame as u32)).collect();
        let joined = joined_pieces(&Mp4Exporter, &info, &images);
        assert!(joined == encode(&info), "{frames} frames, a key frame every {keyframes} s");
    }
}
