//! Films joined from the segments of several machines have the same bytes as from one machine, whatever the chunks, their order and their
//! overlap. Segments that do not belong to the film are named in the error message, and no temporary files are left.

use crate::common;
use crate::common::{Run, choreo, file_names, part_files, read_file};
use std::path::Path;

/// 60 frames: a still scene, then a box that moves, then a title that changes over a still scene. A scene without characters draws fast.
const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 30, length: 2.0 });
cast("b", shape("box", #{ size: [1.0, 1.0, 1.0], color: "#c04020" }))
    .key("position", [[0.0, [0, 0, 0]], [0.5, [0, 0, 0]], [1.2, [1.5, 0, 0]], [2.0, [1.5, 0, 0]]]);
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
text("title", #{ size: 0.3 }).key("opacity", [[0.0, 0.2], [1.5, 0.2], [1.8, 1.0], [2.0, 1.0]]);
"##;

/// Options with which an MP4 has groups of 24 frames.
const KEYFRAMES: &[&str] = &["--export", "keyframes=0.8"];

fn render(folder: &Path, output: &str, more: &[&str]) -> Run {
    let mut args = vec!["render", "s.rhai", "-o", output, "--device", "cpu", "--samples", "1", "--quiet"];
    args.extend(if output.ends_with(".mp4") { KEYFRAMES } else { &[] });
    args.extend(more);
    let run = choreo(folder, &args);
    assert_eq!(run.code, 0, "{}", run.err);
    run
}

/// Renders a segment in `folder`, and returns its name.
fn render_segment(folder: &Path, output: &str, into: &str, frames: &str) -> String {
    render(folder, output, &["--frames", frames, "--segment", into]);
    let (first, last) = frames.split_once('-').unwrap();
    format!("{into}/{first:0>7}-{last:0>7}.segment")
}

fn scene() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("s.rhai"), SCRIPT).unwrap();
    dir
}

/// All bytes of an output: those of the file, or of the images in the folder one after the other.
fn output_bytes(folder: &Path, output: &str) -> Vec<u8> {
    let Some((inner, _)) = output.split_once('/') else { return read_file(folder, output) };
    let names = file_names(&folder.join(inner));
    assert_eq!(names.len(), 60);
    names.iter().flat_map(|name| read_file(&folder.join(inner), name)).collect()
}

/// The numbers of frames that a join copied and encoded.
fn join_segments(folder: &Path, output: &str, segments: &[&str]) -> (u64, u64) {
    let mut args = vec!["join", "-o", output, "--json"];
    args.extend(segments);
    let run = choreo(folder, &args);
    assert_eq!(run.code, 0, "{}", run.err);
    let summary: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(summary["frames"], 60);
    (summary["copied"].as_u64().unwrap(), summary["encoded"].as_u64().unwrap())
}

fn refused_join(folder: &Path, args: &[&str]) -> String {
    let mut all = vec!["join", "-o", "film.gif"];
    all.extend(args);
    let run = choreo(folder, &all);
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(!folder.join("film.gif").exists() && part_files(folder).is_empty(), "{:?}", file_names(folder));
    run.err
}

/// Tests one format. `rendered` and `joined` are its outputs; `copied` is the number of frames that are copied for each division into chunks.
fn assert_join_equals_one_render(rendered: &str, joined: &str, copied: [u64; 4]) {
    let dir = scene();
    let d = dir.path();
    render(d, rendered, &[]);
    let expected = output_bytes(d, rendered);
    let make = |frames: &str| render_segment(d, joined, "chunks", frames);
    let [a, b, c] = ["0-23", "24-47", "48-59"].map(make);
    let [e, f, g] = ["0-6", "7-30", "31-59"].map(make);
    let [h, i] = ["0-39", "20-59"].map(make);
    let all = make("0-59");
    let chunkings: [&[&str]; 4] = [&[&c, &a, &b], &[&f, &g, &e, &f], &[&i, &h], &[&all]];
    for (segments, copied) in chunkings.into_iter().zip(copied) {
        assert_eq!(join_segments(d, joined, segments), (copied, 60 - copied), "{joined}: {segments:?}");
        assert!(output_bytes(d, joined) == expected, "{joined}: {segments:?}");
        assert!(part_files(d).is_empty());
    }
    // All segments given by their folder, and some of them twice.
    join_segments(d, joined, &["chunks", &a, &h]);
    assert!(output_bytes(d, joined) == expected, "{joined}: overlapping");
}

#[test]
fn mp4_segments_join_to_the_bytes_of_one_render() {
    assert_join_equals_one_render("one.mp4", "film.mp4", [48, 0, 48, 48]);
}

#[test]
fn gif_segments_join_to_the_bytes_of_one_render() {
    assert_join_equals_one_render("one.gif", "film.gif", [0; 4]);
}

#[test]
fn apng_segments_join_to_the_bytes_of_one_render() {
    assert_join_equals_one_render("one.apng", "film.apng", [0; 4]);
}

#[test]
fn y4m_segments_join_to_the_bytes_of_one_render() {
    assert_join_equals_one_render("one.y4m", "film.y4m", [60; 4]);
}

#[test]
fn png_segments_join_to_the_bytes_of_one_render() {
    assert_join_equals_one_render("one/%04d.png", "film/%04d.png", [60; 4]);
}

#[test]
fn exr_segments_join_to_the_bytes_of_one_render() {
    assert_join_equals_one_render("one/%04d.exr", "film/%04d.exr", [60; 4]);
}

/// If a segment is truncated anywhere or has any bit changed, it is named, the frames before the damage are used, and other segments
/// supply the rest.
#[test]
fn damaged_segments_are_named_and_replaced_by_others() {
    let dir = scene();
    let d = dir.path();
    render(d, "one.mp4", &[]);
    let [first, all] = ["0-23", "0-59"].map(|frames| render_segment(d, "film.mp4", "a", frames));
    let rest = render_segment(d, "film.mp4", "b", "24-59");
    let segment_bytes = read_file(d, &all);
    for (at, bit) in
        [(0, 1), (70, 2), (900, 4), (segment_bytes.len() / 2, 16), (segment_bytes.len() - 3, 128)]
    {
        for cut in [true, false] {
            let mut damaged = segment_bytes.clone();
            if cut {
                damaged.truncate(at.max(1))
            } else {
                damaged[at] ^= bit
            };
            std::fs::write(d.join(&all), &damaged).unwrap();
            let run = choreo(d, &["join", &all, &first, &rest, "-o", "film.mp4"]);
            assert_eq!(run.code, 0, "{}", run.err);
            assert!(run.err.contains(&format!("warning: {all}: ")), "cut {cut} at {at}: {}", run.err);
            assert!(read_file(d, "film.mp4") == read_file(d, "one.mp4"), "cut {cut} at {at}");
            std::fs::remove_file(d.join("film.mp4")).unwrap();
            let run = choreo(d, &["join", &all, &first, "-o", "film.mp4"]);
            if run.code == 0 {
                // Only the end of the segment was missing.
                assert!(
                    at > segment_bytes.len() - 100 && read_file(d, "film.mp4") == read_file(d, "one.mp4"),
                    "cut {cut} at {at}"
                );
                std::fs::remove_file(d.join("film.mp4")).unwrap();
                continue;
            }
            assert_eq!(run.code, 1);
            assert!(run.err.contains("of 60 frames these are missing: "), "{}", run.err);
            assert!(part_files(d).is_empty() && !d.join("film.mp4").exists());
        }
    }
    // The frames before the damage are used.
    std::fs::write(d.join(&all), &segment_bytes[..segment_bytes.len() - 100]).unwrap();
    let run = choreo(d, &["join", &all, "-o", "film.mp4"]);
    assert!(run.err.contains("after frame 58"), "{}", run.err);
    assert!(run.err.contains("these are missing: 59\n"), "{}", run.err);
}

#[test]
fn missing_frames_are_named() {
    let dir = scene();
    let d = dir.path();
    let [a, b] = ["5-9", "20-58"].map(|frames| render_segment(d, "film.gif", "a", frames));
    let text = refused_join(d, &[&a, &b]);
    let expected = "film.gif: of 60 frames these are missing: 0..=4, 10..=19, 59\n    \
                    hint: render them with choreo render --segment --frames\n";
    assert_eq!(text, expected);
    // An existing film is not changed.
    std::fs::write(d.join("film.gif"), "before").unwrap();
    assert_eq!(choreo(d, &["join", &a, "-o", "film.gif"]).code, 1);
    assert_eq!(read_file(d, "film.gif"), b"before");
}

/// A segment with a different header, as another version or device would write it.
fn with_changed_head(segment: &[u8], change: impl Fn(&mut serde_json::Value)) -> Vec<u8> {
    let mut lines = segment.splitn(3, |byte| *byte == b'\n');
    let (magic, head, rest) = (lines.next().unwrap(), lines.next().unwrap(), lines.next().unwrap());
    let mut value = serde_json::from_slice(&head[65..]).unwrap();
    change(&mut value);
    [magic, b"\n", &hashed_line(&value), rest].concat()
}

fn hashed_line(value: &serde_json::Value) -> Vec<u8> {
    let json = value.to_string();
    format!("{} {json}\n", blake3::hash(json.as_bytes()).to_hex()).into_bytes()
}

fn set_provenance(head: &mut serde_json::Value, keyword: &str, text: &str) {
    let pairs = head["provenance"].as_array_mut().unwrap();
    pairs.iter_mut().find(|pair| pair[0] == keyword).unwrap()[1] = text.into();
}

#[test]
fn segments_of_other_films_versions_and_devices_are_refused() {
    let dir = scene();
    let d = dir.path();
    let a = render_segment(d, "film.gif", "a", "0-29");
    let b = render_segment(d, "film.gif", "b", "30-59");
    let text = |b: &str| refused_join(d, &[&a, b]);
    let segment_bytes = read_file(d, &b);
    let forge = |keyword: &str, text: &str| {
        let forged = with_changed_head(&segment_bytes, |head| set_provenance(head, keyword, text));
        std::fs::write(d.join("b/forged.segment"), forged).unwrap();
    };
    let another = "b/forged.segment: it belongs to another film than a/0000000-0000029.segment\n    ";
    forge("choreo:device", "some GPU (1.2)");
    let device = text("b/forged.segment");
    assert!(
        device.starts_with(&format!("{another}device: some GPU (1.2), there choreo CPU renderer (choreo ")),
        "{device}"
    );
    forge("Software", "choreo 9.9.9");
    let version = text("b/forged.segment");
    assert!(version.starts_with(&format!("{another}Software: choreo 9.9.9, there choreo ")), "{version}");
    let version = refused_join(d, &["b/forged.segment"]);
    assert!(version.contains("choreo 9.9.9 made it, but this program is choreo "), "{version}");
    // A different script text that draws the same, a different size, and different options.
    std::fs::write(d.join("s.rhai"), format!("{SCRIPT}// more\n")).unwrap();
    let script = text(&render_segment(d, "film.gif", "c", "30-59"));
    assert!(script.contains("\n    script: ") && !script.contains("stage: "), "{script}");
    std::fs::write(d.join("s.rhai"), SCRIPT).unwrap();
    render(
        d,
        "film.gif",
        &["--frames", "30-59", "--segment", "c", "--size", "32x18", "--export", "dither=0"],
    );
    let size = text("c");
    assert!(size.contains("\n    size: 32x18, there 64x36\n    options: dither=0, there "), "{size}");
    let format = choreo(d, &["join", &a, "-o", "film.mp4"]);
    assert_eq!(format.code, 1);
    assert!(format.err.contains("it belongs to a film in the format gif "), "{}", format.err);
    assert!(format.err.contains(", but -o names mp4 "), "{}", format.err);
}

/// If two segments differ in a frame, because one machine draws differently, no film is written.
#[test]
fn segments_that_disagree_are_refused() {
    let dir = scene();
    let d = dir.path();
    let a = render_segment(d, "film.gif", "a", "0-59");
    let b = render_segment(d, "film.gif", "b", "25-25");
    // The image of frame 30, as frame 25.
    let c = read_file(d, &render_segment(d, "film.gif", "b", "30-30"));
    let mut lines = c.splitn(4, |byte| *byte == b'\n');
    let (magic, head, record) = (lines.next().unwrap(), lines.next().unwrap(), lines.next().unwrap());
    let mut value: serde_json::Value = serde_json::from_slice(&record[65..]).unwrap();
    value["first"] = 25.into();
    let forged = [magic, b"\n", head, b"\n", &hashed_line(&value), lines.next().unwrap()].concat();
    assert_eq!(join_segments(d, "film.gif", &[&a, &b]), (0, 60));
    std::fs::remove_file(d.join("film.gif")).unwrap();
    std::fs::write(d.join(&b), forged).unwrap();
    let text = refused_join(d, &[&a, &b]);
    let expected = format!("film.gif: frame 25 differs between {a} and {b}\n");
    assert!(text.starts_with(&expected), "{text}");
}

/// A complete segment is not rendered again with --resume, and a truncated one is.
#[test]
fn a_complete_segment_is_not_rendered_again() {
    let dir = scene();
    let d = dir.path();
    let a = render_segment(d, "film.mp4", "a", "10-40");
    let segment_bytes = read_file(d, &a);
    let again = || {
        let more = ["--frames", "10-40", "--segment", "a", "--resume", "--json"];
        let run = render(d, "film.mp4", &more);
        serde_json::from_str::<serde_json::Value>(&run.out).unwrap()["drawn"].as_u64().unwrap()
    };
    assert_eq!(again(), 0);
    std::fs::write(d.join(&a), &segment_bytes[..segment_bytes.len() - 1]).unwrap();
    assert!(again() > 0);
    assert!(read_file(d, &a) == segment_bytes);
}

/// Several processes render the same segment with --resume, as on a farm that restarts a task while its first process still runs: one
/// renders it, the others wait for it, and all succeed.
#[test]
fn several_processes_can_render_one_segment() {
    let dir = scene();
    let d = dir.path();
    let args = [
        "render",
        "s.rhai",
        "-o",
        "film.gif",
        "--device",
        "cpu",
        "--frames",
        "0-59",
        "--segment",
        "a",
        "--resume",
    ];
    let size = ["--size", "640x360", "--json"];
    let start = || {
        common::command(d, &[&args[..], &size].concat())
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap()
    };
    let made: Vec<u64> = [start(), start(), start()]
        .into_iter()
        .map(|child| {
            let run = common::run_result(child.wait_with_output().unwrap());
            assert_eq!(run.code, 0);
            serde_json::from_str::<serde_json::Value>(&run.out).unwrap()["drawn"].as_u64().unwrap()
        })
        .collect();
    assert_eq!(made.iter().filter(|drawn| **drawn > 0).count(), 1, "{made:?}");
    assert_eq!(file_names(&d.join("a")), ["0000000-0000059.report", "0000000-0000059.segment"]);
}

#[test]
fn invalid_segment_and_join_options_are_refused() {
    let dir = scene();
    let d = dir.path();
    let usage = |args: &[&str]| {
        let run = choreo(d, args);
        assert_eq!(run.code, 2, "{}", run.err);
        run.err
    };
    let render = |more: &[&str]| usage(&[&["render", "s.rhai", "--device", "cpu"], more].concat());
    assert!(render(&["-o", "a.png", "--frames", "3", "--segment", "a"]).contains("--segment is for videos"));
    assert!(render(&["-o", "-", "--segment", "a"]).contains("--segment is for videos"));
    assert!(render(&["-o", "a.mp4", "--frames", "0,5", "--segment", "a"]).contains("one range of frames"));
    std::fs::create_dir(d.join("empty")).unwrap();
    assert_eq!(refused_join(d, &["empty"]), "empty: there is no .segment file\n");
    assert!(
        refused_join(d, &["s.rhai"])
            .contains("s.rhai: it is not a segment that choreo render --segment has written")
    );
    assert!(usage(&["join", "s.rhai", "-o", "-"]).contains("join writes files"));
}
