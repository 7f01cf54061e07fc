//! Import times and peak memory of the sample files, compared with assimp: `cargo bench -p importers [-- FILTER]`.
//! `-- --tolerance` measures the cost of the option `tolerance` of import-fbx, and `-- --again PATH` that of a new process.
//!
//! Every run is a new process, alternately of both programs, so that both have equally cold memory and an equally busy machine.
//! Time is the CPU time of all threads without process start: for assimp the whole process less that of `assimp version`; for
//! choreo reading the file and importing all but images, which assimp does not decode.
//!
//! assimp runs twice, both times as `assimp extract` of a texture that no file has, so that it reads, postprocesses and ends:
//! "raw" without postprocessing, "the same" with the steps that choreo always does ([`STEPS`]).
//! Memory is the peak resident memory of the whole process.

use choreo_plugin::{ImportScope, OptionValue};
use importers::{SAMPLES, import_with, samples};
use rustix::time::{ClockId, clock_gettime};
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};

const RUNS: usize = 11;

/// Triangles; vertices shared by faces; normals where there are none; triangles, lines and points apart; no more weights a
/// vertex than can be drawn.
const STEPS: [&str; 5] = [
    "--triangulate",
    "--join-identical-vertices",
    "--gen-smooth-normals",
    "--sort-by-ptype",
    "--limit-bone-weights",
];
/// A number that no file's textures reach: nothing is written. assimp then ends with this code.
const NO_TEXTURE: &str = "--texture=100000";
const ENDED: i32 = 10;

/// Milliseconds of computing; MiB at most.
#[derive(Clone, Copy)]
struct Run {
    ms: f64,
    mib: f64,
}

/// Milliseconds that a process has computed which has ended and is not yet waited for: the scheduler's own count.
fn computed(folder: &str) -> Option<f64> {
    let text = std::fs::read_to_string(format!("{folder}/schedstat")).ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-6)
}

/// Milliseconds that this thread has computed.
fn thread_ms() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

fn status(field: &str) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|l| l.starts_with(field))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// This process, started for one file: `ms MiB`.
fn import_once(path: &Path, tolerance: Option<f64>) {
    let given: Vec<_> = tolerance.map(|t| ("tolerance", OptionValue::Number(t))).into_iter().collect();
    let before = thread_ms();
    let asset = import_with(path, ImportScope { textures: false, ..ImportScope::ALL }, &given);
    let after = thread_ms();
    assert!(std::hint::black_box(asset).is_ok(), "{}", path.display());
    println!("{} {}", after - before, status("VmHWM:").unwrap_or(f64::NAN) / 1024.0);
}

/// Times of this process: milliseconds of the first import, and of the fastest of a hundred more, which find code and memory warm.
fn import_repeatedly(path: &Path) {
    let run = || {
        let before = thread_ms();
        let asset = import_with(path, ImportScope { textures: false, ..ImportScope::ALL }, &[]);
        assert!(std::hint::black_box(asset).is_ok(), "{}", path.display());
        thread_ms() - before
    };
    let first = run();
    let warm = (0..100).map(|_| run()).fold(f64::INFINITY, f64::min);
    println!("{first:.2} ms, warm {warm:.2} ms");
}

fn measure_choreo(path: &Path, tolerance: Option<f64>) -> Option<Run> {
    let me = std::env::current_exe().ok()?;
    let tolerance = tolerance.map(|t| t.to_string());
    let output = Command::new(me).arg("--once").arg(path).args(tolerance).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut numbers = text.split_whitespace().filter_map(|w| w.parse().ok());
    Some(Run { ms: numbers.next()?, mib: numbers.next()? })
}

/// Time and memory of the whole assimp process; GNU time measures the memory in a separate run.
fn assimp(args: &[&str]) -> Option<Run> {
    let mut child =
        Command::new("assimp").args(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
    let mut text = String::new();
    child.stdout.take()?.read_to_string(&mut text).ok()?;
    let folder = format!("/proc/{}", child.id());
    // It has closed its output; until it has ended it may still compute.
    let ended = || {
        let stat = std::fs::read_to_string(format!("{folder}/stat")).unwrap_or_default();
        stat.rsplit(')').next().is_none_or(|rest| rest.trim_start().starts_with('Z'))
    };
    while !ended() {
        std::thread::sleep(std::time::Duration::from_micros(200));
    }
    let ms = computed(&folder)?;
    if !matches!(child.wait().ok()?.code(), Some(0 | ENDED)) {
        return None;
    }
    let output = Command::new("/usr/bin/time").args(["-f", "%M", "assimp"]).args(args).output().ok();
    let kib =
        output.and_then(|o| String::from_utf8_lossy(&o.stderr).lines().last()?.trim().parse::<f64>().ok());
    Some(Run { ms, mib: kib.map_or(f64::NAN, |k| k / 1024.0) })
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn medians(runs: &[Run]) -> Run {
    Run { ms: median(runs.iter().map(|r| r.ms)), mib: median(runs.iter().map(|r| r.mib)) }
}

/// Times by the tolerance of import-fbx, for files whose clips depend on it.
fn tolerances(folder: &Path) {
    const DEGREES: [f64; 3] = [0.5, 0.05, 0.005];
    println!("| file | ms at tolerance 0.5 | 0.05 | 0.005 |\n|---|---|---|---|");
    let files = [
        "fbx/huesitos.fbx",
        "fbx/pab/walk.fbx",
        "fbx/pab/locomotions.fbx",
        "fbx/ufbx/maya_game_sausage_7500_binary_combined.fbx",
    ];
    for name in files {
        let mut runs: [Vec<Run>; 3] = Default::default();
        for _ in 0..RUNS {
            for (runs, degrees) in runs.iter_mut().zip(DEGREES) {
                runs.extend(measure_choreo(&folder.join(name), Some(degrees)));
            }
        }
        let [a, b, c] = runs.map(|runs| medians(&runs).ms);
        println!("| {name} | {a:.2} | {b:.2} | {c:.2} |");
    }
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let [flag, path, tolerance @ ..] = args.as_slice()
        && flag == "--once"
    {
        return import_once(Path::new(path), tolerance.first().and_then(|t| t.parse().ok()));
    }
    if let [flag, path] = args.as_slice()
        && flag == "--again"
    {
        return import_repeatedly(Path::new(path));
    }
    let filter = args.iter().find(|a| !a.starts_with('-')).cloned().unwrap_or_default();
    let Some(folder) = choreo_importer_kit_testing::assets(SAMPLES) else { return };
    if args.iter().any(|a| a == "--tolerance") {
        return tolerances(&folder);
    }
    println!(
        "| file | KB | ours, ms | assimp, the same, ms | | assimp raw, ms | | ours, MiB | assimp, the same, MiB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut all = [0.0; 3];
    let mut least = [f64::INFINITY; 2];
    let mut most_memory: f64 = 0.0;
    for name in samples(&folder).iter().filter(|n| n.to_string_lossy().contains(&filter)) {
        let path = folder.join(name);
        let shown = path.display().to_string();
        let (mut a, mut start, mut raw, mut full) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for _ in 0..RUNS {
            a.extend(measure_choreo(&path, None));
            start.extend(assimp(&["version"]));
            let extract = ["extract", &shown, "/dev/null", NO_TEXTURE];
            raw.extend(assimp(&extract));
            full.extend(assimp(&[&extract[..], &STEPS].concat()));
        }
        let kb = std::fs::metadata(&path).map_or(0, |m| m.len()) as f64 / 1000.0;
        let a = medians(&a);
        if raw.is_empty() {
            println!(
                "| {} | {kb:.0} | {:.2} | refused | | refused | | {:.1} | |",
                name.display(),
                a.ms,
                a.mib
            );
            continue;
        }
        let (start, mib) = (medians(&start).ms, medians(&full).mib);
        let theirs = [medians(&full).ms - start, medians(&raw).ms - start];
        most_memory = most_memory.max(a.mib / mib);
        all = [all[0] + a.ms, all[1] + theirs[0], all[2] + theirs[1]];
        least = std::array::from_fn(|i| least[i].min(theirs[i] / a.ms));
        println!(
            "| {} | {kb:.0} | {:.2} | {:.2} | {:.1}× | {:.2} | {:.1}× | {:.1} | {mib:.1} |",
            name.display(),
            a.ms,
            theirs[0],
            theirs[0] / a.ms,
            theirs[1],
            theirs[1] / a.ms,
            a.mib,
        );
    }
    let [ours, full, raw] = all;
    println!("| all | | {ours:.1} | {full:.1} | {:.1}× | {raw:.1} | {:.1}× | | |", full / ours, raw / ours);
    println!("least: {:.1}×, {:.1}× raw; memory at most {most_memory:.2} of assimp's", least[0], least[1]);
}
