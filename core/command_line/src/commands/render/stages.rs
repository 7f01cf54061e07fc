//! `choreo render --stages`: the intermediate results of the CPU renderer, one image per stage.

use crate::args::RenderArgs;
use crate::commands::render;
use crate::drawing::pipeline::{Pixels, render_failure};
use crate::failure::{Failure, output_failure, print_message};
use crate::output::image_files;
use crate::output::provenance;
use crate::output::target::Target;
use crate::scene;
use choreo_files::PartFile;
use choreo_plugin::{Frame, Registry, VideoInfo};
use choreo_render::cpu::{CpuRenderer, STAGE_IMAGE_NAMES};
use choreo_render::layers_2d::{ScreenLabel, compose_layers};
use choreo_render::plan::motion_blur::plan_alone;
use choreo_render::{PlanOptions, Renderer, SceneResources};
use choreo_stage::{Snapshot, Stage};
use glam::{DVec2, Vec4};
use std::path::Path;
use std::sync::Arc;

/// Captions of the stages; the last stage is the frame itself and has no caption.
const STAGE_CAPTIONS: [&str; 5] = [
    "model: each mesh as its file has it, around its own origin",
    "view: the whole scene from above; the camera is at the bottom, its field of view between the gray lines",
    "clip: projected and divided by w; the white frame marks the edges of the image",
    "raster: the nearest triangle at each pixel, one color per triangle",
    "depth: the distance of the nearest triangle; white is nearest",
];

fn draw_caption(image: &mut Frame, text: &str) {
    draw_label(image, text, (image.height as f32 / 26.0).min(image.width as f32 / 46.0));
}

/// Draws a text in the top left corner, `height` pixels high. A text too small to be read is left out.
pub(super) fn draw_label(image: &mut Frame, text: &str, height: f32) {
    let size = [image.width, image.height];
    if height < 7.0 {
        return;
    }
    darken_top_left(
        image,
        [height * (1.2 + 0.58 * text.chars().count() as f32), 1.9 * height].map(|side| side as u32),
    );
    // The text is drawn twice, first as a shadow, so that it can be read on any background.
    for (shift, color) in [(1.0 + height / 16.0, Vec4::new(0.0, 0.0, 0.0, 1.0)), (0.0, Vec4::ONE)] {
        let at = DVec2::new(f64::from(shift), f64::from(height + shift))
            / DVec2::new(size[0].into(), size[1].into());
        let label = ScreenLabel { at, text: text.into(), size: height, beside: 0.6 * height, color };
        let [_, text_layer] = compose_layers(&Stage::default(), &Snapshot::default(), &[label], size);
        if let Some(text_layer) = text_layer {
            text_layer.blend_over(image);
        }
    }
}

/// Darkens a rectangle in the top left corner, as the background of a text.
fn darken_top_left(image: &mut Frame, [width, height]: [u32; 2]) {
    let [width, height] = [width.min(image.width), height.min(image.height)].map(|side| side as usize);
    let row_bytes = 4 * image.width as usize;
    for row in image.rgba.chunks_exact_mut(row_bytes).take(height) {
        for pixel in row.as_chunks_mut::<4>().0.iter_mut().take(width) {
            pixel[..3].iter_mut().for_each(|channel| *channel /= 3);
        }
    }
}

/// Writes the images `1_model.png` to `6_shade.png` to the folder `-o`, at the time `--at`, or else at the first frame.
pub(super) fn run(args: &RenderArgs, plugins: &Registry) -> Result<(), Failure> {
    let folder = Path::new(&args.output);
    if folder.extension().is_some() {
        let text = format!(
            "--stages writes one image per stage into a folder, but -o names a file: {}",
            args.output
        );
        return Err(Failure::Usage(text));
    }
    let file = |number: usize, name: &str| folder.join(format!("{number}_{name}.png"));
    let last = file(STAGE_IMAGE_NAMES.len(), STAGE_IMAGE_NAMES[STAGE_IMAGE_NAMES.len() - 1]);
    let target = Target::parse(&last.to_string_lossy())?;
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let args = RenderArgs { at: args.at.clone().or_else(|| Some("0".into())), ..args.clone() };
    let job = render::prepare_job(&args, target, &registry, None)?;
    for (number, name) in (1..).zip(STAGE_IMAGE_NAMES) {
        job.scene.inputs.check_output(&file(number, name))?;
    }
    let effects = job.scene.registry.effects();
    let mut renderer = CpuRenderer::new(effects);
    // One sample per pixel: the images show which pixels a triangle covers.
    let samples = job.samples.unwrap_or(1);
    let time = job.frames.first().map(|(_, time)| *time).unwrap_or_default();
    let snapshot = job.scene.stage.at(time).map_err(|e| Failure::input(e.to_string()))?;
    let resources = Arc::new(SceneResources::new(&job.scene.stage));
    let options = PlanOptions { effects, ..PlanOptions::new(job.settings.size, samples) };
    let stage = &job.scene.stage;
    let plan = plan_alone(&resources, stage, &snapshot, &options, |at| stage.at(at))
        .map_err(|e| Failure::input(e.to_string()))?;
    renderer.load(resources).map_err(render_failure)?;
    let mut images = renderer.draw_stage_images(&plan).map_err(render_failure)?;
    let captioned = images.iter_mut().zip(STAGE_CAPTIONS).enumerate();
    captioned.for_each(|(i, (image, text))| draw_caption(image, &format!("{}  {text}", i + 1)));
    std::fs::create_dir_all(folder).map_err(|e| output_failure(&args.output, &e))?;
    let info = VideoInfo {
        width: job.settings.size[0],
        height: job.settings.size[1],
        fps: job.settings.fps,
        frames: 1,
        provenance: provenance::of_render(
            &job.scene,
            &job.settings,
            samples,
            &job.options,
            renderer.device(),
        ),
        options: job.options.clone(),
    };
    for (number, (name, image)) in (1..).zip(STAGE_IMAGE_NAMES.iter().zip(&images)) {
        let path = file(number, name);
        image_files::write_image_to(
            &path,
            PartFile::create(&path),
            &*job.exporter,
            &info,
            &Pixels::Bytes(image.clone()),
        )?;
        if !args.quiet {
            print_message(path.display());
        }
    }
    Ok(())
}
