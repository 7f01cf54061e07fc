//! What one frame in flight owns: commands, the mapped buffer of its data, descriptor sets, the buffer it is read back from.

use super::context::Context;
use super::descriptors::{Layouts, Pools, Set, write_buffer, write_image};
use super::error::Named;
use super::memory::{Buffer, Image};
use super::preskin::Posing;
use super::resources::Resources;
use super::sky::flat_image;
use super::targets::Seen;
use super::upload::Uploads;
use crate::affine::Affine3x4;
use crate::commands::{Command, Recording, UNIFORM_JOINTS};
use crate::error::RenderError;
use crate::layers_2d::LayerImage;
use crate::plan::Plan;
use crate::plan::build::effects::MOST_SURFACE_EFFECTS;
use crate::plan::build::shadow_cascades::MAX_VIEWS;
use crate::plan::light_clusters::MAX_LIGHTS;
use crate::scene_resources::SceneResources;
use crate::shader::uniforms::{
    FrameUniform, LayersUniform, MaterialUniform, PostUniform, RebuiltUniform, ShadowUniform, SkyUniform,
};
use ash::vk;
use choreo_stage::Background;
use glam::Vec2;
use gpu_allocator::MemoryLocation;
use std::sync::Arc;

pub struct Slot {
    pub pool: vk::CommandPool,
    pub commands: vk::CommandBuffer,
    ring: Option<Buffer>,
    pub frame_set: Set,
    /// As the frame's, seen from the light of each shadow map.
    pub view_sets: Vec<Set>,
    /// Shadow maps, the picture behind glass and the sky, and which of them it was made for.
    pub light_set: Option<(Set, [bool; 4])>,
    /// Sets of the same layout, with the depths of the scene, of even layers and of odd ones.
    pub peel_sets: Vec<Set>,
    /// The G-buffer, of the pass that lights it.
    pub kept_set: Option<Set>,
    /// Offsets of the uniforms of the frame's changed materials, which of them with which textures, and their sets.
    changed_at: Vec<[u64; 2]>,
    /// Layers under the scene, by what they are made from.
    under: Option<([u8; 32], Image)>,
    /// Those over the frame.
    pub over: Option<Arc<LayerImage>>,
    changed: Vec<(u32, u32)>,
    changed_sets: Vec<Set>,
    pub post_sets: Vec<Set>,
    pub readback: Option<Buffer>,
    /// Kept until this frame is done.
    pub staging: Option<Buffer>,
    /// Vertices that a compute stage poses.
    pub posed: Posing,
    pub size: [u32; 2],
    /// Value of the timeline at which the frame is done.
    pub done_at: u64,
}

/// Set 0: frame, instances, joints, morphs, lights, joints as a uniform buffer, parameters of effects on surfaces, what effects draw,
/// textures of effects, lists of lights.
pub const FRAME_BINDINGS: [(u32, vk::DescriptorType); 10] = [
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
];

/// Parameters of as many effects on surfaces as there can be, and how far each moves them.
const SURFACE_BYTES: u64 = REACHES_AT + (MOST_SURFACE_EFFECTS * size_of::<f32>()) as u64;
const REACHES_AT: u64 = (MOST_SURFACE_EFFECTS * size_of::<[f32; 8]>()) as u64;

/// Byte ranges of one frame's data in its buffer.
struct Ranges {
    end: u64,
    align: u64,
}

impl Ranges {
    fn take(&mut self, size: u64) -> u64 {
        let at = self.end.next_multiple_of(self.align);
        self.end = at + size;
        at
    }
}

impl Slot {
    pub fn new(gpu: &Context, layouts: &Layouts, pools: &mut Pools) -> Result<Slot, RenderError> {
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
        gpu.name(commands, "frame commands");
        Ok(Slot {
            pool,
            commands,
            ring: None,
            frame_set,
            view_sets: Vec::new(),
            light_set: None,
            peel_sets: Vec::new(),
            kept_set: None,
            under: None,
            over: None,
            changed_at: Vec::new(),
            changed: Vec::new(),
            changed_sets: Vec::new(),
            post_sets: Vec::new(),
            readback: None,
            staging: None,
            posed: Posing::default(),
            size: [0; 2],
            done_at: 0,
        })
    }

    /// Writes the frame's data into the mapped buffer and points the descriptor sets at it.
    pub fn write(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        plan: &Plan,
        recording: &Recording,
        seen: Seen<'_>,
    ) -> Result<(), RenderError> {
        let Some(Command::UploadFrameData { instances, joints, morphs, lights }) = recording.commands.first()
        else {
            return Err(RenderError::Usage("a recording starts with its frame data".into()));
        };
        let shadow = seen.shadow;
        let reads = recording.reads();
        let limits = gpu.limits();
        let align = limits
            .min_uniform_buffer_offset_alignment
            .max(limits.min_storage_buffer_offset_alignment)
            .max(16);
        let mut ranges = Ranges { end: 0, align };
        let frame_at = ranges.take(size_of::<FrameUniform>() as u64);
        let views = plan.shadow_maps.as_ref().map_or(&[][..], |s| &s.views);
        let view_at: Vec<u64> = views.iter().map(|_| ranges.take(size_of::<FrameUniform>() as u64)).collect();
        let of_material = [size_of::<MaterialUniform>(), size_of::<LayersUniform>()].map(|s| s as u64);
        self.changed_at =
            plan.material_overrides.iter().map(|_| of_material.map(|size| ranges.take(size))).collect();
        let lookups_range = if shadow.is_some() { MAX_VIEWS * size_of::<ShadowUniform>() } else { 0 } as u64;
        let lookups_at = ranges.take(lookups_range.max(16));
        let sky = seen.sky.filter(|_| reads.sky).zip(plan.sky.as_ref());
        let sky_range = if sky.is_some() { size_of::<SkyUniform>() } else { 0 } as u64;
        let sky_at = ranges.take(sky_range);
        let kept_range = if seen.kept.is_some() { size_of::<RebuiltUniform>() } else { 0 } as u64;
        let kept_at = ranges.take(kept_range);
        let post_at: Vec<u64> =
            plan.post.iter().map(|_| ranges.take(size_of::<PostUniform>() as u64)).collect();
        let instance_bytes: &[u8] = bytemuck::cast_slice(&plan.instances[..*instances]);
        let joint_bytes: &[u8] = bytemuck::cast_slice(&plan.joint_matrices[..*joints]);
        let morph_bytes: &[u8] = bytemuck::cast_slice(&plan.morphs[..*morphs]);
        let light_bytes: &[u8] = bytemuck::cast_slice(&plan.lights[..*lights]);
        let instances_at = ranges.take(instance_bytes.len() as u64);
        // A shader may be made for morphs that no instance has; what it is bound to must not be empty.
        let morphs_range = morph_bytes.len().max(16) as u64;
        let morphs_at = ranges.take(morphs_range);
        // Uniform arrays have a fixed length in the shader; what lies behind the used part is never read.
        let lights_range =
            if reads.lights { (MAX_LIGHTS * size_of::<crate::plan::PlanLight>()) as u64 } else { 0 };
        let lights_at = ranges.take(lights_range);
        let joints_range = match reads.joints_uniform {
            true => UNIFORM_JOINTS * size_of::<Affine3x4>(),
            false => joint_bytes.len().max(size_of::<Affine3x4>()),
        } as u64;
        let joints_at = ranges.take(joints_range);

        let surface_range = if plan.scene_effects.is_empty() { 0 } else { SURFACE_BYTES };
        let surface_at = ranges.take(surface_range);
        let overlay_bytes: &[u8] = bytemuck::cast_slice(&plan.overlay.vertices);
        let overlay_at = ranges.take(overlay_bytes.len() as u64);
        let list_bytes: &[u8] =
            plan.light_clusters.as_ref().map_or(&[], |lists| bytemuck::cast_slice(&lists.0));
        let lists_at = ranges.take(list_bytes.len() as u64);
        let stored = [
            ("instances", instance_bytes),
            ("joint matrices", joint_bytes),
            ("weights of morph targets", morph_bytes),
            ("vertices that effects draw", overlay_bytes),
            ("lists of lights", list_bytes),
        ];
        let limit = u64::from(limits.max_storage_buffer_range);
        if let Some((what, bytes)) = stored.into_iter().find(|(_, bytes)| bytes.len() as u64 > limit) {
            let what = format!("size in bytes of all {what}");
            return Err(RenderError::Limit { what, value: bytes.len() as u64, limit });
        }

        let old_views = self.view_sets.len();
        while self.view_sets.len() < views.len() {
            self.view_sets.push(pools.allocate(gpu, layouts.frame, "shadow view set")?);
        }
        if self.ring.as_ref().is_none_or(|r| r.size < ranges.end) {
            if let Some(mut old) = self.ring.take() {
                old.destroy(gpu);
            }
            let usage = vk::BufferUsageFlags::UNIFORM_BUFFER | vk::BufferUsageFlags::STORAGE_BUFFER;
            let size = ranges.end.next_power_of_two();
            let ring = Buffer::new(gpu, "frame data", size, usage, MemoryLocation::CpuToGpu)?;
            // Every binding, read or not: lavapipe (22.3) follows what a bound set holds, and a descriptor of the buffer
            // that was just destroyed, legal where no shader reads it, crashes it.
            fill(gpu, &self.frame_set, ring.raw);
            self.view_sets.iter().for_each(|set| fill(gpu, set, ring.raw));
            self.ring = Some(ring);
        } else if let Some(ring) = &self.ring {
            self.view_sets[old_views..].iter().for_each(|set| fill(gpu, set, ring.raw));
        }
        let Some(ring) = &mut self.ring else { return Ok(()) };
        let raw = ring.raw;
        let mapped = ring.mapped_mut();
        let mut put = |at: u64, bytes: &[u8]| {
            mapped[at as usize..at as usize + bytes.len()].copy_from_slice(bytes);
        };
        let frame = frame_uniform(plan, *lights as u32);
        put(frame_at, bytemuck::bytes_of(&frame));
        if let Some(shadows) = plan.shadow_maps.as_ref().filter(|_| shadow.is_some()) {
            for (i, (view, at)) in views.iter().zip(&view_at).enumerate() {
                let seen = FrameUniform { clip_from_relative: view.clip_from_relative, ..frame };
                put(*at, bytemuck::bytes_of(&seen));
                let lookup = ShadowUniform::new(view, shadows.image);
                let at = lookups_at + (i * size_of::<ShadowUniform>()) as u64;
                put(at, bytemuck::bytes_of(&lookup));
            }
        }
        for (i, used) in plan.scene_effects.iter().enumerate() {
            put(surface_at + (i * size_of::<[f32; 8]>()) as u64, bytemuck::bytes_of(&used.parameters));
        }
        if surface_range > 0 {
            put(surface_at + REACHES_AT, bytemuck::bytes_of(&plan.displacement_limits));
        }
        put(overlay_at, overlay_bytes);
        put(lists_at, list_bytes);
        if let Some((images, sky)) = &sky {
            let maps = images.maps.as_ref().map(|(maps, _)| &**maps);
            put(sky_at, bytemuck::bytes_of(&SkyUniform::new(sky, &plan.view, maps)));
        }
        if seen.kept.is_some() {
            put(kept_at, bytemuck::bytes_of(&RebuiltUniform::new(&plan.view)));
        }
        put(joints_at, joint_bytes);
        put(morphs_at, morph_bytes);
        put(lights_at, light_bytes);
        put(instances_at, instance_bytes);
        for ([base_at, layers_at], material) in self.changed_at.iter().zip(&plan.material_overrides) {
            put(*base_at, bytemuck::bytes_of(&MaterialUniform::new(material)));
            if let Some(layers) = LayersUniform::new(material) {
                put(*layers_at, bytemuck::bytes_of(&layers));
            }
        }
        let mut before = 1;
        for (at, pass) in post_at.iter().zip(&plan.post) {
            put(*at, bytemuck::bytes_of(&PostUniform::new(pass, before, plan.size)));
            before = pass.shrink;
        }
        self.posed.place(&mut mapped[instances_at as usize..][..instance_bytes.len()]);

        // Of effects; the frame's own data where there are none, as above.
        let (texels, texel_bytes) = seen.texels.map_or((raw, 16), |b| (b.raw, b.size));
        use vk::DescriptorType as T;
        let of_views = self.view_sets.iter().zip(&view_at);
        for (set, at) in std::iter::once((&self.frame_set, &frame_at)).chain(of_views) {
            let set = set.raw;
            write_buffer(gpu, set, 0, T::UNIFORM_BUFFER, raw, *at, size_of::<FrameUniform>() as u64);
            if *instances > 0 {
                write_buffer(gpu, set, 1, T::STORAGE_BUFFER, raw, instances_at, instance_bytes.len() as u64);
            }
            if reads.joints {
                let (binding, kind) =
                    if reads.joints_uniform { (5, T::UNIFORM_BUFFER) } else { (2, T::STORAGE_BUFFER) };
                write_buffer(gpu, set, binding, kind, raw, joints_at, joints_range);
            }
            if reads.morphs {
                write_buffer(gpu, set, 3, T::STORAGE_BUFFER, raw, morphs_at, morphs_range);
            }
            if surface_range > 0 {
                write_buffer(gpu, set, 6, T::UNIFORM_BUFFER, raw, surface_at, surface_range);
            }
            if !overlay_bytes.is_empty() {
                write_buffer(gpu, set, 7, T::STORAGE_BUFFER, raw, overlay_at, overlay_bytes.len() as u64);
            }
            write_buffer(gpu, set, 8, T::STORAGE_BUFFER, texels, 0, texel_bytes);
            if !list_bytes.is_empty() {
                write_buffer(gpu, set, 9, T::STORAGE_BUFFER, raw, lists_at, list_bytes.len() as u64);
            }
            if reads.lights {
                write_buffer(gpu, set, 4, T::UNIFORM_BUFFER, raw, lights_at, lights_range);
            }
        }
        // Made anew where another of them is there: lavapipe (22.3) follows what a bound set holds, read or not.
        let under = self.under.as_ref().filter(|_| reads.layers_behind).map(|(_, image)| image.view);
        let has = [shadow.is_some(), seen.behind.is_some(), sky.is_some(), under.is_some()];
        if let Some((set, _)) = self.light_set.take_if(|(_, had)| *had != has) {
            pools.free(gpu, set);
        }
        if self.light_set.is_none() && has != [false; 4] {
            self.light_set = Some((pools.allocate(gpu, layouts.shadow, "shadows, glass and sky")?, has));
        }
        // Every binding, as above: what is not there has the place of what is, and is not read.
        let shadows = shadow.map(|t| ([t.image.view; 2], t.sampler));
        let glass = seen.behind.map(|t| ([t.image.view; 2], t.sampler));
        let of_sky = sky.and_then(|(images, _)| Some((images.views()?, images.sampler)));
        // No sampler reads it.
        let of_under = under.map(|view| ([view; 2], vk::Sampler::null()));
        let any = shadows.or(glass).or(of_sky).or(of_under);
        if let (Some((set, _)), Some(any)) = (self.light_set, any) {
            let range = |bytes: u64, at: u64| if bytes > 0 { (at, bytes) } else { (0, 16) };
            for (binding, (at, bytes)) in
                [(0, range(lookups_range, lookups_at)), (5, range(sky_range, sky_at))]
            {
                write_buffer(gpu, set.raw, binding, T::UNIFORM_BUFFER, raw, at, bytes);
            }
            for (binding, there) in [(1, shadows), (3, glass), (6, of_sky)] {
                let ([view, _], sampler) = there.unwrap_or(any);
                write_image(gpu, set.raw, binding, T::SAMPLED_IMAGE, view, vk::Sampler::null());
                if sampler != vk::Sampler::null() {
                    write_image(gpu, set.raw, binding + 1, T::SAMPLER, vk::ImageView::null(), sampler);
                }
            }
            let ([_, picture], _) = of_sky.unwrap_or(any);
            write_image(gpu, set.raw, 8, T::SAMPLED_IMAGE, picture, vk::Sampler::null());
            let ([under, _], _) = of_under.unwrap_or(any);
            write_image(gpu, set.raw, 9, T::SAMPLED_IMAGE, under, vk::Sampler::null());
            write_image(gpu, set.raw, 10, T::SAMPLED_IMAGE, under, vk::Sampler::null());
        }
        for (i, view) in seen.layers.iter().flat_map(|(views, _)| views).enumerate() {
            if self.peel_sets.len() <= i {
                self.peel_sets.push(pools.allocate(gpu, layouts.shadow, "depths of layers")?);
            }
            let set = self.peel_sets[i].raw;
            for binding in [0, 5] {
                write_buffer(gpu, set, binding, T::UNIFORM_BUFFER, raw, 0, 16);
            }
            for binding in [1, 3, 6, 8, 9, 10] {
                write_image(gpu, set, binding, T::SAMPLED_IMAGE, *view, vk::Sampler::null());
            }
            let sampler = seen.layers.map_or(vk::Sampler::null(), |(_, sampler)| sampler);
            for binding in [2, 4, 7] {
                write_image(gpu, set, binding, T::SAMPLER, vk::ImageView::null(), sampler);
            }
        }
        if let Some(views) = seen.kept {
            self.write_kept(gpu, layouts, pools, views, (raw, kept_at))?;
        }
        while self.post_sets.len() < post_at.len() {
            self.post_sets.push(pools.allocate(gpu, layouts.post, "post set")?);
        }
        for (set, at) in self.post_sets.iter().zip(&post_at) {
            write_buffer(gpu, set.raw, 0, T::UNIFORM_BUFFER, raw, *at, size_of::<PostUniform>() as u64);
            write_buffer(gpu, set.raw, 3, T::STORAGE_BUFFER, texels, 0, texel_bytes);
        }

        let pixel = if plan.linear { 8 } else { 4 };
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

    /// The picture of what lies under the scene, where it is another than this slot has; keeps what lies over it.
    pub fn prepare_flats(
        &mut self,
        gpu: &Context,
        plan: &Plan,
        uploads: &mut Uploads,
    ) -> Result<(), RenderError> {
        self.over = plan.layers_in_front.clone();
        let wanted = plan.layers_behind.as_ref().map(|flat| flat.hash);
        if let Some((_, mut old)) = self.under.take_if(|(hash, _)| Some(*hash) != wanted) {
            old.destroy(gpu);
        }
        if let (Some(flat), None) = (&plan.layers_behind, &self.under) {
            let image = flat_image(gpu, flat, uploads)?;
            self.under = Some((flat.hash, image));
        }
        Ok(())
    }

    /// What an upload that failed was to fill.
    pub fn forget_flats(&mut self, gpu: &Context) {
        if let Some((_, mut image)) = self.under.take() {
            image.destroy(gpu);
        }
    }

    /// Sets of the materials that are not as in the scene resources; after `write`, and after the resources are prepared.
    pub fn write_changed(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        scene_resources: &SceneResources,
        recording: &Recording,
        resources: &mut Resources,
    ) -> Result<(), RenderError> {
        self.changed.clear();
        // Made anew each frame: lavapipe (22.3) follows what a bound set holds, textures that are gone and not read included.
        self.changed_sets.drain(..).for_each(|set| pools.free(gpu, set));
        for command in &recording.commands {
            let Command::BindMaterial { material, material_override: Some(changed), slots } = command else {
                continue;
            };
            let (Some(ring), Some([base_at, layers_at])) =
                (&self.ring, self.changed_at.get(*changed as usize))
            else {
                return Err(RenderError::Usage("a changed material is not in the plan".into()));
            };
            if self.changed.contains(&(*changed, *slots)) {
                continue;
            }
            let made = pools.allocate(gpu, layouts.material(*slots)?.set, "changed material set")?;
            self.changed_sets.push(made);
            let set = made.raw;
            let uniform = vk::DescriptorType::UNIFORM_BUFFER;
            write_buffer(gpu, set, 0, uniform, ring.raw, *base_at, size_of::<MaterialUniform>() as u64);
            let size = size_of::<LayersUniform>() as u64;
            write_buffer(gpu, set, LayersUniform::BINDING, uniform, ring.raw, *layers_at, size);
            resources.write_textures(gpu, scene_resources, *material, *slots, set)?;
            self.changed.push((*changed, *slots));
        }
        Ok(())
    }

    pub fn changed_set(&self, changed: u32, slots: u32) -> Option<vk::DescriptorSet> {
        let place = self.changed.iter().position(|c| *c == (changed, slots))?;
        self.changed_sets.get(place).map(|set| set.raw)
    }

    pub fn release_staging(&mut self, gpu: &Context) {
        if let Some(mut staging) = self.staging.take() {
            staging.destroy(gpu);
        }
    }

    /// The frame must be done. Its sets go with the pools.
    pub fn destroy(&mut self, gpu: &Context) {
        self.release_staging(gpu);
        self.posed.destroy(gpu);
        self.forget_flats(gpu);
        for mut buffer in self.ring.take().into_iter().chain(self.readback.take()) {
            buffer.destroy(gpu);
        }
        // SAFETY: made from this device; its command buffer is not pending.
        unsafe { gpu.device.destroy_command_pool(self.pool, None) };
    }
}

/// Every binding of a set like the frame's, whatever its shaders read.
fn fill(gpu: &Context, set: &Set, buffer: vk::Buffer) {
    for (binding, kind) in FRAME_BINDINGS {
        write_buffer(gpu, set.raw, binding, kind, buffer, 0, 16);
    }
}

fn frame_uniform(plan: &Plan, light_count: u32) -> FrameUniform {
    let (top, bottom, alpha) = match plan.background {
        Background::Gradient { top, bottom } => (top, bottom, 1.0),
        Background::Color(c) => (c.truncate(), c.truncate(), c.w),
    };
    FrameUniform {
        clip_from_relative: plan.view.clip_from_relative,
        eye: plan.view.eye,
        camera: plan.view.position.as_vec3().extend(0.0),
        ambient_up: plan.ambient_up.extend(0.0),
        ambient_down: plan.ambient_down.extend(0.0),
        background_top: top.extend(alpha),
        background_bottom: bottom.extend(alpha),
        size: Vec2::new(plan.size[0] as f32, plan.size[1] as f32),
        light_count,
        pad: 0,
    }
}
