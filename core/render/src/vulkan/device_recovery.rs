//! A Vulkan renderer that survives its device: lost, out of memory or silent for too long, the frames that were not yet
//! collected are drawn again, once, on a device made afresh that is asked for less. The same plans on the same device give the
//! same bytes, so nobody sees it in the images.

use super::{GpuOptions, VulkanRenderer};
use crate::error::RenderError;
use crate::plan::Plan;
use crate::renderer::{CreatedCounts, DeviceInfo, DeviceUsage, Renderer};
use crate::scene_resources::SceneResources;
use choreo_plugin::{Effect, FloatFrame, Frame};
use std::collections::VecDeque;
use std::sync::Arc;

pub struct SteadyRenderer {
    options: GpuOptions,
    /// `None` only after a device could not be made again.
    inner: Option<VulkanRenderer>,
    info: DeviceInfo,
    frames_in_flight: usize,
    resources: Option<Arc<SceneResources>>,
    /// Submitted and not collected, the oldest first.
    plans: VecDeque<Plan>,
    /// How many of them the inner renderer has.
    inside: usize,
    /// The error of the failed device, until a later frame was collected.
    failed: Option<RenderError>,
    notes: Vec<String>,
}

impl SteadyRenderer {
    pub fn new(options: GpuOptions) -> Result<SteadyRenderer, RenderError> {
        let inner = VulkanRenderer::new(options.clone())?;
        Ok(SteadyRenderer {
            options,
            info: inner.device().clone(),
            frames_in_flight: inner.frames_in_flight(),
            inner: Some(inner),
            resources: None,
            plans: VecDeque::new(),
            inside: 0,
            failed: None,
            notes: Vec::new(),
        })
    }

    fn inner(&mut self) -> Result<&mut VulkanRenderer, RenderError> {
        let name = &self.info.name;
        self.inner
            .as_mut()
            .ok_or_else(|| RenderError::Usage(format!("{name} failed twice and is no longer used")))
    }

    /// Hands plans on as far as the inner renderer takes them.
    fn feed(&mut self) -> Result<(), RenderError> {
        while let Some(plan) = self.plans.get(self.inside) {
            let Some(inner) = &mut self.inner else { return Ok(()) };
            if self.inside >= inner.frames_in_flight() {
                break;
            }
            inner.submit_plan(plan)?;
            self.inside += 1;
        }
        Ok(())
    }

    /// Tries an operation until it succeeds or has failed twice.
    fn steadily<T>(
        &mut self,
        mut what: impl FnMut(&mut SteadyRenderer) -> Result<T, RenderError>,
    ) -> Result<T, RenderError> {
        loop {
            match what(self) {
                Err(error) if is_mishap(&error) => self.start_again(error)?,
                result => return result,
            }
        }
    }

    fn start_again(&mut self, error: RenderError) -> Result<(), RenderError> {
        self.let_go(&error);
        if let Some(first) = self.failed.take() {
            return Err(RenderError::Twice { first: Box::new(first), second: Box::new(error) });
        }
        self.notes.push(format!("{error}; drawn again on a new device, one frame at a time"));
        self.failed = Some(error);
        self.options.frugal = true;
        // The same one: another would draw other bytes.
        self.options.device = Some(self.info.name.clone());
        let mut again = || {
            let inner = VulkanRenderer::new(self.options.clone())?;
            if *inner.device() != self.info {
                let why = format!(
                    "the device {} is no longer available, only {}",
                    self.info.name,
                    inner.device().name
                );
                return Err(RenderError::NoVulkan { why });
            }
            let inner = self.inner.insert(inner);
            self.resources.clone().map_or(Ok(()), |resources| inner.load(resources))
        };
        again().map_err(|second| match self.failed.take() {
            Some(first) => RenderError::Twice { first: Box::new(first), second: Box::new(second) },
            None => second,
        })
    }

    /// The oldest plan is done.
    fn collected(&mut self) {
        self.plans.pop_front();
        self.inside = self.inside.saturating_sub(1);
        self.failed = None;
    }

    fn let_go(&mut self, error: &RenderError) {
        self.inside = 0;
        let Some(inner) = self.inner.take() else { return };
        if matches!(error, RenderError::TimedOut { .. }) {
            // The driver may still be at it, so nothing of it may be freed, and waiting for it could take for ever: it stays
            // until the program ends.
            std::mem::forget(inner);
        }
    }
}

/// Errors after which a new device and fewer frames in flight may succeed.
fn is_mishap(error: &RenderError) -> bool {
    matches!(
        error,
        RenderError::DeviceLost { .. } | RenderError::OutOfMemory { .. } | RenderError::TimedOut { .. }
    )
}

impl Renderer for SteadyRenderer {
    fn device(&self) -> &DeviceInfo {
        &self.info
    }

    fn frames_in_flight(&self) -> usize {
        self.frames_in_flight
    }

    fn load(&mut self, resources: Arc<SceneResources>) -> Result<(), RenderError> {
        self.resources = Some(resources.clone());
        self.steadily(|this| this.inner()?.load(resources.clone()))
    }

    fn submit(&mut self, plan: Plan) -> Result<(), RenderError> {
        if self.plans.len() >= self.frames_in_flight {
            return Err(RenderError::Usage(format!(
                "{} frames are in flight; collect one first",
                self.plans.len()
            )));
        }
        self.plans.push_back(plan);
        let submitted = self.steadily(SteadyRenderer::feed);
        if submitted.is_err() {
            self.plans.pop_back();
            self.inside = self.inside.min(self.plans.len());
        }
        submitted
    }

    fn collect(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let mut reuse = reuse;
        let frame = self.steadily(|this| {
            this.feed()?;
            this.inner()?.collect(reuse.take())
        })?;
        self.collected();
        Ok(frame)
    }

    fn collect_floats(&mut self) -> Result<FloatFrame, RenderError> {
        let frame = self.steadily(|this| {
            this.feed()?;
            this.inner()?.collect_floats()
        })?;
        self.collected();
        Ok(frame)
    }

    fn set_effects(&mut self, effects: &[Effect]) -> Result<(), RenderError> {
        self.options.effects = effects.to_vec();
        // A fresh device gets them from the options.
        self.steadily(|this| this.inner()?.set_effects(effects))
    }

    fn reload_shaders(&mut self) -> Result<(), RenderError> {
        self.steadily(|this| this.inner()?.reload_shaders())
    }

    fn created(&self) -> CreatedCounts {
        self.inner.as_ref().map(Renderer::created).unwrap_or_default()
    }

    fn usage(&self) -> DeviceUsage {
        self.inner.as_ref().map(Renderer::usage).unwrap_or_default()
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = self.inner.as_mut().map(Renderer::take_notes).unwrap_or_default();
        notes.append(&mut self.notes);
        notes
    }
}
