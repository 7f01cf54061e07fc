//! The objects of one frame in flight: commands, mapped buffer of its data, descriptor sets, read-back buffer.

use super::context::Context;
use super::descriptors::{Layouts, Pools, Set, write_buffer, write_image};
use super::error::Named;
use super::frame_data::{Block, FrameData};
use super::memory::{Buffer, Image};
use super::preskin::PreskinBuffers;
use super::resources::Resources;
use super::sky::layer_image;
use super::targets::FrameImages;
use super::upload::Uploads;
use crate::commands::{Command, Recording};
use crate::error::RenderError;
use crate::layers_2d::LayerImage;
use crate::plan::Plan;
use crate::scene_resources::SceneResources;
use crate::shader::uniforms::LayersUniform;
use ash::vk;
use gpu_allocator::MemoryLocation;
use std::sync::Arc;

pub(crate) struct FrameInFlight {
    pub pool: vk::CommandPool,
    pub commands: vk::CommandBuffer,
    data_buffer: Option<Buffer>,
    pub frame_set: Set,
    /// The frame's set with the view of each shadow map in place of the camera.
    pub view_sets: Vec<Set>,
    /// Set 2 (shadow maps, scene color copy, sky, 2D layers behind the scene), and which of these four it was created with.
    pub scene_set: Option<(Set, [bool; 4])>,
    /// Sets with the same layout, with the depths of the scene, of even peeled layers and of odd ones.
    pub peel_sets: Vec<Set>,
    /// The G-buffer, for the pass that lights it.
    pub gbuffer_set: Option<Set>,
    /// Uniform blocks of the frame's overridden materials. `override_keys`, `override_sets`: override and texture slots of each set, and
    /// the sets.
    override_blocks: Vec<[Block; 2]>,
    /// 2D layers behind the scene, with their content hash.
    layers_behind: Option<([u8; 32], Image)>,
    /// 2D layers over the frame.
    pub layers_in_front: Option<Arc<LayerImage>>,
    override_keys: Vec<(u32, u32)>,
    override_sets: Vec<Set>,
    pub post_sets: Vec<Set>,
    pub readback: Option<Buffer>,
    /// Staging buffer, kept until the frame is done.
    pub staging: Option<Buffer>,
    /// Pre-skinned vertices.
    pub preskin: PreskinBuffers,
    pub size: [u32; 2],
    /// Block of the fault records of effects in the frame's data.
    faults: Block,
    /// Value of the timeline semaphore at which the frame is done.
    pub done_at: u64,
}

/// Bindings of set 0: frame, instances, joints, morphs, lights, joints as a uniform buffer, parameters of effects on surfaces,
/// overlay vertices, textures of effects, light clusters, fault records of effects.
pub(crate) const FRAME_BINDINGS: [(u32, vk::DescriptorType); 11] = [
    (0, vk::DescriptorType::UNIFORM_BUFFER),
    (1, vk::DescriptorType::STORAGE_BUFFER),
    (2, vk::DescriptorType::STORAGE_BUFFER),
    (3, vk::DescriptorType::STORAGE_BUFFER),
    (4, vk::DescriptorType::UNIFORM_BUFFER),
    (5, vk::DescriptorType::UNIFORM_BUFFER),
    (6, vk::DescriptorType::UNIFORM_BUFFER),
    (7, vk::DescriptorType::STORAGE_BUFFER),
    (8, vk::DescriptorType::STORAGE_BUFFER),
    (9, vk::DescriptorType::STORAGE_BUFFER),
    (10, vk::DescriptorType::STORAGE_BUFFER),
];

impl FrameInFlight {
    pub(super) fn new(
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
    ) -> Result<FrameInFlight, RenderError> {
        let frame_set = pools.allocate(gpu, layouts.frame, "frame set")?;
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(gpu.queue_family);
        // SAFETY: the device is alive; destroyed by `destroy`.
        let pool = unsafe { gpu.device.create_command_pool(&info, None) }.named("command pool")?;
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was just made.
        let commands = match unsafe { gpu.device.allocate_command_buffers(&info) } {
            Ok(list) => list[0],
            Err(e) => {
                // SAFETY: the pool was just made, and is not used.
                unsafe { gpu.device.destroy_command_pool(pool, None) };
                return Err(e).named("command buffer");
            }
        };
        gpu.set_name(commands, "frame commands");
        Ok(FrameInFlight {
            pool,
            commands,
            data_buffer: None,
            frame_set,
            view_sets: Vec::new(),
            scene_set: None,
            peel_sets: Vec::new(),
            gbuffer_set: None,
            layers_behind: None,
            layers_in_front: None,
            override_blocks: Vec::new(),
            override_keys: Vec::new(),
            override_sets: Vec::new(),
            post_sets: Vec::new(),
            readback: None,
            staging: None,
            preskin: PreskinBuffers::default(),
            size: [0; 2],
            faults: Block::default(),
            done_at: 0,
        })
    }

    /// Writes the frame's data into the mapped buffer and points the descriptor sets at it.
    pub(super) fn write(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        plan: &Plan,
        recording: &Recording,
        images: FrameImages<'_>,
    ) -> Result<(), RenderError> {
        let data = FrameData::new(gpu, plan, recording, &images)?;
        self.override_blocks.clone_from(&data.materials);
        self.faults = data.faults;
        self.prepare_buffer(gpu, layouts, pools, &data)?;
        let Some(data_buffer) = &mut self.data_buffer else { return Ok(()) };
        let raw = data_buffer.raw;
        let mapped = data_buffer.mapped_mut();
        data.write(plan, &images, mapped);
        let Block { at, bytes } = data.instances;
        self.preskin.patch_instances(&mut mapped[at as usize..][..bytes as usize]);
        // If there are no effect textures, the binding points at the frame's own data: see `prepare_buffer`.
        let texels = images.texels.map_or((raw, 16), |b| (b.raw, b.size));
        self.write_frame_sets(gpu, &data, raw, texels);
        self.write_scene_set(gpu, layouts, pools, &images, &data, raw)?;
        self.write_peel_sets(gpu, layouts, pools, &images, raw)?;
        if let Some(views) = images.gbuffer {
            self.write_gbuffer(gpu, layouts, pools, views, (raw, data.rebuilt.at))?;
        }
        while self.post_sets.len() < data.post.len() {
            self.post_sets.push(pools.allocate(gpu, layouts.post, "post set")?);
        }
        for (set, block) in self.post_sets.iter().zip(&data.post) {
            write_buffer(gpu, set.raw, 0, vk::DescriptorType::UNIFORM_BUFFER, raw, block.at, block.bytes);
            write_buffer(gpu, set.raw, 3, vk::DescriptorType::STORAGE_BUFFER, texels.0, 0, texels.1);
            let Block { at, bytes } = data.faults.nonempty();
            write_buffer(gpu, set.raw, 4, vk::DescriptorType::STORAGE_BUFFER, raw, at, bytes);
        }
        self.prepare_readback(gpu, plan)
    }

    /// Prepares a buffer that is large enough, and the sets of shadow views.
    fn prepare_buffer(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        data: &FrameData,
    ) -> Result<(), RenderError> {
        let old_views = self.view_sets.len();
        while self.view_sets.len() < data.views.len() {
            self.view_sets.push(pools.allocate(gpu, layouts.frame, "shadow view set")?);
        }
        if self.data_buffer.as_ref().is_none_or(|r| r.size < data.bytes) {
            if let Some(mut old) = self.data_buffer.take() {
                old.destroy(gpu);
            }
            let usage = vk::BufferUsageFlags::UNIFORM_BUFFER | vk::BufferUsageFlags::STORAGE_BUFFER;
            let size = data.bytes.next_power_of_two();
            let data_buffer = Buffer::new(gpu, "frame data", size, usage, MemoryLocation::CpuToGpu)?;
            // Every binding is written, read or not: lavapipe (22.3) dereferences all descriptors of a bound set and crashes on a
            // buffer that was just destroyed, although that is legal if no shader reads it.
            bind_all_to_buffer(gpu, &self.frame_set, data_buffer.raw);
            self.view_sets.iter().for_each(|set| bind_all_to_buffer(gpu, set, data_buffer.raw));
            self.data_buffer = Some(data_buffer);
        } else if let Some(data_buffer) = &self.data_buffer {
            self.view_sets[old_views..].iter().for_each(|set| bind_all_to_buffer(gpu, set, data_buffer.raw));
        }
        Ok(())
    }

    /// Writes set 0 of the frame and of each shadow view.
    fn write_frame_sets(&self, gpu: &Context, data: &FrameData, raw: vk::Buffer, texels: (vk::Buffer, u64)) {
        let reads = &data.reads;
        let joints = if reads.joints_uniform { 5 } else { 2 };
        let blocks = [
            (1, data.instances.bytes > 0, data.instances),
            (3, reads.morphs, data.morphs),
            (4, reads.lights, data.lights),
            (joints, reads.joints, data.joints),
            (6, data.surface.bytes > 0, data.surface),
            (7, data.overlay.bytes > 0, data.overlay),
            (9, data.light_clusters.bytes > 0, data.light_clusters),
            (10, data.faults.bytes > 0, data.faults),
        ];
        for (set, own) in std::iter::once(&self.frame_set).chain(&self.view_sets).zip(data.frame_and_views())
        {
            let write = |binding: u32, buffer: vk::Buffer, block: Block| {
                let (_, kind) = FRAME_BINDINGS[binding as usize];
                write_buffer(gpu, set.raw, binding, kind, buffer, block.at, block.bytes);
            };
            write(0, raw, own);
            for (binding, _, block) in blocks.iter().filter(|(_, is_read, _)| *is_read) {
                write(*binding, raw, *block);
            }
            write(8, texels.0, Block { at: 0, bytes: texels.1 });
        }
    }

    /// Writes set 2: shadow maps, the scene color copy, the sky and the 2D layers behind the scene.
    fn write_scene_set(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        images: &FrameImages<'_>,
        data: &FrameData,
        raw: vk::Buffer,
    ) -> Result<(), RenderError> {
        use vk::DescriptorType as T;
        let behind_scene =
            self.layers_behind.as_ref().filter(|_| data.reads.layers_behind).map(|(_, image)| image.view);
        let sky = images.sky.filter(|_| data.sky.bytes > 0);
        // A new set is allocated if other images exist than before: lavapipe (22.3) dereferences all descriptors of a bound set,
        // read or not.
        let has = [
            images.shadow.is_some(),
            images.scene_color_copy.is_some(),
            sky.is_some(),
            behind_scene.is_some(),
        ];
        if let Some((set, _)) = self.scene_set.take_if(|(_, had)| *had != has) {
            pools.free(gpu, set);
        }
        if self.scene_set.is_none() && has != [false; 4] {
            self.scene_set = Some((pools.allocate(gpu, layouts.shadow, "shadows, glass and sky")?, has));
        }
        // Every binding is written: an existing image takes the place of a missing one, and is not read.
        let shadows = images.shadow.map(|t| ([t.image.view; 2], t.sampler));
        let glass = images.scene_color_copy.map(|t| ([t.image.view; 2], t.sampler));
        let of_sky = sky.and_then(|images| Some((images.views()?, images.sampler)));
        // The layers are read without a sampler.
        let layers = behind_scene.map(|view| ([view; 2], vk::Sampler::null()));
        let any = shadows.or(glass).or(of_sky).or(layers);
        let (Some((set, _)), Some(any)) = (self.scene_set, any) else { return Ok(()) };
        for (binding, block) in [(0, data.shadow_lookups.nonempty()), (5, data.sky.nonempty())] {
            write_buffer(gpu, set.raw, binding, T::UNIFORM_BUFFER, raw, block.at, block.bytes);
        }
        for (binding, there) in [(1, shadows), (3, glass), (6, of_sky)] {
            let ([view, _], sampler) = there.unwrap_or(any);
            write_image(gpu, set.raw, binding, T::SAMPLED_IMAGE, view, vk::Sampler::null());
            if sampler != vk::Sampler::null() {
                write_image(gpu, set.raw, binding + 1, T::SAMPLER, vk::ImageView::null(), sampler);
            }
        }
        let ([_, panorama_view], _) = of_sky.unwrap_or(any);
        let ([layers_behind, _], _) = layers.unwrap_or(any);
        for (binding, view) in [(8, panorama_view), (9, layers_behind), (10, layers_behind)] {
            write_image(gpu, set.raw, binding, T::SAMPLED_IMAGE, view, vk::Sampler::null());
        }
        Ok(())
    }

    /// Writes set 2 of the passes that find peeled layers: the depths of the layer before.
    fn write_peel_sets(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        images: &FrameImages<'_>,
        raw: vk::Buffer,
    ) -> Result<(), RenderError> {
        use vk::DescriptorType as T;
        let Some((views, sampler)) = images.layers else { return Ok(()) };
        for (i, view) in views.into_iter().enumerate() {
            if self.peel_sets.len() <= i {
                self.peel_sets.push(pools.allocate(gpu, layouts.shadow, "depths of layers")?);
            }
            let set = self.peel_sets[i].raw;
            for binding in [0, 5] {
                write_buffer(gpu, set, binding, T::UNIFORM_BUFFER, raw, 0, 16);
            }
            for binding in [1, 3, 6, 8, 9, 10] {
                write_image(gpu, set, binding, T::SAMPLED_IMAGE, view, vk::Sampler::null());
            }
            for binding in [2, 4, 7] {
                write_image(gpu, set, binding, T::SAMPLER, vk::ImageView::null(), sampler);
            }
        }
        Ok(())
    }

    /// Fault records of effects, written by the frame's shaders. The frame must be done.
    pub(crate) fn fault_records(&self) -> &[u8] {
        let Block { at, bytes } = self.faults;
        let mapped = self.data_buffer.as_ref().map_or(&[][..], |data_buffer| data_buffer.mapped());
        mapped.get(at as usize..(at + bytes) as usize).unwrap_or(&[])
    }

    fn prepare_readback(&mut self, gpu: &Context, plan: &Plan) -> Result<(), RenderError> {
        let pixel = match &plan.scene_inputs {
            Some(pass) if plan.inputs_only => pass.pixel_bytes() as u64,
            _ if plan.linear => 8,
            _ => 4,
        };
        let bytes = plan.size[0] as u64 * plan.size[1] as u64 * pixel;
        if self.readback.as_ref().is_none_or(|b| b.size < bytes) {
            if let Some(mut old) = self.readback.take() {
                old.destroy(gpu);
            }
            let usage = vk::BufferUsageFlags::TRANSFER_DST;
            self.readback =
                Some(Buffer::new(gpu, "read-back buffer", bytes, usage, MemoryLocation::GpuToCpu)?);
        }
        self.size = plan.size;
        Ok(())
    }

    /// Uploads the 2D layers behind the scene if this slot holds different ones, and keeps the layers in front for the host.
    pub(crate) fn prepare_layers_2d(
        &mut self,
        gpu: &Context,
        plan: &Plan,
        uploads: &mut Uploads,
    ) -> Result<(), RenderError> {
        self.layers_in_front = plan.layers_in_front.clone();
        let wanted = plan.layers_behind.as_ref().map(|layers| layers.hash);
        if let Some((_, mut old)) = self.layers_behind.take_if(|(hash, _)| Some(*hash) != wanted) {
            old.destroy(gpu);
        }
        if let (Some(layers), None) = (&plan.layers_behind, &self.layers_behind) {
            let image = layer_image(gpu, layers, uploads)?;
            self.layers_behind = Some((layers.hash, image));
        }
        Ok(())
    }

    /// Drops the image of the layers behind the scene, after its upload has failed.
    pub(crate) fn forget_layers_2d(&mut self, gpu: &Context) {
        if let Some((_, mut image)) = self.layers_behind.take() {
            image.destroy(gpu);
        }
    }

    /// Writes the sets of materials that are overridden in this frame. Call it after `write`, and after the resources are
    /// prepared.
    pub(crate) fn write_override_sets(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        scene_resources: &SceneResources,
        recording: &Recording,
        resources: &mut Resources,
    ) -> Result<(), RenderError> {
        self.override_keys.clear();
        // Sets are allocated anew in each frame: lavapipe (22.3) dereferences all descriptors of a bound set, even destroyed
        // textures that are not read.
        self.override_sets.drain(..).for_each(|set| pools.free(gpu, set));
        for command in &recording.commands {
            let Command::BindMaterial { material, material_override: Some(changed), slots } = command else {
                continue;
            };
            let (Some(data_buffer), Some([own, layers])) =
                (&self.data_buffer, self.override_blocks.get(*changed as usize))
            else {
                return Err(RenderError::Usage("an overridden material is not in the plan".into()));
            };
            if self.override_keys.contains(&(*changed, *slots)) {
                continue;
            }
            let made = pools.allocate(gpu, layouts.material(*slots)?.set, "overridden material set")?;
            self.override_sets.push(made);
            let set = made.raw;
            let uniform = vk::DescriptorType::UNIFORM_BUFFER;
            write_buffer(gpu, set, 0, uniform, data_buffer.raw, own.at, own.bytes);
            write_buffer(gpu, set, LayersUniform::BINDING, uniform, data_buffer.raw, layers.at, layers.bytes);
            resources.write_textures(gpu, scene_resources, *material, *slots, set)?;
            self.override_keys.push((*changed, *slots));
        }
        Ok(())
    }

    pub(crate) fn override_set(&self, changed: u32, slots: u32) -> Option<vk::DescriptorSet> {
        let place = self.override_keys.iter().position(|c| *c == (changed, slots))?;
        self.override_sets.get(place).map(|set| set.raw)
    }

    pub(crate) fn release_staging(&mut self, gpu: &Context) {
        if let Some(mut staging) = self.staging.take() {
            staging.destroy(gpu);
        }
    }

    /// Destroys the objects. The frame must be done; its sets are destroyed with the pools.
    pub(super) fn destroy(&mut self, gpu: &Context) {
        self.release_staging(gpu);
        self.preskin.destroy(gpu);
        self.forget_layers_2d(gpu);
        for mut buffer in self.data_buffer.take().into_iter().chain(self.readback.take()) {
            buffer.destroy(gpu);
        }
        // SAFETY: made from this device; its command buffer is not pending.
        unsafe { gpu.device.destroy_command_pool(self.pool, None) };
    }
}

/// Points every binding of a set with the frame's layout at a buffer.
fn bind_all_to_buffer(gpu: &Context, set: &Set, buffer: vk::Buffer) {
    for (binding, kind) in FRAME_BINDINGS {
        write_buffer(gpu, set.raw, binding, kind, buffer, 0, 16);
    }
}
