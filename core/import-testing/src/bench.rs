//! Import times, for the benches of the importers. Where assimp is installed, its whole process (`assimp info`) is timed in
//! turn with ours: it holds the start of a process, which `assimp version` shows.

use crate::{Companions, import, source};
use choreo_plugin::{Importer, Needs};
use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

const RUNS: usize = 21;

/// `files` are relative to the sample folder; file names on the command line come in their place.
pub fn run(importer: &dyn Importer, files: &[&str]) {
    let given: Vec<PathBuf> =
        std::env::args().skip(1).filter(|a| !a.starts_with('-')).map(PathBuf::from).collect();
    let files = match (given.is_empty(), crate::assets(files.len())) {
        (false, _) => given,
        (true, Some(folder)) => files.iter().map(|f| folder.join(f)).collect(),
        (true, None) => return,
    };
    for path in files {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let Ok(bytes) = std::fs::read(&path) else {
            println!("skipped: {} is not there", path.display());
            continue;
        };
        let source = source(&name, bytes);
        let folder = Companions::in_folder(path.parent().map(PathBuf::from).unwrap_or_default());
        let needs =
            [("all", Needs::ALL), ("clips only", Needs { geometry: false, clips: true, textures: false })];
        for (what, needs) in needs {
            let ours =
                median(|| assert!(std::hint::black_box(import(importer, &source, &folder, needs)).is_ok()));
            println!("{name}: {what}: {ours:.2} ms");
        }
        let start = median(|| drop(Command::new("assimp").arg("version").output()));
        let whole = median(|| drop(Command::new("assimp").arg("info").arg(&path).output()));
        println!("{name}: assimp info {whole:.2} ms, of which the process {start:.2} ms");
    }
}

/// Milliseconds.
fn median(mut job: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            job();
            start.elapsed().as_secs_f64() * 1000.0
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2]
}
