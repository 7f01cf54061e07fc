//! The Vulkan renderer: executes recordings on a Vulkan 1.3 device, without a window.
//!
//! Design decisions: one queue, and one primary command buffer per frame. Frames in flight share their targets, since the queue
//! runs them in order anyway. Each frame has a mapped buffer of its own for all data that the host writes. Resources are created
//! when a frame first draws them and kept by content; `load` waits for the device. Failed operations are not repeated here:
//! `device_recovery` repeats them on a new device with reduced demands.

mod accumulate;
mod cache;
mod clock;
mod context;
pub mod deferred;
mod descriptors;
mod device_features;
mod device_recovery;
mod effect_textures;
mod error;
mod execute;
pub mod faults;
mod frame_data;
mod frame_in_flight;
mod memory;
mod options;
mod peel;
mod pipeline_ids;
mod pipelines;
pub(crate) mod preskin;
mod resources;
mod sampled_image;
mod scene_color_copy;
pub(crate) mod scene_inputs;
mod shadow;
mod sky;
mod split_uploads;
mod state;
mod streams;
mod targets;
mod texture_budget;
mod tiled;
mod upload;

use crate::commands::{Command, RecordOptions, Recording, record, texture_slots};
use crate::effect_faults::EffectFaults;
use crate::error::RenderError;
use crate::plan::Plan;
use crate::renderer::{CreatedCounts, DeviceInfo, DeviceKind, DeviceUsage, Renderer};
use crate::scene_resources::SceneResources;
use crate::shader::ShaderSources;
use ash::vk;
use choreo_plugin::{Effect, FloatFrame, Frame};
use choreo_stage::Background;
pub use clock::DeviceTime;
use context::{Context, ContextOptions};
pub use context::{chosen_device, limit_software_threads};
use descriptors::{Layouts, Pools};
pub use device_features::Ability;
pub use device_recovery::RecoveringRenderer;
use error::Named;
use execute::Execution;
use faults::FaultPlace;
use frame_in_flight::FrameInFlight;
use memory::Buffer;
pub use options::GpuOptions;
use options::frames_in_flight;
use pipelines::Pipelines;
use resources::Resources;
use std::collections::VecDeque;
use std::sync::Arc;
use targets::{FrameImages, TargetNeeds, Targets};
use upload::Uploads;

/// Time after which a frame is given up, so that a hanging driver does not hang the program. Five minutes: a driver on a busy CPU
/// takes seconds for a large frame, and GPU drivers give up by themselves after some seconds.
pub(crate) const TIMEOUT_SECS: u64 = 300;

/// Largest upload of a frugal renderer in bytes.
const MAX_FRUGAL_UPLOAD_BYTES: usize = 8 << 20;

pub struct VulkanRenderer {
    gpu: Context,
    layouts: Layouts,
    pools: Pools,
    pipelines: Pipelines,
    resources: Resources,
    targets: Option<Targets>,
    /// Textures of effects.
    texels: Option<Buffer>,
    frames: Vec<FrameInFlight>,
    /// Indices into `frames`, the oldest first.
    pending: VecDeque<usize>,
    /// Plans submitted after those, and drawn when they are collected; the oldest first.
    waiting_plans: VecDeque<Plan>,
    timeline: vk::Semaphore,
    submitted: u64,
    scene_resources: Arc<SceneResources>,
    last_recorded: Option<Recording>,
    /// Whether no frame of these scene resources was collected yet: their uploads and pipelines still leave freed memory behind.
    awaits_first_frame: bool,
    frugal: bool,
    /// Messages for the user about textures and features that were left out.
    notes: Vec<String>,
    faults: EffectFaults,
    texture_limit: Option<u32>,
    /// Whether the user was informed that forward shading replaces the requested deferred shading.
    noted_forward_shading: bool,
    clock: Option<clock::Clock>,
    longest_side: u32,
}

impl VulkanRenderer {
    pub fn new(options: GpuOptions) -> Result<VulkanRenderer, RenderError> {
        let gpu = Context::new(&ContextOptions {
            validation: options.validation,
            device: options.device.as_deref(),
            instance_extensions: &options.instance_extensions,
            device_extensions: &options.device_extensions,
            frugal: options.frugal,
            faults: options.faults,
            without: &options.without,
            storage_range: options.storage_range,
        })?;
        let calls = gpu.lock_for_calls();
        let mut layouts = Layouts::new(&gpu)?;
        let cache_dir = options.cache_dir.as_deref();
        let pipelines = ShaderSources::read(options.shader_dir)
            .and_then(|sources| Pipelines::new(&gpu, &layouts, cache_dir, sources, options.effects));
        let pipelines = match pipelines {
            Ok(pipelines) => pipelines,
            Err(e) => {
                layouts.destroy(&gpu);
                return Err(e);
            }
        };
        let usual = if gpu.info.kind == DeviceKind::VulkanGpu { 16.0 } else { 1.0 };
        let mut resources = Resources::default();
        resources.anisotropy = options.anisotropy.unwrap_or(usual);
        // Dropping the renderer after an error destroys its device, which takes the write lock, so the read lock is released
        // first.
        drop(calls);
        let mut renderer = VulkanRenderer {
            gpu,
            layouts,
            pools: Pools::default(),
            pipelines,
            resources,
            targets: None,
            texels: None,
            frames: Vec::new(),
            pending: VecDeque::new(),
            waiting_plans: VecDeque::new(),
            timeline: vk::Semaphore::null(),
            submitted: 0,
            scene_resources: Arc::default(),
            last_recorded: None,
            awaits_first_frame: true,
            notes: Vec::new(),
            faults: EffectFaults::default(),
            texture_limit: options.textures,
            noted_forward_shading: false,
            clock: None,
            longest_side: options.longest_side.unwrap_or(u32::MAX).max(1),
            frugal: options.frugal,
        };
        // `drop` frees everything from here on.
        let _calls = renderer.gpu.lock_for_calls();
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive and has the feature; destroyed by `drop`.
        renderer.timeline =
            unsafe { renderer.gpu.device.create_semaphore(&info, None) }.named("frame timeline")?;
        renderer.gpu.set_name(renderer.timeline, "frame timeline");
        for _ in 0..frames_in_flight(renderer.gpu.info.kind, options.frugal) {
            let slot = FrameInFlight::new(&renderer.gpu, &renderer.layouts, &mut renderer.pools)?;
            renderer.frames.push(slot);
        }
        let slots = renderer.frames.len() as u32;
        renderer.clock = clock::Clock::new(&renderer.gpu, options.device_time, slots)?;
        renderer.gpu.check_messages()?;
        Ok(renderer)
    }

    /// The recording of the frame submitted last.
    pub fn last_recording(&self) -> Option<&Recording> {
        self.last_recorded.as_ref()
    }

    /// Number of pipelines that exist.
    pub fn pipeline_count(&self) -> usize {
        self.pipelines.count()
    }

    /// Numbers of meshes, textures and materials on the device.
    pub fn resource_counts(&self) -> [usize; 3] {
        self.resources.counts()
    }

    /// Validation messages. They outlive the renderer, so that messages during its destruction can be read.
    pub fn validation_messages(&self) -> Arc<std::sync::Mutex<Vec<String>>> {
        self.gpu.messages.clone()
    }

    /// Bytes of device memory in use, by the allocator's sum.
    pub fn allocated_bytes(&self) -> u64 {
        self.gpu.allocator().generate_report().total_allocated_bytes
    }

    fn wait_idle(&self) -> Result<(), RenderError> {
        self.wait_for(self.submitted)
    }

    fn wait_for(&self, value: u64) -> Result<(), RenderError> {
        let (semaphores, values) = ([self.timeline], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        self.gpu.inject_fault(FaultPlace::Wait).named(&format!("frame {value}"))?;
        // SAFETY: the semaphore is alive.
        unsafe { self.gpu.device.wait_semaphores(&info, TIMEOUT_SECS * 1_000_000_000) }
            .named(&format!("frame {value}"))
    }

    fn check_plan(&self, plan: &Plan) -> Result<(), RenderError> {
        let limit = self.longest_side().max(crate::plan::tiles::MAX_TILED_SIDE);
        for (what, value) in [("image width", plan.size[0]), ("image height", plan.size[1])] {
            if value == 0 {
                return Err(RenderError::Usage(format!("the {what} is 0")));
            }
            if value > limit {
                let (value, limit) = (value as u64, limit as u64);
                return Err(RenderError::Limit { what: what.into(), value, limit });
            }
        }
        let counts = self.gpu.limits().framebuffer_color_sample_counts
            & self.gpu.limits().framebuffer_depth_sample_counts;
        if !plan.samples.is_power_of_two() || !counts.contains(vk::SampleCountFlags::from_raw(plan.samples)) {
            let what = "number of samples".into();
            return Err(RenderError::Limit { what, value: plan.samples as u64, limit: 4 });
        }
        crate::plan::light_clusters::check(plan)
    }

    fn free_frame_index(&self) -> Option<usize> {
        (0..self.frames.len()).find(|s| !self.pending.contains(s))
    }

    fn has_targets(&self, recording: &Recording) -> bool {
        self.targets.as_ref().is_some_and(|targets| targets.needs == TargetNeeds::of(recording))
    }

    fn prepare_targets(&mut self, plan: &Plan, recording: &Recording) -> Result<(), RenderError> {
        if !self.has_targets(recording) {
            self.wait_idle()?;
            if let Some(mut old) = self.targets.take() {
                old.destroy(&self.gpu);
            }
            self.targets = Some(Targets::new(&self.gpu, TargetNeeds::of(recording))?);
        }
        let copied = recording.commands.contains(&Command::CopyBackground);
        let (top, bottom) = match plan.background {
            Background::Gradient { top, bottom } => (top.extend(1.0), bottom.extend(1.0)),
            Background::Color(color) => (color, color),
        };
        if copied && self.targets.as_ref().is_some_and(|t| !t.has_background(top, bottom)) {
            // The frames in flight share the background rows, so a gradient that changes over time waits for them.
            self.wait_idle()?;
            if let Some(targets) = &mut self.targets {
                targets.set_background(&self.gpu, top, bottom)?;
            }
        }
        Ok(())
    }

    /// Executes a recording into the slot's command buffer.
    fn record_commands(
        &mut self,
        index: usize,
        recording: &Recording,
        ids: &[Option<pipelines::PipelineId>],
        uploads: Uploads,
    ) -> Result<(), RenderError> {
        let gpu = &self.gpu;
        let frame = &mut self.frames[index];
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the slot's last frame is done, so its commands are not pending.
        unsafe {
            gpu.device
                .reset_command_pool(frame.pool, vk::CommandPoolResetFlags::empty())
                .named("command pool")?;
            gpu.device.begin_command_buffer(frame.commands, &begin).named("frame commands")?;
        }
        if let Some(clock) = &self.clock {
            clock.begin(gpu, frame.commands, index);
        }
        if !uploads.is_empty() {
            frame.staging = Some(uploads.record(gpu, frame.commands)?);
        }
        let frame = &self.frames[index];
        let Some(targets) = &self.targets else {
            return Err(RenderError::Usage("targets were not prepared".into()));
        };
        let execution = Execution {
            gpu,
            layouts: &self.layouts,
            scene_resources: &self.scene_resources,
            resources: &self.resources,
            pipelines: &self.pipelines,
            targets,
            frame,
            draws_shadows: recording.commands.iter().any(|c| matches!(c, Command::BeginShadows { .. })),
        };
        execution.run(recording, ids)?;
        if let Some(clock) = &self.clock {
            clock.end(gpu, frame.commands, index);
        }
        // SAFETY: recording was begun above.
        unsafe { gpu.device.end_command_buffer(frame.commands) }.named("frame commands")
    }

    fn submit_frame(&mut self, index: usize) -> Result<(), RenderError> {
        self.submit_commands(index)?;
        self.frames[index].done_at = self.submitted;
        self.pending.push_back(index);
        Ok(())
    }

    /// Submits the slot's commands to the queue.
    fn submit_commands(&mut self, index: usize) -> Result<(), RenderError> {
        let value = self.submitted + 1;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.frames[index].commands)];
        let signals = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.timeline)
            .value(value)
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let submit =
            [vk::SubmitInfo2::default().command_buffer_infos(&commands).signal_semaphore_infos(&signals)];
        self.gpu.inject_fault(FaultPlace::Submit).named(&format!("frame {value}"))?;
        // SAFETY: queue and semaphore belong to the device; only this renderer submits to the queue.
        unsafe { self.gpu.device.queue_submit2(self.gpu.queue, &submit, vk::Fence::null()) }
            .named(&format!("frame {value}"))?;
        self.submitted = value;
        Ok(())
    }

    /// Like [`Renderer::submit`], without taking the plan.
    pub fn submit_plan(&mut self, plan: &Plan) -> Result<(), RenderError> {
        let _calls = self.gpu.lock_for_calls();
        if self.pending.len() + self.waiting_plans.len() >= self.frames.len() {
            let text = format!("{} frames are in flight; collect one first", self.frames.len());
            return Err(RenderError::Usage(text));
        }
        plan.record_faults(&self.faults);
        if self.waits_on_host(plan) {
            self.check_plan(plan)?;
            plan.sub_plans().try_for_each(|part| self.check_plan(part))?;
            self.waiting_plans.push_back(plan.clone());
            return Ok(());
        }
        self.submit_now(plan)
    }

    fn submit_now(&mut self, plan: &Plan) -> Result<(), RenderError> {
        let index = self.free_frame_index().ok_or_else(|| {
            RenderError::Usage(format!("{} frames are in flight; collect one first", self.frames.len()))
        })?;
        self.check_plan(plan)?;
        let maps = shadow::maps_of(plan, &self.scene_resources);
        let mut options =
            RecordOptions { kept_maps: self.kept_maps(plan, &maps), ..self.record_options(plan) };
        let entry = |primitive: u32| self.scene_resources.primitives.get(primitive as usize);
        let triangles = |primitive| entry(primitive).map_or(0, |p| p.primitive().indices.len() / 3);
        let mut recording = record(plan, options, triangles);
        if !self.can_preskin(&recording) {
            options.no_compute = true;
            recording = record(plan, options, triangles);
        }
        if options.kept_maps != 0 && !self.has_targets(&recording) {
            // New targets hold no shadow maps from before.
            recording = record(plan, RecordOptions { kept_maps: 0, ..options }, triangles);
        }
        let ids = pipelines::ids(&recording);
        self.prepare_targets(plan, &recording)?;
        self.prepare_texels(&recording)?;
        self.layouts.prepare_gbuffer_layout(&self.gpu, &recording)?;
        for command in &recording.commands {
            if let Command::BindPipeline(variant) = command {
                self.layouts.prepare_material(&self.gpu, texture_slots(variant.key.features))?;
            }
        }
        self.pipelines.prepare(&self.gpu, &self.layouts, &ids)?;
        if let Err(e) = self.upload_and_queue(index, plan, &recording, &ids) {
            // The uploads were not executed: the resources are dropped, so that the next frame creates them again.
            self.wait_idle()?;
            self.resources.forget(&self.gpu);
            self.frames[index].forget_layers_2d(&self.gpu);
            self.frames[index].release_staging(&self.gpu);
            return Err(e);
        }
        if let Some(targets) = &mut self.targets {
            targets.shadow_maps = maps;
        }
        self.last_recorded = Some(recording);
        if let Err(e) = self.gpu.check_messages() {
            // An error means that the frame was not submitted.
            self.wait_idle()?;
            self.pending.pop_back();
            return Err(e);
        }
        Ok(())
    }

    /// Uploads what the recording refers to, writes the frame's buffers, records the commands and queues them.
    fn upload_and_queue(
        &mut self,
        index: usize,
        plan: &Plan,
        recording: &Recording,
        ids: &[Option<pipelines::PipelineId>],
    ) -> Result<(), RenderError> {
        let mut uploads = Uploads::default();
        let (gpu, layouts, pools) = (&self.gpu, &self.layouts, &mut self.pools);
        let (scene_resources, slot) = (&*self.scene_resources, &mut self.frames[index]);
        self.resources.prepare(gpu, layouts, scene_resources, recording, &mut uploads)?;
        slot.prepare_layers_2d(gpu, plan, &mut uploads)?;
        slot.preskin.prepare(gpu, layouts, pools, (scene_resources, &self.resources), plan, recording)?;
        let seen = self.targets.as_ref().map(Targets::shader_images).unwrap_or_default();
        let (sky, texels) = (self.resources.sky.as_ref(), self.texels.as_ref());
        let images = FrameImages { sky, texels, faults: self.pipelines.fault_buffer_bytes(), ..seen };
        slot.write(gpu, layouts, pools, plan, recording, images)?;
        slot.write_override_sets(gpu, layouts, pools, scene_resources, recording, &mut self.resources)?;
        if self.frugal && !uploads.is_empty() {
            self.upload_in_parts(index, std::mem::take(&mut uploads))?;
        }
        self.record_commands(index, recording, ids, uploads)?;
        self.submit_frame(index)
    }
}

impl Renderer for VulkanRenderer {
    fn device(&self) -> &DeviceInfo {
        &self.gpu.info
    }

    fn frames_in_flight(&self) -> usize {
        self.frames.len()
    }

    fn load(&mut self, scene_resources: Arc<SceneResources>) -> Result<(), RenderError> {
        let _calls = self.gpu.lock_for_calls();
        self.wait_idle()?;
        let before = self.resources.counts();
        self.resources.retain(&self.gpu, &scene_resources);
        self.scene_resources = scene_resources;
        self.notes.extend(self.textures_left_out());
        // If resources neither come nor go, no memory was freed.
        if before == [0; 3] || self.resources.counts() != before {
            self.awaits_first_frame = true;
            context::give_back_freed_memory();
        }
        self.gpu.check_messages()
    }

    fn set_effects(&mut self, effects: &[Effect]) -> Result<(), RenderError> {
        let _calls = self.gpu.lock_for_calls();
        self.wait_idle()?;
        self.forget_texels(effects);
        self.faults.clear();
        self.pipelines.set_effects(&self.gpu, effects);
        self.forget_maps();
        self.gpu.check_messages()
    }

    fn reload_shaders(&mut self) -> Result<(), RenderError> {
        let _calls = self.gpu.lock_for_calls();
        self.wait_idle()?;
        self.pipelines.reload(&self.gpu, &self.layouts)?;
        self.forget_maps();
        self.gpu.check_messages()
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.faults.take_warnings(self.pipelines.effects()));
        notes
    }

    fn created_counts(&self) -> CreatedCounts {
        CreatedCounts { pipelines: self.pipelines.created(), ..self.resources.created_counts }
    }

    fn usage(&self) -> DeviceUsage {
        let memory = self.gpu.allocator().generate_report();
        DeviceUsage {
            // Each buffer and image has one allocation.
            memory_objects: memory.allocations.len(),
            memory_blocks: memory.blocks.len(),
            bytes: memory.total_capacity_bytes,
            pipelines: self.pipelines.count(),
            descriptor_pools: self.resources.descriptor_pools(),
        }
    }

    fn submit(&mut self, plan: Plan) -> Result<(), RenderError> {
        self.submit_plan(&plan)
    }

    fn collect(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let _calls = self.gpu.lock_for_calls();
        if self.pending.is_empty()
            && let Some(plan) = self.waiting_plans.pop_front()
        {
            return self.collect_later(plan, reuse);
        }
        self.collect_now(reuse)
    }

    fn collect_floats(&mut self) -> Result<FloatFrame, RenderError> {
        let _calls = self.gpu.lock_for_calls();
        self.collect_floats_later()
    }
}

impl Drop for VulkanRenderer {
    fn drop(&mut self) {
        let _calls = self.gpu.lock_for_calls();
        // SAFETY: nothing else submits; an error (device lost) means that nothing runs any more.
        let _ = unsafe { self.gpu.device.device_wait_idle() };
        if let Some(mut targets) = self.targets.take() {
            targets.destroy(&self.gpu);
        }
        for slot in &mut self.frames {
            slot.destroy(&self.gpu);
        }
        if let Some(mut texels) = self.texels.take() {
            texels.destroy(&self.gpu);
        }
        self.resources.destroy(&self.gpu);
        self.pipelines.destroy(&self.gpu);
        self.pools.destroy(&self.gpu);
        self.layouts.destroy(&self.gpu);
        if let Some(clock) = self.clock.take() {
            clock.destroy(&self.gpu);
        }
        // SAFETY: the device is idle.
        unsafe { self.gpu.device.destroy_semaphore(self.timeline, None) };
    }
}
