//! The choice of the renderer and of the number of samples per pixel.

use super::{MeasuredScene, SceneChoices};
use crate::error::BenchError;
use crate::moment::Moment;
use crate::plots::{Choice, Row};
use crate::timing::{Case, Clock, interleaved};
use choreo_image_diff::compare;
use choreo_plugin::Frame;
use choreo_render::{DeviceKind, RenderError};
use std::cell::RefCell;

/// Largest size of the image; the reference draws 16 times as many pixels.
const MAX_PIXELS: u32 = 1280 * 720;
/// Larger differences, in steps of 255, are visible side by side.
const TOLERANCE: u8 = 8;

pub fn choices(scene: &mut MeasuredScene, moment: &Moment) -> Result<SceneChoices, BenchError> {
    if moment.resources.primitives.is_empty() {
        return Ok(SceneChoices::None("there is nothing to draw".into()));
    }
    let [width, height] = scene.size;
    // The size is divided by a whole number, so that the aspect ratio stays.
    let smaller = (1..=64).find(|n| (width / n) * (height / n) <= MAX_PIXELS).unwrap_or(64);
    let size = [width / smaller, height / smaller].map(|n| n.max(16));
    let truth = moment.supersampled(size)?;
    let mut choice = Choice::new("renderer", "Which renderer draws, with how many samples a pixel?");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = format!(
        "64 samples a pixel, textures included, at {}×{}; mean over all channels of all pixels; \
         differences of at most {TOLERANCE} steps are hard to see",
        size[0], size[1]
    );
    let mut rows = Vec::new();
    for renderer in &mut scene.renderers {
        renderer.load(moment.resources.clone())?;
        let name = match renderer.device().kind {
            DeviceKind::CpuReference => "CPU renderer".to_string(),
            _ => format!("Vulkan ({})", short_device_name(&renderer.device().name)),
        };
        for samples in [1, 4] {
            let frame = moment.draw(renderer.as_mut(), size, samples)?;
            let plural = if samples == 1 { "" } else { "s" };
            rows.push((
                samples,
                comparison_row(format!("{name}, {samples} sample{plural}"), &frame, &truth)?,
            ));
        }
    }
    let gpu = scene.renderers.iter().any(|r| r.device().kind == DeviceKind::VulkanGpu);
    let clock = if gpu { Clock::Wall } else { Clock::Process };
    choice.per = format!("image, {}", clock.words());
    // Drawing is not expected to fail after the first image; a failure must not be timed as a fast image.
    let failed: RefCell<Option<RenderError>> = RefCell::new(None);
    let cells: Vec<RefCell<_>> = scene.renderers.iter_mut().map(RefCell::new).collect();
    let mut cases: Vec<Case> = Vec::new();
    for cell in &cells {
        for samples in [1, 4] {
            let failed = &failed;
            cases.push(Case::new(1, move || {
                if let Err(e) = moment.draw(cell.borrow_mut().as_mut(), size, samples) {
                    *failed.borrow_mut() = Some(e);
                }
            }));
        }
    }
    let nanos = interleaved(clock, scene.budget_secs, &mut cases);
    drop(cases);
    drop(cells);
    if let Some(e) = failed.into_inner() {
        return Err(e.into());
    }
    let wanted = scene.stage.settings.samples.unwrap_or(4);
    choice.rows = rows.iter().zip(nanos).map(|((_, row), nanos)| row.clone().nanos(nanos)).collect();
    let kinds: Vec<DeviceKind> = scene.renderers.iter().map(|r| r.device().kind).collect();
    let (taken, reason) = default_renderer(&kinds, scene.asks_for_vulkan);
    // There are two rows per renderer.
    let of_taken = |samples: u32| (2 * taken..2 * taken + 2).find(|i| rows[*i].0 == samples);
    if let (Some(chosen), Some(one), Some(four)) = (of_taken(wanted), of_taken(1), of_taken(4)) {
        let [one, four] = [one, four].map(|row| choice.rows[row].clone());
        let times = four.cost().unwrap_or(1.0) / one.cost().unwrap_or(1.0);
        let left = four.mean / one.mean.max(1e-9) * 100.0;
        let asked = if scene.stage.settings.samples.is_some() { "as the script asks" } else { "the default" };
        let why = format!(
            "{asked}, {reason}; 4 samples leave {left:.0} % of the mean error of 1 sample and take \
             {times:.1} times as long"
        );
        let name = choice.rows[chosen].name.clone();
        choice.choose(&name, why);
    }
    Ok(SceneChoices::Choices(vec![choice]))
}

/// The renderer that the program would use, and why. A Vulkan driver that draws on the CPU is used only if it was requested (decision 30).
fn default_renderer(kinds: &[DeviceKind], asks_for_vulkan: bool) -> (usize, &'static str) {
    let of = |kind: DeviceKind| kinds.iter().position(|k| *k == kind);
    match (of(DeviceKind::VulkanGpu), of(DeviceKind::VulkanCpu)) {
        (Some(gpu), _) => (gpu, "on the GPU"),
        (None, Some(driver)) if asks_for_vulkan => (driver, "by the requested driver"),
        (None, Some(_)) => (0, "by the CPU renderer, since the Vulkan driver draws on the CPU, too"),
        (None, None) => (0, "by the CPU renderer, the only one available"),
    }
}

fn comparison_row(name: String, frame: &Frame, truth: &Frame) -> Result<Row, BenchError> {
    let c = compare(frame, truth, TOLERANCE)?;
    let share =
        format!("{:.2} % of pixels beyond {TOLERANCE}, PSNR {:.1} dB", c.share_beyond * 100.0, c.psnr);
    Ok(Row::new(name)
        .error(f64::from(c.worst), c.mean)
        .at(format!("pixel {}, {}", c.worst_at[0], c.worst_at[1]))
        .note(share))
}

/// Short name of a device: "llvmpipe" for "llvmpipe (LLVM 15.0.6, 256 bits)".
fn short_device_name(device: &str) -> &str {
    device.split(" (").next().unwrap_or(device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cpu_vulkan_driver_is_chosen_only_on_request() {
        use DeviceKind::{CpuReference, VulkanCpu, VulkanGpu};
        assert_eq!(default_renderer(&[CpuReference], false).0, 0);
        assert_eq!([false, true].map(|asks| default_renderer(&[CpuReference, VulkanCpu], asks).0), [0, 1]);
        assert_eq!([false, true].map(|asks| default_renderer(&[CpuReference, VulkanGpu], asks).0), [1, 1]);
    }
}
