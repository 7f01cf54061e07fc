//! Full-screen passes over a whole image: effects that read neighboring pixels, and per-pixel effects between them.

use super::scene_inputs::EffectInputs;
use super::target::{LinearFloat, OutputPixel, Target};
use crate::effect_faults::EffectFaults;
use crate::error::RenderError;
use crate::plan::PostPass;
use choreo_plugin::{Effect, EffectImage, EffectImages};
use glam::{Vec2, Vec4};
use rayon::prelude::*;

pub struct ImagePass {
    pub effect: Effect,
    pub parameters: Vec<f32>,
    /// Index of the pass among the passes of its effect.
    pub number: u32,
    /// Size of the output in pixels.
    pub size: [u32; 2],
    /// Whether the pass writes a texture for later passes of its effect instead of the image.
    pub makes_texture: bool,
}

/// Resolves the passes of a plan: looks up the effects that they name.
pub fn resolve_passes(
    post: &[PostPass],
    size: [u32; 2],
    effects: &[Effect],
) -> Result<Vec<ImagePass>, RenderError> {
    let pass = |pass: &PostPass| {
        let effect = find_effect(effects, &pass.effect)?.clone();
        let size = pass.size(size);
        let (parameters, makes_texture) = (pass.parameters.clone(), pass.texture.is_some());
        Ok(ImagePass { effect, parameters, number: pass.number, size, makes_texture })
    };
    post.iter().map(pass).collect()
}

pub fn find_effect<'a>(effects: &'a [Effect], name: &str) -> Result<&'a Effect, RenderError> {
    effects.iter().find(|e| e.manifest().name == name).ok_or_else(|| {
        let help = "pass it when you create the renderer, or to set_effects";
        RenderError::Usage(format!("the renderer has no effect \"{name}\": {help}"))
    })
}

/// Centers of the pixels of a row, 0 to 1 from the top left of an image.
pub(crate) fn pixel_uv([x, y]: [i32; 2], count: usize, size: [u32; 2]) -> Vec<Vec2> {
    let size = Vec2::new(size[0] as f32, size[1] as f32);
    (x..x + count as i32).map(|x| (Vec2::new(x as f32, y as f32) + 0.5) / size).collect()
}

/// Runs the passes as [`run_linear`] does, and writes the dithered image as bytes.
pub(crate) fn run_to_bytes(
    passes: &[ImagePass],
    scene: EffectInputs<'_>,
    pixels: Vec<Vec4>,
    before: &[Vec<Vec4>],
    faults: &EffectFaults,
    bytes: &mut [u8],
) {
    let width = scene.size[0].max(1) as usize;
    let image = run_linear(passes, scene, pixels, before, faults);
    let rows = bytes.par_chunks_mut(4 * width).zip(image.par_chunks(width)).enumerate();
    rows.for_each(|(y, (bytes, row))| {
        for ((out, color), x) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(row).zip(0..) {
            *out = <[u8; 4]>::from_color(*color, [x, y]);
        }
    });
}

/// Runs the passes and returns the image of the last one. `scene`: the inputs that effects read; `pixels`: the rendered scene,
/// linear; `before`: images of previous frames.
pub(crate) fn run_linear(
    passes: &[ImagePass],
    scene: EffectInputs<'_>,
    pixels: Vec<Vec4>,
    before: &[Vec<Vec4>],
    faults: &EffectFaults,
) -> Vec<Vec4> {
    let (size, rows) = (scene.size, scene.frame.rows());
    let scene = Some(scene.images(&rows));
    let before: Vec<EffectImage> = before.iter().map(|rgba| EffectImage { size, rgba }).collect();
    let (mut pixels, mut current_size) = (pixels, size);
    let mut original = Vec::new();
    // Textures of the passes of an effect by their number, each with its size.
    let mut textures: Vec<Option<(Vec<Vec4>, [u32; 2])>> = Vec::new();
    for pass in passes {
        let has_textures = !pass.effect.named_passes().is_empty();
        if pass.number == 0 && pass.effect.passes() > 1 && !has_textures {
            original.clone_from(&pixels);
        }
        let image = EffectImage { size: current_size, rgba: &pixels };
        let is_first = pass.number == 0 || has_textures;
        let first = EffectImage { size, rgba: if is_first { &pixels } else { &original } };
        let earlier: Vec<Option<EffectImage>> = textures
            .iter()
            .map(|texture| texture.as_ref().map(|(rgba, size)| EffectImage { size: *size, rgba }))
            .collect();
        let images = EffectImages { now: image, original: first, passes: &earlier, before: &before, scene };
        let [width, height] = pass.size.map(|s| s as usize);
        let mut next = vec![Vec4::ZERO; width * height];
        next.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            match &pass.effect {
                Effect::Image(effect) => {
                    effect.image_row(&images, y as u32, pass.number, &pass.parameters, row);
                }
                Effect::Pixel(effect) => {
                    let start = y.min(current_size[1] as usize - 1) * current_size[0] as usize;
                    row.copy_from_slice(&pixels[start..start + width]);
                    effect.pixels(row, &pixel_uv([0, y as i32], width, size), &pass.parameters);
                }
                _ => return,
            }
            faults.replace_faulty_colors(&pass.effect, row, |x| [x as i32, y as i32]);
            row.iter_mut().for_each(|color| *color = LinearFloat::encode(*color).decode());
        });
        if pass.makes_texture {
            textures.resize(pass.number as usize, None);
            textures.push(Some((next, pass.size)));
        } else {
            textures.clear();
            (pixels, current_size) = (next, pass.size);
        }
    }
    pixels
}
