//! `cargo xtask frames [--quick] [--gpu NAME] [FILTER]`: frames per second of typical scenes, and the cost of each effect, as Markdown
//! tables. Measures on the fastest Vulkan device, or on the one named: wall time, CPU time, and device time by the device's timestamps.
//!
//! The cost of a frame is the difference between two runs of the release binary with few and with more frames, divided by the difference in
//! frames, so that start, loading and the first frame do not count. Images are written as y4m: their conversion is included, a video codec
//! is not; one row gives the cost of a codec. Figures are medians of rounds in which all rows take turns, so that other load on the machine
//! affects all of them.

use crate::bench::{Bench, Run, median};
use crate::{assets, release_binary, root};

/// Name, script, parameters, samples, frames of the longer run, output, and the frame rate that the project aims at.
struct Job {
    name: String,
    script: &'static str,
    set: Vec<String>,
    samples: u32,
    frames: usize,
    out: &'static str,
    asked: Option<f64>,
    /// Image size in place of the script's.
    size: Option<&'static str>,
}

/// Number of frames of the shorter run: the first frames create pipelines and textures.
const SHORT_RUN_FRAMES: usize = 4;

/// Effects on the image, on surfaces and in the scene, with their defaults.
const LOOKS: [&str; 12] = [
    "tonemap",
    "vignette",
    "fxaa",
    "bloom",
    "fog",
    "toon",
    "outline",
    "wireframe",
    "xray",
    "skeleton",
    "grid",
    "views",
];

fn jobs() -> Vec<Job> {
    let job = |name: &str, script, set: &[&str], samples, frames, out, asked| Job {
        name: name.into(),
        script,
        set: set.iter().map(|s| s.to_string()).collect(),
        samples,
        frames,
        out,
        asked,
        size: None,
    };
    let knight = "frames_knight.rhai";
    vec![
        job("one Knight with his shadow, 1280×720, 4 samples", knight, &[], 4, 44, "out.y4m", Some(30.0)),
        job("the same → mp4", knight, &[], 4, 44, "out.mp4", None),
        job("the same, without shadow", knight, &["shadow=false"], 4, 44, "out.y4m", None),
        job("the same, on a ground", knight, &["ground=true"], 4, 24, "out.y4m", None),
        job("the same, 1 sample", knight, &[], 1, 64, "out.y4m", None),
        job(
            "25 Knights with shadows, 1280×720, 1 sample",
            "frames_25.rhai",
            &[],
            1,
            16,
            "out.y4m",
            Some(10.0),
        ),
        job("1,000 Knights, 640×360, 1 sample", "frames_1000.rhai", &[], 1, 10, "out.y4m", Some(5.0)),
        Job {
            size: Some("1920x1080"),
            ..job(
                "1,000 Knights with shadows, 1920×1080, 4 samples",
                "frames_1000.rhai",
                &["shadow=true"],
                4,
                10,
                "out.y4m",
                None,
            )
        },
    ]
}

fn looks() -> Vec<Job> {
    let knight = |name: &str, set: Vec<String>| Job {
        name: name.into(),
        script: "frames_knight.rhai",
        set,
        samples: 1,
        frames: 34,
        out: "out.y4m",
        asked: None,
        size: None,
    };
    let mut all = vec![knight("none", Vec::new())];
    all.extend(LOOKS.iter().map(|look| knight(look, vec![format!("look={look}")])));
    all
}

/// Seconds per frame.
#[derive(Clone, Copy)]
struct Cost {
    wall: f64,
    cpu: f64,
    /// Time by the device's clock; NaN if it has none.
    device: f64,
}

/// Program and device of a run.
struct Setting<'a> {
    bench: &'a Bench,
    search: &'a str,
    gpu: Option<&'a str>,
}

impl Job {
    fn run(&self, setting: &Setting, frames: usize) -> Result<Run, String> {
        let (samples, frames) = (self.samples.to_string(), format!("0..{frames}"));
        let mut more = vec!["--search", setting.search, "--samples", &samples, "--frames", &frames];
        more.extend(["--json", "--timings"]);
        more.extend(setting.gpu.map_or(["--device", "vulkan"], |name| ["--gpu", name]));
        more.extend(self.size.iter().flat_map(|size| ["--size", size]));
        more.extend(self.set.iter().flat_map(|set| ["--set", set]));
        setting.bench.run_once(&root().join("tests/bench").join(self.script), self.out, &more)
    }

    fn round(&self, setting: &Setting) -> Result<Cost, String> {
        let few = self.run(setting, SHORT_RUN_FRAMES)?;
        let many = self.run(setting, self.frames)?;
        let frames = (self.frames - SHORT_RUN_FRAMES) as f64;
        Ok(Cost {
            wall: (many.wall_secs - few.wall_secs) / frames,
            cpu: (many.cpu_secs - few.cpu_secs) / frames,
            device: match (few.device_secs, many.device_secs) {
                (Some(few), Some(many)) => (many - few) / frames,
                _ => f64::NAN,
            },
        })
    }
}

/// Medians of each job, measured in rounds over all jobs.
fn measure(jobs: &[Job], setting: &Setting, rounds: usize) -> Result<Vec<Cost>, String> {
    let mut all: Vec<Vec<Cost>> = jobs.iter().map(|_| Vec::new()).collect();
    for round in 0..rounds {
        for (job, costs) in jobs.iter().zip(&mut all) {
            eprintln!("round {} of {rounds}: {}", round + 1, job.name);
            costs.push(job.round(setting)?);
        }
    }
    let of = |costs: &Vec<Cost>, what: fn(&Cost) -> f64| median(costs.iter().map(what).collect());
    let cost = |costs| Cost {
        wall: of(costs, |c| c.wall),
        cpu: of(costs, |c| c.cpu),
        device: of(costs, |c| c.device),
    };
    Ok(all.iter().map(cost).collect())
}

pub(crate) fn frames(args: &[&str]) -> Result<(), String> {
    let rounds = if args.contains(&"--quick") { 1 } else { 5 };
    let gpu = args.iter().position(|a| *a == "--gpu").map(|i| args.get(i + 1).copied());
    if gpu == Some(None) {
        return Err("--gpu: part of a device's name is missing".into());
    }
    let gpu = gpu.flatten();
    let filters = args.iter().enumerate().filter(|(i, _)| *i == 0 || args[i - 1] != "--gpu");
    let filter = filters.map(|(_, a)| *a).find(|a| !a.starts_with("--")).unwrap_or_default();
    let assets =
        assets().ok_or("Knight.glb is needed; CHOREO_ASSETS names the folder of the shared assets")?;
    let search = assets.join("gltf").display().to_string();
    let bench = Bench::new(release_binary()?, "frames", rounds)?;
    let setting = Setting { bench: &bench, search: &search, gpu };
    let device = bench.device(&root().join("tests/bench/frames_knight.rhai"), &search, gpu)?;
    println!("On {device}.\n");
    // A frame takes half a minute if the CPU draws it: measured there only on request.
    let gpu_alone = |job: &Job| job.size.is_some() && filter.is_empty();
    let by_cpu = device.contains("llvmpipe") || device.contains("choreo CPU renderer");
    let wanted = |job: &Job| job.name.contains(filter) && !(by_cpu && gpu_alone(job));
    let jobs: Vec<Job> = jobs().into_iter().filter(wanted).collect();
    if !jobs.is_empty() {
        let costs = measure(&jobs, &setting, rounds)?;
        println!("| scene | frames/s | ms a frame | CPU-ms a frame | device-ms a frame | target |");
        println!("|---|---|---|---|---|---|");
        for (job, cost) in jobs.iter().zip(costs) {
            let asked = job.asked.map_or(String::new(), |rate| format!("≥ {rate} frames/s"));
            let (wall, cpu) = (cost.wall * 1e3, cost.cpu * 1e3);
            let device =
                if cost.device.is_nan() { "–".into() } else { format!("{:.2}", cost.device * 1e3) };
            let rate = 1.0 / cost.wall.max(1e-9);
            println!("| {} | {rate:.1} | {wall:.1} | {cpu:.1} | {device} | {asked} |", job.name);
        }
        println!();
    }
    // The row "none" is always measured, as the baseline for the others.
    let looks: Vec<Job> = looks().into_iter().filter(|job| job.name == "none" || wanted(job)).collect();
    if looks.len() > 1 {
        let costs = measure(&looks, &setting, rounds)?;
        let none = costs[0];
        println!(
            "| effect on one Knight, 1280×720, 1 sample ({:.1} ms without) | ms more | CPU-ms more |",
            none.wall * 1e3
        );
        println!("|---|---|---|");
        for (job, cost) in looks.iter().zip(&costs).skip(1) {
            let (wall, cpu) = ((cost.wall - none.wall) * 1e3, (cost.cpu - none.cpu) * 1e3);
            println!("| {} | {wall:.1} | {cpu:.1} |", job.name);
        }
        println!();
    }
    let richest = root().join("scripts/31_glass.rhai");
    if "first frame".contains(filter) {
        let first = bench.render(&richest, "first.png", &["--at", "1.0"])?;
        println!(
            "First frame of the richest sample (glass, 4 samples), warm cache, whole process: {:.2} s, \
             {:.2} CPU-s; target ≤ 2 s.",
            first.wall_secs, first.cpu_secs
        );
    }
    bench.clean()
}
