//! Import times of the sample files, beside assimp's own figure for the same files where its command line is installed:
//! `cargo bench -p import-fbx`. Medians of runs in turns; textures are left out, as assimp does not decode them.

use choreo_import_testing::{Companions, assets, options, source};
use choreo_plugin::{Importer, Needs, OptionValue};
use import_fbx::FbxImporter;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

const RUNS: usize = 15;

/// Milliseconds, as `assimp info` says: reading the file and nothing done to it after.
fn assimp(path: &Path) -> Option<f64> {
    let output = Command::new("assimp").arg("info").arg(path).arg("--raw").output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let after = text.split("import took approx.").nth(1)?;
    Some(after.split_whitespace().next()?.parse::<f64>().ok()? * 1e3)
}

fn ours(path: &Path, rate: f64) -> f64 {
    let needs = Needs { textures: false, ..Needs::ALL };
    let start = Instant::now();
    let source = source("a.fbx", std::fs::read(path).unwrap());
    let asset = FbxImporter
        .import(
            &source,
            &Companions::none(),
            needs,
            &options(&FbxImporter, &[("rate", OptionValue::Number(rate))]),
        )
        .unwrap();
    let elapsed = start.elapsed().as_secs_f64() * 1e3;
    std::hint::black_box(asset);
    elapsed
}

fn median(mut list: Vec<f64>) -> f64 {
    list.sort_by(f64::total_cmp);
    list[list.len() / 2]
}

fn files(folder: PathBuf) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut folders = vec![folder];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false if path.extension().is_some_and(|e| e == "fbx") => out.push(path),
                false => {}
            }
        }
    }
    out.sort();
    out
}

fn main() {
    let Some(folder) = assets(1) else { return };
    println!("| file | KB | choreo | rate 30 | assimp | |\n|---|---|---|---|---|---|");
    let (mut all, mut plain_all, mut theirs_all) = (0.0, 0.0, 0.0);
    for path in files(folder) {
        let (mut a, mut plain, mut b) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..RUNS {
            a.push(ours(&path, 0.0));
            plain.push(ours(&path, 30.0));
            b.extend(assimp(&path));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let kb = std::fs::metadata(&path).map_or(0, |m| m.len()) / 1000;
        let (ours, plain) = (median(a), median(plain));
        if b.is_empty() {
            println!("| {name} | {kb} | {ours:.2} ms | {plain:.2} ms | SKIP 1: no assimp | |");
            continue;
        }
        let theirs = median(b);
        all += ours;
        plain_all += plain;
        theirs_all += theirs;
        println!(
            "| {name} | {kb} | {ours:.2} ms | {plain:.2} ms | {theirs:.2} ms | {:.1}×, {:.1}× |",
            theirs / ours,
            theirs / plain
        );
    }
    println!(
        "| all | | {all:.1} ms | {plain_all:.1} ms | {theirs_all:.1} ms | {:.1}×, {:.1}× |",
        theirs_all / all,
        theirs_all / plain_all
    );
}
