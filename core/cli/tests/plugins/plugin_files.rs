//! Plugins in single files beside a script: how they are found, listed, used, hashed, and refused with the line of the fault.

use crate::common::*;
use std::path::Path;

const IMPORTER: &str = r#"
fn manifest() {
    #{ name: "dots", about: "vertices of triangles", extensions: "dots", magic: "DOTS",
       options: #{ scale: #{ value: 1.0, min: 0.1, max: 10.0, about: "metres a unit" } } }
}

fn load(file) {
    let rest = file.bytes.part(4, file.bytes.len - 4);
    mesh(#{ name: "dots", positions: rest.numbers() * file.options.scale });
}
"#;

/// Exchanges red and blue.
const EFFECT: &str = "// effect: swap
// about: exchanges red and blue
// param amount = 1.0 in 0..1: how much
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    return mix(color, color.bgra, p[amount]);
}
";

const SCRIPT: &str = r##"
stage(#{ size: [32, 32], fps: 10, length: 0.1, background: "#ff0000", samples: 1 });
cast("a", load("a.dots", #{ scale: 2.0 }));
effect("swap");
camera("c").at(0.0, 0.0, 9.0).look_at([0.0, 0.0, 0.0]);
"##;

fn folder_with_plugins() -> tempfile::TempDir {
    let dir = folder_with_triangle();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("plugins/dots.importer.rhai", IMPORTER);
    write("plugins/swap.wgsl", EFFECT);
    write("a.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
    write("s.rhai", SCRIPT);
    dir
}

fn run_successfully(dir: &Path, args: &[&str]) -> String {
    let run = choreo(dir, args);
    assert_eq!(run.code, 0, "{args:?}: {}", run.err);
    run.out
}

#[test]
fn plugins_beside_a_script_are_listed_and_checked() {
    let dir = folder_with_plugins();
    let out = run_successfully(dir.path(), &["plugins"]);
    assert!(out.contains("  dots         .dots          vertices of triangles ("), "{out}");
    assert!(out.contains("      scale          metres a unit (0.1 to 10, default 1)"), "{out}");
    assert!(out.contains("swap.wgsl)"), "{out}");
    run_successfully(dir.path(), &["check", "s.rhai"]);
    // Plugins beside the named files are listed, too, from their manifests alone.
    let out = run_successfully(dir.path(), &["info", "a.dots", "--help"]);
    assert!(out.contains("  dots\n      scale          metres a unit (0.1 to 10, default 1)"), "{out}");
    assert!(out.contains("      tolerance      largest rotation error between keys"), "{out}");
    let out = run_successfully(dir.path(), &["render", "--help"]);
    assert!(out.contains("Options of exporters") && out.contains("Limits, set with --limit"), "{out}");
    let out = run_successfully(dir.path(), &["plugins", "--for", "a.dots"]);
    assert!(out.starts_with("a.dots: read by dots\n  dots         by content, 90 of 100\n"), "{out}");
    let out = run_successfully(dir.path(), &["info", "a.dots", "--import", "scale=3"]);
    assert!(out.contains("size       3.000 × 3.000 × 0.000 m"), "{out}");
}

#[test]
fn an_effect_file_draws_the_same_on_the_cpu_and_on_vulkan() {
    let dir = folder_with_plugins();
    run_successfully(
        dir.path(),
        &["render", "s.rhai", "-o", "cpu.png", "--at", "0", "--device", "cpu", "-q"],
    );
    let cpu = first_pixel(&read_file(dir.path(), "cpu.png"));
    assert_eq!(cpu, [0, 0, 255], "red has become blue");
    let run =
        choreo(dir.path(), &["render", "s.rhai", "-o", "gpu.png", "--at", "0", "--device", "vulkan", "-q"]);
    if run.code == 4 {
        println!("SKIP 1: no Vulkan driver");
        return;
    }
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(first_pixel(&read_file(dir.path(), "gpu.png")), cpu);
}

/// The first pixel of a PNG, red green blue.
fn first_pixel(png: &[u8]) -> [u8; 3] {
    let image = image::load_from_memory(png).unwrap().into_rgb8();
    image.get_pixel(0, 0).0
}

#[test]
fn errors_of_a_plugin_state_file_and_line() {
    let dir = folder_with_plugins();
    std::fs::write(dir.path().join("plugins/bad.wgsl"), EFFECT.replace("color.bgra", "colr")).unwrap();
    std::fs::write(dir.path().join("plugins/bad.importer.rhai"), "fn manifest() {\n  let = 1;\n}").unwrap();
    let run = choreo(dir.path(), &["plugins"]);
    assert_eq!(run.code, 1);
    // Its name is swap, like that of the other plugin; a later plugin with the same name is not used, but its faults are reported.
    assert!(run.err.contains("plugins/bad.wgsl:5:23: "), "{}", run.err);
    assert!(run.err.contains("plugins/bad.importer.rhai:2:7: "), "{}", run.err);
    assert!(run.out.contains("dots"), "what works is listed: {}", run.out);
}

/// A faulty plugin does not affect scenes that do not use it.
#[cfg(not(feature = "wasm"))]
#[test]
fn a_wasm_plugin_in_a_build_without_wasm_is_an_error_that_names_the_feature() {
    let dir = folder_with_plugins();
    std::fs::write(dir.path().join("plugins/odd.importer.wasm"), b"\0asm\x01\0\0\0").unwrap();
    run_successfully(dir.path(), &["check", "s.rhai"]);
    let run = choreo(dir.path(), &["plugins"]);
    let what = "odd.importer.wasm: this choreo was built without WebAssembly; \
        build it with: cargo build --release --features wasm";
    assert!(run.code == 1 && run.err.contains(what), "{}", run.err);
    std::fs::write(dir.path().join("a.odd"), "x").unwrap();
    let run = choreo(dir.path(), &["info", "a.odd"]);
    assert!(run.code != 0 && run.err.contains("odd.importer.wasm"), "{}", run.err);
}

/// A faulty plugin is an error only in a scene that uses it, at the position of its use.
#[test]
fn a_broken_plugin_breaks_only_what_uses_it() {
    let dir = folder_with_plugins();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("plugins/bad.wgsl", &EFFECT.replace("swap", "bad").replace("color.bgra", "colr"));
    write(
        "plugins/deep.wgsl",
        &EFFECT.replace("swap", "deep").replace("p[amount]", &format!("1.0{}", "+uv.x".repeat(20_000))),
    );
    let else_ifs = " else if uv.x < 0.1 { return color; }".repeat(3_000);
    let else_ifs = format!("if uv.x < 0.0 {{ return color; }}{else_ifs} return");
    write("plugins/else_ifs.wgsl", &EFFECT.replace("swap", "else_ifs").replace("return", &else_ifs));
    write("plugins/nameless.wgsl", "fn effect() {}\n");
    write(
        "plugins/bad.importer.rhai",
        &IMPORTER.replace("dots", "bad").replace("DOTS", "BAD").replace("file.options", "= file"),
    );
    write("plugins/worse.importer.rhai", "fn manifest() {\n  let = 1;\n}");
    run_successfully(dir.path(), &["check", "s.rhai"]);
    run_successfully(dir.path(), &["render", "s.rhai", "-o", "o.png", "--at", "0", "--device", "cpu", "-q"]);
    run_successfully(dir.path(), &["info", "a.dots"]);
    let error = |line: &str| {
        write("bad.rhai", &SCRIPT.replace("effect(\"swap\");", line));
        let run = choreo(dir.path(), &["check", "bad.rhai"]);
        assert_eq!(run.code, 1, "{line}: {}", run.err);
        run.err
    };
    let text = error("effect(\"bad\");");
    assert!(text.contains("bad.rhai:4:1: plugins/bad.wgsl:5:23: no definition in scope"), "{text}");
    let levels = "nested more than 350 levels deep: each bracket counts 5, each operator and else if of a statement 1; split it \
        with let, or use a loop or switch";
    let text = error("effect(\"deep\");");
    assert!(text.contains(&format!("bad.rhai:4:1: plugins/deep.wgsl:5:853: {levels}")), "{text}");
    let text = error("effect(\"else_ifs\");");
    assert!(text.contains(&format!("bad.rhai:4:1: plugins/else_ifs.wgsl:5:11896: {levels}")), "{text}");
    write("a.bad", "BAD 0 0 0");
    let text = error("cast(\"b\", load(\"a.bad\"));");
    assert!(text.contains("a.bad: plugins/bad.importer.rhai:9:"), "{text}");
    // If something is not found, the message names the files that are not plugins.
    let text = error("effect(\"worse\");");
    let faulty = "no plugin: plugins/nameless.wgsl:";
    assert!(text.contains("bad.rhai:4:8: unknown effect \"worse\"") && text.contains(faulty), "{text}");
    assert!(
        text.contains("packages of plugins: choreo plugins list") && !text.contains("worse.importer"),
        "{text}"
    );
    // A WGSL file beside a script is an effect only if its header names it, so a spelling error there is reported.
    write("snow.wgsl", "// effct: snow\n");
    let text = error("effect(\"snow\");");
    assert!(text.contains("no plugin: ./snow.wgsl: it has no line // effect: NAME"), "{text}");
    write("a.worse", "WORSE 0 0 0");
    let text = error("cast(\"b\", load(\"a.worse\"));");
    assert!(text.contains("no importer knows this kind of file"), "{text}");
    assert!(text.contains("no plugin: plugins/worse.importer.rhai:"), "{text}");
    let run = choreo(dir.path(), &["plugins"]);
    // Lines of code and carets are indented.
    let problems = run.err.lines().filter(|line| !line.starts_with("    ")).count();
    assert_eq!((run.code, problems), (1, 6), "{}", run.err);
}

/// A downloaded folder can have links out of the folder beside a script, and pipes that nobody writes to.
#[test]
#[cfg(unix)]
fn links_out_of_the_folder_and_pipes_are_not_read() {
    use std::os::unix::fs::symlink;
    let dir = folder_with_triangle();
    let scene = dir.path().join("scene");
    std::fs::create_dir_all(scene.join("plugins/inner")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("swap.wgsl", EFFECT);
    write("dots.importer.rhai", IMPORTER);
    write("scene/a.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
    write("scene/s.rhai", SCRIPT);
    symlink("../../swap.wgsl", scene.join("plugins/swap.wgsl")).unwrap();
    symlink("../../dots.importer.rhai", scene.join("plugins/dots.importer.rhai")).unwrap();
    let run = choreo(&scene, &["plugins"]);
    let refused = "cannot read: it is a link that leads out of";
    assert_eq!(run.code, 1);
    for name in ["plugins/swap.wgsl", "plugins/dots.importer.rhai"] {
        assert!(run.err.contains(&format!("{name}: {refused}")), "{}", run.err);
    }
    let run = choreo(&scene, &["check", "s.rhai"]);
    assert!(run.code == 1 && run.err.contains("no importer knows this kind of file"), "{}", run.err);
    // Links within the folder of the script are followed.
    let into = |name: &str| {
        std::fs::remove_file(scene.join("plugins").join(name)).unwrap();
        std::fs::copy(dir.path().join(name), scene.join(name)).unwrap();
        symlink(Path::new("..").join(name), scene.join("plugins").join(name)).unwrap();
    };
    into("swap.wgsl");
    into("dots.importer.rhai");
    run_successfully(&scene, &["check", "s.rhai"]);
    // Textures must not be links out of the folder of the effect, or pipes.
    write("out.tga", "secret");
    let inked = EFFECT.replace("// param", "// texture ink = ink.tga: it\n// param");
    std::fs::remove_file(scene.join("plugins/swap.wgsl")).unwrap();
    write("scene/plugins/swap.wgsl", &inked);
    let check_error = || {
        let run = choreo(&scene, &["check", "s.rhai"]);
        assert_eq!(run.code, 1);
        run.err
    };
    symlink("../../out.tga", scene.join("plugins/ink.tga")).unwrap();
    let place = "plugins/swap.wgsl:3:1: texture ink: \"ink.tga\": ";
    assert!(
        check_error().contains(&format!("{place}a plugin reads files of its own folder only")),
        "{}",
        check_error()
    );
    std::fs::remove_file(scene.join("plugins/ink.tga")).unwrap();
    make_pipe(&scene.join("plugins/ink.tga"));
    assert!(
        check_error().contains(&format!("{place}it is a pipe or device, not a regular file")),
        "{}",
        check_error()
    );
    // Pipes are not plugins.
    std::fs::remove_file(scene.join("swap.wgsl")).unwrap();
    std::fs::remove_file(scene.join("plugins/swap.wgsl")).unwrap();
    make_pipe(&scene.join("plugins/swap.wgsl"));
    assert!(check_error().contains("unknown effect \"swap\""), "{}", check_error());
    let run = choreo(&scene, &["plugins"]);
    let expected = "plugins/swap.wgsl: cannot read: it is a pipe or device, not a regular file";
    assert!(run.code == 1 && run.err.contains(expected), "{}", run.err);
    // The plugin folder itself is a link.
    std::fs::rename(scene.join("plugins"), dir.path().join("shared")).unwrap();
    symlink("../shared", scene.join("plugins")).unwrap();
    let expected = "plugins: it is a symbolic link that leads out of the script's folder; to use the plugins there, name their folder with --plugins";
    for command in [&["check", "s.rhai"][..], &["plugins"]] {
        let run = choreo(&scene, command);
        assert_eq!((run.code, run.err.trim_end().trim_start_matches("./")), (1, expected));
    }
    // A folder that the user names can be a link.
    let run = choreo(&scene, &["plugins", "--plugins", "plugins"]);
    assert!(!run.err.contains(expected), "{}", run.err);
}

#[cfg(unix)]
fn make_pipe(path: &Path) {
    assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
fn a_byte_order_mark_is_ignored() {
    let dir = folder_with_plugins();
    let write =
        |name: &str, text: &str| std::fs::write(dir.path().join(name), format!("\u{feff}{text}")).unwrap();
    write("plugins/dots.importer.rhai", IMPORTER);
    write("plugins/swap.wgsl", EFFECT);
    write("half.rhai", "fn half(x) { x / 2.0 }");
    write("tri.gltf", &triangle(1.0));
    let script =
        format!("import \"half\" as h; cast(\"t\", load(\"tri.gltf\")).at(h::half(2.0), 0.0, 0.0);{SCRIPT}");
    write("s.rhai", &script);
    run_successfully(dir.path(), &["check", "s.rhai"]);
    run_successfully(dir.path(), &["plugins"]);
    // Columns of the first line do not count the byte order mark, as in editors.
    write("s.rhai", "cast(\"t\", lod(\"tri.gltf\"));");
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert!(run.err.starts_with("s.rhai:1:11: unknown function"), "{}", run.err);
    write("half.rhai", "fn half(x) { x / }");
    write("s.rhai", "import \"half\" as h;");
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert!(run.err.starts_with("half.rhai:1:18: "), "{}", run.err);
}

#[test]
fn an_error_in_an_importer_names_both_files() {
    let dir = folder_with_plugins();
    std::fs::write(dir.path().join("a.dots"), "DOTS 0 0 zero").unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert_eq!(run.code, 1);
    let expected = "a.dots: plugins/dots.importer.rhai:9:43: numbers: \"zero\" is no number";
    assert!(run.err.contains(expected), "{}", run.err);
}

#[test]
fn only_named_folders_are_read() {
    let dir = folder_with_plugins();
    std::fs::rename(dir.path().join("plugins"), dir.path().join("mine")).unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert!(run.code == 1 && run.err.contains("no importer knows this kind of file"), "{}", run.err);
    run_successfully(dir.path(), &["check", "s.rhai", "--plugins", "mine"]);
    let with_variable =
        command(dir.path(), &["check", "s.rhai"]).env("CHOREO_PLUGINS", "mine").output().unwrap();
    assert_eq!(run_result(with_variable).code, 0);
    let run = choreo(dir.path(), &["check", "s.rhai", "--plugins", "nowhere"]);
    assert_eq!((run.code, run.err.lines().next()), (2, Some("--plugins nowhere: no such folder")));
}

/// Plugins can be directly beside the script. If a plugin is found twice, it is read once. Other WGSL files there are ignored.
#[test]
fn plugins_beside_the_script_are_found_once() {
    let dir = folder_with_plugins();
    for name in ["dots.importer.rhai", "swap.wgsl"] {
        std::fs::rename(dir.path().join("plugins").join(name), dir.path().join(name)).unwrap();
    }
    run_successfully(dir.path(), &["check", "s.rhai", "--plugins", "."]);
    std::fs::write(dir.path().join("part.wgsl"), "fn helper(x: f32) -> f32 { return x * 2.0; }\n").unwrap();
    run_successfully(dir.path(), &["check", "s.rhai"]);
    let out = run_successfully(dir.path(), &["plugins"]);
    assert_eq!(out.matches("dots.importer.rhai)").count(), 1, "{out}");
    assert!(out.contains("swap.wgsl)") && !out.contains("part.wgsl"), "{out}");
    run_successfully(dir.path(), &["info", "a.dots"]);
    // A file whose header says that it is a plugin must be valid.
    std::fs::write(dir.path().join("part.wgsl"), "// effect: part\nfn helper() {}\n").unwrap();
    let run = choreo(dir.path(), &["plugins"]);
    assert!(run.code == 1 && run.err.contains("part.wgsl"), "{}", run.err);
    run_successfully(dir.path(), &["check", "s.rhai"]);
}

#[test]
fn a_changed_plugin_changes_the_scripts_hash() {
    let dir = folder_with_plugins();
    let hash = || {
        run_successfully(
            dir.path(),
            &["render", "s.rhai", "-o", "o.png", "--at", "0", "--device", "cpu", "-q"],
        );
        run_successfully(dir.path(), &["info", "o.png"])
    };
    let before = hash();
    assert_eq!(before, hash());
    std::fs::write(dir.path().join("plugins/unused.wgsl"), EFFECT.replace("swap", "other")).unwrap();
    assert_eq!(before, hash(), "a plugin that is not used does not matter");
    std::fs::write(dir.path().join("plugins/dots.importer.rhai"), format!("{IMPORTER}// changed\n")).unwrap();
    assert_ne!(before, hash());
}

#[test]
fn the_plugin_lesson_passes_check() {
    let lesson = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/08_plugins");
    let out = run_successfully(&lesson, &["check", "lesson.rhai"]);
    assert!(out.contains("good, 180 frames, no warnings"), "{out}");
}

/// If a file replaces a built-in effect or another file, a message says so.
#[test]
fn a_plugin_that_hides_another_of_its_name_is_noted() {
    let dir = folder_with_plugins();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert_eq!((run.code, run.err.contains("replaces another one")), (0, false), "{}", run.err);
    let write =
        |name: &str, text: String| std::fs::write(dir.path().join("plugins").join(name), text).unwrap();
    write("my_fog.wgsl", EFFECT.replace("effect: swap", "effect: fog"));
    write("swap_2.wgsl", EFFECT.into());
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    let note = |file: &str, name: &str| {
        let file = Path::new("plugins").join(file);
        format!("note: {}: the effect {name} replaces another one of this name", file.display())
    };
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(run.err.contains(&note("my_fog.wgsl", "fog")), "{}", run.err);
    assert!(run.err.contains(&note("swap_2.wgsl", "swap")), "{}", run.err);
}

#[test]
fn a_warning_of_an_effect_is_printed_with_quiet_too() {
    let dir = folder_with_triangle();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    let effect = |result: &str| {
        format!(
            "// effect: broken\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {{ return {result}; }}\n"
        )
    };
    write("s.rhai", "stage(#{ size: [16, 16], fps: 10, length: 0.1, samples: 1 });\neffect(\"broken\");\n");
    let render =
        || choreo(dir.path(), &["render", "s.rhai", "-o", "o.png", "--at", "0", "--device", "cpu", "-q"]);
    write("broken.wgsl", &effect("color / (uv.x - uv.x)"));
    let run = render();
    assert!(
        run.code == 0 && run.err.contains("warning: effect \"broken\": the result at pixel (0, 0)"),
        "{}",
        run.err
    );
    write("broken.wgsl", &effect("color"));
    let run = render();
    assert!(run.code == 0 && !run.err.contains("effect \"broken\""), "{}", run.err);
}
