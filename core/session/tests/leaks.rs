//! Reloads leak nothing: not on the device, not in memory, not in threads. 200 of them here; 10,000 with
//! `cargo test --release -p choreo-session --test leaks -- --ignored --nocapture`.

use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::vulkan::{GpuOptions, RecoveringRenderer};
use choreo_render::{DeviceUsage, RenderError};
use choreo_session::{FrameRenderer, FrameReply, FrameRequest, SceneSource, Session, WatchEvent};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const SCRIPT: &str = r#"
stage(#{ size: [96, 64], fps: 30, length: 2.0 });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(load("choreo:mannequin").clip("Walk")).from(FROM);
let box = cast("box", load("box.obj")).at(1.0, 0.0, 0.0);
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
effect("glow");
"#;
const GLOW: &str = "// effect: glow\n// about: brighter\n// version: 1\n// param amount = 0.5 in 0..1: how much\n\
    fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return color * (BY + p[amount]);\n}\n";

/// Resources that a process holds, where the system reports them (Linux).
#[derive(Clone, Copy, Debug, Default)]
struct Process {
    /// Bytes that are nobody else's.
    anonymous: u64,
    threads: u64,
    /// Open files, watches of the system among them.
    files: usize,
}

impl Process {
    fn now() -> Process {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let number = |name: &str| {
            let line = status.lines().find_map(|l| l.strip_prefix(name))?;
            line.split_whitespace().next()?.parse::<u64>().ok()
        };
        Process {
            anonymous: number("RssAnon:").unwrap_or(0) * 1024,
            threads: number("Threads:").unwrap_or(0),
            files: fs::read_dir("/proc/self/fd").map_or(0, Iterator::count),
        }
    }

    /// Once it holds no more threads and files than `before`: those that end are waited for, however busy the machine is. What
    /// leaks does not end.
    fn settled(before: &Process) -> Process {
        let end = Instant::now() + Duration::from_secs(60);
        loop {
            let now = Process::now();
            if (now.threads <= before.threads && now.files <= before.files) || Instant::now() > end {
                return now;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

struct Bench {
    folder: tempfile::TempDir,
    session: Session,
    renderer: FrameRenderer,
    reply: Receiver<FrameReply>,
}

impl Bench {
    /// `None`, with a word, where there is no Vulkan.
    fn new() -> Option<Bench> {
        if let Err(RenderError::NoVulkan { why }) = RecoveringRenderer::new(GpuOptions::default()) {
            println!("SKIP 1: {why}");
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        let mut registry = Registry::default();
        registry.add_importer(import_mannequin::Mannequin);
        registry.add_importer(import_obj::ObjImporter);
        for n in 0..3 {
            edit(folder.path(), n);
        }
        let session = Session::new(SceneSource::new(folder.path().join("a.rhai")), &registry, true).unwrap();
        let (to, reply) = channel();
        let start = Box::new(|| {
            let renderer = RecoveringRenderer::new(GpuOptions::default())?;
            Ok((Box::new(renderer) as Box<dyn choreo_render::Renderer>, None))
        });
        let renderer = FrameRenderer::start(start, move |p| drop(to.send(p))).unwrap();
        let mut bench = Bench { folder, session, renderer, reply };
        bench.show(BTreeSet::new());
        Some(bench)
    }

    fn show(&mut self, changed: BTreeSet<std::path::PathBuf>) -> DeviceUsage {
        let version = self.session.build(changed);
        let scene = version.scene.unwrap_or_else(|| panic!("{:?}", version.problems));
        self.renderer.ask(FrameRequest::new(scene, Time::from_secs(1.0), 4, 0));
        let reply = self.reply.recv_timeout(Duration::from_secs(300)).unwrap();
        let held = reply.device_usage;
        self.renderer.give_back(reply.result.unwrap().0);
        held
    }

    /// The `n`th edit, as the watch reports it.
    fn reload(&mut self, n: usize) -> DeviceUsage {
        edit(self.folder.path(), n);
        match self.session.wait(Some(Duration::from_secs(300))).unwrap() {
            WatchEvent::Changed(files) => self.show(files),
            other => panic!("nothing has changed: {other:?}"),
        }
    }
}

/// A number of the script, a mesh, an effect, one after the other; each time another.
fn edit(folder: &Path, n: usize) {
    let part = 0.1 + n as f64 * 1e-4;
    let (name, text) = match n % 3 {
        0 => ("a.rhai", SCRIPT.replace("FROM", &format!("{part:.4}"))),
        1 => ("box.obj", format!("v 0 0 0\nv {part:.4} 0 0\nv 0 1 0\nf 1 2 3\n")),
        _ => ("glow.wgsl", GLOW.replace("BY", &format!("{part:.4}"))),
    };
    fs::write(folder.join(name), text).unwrap();
}

/// Gives bytes that were added a reload, after the first tenth.
fn reloads(count: usize, report: bool) -> Option<f64> {
    let mut bench = Bench::new()?;
    let start = Instant::now();
    let settled = count / 10;
    let (mut held, mut process) = (DeviceUsage::default(), Process::default());
    for n in 3..count + 3 {
        let now = bench.reload(n);
        if n == settled + 3 {
            (held, process) = (now, Process::now());
        }
        if n > settled + 3 {
            assert_eq!(now, held, "after {n} reloads the device holds something else");
        }
        if report && (n - 2) % (count / 10) == 0 {
            println!(
                "{:5} reloads, {:.0} s: {:?} {now:?}",
                n - 2,
                start.elapsed().as_secs_f64(),
                Process::now()
            );
        }
    }
    let after = Process::settled(&process);
    // One file less than at first is none that leaks: what a start-up still had open has gone.
    assert!(
        after.threads <= process.threads && after.files <= process.files,
        "{} threads and {} files, {} and {} before",
        after.threads,
        after.files,
        process.threads,
        process.files
    );
    Some((after.anonymous as f64 - process.anonymous as f64) / (count - settled) as f64)
}

#[test]
fn two_hundred_reloads_hold_what_one_does() {
    let Some(added) = reloads(200, false) else { return };
    // A leaked mesh, scene or pipeline is tens of kilobytes; allocators settle over a few hundred.
    assert!(added < 20_000.0, "{added:.0} bytes a reload");
}

#[test]
#[ignore = "10,000 reloads take minutes"]
fn ten_thousand_reloads_hold_what_one_does() {
    let Some(added) = reloads(10_000, true) else { return };
    println!("{added:.0} bytes a reload");
    assert!(added < 500.0, "{added:.0} bytes a reload");
}
