//! Meshes, textures, samplers and materials on the device, created when a frame first needs them and kept by content.

use super::context::Context;
use super::descriptors::{Layouts, Pools, Set, write_buffer, write_image};
use super::device_features::Ability;
use super::error::Named;
use super::memory::{Buffer, Image, ImageDesc};
use super::preskin::Sources;
use super::sky::SkyImages;
use super::streams::Streams;
use super::upload::Uploads;
use crate::commands::{Command, Recording};
use crate::error::RenderError;
use crate::plan::Features;
use crate::renderer::CreatedCounts;
use crate::scene_resources::material::is_anisotropic;
use crate::scene_resources::mipmap;
use crate::scene_resources::vertex_layout::{VertexLayout, pack, pack_morphs};
use crate::scene_resources::{PrimitiveResource, SceneResources};
use crate::shader::uniforms::{LayersUniform, MaterialUniform};
use ash::vk;
use choreo_asset::{Sampler, Wrap};
use gpu_allocator::MemoryLocation;
use rayon::prelude::*;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};

type Hash = [u8; 16];

pub(crate) struct Mesh {
    pub buffer: Buffer,
    /// Offset of the indices, after the vertices.
    pub index_offset: u64,
    pub index_count: u32,
    pub vertex_count: u32,
    pub index_type: vk::IndexType,
}

struct Morphs {
    buffer: Buffer,
    set: Set,
}

/// Largest alignment that a device may require (`minUniformBufferOffsetAlignment`).
const UNIFORM_ALIGNMENT: u64 = 256;

struct Material {
    /// The uniform of the material, then the uniform of its layers.
    uniform: Buffer,
    set: Set,
}

/// Content hash, whether sRGB, whether with mipmaps.
pub(super) type TextureKey = (Hash, bool, bool);

#[derive(Default)]
pub(crate) struct Resources {
    meshes: HashMap<(Hash, VertexLayout), Mesh>,
    morphs: HashMap<(Hash, VertexLayout), Morphs>,
    textures: HashMap<TextureKey, Image>,
    samplers: HashMap<Sampler, vk::Sampler>,
    /// The requested anisotropy; see `GpuOptions::anisotropy`.
    pub anisotropy: f32,
    /// Materials by content and by the texture slots that the shader reads.
    materials: HashMap<(Hash, u32), Material>,
    white: Option<Image>,
    pub sky: Option<SkyImages>,
    pub(super) pools: Pools,
    pub(super) sources: Sources,
    pub(super) streams: Streams,
    /// Numbers of objects created so far.
    pub created_counts: CreatedCounts,
}

impl Resources {
    pub(crate) fn mesh(&self, hash: Hash, layout: VertexLayout) -> Option<&Mesh> {
        self.meshes.get(&(hash, layout))
    }

    pub(crate) fn morph_set(&self, hash: Hash, layout: VertexLayout) -> Option<vk::DescriptorSet> {
        self.morphs.get(&(hash, layout)).map(|m| m.set.raw)
    }

    pub(crate) fn material_set(&self, material: Hash, slots: u32) -> Option<vk::DescriptorSet> {
        self.materials.get(&(material, slots)).map(|m| m.set.raw)
    }

    /// Numbers of meshes, textures and materials on the device.
    pub(crate) fn counts(&self) -> [usize; 3] {
        [self.meshes.len(), self.textures.len(), self.materials.len()]
    }

    pub(crate) fn descriptor_pools(&self) -> usize {
        self.pools.count()
    }

    /// Creates the resources that a recording binds and that do not exist yet.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        resources: &SceneResources,
        recording: &Recording,
        uploads: &mut Uploads,
    ) -> Result<(), RenderError> {
        let mut meshes = HashSet::new();
        let mut materials = HashSet::new();
        for command in &recording.commands {
            match command {
                Command::BindMaterial { material, slots, .. }
                    if resources
                        .materials
                        .get(*material as usize)
                        .is_none_or(|m| !self.materials.contains_key(&(m.hash, *slots))) =>
                {
                    materials.insert((*material, *slots));
                }
                Command::BindMesh { primitive, layout, morphs } => {
                    meshes.insert((*primitive, *layout, *morphs));
                }
                Command::Preskin { variant, primitive, layout, .. } => {
                    meshes.insert((*primitive, *layout, variant.features.has(Features::MORPH)));
                }
                _ => {}
            }
        }
        // Sorted, so that uploads have the same order in every run.
        let mut meshes: Vec<_> = meshes.into_iter().collect();
        meshes.sort_unstable();
        let mut materials: Vec<_> = materials.into_iter().collect();
        materials.sort_unstable();
        for (primitive, layout, morphs) in meshes {
            let entry = resources.primitives.get(primitive as usize).ok_or_else(|| {
                RenderError::Usage(format!(
                    "the plan draws primitive {primitive}, which the loaded scene resources lack"
                ))
            })?;
            self.prepare_mesh(gpu, layouts, entry, layout, morphs, uploads)?;
        }
        self.prepare_sources(gpu, layouts, resources, recording)?;
        let reads = recording.reads();
        if let Some(panorama) = resources.sky.as_deref().filter(|_| reads.sky) {
            let sky = match self.sky.take() {
                Some(sky) => sky,
                None => SkyImages::new(gpu, panorama)?,
            };
            let maps = reads.sky_maps;
            self.sky.insert(sky).prepare(gpu, panorama, [maps, reads.sky_background], uploads)?;
        }
        self.prepare_textures(gpu, resources, &materials, uploads)?;
        for (material, slots) in materials {
            self.prepare_material(gpu, layouts, resources, material, slots, uploads)?;
        }
        self.drop_unused_textures(gpu, resources, recording);
        Ok(())
    }

    fn prepare_mesh(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        entry: &PrimitiveResource,
        layout: VertexLayout,
        morphs: bool,
        uploads: &mut Uploads,
    ) -> Result<(), RenderError> {
        let key = (entry.hash, layout);
        let primitive = entry.primitive();
        if let Entry::Vacant(slot) = self.meshes.entry(key) {
            let packed = pack(primitive, entry.indices(layout), layout);
            let index_offset = packed.vertices.len().next_multiple_of(4) as u64;
            let mut bytes = packed.vertices;
            bytes.resize(index_offset as usize, 0);
            bytes.extend_from_slice(&packed.indices);
            let usage = vk::BufferUsageFlags::VERTEX_BUFFER
                | vk::BufferUsageFlags::INDEX_BUFFER
                | vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::TRANSFER_DST;
            let name = format!("mesh \"{}\" primitive {}", entry.mesh.name, entry.index);
            let buffer = Buffer::new(gpu, &name, bytes.len() as u64, usage, MemoryLocation::GpuOnly)?;
            uploads.add_buffer(buffer.raw, &bytes);
            self.created_counts.meshes += 1;
            let index_type = if packed.wide_indices { vk::IndexType::UINT32 } else { vk::IndexType::UINT16 };
            slot.insert(Mesh {
                buffer,
                index_offset,
                index_count: packed.index_count,
                vertex_count: packed.vertex_count,
                index_type,
            });
        }
        if morphs && !self.morphs.contains_key(&key) {
            let bytes = pack_morphs(primitive, entry.indices(layout), layout);
            let limit = gpu.limits().max_storage_buffer_range as u64;
            let name = format!("morph targets of mesh \"{}\" primitive {}", entry.mesh.name, entry.index);
            if bytes.len() as u64 > limit {
                return Err(RenderError::Limit {
                    what: format!("size in bytes of the {name}"),
                    value: bytes.len() as u64,
                    limit,
                });
            }
            let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_DST;
            let mut buffer = Buffer::new(gpu, &name, bytes.len() as u64, usage, MemoryLocation::GpuOnly)?;
            let set = match self.pools.allocate(gpu, layouts.morphs, &name) {
                Ok(set) => set,
                Err(e) => {
                    buffer.destroy(gpu);
                    return Err(e);
                }
            };
            let kind = vk::DescriptorType::STORAGE_BUFFER;
            write_buffer(gpu, set.raw, 0, kind, buffer.raw, 0, vk::WHOLE_SIZE);
            uploads.add_buffer(buffer.raw, &bytes);
            self.morphs.insert(key, Morphs { buffer, set });
        }
        Ok(())
    }

    fn prepare_textures(
        &mut self,
        gpu: &Context,
        resources: &SceneResources,
        materials: &[(u32, u32)],
        uploads: &mut Uploads,
    ) -> Result<(), RenderError> {
        let mut wanted: Vec<u32> = Vec::new();
        let mut white = false;
        for (material, slots) in materials {
            let Some(m) = resources.materials.get(*material as usize) else {
                return Err(RenderError::Usage(format!(
                    "the plan uses material {material}, which the loaded scene resources lack"
                )));
            };
            for (slot, texture) in m.textures.iter().enumerate() {
                match texture {
                    _ if slots & (1 << slot) == 0 => {}
                    Some(t) => wanted.push(t.texture),
                    None => white = true,
                }
            }
        }
        wanted.sort_unstable();
        wanted.dedup();
        wanted.retain(|t| !self.textures.contains_key(&texture_key(resources, *t)));
        if white && self.white.is_none() {
            let image = texture_image(gpu, "white texture", 1, 1, 1, false)?;
            uploads.add_image(image.raw, std::iter::once((1, 1, &[255u8; 4][..])));
            self.white = Some(image);
        }
        let chains: Vec<_> = wanted
            .par_iter()
            .map(|t| {
                let texture = resources.textures[*t as usize].with_loaded_pixels()?;
                let chain = match texture.mipmaps {
                    true => mipmap::levels_below(&texture.image, texture.srgb),
                    false => Vec::new(),
                };
                Ok((texture, chain))
            })
            .collect::<Result<_, RenderError>>()?;
        for (t, (texture, chain)) in wanted.iter().zip(chains) {
            let image = &texture.image;
            let name = format!("texture \"{}\"", image.name);
            let levels = 1 + chain.len() as u32;
            let made = texture_image(gpu, &name, image.width, image.height, levels, texture.srgb)?;
            let base = (image.width, image.height, &image.rgba[..]);
            let below = chain.iter().map(|l| (l.width, l.height, &l.rgba[..]));
            uploads.add_image(made.raw, std::iter::once(base).chain(below));
            self.textures.insert(texture_key(resources, *t), made);
            self.created_counts.textures += 1;
        }
        Ok(())
    }

    fn prepare_material(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        resources: &SceneResources,
        index: u32,
        slots: u32,
        uploads: &mut Uploads,
    ) -> Result<(), RenderError> {
        let material = &resources.materials[index as usize];
        let name = format!("material \"{}\"", material.material.name);
        let usage = vk::BufferUsageFlags::UNIFORM_BUFFER | vk::BufferUsageFlags::TRANSFER_DST;
        let base = MaterialUniform::new(material);
        let layers = LayersUniform::new(material);
        let mut bytes = bytemuck::bytes_of(&base).to_vec();
        let size = bytes.len() as u64;
        let layers_at = size.next_multiple_of(UNIFORM_ALIGNMENT);
        if let Some(layers) = &layers {
            bytes.resize(layers_at as usize, 0);
            bytes.extend_from_slice(bytemuck::bytes_of(layers));
        }
        let mut uniform = Buffer::new(gpu, &name, bytes.len() as u64, usage, MemoryLocation::GpuOnly)?;
        let set = match layouts.material(slots).and_then(|l| self.pools.allocate(gpu, l.set, &name)) {
            Ok(set) => set,
            Err(e) => {
                uniform.destroy(gpu);
                return Err(e);
            }
        };
        // Inserted into the table first, so that it is destroyed with the rest if a later step fails.
        let raw = uniform.raw;
        self.materials.insert((material.hash, slots), Material { uniform, set });
        self.created_counts.materials += 1;
        write_buffer(gpu, set.raw, 0, vk::DescriptorType::UNIFORM_BUFFER, raw, 0, size);
        if layers.is_some() {
            let size = size_of::<LayersUniform>() as u64;
            let kind = vk::DescriptorType::UNIFORM_BUFFER;
            write_buffer(gpu, set.raw, LayersUniform::BINDING, kind, raw, layers_at, size);
        }
        uploads.add_buffer(raw, &bytes);
        self.write_textures(gpu, resources, index, slots, set.raw)
    }

    /// Writes the textures and samplers of a material to a descriptor set. They must be prepared.
    pub(crate) fn write_textures(
        &mut self,
        gpu: &Context,
        resources: &SceneResources,
        index: u32,
        slots: u32,
        set: vk::DescriptorSet,
    ) -> Result<(), RenderError> {
        let material = &resources.materials[index as usize];
        for (slot, texture) in material.textures.iter().enumerate() {
            let binding = 1 + 2 * slot as u32;
            let null = (vk::ImageView::null(), vk::Sampler::null());
            if slots & (1 << slot) == 0 {
                continue;
            }
            let (view, sampler) = match texture {
                Some(t) => (self.textures.get(&texture_key(resources, t.texture)).map(|i| i.view), t.sampler),
                None => (self.white.as_ref().map(|i| i.view), Sampler::default()),
            };
            let view = view.ok_or_else(|| {
                RenderError::Usage(format!(
                    "material \"{}\" lacks its texture {slot}",
                    material.material.name
                ))
            })?;
            let sampler = self.sampler(gpu, sampler)?;
            write_image(gpu, set, binding, vk::DescriptorType::SAMPLED_IMAGE, view, null.1);
            write_image(gpu, set, binding + 1, vk::DescriptorType::SAMPLER, null.0, sampler);
        }
        Ok(())
    }

    fn sampler(&mut self, gpu: &Context, s: Sampler) -> Result<vk::Sampler, RenderError> {
        if let Some(sampler) = self.samplers.get(&s) {
            return Ok(*sampler);
        }
        let wrap = |w| match w {
            Wrap::Repeat => vk::SamplerAddressMode::REPEAT,
            Wrap::MirroredRepeat => vk::SamplerAddressMode::MIRRORED_REPEAT,
            Wrap::ClampToEdge => vk::SamplerAddressMode::CLAMP_TO_EDGE,
        };
        let filter = |linear| if linear { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
        let slanted = is_anisotropic(&s);
        let anisotropy = match slanted && gpu.abilities.has(Ability::SamplerAnisotropy) {
            true => self.anisotropy.clamp(1.0, gpu.limits().max_sampler_anisotropy),
            false => 1.0,
        };
        let info = vk::SamplerCreateInfo::default()
            .address_mode_u(wrap(s.wrap_u))
            .address_mode_v(wrap(s.wrap_v))
            .mag_filter(filter(s.mag_linear))
            .min_filter(filter(s.min_linear))
            .mipmap_mode(match s.mip_linear {
                Some(true) => vk::SamplerMipmapMode::LINEAR,
                _ => vk::SamplerMipmapMode::NEAREST,
            })
            // A texture without mipmaps is read at level 0 only, but with the minification filter if the level of detail says so
            // (Vulkan, "VkSamplerCreateInfo", the table of GL equivalents).
            .max_lod(if s.mip_linear.is_some() { vk::LOD_CLAMP_NONE } else { 0.25 })
            .anisotropy_enable(anisotropy > 1.0)
            .max_anisotropy(anisotropy);
        // SAFETY: the device is alive; destroyed by `destroy`.
        let sampler = unsafe { gpu.device.create_sampler(&info, None) }.named("sampler")?;
        gpu.set_name(sampler, &format!("{s:?}"));
        self.samplers.insert(s, sampler);
        Ok(sampler)
    }

    /// Drops all resources that the new scene resources do not contain. No frame may be in flight.
    pub(crate) fn retain(&mut self, gpu: &Context, resources: &SceneResources) {
        let primitives: HashSet<Hash> = resources.primitives.iter().map(|p| p.hash).collect();
        let textures: HashSet<TextureKey> =
            (0..resources.textures.len() as u32).map(|t| texture_key(resources, t)).collect();
        self.keep_streams(|key| textures.contains(key));
        self.retain_sources(gpu, |hash| primitives.contains(hash));
        let pools = &mut self.pools;
        let materials: HashSet<Hash> = resources.materials.iter().map(|m| m.hash).collect();
        self.materials.retain(|(hash, _), m| {
            let keep = materials.contains(hash);
            if !keep {
                m.uniform.destroy(gpu);
                pools.free(gpu, m.set);
            }
            keep
        });
        self.meshes.retain(|(hash, _), m| {
            let keep = primitives.contains(hash);
            if !keep {
                m.buffer.destroy(gpu);
            }
            keep
        });
        self.morphs.retain(|(hash, _), m| {
            let keep = primitives.contains(hash);
            if !keep {
                m.buffer.destroy(gpu);
                pools.free(gpu, m.set);
            }
            keep
        });
        if let Some(mut sky) = self.sky.take_if(|sky| !sky.shows_panorama(resources.sky.as_deref())) {
            sky.destroy(gpu);
        }
        self.textures.retain(|key, image| {
            let keep = textures.contains(key);
            if !keep {
                image.destroy(gpu);
            }
            keep
        });
    }

    /// Drops a material. No frame in flight may use it.
    pub(super) fn forget_material(&mut self, gpu: &Context, material: Hash) {
        let pools = &mut self.pools;
        self.materials.retain(|(hash, _), m| {
            let keep = *hash != material;
            if !keep {
                m.uniform.destroy(gpu);
                pools.free(gpu, m.set);
            }
            keep
        });
    }

    /// Drops a texture. No frame in flight may use it.
    pub(super) fn forget_texture(&mut self, gpu: &Context, key: &TextureKey) {
        if let Some(mut image) = self.textures.remove(key) {
            image.destroy(gpu);
        }
    }

    /// Drops all objects with uploaded bytes. No frame may be in flight.
    pub(crate) fn forget(&mut self, gpu: &Context) {
        self.retain(gpu, &SceneResources::default());
        if let Some(mut white) = self.white.take() {
            white.destroy(gpu);
        }
    }

    /// Destroys all objects. No frame may be in flight.
    pub(crate) fn destroy(&mut self, gpu: &Context) {
        self.forget(gpu);
        for (_, sampler) in self.samplers.drain() {
            // SAFETY: made from this device, no longer used.
            unsafe { gpu.device.destroy_sampler(sampler, None) };
        }
        self.pools.destroy(gpu);
    }
}

pub(super) fn texture_key(resources: &SceneResources, texture: u32) -> TextureKey {
    let t = &resources.textures[texture as usize];
    (t.hash, t.srgb, t.mipmaps)
}

fn texture_image(
    gpu: &Context,
    name: &str,
    width: u32,
    height: u32,
    levels: u32,
    srgb: bool,
) -> Result<Image, RenderError> {
    Image::new(
        gpu,
        &ImageDesc {
            name,
            width,
            height,
            levels,
            samples: 1,
            format: if srgb { vk::Format::R8G8B8A8_SRGB } else { vk::Format::R8G8B8A8_UNORM },
            usage: vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
            aspect: vk::ImageAspectFlags::COLOR,
        },
    )
}
