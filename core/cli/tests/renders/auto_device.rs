//! `--device auto` uses the CPU renderer if the Vulkan driver draws on the CPU, and `--jobs` limits the threads of such a driver.

use crate::common::{choreo, command};
use std::collections::BTreeSet;
use std::path::Path;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 2.0 });
let ball = cast("b", shape("sphere", #{ size: 2.0, color: "#c04020" }));
ball.key("position", [[0.0, [0, 0, 0]], [2.0, [1, 0, 0]]]);
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
"##;

fn summary(folder: &Path, device: &str) -> Option<serde_json::Value> {
    let args = ["render", "a.rhai", "-o", "a.png", "--at", "0", "--json", "--timings", "--device", device];
    let run = choreo(folder, &args);
    (run.code == 0).then(|| serde_json::from_str(&run.out).unwrap())
}

#[test]
fn auto_device_avoids_a_vulkan_driver_that_draws_on_the_cpu() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.rhai"), SCRIPT).unwrap();
    let auto = summary(dir.path(), "auto").unwrap();
    let Some(named) = summary(dir.path(), "vulkan") else {
        println!("SKIP 1: no Vulkan driver");
        return;
    };
    let text = |value: &serde_json::Value, key: &str| value[key].as_str().map(str::to_string);
    assert_eq!(text(&named, "device_reason"), None);
    let driver = text(&named, "device").unwrap();
    if !driver.contains("llvmpipe") {
        assert_eq!(text(&auto, "device"), Some(driver));
        return;
    }
    assert_eq!(text(&auto, "device").as_deref(), Some("choreo CPU renderer"));
    let reason = "the only Vulkan device, llvmpipe, draws on the CPU and is slower";
    assert_eq!(text(&auto, "device_reason").as_deref(), Some(reason));
    // Only the stages of the CPU renderer are in the timings.
    let stages = auto["stage_seconds"].as_object().unwrap();
    assert_eq!((stages.len(), auto["stage_frames"].as_u64()), (5, Some(1)));
    assert!(stages["pixels"].as_f64().unwrap() > 0.0 && named["stage_seconds"].is_null());
}

/// The names of the rasterizer threads of a process, observed while it runs.
#[cfg(target_os = "linux")]
fn rasterizer_threads(folder: &Path, jobs: &str) -> BTreeSet<String> {
    let args = ["render", "a.rhai", "-o", "a.y4m", "--device", "vulkan", "--jobs", jobs, "--quiet"];
    let mut child = command(folder, &args).spawn().unwrap();
    let mut seen = BTreeSet::new();
    while child.try_wait().unwrap().is_none() {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", child.id())).into_iter().flatten().flatten();
        let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
        seen.extend(names.map(|name| name.trim().to_string()).filter(|name| name.starts_with("llvmpipe-")));
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    seen
}

#[cfg(target_os = "linux")]
#[test]
fn jobs_bound_the_threads_of_the_driver() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.rhai"), SCRIPT).unwrap();
    let one = rasterizer_threads(dir.path(), "1");
    if one.is_empty() {
        println!("SKIP 1: no Vulkan driver that draws on the CPU");
        return;
    }
    assert_eq!((one.len(), rasterizer_threads(dir.path(), "3").len()), (1, 3));
}
