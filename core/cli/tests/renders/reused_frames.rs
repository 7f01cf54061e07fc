//! Frames that equal the previous one are not drawn again, and for titles over a still scene only the titles are drawn. The bytes are the
//! same as those of frames that are rendered one by one.

use crate::common::{choreo, file_names, read_file};
use std::path::Path;

/// Six still frames, six in which a title moves, except for one, and four in which the box moves.
const SCRIPT: &str = r##"stage(#{ size: [64, 48], fps: 8, length: 2.0 });
cast("b", shape("box", #{ size: [1.0, 1.0, 1.0], color: "#c04020" }))
    .key("position", [[0.0, [0, 0, 0]], [1.5, [0, 0, 0]], [2.0, [1, 0, 0]]]);
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
text("title", #{ size: 0.3 }).key("opacity", [[0.0, 0.2], [0.625, 0.2], [1.125, 1.0], [2.0, 1.0]]);
"##;

fn render(folder: &Path, output: &str, more: &[&str]) -> Option<serde_json::Value> {
    let mut args = vec!["render", "a.rhai", "-o", output, "--samples", "1", "--json"];
    args.extend(more);
    let run = choreo(folder, &args);
    // The code for "no device can render it".
    if run.code == 4 && more.contains(&"vulkan") {
        println!("SKIP 1: {}", run.err.lines().next().unwrap_or_default());
        return None;
    }
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    Some(serde_json::from_str(&run.out).unwrap())
}

fn assert_reused_frames_equal_single_renders(device: &str) {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    std::fs::write(d.join("a.rhai"), SCRIPT).unwrap();
    // A frame that is rendered alone has no previous frame.
    for frame in 0..16 {
        let range = format!("{frame}..{}", frame + 1);
        let Some(summary) = render(d, "alone/%02d.png", &["--device", device, "--frames", &range]) else {
            return;
        };
        assert_eq!(summary["drawn"], 1);
        render(d, &format!("y{frame:02}.y4m"), &["--device", device, "--frames", &range]);
    }
    for jobs in ["1", "5"] {
        let folder = format!("jobs_{jobs}");
        let summary =
            render(d, &format!("{folder}/%02d.png"), &["--device", device, "--jobs", jobs]).unwrap();
        let counts = ["drawn", "repeated", "recomposed", "reused"].map(|key| summary[key].as_u64().unwrap());
        assert_eq!(counts, [4, 8, 4, 12], "{device}");
        let frame_files = file_names(&d.join(&folder));
        assert_eq!(frame_files.len(), 16);
        for name in frame_files {
            let same = read_file(d, &format!("{folder}/{name}")) == read_file(d, &format!("alone/{name}"));
            assert!(same, "{device}, {jobs} jobs: {name}");
        }
    }
    render(d, "whole.y4m", &["--device", device]);
    let body = |name: &str| {
        let bytes = read_file(d, name);
        let header = bytes.iter().position(|b| *b == b'\n').unwrap() + 1;
        bytes[header..].to_vec()
    };
    let joined: Vec<u8> = (0..16).flat_map(|frame| body(&format!("y{frame:02}.y4m"))).collect();
    assert!(body("whole.y4m") == joined, "{device}: y4m");
}

#[test]
fn reused_frames_equal_single_renders_on_the_cpu() {
    assert_reused_frames_equal_single_renders("cpu");
}

#[test]
fn reused_frames_equal_single_renders_on_vulkan() {
    assert_reused_frames_equal_single_renders("vulkan");
}

#[test]
fn the_summary_counts_reused_frames() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.rhai"), SCRIPT).unwrap();
    let run = choreo(dir.path(), &["render", "a.rhai", "-o", "a.y4m", "--samples", "1", "--device", "cpu"]);
    let expected = "16 frames, 8 of them equal to the one before, 4 of them with other 2D layers over the same scene, in ";
    assert!(run.err.contains(expected), "{}", run.err);
}
