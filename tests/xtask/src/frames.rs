//! `cargo xtask frames [--quick] [FILTER]`: frames a second of scenes as users have them, and what each effect costs, as Markdown
//! tables.
//!
//! A frame's cost is the difference of two runs of the release binary, one of few and one of more frames, divided by how many
//! more: without start, loading and first frame. Pictures are written as y4m: their conversion is included, no video codec is,
//! and one row says what a codec adds. Medians of rounds in which all rows take turns, so that other work on the machine falls on all.

use crate::bench::{Bench, Run, median};
use crate::{assets, release_binary, root};

/// Name, script, what is set, samples, frames of the longer run, output, frames a second that the project asks of itself.
struct Job {
    name: String,
    script: &'static str,
    set: Vec<String>,
    samples: u32,
    frames: usize,
    out: &'static str,
    asked: Option<f64>,
}

/// Frames of the shorter run: the first ones make pipelines and textures.
const FEW: usize = 4;

/// Effects over the picture, on surfaces and in the scene, with what they are by default.
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
    };
    let mut all = vec![knight("none", Vec::new())];
    all.extend(LOOKS.iter().map(|look| knight(look, vec![format!("look={look}")])));
    all
}

/// Seconds a frame.
#[derive(Clone, Copy)]
struct Cost {
    wall: f64,
    cpu: f64,
}

impl Job {
    fn run(&self, bench: &Bench, search: &str, frames: usize) -> Result<Run, String> {
        let (samples, frames) = (self.samples.to_string(), format!("0..{frames}"));
        let mut more = vec!["--search", search, "--samples", &samples, "--frames", &frames];
        more.extend(self.set.iter().flat_map(|set| ["--set", set]));
        bench.once(&root().join("tests/bench").join(self.script), self.out, &more)
    }

    fn round(&self, bench: &Bench, search: &str) -> Result<Cost, String> {
        let few = self.run(bench, search, FEW)?;
        let many = self.run(bench, search, self.frames)?;
        let frames = (self.frames - FEW) as f64;
        Ok(Cost {
            wall: (many.wall_secs - few.wall_secs) / frames,
            cpu: (many.cpu_secs - few.cpu_secs) / frames,
        })
    }
}

/// Medians of each job, in rounds of all.
fn measure(jobs: &[Job], bench: &Bench, search: &str, rounds: usize) -> Result<Vec<Cost>, String> {
    let mut all: Vec<Vec<Cost>> = jobs.iter().map(|_| Vec::new()).collect();
    for round in 0..rounds {
        for (job, costs) in jobs.iter().zip(&mut all) {
            eprintln!("round {} of {rounds}: {}", round + 1, job.name);
            costs.push(job.round(bench, search)?);
        }
    }
    let of = |costs: &Vec<Cost>, what: fn(&Cost) -> f64| median(costs.iter().map(what).collect());
    Ok(all.iter().map(|costs| Cost { wall: of(costs, |c| c.wall), cpu: of(costs, |c| c.cpu) }).collect())
}

pub fn frames(args: &[&str]) -> Result<(), String> {
    let rounds = if args.contains(&"--quick") { 1 } else { 5 };
    let filter = args.iter().find(|a| !a.starts_with("--")).copied().unwrap_or_default();
    let assets =
        assets().ok_or("Knight.glb is needed; CHOREO_ASSETS names the folder of the shared assets")?;
    let search = assets.join("gltf").display().to_string();
    let bench = Bench::new(release_binary()?, "frames", rounds)?;
    let wanted = |job: &Job| job.name.contains(filter);
    let jobs: Vec<Job> = jobs().into_iter().filter(wanted).collect();
    if !jobs.is_empty() {
        let costs = measure(&jobs, &bench, &search, rounds)?;
        println!("| scene | frames/s | ms a frame | CPU-ms a frame | asked for |");
        println!("|---|---|---|---|---|");
        for (job, cost) in jobs.iter().zip(costs) {
            let asked = job.asked.map_or(String::new(), |rate| format!("≥ {rate} frames/s"));
            let (wall, cpu) = (cost.wall * 1e3, cost.cpu * 1e3);
            println!("| {} | {:.1} | {wall:.1} | {cpu:.1} | {asked} |", job.name, 1.0 / cost.wall.max(1e-9));
        }
        println!();
    }
    // Beside what they are added to.
    let looks: Vec<Job> = looks().into_iter().filter(|job| job.name == "none" || wanted(job)).collect();
    if looks.len() > 1 {
        let costs = measure(&looks, &bench, &search, rounds)?;
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
            "First frame of the richest sample (glass, 4 samples), warm cache, whole process: {:.2} s, {:.2} CPU-s; asked for ≤ 2 s.",
            first.wall_secs, first.cpu_secs
        );
    }
    bench.clean()
}
