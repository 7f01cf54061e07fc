//! `choreo measure`: error against run time for the numerical choices that a scene could make.

use crate::args::values;
use crate::args::{Device, MeasureArgs};
use crate::drawing::device;
use crate::failure::{Failure, print, print_json, print_message};
use crate::output::svg;
use crate::scene::{self, opening::OpenOptions};
use choreo_bench::plots::{Choice, stacked};
use choreo_bench::scene::{KEYS, MeasuredScene, measure};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::{CpuRenderer, Renderer};
use choreo_script::did_you_mean;
use serde_json::{Value, json};

/// Seconds spent on the timings of one choice.
const SECS_PER_CHOICE: f64 = 1.0;

pub(crate) fn run(args: MeasureArgs, plugins: &Registry) -> Result<(), Failure> {
    svg::check_plot_path(args.plot.as_deref())?;
    let keys = requested_keys(&args.only)?;
    let at = args.at.as_deref().map(values::parse_at).transpose()?;
    let size = args.size.as_deref().map(values::parse_size).transpose()?;
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let scene = scene::open(&args.scene, &registry, OpenOptions::TO_DRAW)?;
    args.plot.as_deref().map_or(Ok(()), |path| scene.inputs.check_output(path))?;
    let (stage, registry) = (&scene.stage, &scene.registry);
    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(registry.effects()))];
    let mut note = None;
    if args.device != Device::Cpu && keys.contains(&"renderer") {
        // Vulkan is compared even if `auto` would not choose it.
        match device::start_renderer(Device::Vulkan, registry.effects()).wait() {
            Ok(started) => renderers.push(started.renderer),
            Err(failure) if args.device == Device::Vulkan => return Err(failure),
            Err(failure) => note = Some(failure.message_lines().join("\n")),
        }
    }
    let middle = Time(stage.settings.length.0 / 2);
    let mut measured = MeasuredScene {
        stage,
        registry,
        at: at.unwrap_or(middle),
        size: size.unwrap_or(stage.settings.size),
        renderers,
        asks_for_vulkan: args.device == Device::Vulkan,
        budget_secs: SECS_PER_CHOICE,
    };
    let mut choices: Vec<Choice> = Vec::new();
    let mut left_out: Vec<(&'static str, String)> = Vec::new();
    if !args.json {
        note.iter().for_each(print_message);
        let [w, h] = measured.size;
        print(&format!(
            "{}: images at {} s, {w}×{h}; → marks the current choice\n",
            scene.name,
            measured.at.as_secs()
        ))?;
    }
    for key in keys {
        let found = measure(&mut measured, &[key]).map_err(|e| Failure::input(e.to_string()))?;
        if !args.json {
            for choice in &found.choices {
                print(&format!("\n{}", choice.table().text()))?;
            }
        }
        choices.extend(found.choices);
        left_out.extend(found.left_out);
    }
    if let Some(path) = &args.plot {
        let plots: Vec<String> = choices.iter().filter_map(choreo_bench::plots::plot).collect();
        svg::write_plot(path, &stacked(&plots), &scene.inputs)?;
    }
    if args.json {
        let left: Vec<Value> =
            left_out.iter().map(|(what, why)| json!({ "what": what, "why": why })).collect();
        let choices: Vec<Value> = choices.iter().map(Choice::json).collect();
        return print_json(&json!({
            "source": scene.name, "seconds": measured.at.as_secs(), "size": measured.size,
            "choices": choices, "left_out": left,
        }));
    }
    if !left_out.is_empty() {
        let lines: Vec<String> = left_out.iter().map(|(what, why)| format!("  {what}: {why}\n")).collect();
        print(&format!("\nno choice to measure\n{}", lines.concat()))?;
    }
    Ok(())
}

/// Keys of all choices, or of those requested.
fn requested_keys(only: &[String]) -> Result<Vec<&'static str>, Failure> {
    if only.is_empty() {
        return Ok(KEYS.to_vec());
    }
    let known = |name: &String| {
        KEYS.iter().find(|k| *k == name).copied().ok_or_else(|| {
            let near = did_you_mean(name, KEYS.iter().copied());
            Failure::Usage(format!(
                "--only {name}: there is no such choice{near}; choices: {}",
                KEYS.join(", ")
            ))
        })
    };
    only.iter().map(known).collect()
}
