//! Memory for images: commands that describe a scene read only the headers, and a render holds an image once with its mipmaps.

use choreo_importer_kit_testing::own_process;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// Pixels a side: 48 MiB of RGB, 64 MiB decoded, 21 MiB of mipmaps.
const SIDE: u32 = 4096;

/// A triangle with a large image in its own folder.
fn folder_with_large_image() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let numbers: [f32; 15] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    std::fs::write(dir.path().join("a.bin"), bytes).unwrap();
    let image = image::RgbImage::from_fn(SIDE, SIDE, |x, y| image::Rgb([x as u8, (x >> 4) as u8, y as u8]));
    image.save(dir.path().join("large.png")).unwrap();
    let model = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
"textures":[{"source":0}],"images":[{"uri":"large.png"}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
"buffers":[{"byteLength":60,"uri":"a.bin"}]}"#;
    std::fs::write(dir.path().join("a.gltf"), model).unwrap();
    std::fs::write(dir.path().join("a.rhai"), SCRIPT).unwrap();
    dir
}

/// A script with the same image on a surface.
const SCRIPT: &str =
    "stage(#{ length: 1.0 });\ncast(\"wall\", shape(\"plane\", #{ image: image(\"large.png\") }));\n";

/// Peak memory of this process in MiB while `work` runs, above the memory before; `None` if the system does not report it.
fn peak_memory_mib(work: impl FnOnce()) -> Option<u64> {
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    let status = |key: &str| -> Option<u64> {
        let text = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = text.lines().find_map(|line| line.strip_prefix(key))?;
        line.split_whitespace().next()?.parse().ok()
    };
    let before = status("VmRSS:")?;
    work();
    Some((status("VmHWM:")?.saturating_sub(before)) >> 10)
}

fn run_in_this_process(folder: &Path, args: &[&str]) {
    let path = |arg: &&str| match folder.join(arg).exists() || arg.ends_with(".y4m") {
        true => folder.join(arg).into_os_string(),
        false => OsString::from(arg),
    };
    let args = std::iter::once(OsString::from("choreo")).chain(args.iter().map(path));
    assert_eq!(choreo::run(args, &choreo::app()), ExitCode::SUCCESS);
}

/// Runs a command in a separate process and asserts that its peak memory is at most `most` MiB.
fn assert_memory_at_most(most: u64, args: &[&str]) {
    if own_process::ran_in_own_process() {
        return;
    }
    let folder = folder_with_large_image();
    match peak_memory_mib(|| run_in_this_process(folder.path(), args)) {
        None => println!("SKIP 1: the system does not state the memory of a process"),
        Some(peak) => {
            println!("{}: {peak} MiB", args[0]);
            assert!(peak <= most, "{args:?}: {peak} MiB, at most {most} are allowed");
        }
    }
}

#[test]
fn check_reads_only_the_image_header() {
    assert_memory_at_most(24, &["check", "a.gltf"]);
}

#[test]
fn pose_reads_only_the_image_header() {
    assert_memory_at_most(24, &["pose", "a.gltf", "--json"]);
}

#[test]
fn info_reads_only_the_image_header() {
    assert_memory_at_most(24, &["info", "a.gltf"]);
}

#[test]
fn explain_reads_only_the_image_header() {
    assert_memory_at_most(24, &["explain", "a.gltf"]);
}

#[test]
fn check_of_a_script_reads_only_the_image_header() {
    assert_memory_at_most(24, &["check", "a.rhai"]);
}

#[test]
fn the_pose_command_reads_only_image_headers() {
    assert_memory_at_most(24, &["pose", "a.rhai", "--json"]);
}

#[test]
fn explain_of_a_script_reads_only_the_image_header() {
    assert_memory_at_most(24, &["explain", "a.rhai"]);
}

/// Images are decoded even so if a mesh or a material depends on their pixels.
#[test]
fn a_scene_is_the_same_without_pixels() {
    let dir = tempfile::tempdir().unwrap();
    let waves = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([(x * 30) as u8, (y * 30) as u8, 77]));
    waves.save(dir.path().join("waves.png")).unwrap();
    let holes = image::RgbaImage::from_fn(8, 8, |x, _| image::Rgba([255, 0, 0, if x < 4 { 0 } else { 255 }]));
    holes.save(dir.path().join("holes.png")).unwrap();
    let script = r#"
        let waves = image("waves.png");
        let colored = shape("plane", #{ image: waves });
        cast("colored", colored);
        cast("painted", colored.texture(colored.materials()[0], "color", image("holes.png")));
        cast("cut", shape("plane", #{ image: image("holes.png") }));
        cast("veiled", shape("plane", #{ image: waves, opacity_map: waves }));
        cast("raised", shape("plane", #{ displacement_map: waves, displacement: 0.3 }));
        cast("bumps", shape("plane", #{ normal_map: waves, height_map: waves }));
        cast("cells", shape("plane", #{ image: [waves, image("holes.png")] }));
        picture(waves, #{ height: 0.5 });
    "#;
    let run = |requested_parts: choreo_plugin::ImportScope| {
        let options = choreo_script::ScriptOptions { requested_parts, ..Default::default() };
        choreo_script::run_text("a.rhai", script, dir.path(), &choreo::registry(), &options).unwrap().stage
    };
    let (all, few) = (run(choreo_plugin::ImportScope::ALL), run(choreo_plugin::ImportScope::NO_PIXELS));
    let mut waiting = Vec::new();
    for (a, b) in all.actors.iter().zip(&few.actors) {
        let (a, b, name) = (&a.asset, &b.asset, &a.name);
        assert_eq!(a.meshes[0].content_hash(), b.meshes[0].content_hash(), "{name}");
        assert_eq!(a.materials, b.materials, "{name}");
        for (a, b) in a.images.iter().zip(&b.images) {
            assert_eq!((a.width, a.height), (b.width, b.height), "{name}");
            assert!(b.rgba.is_empty() || a.rgba == b.rgba, "{name}");
        }
        if b.images.iter().any(|image| image.rgba.is_empty()) {
            waiting.push(name.as_str());
        }
    }
    assert_eq!(waiting, ["colored", "painted"]);
}

#[test]
fn a_render_holds_the_image_once_with_its_mipmaps() {
    assert_memory_at_most(
        136,
        &[
            "render",
            "a.gltf",
            "-o",
            "a.y4m",
            "--frames",
            "0",
            "--size",
            "64x64",
            "--device",
            "cpu",
            "--samples",
            "1",
            "--quiet",
        ],
    );
}

/// The limit can be exceeded: decoding the image takes more memory.
#[test]
fn decoding_the_image_exceeds_the_limit_for_headers() {
    if own_process::ran_in_own_process() {
        return;
    }
    let folder = folder_with_large_image();
    let open = || drop(image::open(folder.path().join("large.png")).unwrap());
    match peak_memory_mib(open) {
        None => println!("SKIP 1: the system does not state the memory of a process"),
        Some(peak) => assert!(peak > 40, "{peak} MiB"),
    }
}
