//! Collects the resources of a stage's assets.

use crate::scene_resources::bounds::PrimitiveInfo;
use crate::scene_resources::content_hash::{material_content, material_hash, short};
use crate::scene_resources::lod::{CROWD, LodLevel, simplified};
use crate::scene_resources::material::{MaterialResource, MaterialTexture, slot_sources};
use crate::scene_resources::{
    AssetEntry, PrimitiveEntry, PrimitiveResource, SceneResources, TextureResource,
};
use choreo_asset::{Asset, Image, ImageStream, Material, Mesh, Shading, TextureRef};
use choreo_stage::Stage;
use glam::Vec4;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};
use std::collections::HashMap;
use std::sync::Arc;

impl SceneResources {
    /// Every distinct primitive, material and texture of the stage's assets, in order of first use.
    pub fn new(stage: &Stage) -> SceneResources {
        SceneResources::after(&SceneResources::default(), stage)
    }

    /// The same as `new`. Assets that the earlier resources were made of are not hashed and measured again.
    pub fn after(earlier: &SceneResources, stage: &Stage) -> SceneResources {
        let mut builder = Builder::default();
        for p in &earlier.primitives {
            builder.known_primitives.insert((Arc::as_ptr(&p.mesh), p.index), (p.hash, p.info.clone()));
        }
        builder.image_hashes = earlier.textures.iter().map(|t| (Arc::as_ptr(&t.image), t.hash)).collect();
        let mut asset_ids: HashMap<*const Asset, u32> = HashMap::new();
        for actor in &stage.actors {
            let id = *asset_ids.entry(Arc::as_ptr(&actor.asset)).or_insert_with(|| {
                let entry = builder.asset(&actor.asset);
                builder.resources.assets.push(entry);
                builder.resources.assets.len() as u32 - 1
            });
            builder.resources.asset_of_actor.push(id);
        }
        builder.add_lods(earlier, stage);
        let mut resources = builder.resources;
        resources.sky = stage.sky.as_ref().map(|sky| sky.panorama.clone());
        for m in &mut resources.materials {
            m.hash = material_content(m, &resources.textures);
        }
        resources
    }
}

#[derive(Default)]
struct Builder {
    resources: SceneResources,
    primitives: HashMap<[u8; 16], u32>,
    materials: HashMap<[u8; 16], u32>,
    textures: HashMap<([u8; 16], bool), u32>,
    /// Primitives of the earlier resources, which hold the meshes alive.
    known_primitives: HashMap<(*const Mesh, u32), ([u8; 16], PrimitiveInfo)>,
    /// Files share images by `Arc`, so each is hashed once.
    image_hashes: HashMap<*const Image, [u8; 16]>,
}

impl Builder {
    /// Adds simplified versions of the primitives of crowds, after all other primitives.
    fn add_lods(&mut self, earlier: &SceneResources, stage: &Stage) {
        let mut copies = vec![0usize; self.resources.primitives.len()];
        for (at, actor) in stage.actors.iter().enumerate() {
            for (instance, entries) in actor.asset.instances.iter().zip(&self.resources.entry(at).primitives)
            {
                entries.iter().for_each(|e| copies[e.primitive as usize] += actor.asset.times(instance));
            }
        }
        let resources = &mut self.resources;
        resources.lods = vec![Vec::new(); copies.len()];
        let crowds = |at: &usize| copies[*at] >= CROWD && resources.primitives[*at].info.valid;
        let crowds: Vec<usize> = (0..copies.len()).filter(crowds).collect();
        let known = |at: usize| {
            let same = |p: &PrimitiveResource| p.hash == resources.primitives[at].hash;
            let levels = earlier.lods.get(earlier.primitives.iter().position(same)?)?;
            let found = levels.iter().map(|l| (earlier.primitives[l.primitive as usize].clone(), l.error));
            Some(found.collect::<Vec<_>>()).filter(|levels| !levels.is_empty())
        };
        let make = |at: &usize| {
            let new = || {
                let fine = &resources.primitives[*at];
                let name = || format!("{}, coarser", fine.mesh.name);
                let levels = simplified(fine.primitive()).into_iter();
                levels.map(|(level, error)| (PrimitiveResource::alone(name(), level), error)).collect()
            };
            (*at, known(*at).unwrap_or_else(new))
        };
        let made: Vec<(usize, Vec<(PrimitiveResource, f32)>)> = crowds.par_iter().map(make).collect();
        for (at, levels) in made {
            for (primitive, error) in levels {
                resources.lods[at].push(LodLevel { primitive: resources.primitives.len() as u32, error });
                resources.primitives.push(primitive);
            }
        }
    }

    fn asset(&mut self, asset: &Asset) -> AssetEntry {
        let animated_color = asset.animated_base_colors();
        let animated = asset.changing_materials();
        let flag = |flags: &[bool], m: u32| flags.get(m as usize).is_some_and(|f| *f);
        let materials: Vec<u32> = (0..)
            .zip(&asset.materials)
            .map(|(index, m)| match flag(&animated_color, index) {
                true => {
                    let white = Material { base_color: Vec4::ONE, ..m.clone() };
                    self.material(asset, &white, flag(&animated, index))
                }
                false => self.material(asset, m, flag(&animated, index)),
            })
            .collect();
        let mut default_material = None;
        let mut meshes: Vec<Option<Vec<PrimitiveEntry>>> = vec![None; asset.meshes.len()];
        let mut entry = AssetEntry::default();
        for instance in &asset.instances {
            let Some(mesh) = asset.meshes.get(instance.mesh as usize) else {
                entry.primitives.push(Vec::new());
                continue;
            };
            let entries = meshes[instance.mesh as usize].get_or_insert_with(|| {
                let entry = |(index, primitive): (u32, &choreo_asset::Primitive)| {
                    let of_asset = primitive.material;
                    let material = of_asset.and_then(|m| materials.get(m as usize).copied());
                    let material = material.unwrap_or_else(|| {
                        let default = || self.material(asset, &Material::default(), false);
                        *default_material.get_or_insert_with(default)
                    });
                    PrimitiveEntry {
                        primitive: self.primitive(mesh, index),
                        material,
                        of_asset,
                        animated_color: of_asset.filter(|m| flag(&animated_color, *m)),
                        animated: of_asset.filter(|m| flag(&animated, *m)),
                    }
                };
                (0..).zip(&mesh.primitives).map(entry).collect()
            });
            entry.primitives.push(entries.clone());
        }
        entry
    }

    fn primitive(&mut self, mesh: &Arc<Mesh>, index: u32) -> u32 {
        let primitive = &mesh.primitives[index as usize];
        let known = self.known_primitives.get(&(Arc::as_ptr(mesh), index)).cloned();
        let hash = known.as_ref().map_or_else(|| short(primitive.content_hash()), |(hash, _)| *hash);
        *self.primitives.entry(hash).or_insert_with(|| {
            let info = known.map_or_else(|| PrimitiveInfo::new(primitive), |(_, info)| info);
            self.resources.primitives.push(PrimitiveResource { mesh: mesh.clone(), index, hash, info });
            self.resources.primitives.len() as u32 - 1
        })
    }

    /// `animated`: factors that hide a texture now may show it later.
    fn material(&mut self, asset: &Asset, m: &Material, animated: bool) -> u32 {
        let mut material = MaterialResource::new(m, animated);
        let keep_all = animated && m.shading != Shading::Unlit;
        for (slot, source) in slot_sources(m).enumerate() {
            let texture = source.texture.filter(|_| source.visible || keep_all);
            material.textures[slot] = texture.and_then(|t| self.texture(asset, t, source.srgb));
        }
        let hash = material_hash(&material);
        if let Some(known) = self.materials.get(&hash) {
            return *known;
        }
        let first = self.resources.materials.len() as u32;
        self.materials.insert(hash, first);
        let later_images =
            material.with_later_images(|stream, i, first| self.streamed(stream, i, first.texture));
        self.resources.materials.push(material);
        self.resources.materials.extend(later_images);
        first
    }

    fn streamed(&mut self, stream: &ImageStream, index: usize, first: u32) -> u32 {
        let textures = &mut self.resources.textures;
        let hash = short(stream.hashes[index]);
        let TextureResource { mipmaps, image: like, srgb, .. } = textures[first as usize].clone();
        *self.textures.entry((hash, srgb)).or_insert_with(|| {
            let image = Image { name: format!("{} {index}", like.name), rgba: Vec::new(), ..*like };
            let streamed = Some((stream.pictures.clone(), index));
            textures.push(TextureResource { image: Arc::new(image), srgb, mipmaps, hash, streamed });
            textures.len() as u32 - 1
        })
    }

    fn texture(&mut self, asset: &Asset, t: &TextureRef, srgb: bool) -> Option<MaterialTexture> {
        let image = asset.images.get(t.image as usize)?;
        let bytes = 4 * u64::from(image.width) * u64::from(image.height);
        if bytes == 0 || bytes != image.rgba.len() as u64 {
            return None;
        }
        let hash =
            *self.image_hashes.entry(Arc::as_ptr(image)).or_insert_with(|| short(image.content_hash()));
        let textures = &mut self.resources.textures;
        let texture = *self.textures.entry((hash, srgb)).or_insert_with(|| {
            let image = image.clone();
            textures.push(TextureResource { image, srgb, mipmaps: false, hash, streamed: None });
            textures.len() as u32 - 1
        });
        textures[texture as usize].mipmaps |= t.sampler.mip_linear.is_some();
        let uv_set = t.uv_set.min(1);
        Some(MaterialTexture { texture, sampler: t.sampler, uv_set, uv_transform: t.uv_transform })
    }
}
