//! Frames that need several drawings (sub-frames of a shutter, dissolves, floats). Each part is drawn as any frame and read back
//! linear; the host accumulates them and runs the full-screen passes by their CPU functions.

use super::VulkanRenderer;
use super::context;
use crate::cpu::float_frames::{FloatFrameRenderer, float_frame};
use crate::cpu::image_passes;
use crate::cpu::scene_inputs::InputImages;
use crate::effect_faults::EffectFaults;
use crate::error::RenderError;
use crate::plan::Plan;
use crate::plan::dissolve::dissolved;
use crate::plan::motion_blur::Accumulated;
use choreo_plugin::{Effect, FloatFrame, Frame, FrameWish};
use glam::Vec4;
use std::collections::VecDeque;

impl VulkanRenderer {
    /// Whether a plan is kept on the host until it is collected: a frame of several drawings needs all frames in flight, and
    /// plans submitted after it wait, too.
    pub(super) fn waits_on_host(&self, plan: &Plan) -> bool {
        plan.wish != FrameWish::Bytes
            || !plan.subframes.is_empty()
            || plan.dissolve.is_some()
            || self.is_tiled(plan)
            || !self.waiting_plans.is_empty()
    }

    /// Draws the oldest waiting plan. Nothing may be in flight.
    pub(super) fn collect_later(&mut self, plan: Plan, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        dissolved(plan, reuse, |plan, reuse| self.collect_accumulated(plan, reuse))
    }

    fn collect_accumulated(&mut self, plan: Plan, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        if self.is_tiled(&plan) {
            return self.collect_tiled(&plan, reuse);
        }
        if plan.subframes.is_empty() {
            self.submit_now(&plan)?;
            return self.collect_now(reuse);
        }
        let inputs = self.inputs_on_host(&plan)?;
        let [width, height] = plan.size;
        let mut sum = Accumulated::new(width as usize * height as usize);
        let mut before = Vec::with_capacity(plan.history.len());
        let mut waiting: VecDeque<&Plan> = plan.sub_plans().collect();
        let mut done = 0;
        while !waiting.is_empty() || !self.pending.is_empty() {
            while self.pending.len() < self.frames.len()
                && let Some(part) = waiting.pop_front()
            {
                self.submit_now(part)?;
            }
            if done < plan.subframes.len() {
                self.add_oldest(&mut sum)?;
            } else {
                // The sum of one image is the image itself.
                let mut one = Accumulated::new(width as usize * height as usize);
                self.add_oldest(&mut one)?;
                before.push(one.mean());
            }
            done += 1;
        }
        let mut frame = reuse.unwrap_or(Frame { width, height, rgba: Vec::new() });
        (frame.width, frame.height) = (width, height);
        frame.rgba.resize(width as usize * height as usize * 4, 0);
        let passes = image_passes::resolve_passes(&plan.post, plan.size, self.pipelines.effects())?;
        let scene = inputs.effect_inputs(&plan);
        image_passes::run_to_bytes(&passes, scene, sum.mean(), &before, &self.faults, &mut frame.rgba);
        if let Some(layers) = &plan.layers_in_front {
            layers.blend_over(&mut frame);
        }
        Ok(frame)
    }

    /// Waits for the oldest frame in flight, a linear one, and adds it to `sum`.
    fn add_oldest(&mut self, sum: &mut Accumulated) -> Result<(), RenderError> {
        let mapped = self.finish_oldest(8, [0, 0])?;
        let pixel = |bytes: &[u8; 8]| {
            let part = |i: usize| half::f16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]).to_f32();
            Vec4::new(part(0), part(1), part(2), part(3))
        };
        sum.add(mapped.as_chunks::<8>().0.iter().map(pixel));
        self.gpu.check_messages()
    }

    /// Waits for the oldest frame in flight and returns its bytes. `at`: position of its part in the whole image.
    pub(super) fn finish_oldest(
        &mut self,
        bytes_per_pixel: usize,
        at: [u32; 2],
    ) -> Result<&[u8], RenderError> {
        let index = *self.pending.front().ok_or_else(|| {
            RenderError::Usage("no frame is submitted: submit a plan before you collect a frame".into())
        })?;
        self.wait_for(self.frames[index].done_at)?;
        self.pending.pop_front();
        if let Some(clock) = &self.clock {
            clock.read(&self.gpu, index)?;
        }
        self.frames[index].release_staging(&self.gpu);
        if std::mem::take(&mut self.awaits_first_frame) {
            context::give_back_freed_memory();
        }
        let slot = &self.frames[index];
        self.faults.read_device_records(self.pipelines.effects(), slot.fault_records(), at);
        let bytes = slot.size[0] as usize * slot.size[1] as usize * bytes_per_pixel;
        slot.readback.as_ref().and_then(|b| b.mapped().get(..bytes)).ok_or_else(|| RenderError::Vulkan {
            object: "read-back buffer".into(),
            result: "it is not mapped".into(),
        })
    }

    pub(super) fn collect_now(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let mut rgba = reuse.map(|f| f.rgba).unwrap_or_default();
        rgba.clear();
        let index = self.pending.front().copied().unwrap_or_default();
        rgba.extend_from_slice(self.finish_oldest(4, [0, 0])?);
        let layers = self.frames[index].layers_in_front.take();
        let [width, height] = self.frames[index].size;
        self.gpu.check_messages()?;
        let mut frame = Frame { width, height, rgba };
        if let Some(layers) = layers {
            layers.blend_over(&mut frame);
        }
        Ok(frame)
    }
}

impl VulkanRenderer {
    /// Draws the oldest waiting plan, which requests floats. Nothing may be in flight.
    pub(super) fn collect_floats_later(&mut self) -> Result<FloatFrame, RenderError> {
        match self.waiting_plans.pop_front() {
            Some(plan) if self.pending.is_empty() => float_frame(&plan, self),
            _ => Err(RenderError::Usage(
                "no frame of floats is submitted: submit a plan that requests floats before you collect one"
                    .into(),
            )),
        }
    }
}

impl FloatFrameRenderer for VulkanRenderer {
    fn render_linear(&mut self, plan: &Plan) -> Result<Vec<Vec4>, RenderError> {
        if self.is_tiled(plan) {
            return self.linear_tiles(plan);
        }
        self.submit_now(&plan.scene_alone())?;
        let mut one = Accumulated::new(plan.size[0] as usize * plan.size[1] as usize);
        self.add_oldest(&mut one)?;
        Ok(one.mean())
    }

    fn render_inputs(&mut self, plan: &Plan) -> Result<InputImages, RenderError> {
        self.inputs_on_host(plan)
    }

    fn effects(&self) -> &[Effect] {
        self.pipelines.effects()
    }

    fn faults(&self) -> &EffectFaults {
        &self.faults
    }
}
