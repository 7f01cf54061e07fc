//! Packed scenes: an archive has all files that a script reads, has the same bytes wherever it is packed, and renders the same images
//! everywhere without other files. Malicious archives are refused and write no file outside their folder.

use crate::common::*;
use std::path::Path;

/// Exchanges red and blue.
const EFFECT: &str = "// effect: swap
// about: exchanges red and blue
// param amount = 1.0 in 0..1: how much
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    return mix(color, color.bgra, p[amount]);
}
";

const IMPORTER: &str = r#"
fn manifest() {
    #{ name: "dots", about: "vertices of triangles", extensions: "dots", magic: "DOTS" }
}

fn load(file) {
    let rest = file.bytes.part(4, file.bytes.len - 4);
    mesh(#{ name: "dots", positions: rest.numbers() });
}
"#;

const SCRIPT: &str = r##"
import "modules/place" as place;
stage(#{ size: [320, 180], fps: 10, length: 0.4, samples: 1 });
let color = param("color", "#a0c0e0");
cast("model", load("deep/model.gltf")).at(place::left(), 0, 0);
cast("dots", load("a.dots")).at(0.5, 0, 0);
cast("linked", load("link.dots")).at(0.5, 1, 0);
cast("box", shape("box", #{ size: [0.8, 0.8, 0.8], color: color }).texture("shape", "color", image("checks.png")));
cast("card", shape("box").texture("shape", "color", image("smoke_##.png"), #{ fps: 10 })).at(1.5, 0, -1);
text("title", #{ size: 0.1, font: "own.ttf" });
effect("swap");
camera("c").at(0.0, 0.5, 5.0).look_at([0.0, 0.0, 0.0]);
"##;

fn write(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

fn png_image(shade: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let image = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([shade, (x * 30) as u8, (y * 30) as u8]));
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

/// A repository with a script in `scenes`, search and plugin folders beside it and above it, and files that are not read.
fn write_project(folder: &Path) {
    let gltf = triangle(1.0);
    let data = gltf.split("base64,").nth(1).unwrap().split('"').next().unwrap();
    let uri = format!("data:application/octet-stream;base64,{data}");
    write(folder, "assets/deep/model.gltf", gltf.replace(&uri, "buffers/tri.bin"));
    write(folder, "assets/deep/buffers/tri.bin", decode_base64(data));
    write(folder, "scenes/film.rhai", SCRIPT);
    write(folder, "scenes/modules/place.rhai", "fn left() { -0.5 }");
    write(folder, "scenes/a.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
    write(folder, "scenes/checks.png", png_image(200));
    write(folder, "scenes/plugins/dots.importer.rhai", IMPORTER);
    for (i, shade) in [20, 90, 160, 230].into_iter().enumerate() {
        write(folder, &format!("assets/smoke_{:02}.png", i + 1), png_image(shade));
    }
    write(folder, "assets/own.ttf", epaint_default_fonts::HACK_REGULAR);
    write(folder, "effects/swap.wgsl", EFFECT);
    write(folder, "scenes/unread.png", png_image(1));
    write(folder, "assets/unread.bin", "unread");
    write(folder, "effects/unread.wgsl", EFFECT.replace("swap", "unread"));
    write(
        folder,
        "choreo.toml",
        "search = [\"assets\"]\nplugins = [\"effects\"]\n[render]\nsize = \"80x48\"\ndevice = \"cpu\"\n",
    );
    std::fs::create_dir(folder.join(".git")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("a.dots", folder.join("scenes/link.dots")).unwrap();
    #[cfg(not(unix))]
    std::fs::copy(folder.join("scenes/a.dots"), folder.join("scenes/link.dots")).unwrap();
}

/// Base64 without padding.
fn decode_base64(text: &str) -> Vec<u8> {
    let value = |letter: u8| match letter {
        b'A'..=b'Z' => letter - b'A',
        b'a'..=b'z' => letter - b'a' + 26,
        b'0'..=b'9' => letter - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let letters: Vec<u8> = text.bytes().filter(|letter| *letter != b'=').collect();
    let bits = letters.iter().fold(String::new(), |bits, letter| bits + &format!("{:06b}", value(*letter)));
    bits.as_bytes()
        .chunks_exact(8)
        .map(|byte| u8::from_str_radix(std::str::from_utf8(byte).unwrap(), 2).unwrap())
        .collect()
}

fn run_successfully(folder: &Path, args: &[&str]) -> Run {
    let run = choreo(folder, args);
    assert_eq!(run.code, 0, "{args:?}: {}", run.err);
    run
}

#[test]
fn a_packed_scene_renders_the_same_bytes_without_its_files() {
    let [home, other, away] = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let (d, away) = (home.path(), away.path());
    write_project(d);
    write_project(other.path());
    let set = ["--set", "color=#e04020"];
    run_successfully(d, &[&["render", "scenes/film.rhai", "-o", "one.mp4"][..], &set].concat());
    run_successfully(
        d,
        &[&["render", "scenes/film.rhai", "-o", "one/%02d.png", "--size", "40x24"][..], &set].concat(),
    );
    let run = run_successfully(
        d,
        &[&["pack", "scenes/film.rhai", "-o", "film.choreo", "--json"][..], &set].concat(),
    );
    let summary: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    let files: Vec<&str> = summary["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap()).collect();
    assert_eq!(
        files,
        [
            "files/0/a.dots",
            "files/0/checks.png",
            "files/0/film.rhai",
            "files/0/modules/place.rhai",
            "files/0/plugins/dots.importer.rhai",
            "files/1/deep/buffers/tri.bin",
            "files/1/deep/model.gltf",
            "files/1/own.ttf",
            "files/1/smoke_01.png",
            "files/1/smoke_02.png",
            "files/1/smoke_03.png",
            "files/1/smoke_04.png",
            "files/2/swap.wgsl",
        ]
    );
    // The same files in another folder give the same archive.
    run_successfully(other.path(), &[&["pack", "scenes/film.rhai", "-o", "film.choreo"][..], &set].concat());
    assert!(read_file(d, "film.choreo") == read_file(other.path(), "film.choreo"));
    let [mp4, images] = ["one.mp4", "one"].map(|name| d.join(name));
    std::fs::rename(d.join("film.choreo"), away.join("film.choreo")).unwrap();
    std::fs::rename(&mp4, away.join("one.mp4")).unwrap();
    std::fs::rename(&images, away.join("one")).unwrap();
    drop((home, other));
    // A choreo.toml beside the archive has no effect.
    write(away, "choreo.toml", "[render]\nsize = \"16x16\"\n");
    let run = run_successfully(away, &["render", "film.choreo", "-o", "film.mp4"]);
    assert!(!run.err.contains("warning"), "{}", run.err);
    assert!(read_file(away, "film.mp4") == read_file(away, "one.mp4"));
    run_successfully(away, &["render", "film.choreo", "-o", "film/%02d.png", "--size", "40x24"]);
    for name in file_names(&away.join("one")) {
        assert!(
            read_file(away, &format!("one/{name}")) == read_file(away, &format!("film/{name}")),
            "{name}"
        );
    }
    assert_eq!(file_names(&away.join("film")).len(), 4);
    // Other commands accept the archive, and a parameter can be changed.
    run_successfully(away, &["check", "film.choreo"]);
    run_successfully(away, &["render", "film.choreo", "-o", "blue.mp4", "--set", "color=#2040e0"]);
    assert!(read_file(away, "blue.mp4") != read_file(away, "one.mp4"));
}

#[test]
fn a_model_file_can_be_packed() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let args = ["--device", "cpu", "--size", "32x32", "-o"];
    run_successfully(d, &[&["render", "tri.gltf"][..], &args, &["one.gif"]].concat());
    run_successfully(d, &["pack", "tri.gltf", "--clip", "Slide", "-o", "tri.choreo"]);
    std::fs::rename(d.join("tri.gltf"), d.join("gone")).unwrap();
    run_successfully(d, &[&["render", "tri.choreo"][..], &args, &["packed.gif"]].concat());
    // The provenance names the requested clip.
    std::fs::rename(d.join("gone"), d.join("tri.gltf")).unwrap();
    run_successfully(d, &[&["render", "tri.gltf", "--clip", "Slide"][..], &args, &["one.gif"]].concat());
    assert!(read_file(d, "packed.gif") == read_file(d, "one.gif"));
}

/// Nothing is left in the folder for temporary files, whatever the exit code is.
#[test]
fn unpacked_files_are_deleted() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let scratch = d.join("scratch");
    std::fs::create_dir(&scratch).unwrap();
    run_successfully(d, &["pack", "tri.gltf", "-o", "tri.choreo"]);
    for args in [
        &["render", "tri.choreo", "--at", "0", "-o", "a.png", "--device", "cpu"][..],
        &["render", "tri.choreo", "--at", "0", "-o", "missing/a.png", "--device", "cpu"],
        &["explain", "tri.choreo"],
    ] {
        let output = command(d, args).env("TMPDIR", &scratch).output().unwrap();
        run_result(output);
        assert!(file_names(&scratch).is_empty(), "{args:?}: {:?}", file_names(&scratch));
    }
}

/// The archive with additional entries: (name, type, link target or content).
fn archive(entries: &[(&str, tar::EntryType, &[u8])]) -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    for (name, kind, content) in entries {
        let mut header = tar::Header::new_gnu();
        header.set_entry_type(*kind);
        header.set_mode(0o644);
        let link = !matches!(kind, tar::EntryType::Regular);
        header.set_size(if link { 0 } else { content.len() as u64 });
        // Written directly into the header, because the crate rejects such names.
        header.as_gnu_mut().unwrap().name[..name.len()].copy_from_slice(name.as_bytes());
        if link {
            header.as_gnu_mut().unwrap().linkname[..content.len()].copy_from_slice(content);
        }
        header.set_cksum();
        builder.append(&header, if link { &[] } else { *content }).unwrap();
    }
    builder.into_inner().unwrap()
}

fn manifest(change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let script = b"stage(#{ length: 0.1 });";
    let mut value = serde_json::json!({
        "pack": 1, "software": "another 1", "input": "files/0/a.rhai", "search": [], "plugins": [], "set": [],
        "import": [], "clip": null, "importer": null, "options": "", "input_hash": "", "stage": "",
        "names": [],
        "files": [{ "path": "files/0/a.rhai", "bytes": script.len(), "blake3": blake3::hash(script).to_hex().as_str() }],
    });
    change(&mut value);
    value.to_string().into_bytes()
}

#[test]
fn malicious_archives_write_nothing_outside() {
    use tar::EntryType::{Directory, Link, Regular, Symlink};
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let script: &[u8] = b"stage(#{ length: 0.1 });";
    let plain = manifest(|_| ());
    let check = |entries: &[(&str, tar::EntryType, &[u8])]| {
        write(d, "a.choreo", archive(entries));
        choreo(d, &["check", "a.choreo"])
    };
    let script_entry = ("files/0/a.rhai", Regular, script);
    let run = check(&[("choreo.json", Regular, &plain), script_entry]);
    assert_eq!(run.code, 0, "{}", run.err);
    let refused = |what: &str, entries: &[(&str, tar::EntryType, &[u8])]| {
        let run = check(entries);
        assert_eq!(run.code, 1, "{what}");
        assert!(run.err.starts_with(&format!("a.choreo: {what}")), "{what}: {}", run.err);
        assert_eq!(file_names(d), ["a.choreo"]);
    };
    let wrong = "it is not a scene that choreo pack has written: choreo.json lacks a field, or has a path that leads out of it";
    for path in [
        "../a.rhai",
        "/etc/a.rhai",
        "files/../../a.rhai",
        "files//a.rhai",
        "files\\..\\a.rhai",
        "./a.rhai",
        "",
    ] {
        let text = manifest(|m| m["files"][0]["path"] = path.into());
        refused(wrong, &[("choreo.json", Regular, &text), (path, Regular, script)]);
        for key in ["input", "search", "plugins"] {
            let text =
                manifest(|m| m[key] = if key == "input" { path.into() } else { serde_json::json!([path]) });
            refused(wrong, &[("choreo.json", Regular, &text), script_entry]);
        }
    }
    // A hard link may only refer to a file of the archive, and may not replace a file.
    for pair in [
        ["files/0/b", "/etc/passwd"],
        ["files/0/b", "files/0/c"],
        ["../b", "files/0/a.rhai"],
        ["files/0/a.rhai", "files/0/a.rhai"],
    ] {
        let text = manifest(|m| m["names"] = serde_json::json!([pair]));
        refused(wrong, &[("choreo.json", Regular, &text), script_entry]);
    }
    let place = "it is damaged: a different file is in the place of files/0/a.rhai";
    for kind in [Symlink, Link, Directory] {
        refused(
            place,
            &[("choreo.json", Regular, &plain), ("files/0/a.rhai", kind, b"/etc/passwd"), script_entry],
        );
    }
    // A link has no content, and so the length and hash of an empty file.
    let empty = manifest(|m| {
        m["files"][0]["bytes"] = 0.into();
        m["files"][0]["blake3"] = blake3::hash(b"").to_hex().as_str().into();
    });
    refused(place, &[("choreo.json", Regular, &empty), ("files/0/a.rhai", Symlink, b"/etc/passwd")]);
    refused(place, &[("choreo.json", Regular, &plain), ("../a.rhai", Regular, script)]);
    refused(
        "it is damaged: files/0/a.rhai does not match its hash",
        &[("choreo.json", Regular, &plain), ("files/0/a.rhai", Regular, b"stage(#{ length: 9.1 });")],
    );
    let more = [("choreo.json", Regular, &plain[..]), script_entry, ("files/0/b", Regular, b"x")];
    refused("it is damaged: it contains more than its manifest lists", &more);
    refused("it is damaged: files/0/a.rhai is missing", &[("choreo.json", Regular, &plain)]);
    let unpackable = "it is not a scene that choreo pack has written: ";
    refused(&format!("{unpackable}it does not begin with choreo.json"), &[script_entry]);
    refused(&format!("{unpackable}it is not a tar archive"), &[]);
    refused(&format!("{unpackable}choreo.json is not JSON"), &[("choreo.json", Regular, b"{")]);
    // Truncated anywhere, the archive is refused or lacks only its end marker.
    let complete = archive(&[("choreo.json", Regular, &plain), script_entry]);
    for cut in (0..complete.len()).step_by(97) {
        write(d, "a.choreo", &complete[..cut]);
        let code = choreo(d, &["check", "a.choreo"]).code;
        assert!(code == 1 || cut >= complete.len() - 1536, "cut at {cut} of {}", complete.len());
    }
    write(d, "a.choreo", archive(&[("choreo.json", Regular, &plain), script_entry]));
    let run = choreo(d, &["check", "a.choreo", "--limit", "file=10"]);
    assert!(run.err.starts_with("a.choreo: files/0/a.rhai is too large\n    hint: "), "{}", run.err);
}

/// If a plugin of the user would be used, the same files could give another scene.
#[test]
fn an_archive_that_gives_another_scene_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    write(d, "scene/a.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
    write(d, "scene/s.rhai", "stage(#{ length: 0.1, size: [16, 16] }); cast(\"a\", load(\"a.dots\"));");
    write(d, "plugins/dots.importer.rhai", IMPORTER);
    write(d, "others/dots.importer.rhai", IMPORTER.replace("rest.numbers()", "rest.numbers() * 2.0"));
    let with = |plugins: &str, args: &[&str]| {
        run_result(command(d, args).env("CHOREO_PLUGINS", d.join(plugins)).output().unwrap())
    };
    let run = with("plugins", &["pack", "scene/s.rhai", "-o", "s.choreo"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let render = ["render", "s.choreo", "--at", "0", "-o", "a.png", "--device", "cpu"];
    // The plugin of the scene is in the archive, and takes precedence over those of the user.
    assert_eq!(choreo(d, &render).code, 0);
    assert_eq!(with("others", &render).code, 0);
    let mut archive = read_file(d, "s.choreo");
    let stage = archive.windows(9).position(|w| w == b"\"stage\": ").unwrap() + 10;
    archive[stage] = if archive[stage] == b'0' { b'1' } else { b'0' };
    std::fs::write(d.join("s.choreo"), archive).unwrap();
    let run = choreo(d, &render);
    assert_eq!(run.code, 1);
    assert!(run.err.contains("s.rhai: the scene differs from the one that was packed\n"), "{}", run.err);
}

#[test]
fn inputs_that_cannot_be_packed_are_refused() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let usage = |args: &[&str], what: &str| {
        let run = choreo(d, args);
        assert!(run.code != 0 && run.err.contains(what), "{args:?}: {}", run.err);
        assert!(part_files(d).is_empty());
    };
    usage(&["pack", "tri.gltf", "-o", "tri.gltf"], "write a name that ends in .choreo");
    usage(&["pack", "choreo:mannequin", "-o", "a.choreo"], "there is nothing to pack");
    usage(&["pack", "none.rhai", "-o", "a.choreo"], "none.rhai: no such file");
    run_successfully(d, &["pack", "tri.gltf", "-o", "a.choreo"]);
    usage(&["pack", "a.choreo", "-o", "b.choreo"], "it is packed already");
    // A render of the scene does not change the archive beside it.
    usage(&["render", "a.choreo", "-o", "a.choreo"], "the file extension selects the format");
}

/// A scene packed as a folder has the files of the archive and renders the same bytes. Links in it are refused, whatever their target.
#[cfg(unix)]
#[test]
fn a_packed_folder_equals_the_archive_and_refuses_links() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    write_project(d);
    run_successfully(d, &["pack", "scenes/film.rhai", "-o", "film.choreo"]);
    run_successfully(d, &["pack", "scenes/film.rhai", "-o", "film/"]);
    let mut archive = tar::Archive::new(std::io::Cursor::new(read_file(d, "film.choreo")));
    let mut count = 0;
    for entry in archive.entries().unwrap() {
        let mut entry = entry.unwrap();
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut entry, &mut bytes).unwrap();
        assert!(std::fs::read(d.join("film").join(entry.path().unwrap())).unwrap() == bytes);
        count += 1;
    }
    assert!(count == 14 && count_files_below(&d.join("film")) == count);
    run_successfully(d, &["render", "film.choreo", "-o", "one.mp4"]);
    std::fs::rename(d.join("scenes"), d.join("gone")).unwrap();
    run_successfully(d, &["render", "film", "-o", "two.mp4"]);
    assert!(read_file(d, "one.mp4") == read_file(d, "two.mp4"));
    let run = choreo(d, &["pack", "gone/film.rhai", "-o", "film/"]);
    assert!(run.code == 3 && run.err.contains("film/: it exists already"), "{}", run.err);
    let refused = |what: &str| {
        let run = choreo(d, &["check", "film"]);
        assert!(run.code == 1 && run.err.starts_with(&format!("film: it is damaged: {what}")), "{}", run.err);
    };
    let dots = d.join("film/files/0/a.dots");
    std::fs::rename(&dots, d.join("film/files/0/b.dots")).unwrap();
    refused("files/0/a.dots: ");
    std::os::unix::fs::symlink("b.dots", &dots).unwrap();
    refused("a different file is in the place of files/0/a.dots");
    std::fs::remove_file(&dots).unwrap();
    std::os::unix::fs::symlink(d.join("gone/a.dots"), &dots).unwrap();
    refused("files/0/a.dots: ");
    std::fs::remove_file(&dots).unwrap();
    std::fs::write(&dots, "DOTS 0 0 0, 1 0 0, 0 2 0").unwrap();
    refused("files/0/a.dots does not match its hash");
    std::fs::remove_file(&dots).unwrap();
    std::fs::rename(d.join("film/files/0/b.dots"), &dots).unwrap();
    std::fs::rename(d.join("film/files/1"), d.join("film/files/one")).unwrap();
    std::os::unix::fs::symlink("one", d.join("film/files/1")).unwrap();
    refused("a different file is in the place of files/1/deep/buffers/tri.bin");
}

fn count_files_below(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { count_files_below(&path) } else { 1 }).sum()
}

/// `choreo test` runs the sections of a packed script, and `choreo view` shows it, unpacked until the viewer ends.
#[cfg(unix)]
#[test]
fn a_packed_scene_is_tested_and_viewed() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    write_project(d);
    let sections = "stage(#{ size: [16, 16], length: 0.1 });\nlet b = cast(\"b\", load(\"deep/model.gltf\")).at(1, 0, 0);\n\
                    test(\"place\", || { expect(b).at(0.0).near([1.0, 0.0, 0.0], cm(1)); });\n";
    write(d, "scenes/t.rhai", sections);
    let scratch = d.join("scratch");
    std::fs::create_dir(&scratch).unwrap();
    let outcome = |name: &str| {
        run_successfully(d, &["pack", "scenes/t.rhai", "-o", name]);
        let output = command(d, &["test", name]).env("TMPDIR", &scratch).output().unwrap();
        assert!(file_names(&scratch).is_empty(), "{:?}", file_names(&scratch));
        run_result(output)
    };
    let run = outcome("t.choreo");
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    write(d, "scenes/t.rhai", sections.replace("near([1.0", "near([1.5"));
    assert_eq!(outcome("wrong.choreo").code, 1);
    let refused = choreo(d, &["test", "t.choreo", "--accept"]);
    assert!(refused.code == 2 && refused.err.contains("t.choreo: it is packed"), "{}", refused.err);
    // A substitute for the viewer that only prints its arguments, beside a copy of the program.
    std::fs::copy(env!("CARGO_BIN_EXE_choreo"), d.join("choreo")).unwrap();
    let viewer = "#!/bin/sh\nls \"$1\"\nfor word; do echo \"$word\"; done\n";
    std::fs::write(d.join("choreo-view"), viewer).unwrap();
    std::fs::set_permissions(d.join("choreo-view"), PermissionsExt::from_mode(0o755)).unwrap();
    run_successfully(d, &["pack", "scenes/film.rhai", "--set", "color=#e04020", "-o", "film.choreo"]);
    let view = |more: &[&str]| {
        let mut command = std::process::Command::new(d.join("choreo"));
        command.args(["view", "film.choreo"]).args(more).current_dir(d).env_remove("CARGO");
        let run = run_result(command.env("TMPDIR", &scratch).env("CHOREO_PLUGINS", "").output().unwrap());
        assert!(run.code == 0 && file_names(&scratch).is_empty(), "{}", run.err);
        run.out
    };
    let shown = view(&["--play"]);
    let words: Vec<&str> = shown.lines().collect();
    assert!(words[0] == words[1] && words[0].ends_with("/files/0/film.rhai"), "{shown}");
    assert!(words.contains(&"color=#e04020") && words.last() == Some(&"--play"), "{shown}");
    assert!(words.iter().any(|word| word.ends_with("/files/1")), "{shown}");
    let shown = view(&["--set", "color=#2040e0"]);
    assert!(!shown.contains("color=#e04020") && shown.contains("color=#2040e0"), "{shown}");
}
