//! `cargo xtask fuzz TARGET [--seconds N]`: libFuzzer on one of the targets in tests/fuzz, which begin from the project's
//! own scripts, shaders and models. Needs the nightly toolchain and cargo-fuzz, which are not installed for you.

use crate::{assets, root, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Targets, and where their seeds lie: folders or files below the root, with the endings that count.
const TARGETS: &[(&str, &[&str], &[&str])] = &[
    ("script", &["scripts", "tests/hostile", "tests/suite"], &["rhai"]),
    ("import_gltf", &[], &["glb", "gltf"]),
    ("motion", &[], &[]),
    ("effect", &["shaders", "plugins"], &["wgsl"]),
    ("timeline", &[], &[]),
];

/// Larger seeds slow the search down more than they help it.
const LARGEST_SEED: u64 = 64 << 10;

pub fn fuzz(args: &[&str]) -> Result<(), String> {
    let names: Vec<&str> = TARGETS.iter().map(|t| t.0).collect();
    let usage = || format!("usage: cargo xtask fuzz TARGET [--seconds N]; targets: {}", names.join(", "));
    let (name, seconds) = match args {
        [name] => (*name, 60),
        [name, "--seconds", n] => (*name, n.parse::<u32>().map_err(|_| usage())?),
        _ => return Err(usage()),
    };
    let (_, places, endings) = TARGETS.iter().find(|t| t.0 == name).ok_or_else(usage)?;
    let folder = root().join("tests/fuzz");
    let corpus = folder.join("corpus").join(name);
    std::fs::create_dir_all(&corpus).map_err(|e| format!("{}: {e}", corpus.display()))?;
    let mut seeds = 0;
    for place in places.iter().map(|p| root().join(p)) {
        seeds += plant(&place, endings, &corpus)?;
    }
    if let (true, Some(assets)) = (places.is_empty() && !endings.is_empty(), assets()) {
        seeds += plant(&assets, endings, &corpus)?;
    }
    if places.is_empty() {
        // What the jobs read their fields from: no format, so any bytes will do.
        let bytes: Vec<u8> = (0..2048u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        for (i, part) in bytes.chunks(256).enumerate() {
            std::fs::write(corpus.join(format!("seed_{i}")), part).map_err(|e| e.to_string())?;
        }
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
    command.arg(format!("-max_total_time={seconds}"));
    // A limit that does not hold is a finding too.
    command.args(["-timeout=20", "-rss_limit_mb=3000", "-print_final_stats=1"]);
    run(command, "cargo fuzz (cargo install cargo-fuzz --locked; rustup toolchain install nightly)")
}

/// Copies files of these endings, folders below included, under names made of their paths.
fn plant(place: &Path, endings: &[&str], corpus: &Path) -> Result<usize, String> {
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
