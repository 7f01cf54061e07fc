//! The data of one frame: the position of each part in the frame's mapped buffer, and its contents.

use super::context::Context;
use super::targets::FrameImages;
use crate::affine::Affine3x4;
use crate::commands::{Command, MAX_UNIFORM_JOINTS, Recording, ResourceReads};
use crate::error::RenderError;
use crate::plan::build::shadow_cascades::MAX_VIEWS;
use crate::plan::light_clusters::MAX_LIGHTS;
use crate::plan::{Plan, PlanLight, PostPass};
use crate::shader::uniforms::{
    FrameUniform, LayersUniform, MaterialUniform, PostUniform, RebuiltUniform, ShadowUniform, SkyUniform,
};
use ash::vk;
use choreo_plugin::ImagePass;
use choreo_stage::Background;
use glam::{Mat4, Vec2, Vec4};

/// A range of the frame's buffer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Block {
    pub at: u64,
    pub bytes: u64,
}

impl Block {
    /// A range for a descriptor, which must not be empty even if nothing reads it.
    pub(crate) fn nonempty(self) -> Block {
        if self.bytes > 0 { self } else { Block { at: 0, bytes: 16 } }
    }
}

/// Allocates blocks one after the other.
struct Blocks {
    end: u64,
    align: u64,
}

impl Blocks {
    fn new(limits: &vk::PhysicalDeviceLimits) -> Blocks {
        let align = limits
            .min_uniform_buffer_offset_alignment
            .max(limits.min_storage_buffer_offset_alignment)
            .max(16);
        Blocks { end: 0, align }
    }

    fn allocate(&mut self, bytes: usize) -> Block {
        let at = self.end.next_multiple_of(self.align);
        self.end = at + bytes as u64;
        Block { at, bytes: bytes as u64 }
    }

    /// Allocates `count` values of a type if `is_there`, else an empty block.
    fn allocate_if<T>(&mut self, is_there: bool, count: usize) -> Block {
        self.allocate(if is_there { count * size_of::<T>() } else { 0 })
    }
}

/// Block of a storage buffer, and the data of the plan that is copied into it unchanged.
struct CopiedData<'a> {
    name: &'static str,
    block: Block,
    data: &'a [u8],
}

/// Positions of all parts of a frame's data.
pub(super) struct FrameData<'a> {
    pub reads: ResourceReads,
    /// Total size in bytes.
    pub bytes: u64,
    light_count: u32,
    pub frame: Block,
    /// The frame's uniform with the view of each shadow map in place of the camera.
    pub views: Vec<Block>,
    /// The uniform of each overridden material and that of its layers.
    pub materials: Vec<[Block; 2]>,
    pub shadow_lookups: Block,
    pub sky: Block,
    pub rebuilt: Block,
    pub post: Vec<Block>,
    pub instances: Block,
    pub morphs: Block,
    pub lights: Block,
    pub joints: Block,
    pub surface: Block,
    pub overlay: Block,
    pub light_clusters: Block,
    /// Fault records of effects.
    pub faults: Block,
    copied_data: [CopiedData<'a>; 6],
}

impl<'a> FrameData<'a> {
    pub(super) fn new(
        gpu: &Context,
        plan: &'a Plan,
        recording: &Recording,
        images: &FrameImages<'_>,
    ) -> Result<FrameData<'a>, RenderError> {
        let Some(Command::UploadFrameData { instances, joints, morphs, lights }) = recording.commands.first()
        else {
            return Err(RenderError::Usage("the recording does not begin with its frame data".into()));
        };
        let reads = recording.reads();
        let limits = gpu.limits();
        let mut blocks = Blocks::new(limits);
        let views = plan.shadow_maps.as_ref().map_or(0, |s| s.views.len());
        let [instance_data, joint_data, morph_data, light_data, overlay_data]: [&[u8]; 5] = [
            bytemuck::cast_slice(&plan.instances[..*instances]),
            bytemuck::cast_slice(&plan.joint_matrices[..*joints]),
            bytemuck::cast_slice(&plan.morphs[..*morphs]),
            bytemuck::cast_slice(&plan.lights[..*lights]),
            bytemuck::cast_slice(&plan.overlay.vertices),
        ];
        let cluster_data: &[u8] = plan.light_clusters.as_ref().map_or(&[], |l| bytemuck::cast_slice(&l.0));
        let joint_bytes = match reads.joints_uniform {
            true => MAX_UNIFORM_JOINTS * size_of::<Affine3x4>(),
            false => joint_data.len().max(size_of::<Affine3x4>()),
        };
        let sky = images.sky.is_some() && reads.sky && plan.sky.is_some();
        let frame = blocks.allocate(size_of::<FrameUniform>());
        let instances = blocks.allocate(instance_data.len());
        // A shader may be compiled for morphs although no instance has any; its binding must not be empty.
        let morphs = blocks.allocate(morph_data.len().max(16));
        let joints = blocks.allocate(joint_bytes);
        // Uniform arrays have a fixed length in the shader; elements after the used ones are never read.
        let light_block = blocks.allocate_if::<PlanLight>(reads.lights, MAX_LIGHTS);
        let overlay = blocks.allocate(overlay_data.len());
        let light_clusters = blocks.allocate(cluster_data.len());
        let has_effects = !plan.post.is_empty() || !plan.scene_effects.is_empty();
        let copied_data = |what, block, data| CopiedData { name: what, block, data };
        let data = FrameData {
            reads,
            light_count: *lights as u32,
            frame,
            views: (0..views).map(|_| blocks.allocate(size_of::<FrameUniform>())).collect(),
            materials: plan
                .material_overrides
                .iter()
                .map(|_| {
                    [size_of::<MaterialUniform>(), size_of::<LayersUniform>()].map(|s| blocks.allocate(s))
                })
                .collect(),
            shadow_lookups: blocks.allocate_if::<ShadowUniform>(images.shadow.is_some(), MAX_VIEWS),
            sky: blocks.allocate_if::<SkyUniform>(sky, 1),
            rebuilt: blocks.allocate_if::<RebuiltUniform>(images.gbuffer.is_some(), 1),
            post: plan.post.iter().map(|pass| blocks.allocate(PostUniform::bytes(pass))).collect(),
            surface: blocks.allocate(plan.surface_rows() * size_of::<Vec4>()),
            instances,
            morphs,
            lights: light_block,
            joints,
            overlay,
            light_clusters,
            faults: blocks.allocate(if has_effects { images.faults } else { 0 }),
            copied_data: [
                copied_data("instances", instances, instance_data),
                copied_data("joint matrices", joints, joint_data),
                copied_data("weights of morph targets", morphs, morph_data),
                copied_data("vertices that effects draw", overlay, overlay_data),
                copied_data("light clusters", light_clusters, cluster_data),
                copied_data("lights", light_block, light_data),
            ],
            bytes: blocks.end,
        };
        data.check(u64::from(limits.max_storage_buffer_range))?;
        Ok(data)
    }

    /// Fails if a shader would read more from one buffer than the device's limit.
    fn check(&self, limit: u64) -> Result<(), RenderError> {
        match self.copied_data.iter().find(|s| s.data.len() as u64 > limit) {
            Some(CopiedData { name, data, .. }) => {
                let what = format!("size in bytes of all {name}");
                Err(RenderError::Limit { what, value: data.len() as u64, limit })
            }
            None => Ok(()),
        }
    }

    /// Blocks of the uniforms of the frame and of each shadow view.
    pub(crate) fn frame_and_views(&self) -> impl Iterator<Item = Block> {
        std::iter::once(self.frame).chain(self.views.iter().copied())
    }

    /// Copies everything into the frame's buffer.
    pub(super) fn write(&self, plan: &Plan, images: &FrameImages<'_>, mapped: &mut [u8]) {
        let mut put = |at: u64, bytes: &[u8]| {
            mapped[at as usize..at as usize + bytes.len()].copy_from_slice(bytes);
        };
        for CopiedData { block, data, .. } in &self.copied_data {
            put(block.at, data);
        }
        put(self.faults.at, &vec![u8::MAX; self.faults.bytes as usize]);
        let frame = frame_uniform(plan, self.light_count);
        put(self.frame.at, bytemuck::bytes_of(&frame));
        if let Some(shadows) = plan.shadow_maps.as_ref().filter(|_| images.shadow.is_some()) {
            for (i, (view, block)) in shadows.views.iter().zip(&self.views).enumerate() {
                let seen = FrameUniform { clip_from_relative: view.clip_from_relative, ..frame };
                put(block.at, bytemuck::bytes_of(&seen));
                let at = self.shadow_lookups.at + (i * size_of::<ShadowUniform>()) as u64;
                put(at, bytemuck::bytes_of(&ShadowUniform::new(view, shadows.image)));
            }
        }
        for (used, row) in plan.scene_effects.iter().zip(plan.first_rows()) {
            put(
                self.surface.at + u64::from(row) * size_of::<Vec4>() as u64,
                bytemuck::cast_slice(&used.parameters),
            );
        }
        if self.surface.bytes > 0 {
            put(self.surface.at, bytemuck::bytes_of(&plan.displacement_limits));
        }
        if let (Some(images), Some(sky), true) = (images.sky, &plan.sky, self.sky.bytes > 0) {
            let maps = images.maps.as_ref().map(|(maps, _)| &**maps);
            put(self.sky.at, bytemuck::bytes_of(&SkyUniform::new(sky, &plan.view, maps)));
        }
        if self.rebuilt.bytes > 0 {
            put(self.rebuilt.at, bytemuck::bytes_of(&RebuiltUniform::new(&plan.view)));
        }
        for ([own, layers], material) in self.materials.iter().zip(&plan.material_overrides) {
            put(own.at, bytemuck::bytes_of(&MaterialUniform::new(material)));
            if let Some(uniform) = LayersUniform::new(material) {
                put(layers.at, bytemuck::bytes_of(&uniform));
            }
        }
        let mut before = 1;
        for (i, (block, pass)) in self.post.iter().zip(&plan.post).enumerate() {
            let scales = texture_scales(pass, &plan.post[..i]);
            put(
                block.at,
                bytemuck::bytes_of(&PostUniform::new(pass, before, plan.size, scales, &plan.effect_frame)),
            );
            put(block.at + size_of::<PostUniform>() as u64, bytemuck::cast_slice(PostUniform::rest(pass)));
            // All passes of an effect with textures read the image that the effect received.
            before = if pass.texture.is_some() { before } else { pass.shrink };
        }
    }
}

/// Factors by which the textures that a pass reads are smaller than the whole image.
fn texture_scales(pass: &PostPass, before: &[PostPass]) -> [f32; ImagePass::MOST_READ] {
    let mut scales = [1.0; ImagePass::MOST_READ];
    for (scale, number) in scales.iter_mut().zip(&pass.reads) {
        let read = before.iter().rev().find(|pass| pass.number == *number);
        *scale = read.map_or(1.0, |pass| pass.shrink.max(1) as f32);
    }
    scales
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
        exposure: plan.exposure,
        clip_before: plan.scene_inputs.as_ref().map_or(Mat4::ZERO, |pass| pass.clip_before),
        camera_before: plan.scene_inputs.as_ref().map_or(Vec4::ZERO, |pass| pass.camera_before.extend(0.0)),
    }
}
