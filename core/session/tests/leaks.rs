//! Reloads leak no device objects, memory, threads or files. The default test makes 200 reloads; 10,000 are made by
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

/// Resources of this process, as Linux reports them; zero on other systems.
#[derive(Clone, Copy, Debug, Default)]
struct ProcessResources {
    /// Resident memory that is not backed by a file.
    anonymous_bytes: u64,
    threads: u64,
    /// Open file descriptors, including those of file watches.
    files: usize,
}

impl ProcessResources {
    fn now() -> ProcessResources {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let number = |name: &str| {
            let line = status.lines().find_map(|l| l.strip_prefix(name))?;
            line.split_whitespace().next()?.parse::<u64>().ok()
        };
        ProcessResources {
            anonymous_bytes: number("RssAnon:").unwrap_or(0) * 1024,
            threads: number("Threads:").unwrap_or(0),
            files: fs::read_dir("/proc/self/fd").map_or(0, Iterator::count),
        }
    }

    /// Waits until the process has no more threads and files than `before`, at most for a minute: on a busy machine, they end late.
    fn wait_for_release(before: &ProcessResources) -> ProcessResources {
        let end = Instant::now() + Duration::from_secs(60);
        loop {
            let now = ProcessResources::now();
            if (now.threads <= before.threads && now.files <= before.files) || Instant::now() > end {
                return now;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

struct ReloadTest {
    folder: tempfile::TempDir,
    session: Session,
    renderer: FrameRenderer,
    reply: Receiver<FrameReply>,
}

impl ReloadTest {
    /// Returns `None`, and prints the reason, if Vulkan is not available.
    fn new() -> Option<ReloadTest> {
        if let Err(RenderError::NoVulkan { why }) = RecoveringRenderer::new(GpuOptions::default()) {
            println!("SKIP 1: {why}");
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        let mut registry = Registry::default();
        registry.add_importer(import_mannequin::Mannequin);
        registry.add_importer(import_obj::ObjImporter);
        for n in 0..3 {
            write_edit(folder.path(), n);
        }
        let session = Session::new(SceneSource::new(folder.path().join("a.rhai")), &registry, true).unwrap();
        let (to, reply) = channel();
        let start = Box::new(|| {
            let renderer = RecoveringRenderer::new(GpuOptions::default())?;
            Ok((Box::new(renderer) as Box<dyn choreo_render::Renderer>, None))
        });
        let renderer = FrameRenderer::start(start, move |p| drop(to.send(p))).unwrap();
        let mut test = ReloadTest { folder, session, renderer, reply };
        test.build_and_draw(BTreeSet::new());
        Some(test)
    }

    fn build_and_draw(&mut self, changed: BTreeSet<std::path::PathBuf>) -> DeviceUsage {
        let version = self.session.build(changed);
        let scene = version.scene.unwrap_or_else(|| panic!("{:?}", version.problems));
        self.renderer.request_frame(FrameRequest::new(scene, Time::from_secs(1.0), 4, 0));
        let reply = self.reply.recv_timeout(Duration::from_secs(300)).unwrap();
        let device_usage = reply.device_usage;
        self.renderer.recycle_frame(reply.result.unwrap().0);
        device_usage
    }

    /// Makes edit `n`, waits until the watch reports it, and draws the new version.
    fn reload(&mut self, n: usize) -> DeviceUsage {
        write_edit(self.folder.path(), n);
        match self.session.wait(Some(Duration::from_secs(300))).unwrap() {
            WatchEvent::Changed(files) => self.build_and_draw(files),
            other => panic!("the watch reports no change: {other:?}"),
        }
    }
}

/// Writes a new number into the script, the mesh and the effect in turn.
fn write_edit(folder: &Path, n: usize) {
    let part = 0.1 + n as f64 * 1e-4;
    let (name, text) = match n % 3 {
        0 => ("a.rhai", SCRIPT.replace("FROM", &format!("{part:.4}"))),
        1 => ("box.obj", format!("v 0 0 0\nv {part:.4} 0 0\nv 0 1 0\nf 1 2 3\n")),
        _ => ("glow.wgsl", GLOW.replace("BY", &format!("{part:.4}"))),
    };
    fs::write(folder.join(name), text).unwrap();
}

/// Makes `count` edits and returns by how many bytes each has enlarged the memory, without the first tenth.
fn bytes_per_reload(count: usize, report: bool) -> Option<f64> {
    let mut test = ReloadTest::new()?;
    let start = Instant::now();
    let warm_up = count / 10;
    let (mut device_usage, mut resources) = (DeviceUsage::default(), ProcessResources::default());
    for n in 3..count + 3 {
        let now = test.reload(n);
        if n == warm_up + 3 {
            (device_usage, resources) = (now, ProcessResources::now());
        }
        if n > warm_up + 3 {
            assert_eq!(now, device_usage, "after {n} reloads, the device has a different number of objects");
        }
        if report && (n - 2) % (count / 10) == 0 {
            println!(
                "{:5} reloads, {:.0} s: {:?} {now:?}",
                n - 2,
                start.elapsed().as_secs_f64(),
                ProcessResources::now()
            );
        }
    }
    let after = ProcessResources::wait_for_release(&resources);
    // Fewer files than before are no leak: the start may have had a file open that is now closed.
    assert!(
        after.threads <= resources.threads && after.files <= resources.files,
        "{} threads and {} files at the end; {} threads and {} files before",
        after.threads,
        after.files,
        resources.threads,
        resources.files
    );
    Some((after.anonymous_bytes as f64 - resources.anonymous_bytes as f64) / (count - warm_up) as f64)
}

#[test]
fn two_hundred_reloads_leak_nothing() {
    let Some(added) = bytes_per_reload(200, false) else { return };
    // A leaked mesh, scene or pipeline has tens of kilobytes. Allocators need a few hundred reloads until their memory stops growing.
    assert!(added < 20_000.0, "{added:.0} bytes per reload");
}

#[test]
#[ignore = "10,000 reloads take minutes"]
fn ten_thousand_reloads_leak_nothing() {
    let Some(added) = bytes_per_reload(10_000, true) else { return };
    println!("{added:.0} bytes per reload");
    assert!(added < 500.0, "{added:.0} bytes per reload");
}
