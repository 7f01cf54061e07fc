//! The same script gives the same bytes: twice, in any order of frames, played or sought, in parts by several processes, with
//! any number of threads, in every format, on the CPU and on Vulkan.

mod common;
#[path = "common/long_time_limits.rs"]
mod long_time_limits;

use choreo_motion::Time;
use choreo_plugin::{Frame, Registry};
use choreo_render::{
    CpuRenderer, GpuOptions, Plan, PlanOptions, RenderError, Renderer, SceneResources, VulkanRenderer,
};
use choreo_script::run_file;
use choreo_stage::Evaluator;
use common::{choreo, file_names, read_file};
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts").join(name)
}

/// Renders ranges of frames as numbered images, one process after the other; `None` if there is no Vulkan device.
fn render_images(folder: &Path, device: &str, out: &str, ranges: &[&str], jobs: &str) -> Option<()> {
    let script = script("07_keys_and_frames.rhai");
    for range in ranges {
        let out = format!("{out}/%04d.png");
        let mut args = vec!["render", script.to_str().unwrap(), "-o", &out, "--frames", range];
        args.extend(["--device", device, "--jobs", jobs, "--size", "160x90", "--samples", "4"]);
        let run = choreo(folder, &args);
        // The code for "no device can render it".
        if run.code == 4 && device == "vulkan" {
            println!("SKIP 1: {}", run.err.lines().next().unwrap_or_default());
            return None;
        }
        assert_eq!(run.code, 0, "{}", run.err);
    }
    Some(())
}

/// Renders a video of some frames and returns its bytes.
fn render_video(folder: &Path, device: &str, name: &str, frames: &str, jobs: &str) -> Vec<u8> {
    let script = script("07_keys_and_frames.rhai");
    let mut args = vec!["render", script.to_str().unwrap(), "-o", name, "--frames", frames];
    args.extend(["--device", device, "--jobs", jobs, "--size", "160x90", "--samples", "1"]);
    let run = choreo(folder, &args);
    assert_eq!(run.code, 0, "{}", run.err);
    read_file(folder, name)
}

fn assert_processes_agree(device: &str) {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    // Output folder, ranges of frames (one process each), number of threads.
    let cases: [(&str, &[&str], &str); 6] = [
        ("whole", &["40..48"], "2"),
        ("again", &["40..48"], "2"),
        ("one_thread", &["40..48"], "1"),
        ("seven_threads", &["40..48"], "7"),
        ("parts", &["45..48", "40..42", "42..45"], "2"),
        ("alone", &["46", "41"], "2"),
    ];
    for (out, ranges, jobs) in cases {
        if render_images(d, device, out, ranges, jobs).is_none() {
            return;
        }
    }
    let whole = file_names(&d.join("whole"));
    assert_eq!(whole.len(), 8);
    for (out, ranges, _) in cases {
        let frame_files = file_names(&d.join(out));
        assert_eq!(frame_files.len(), if out == "alone" { ranges.len() } else { 8 }, "{out}");
        for name in &frame_files {
            let same = read_file(d, &format!("whole/{name}")) == read_file(d, &format!("{out}/{name}"));
            assert!(same, "{device}: {name} differs between whole and {out}");
        }
    }
    // The comparison can fail: consecutive frames differ.
    assert!(read_file(d, "whole/0040.png") != read_file(d, "whole/0041.png"));

    for format in ["y4m", "mp4", "gif"] {
        let whole = render_video(d, device, &format!("whole.{format}"), "40..48", "1");
        let other = render_video(d, device, &format!("seven.{format}"), "40..48", "7");
        assert!(other == whole, "{device}: {format} with seven threads");
    }
    // Parts of a y4m stream, joined, are the whole stream.
    let (whole, mut joined) =
        (read_file(d, "whole.y4m"), render_video(d, device, "first.y4m", "40..43", "2"));
    let rest = render_video(d, device, "rest.y4m", "43..48", "1");
    let header = rest.iter().position(|b| *b == b'\n').unwrap() + 1;
    joined.extend(&rest[header..]);
    assert!(joined == whole && whole.len() > 8 * 160 * 90, "{device}: y4m in parts");
}

#[test]
fn processes_and_thread_counts_give_the_same_bytes_on_the_cpu() {
    assert_processes_agree("cpu");
}

#[test]
fn processes_and_thread_counts_give_the_same_bytes_on_vulkan() {
    assert_processes_agree("vulkan");
}

/// Frames of a script in the order of `numbers`, with several frames in flight and one renderer for all of them.
fn draw(renderer: &mut dyn Renderer, name: &str, registry: &Registry, numbers: &[i64]) -> Vec<Frame> {
    let mut stage = run_file(&script(name), registry, &long_time_limits::script_options()).unwrap().stage;
    stage.settings.size = [160, 90];
    let length = stage.settings.length.as_secs();
    let resources = Arc::new(SceneResources::new(&stage));
    renderer.load(resources.clone()).unwrap();
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let options = PlanOptions { effects: registry.effects(), ..PlanOptions::new([160, 90], 4) };
    let (mut frames, mut in_flight) = (Vec::new(), 0);
    for number in numbers {
        let snapshot = evaluator.at(Time::from_secs(length * *number as f64 / FRAMES as f64)).unwrap();
        renderer.submit(Plan::new(&resources, evaluator.stage(), &snapshot, &options)).unwrap();
        in_flight += 1;
        if in_flight == renderer.frames_in_flight() {
            frames.push(renderer.collect(None).unwrap());
            in_flight -= 1;
        }
    }
    for _ in 0..in_flight {
        frames.push(renderer.collect(None).unwrap());
    }
    frames
}

const FRAMES: i64 = 8;

fn assert_orders_agree(renderer: &mut dyn Renderer, registry: &Registry) {
    for name in ["01_first_dance.rhai", "04_cameras.rhai", "05_lights.rhai", "07_keys_and_frames.rhai"] {
        let forward: Vec<i64> = (0..FRAMES).collect();
        let backward: Vec<i64> = (0..FRAMES).rev().collect();
        let shuffled: Vec<i64> = (0..FRAMES).map(|i| (i * 3 + 5) % FRAMES).collect();
        let expected = draw(renderer, name, registry, &forward);
        assert!(expected.windows(2).all(|w| w[0] != w[1]), "{name}: something moves in every frame");
        for order in [backward, shuffled] {
            let frames = draw(renderer, name, registry, &order);
            for (frame, number) in frames.iter().zip(&order) {
                assert!(*frame == expected[*number as usize], "{name}: frame {number} in order {order:?}");
            }
        }
    }
}

fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add_importer(import_mannequin::Mannequin);
    effects::named(&["vignette"]).into_iter().for_each(|effect| registry.add_effect(effect));
    registry
}

#[test]
fn frames_drawn_in_any_order_are_equal_on_the_cpu() {
    let registry = registry();
    assert_orders_agree(&mut CpuRenderer::new(registry.effects()), &registry);
}

#[test]
fn frames_drawn_in_any_order_are_equal_on_vulkan() {
    let registry = registry();
    let effects = registry.effects().to_vec();
    match VulkanRenderer::new(GpuOptions { validation: true, effects, ..GpuOptions::default() }) {
        Ok(mut renderer) => assert_orders_agree(&mut renderer, &registry),
        Err(RenderError::NoVulkan { why }) => println!("SKIP 1: {}", why.lines().next().unwrap_or_default()),
        Err(e) => panic!("{e}"),
    }
}
