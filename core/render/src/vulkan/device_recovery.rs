//! Device-loss recovery: a Vulkan renderer that survives the failure of its device. If the device is lost, out of memory or silent for too long, the
//! frames that were not yet collected are drawn again, once, on a newly created device with reduced demands. The same plans on
//! the same device give the same bytes, so the images do not show it.

use super::{GpuOptions, VulkanRenderer};
use crate::error::RenderError;
use crate::plan::Plan;
use crate::renderer::{CreatedCounts, DeviceInfo, DeviceUsage, Renderer};
use crate::scene_resources::SceneResources;
use choreo_plugin::{Effect, FloatFrame, Frame};
use std::collections::VecDeque;
use std::sync::Arc;

pub struct RecoveringRenderer {
    options: GpuOptions,
    /// `None` only after a device could not be created again.
    inner: Option<VulkanRenderer>,
    info: DeviceInfo,
    frames_in_flight: usize,
    resources: Option<Arc<SceneResources>>,
    /// Plans submitted and not yet collected, the oldest first.
    plans: VecDeque<Plan>,
    /// Number of these plans that the inner renderer has received.
    submitted_to_inner: usize,
    /// The error of the failed device, until a later frame is collected.
    failed: Option<RenderError>,
    notes: Vec<String>,
}

impl RecoveringRenderer {
    pub fn new(options: GpuOptions) -> Result<RecoveringRenderer, RenderError> {
        let inner = VulkanRenderer::new(options.clone())?;
        Ok(RecoveringRenderer {
            options,
            info: inner.device().clone(),
            frames_in_flight: inner.frames_in_flight(),
            inner: Some(inner),
            resources: None,
            plans: VecDeque::new(),
            submitted_to_inner: 0,
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

    /// Submits plans to the inner renderer, as many as it accepts.
    fn submit_waiting_plans(&mut self) -> Result<(), RenderError> {
        while let Some(plan) = self.plans.get(self.submitted_to_inner) {
            let Some(inner) = &mut self.inner else { return Ok(()) };
            if self.submitted_to_inner >= inner.frames_in_flight() {
                break;
            }
            inner.submit_plan(plan)?;
            self.submitted_to_inner += 1;
        }
        Ok(())
    }

    /// Repeats an operation until it succeeds or has failed twice.
    fn retry_once<T>(
        &mut self,
        mut operation: impl FnMut(&mut RecoveringRenderer) -> Result<T, RenderError>,
    ) -> Result<T, RenderError> {
        loop {
            match operation(self) {
                Err(error) if is_recoverable(&error) => self.recreate_device(error)?,
                result => return result,
            }
        }
    }

    fn recreate_device(&mut self, error: RenderError) -> Result<(), RenderError> {
        self.drop_device(&error);
        if let Some(first) = self.failed.take() {
            return Err(RenderError::FailedTwice { first: Box::new(first), second: Box::new(error) });
        }
        self.notes.push(format!("{error}; drawn again on a new device, one frame at a time"));
        self.failed = Some(error);
        self.options.frugal = true;
        // The same device as before: another would draw different bytes.
        self.options.device = Some(self.info.name.clone());
        let mut recreate = || {
            let inner = VulkanRenderer::new(self.options.clone())?;
            if *inner.device() != self.info {
                let why = format!(
                    "the device {} is no longer available; the driver offers {} instead",
                    self.info.name,
                    inner.device().name
                );
                return Err(RenderError::NoVulkan { why });
            }
            let inner = self.inner.insert(inner);
            self.resources.clone().map_or(Ok(()), |resources| inner.load(resources))
        };
        recreate().map_err(|second| match self.failed.take() {
            Some(first) => RenderError::FailedTwice { first: Box::new(first), second: Box::new(second) },
            None => second,
        })
    }

    /// Removes the oldest plan, which has been collected.
    fn remove_oldest_plan(&mut self) {
        self.plans.pop_front();
        self.submitted_to_inner = self.submitted_to_inner.saturating_sub(1);
        self.failed = None;
    }

    fn drop_device(&mut self, error: &RenderError) {
        self.submitted_to_inner = 0;
        let Some(inner) = self.inner.take() else { return };
        if matches!(error, RenderError::TimedOut { .. }) {
            // The driver may still use its objects, so they must not be freed, and waiting for it could hang. The renderer is
            // leaked until the program ends.
            std::mem::forget(inner);
        }
    }
}

/// Errors after which a new device and fewer frames in flight may succeed.
fn is_recoverable(error: &RenderError) -> bool {
    matches!(
        error,
        RenderError::DeviceLost { .. } | RenderError::OutOfMemory { .. } | RenderError::TimedOut { .. }
    )
}

impl Renderer for RecoveringRenderer {
    fn device(&self) -> &DeviceInfo {
        &self.info
    }

    fn frames_in_flight(&self) -> usize {
        self.frames_in_flight
    }

    fn load(&mut self, resources: Arc<SceneResources>) -> Result<(), RenderError> {
        self.resources = Some(resources.clone());
        self.retry_once(|this| this.inner()?.load(resources.clone()))
    }

    fn submit(&mut self, plan: Plan) -> Result<(), RenderError> {
        if self.plans.len() >= self.frames_in_flight {
            return Err(RenderError::Usage(format!(
                "{} frames are in flight; collect one first",
                self.plans.len()
            )));
        }
        self.plans.push_back(plan);
        let submitted = self.retry_once(RecoveringRenderer::submit_waiting_plans);
        if submitted.is_err() {
            self.plans.pop_back();
            self.submitted_to_inner = self.submitted_to_inner.min(self.plans.len());
        }
        submitted
    }

    fn collect(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let mut reuse = reuse;
        let frame = self.retry_once(|this| {
            this.submit_waiting_plans()?;
            this.inner()?.collect(reuse.take())
        })?;
        self.remove_oldest_plan();
        Ok(frame)
    }

    fn collect_floats(&mut self) -> Result<FloatFrame, RenderError> {
        let frame = self.retry_once(|this| {
            this.submit_waiting_plans()?;
            this.inner()?.collect_floats()
        })?;
        self.remove_oldest_plan();
        Ok(frame)
    }

    fn set_effects(&mut self, effects: &[Effect]) -> Result<(), RenderError> {
        self.options.effects = effects.to_vec();
        // A new device gets the effects from the options.
        self.retry_once(|this| this.inner()?.set_effects(effects))
    }

    fn reload_shaders(&mut self) -> Result<(), RenderError> {
        self.retry_once(|this| this.inner()?.reload_shaders())
    }

    fn created_counts(&self) -> CreatedCounts {
        self.inner.as_ref().map(Renderer::created_counts).unwrap_or_default()
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
