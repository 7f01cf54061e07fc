//! Meshes pre-skinned once per frame by compute shaders; see [`crate::commands::preskin`] and preskin.wgsl.

use super::VulkanRenderer;
use super::context::Context;
use super::descriptors::{Layouts, Pools, Set, write_buffer};
use super::error::Named;
use super::execute::{Execution, not_prepared};
use super::faults::FaultPlace;
use super::memory::Buffer;
use super::resources::Resources;
use crate::affine::Affine3x4;
use crate::commands::preskin::PreskinVariant;
use crate::commands::{Command, Recording};
use crate::error::RenderError;
use crate::plan::{Instance, Plan};
use crate::scene_resources::SceneResources;
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::shader::{PRESKIN, ShaderSources, compile};
use ash::vk;
use gpu_allocator::MemoryLocation;
use naga::ShaderStage;
use std::collections::HashMap;
use std::mem::offset_of;

/// Number of invocations of a work group, as in the shader.
const WORKGROUP_SIZE: u32 = 64;

/// Parameters of one pre-skinned mesh (a mesh with one deformation), as the shader reads them.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Job {
    pub relative_from_mesh: Affine3x4,
    pub first_joint: u32,
    pub first_morph: u32,
    pub morph_count: u32,
    /// Index of the mesh's first f32 in the output buffer.
    pub first: u32,
}

/// Pre-skinning buffers of one frame in flight.
#[derive(Default)]
pub(crate) struct PreskinBuffers {
    jobs: Option<Buffer>,
    vertices: Option<Buffer>,
    /// Descriptor sets: `write_set` has both buffers for the compute stage; `read_set` has the vertices for all passes.
    write_set: Option<Set>,
    read_set: Option<Set>,
    /// Each instance that reads pre-skinned vertices, the index of its first f32 in the vertex buffer, and its number of vertices.
    vertex_ranges: Vec<(u32, [u32; 2])>,
}

/// Grows a buffer if it is too small; returns `true` if it was replaced.
fn grow(
    gpu: &Context,
    buffer: &mut Option<Buffer>,
    name: &str,
    bytes: u64,
    location: MemoryLocation,
) -> Result<bool, RenderError> {
    if buffer.as_ref().is_some_and(|b| b.size >= bytes) {
        return Ok(false);
    }
    if let Some(mut old) = buffer.take() {
        old.destroy(gpu);
    }
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
    let size = grown_size(bytes, u64::from(gpu.limits().max_storage_buffer_range));
    *buffer = Some(Buffer::new(gpu, name, size, usage, location)?);
    Ok(true)
}

impl PreskinBuffers {
    /// Assigns an output range to each pre-skinned mesh. Must be called after the resources are prepared; the slot's last frame must be
    /// done.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        (scene_resources, resources): (&SceneResources, &Resources),
        plan: &Plan,
        recording: &Recording,
    ) -> Result<(), RenderError> {
        self.vertex_ranges.clear();
        if recording.preskinned.is_empty() {
            return Ok(());
        }
        let mut jobs: Vec<Job> = Vec::with_capacity(recording.preskinned.len());
        let mut end = 0;
        for command in &recording.commands {
            let Command::Preskin { variant, primitive, layout, first, count } = command else { continue };
            let hash = scene_resources.primitives[*primitive as usize].hash;
            let mesh = resources.mesh(hash, *layout);
            let vertices = mesh.map(|m| m.vertex_count).ok_or_else(|| not_prepared("a pre-skinned mesh"))?;
            for preskinned in &recording.preskinned[*first as usize..(first + count) as usize] {
                let of = preskinned.instances.first().and_then(|i| plan.instances.get(*i as usize));
                let Instance { relative_from_mesh, first_joint, first_morph, morph_count, .. } =
                    *of.ok_or_else(|| not_prepared("the instance of a pre-skinned mesh"))?;
                let first = end as u32;
                jobs.push(Job { relative_from_mesh, first_joint, first_morph, morph_count, first });
                self.vertex_ranges.extend(preskinned.instances.iter().map(|i| (*i, [first, vertices])));
                end += u64::from(vertices) * variant.floats_per_vertex();
            }
        }
        let bytes: &[u8] = bytemuck::cast_slice(&jobs);
        let new = [
            grow(
                gpu,
                &mut self.jobs,
                "meshes to be pre-skinned",
                bytes.len() as u64,
                MemoryLocation::CpuToGpu,
            )?,
            grow(gpu, &mut self.vertices, "pre-skinned vertices", 4 * end, MemoryLocation::GpuOnly)?,
        ];
        let (Some(jobs), Some(vertices)) = (&mut self.jobs, &self.vertices) else { return Ok(()) };
        jobs.mapped_mut()[..bytes.len()].copy_from_slice(bytes);
        let sets = [self.write_set.is_none(), self.read_set.is_none()];
        if self.write_set.is_none() {
            self.write_set = Some(pools.allocate(gpu, layouts.preskin, "set of meshes to be pre-skinned")?);
        }
        if self.read_set.is_none() {
            self.read_set = Some(pools.allocate(gpu, layouts.morphs, "set of pre-skinned vertices")?);
        }
        if let (Some(write), Some(read), true) =
            (self.write_set, self.read_set, new.contains(&true) || sets.contains(&true))
        {
            let kind = vk::DescriptorType::STORAGE_BUFFER;
            write_buffer(gpu, write.raw, 0, kind, jobs.raw, 0, vk::WHOLE_SIZE);
            write_buffer(gpu, write.raw, 1, kind, vertices.raw, 0, vk::WHOLE_SIZE);
            write_buffer(gpu, read.raw, 0, kind, vertices.raw, 0, vk::WHOLE_SIZE);
        }
        Ok(())
    }

    /// Patches the instances in these bytes to refer to their pre-skinned vertices.
    pub(crate) fn patch_instances(&self, instances: &mut [u8]) {
        for (instance, place) in &self.vertex_ranges {
            let at = *instance as usize * size_of::<Instance>() + offset_of!(Instance, first_joint);
            if let Some(bytes) = instances.get_mut(at..at + size_of::<[u32; 2]>()) {
                bytes.copy_from_slice(bytemuck::cast_slice(place));
            }
        }
    }

    /// Destroys the buffers. The frame must be done; its sets are destroyed with the pools.
    pub(crate) fn destroy(&mut self, gpu: &Context) {
        for mut buffer in self.jobs.take().into_iter().chain(self.vertices.take()) {
            buffer.destroy(gpu);
        }
    }
}

/// Size of a grown buffer, all of which is bound: at most the device's limit, at least the requested bytes.
fn grown_size(bytes: u64, limit: u64) -> u64 {
    bytes.next_power_of_two().min(limit).max(bytes)
}

impl VulkanRenderer {
    /// Whether all inputs and outputs of the compute stage can be bound on this device. Otherwise every pass skins its vertices.
    pub(super) fn can_preskin(&self, recording: &Recording) -> bool {
        let limit = u64::from(self.gpu.limits().max_storage_buffer_range);
        let mesh = |command: &Command| match command {
            Command::Preskin { primitive, layout, .. } => {
                let mesh = self.scene_resources.primitives.get(*primitive as usize);
                u64::from(layout.attributes().1) * mesh.map_or(0, |m| m.primitive().positions.len() as u64)
            }
            _ => 0,
        };
        let jobs = (recording.preskinned.len() * size_of::<Job>()) as u64;
        jobs.max(recording.preskinned_bytes(&self.scene_resources)) <= limit
            && recording.commands.iter().all(|command| mesh(command) <= limit)
    }
}

/// Sets of the source meshes of the compute stage.
pub(crate) type Sources = HashMap<([u8; 16], VertexLayout), Set>;

impl Resources {
    /// Creates the sets of a recording's source meshes, which must be loaded.
    pub(super) fn prepare_sources(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        scene_resources: &SceneResources,
        recording: &Recording,
    ) -> Result<(), RenderError> {
        for command in &recording.commands {
            let Command::Preskin { primitive, layout, .. } = command else { continue };
            let key = (scene_resources.primitives[*primitive as usize].hash, *layout);
            if self.sources.contains_key(&key) {
                continue;
            }
            let mesh = self.mesh(key.0, key.1).ok_or_else(|| not_prepared("a pre-skinned mesh"))?;
            // Only the vertices are bound, which precede the indices. An empty mesh has neither, so at least four bytes are
            // bound.
            let (raw, bytes) = (mesh.buffer.raw, mesh.index_offset.max(4));
            let set = self.pools.allocate(gpu, layouts.morphs, "set of a pre-skinned mesh")?;
            write_buffer(gpu, set.raw, 0, vk::DescriptorType::STORAGE_BUFFER, raw, 0, bytes);
            self.sources.insert(key, set);
        }
        Ok(())
    }

    /// Drops the sets of meshes that are not kept. No frame may be in flight.
    pub(super) fn retain_sources(&mut self, gpu: &Context, keep: impl Fn(&[u8; 16]) -> bool) {
        let pools = &mut self.pools;
        self.sources.retain(|(hash, _), set| {
            let keep = keep(hash);
            if !keep {
                pools.free(gpu, *set);
            }
            keep
        });
    }
}

impl Execution<'_> {
    /// Dispatches the pre-skinning of the deformations of one mesh. `primitive`: index in the scene resources.
    pub(super) fn preskin_mesh(
        &self,
        pipeline: vk::Pipeline,
        (primitive, layout): (u32, VertexLayout),
        morphs: bool,
        [first, count]: [u32; 2],
    ) -> Result<(), RenderError> {
        let hash = self.scene_resources.primitives[primitive as usize].hash;
        let mesh = self.resources.mesh(hash, layout).ok_or_else(|| not_prepared("a pre-skinned mesh"))?;
        let source =
            self.resources.sources.get(&(hash, layout)).ok_or_else(|| not_prepared("a pre-skinned mesh"))?;
        let write =
            self.frame.preskin.write_set.ok_or_else(|| not_prepared("a set of meshes to be pre-skinned"))?;
        let bind = |index: u32, set: vk::DescriptorSet| {
            let (point, layout) = (vk::PipelineBindPoint::COMPUTE, self.layouts.preskin_pipeline);
            // SAFETY: the command buffer is being recorded; the set fits the layout and outlives the frame.
            unsafe {
                self.gpu.device.cmd_bind_descriptor_sets(
                    self.frame.commands,
                    point,
                    layout,
                    index,
                    &[set],
                    &[],
                );
            }
        };
        bind(0, self.frame.frame_set.raw);
        if morphs {
            let set = self.resources.morph_set(hash, layout);
            bind(1, set.ok_or_else(|| not_prepared("a set of morph targets"))?);
        }
        bind(2, source.raw);
        bind(3, write.raw);
        let push_constants = [first, mesh.vertex_count];
        // SAFETY: the command buffer is being recorded, outside a pass; the pipeline outlives the frame, its sets are bound, and
        // the constants are those of its layout.
        unsafe {
            let (device, commands) = (&self.gpu.device, self.frame.commands);
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline);
            let (layout, stage) = (self.layouts.preskin_pipeline, vk::ShaderStageFlags::COMPUTE);
            device.cmd_push_constants(commands, layout, stage, 0, bytemuck::cast_slice(&push_constants));
            device.cmd_dispatch(commands, mesh.vertex_count.div_ceil(WORKGROUP_SIZE), count, 1);
        }
        Ok(())
    }

    /// Barrier: all meshes are pre-skinned before a vertex is read.
    pub(super) fn end_preskin(&self) {
        let written = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COMPUTE_SHADER)
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::VERTEX_SHADER)
            .dst_access_mask(vk::AccessFlags2::SHADER_STORAGE_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&written);
        // SAFETY: the command buffer is being recorded, outside a pass.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.frame.commands, &info) };
    }

    /// Binds the pre-skinned vertices, in the place of morph targets.
    pub(super) fn bind_preskinned(&self) -> Result<(), RenderError> {
        let set = self.frame.preskin.read_set.ok_or_else(|| not_prepared("a set of pre-skinned vertices"))?;
        self.bind_set(self.pipelines.layout, 1, set.raw);
        Ok(())
    }
}

/// Creates the compute pipeline of a pre-skinning variant.
pub(crate) fn create_pipeline(
    gpu: &Context,
    layouts: &Layouts,
    sources: &ShaderSources,
    cache: vk::PipelineCache,
    variant: &PreskinVariant,
) -> Result<vk::Pipeline, RenderError> {
    let switches = variant.switches();
    let name = format!("pose pipeline {}", switches.join(" "));
    let code = compile(&sources.files(&PRESKIN)?, &switches, &[("pose", ShaderStage::Compute)], false)?;
    let info = vk::ShaderModuleCreateInfo::default().code(&code[0].words);
    gpu.inject_fault(FaultPlace::Pipeline).named(&name)?;
    // SAFETY: naga validated the module and wrote the SPIR-V; destroyed below.
    let module = unsafe { gpu.device.create_shader_module(&info, None) }.named(&name)?;
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module)
        .name(c"pose");
    let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layouts.preskin_pipeline)];
    // SAFETY: module, layout and cache belong to this device; a pipeline does not need its module once it is made.
    let made = unsafe {
        let made = gpu.device.create_compute_pipelines(cache, &info, None);
        gpu.device.destroy_shader_module(module, None);
        made
    };
    let pipeline = made.map_err(|(_, r)| r).named(&name)?[0];
    gpu.set_name(pipeline, &name);
    Ok(pipeline)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_grow_up_to_the_binding_limit() {
        let most = u64::from(u32::MAX);
        assert_eq!(grown_size(5000, most), 8192);
        assert_eq!(grown_size(3 << 30, most), most, "twice a gigabyte and more would be 4 GiB");
        assert_eq!((grown_size(5000, 6000), grown_size(5000, 4000)), (6000, 5000));
    }
}
