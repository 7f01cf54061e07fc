//! Renders that succeed: formats, ranges, numbering and reproducibility.

use crate::common::*;
use std::process::Command;

const SMALL: &[&str] = &["--device", "cpu", "--size", "96x54", "--samples", "1"];

fn render(folder: &std::path::Path, args: &[&str]) -> Run {
    let all: Vec<&str> = ["render"].iter().chain(args).chain(SMALL).copied().collect();
    choreo(folder, &all)
}

#[test]
fn numbered_images_of_two_processes_equal_those_of_one() {
    let dir = folder_with_triangle();
    let d = dir.path();
    for (range, out) in [("0..12", "whole"), ("6..12", "halves"), ("0..6", "halves"), ("..", "again")] {
        let run = render(d, &["tri.gltf", "-o", &format!("{out}/%04d.png"), "--frames", range]);
        assert_eq!(run.code, 0, "{}", run.err);
    }
    let whole = file_names(&d.join("whole"));
    assert_eq!(whole.len(), 12);
    assert_eq!((whole[0].as_str(), whole[11].as_str()), ("0000.png", "0011.png"));
    assert_eq!(file_names(&d.join("halves")), whole);
    for name in &whole {
        let one = read_file(d, &format!("whole/{name}"));
        assert!(
            one == read_file(d, &format!("halves/{name}")),
            "{name} differs between the halves and the whole"
        );
        assert!(one == read_file(d, &format!("again/{name}")), "{name} differs between two runs");
    }
    // The triangle moves, so that a wrong frame would be found.
    assert!(read_file(d, "whole/0000.png") != read_file(d, "whole/0011.png"));
}

#[test]
fn videos_are_complete_and_the_same_bytes_in_each_run() {
    let dir = folder_with_triangle();
    let d = dir.path();
    for format in ["mp4", "gif", "y4m"] {
        for name in ["a", "b"] {
            let run = render(d, &["tri.gltf", "-o", &format!("{name}.{format}"), "--frames", "0..10"]);
            assert_eq!(run.code, 0, "{}", run.err);
            assert!(run.err.contains("10 frames in "), "{}", run.err);
        }
        assert!(read_file(d, &format!("a.{format}")) == read_file(d, &format!("b.{format}")), "{format}");
    }
    assert_eq!(part_files(d), Vec::<String>::new());
    let probe = Command::new("ffprobe")
        .current_dir(d)
        .args([
            "-v",
            "error",
            "-count_frames",
            "-show_entries",
            "stream=width,height,nb_read_frames",
            "-of",
            "csv",
        ])
        .arg("a.mp4")
        .output();
    match probe {
        Ok(out) => assert_eq!(String::from_utf8_lossy(&out.stdout).trim(), "stream,96,54,10"),
        Err(_) => println!("SKIP 1: ffprobe is not installed"),
    }
}

#[test]
fn standard_output_is_y4m_and_nothing_else() {
    let dir = folder_with_triangle();
    let output = command(dir.path(), &["render", "tri.gltf", "-o", "-", "--frames", "0..3"])
        .args(SMALL)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    let header = output.stdout.iter().position(|b| *b == b'\n').unwrap() + 1;
    assert!(output.stdout.starts_with(b"YUV4MPEG2 W96 H54 F30:1 "));
    assert_eq!(output.stdout.len(), header + 3 * (6 + 96 * 54 * 3 / 2));
    assert_eq!(file_names(dir.path()), ["tri.gltf"]);
}

#[test]
fn a_single_image_is_chosen_by_time_or_frame() {
    let dir = folder_with_triangle();
    let d = dir.path();
    for (args, note) in [
        (&["tri.gltf", "-o", "first.png"][..], ""),
        (&["tri.gltf", "-o", "frame.png", "--frames", "15"], ""),
        (&["tri.gltf", "-o", "time.png", "--at", "0.5"], ""),
        (
            &["tri.gltf", "-o", "range.png", "--frames", "15..20"],
            "range.png holds one image: frame 15 is drawn",
        ),
    ] {
        let run = render(d, args);
        assert_eq!(run.code, 0, "{}", run.err);
        assert!(run.err.contains(note), "{}", run.err);
    }
    assert!(read_file(d, "frame.png") == read_file(d, "time.png"));
    assert!(read_file(d, "frame.png") == read_file(d, "range.png"));
    assert!(read_file(d, "frame.png") != read_file(d, "first.png"));
}

#[test]
fn quiet_prints_nothing_and_json_prints_a_summary() {
    let dir = folder_with_triangle();
    let run = render(dir.path(), &["tri.gltf", "-o", "a.gif", "--frames", "0..2", "--quiet"]);
    assert_eq!((run.code, run.out.as_str(), run.err.as_str()), (0, "", ""));
    let run = render(dir.path(), &["tri.gltf", "-o", "a.gif", "--frames", "0..2", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(
        (&value["ok"], &value["frames"], &value["output"]),
        (&true.into(), &2.into(), &"a.gif".into())
    );
    let run = render(dir.path(), &["none.gltf", "-o", "a.gif", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(
        (&value["ok"], &value["kind"], &value["exit_code"]),
        (&false.into(), &"input".into(), &1.into())
    );
    assert_eq!(value["errors"][0]["message"], "none.gltf: no such file");
}

#[test]
fn the_number_of_jobs_does_not_change_images() {
    let dir = folder_with_triangle();
    let d = dir.path();
    for jobs in ["1", "3"] {
        let out = format!("j{jobs}/%d.png");
        let run = render(d, &["tri.gltf", "-o", &out, "--frames", "0..5", "--jobs", jobs]);
        assert_eq!(run.code, 0, "{}", run.err);
    }
    assert_eq!(file_names(&d.join("j1")), ["0.png", "1.png", "2.png", "3.png", "4.png"]);
    for name in file_names(&d.join("j1")) {
        assert!(read_file(d, &format!("j1/{name}")) == read_file(d, &format!("j3/{name}")), "{name}");
    }
}

fn info(folder: &std::path::Path, name: &str) -> serde_json::Value {
    let run = choreo(folder, &["info", name, "--json"]);
    assert_eq!(run.code, 0, "{}", run.err);
    serde_json::from_str(&run.out).unwrap()
}

#[test]
fn images_and_videos_contain_their_provenance() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let mut ids = Vec::new();
    for name in ["a.png", "a.mp4", "a.gif", "a.y4m"] {
        assert_eq!(render(d, &["tri.gltf", "--clip", "Slide", "-o", name, "--frames", "3"]).code, 0);
        let value = info(d, name);
        assert_eq!(value["size"], serde_json::json!([96, 54]));
        let provenance = &value["provenance"];
        ids.push(provenance["choreo:id"].as_str().unwrap().to_string());
        if name == "a.y4m" {
            // A Y4M file has only room for the id of the provenance.
            continue;
        }
        assert_eq!(provenance["Software"], format!("choreo {}", env!("CARGO_PKG_VERSION")));
        assert_eq!(provenance["choreo:source"], "tri.gltf");
        assert_eq!(provenance["choreo:arguments"], "--size 96x54 --fps 30 --samples 1 --clip Slide");
        assert_eq!(provenance["choreo:plugins"], format!("gltf {}", env!("CARGO_PKG_VERSION")));
        assert_eq!(provenance["choreo:stage"].as_str().unwrap().len(), 32);
        assert_eq!(provenance["choreo:model"].as_str().unwrap().len(), 32);
        assert_eq!(provenance["choreo:device"], "choreo CPU renderer (choreo 0.1.0)");
        assert_eq!(
            provenance.get("choreo:time").and_then(|t| t.as_str()),
            (name == "a.png").then_some("0.1")
        );
        let text = choreo(d, &["info", name]).out;
        assert!(text.contains("  arguments    --size 96x54") && text.contains("96×54"), "{text}");
    }
    assert!(ids.iter().all(|id| *id == ids[0] && id.len() == 16), "{ids:?}");
}

/// The bytes of an image do not depend on the folder, the time, the output name and the range of frames of a render. They do depend on
/// everything that can change the image.
#[test]
fn provenance_depends_only_on_what_changes_the_image() {
    let script = "let who = param(\"who\", \"x\");\nlet m = load(\"models/tri.gltf\");\nlet a = cast(who, m);\n\
                  a.play(m.clip(\"Slide\"));\nstage(#{ length: 1.0 });";
    let place = |script: &str| {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("models")).unwrap();
        std::fs::write(dir.path().join("models/tri.gltf"), triangle(1.0)).unwrap();
        std::fs::write(dir.path().join("s.rhai"), script).unwrap();
        dir
    };
    let (here, there) = (place(script), place(script));
    let outside = there.path().parent().unwrap();
    let from_outside = there.path().join("s.rhai");
    for format in ["mp4", "gif", "y4m"] {
        let (a, b) = (format!("a.{format}"), format!("b.{format}"));
        assert_eq!(render(here.path(), &["s.rhai", "-o", &a, "--frames", "0..9"]).code, 0);
        let out = there.path().join(&b);
        let run = render(
            outside,
            &[from_outside.to_str().unwrap(), "-o", out.to_str().unwrap(), "--frames", "0..9", "--jobs", "3"],
        );
        assert_eq!(run.code, 0, "{}", run.err);
        assert!(
            read_file(here.path(), &a) == read_file(there.path(), &b),
            "{format}: moving the folder changes the bytes"
        );
    }
    // The same frame alone, in a range, and requested by its time.
    let d = here.path();
    assert_eq!(render(d, &["s.rhai", "-o", "f/%d.png", "--frames", "3..9"]).code, 0);
    assert_eq!(render(d, &["s.rhai", "-o", "alone.png", "--frames", "6"]).code, 0);
    assert_eq!(render(d, &["s.rhai", "-o", "time.png", "--at", "0.2"]).code, 0);
    assert!(
        read_file(d, "f/6.png") == read_file(d, "alone.png")
            && read_file(d, "alone.png") == read_file(d, "time.png")
    );
    let provenance = info(d, "alone.png")["provenance"].clone();
    assert_eq!(provenance["choreo:time"], "0.2");

    // A comment changes the hash of the script, but not that of the stage; parameters and options of the format are recorded.
    let other = place(&format!("{script} // more"));
    let d = other.path();
    assert_eq!(render(d, &["s.rhai", "-o", "a.png", "--frames", "6"]).code, 0);
    let changed = info(d, "a.png")["provenance"].clone();
    assert!(
        changed["choreo:script"] != provenance["choreo:script"]
            && changed["choreo:id"] != provenance["choreo:id"]
    );
    assert_eq!(changed["choreo:stage"], provenance["choreo:stage"]);
    let more = ["--set", "who=a\nb", "--export", "compression=small"];
    let args = [&["s.rhai", "-o", "b.png", "--frames", "6"][..], &more].concat();
    assert_eq!(render(d, &args).code, 0);
    let arguments = info(d, "b.png")["provenance"]["choreo:arguments"].clone();
    assert_eq!(arguments, "--size 96x54 --fps 30 --samples 1 --set who=a\\nb --export compression=small");
}

/// The default camera uses the aspect ratio of the image, not the default one of the scene.
#[test]
fn a_model_is_framed_completely_in_a_tall_image() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let (width, height) = (54, 96);
    let size = &["--device", "cpu", "--samples", "1", "--size", "54x96"];
    let run = choreo(d, &[&["render", "tri.gltf", "-o", "a.y4m", "--frames", "0..30"][..], size].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    let bytes = read_file(d, "a.y4m");
    let header = bytes.iter().position(|b| *b == b'\n').unwrap() + 1;
    let mut drawn_pixels = 0;
    for frame in bytes[header..].chunks(6 + width * height * 3 / 2) {
        for row in frame[6..6 + width * height].chunks(width) {
            // They may differ by the dithering.
            assert!(row[0].abs_diff(row[width - 1]) <= 1, "the background is the same at both edges");
            drawn_pixels += row.iter().filter(|luma| luma.abs_diff(row[0]) > 8).count();
        }
    }
    assert!(drawn_pixels > 30 * 50, "only {drawn_pixels} pixels are drawn");
}

/// `--stages` writes an image for each stage of a rasterizer. The output must be a folder.
#[test]
fn rasterizer_stages_are_six_images_in_a_folder() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let run = choreo(d, &["render", "tri.gltf", "--stages", "-o", "steps", "--size", "96x54"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let all = ["1_model.png", "2_view.png", "3_clip.png", "4_raster.png", "5_depth.png", "6_shade.png"];
    assert_eq!(file_names(&d.join("steps")), all);
    let pictures = all.map(|name| read_file(d, &format!("steps/{name}")));
    for (i, a) in pictures.iter().enumerate() {
        assert!(a.starts_with(b"\x89PNG"));
        assert!(pictures[..i].iter().all(|b| a != b), "{} equals another image", all[i]);
    }
    // If there is room, the first five images have a description in white; the last one is the frame as it is rendered.
    let run = choreo(d, &["render", "tri.gltf", "--stages", "-o", "large", "--size", "960x540"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let white = |name: &str| {
        let picture = image::load_from_memory(&read_file(d, &format!("large/{name}"))).unwrap().into_rgb8();
        picture.rows().take(40).flatten().filter(|p| p.0 == [255; 3]).count()
    };
    for name in &all[..5] {
        assert!(white(name) > 100, "{name}: {}", white(name));
    }
    assert_eq!(white(all[5]), 0);
    let run = choreo(d, &["render", "tri.gltf", "--stages", "-o", "steps.png"]);
    assert!(
        run.code != 0 && run.err.contains("--stages writes one image per stage into a folder"),
        "{}",
        run.err
    );
}

#[test]
fn the_option_frames_accepts_lists_and_steps() {
    let dir = folder_with_triangle();
    let run = render(dir.path(), &["tri.gltf", "-o", "f/%02d.png", "--frames", "0..30:12,29,3..5"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(
        file_names(&dir.path().join("f")),
        ["00.png", "03.png", "04.png", "12.png", "24.png", "29.png"]
    );
}

#[test]
fn a_model_renders_longer_than_its_clip() {
    let dir = folder_with_triangle();
    let d = dir.path();
    assert_eq!(render(d, &["tri.gltf", "-o", "a.png", "--frames", "45"]).code, 2, "the clip has 30 frames");
    for (name, frame) in [("a.png", "45"), ("b.png", "15"), ("c.png", "20")] {
        let run = render(d, &["tri.gltf", "-o", name, "--length", "2", "--frames", frame]);
        assert_eq!(run.code, 0, "{}", run.err);
    }
    let pixels = |name: &str| image::open(d.join(name)).unwrap().into_rgba8();
    assert!(pixels("a.png") == pixels("b.png"), "the clip is looped");
    assert!(pixels("a.png") != pixels("c.png"));
    std::fs::write(d.join("s.rhai"), "cast(\"a\", shape(\"box\"));").unwrap();
    let run = render(d, &["s.rhai", "-o", "s.png", "--length", "2"]);
    assert!(run.code == 2 && run.err.contains("--length is for model files"), "{}", run.err);
}

#[test]
fn a_contact_sheet_holds_its_frames() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let run = render(d, &["tri.gltf", "-o", "sheet.png", "--sheet", "--frames", "0,10,20"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let sheet = image::open(d.join("sheet.png")).unwrap().into_rgba8();
    // Two columns and two rows of 96x54, with gaps of 4.
    assert_eq!(sheet.dimensions(), (2 * 100 + 4, 2 * 58 + 4));
    for (frame, left, top) in [("0", 4, 4), ("10", 104, 4), ("20", 4, 62)] {
        assert_eq!(render(d, &["tri.gltf", "-o", "one.png", "--frames", frame]).code, 0);
        let one = image::open(d.join("one.png")).unwrap().into_rgba8();
        let cell = image::imageops::crop_imm(&sheet, left, top, 96, 54).to_image();
        assert!(cell == one, "frame {frame}");
    }
    let run = render(d, &["tri.gltf", "-o", "sheet.mp4", "--sheet"]);
    assert!(run.code == 2 && run.err.contains("--sheet makes one image"), "{}", run.err);
}
