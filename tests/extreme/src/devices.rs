//! Devices without optional features: each feature that choreo uses is masked, and limits of the device are exceeded.

use crate::{Case, images, refused};
use choreo_motion::Time;
use choreo_render::vulkan::Ability;
use choreo_render::{
    CpuRenderer, GpuOptions, Plan, PlanOptions, RenderError, Renderer, SceneResources, VulkanRenderer,
};
use choreo_stage::{Cutouts, Pipeline, Stage, Transparency};
use std::sync::Arc;

pub const CASES: &[Case] = &[
    Case::new("a device without alphaToOne", "steps of 255 off hard cut-outs by the CPU", 2.0, || {
        without(Ability::AlphaToOne, &images::leaf(), 4, |s| s.settings.cutouts = Cutouts::Hard)
    }),
    Case::new("a device without sampleRateShading", "steps of 255 off sorted panes by the CPU", 2.0, || {
        let sorted = |s: &mut Stage| s.settings.transparency = Transparency::Sorted;
        without(Ability::SampleRateShading, &images::panes(), 4, sorted)
    }),
    Case::new("a device without samplerAnisotropy", "steps of 255 off none by the CPU", 3.0, || {
        without(Ability::SamplerAnisotropy, &images::leaf(), 4, |_| {})
    }),
    Case::new("a device without maxColorAttachments", "steps of 255 off forward by the CPU", 2.0, || {
        let mut stage = images::lit_wall();
        stage.settings.pipeline = Pipeline::Deferred;
        without(Ability::ColorAttachments, &stage, 1, |s| s.settings.pipeline = Pipeline::Forward)
    }),
    Case::new("an image wider than any device's", "named error (0) or not (1)", 0.0, || {
        vulkan(GpuOptions::default(), |gpu| {
            refused(draw(gpu, &images::panes(), [1 << 20, 16], 1).map(|_| ()), "image width is 1048576")
        })
    }),
    Case::new("a device that is not there", "named error (0) or not (1)", 0.0, || {
        let options = GpuOptions { device: Some("no such device".into()), ..GpuOptions::default() };
        match VulkanRenderer::new(options) {
            Err(RenderError::NoVulkan { why }) if why.contains("no Vulkan loader") => skip(&why),
            made => refused(made.map(|_| ()).map_err(|e| e.to_string()), "\"no such device\""),
        }
    }),
];

const SIZE: [u32; 2] = [48, 48];

fn skip(why: &str) -> f64 {
    println!("SKIP 1: {}", why.lines().next().unwrap_or_default());
    0.0
}

/// Runs `value` with a Vulkan renderer, under the validation layer if it is installed.
fn vulkan(options: GpuOptions, value: impl FnOnce(&mut VulkanRenderer) -> f64) -> f64 {
    let checked = VulkanRenderer::new(GpuOptions { validation: true, ..options.clone() });
    match checked.or_else(|_| VulkanRenderer::new(options)) {
        Ok(mut gpu) => value(&mut gpu),
        Err(e) => skip(&e.to_string()),
    }
}

fn draw(renderer: &mut dyn Renderer, stage: &Stage, size: [u32; 2], samples: u32) -> Result<Vec<u8>, String> {
    let snapshot = stage.at(Time::ZERO).map_err(|e| e.to_string())?;
    let resources = Arc::new(SceneResources::new(stage));
    let plan = Plan::new(&resources, stage, &snapshot, &PlanOptions::new(size, samples));
    renderer.load(resources).map_err(|e| e.to_string())?;
    renderer.submit(plan).map_err(|e| e.to_string())?;
    Ok(renderer.collect(None).map_err(|e| e.to_string())?.rgba)
}

/// The 99th percentile of the byte differences between a device without a feature and the CPU renderer's image of a stage changed to do
/// without it. The percentile allows samples on edges to differ.
fn without(ability: Ability, stage: &Stage, samples: u32, change: impl FnOnce(&mut Stage)) -> f64 {
    let options = GpuOptions { without: vec![ability], anisotropy: Some(16.0), ..GpuOptions::default() };
    vulkan(options, |gpu| {
        let mut plain = stage.clone();
        change(&mut plain);
        let (there, here) =
            (draw(gpu, stage, SIZE, samples), draw(&mut CpuRenderer::new(&[]), &plain, SIZE, samples));
        let (Ok(there), Ok(here)) = (there, here) else { return f64::NAN };
        let mut steps: Vec<u8> = there.iter().zip(&here).map(|(a, b)| a.abs_diff(*b)).collect();
        steps.sort_unstable();
        f64::from(steps[steps.len() * 99 / 100])
    })
}
