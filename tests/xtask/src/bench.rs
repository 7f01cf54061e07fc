//! `cargo xtask bench`: measures complete runs of the program — CPU seconds, peak memory, first image — as a Markdown table.
//!
//! Every row runs the release binary several times; the figures are medians. CPU seconds are user and system time of the whole process, as
//! the operating system counts them.

use crate::{assets, release_binary, root};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Measurements of one run of a program.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    pub cpu_secs: f64,
    pub wall_secs: f64,
    peak_mb: f64,
    /// Time of all frames together by the device's clock; `None` without `--timings` or without such a clock.
    pub device_secs: Option<f64>,
}

/// `xtask measured PROGRAM ARGS…`: runs a program and prints its resource usage. A separate process is needed, because the system reports
/// peak memory only for the largest child.
pub(crate) fn measured(args: &[&str]) -> Result<(), String> {
    let (program, rest) = args.split_first().ok_or("usage: xtask measured PROGRAM [ARG…]")?;
    let start = Instant::now();
    let run = Command::new(program)
        .args(rest)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| format!("{program}: {e}"))?;
    let wall = start.elapsed().as_secs_f64();
    if !run.status.success() {
        return Err(format!("{program} {}: {}", rest.join(" "), run.status));
    }
    let device = json_field(&String::from_utf8_lossy(&run.stdout), "device_seconds").unwrap_or_default();
    let (cpu, peak_mb) = usage_of_children()?;
    println!("{cpu} {wall} {peak_mb} {device}");
    Ok(())
}

/// CPU seconds of the child processes that have ended, and the peak memory of the largest one in MB.
#[cfg(unix)]
fn usage_of_children() -> Result<(f64, f64), String> {
    use nix::sys::resource::{UsageWho, getrusage};
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN).map_err(|e| format!("getrusage: {e}"))?;
    let secs = |t: nix::sys::time::TimeVal| t.tv_sec() as f64 + t.tv_usec() as f64 * 1e-6;
    Ok((secs(usage.user_time()) + secs(usage.system_time()), usage.max_rss() as f64 / 1024.0))
}

#[cfg(not(unix))]
fn usage_of_children() -> Result<(f64, f64), String> {
    Err("measurements need a system with getrusage".into())
}

/// Value of a top-level field of a summary in JSON, without quotes.
pub(crate) fn json_field(text: &str, name: &str) -> Option<String> {
    let (_, rest) = text.split_once(&format!("\"{name}\""))?;
    let value = rest.trim_start().strip_prefix(':')?.trim_start();
    match value.strip_prefix('"') {
        Some(quoted) => Some(quoted.split('"').next()?.to_string()),
        None => Some(value.split([',', '}', '\n']).next()?.trim().to_string()),
    }
}

fn measure(program: &Path, args: &[String], env: &[(&str, &Path)]) -> Result<Run, String> {
    let me = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut command = Command::new(me);
    command.arg("measured").arg(program).args(args).current_dir(root()).stderr(Stdio::inherit());
    for (name, value) in env {
        command.env(name, value);
    }
    let output = command.output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(format!("choreo {} failed", args.join(" ")));
    }
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    match numbers.as_slice() {
        [cpu_secs, wall_secs, peak_mb, device @ ..] => Ok(Run {
            cpu_secs: *cpu_secs,
            wall_secs: *wall_secs,
            peak_mb: *peak_mb,
            device_secs: device.first().copied(),
        }),
        _ => Err(format!("unexpected output of the measured run: {text}")),
    }
}

pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn medians(runs: &[Run]) -> Run {
    Run {
        cpu_secs: median(runs.iter().map(|r| r.cpu_secs).collect()),
        wall_secs: median(runs.iter().map(|r| r.wall_secs).collect()),
        peak_mb: median(runs.iter().map(|r| r.peak_mb).collect()),
        device_secs: None,
    }
}

pub(crate) struct Bench {
    choreo: PathBuf,
    work: PathBuf,
    repeats: usize,
}

impl Bench {
    /// Creates a bench with a folder for its files.
    pub(crate) fn new(choreo: PathBuf, name: &str, repeats: usize) -> Result<Bench, String> {
        let work = std::env::temp_dir().join(format!("choreo-{name}-{}", std::process::id()));
        std::fs::create_dir_all(work.join("frames")).map_err(|e| e.to_string())?;
        Ok(Bench { choreo, work, repeats })
    }

    pub(crate) fn clean(&self) -> Result<(), String> {
        std::fs::remove_dir_all(&self.work).map_err(|e| e.to_string())
    }

    /// One run of `choreo render SCRIPT -o OUT ARGS…`.
    pub(crate) fn run_once(&self, script: &Path, out: &str, more: &[&str]) -> Result<Run, String> {
        let mut args = vec!["render".to_string(), script.display().to_string()];
        args.extend(["-o".to_string(), self.work.join(out).display().to_string(), "--quiet".to_string()]);
        args.extend(more.iter().map(|s| s.to_string()));
        measure(&self.choreo, &args, &[])
    }

    /// Name of the device that draws the frames.
    pub(crate) fn device(&self, script: &Path, search: &str, gpu: Option<&str>) -> Result<String, String> {
        let mut command = Command::new(&self.choreo);
        command.arg("render").arg(script).arg("-o").arg(self.work.join("device.png"));
        command.args(["--search", search, "--at", "0", "--json"]).current_dir(root());
        command.args(gpu.map_or(["--device", "vulkan"], |name| ["--gpu", name]));
        let output = command.stderr(Stdio::inherit()).output().map_err(|e| e.to_string())?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        json_field(&text, "device").filter(|_| output.status.success()).ok_or(text)
    }

    /// Medians of several runs with warm caches.
    pub(crate) fn render(&self, script: &Path, out: &str, more: &[&str]) -> Result<Run, String> {
        self.run_once(script, out, more)?;
        let runs =
            (0..self.repeats).map(|_| self.run_once(script, out, more)).collect::<Result<Vec<_>, _>>()?;
        Ok(medians(&runs))
    }

    /// Time of one image with empty caches: every run gets its own cache folder.
    fn run_with_cold_cache(&self, script: &Path, more: &[&str]) -> Result<Run, String> {
        let mut runs = Vec::new();
        for i in 0..self.repeats {
            let cache = self.work.join(format!("cache{i}"));
            std::fs::create_dir_all(&cache).map_err(|e| e.to_string())?;
            let mut args = vec!["render".to_string(), script.display().to_string()];
            args.extend(["-o".into(), self.work.join("cold.png").display().to_string(), "--quiet".into()]);
            args.extend(["--at".into(), "1.0".into()]);
            args.extend(more.iter().map(|s| s.to_string()));
            let env = [("XDG_CACHE_HOME", cache.as_path()), ("MESA_SHADER_CACHE_DIR", cache.as_path())];
            runs.push(measure(&self.choreo, &args, &env)?);
        }
        Ok(medians(&runs))
    }
}

pub(crate) fn bench(args: &[&str]) -> Result<(), String> {
    let repeats = if args.contains(&"--quick") { 1 } else { 5 };
    let Some(assets) = assets() else {
        return Err("Knight.glb is needed: put the shared assets beside the checkout, or name their folder in CHOREO_ASSETS".into());
    };
    let choreo = release_binary()?;
    let bench = Bench::new(choreo, "bench", repeats)?;
    let search = assets.join("gltf").display().to_string();
    let knight = root().join("tests/bench/knight.rhai");
    let crowd = root().join("tests/bench/knights_25.rhai");
    let at = ["--search", search.as_str(), "--samples", "1"];
    let with =
        |more: &[&'static str]| -> Vec<&str> { at.iter().copied().chain(more.iter().copied()).collect() };

    println!("| job (1280×720, 1 sample) | CPU-s | wall s | peak MB | |");
    println!("|---|---|---|---|---|");
    let row = |name: &str, run: Run, note: String| {
        println!("| {name} | {:.2} | {:.2} | {:.0} | {note} |", run.cpu_secs, run.wall_secs, run.peak_mb);
    };
    let first = bench.render(&knight, "one.png", &with(&["--at", "1.0"]))?;
    row("first image, warm cache", first, String::new());
    row("first image, cold cache", bench.run_with_cold_cache(&knight, &at)?, String::new());
    let png = bench.render(&knight, "frames/%04d.png", &with(&[]))?;
    let beyond = png.cpu_secs - first.cpu_secs;
    row("120 frames of one Knight → PNG", png, format!("{beyond:.2} CPU-s beyond start-up"));
    let mp4 = bench.render(&knight, "out.mp4", &with(&[]))?;
    row("120 frames of one Knight → mp4", mp4, String::new());
    let cpu = bench.render(&knight, "cpu/%04d.png", &with(&["--device", "cpu"]))?;
    row("the same → PNG, CPU renderer", cpu, format!("{:.1} frames/s", 120.0 / cpu.wall_secs));
    let one = bench.render(&crowd, "one.png", &with(&["--at", "1.0"]))?;
    let many = bench.render(&crowd, "out.y4m", &with(&[]))?;
    let rate = 119.0 / (many.wall_secs - one.wall_secs).max(1e-3);
    row("120 frames of 25 Knights → y4m", many, format!("{rate:.1} frames/s beyond start-up"));
    bench.clean()
}

#[cfg(test)]
mod tests {
    use super::json_field;

    #[test]
    fn fields_of_a_summary() {
        let text =
            "{\n  \"device\": \"llvmpipe (LLVM, 256 bits)\",\n  \"device_seconds\": 0.25,\n  \"ok\":true}";
        assert_eq!(json_field(text, "device").as_deref(), Some("llvmpipe (LLVM, 256 bits)"));
        assert_eq!(json_field(text, "device_seconds").as_deref(), Some("0.25"));
        assert_eq!(json_field(text, "ok").as_deref(), Some("true"));
        assert_eq!(json_field(text, "seconds"), None);
    }
}
