//! Images larger than the device can draw: drawn tile by tile and assembled on the host, which runs the full-screen passes on the
//! whole image, as with sub-frames.

use super::VulkanRenderer;
use crate::cpu::image_passes;
use crate::error::RenderError;
use crate::plan::Plan;
use crate::plan::motion_blur::Accumulated;
use crate::plan::tiles::{Tile, side_of_tiles, tiles};
use choreo_plugin::Frame;
use glam::Vec4;

impl VulkanRenderer {
    /// Longest image side in pixels that is drawn at once.
    pub(super) fn longest_side(&self) -> u32 {
        let limits = self.gpu.limits();
        let viewport = limits.max_viewport_dimensions[0].min(limits.max_viewport_dimensions[1]);
        let image = limits.max_image_dimension2_d.min(viewport);
        image.min(limits.max_framebuffer_width).min(limits.max_framebuffer_height).min(self.longest_side)
    }

    pub(super) fn is_tiled(&self, plan: &Plan) -> bool {
        self.side_of_tiles(plan).is_some()
    }

    pub(super) fn side_of_tiles(&self, plan: &Plan) -> Option<u32> {
        let bends = |p: &Plan| p.scene_color_copy.is_some();
        let whole = bends(plan) || plan.sub_plans().any(bends);
        side_of_tiles(plan.size, self.longest_side(), whole)
    }

    /// Draws a plan for which [`VulkanRenderer::is_tiled`] holds. Nothing may be in flight.
    pub(super) fn collect_tiled(&mut self, plan: &Plan, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let [width, height] = plan.size;
        let count = width as usize * height as usize;
        let mut frame = reuse.unwrap_or(Frame { width, height, rgba: Vec::new() });
        (frame.width, frame.height) = (width, height);
        frame.rgba.resize(4 * count, 0);
        if plan.subframes.is_empty() && plan.post.is_empty() {
            self.draw_tiles::<4>(plan, |at, pixel| frame.rgba[4 * at..4 * at + 4].copy_from_slice(pixel))?;
        } else {
            let alone = [plan];
            let exposed: Vec<&Plan> =
                if plan.subframes.is_empty() { alone.to_vec() } else { plan.subframes.iter().collect() };
            let mut sum = Accumulated::new(count);
            for part in exposed {
                sum.add(self.linear_tiles(part)?.into_iter());
            }
            let before =
                plan.history.iter().map(|part| self.linear_tiles(part)).collect::<Result<Vec<_>, _>>()?;
            let inputs = self.inputs_on_host(plan)?;
            let passes = image_passes::resolve_passes(&plan.post, plan.size, self.pipelines.effects())?;
            let scene = inputs.effect_inputs(plan);
            image_passes::run_to_bytes(&passes, scene, sum.mean(), &before, &self.faults, &mut frame.rgba);
        }
        if let Some(layers) = &plan.layers_in_front {
            layers.blend_over(&mut frame);
        }
        Ok(frame)
    }

    pub(super) fn linear_tiles(&mut self, plan: &Plan) -> Result<Vec<Vec4>, RenderError> {
        let mut pixels = vec![Vec4::ZERO; plan.size[0] as usize * plan.size[1] as usize];
        self.draw_tiles::<8>(&plan.scene_alone(), |at, bytes| {
            let part = |i: usize| half::f16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]).to_f32();
            pixels[at] = Vec4::new(part(0), part(1), part(2), part(3));
        })?;
        Ok(pixels)
    }

    /// Draws all tiles and calls `put` once for each pixel, with its index in the image and its bytes.
    fn draw_tiles<const BYTES: usize>(
        &mut self,
        plan: &Plan,
        mut put: impl FnMut(usize, &[u8; BYTES]),
    ) -> Result<(), RenderError> {
        let side = self.side_of_tiles(plan).unwrap_or(self.longest_side());
        for tile in tiles(plan.size, side) {
            self.submit_now(&plan.tile(tile, &self.scene_resources.clone())?)?;
            let bytes = self.finish_oldest(BYTES, tile.at)?;
            let Tile { at, size, keep } = tile;
            for y in 0..keep[1] {
                let row = &bytes[(y * size[0]) as usize * BYTES..][..size[0] as usize * BYTES];
                let first = (at[1] + y) as usize * plan.size[0] as usize + at[0] as usize;
                let pixels = row.as_chunks::<BYTES>().0.iter().enumerate().take(keep[0] as usize);
                pixels.for_each(|(x, pixel)| put(first + x, pixel));
            }
            self.gpu.check_messages()?;
        }
        Ok(())
    }
}
