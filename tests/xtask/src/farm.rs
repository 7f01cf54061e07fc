//! `cargo xtask farm`: runs a job of `choreo farm` on a Slurm cluster with one controller and three nodes on the loopback interface: once
//! undisturbed, and once with a node that dies and one that is drained. The films must equal the film of one machine byte for byte. Slurm
//! comes from Debian packages, unpacked into a folder of build outputs, and no daemon keeps running. The costs of tasks are measured
//! separately, and the model of the report predicts the time of the undisturbed job from them; both are written into the report's section
//! "farm".

#[path = "../../report/src/farm_model.rs"]
#[allow(dead_code, reason = "the report uses all of it")]
mod farm_model;

use crate::{cargo, root, run, target};
use farm_model::{Farm, Join};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Packages of Slurm, and of the libraries that it needs beyond those of every system.
const PACKAGES: [&str; 10] = [
    "slurmctld",
    "slurmd",
    "slurm-client",
    "slurm-wlm-basic-plugins",
    "libmunge2",
    "libhwloc15",
    "liblua5.1-0",
    "libjson-c5",
    "libdbus-1-3",
    "libyaml-0-2",
];

/// Scene with 24 chunks of 24 frames; each chunk is one piece of an MP4.
const SCRIPT: &str = r#"stage(#{ size: [640, 360], fps: 30, length: 19.2 });
let m = load("choreo:mannequin");
cast("a", m).play(m.clip("Dance_Groove")).loop();
camera("c").at(0.0, 1.2, 4.0).look_at([0.0, 1.0, 0.0]);
"#;
const OPTIONS: [&str; 4] = ["--export", "keyframes=0.8", "--device", "cpu"];
const CHUNKS: usize = 24;

/// Seconds after which a job is abandoned.
const TIMEOUT_SECS: u64 = 600;

/// Runs the test. `program`: path of an existing choreo; without it, choreo is built.
pub(crate) fn farm(program: Option<&str>) -> Result<(), String> {
    let Some(root) = packages()? else {
        println!("SKIP 1: no packages of Slurm (Debian, with its registry)");
        return Ok(());
    };
    let choreo = match program {
        Some(program) => PathBuf::from(program).canonicalize().map_err(|e| format!("{program}: {e}"))?,
        None => {
            run(cargo(&["build", "--quiet", "--workspace", "--bin", "choreo"]), "cargo build")?;
            target().join("debug/choreo")
        }
    };
    let folder = target().join("farm");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    fs::write(folder.join("s.rhai"), SCRIPT).map_err(|e| e.to_string())?;
    let start = Instant::now();
    let one = [&["render", "s.rhai", "-o", "one.mp4", "--quiet"][..], &OPTIONS].concat();
    run(command_in(&choreo, &folder, &one), "the render of one machine")?;
    let alone = start.elapsed().as_secs_f64();
    let mut cluster = Cluster::start(&root, &folder)?;
    let before = Costs::measured(&choreo, &folder, &cluster)?;
    let whole = cluster.render_film(&choreo, "whole", false)?;
    let start = Instant::now();
    run(
        command_in(&choreo, &folder, &["join", "whole/segments", "-o", "joined.mp4", "--quiet"]),
        "choreo join",
    )?;
    let join = start.elapsed().as_secs_f64();
    // The load of the machine may vary, so costs are measured before and after the job.
    let costs = before.mean(&Costs::measured(&choreo, &folder, &cluster)?, join);
    let predicted = costs.farm().run().joined;
    println!("predicted for the three nodes: {predicted:.1} s, {:+.0} %", (predicted / whole - 1.0) * 100.0);
    costs.write(whole)?;
    let faulty = cluster.render_film(&choreo, "faulty", true)?;
    println!("| {CHUNKS} chunks of 24 frames, 640×360 | seconds |\n|---|---|");
    println!("| one machine | {alone:.1} |");
    println!("| three nodes of this machine | {whole:.1} |");
    println!("| the same, a node killed and one drained | {faulty:.1} |");
    println!("the films are equal byte for byte");
    Ok(())
}

/// Costs of a task on this machine, measured without a job: three tasks run at the same time, since the nodes share the machine.
struct Costs {
    /// Seconds until the first frame, seconds per frame, seconds of Slurm between two tasks of a node, and seconds of the join.
    start: f64,
    frame: f64,
    gap: f64,
    join: f64,
}

impl Costs {
    fn measured(choreo: &Path, folder: &Path, cluster: &Cluster) -> Result<Costs, String> {
        run(command_in(choreo, folder, &["pack", "s.rhai", "-o", "s.choreo", "--quiet"]), "choreo pack")?;
        // Seconds of three tasks at the same time, of this many frames each, at three places of the film.
        let three = |frames: usize| {
            let start = Instant::now();
            let task = |place: usize| {
                let range = format!("{}-{}", place * 192, place * 192 + frames - 1);
                let words = [
                    "render",
                    "s.choreo",
                    "-o",
                    "film.mp4",
                    "--segment",
                    "costs",
                    "--quiet",
                    "--frames",
                    &range,
                ];
                command_in(choreo, folder, &[&words[..], &OPTIONS].concat()).spawn()
            };
            let tasks = (0..3).map(task).collect::<Result<Vec<_>, _>>()?;
            for mut task in tasks {
                task.wait()?;
            }
            Ok::<f64, std::io::Error>(start.elapsed().as_secs_f64())
        };
        let failed = |e: std::io::Error| e.to_string();
        let (one, chunk) = (three(1).map_err(failed)?, three(24).map_err(failed)?);
        let frame = (chunk - one) / 23.0;
        // Tasks that sleep for the duration of a chunk: the remaining time is that of Slurm.
        cluster.wait("three idle nodes", Cluster::three_are_idle)?;
        let start = Instant::now();
        cluster.slurm_output(
            "sbatch",
            &["--array=0-23", "--output=/dev/null", &format!("--wrap=sleep {chunk:.2}")],
        );
        cluster.wait("an end of the sleeping tasks", |cluster| {
            cluster.slurm_output("squeue", &["-h"]).is_empty()
        })?;
        let gap = (start.elapsed().as_secs_f64() / 8.0 - chunk).max(0.0);
        Ok(Costs { start: one - frame, frame, gap, join: 0.0 })
    }

    fn mean(&self, other: &Costs, join: f64) -> Costs {
        let mean = |a: f64, b: f64| (a + b) / 2.0;
        Costs {
            start: mean(self.start, other.start),
            frame: mean(self.frame, other.frame),
            gap: mean(self.gap, other.gap),
            join,
        }
    }

    fn farm(&self) -> Farm {
        let Costs { start, frame, gap, join } = *self;
        Farm {
            workers: 3,
            frames: 24 * CHUNKS as u64,
            chunk: 24,
            start,
            frame,
            gap,
            // The job that joins waits for Slurm as a task does.
            join: Join::One { bytes_per_second: 1e9, fixed: join + gap },
            ..Farm::ONE_MACHINE
        }
    }

    /// Writes the costs for the report, with the seconds that the job took.
    fn write(&self, seconds: f64) -> Result<(), String> {
        let path = root().join("tests/report/src/farm_measured.rs");
        let Costs { start, frame, gap, join } = self;
        let text = format!(
            "// Written by `cargo xtask farm`: what it measured on its three nodes, and how long the job took.
const START_SECS: f64 = {start:.3};
const FRAME_SECS: f64 = {frame:.4};
const GAP_SECS: f64 = {gap:.3};
const JOIN_SECS: f64 = {join:.3};
const TOTAL_SECS: f64 = {seconds:.2};
"
        );
        fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))
    }
}

fn command_in(program: &Path, folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(args).current_dir(folder).env("CHOREO_PLUGINS", "").stdin(Stdio::null());
    command
}

/// Root of the unpacked packages; `None` if they are not available.
fn packages() -> Result<Option<PathBuf>, String> {
    let tools = target().join("tools/slurm");
    let (root, archives) = (tools.join("root"), tools.join("deb"));
    if root.join("usr/sbin/slurmctld-wlm").exists() {
        return Ok(Some(root));
    }
    fs::create_dir_all(&archives).map_err(|e| format!("{}: {e}", archives.display()))?;
    let download = command_in(Path::new("apt-get"), &archives, &["download", "-qq"]).args(PACKAGES).output();
    if !download.is_ok_and(|run| run.status.success()) {
        return Ok(None);
    }
    for entry in fs::read_dir(&archives).map_err(|e| e.to_string())?.flatten() {
        let mut unpack = Command::new("dpkg");
        unpack.arg("-x").arg(entry.path()).arg(&root);
        run(unpack, "dpkg -x")?;
    }
    Ok(Some(root))
}

/// The running daemons, which are ended on drop.
struct Cluster {
    root: PathBuf,
    folder: PathBuf,
    controller: Child,
    /// Nodes n1 to n3.
    nodes: Vec<Child>,
}

impl Cluster {
    fn start(root: &Path, folder: &Path) -> Result<Cluster, String> {
        let name = |command: &mut Command| {
            let output = command.output().map_err(|e| e.to_string())?;
            Ok::<String, String>(String::from_utf8_lossy(&output.stdout).trim().to_string())
        };
        let host = name(Command::new("hostname").arg("-s"))?;
        let user = name(Command::new("id").arg("-un"))?;
        let at = folder.display();
        // The port is derived from the process id, so that users of one machine do not collide.
        let port = 20_000 + std::process::id() % 20_000;
        let plugins = plugins(root).display().to_string();
        let text = format!(
            "ClusterName=choreo\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={port}\nAuthType=auth/none\n\
             CredType=cred/none\nSlurmUser={user}\nSlurmdUser={user}\nStateSaveLocation={at}/state\n\
             SlurmdSpoolDir={at}/spool/%n\nSlurmctldPidFile={at}/controller.pid\nSlurmdPidFile={at}/%n.pid\n\
             SlurmctldLogFile={at}/controller.log\nSlurmdLogFile={at}/%n.log\nPluginDir={plugins}\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nSelectType=select/linear\nReturnToService=2\n\
             SlurmdTimeout=10\nMpiDefault=none\nSwitchType=switch/none\nJobAcctGatherType=jobacct_gather/none\n\
             AccountingStorageType=accounting_storage/none\n\
             NodeName=n[1-3] NodeHostname={host} NodeAddr=127.0.0.1 Port=[{}-{}] CPUs=1 State=UNKNOWN\n\
             PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n",
            port + 1,
            port + 3
        );
        for below in ["state", "spool/n1", "spool/n2", "spool/n3"] {
            fs::create_dir_all(folder.join(below)).map_err(|e| e.to_string())?;
        }
        fs::write(folder.join("slurm.conf"), text).map_err(|e| e.to_string())?;
        let daemon = |args: &[&str]| {
            let mut command = slurm(root, folder, &format!("usr/sbin/{}", args[0]));
            command.args(&args[1..]).stdout(Stdio::null()).stderr(Stdio::null());
            command.spawn().map_err(|e| format!("{} did not start: {e}", args[0]))
        };
        let step = root.join("usr/sbin/slurmstepd-wlm").display().to_string();
        let node = |name: &str| daemon(&["slurmd-wlm", "-D", "-N", name, "-d", &step]);
        let controller = daemon(&["slurmctld-wlm", "-D"])?;
        let nodes = vec![node("n1")?, node("n2")?, node("n3")?];
        Ok(Cluster { root: root.to_path_buf(), folder: folder.to_path_buf(), controller, nodes })
    }

    /// Runs a program of the cluster and returns its output.
    fn slurm_output(&self, program: &str, args: &[&str]) -> String {
        let output = slurm(&self.root, &self.folder, &format!("usr/bin/{program}")).args(args).output();
        output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default()
    }

    fn three_are_idle(&self) -> bool {
        self.slurm_output("sinfo", &["-h", "-N", "-t", "idle"]).lines().count() == 3
    }

    /// Runs a job and returns its duration in seconds.
    fn render_film(&mut self, choreo: &Path, job: &str, faults: bool) -> Result<f64, String> {
        let words =
            ["farm", "s.rhai", "-o", "film.mp4", "--for", "slurm", "--to", job, "--chunk", "24", "--quiet"];
        run(command_in(choreo, &self.folder, &[&words[..], &OPTIONS].concat()), "choreo farm")?;
        self.wait("three idle nodes", Cluster::three_are_idle)?;
        let start = Instant::now();
        let mut submit = slurm(&self.root, &self.folder, "/bin/sh");
        let path = std::env::var("PATH").unwrap_or_default();
        submit.arg(format!("{job}/submit.sh")).env("CHOREO", choreo);
        submit.env("PATH", format!("{}:{path}", self.root.join("usr/bin").display()));
        run(submit, "submit.sh")?;
        let segments = self.folder.join(job).join("segments");
        if faults {
            self.wait("some segments", |_| whole_segments(&segments) >= 3)?;
            self.kill_node()?;
            self.slurm_output("scontrol", &["update", "nodename=n2", "state=drain", "reason=test"]);
        }
        let film = self.folder.join(job).join("output/film.mp4");
        self.wait("the film", |_| film.exists())?;
        let seconds = start.elapsed().as_secs_f64();
        let count = whole_segments(&segments);
        let read = |path: &Path| fs::read(path).map_err(|e| format!("{}: {e}", path.display()));
        if count != CHUNKS || read(&film)? != read(&self.folder.join("one.mp4"))? {
            return Err(format!("{job}: the film of {count} segments differs from the film of one machine"));
        }
        Ok(seconds)
    }

    /// Kills the daemon of n3 and everything that runs on it, like a power failure.
    fn kill_node(&mut self) -> Result<(), String> {
        self.wait("a task of n3", |cluster| !cluster.processes_of_n3().is_empty())?;
        let processes = self.processes_of_n3();
        let node = self.nodes.last_mut().ok_or("no node")?;
        node.kill().map_err(|e| e.to_string())?;
        let _ = Command::new("kill").arg("-9").args(&processes).stderr(Stdio::null()).status();
        println!("killed n3 with {} processes", processes.len());
        Ok(())
    }

    /// Processes of the task on n3, including the parent process of Slurm that would report its end.
    fn processes_of_n3(&self) -> Vec<String> {
        let mut processes = Vec::new();
        for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
            let of_job =
                fs::read_link(entry.path().join("cwd")).is_ok_and(|cwd| cwd.starts_with(&self.folder));
            let environment = fs::read(entry.path().join("environ")).unwrap_or_default();
            let on_n3 = environment.split(|byte| *byte == 0).any(|entry| entry == b"SLURMD_NODENAME=n3");
            let status = fs::read_to_string(entry.path().join("status")).unwrap_or_default();
            let parent = status.lines().find_map(|line| line.strip_prefix("PPid:"));
            if let (true, true, Some(parent)) = (of_job, on_n3, parent) {
                processes
                    .extend([parent.trim().to_string(), entry.file_name().to_string_lossy().into_owned()]);
            }
        }
        processes
    }

    fn wait(&self, what: &str, done: impl Fn(&Cluster) -> bool) -> Result<(), String> {
        let start = Instant::now();
        while !done(self) {
            if start.elapsed().as_secs() > TIMEOUT_SECS {
                let queue = self.slurm_output("squeue", &[]);
                return Err(format!(
                    "no {what} after {TIMEOUT_SECS} s; logs in {}\n{queue}",
                    self.folder.display()
                ));
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(())
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        self.slurm_output("scancel", &["--full", "-t", "RUNNING"]);
        self.slurm_output("scancel", &["-t", "PENDING"]);
        for daemon in self.nodes.iter_mut().chain([&mut self.controller]) {
            let _ = Command::new("kill").arg(daemon.id().to_string()).stderr(Stdio::null()).status();
            let _ = daemon.wait();
        }
    }
}

fn whole_segments(folder: &Path) -> usize {
    let names = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    names.filter(|name| name.extension().is_some_and(|ending| ending == "segment")).count()
}

/// Folder of Slurm's own libraries and plugins.
fn plugins(root: &Path) -> PathBuf {
    let libraries = root.join("usr/lib").join(format!("{}-linux-gnu", std::env::consts::ARCH));
    libraries.join("slurm-wlm")
}

/// Command for a program of the cluster, with its libraries and configuration.
fn slurm(root: &Path, folder: &Path, program: &str) -> Command {
    let (plugins, own) = (plugins(root), root.join("lib"));
    let libraries = plugins.parent().unwrap_or(&own);
    let paths = [libraries, &own.join(libraries.file_name().unwrap_or_default()), &plugins]
        .map(|path| path.display().to_string())
        .join(":");
    let mut command = command_in(&root.join(program.trim_start_matches('/')), folder, &[]);
    if program.starts_with('/') {
        command = command_in(Path::new(program), folder, &[]);
    }
    command.env("LD_LIBRARY_PATH", paths).env("SLURM_CONF", folder.join("slurm.conf"));
    command
}
