//! Images of a stage, and reference images of it with many more samples.

use choreo_motion::Time;
use choreo_plugin::{Effect, Frame};
use choreo_render::scene_resources::mipmap::{linear_to_srgb8, srgb_to_linear_table};
use choreo_render::{CpuRenderer, Plan, PlanOptions, RenderError, Renderer, SceneResources};
use choreo_stage::{Snapshot, Stage, StageError};
use std::sync::Arc;

/// Pixels of the reference per side of a pixel of the image, each with four samples: 64 samples per pixel.
pub(crate) const REFERENCE_SCALE: u32 = 4;

/// One moment of a stage, ready to be drawn in any size.
pub struct Moment {
    pub stage: Arc<Stage>,
    pub snapshot: Snapshot,
    pub resources: Arc<SceneResources>,
    pub effects: Vec<Effect>,
}

impl Moment {
    pub fn new(stage: &Arc<Stage>, at: Time, effects: &[Effect]) -> Result<Moment, StageError> {
        let resources = Arc::new(SceneResources::new(stage));
        Ok(Moment { snapshot: stage.at(at)?, stage: stage.clone(), resources, effects: effects.to_vec() })
    }

    pub fn plan(&self, size: [u32; 2], samples: u32) -> Plan {
        let options = PlanOptions { effects: &self.effects, ..PlanOptions::new(size, samples) };
        Plan::new(&self.resources, &self.stage, &self.snapshot, &options)
    }

    /// Draws a frame with a renderer that has loaded the scene resources.
    pub fn draw(
        &self,
        renderer: &mut dyn Renderer,
        size: [u32; 2],
        samples: u32,
    ) -> Result<Frame, RenderError> {
        renderer.submit(self.plan(size, samples))?;
        renderer.collect(None)
    }

    /// Reference image with 64 samples per pixel, textures included: the CPU renderer draws it at four times the size with four samples,
    /// and the result is averaged in linear light.
    pub fn supersampled(&self, size: [u32; 2]) -> Result<Frame, RenderError> {
        let mut renderer = CpuRenderer::new(&self.effects);
        renderer.load(self.resources.clone())?;
        let large = self.draw(&mut renderer, size.map(|n| n * REFERENCE_SCALE), 4)?;
        Ok(averaged(&large, REFERENCE_SCALE))
    }
}

/// Averages each square of `step` pixels to one pixel, in linear light. The sides are multiples of the step.
pub fn averaged(frame: &Frame, step: u32) -> Frame {
    let linear = srgb_to_linear_table();
    let (width, height) = (frame.width / step, frame.height / step);
    let mut rgba = Vec::with_capacity((width * height * 4) as usize);
    let share = 1.0 / f64::from(step * step);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0f64; 4];
            for dy in 0..step {
                let row = ((y * step + dy) * frame.width + x * step) as usize * 4;
                for p in frame.rgba[row..row + step as usize * 4].as_chunks::<4>().0 {
                    for (sum, code) in sum.iter_mut().zip(&p[..3]) {
                        *sum += f64::from(linear[usize::from(*code)]);
                    }
                    sum[3] += f64::from(p[3]);
                }
            }
            rgba.extend(sum[..3].iter().map(|s| linear_to_srgb8((s * share) as f32)));
            rgba.push((sum[3] * share + 0.5) as u8);
        }
    }
    Frame { width, height, rgba }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_averaged_in_linear_light() {
        // Black and white halves: half of the light is code 188.
        let rgba = [[0u8, 0, 0, 255], [255; 4], [255; 4], [0, 0, 0, 255]].concat();
        let small = averaged(&Frame { width: 2, height: 2, rgba }, 2);
        assert_eq!(small.rgba, [188, 188, 188, 255]);
    }
}
