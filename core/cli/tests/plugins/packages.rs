//! `choreo plugins install|list|remove|test`: packages with a plugin.toml are checked, installed completely or not at all, found by all
//! commands, named with their version in the provenance of outputs, and removed completely.

use crate::common::*;
use std::path::{Path, PathBuf};

const DESCRIPTION: &str = r#"name = "prints"
version = "1.2.0"
choreo = "0.1.0"
license = "MIT OR Apache-2.0"
about = "dots and swapped colors"

[[plugin]]
file = "dots.importer.rhai"
kind = "importer"

[[plugin]]
file = "cast.exporter.rhai"
kind = "exporter"

[[plugin]]
file = "swap.wgsl"
kind = "effect"
hook = "pixel"
"#;

const IMPORTER: &str = r#"
fn manifest() { #{ name: "dots", version: "1.2.0", extensions: "dots", magic: "DOTS" } }

fn load(file) { mesh(#{ positions: file.bytes.part(4, file.bytes.len - 4).numbers() }); }
"#;

const EXPORTER: &str = r#"
fn manifest() { #{ name: "cast", version: "1.2.0", extensions: "cast" } }

fn save(scene) { for actor in scene.actors { writeln(actor.name); } }
"#;

/// Exchanges red and blue.
const EFFECT: &str = "// effect: swap
// version: 1.2.0
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color.bgra; }
";

const TEST: &str = r#"test("dots stand where the file says", || {
    let a = cast("a", load("a.dots"));
    effect("swap");
    expect(a.joint("mesh 0")).near([0, 0, 0], 0.001);
});
"#;

const SCRIPT: &str = r##"
stage(#{ size: [32, 32], fps: 10, length: 0.1, background: "#ff0000", samples: 1 });
cast("anna", load("b.dots"));
effect("swap");
camera("c").at(0.0, 0.0, 9.0).look_at([0.0, 0.0, 0.0]);
"##;

/// A folder with a package in `source`, a scene that needs the package, and the user's data folder `data`.
struct PackageTest(tempfile::TempDir);

impl PackageTest {
    fn new() -> PackageTest {
        let test = PackageTest(tempfile::tempdir().unwrap());
        test.write("source/plugin.toml", DESCRIPTION);
        test.write("source/dots.importer.rhai", IMPORTER);
        test.write("source/cast.exporter.rhai", EXPORTER);
        test.write("source/swap.wgsl", EFFECT);
        test.write("source/a.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
        test.write("source/tests/dots.rhai", TEST);
        test.write("source/.git/config", "hidden");
        test.write("b.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
        test.write("s.rhai", SCRIPT);
        test
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    /// The program, with the user's folder of plugins below `data`.
    fn run(&self, args: &[&str]) -> Run {
        let mut command = command(self.path(), args);
        command.env_remove("CHOREO_PLUGINS").env("XDG_DATA_HOME", self.path().join("data"));
        run_result(command.output().unwrap())
    }

    fn run_successfully(&self, args: &[&str]) -> String {
        let run = self.run(args);
        assert_eq!(run.code, 0, "{args:?}: {}{}", run.out, run.err);
        run.out
    }

    /// The folder in which packages are installed.
    fn plugins_folder(&self) -> PathBuf {
        self.path().join("data/choreo/plugins")
    }

    /// Names in the user's folder of plugins, including hidden ones.
    fn installed_names(&self) -> Vec<String> {
        if self.plugins_folder().is_dir() { file_names(&self.plugins_folder()) } else { Vec::new() }
    }

    fn refused_install(&self, text: &str) -> String {
        let run = self.run(&["plugins", "install", "source"]);
        assert_ne!(run.code, 0, "{}", run.out);
        assert!(run.err.contains(text), "{text}: {}", run.err);
        assert_eq!(self.installed_names(), Vec::<String>::new(), "nothing is left of a refused package");
        run.err
    }
}

#[test]
fn an_installed_package_is_found_named_and_removed() {
    let test = PackageTest::new();
    assert!(test.run(&["check", "s.rhai"]).code == 1, "without the package the scene is faulty");
    let out = test.run_successfully(&["plugins", "install", "source"]);
    let target = test.plugins_folder().join("prints");
    let contents = "importer dots.importer.rhai, exporter cast.exporter.rhai, effect swap.wgsl (pixel)";
    assert!(out.contains(&format!("prints 1.2.0: installed in {}", target.display())), "{out}");
    assert!(out.contains("license: MIT OR Apache-2.0") && out.contains(contents), "{out}");
    assert_eq!(test.installed_names(), ["prints"]);
    let copied = ["a.dots", "cast.exporter.rhai", "dots.importer.rhai", "plugin.toml", "swap.wgsl", "tests"];
    assert_eq!(file_names(&target), copied, "hidden files stay behind");

    let list = test.run_successfully(&["plugins", "list"]);
    assert!(list.contains("  prints 1.2.0 (MIT OR Apache-2.0) dots and swapped colors\n"), "{list}");
    let listed: serde_json::Value =
        serde_json::from_str(&test.run_successfully(&["plugins", "list", "--json"])).unwrap();
    assert_eq!(listed["packages"][0]["plugins"][2]["hook"], "pixel");
    let all = test.run_successfully(&["plugins"]);
    assert!(["dots ", "cast ", "swap "].iter().all(|name| all.contains(name)), "{all}");

    test.run_successfully(&["check", "s.rhai"]);
    test.run_successfully(&["render", "s.rhai", "-o", "s.png", "--at", "0", "--device", "cpu", "-q"]);
    let image = image::load_from_memory(&read_file(test.path(), "s.png")).unwrap().into_rgb8();
    assert_eq!(image.get_pixel(0, 0).0, [0, 0, 255], "red has become blue");
    let info = test.run_successfully(&["info", "s.png"]);
    assert!(info.contains("dots 1.2.0, swap 1.2.0"), "{info}");
    let exported: serde_json::Value =
        serde_json::from_str(&test.run_successfully(&["export", "s.rhai", "-o", "s.cast", "--json"]))
            .unwrap();
    assert_eq!(exported["provenance"]["choreo:exporter"], "cast 1.2.0");
    assert_eq!(read_file(test.path(), "s.cast"), b"anna\n");

    // CHOREO_PLUGINS replaces the user's folder of plugins; a folder given with --plugins can contain packages, too.
    let mut other = command(test.path(), &["check", "s.rhai"]);
    other.env("CHOREO_PLUGINS", "").env("XDG_DATA_HOME", test.path().join("data"));
    assert_eq!(run_result(other.output().unwrap()).code, 1);
    let named = command(test.path(), &["check", "s.rhai", "--plugins", "data/choreo/plugins"]).output();
    assert_eq!(run_result(named.unwrap()).code, 0);

    assert_eq!(test.run_successfully(&["plugins", "remove", "prints"]), "prints: removed\n");
    assert_eq!(test.installed_names(), Vec::<String>::new());
    assert_eq!(test.run(&["check", "s.rhai"]).code, 1);
    let run = test.run(&["plugins", "remove", "prints"]);
    assert!(
        run.code == 2 && run.err.contains("there is no package \"prints\"; none is installed"),
        "{}",
        run.err
    );
    let run = test.run(&["plugins", "remove", "../.."]);
    assert!(run.code == 2 && run.err.contains("there is no package \"../..\""), "{}", run.err);
    assert!(test.path().join("s.rhai").is_file());
}

#[test]
fn malformed_too_new_or_contradictory_packages_are_refused() {
    let test = PackageTest::new();
    let described = |from: &str, to: &str| {
        assert!(DESCRIPTION.contains(from));
        test.write("source/plugin.toml", &DESCRIPTION.replacen(from, to, 1));
    };
    described("license", "licence");
    test.refused_install("plugin.toml:4:1: unknown key \"licence\"; did you mean \"license\"?");
    described("choreo = \"0.1.0\"", "choreo = \"77.0.0\"");
    test.refused_install("plugin.toml:3:10: the package needs choreo 77.0.0, this is choreo");
    described("1.2.0", "1.2.1");
    test.refused_install(
        "dots.importer.rhai: the plugin states version 1.2.0, plugin.toml 1.2.1; write the same in both",
    );
    described("hook = \"pixel\"", "hook = \"surface\"");
    test.refused_install("swap.wgsl: the effect has the hook pixel, plugin.toml states surface");
    described("swap.wgsl", "swop.wgsl");
    test.refused_install("swop.wgsl: cannot read: no such file or folder");
    test.write("source/plugin.toml", DESCRIPTION);
    test.write("source/swap.wgsl", &EFFECT.replace("color.bgra", "colr"));
    test.refused_install("swap.wgsl:3:");
    test.write("source/swap.wgsl", EFFECT);
    test.write("source/plugin.toml", "");
    test.refused_install("plugin.toml:1:1: name is missing");
    std::fs::remove_file(test.path().join("source/plugin.toml")).unwrap();
    let text = test.refused_install("this file is missing; a package needs it. A complete example:");
    assert!(text.contains("[[plugin]]"), "{text}");
    test.write("source/plugin.toml", DESCRIPTION);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/etc/hostname", test.path().join("source/tests/link")).unwrap();
        test.refused_install("tests/link: a package must not contain links");
        std::fs::remove_file(test.path().join("source/tests/link")).unwrap();
    }
    let run = test.run(&["plugins", "install", "b.dots"]);
    assert!(run.code == 1 && run.err.contains("plugin.toml: this file is missing"), "{}", run.err);
    let run = test.run(&["plugins", "install", "source/a.dots"]);
    assert!(
        run.code == 1 && run.err.contains("beside it does not name it, only dots.importer.rhai"),
        "{}",
        run.err
    );
    test.run_successfully(&["plugins", "install", "source/swap.wgsl"]);
}

#[test]
fn another_version_is_installed_only_with_replace() {
    let test = PackageTest::new();
    test.run_successfully(&["plugins", "install", "source"]);
    for name in ["plugin.toml", "dots.importer.rhai", "cast.exporter.rhai", "swap.wgsl"] {
        let text = std::fs::read_to_string(test.path().join("source").join(name)).unwrap();
        test.write(&format!("source/{name}"), &text.replace("1.2.0", "1.3.0"));
    }
    std::fs::remove_file(test.path().join("source/a.dots")).unwrap();
    let run = test.run(&["plugins", "install", "source"]);
    assert!(run.code == 3 && run.err.contains("prints 1.2.0 is installed already"), "{}", run.err);
    test.run_successfully(&["plugins", "install", "source", "--replace"]);
    assert_eq!(test.installed_names(), ["prints"]);
    assert!(!test.plugins_folder().join("prints/a.dots").exists(), "nothing of the old one is left");
    assert!(test.run_successfully(&["plugins", "list"]).contains("prints 1.3.0"));
    // A package that became faulty after its installation is reported and can be removed.
    std::fs::write(test.plugins_folder().join("prints/plugin.toml"), "nam = 1").unwrap();
    let run = test.run(&["plugins", "list"]);
    assert!(run.code == 1 && run.err.contains("plugin.toml:1:1: unknown key \"nam\""), "{}", run.err);
    let run = test.run(&["check", "s.rhai"]);
    assert!(
        run.code == 1 && run.err.contains("no plugin: ") && run.err.contains("unknown key \"nam\""),
        "{}",
        run.err
    );
    test.run_successfully(&["plugins", "remove", "prints"]);
}

#[test]
fn a_package_that_hides_a_built_in_effect_is_noted() {
    let test = PackageTest::new();
    test.write("source/swap.wgsl", &EFFECT.replace("effect: swap", "effect: fog"));
    let run = test.run(&["plugins", "install", "source"]);
    let note = "swap.wgsl: the effect fog replaces another one of this name";
    assert!(run.code == 0 && run.err.contains(note), "{}", run.err);
    assert!(test.run(&["plugins", "list"]).code == 0);
    assert!(test.run(&["check", "s.rhai"]).err.contains(note));
}

#[test]
fn plugins_test_runs_the_samples_and_tests_of_a_package() {
    let test = PackageTest::new();
    let out = test.run_successfully(&["plugins", "test", "source"]);
    assert!(out.contains("importer dots: source/a.dots: meshes 1, vertices 3, joints 1"), "{out}");
    assert!(out.contains("exporter cast: 10 bytes of a small scene, 0 files beside"), "{out}");
    assert!(out.contains("1 passed, 0 failed"), "{out}");
    let fails = |text: &str| {
        let run = test.run(&["plugins", "test", "source"]);
        assert!(run.code == 1, "{text}: {}", run.out);
        assert!(format!("{}{}", run.out, run.err).contains(text), "{text}: {}{}", run.out, run.err);
    };
    test.write("source/tests/dots.rhai", &TEST.replace("near([0,", "near([1,"));
    fails("dots stand where the file says");
    fails("choreo test source/tests/dots.rhai --plugins source --search source --filter");
    test.write("source/tests/dots.rhai", &TEST.replace("effect(\"swap\")", "effect(\"fog\")"));
    fails("source: no test uses the effect swap; write effect(\"swap\") in one");
    test.write(
        "source/tests/dots.rhai",
        &TEST.replace("expect(", "expect_image(\"it\", #{ at: 0.0, size: [32, 32] }); expect("),
    );
    fails("accept: choreo test source/tests/dots.rhai --plugins source --search source --accept=it");
    let words = ["source/tests/dots.rhai", "--plugins", "source", "--search", "source", "--accept=it"];
    test.run_successfully(&[&["test"][..], &words].concat());
    test.run_successfully(&["plugins", "test", "source"]);
    std::fs::remove_file(test.path().join("source/tests/dots.rhai")).unwrap();
    fails("the effect swap has no test; write tests/swap.rhai");
    test.write("source/tests/dots.rhai", TEST);
    std::fs::rename(test.path().join("source/a.dots"), test.path().join("source/a.txt")).unwrap();
    test.write("source/a.txt", "nothing");
    fails("the importer dots has no sample; put a small file there, as sample.dots");
    test.write("source/a.dots", "DOTS zero");
    fails("a.dots: ");
    test.write("source/a.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
    test.write("source/cast.exporter.rhai", &EXPORTER.replace("actor.name", "actor.nme"));
    fails("the exporter cast: ");
}
