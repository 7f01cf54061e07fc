//! Descriptor set layouts, and pools that grow.

use super::context::Context;
use super::error::Named;
use crate::commands::{Command, Recording};
use crate::error::RenderError;
use crate::plan::shader_features::{FEATURES, Feature, TextureSlot};
use crate::scene_resources::material::TEXTURE_SLOTS;
pub(crate) use crate::shader::POST_TEXTURES;
use crate::shader::uniforms::LayersUniform;
use ash::vk;
use choreo_plugin::ImagePass;
use std::collections::BTreeMap;

const FRAGMENT: vk::ShaderStageFlags = vk::ShaderStageFlags::FRAGMENT;

/// Bindings of the set with the shadow maps, the scene color copy, the sky, the 2D layers behind the scene and the peeled depth.
const SCENE_SET_BINDINGS: [(u32, vk::DescriptorType, vk::ShaderStageFlags); 11] = [
    (0, vk::DescriptorType::UNIFORM_BUFFER, FRAGMENT),
    (1, vk::DescriptorType::SAMPLED_IMAGE, FRAGMENT),
    (2, vk::DescriptorType::SAMPLER, FRAGMENT),
    (3, vk::DescriptorType::SAMPLED_IMAGE, FRAGMENT),
    (4, vk::DescriptorType::SAMPLER, FRAGMENT),
    // Sky: uniform, maps, sampler of the maps, panorama.
    (5, vk::DescriptorType::UNIFORM_BUFFER, FRAGMENT),
    (6, vk::DescriptorType::SAMPLED_IMAGE, FRAGMENT),
    (7, vk::DescriptorType::SAMPLER, FRAGMENT),
    (8, vk::DescriptorType::SAMPLED_IMAGE, FRAGMENT),
    // 2D layers behind the scene.
    (9, vk::DescriptorType::SAMPLED_IMAGE, FRAGMENT),
    // Depths of the peeled layer before.
    (10, vk::DescriptorType::SAMPLED_IMAGE, FRAGMENT),
];

/// Number of sampled images that are bound for fragment shaders of surfaces beside the textures of the material.
pub(super) fn images_beside_material() -> u32 {
    SCENE_SET_BINDINGS.iter().filter(|(_, kind, _)| *kind == vk::DescriptorType::SAMPLED_IMAGE).count() as u32
}

/// Descriptor sets of scene pipelines: 0 per frame; 1 morph offsets of a primitive; 2 shadow maps, scene color copy, sky; 3 per
/// material. Set 3 is last because its layout differs with the textures that a shader reads and must not disturb the other sets.
/// A full-screen pass has only set 0.
pub(crate) struct Layouts {
    pub frame: vk::DescriptorSetLayout,
    materials: BTreeMap<u32, MaterialLayout>,
    pub morphs: vk::DescriptorSetLayout,
    pub shadow: vk::DescriptorSetLayout,
    pub post: vk::DescriptorSetLayout,
    /// Set 3 of the pass that lights the G-buffer, if a frame has had one.
    light: Option<MaterialLayout>,
    /// Meshes to pre-skin and their output vertices: set 3 of the compute stage, after the sets of the frame, the morph offsets
    /// and the source mesh.
    pub preskin: vk::DescriptorSetLayout,
    pub preskin_pipeline: vk::PipelineLayout,
}

/// Layout of materials whose shaders read the same textures.
#[derive(Clone, Copy)]
pub(crate) struct MaterialLayout {
    pub set: vk::DescriptorSetLayout,
    /// Pipeline layout with this set and the three before it.
    pub pipeline: vk::PipelineLayout,
}

fn create_set_layout(
    gpu: &Context,
    name: &str,
    bindings: &[(u32, vk::DescriptorType, vk::ShaderStageFlags)],
) -> Result<vk::DescriptorSetLayout, RenderError> {
    let bindings: Vec<_> = bindings
        .iter()
        .map(|(binding, kind, stages)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(*binding)
                .descriptor_type(*kind)
                .descriptor_count(1)
                .stage_flags(*stages)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: the device is alive; destroyed by `Layouts::destroy`.
    let layout = unsafe { gpu.device.create_descriptor_set_layout(&info, None) }.named(name)?;
    gpu.set_name(layout, name);
    Ok(layout)
}

impl Layouts {
    pub(crate) fn new(gpu: &Context) -> Result<Layouts, RenderError> {
        use vk::DescriptorType as T;
        let (vertex, fragment) = (vk::ShaderStageFlags::VERTEX, vk::ShaderStageFlags::FRAGMENT);
        let mut layouts = Layouts {
            frame: vk::DescriptorSetLayout::null(),
            materials: BTreeMap::new(),
            morphs: vk::DescriptorSetLayout::null(),
            shadow: vk::DescriptorSetLayout::null(),
            post: vk::DescriptorSetLayout::null(),
            light: None,
            preskin: vk::DescriptorSetLayout::null(),
            preskin_pipeline: vk::PipelineLayout::null(),
        };
        let both = vertex | fragment;
        let compute = vk::ShaderStageFlags::COMPUTE;
        let poses = vertex | compute;
        let frame = super::frame_in_flight::FRAME_BINDINGS.map(|(binding, kind)| {
            let stages = [both, vertex, poses, poses, fragment, poses, both, vertex, both, fragment, both];
            (binding, kind, stages[binding as usize])
        });
        let mut post = vec![
            (0, T::UNIFORM_BUFFER, fragment),
            (1, T::SAMPLED_IMAGE, fragment),
            (2, T::SAMPLED_IMAGE, fragment),
            (3, T::STORAGE_BUFFER, fragment),
            (4, T::STORAGE_BUFFER, fragment),
            (5, T::SAMPLED_IMAGE, fragment),
            (6, T::SAMPLED_IMAGE, fragment),
        ];
        // Textures of passes.
        let textures = 0..ImagePass::MOST_READ as u32;
        post.extend(textures.map(|i| (POST_TEXTURES + i, T::SAMPLED_IMAGE, fragment)));
        let made = (|| {
            layouts.frame = create_set_layout(gpu, "frame set layout", &frame)?;
            layouts.morphs = create_set_layout(gpu, "morph set layout", &[(0, T::STORAGE_BUFFER, poses)])?;
            layouts.shadow = create_set_layout(gpu, "shadow set layout", &SCENE_SET_BINDINGS)?;
            layouts.post = create_set_layout(gpu, "post set layout", &post)?;
            let preskin = [(0, T::STORAGE_BUFFER, compute), (1, T::STORAGE_BUFFER, compute)];
            layouts.preskin = create_set_layout(gpu, "set layout of meshes to be pre-skinned", &preskin)?;
            let sets = [layouts.frame, layouts.morphs, layouts.morphs, layouts.preskin];
            let constants = [vk::PushConstantRange::default().stage_flags(compute).size(8)];
            let info =
                vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&constants);
            // SAFETY: the set layouts belong to this device; destroyed by `destroy`.
            layouts.preskin_pipeline = unsafe { gpu.device.create_pipeline_layout(&info, None) }
                .named("pre-skinning pipeline layout")?;
            gpu.set_name(layouts.preskin_pipeline, "pre-skinning pipeline layout");
            Ok(())
        })();
        match made {
            Ok(()) => Ok(layouts),
            Err(e) => {
                layouts.destroy(gpu);
                Err(e)
            }
        }
    }

    /// Creates the layout of materials with these textures (one bit for each slot), if it does not exist.
    pub(crate) fn prepare_material(&mut self, gpu: &Context, slots: u32) -> Result<(), RenderError> {
        if self.materials.contains_key(&slots) {
            return Ok(());
        }
        use vk::DescriptorType as T;
        let fragment = vk::ShaderStageFlags::FRAGMENT;
        // The vertex shader reads the width of outlines.
        let vertex = vk::ShaderStageFlags::VERTEX;
        let mut bindings = vec![(0, T::UNIFORM_BUFFER, vertex | fragment)];
        for slot in (0..TEXTURE_SLOTS as u32).filter(|slot| slots & (1 << slot) != 0) {
            let read_by_vertices =
                |f: &Feature| f.texture == Some(TextureSlot { slot: slot as usize, vertex: true });
            let stage = if FEATURES.iter().any(read_by_vertices) { vertex } else { fragment };
            bindings.push((1 + 2 * slot, T::SAMPLED_IMAGE, stage));
            bindings.push((2 + 2 * slot, T::SAMPLER, stage));
        }
        bindings.push((LayersUniform::BINDING, T::UNIFORM_BUFFER, fragment));
        let made = self.with_set(gpu, "material set layout", &bindings)?;
        self.materials.insert(slots, made);
        Ok(())
    }

    /// Creates the descriptor set layout through which the lighting pass reads the G-buffer, if a recording needs it and it does not exist.
    pub(crate) fn prepare_gbuffer_layout(
        &mut self,
        gpu: &Context,
        recording: &Recording,
    ) -> Result<(), RenderError> {
        if self.light.is_none() && recording.commands.contains(&Command::BeginGBuffer) {
            self.light = Some(self.with_set(gpu, "G-buffer set layout", &super::deferred::BINDINGS)?);
        }
        Ok(())
    }

    /// Layout of the G-buffer. Fails unless it was prepared.
    pub(crate) fn light(&self) -> Result<MaterialLayout, RenderError> {
        self.light.ok_or_else(|| RenderError::Usage("the layout of the G-buffer was not prepared".into()))
    }

    /// Creates a set layout, and a pipeline layout with it after the three sets that all scene pipelines share.
    fn with_set(
        &self,
        gpu: &Context,
        name: &str,
        bindings: &[(u32, vk::DescriptorType, vk::ShaderStageFlags)],
    ) -> Result<MaterialLayout, RenderError> {
        let set = create_set_layout(gpu, name, bindings)?;
        let sets = [self.frame, self.morphs, self.shadow, set];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        // SAFETY: the set layouts belong to this device; destroyed by `destroy`.
        match unsafe { gpu.device.create_pipeline_layout(&info, None) }.named("scene pipeline layout") {
            Ok(pipeline) => {
                gpu.set_name(pipeline, "scene pipeline layout");
                Ok(MaterialLayout { set, pipeline })
            }
            Err(e) => {
                // SAFETY: just made, used by nothing.
                unsafe { gpu.device.destroy_descriptor_set_layout(set, None) };
                Err(e)
            }
        }
    }

    /// Layout of materials with these textures. Fails unless it was prepared.
    pub(crate) fn material(&self, slots: u32) -> Result<MaterialLayout, RenderError> {
        let known = self.materials.get(&slots).copied();
        known.ok_or_else(|| RenderError::Usage("a material's layout was not prepared".into()))
    }

    pub(crate) fn destroy(&mut self, gpu: &Context) {
        let light = self.light.take();
        let materials = std::mem::take(&mut self.materials);
        for MaterialLayout { set, pipeline } in materials.into_values().chain(light) {
            // SAFETY: made from this device; no pipeline or set is created from it any more.
            unsafe {
                gpu.device.destroy_pipeline_layout(pipeline, None);
                gpu.device.destroy_descriptor_set_layout(set, None);
            }
        }
        // SAFETY: made from this device (or null); no pipeline is created from it any more.
        unsafe { gpu.device.destroy_pipeline_layout(self.preskin_pipeline, None) };
        for layout in [self.frame, self.morphs, self.shadow, self.post, self.preskin] {
            // SAFETY: made from this device (or null); no pipeline or set is created from it any more.
            unsafe { gpu.device.destroy_descriptor_set_layout(layout, None) };
        }
    }
}

/// A descriptor set, and the pool that it is returned to.
#[derive(Clone, Copy)]
pub(crate) struct Set {
    pub raw: vk::DescriptorSet,
    pool: vk::DescriptorPool,
}

#[derive(Default)]
pub(crate) struct Pools {
    pools: Vec<vk::DescriptorPool>,
}

const SETS_PER_POOL: u32 = 64;

impl Pools {
    pub(crate) fn count(&self) -> usize {
        self.pools.len()
    }

    pub(crate) fn allocate(
        &mut self,
        gpu: &Context,
        layout: vk::DescriptorSetLayout,
        name: &str,
    ) -> Result<Set, RenderError> {
        for &pool in self.pools.iter().rev() {
            if let Ok(set) = allocate(gpu, pool, layout) {
                gpu.set_name(set.raw, name);
                return Ok(set);
            }
        }
        let pool = self.grow(gpu)?;
        let set = allocate(gpu, pool, layout).named(name)?;
        gpu.set_name(set.raw, name);
        Ok(set)
    }

    fn grow(&mut self, gpu: &Context) -> Result<vk::DescriptorPool, RenderError> {
        let size = |ty, each: u32| vk::DescriptorPoolSize { ty, descriptor_count: each * SETS_PER_POOL };
        // Enough descriptors of each kind for a pool full of the set that has most of them.
        let sizes = [
            size(vk::DescriptorType::UNIFORM_BUFFER, 4),
            size(vk::DescriptorType::STORAGE_BUFFER, 7),
            size(vk::DescriptorType::SAMPLED_IMAGE, TEXTURE_SLOTS as u32),
            size(vk::DescriptorType::SAMPLER, TEXTURE_SLOTS as u32),
        ];
        let info = vk::DescriptorPoolCreateInfo::default()
            .flags(vk::DescriptorPoolCreateFlags::FREE_DESCRIPTOR_SET)
            .max_sets(SETS_PER_POOL)
            .pool_sizes(&sizes);
        // SAFETY: the device is alive; destroyed by `Pools::destroy`.
        let pool = unsafe { gpu.device.create_descriptor_pool(&info, None) }.named("descriptor pool")?;
        self.pools.push(pool);
        Ok(pool)
    }

    /// Frees a set. No frame in flight may use it.
    pub(crate) fn free(&mut self, gpu: &Context, set: Set) {
        // SAFETY: allocated from this pool, which allows freeing. The call cannot fail (it only returns success).
        let _ = unsafe { gpu.device.free_descriptor_sets(set.pool, &[set.raw]) };
    }

    pub(crate) fn destroy(&mut self, gpu: &Context) {
        for pool in self.pools.drain(..) {
            // SAFETY: made from this device; no frame in flight uses its sets.
            unsafe { gpu.device.destroy_descriptor_pool(pool, None) };
        }
    }
}

fn allocate(
    gpu: &Context,
    pool: vk::DescriptorPool,
    layout: vk::DescriptorSetLayout,
) -> Result<Set, vk::Result> {
    let layouts = [layout];
    let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
    // SAFETY: pool and layout belong to this device.
    let sets = unsafe { gpu.device.allocate_descriptor_sets(&info) }?;
    Ok(Set { raw: sets[0], pool })
}

/// Writes a buffer range to a binding.
pub(crate) fn write_buffer(
    gpu: &Context,
    set: vk::DescriptorSet,
    binding: u32,
    kind: vk::DescriptorType,
    buffer: vk::Buffer,
    offset: u64,
    range: u64,
) {
    let info = [vk::DescriptorBufferInfo { buffer, offset, range }];
    let write = vk::WriteDescriptorSet::default()
        .dst_set(set)
        .dst_binding(binding)
        .descriptor_type(kind)
        .buffer_info(&info);
    // SAFETY: set and buffer are alive, and no frame in flight uses the set.
    unsafe { gpu.device.update_descriptor_sets(&[write], &[]) };
}

/// Writes an image in shader-read layout, or a sampler, to a binding.
pub(crate) fn write_image(
    gpu: &Context,
    set: vk::DescriptorSet,
    binding: u32,
    kind: vk::DescriptorType,
    view: vk::ImageView,
    sampler: vk::Sampler,
) {
    let info = [vk::DescriptorImageInfo {
        sampler,
        image_view: view,
        image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
    }];
    let write = vk::WriteDescriptorSet::default()
        .dst_set(set)
        .dst_binding(binding)
        .descriptor_type(kind)
        .image_info(&info);
    // SAFETY: set, view and sampler are alive, and no frame in flight uses the set.
    unsafe { gpu.device.update_descriptor_sets(&[write], &[]) };
}
