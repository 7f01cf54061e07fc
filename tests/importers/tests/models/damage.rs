//! Every sample file cut off and with single bits turned over: no panic, an error with a place or a sound asset, bounded
//! memory and time. The everyday test takes a seeded slice, small files first; all of it, some minutes in release:
//! `cargo test --release -p importers --test models damage -- --ignored --nocapture`.

use choreo_importer_kit_testing::{Companions, assets, damage, own_process};
use importers::{GLTF_SAMPLES, SAMPLES, USD, as_usd, gltf_samples, import_whole, importer, samples};
use std::path::{Path, PathBuf};
use std::sync::Arc;

type Samples = (usize, fn(&Path) -> Vec<PathBuf>);
const FIVE_FORMATS: Samples = (SAMPLES, samples);
const GLTF: Samples = (GLTF_SAMPLES, gltf_samples);

/// Cuts and flips of each file.
fn run((count, samples): Samples, cuts: usize, flips: usize, budget_bytes: usize) {
    if own_process::ran_in_own_process() {
        return;
    }
    let Some(folder) = assets(count) else { return };
    let mut files: Vec<(usize, PathBuf)> = samples(&folder)
        .into_iter()
        .map(|name| (std::fs::metadata(folder.join(&name)).map_or(0, |m| m.len() as usize), name))
        .collect();
    files.sort();
    let (mut total, mut slowest) = (damage::Outcome::default(), (0.0, String::new()));
    for (size, name) in &files {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        let importer = importer(name).unwrap();
        // Large files get their share of the slice.
        let share = (budget_bytes / (size + 1)).max(1);
        let outcome = damage::run_slice(
            importer,
            &name.display().to_string(),
            &bytes,
            &Companions::in_folder(folder.join(name).parent().unwrap_or(&folder)),
            cuts.min(share),
            flips.min(share),
        );
        total.read += outcome.read;
        total.refused += outcome.refused;
        if outcome.slowest_secs > slowest.0 {
            slowest = (outcome.slowest_secs, name.display().to_string());
        }
    }
    println!(
        "{} files, {} damaged copies refused, {} read; the slowest import {:.3} s ({})",
        files.len(),
        total.refused,
        total.read,
        slowest.0,
        slowest.1
    );
    assert!(total.refused > files.len() && total.read > 0);
}

/// Models as USD, cut off and with bits turned over.
fn run_usd(cuts: usize, flips: usize) {
    if own_process::ran_in_own_process() {
        return;
    }
    let Some(folder) = assets(1) else { return };
    let (mut total, mut slowest) = (damage::Outcome::default(), 0.0f64);
    for name in ["same-model-3-formats/chest_gold.glb", "gltf/SimpleSkin.gltf"] {
        let asset = Arc::new(import_whole(&folder.join(name)));
        for extension in USD {
            let (bytes, beside) = as_usd(&asset, extension);
            let beside = Companions::of(beside);
            let file = format!("out.{extension}");
            let outcome =
                damage::run_slice(importer(Path::new(&file)).unwrap(), &file, &bytes, &beside, cuts, flips);
            total.read += outcome.read;
            total.refused += outcome.refused;
            slowest = slowest.max(outcome.slowest_secs);
        }
    }
    println!(
        "USD: {} damaged copies refused, {} read; the slowest import {slowest:.3} s",
        total.refused, total.read
    );
    assert!(total.refused > 12 && total.read > 0);
}

#[test]
fn a_slice_of_usd() {
    run_usd(8, 24);
}

#[test]
#[ignore = "50 cuts and 1,000 flips of six files: minutes, in release"]
fn all_of_usd() {
    run_usd(50, 1000);
}

#[test]
fn a_slice() {
    run(FIVE_FORMATS, 6, 12, 1 << 20);
}

#[test]
fn a_slice_of_gltf() {
    run(GLTF, 2, 4, 1 << 16);
}

#[test]
#[ignore = "50 cuts and 1,000 flips of every sample: minutes, in release"]
fn all() {
    run(FIVE_FORMATS, 50, 1000, usize::MAX);
}

#[test]
#[ignore = "as all, with images to decode: most of an hour, in release"]
fn all_of_gltf() {
    run(GLTF, 50, 1000, usize::MAX);
}
