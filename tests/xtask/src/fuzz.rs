//! `cargo xtask fuzz TARGET [--seconds N]`: runs libFuzzer on one of the targets in tests/fuzz, with the project's own scripts, shaders and
//! models as seeds. Needs the nightly toolchain and cargo-fuzz, which are not installed automatically.

use crate::setup::works;
use crate::{assets, root, run};
use std::path::{Path, PathBuf};
use std::process::Command;

struct Target {
    name: &'static str,
    /// Folders with seeds, relative to the root, and the extensions of seeds, there and among the sample assets.
    places: &'static [&'static str],
    endings: &'static [&'static str],
    /// Whether sample assets are seeds too.
    assets: bool,
}

const fn target(
    name: &'static str,
    places: &'static [&'static str],
    endings: &'static [&'static str],
) -> Target {
    Target { name, places, endings, assets: false }
}

const fn importer(
    name: &'static str,
    places: &'static [&'static str],
    endings: &'static [&'static str],
) -> Target {
    Target { name, places, endings, assets: true }
}

const TARGETS: &[Target] = &[
    target("script", &["scripts", "tests/hostile", "tests/suite"], &["rhai"]),
    importer("import_gltf", &["plugins/import-gltf/tests/samples"], &["glb", "gltf"]),
    importer("import_vrm", &[], &["vrm", "vrma"]),
    importer("import_fbx", &["plugins/import-fbx/tests/data"], &["fbx"]),
    importer("import_obj", &["plugins/import-obj/tests/data"], &["obj", "mtl"]),
    importer("import_stl", &["plugins/import-stl/tests/data"], &["stl"]),
    importer("import_bvh", &["plugins/import-bvh/tests/data"], &["bvh"]),
    importer("import_collada", &["plugins/import-collada/tests/data"], &["dae"]),
    target("dropin", &["scripts/08_plugins/plugins", "core/command_line/src/commands/new"], &["rhai"]),
    target("outputs", &["tests/suite", "tests/pictures"], &["png"]),
    target("resume", &[], &[]),
    target("motion", &[], &[]),
    target("effect", &["shaders", "plugins"], &["wgsl"]),
    target("timeline", &[], &[]),
];

/// Largest seed in bytes: larger seeds slow the search down more than they help.
const LARGEST_SEED: u64 = 64 << 10;

pub(crate) fn fuzz(args: &[&str]) -> Result<(), String> {
    let names: Vec<&str> = TARGETS.iter().map(|t| t.name).collect();
    let usage = || format!("usage: cargo xtask fuzz TARGET [--seconds N]; targets: {}", names.join(", "));
    let (name, seconds) = match args {
        [name] => (*name, 60),
        [name, "--seconds", n] => (*name, n.parse::<u32>().map_err(|_| usage())?),
        _ => return Err(usage()),
    };
    let target = TARGETS.iter().find(|t| t.name == name).ok_or_else(usage)?;
    let folder = root().join("tests/fuzz");
    let corpus = folder.join("corpus").join(name);
    std::fs::create_dir_all(&corpus).map_err(|e| format!("{}: {e}", corpus.display()))?;
    let mut seeds = 0;
    for place in target.places.iter().map(|p| root().join(p)) {
        seeds += copy_seeds(&place, target.endings, &corpus)?;
    }
    if let (true, Some(assets)) = (target.assets, assets()) {
        seeds += copy_seeds(&assets, target.endings, &corpus)?;
    }
    if name == "outputs" {
        seeds += write_video_seeds(&corpus)?;
    }
    if target.endings.is_empty() || name == "dropin" {
        seeds += write_number_seeds(&corpus)?;
    }
    println!("{name}: {seeds} seeds, {seconds} s");
    let mut command = Command::new("cargo");
    command.current_dir(root()).args([
        "+nightly",
        "fuzz",
        "run",
        "--fuzz-dir",
        "tests/fuzz",
        "-s",
        "none",
        name,
        "--",
    ]);
    if works("clang", &["--version"]) {
        // The C code of ufbx is instrumented too.
        command.env("CC", "clang").env("CFLAGS", "-fsanitize=fuzzer-no-link");
    }
    command.arg(format!("-max_total_time={seconds}"));
    // Exceeding a limit of time or memory is a finding too.
    command.args(["-timeout=20", "-rss_limit_mb=3000", "-print_final_stats=1"]);
    run(command, "cargo fuzz (cargo install cargo-fuzz --locked; rustup toolchain install nightly)")
}

/// Seeds for targets that read fields from bytes. They have no format, so any bytes will do; each seed begins with a different byte.
fn write_number_seeds(corpus: &Path) -> Result<usize, String> {
    const LENGTH: usize = 512;
    for first in 0..16u8 {
        let seed = u32::from(first) << 16;
        let mut bytes: Vec<u8> =
            (seed..).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).take(LENGTH).collect();
        bytes[0] = first;
        let path = corpus.join(format!("numbers_{first}"));
        std::fs::write(&path, bytes).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(16)
}

/// Short videos of the first lesson in every format, rendered by choreo itself.
fn write_video_seeds(corpus: &Path) -> Result<usize, String> {
    let formats = ["gif", "mp4", "y4m"];
    for format in formats {
        let place = corpus.join(format!("lesson.{format}"));
        let mut command = Command::new("cargo");
        command.current_dir(root()).args([
            "run",
            "--quiet",
            "--",
            "render",
            "scripts/01_first_dance.rhai",
            "-o",
        ]);
        command.arg(&place).args([
            "--frames",
            "0..2",
            "--size",
            "16x10",
            "--samples",
            "1",
            "--device",
            "cpu",
        ]);
        run(command, "choreo render")?;
    }
    Ok(formats.len())
}

/// Copies files with these extensions, also from folders below; their new names are derived from their paths.
fn copy_seeds(place: &Path, endings: &[&str], corpus: &Path) -> Result<usize, String> {
    let mut count = 0;
    let mut open: Vec<PathBuf> = vec![place.to_path_buf()];
    while let Some(folder) = open.pop() {
        let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        for path in entries.flatten().map(|e| e.path()) {
            let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
            let small = std::fs::metadata(&path).is_ok_and(|m| m.len() <= LARGEST_SEED);
            if path.is_dir() {
                open.push(path);
            } else if endings.contains(&ending) && small {
                let below =
                    path.strip_prefix(place).unwrap_or(&path).to_string_lossy().replace(['/', '\\'], "_");
                std::fs::copy(&path, corpus.join(below)).map_err(|e| format!("{}: {e}", path.display()))?;
                count += 1;
            }
        }
    }
    Ok(count)
}
