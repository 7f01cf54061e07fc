//! Collects the resources of a stage's assets.

use crate::scene_resources::bounds::PrimitiveInfo;
use crate::scene_resources::content_hash::{material_content, material_hash, shortened_hash};
use crate::scene_resources::large_triangles;
use crate::scene_resources::lod::{LodLevel, assets_worth_levels};
use crate::scene_resources::material::{MaterialResource, MaterialTexture, slot_sources};
use crate::scene_resources::simplify::{Level, Model};
use crate::scene_resources::{
    AssetEntry, PrimitiveEntry, PrimitiveResource, SceneResources, TextureResource,
};
use choreo_asset::{Asset, Image, ImageStream, Material, Mesh, Shading, TextureRef};
use choreo_stage::Stage;
use glam::Vec4;
use std::collections::HashMap;
use std::sync::Arc;

impl SceneResources {
    /// Every distinct primitive, material and texture of the stage's assets, in order of first use.
    pub fn new(stage: &Stage) -> SceneResources {
        SceneResources::new_reusing(&SceneResources::default(), stage)
    }

    /// Like `new`, but reuses earlier resources: their assets are not hashed and measured again.
    pub fn new_reusing(earlier: &SceneResources, stage: &Stage) -> SceneResources {
        let (mut resources, assets) = SceneResources::collect_resources(earlier, stage);
        let pays = assets_worth_levels(&resources, stage);
        for (index, asset) in assets.iter().enumerate().filter(|(index, _)| pays[*index]) {
            resources.add_levels(index, asset, earlier);
        }
        resources
    }

    /// Like `new`, but without levels of detail, which take time. Marks the assets for which they would pay.
    pub fn without_levels(stage: &Stage) -> SceneResources {
        let (mut resources, _) = SceneResources::collect_resources(&SceneResources::default(), stage);
        let pays = assets_worth_levels(&resources, stage);
        resources.assets.iter_mut().zip(pays).for_each(|(entry, pays)| entry.wants_levels = pays);
        resources
    }

    /// The resources without levels of detail, and the distinct assets.
    fn collect_resources<'a>(earlier: &SceneResources, stage: &'a Stage) -> (SceneResources, Vec<&'a Asset>) {
        let mut builder = Builder::default();
        for p in &earlier.primitives {
            builder.known_primitives.insert((Arc::as_ptr(&p.mesh), p.index), (p.hash, p.info.clone()));
        }
        builder.image_hashes = earlier.textures.iter().map(|t| (Arc::as_ptr(&t.image), t.hash)).collect();
        let mut asset_ids: HashMap<*const Asset, u32> = HashMap::new();
        let mut assets: Vec<&Asset> = Vec::new();
        for actor in &stage.actors {
            let id = *asset_ids.entry(Arc::as_ptr(&actor.asset)).or_insert_with(|| {
                let entry = builder.add_asset(&actor.asset);
                builder.resources.assets.push(entry);
                assets.push(&actor.asset);
                builder.resources.assets.len() as u32 - 1
            });
            builder.resources.asset_of_actor.push(id);
        }
        let mut resources = builder.resources;
        resources.sky = stage.sky.as_ref().map(|sky| sky.panorama.clone());
        large_triangles::split(&mut resources, stage);
        for m in &mut resources.materials {
            m.hash = material_content(m, &resources.textures);
        }
        for (entry, asset) in resources.assets.iter_mut().zip(&assets) {
            entry.content = model_content(entry, asset, &resources.primitives, &resources.materials);
        }
        (resources, assets)
    }

    /// Adds the levels of detail of an asset, and their primitives after all others.
    fn add_levels(&mut self, index: usize, asset: &Asset, earlier: &SceneResources) {
        let content = self.assets[index].content;
        let known = earlier.assets.iter().find(|e| e.content == content && !e.levels.is_empty());
        if let Some(known) = known {
            for level in &known.levels {
                let primitives = level.primitives.iter().map(|of_instance| {
                    let add = |p: &Option<u32>| p.map(|p| self.add(earlier.primitives[p as usize].clone()));
                    of_instance.iter().map(add).collect()
                });
                let primitives = primitives.collect();
                self.assets[index].levels.push(LodLevel { error: level.error, primitives });
            }
            return;
        }
        let entry = self.assets[index].clone();
        let valid =
            |i: usize, p: usize| self.primitives[entry.primitives[i][p].primitive as usize].info.valid;
        let levels = Model::new(asset, valid).map_or(Vec::new(), |model| model.levels());
        for Level { error, primitives } in levels {
            // Primitives that are not simplified, such as lines, stay as they are.
            let own =
                |of_instance: &Vec<PrimitiveEntry>| of_instance.iter().map(|e| Some(e.primitive)).collect();
            let mut level = LodLevel { error, primitives: entry.primitives.iter().map(own).collect() };
            for ((instance, at), primitive) in primitives {
                let name = &asset.meshes[asset.instances[instance].mesh as usize].name;
                let name = format!("{name}, coarser");
                level.primitives[instance][at] =
                    primitive.map(|primitive| self.add(PrimitiveResource::alone(name, primitive)));
            }
            self.assets[index].levels.push(level);
        }
    }

    /// Index of a primitive. Adds it if no equal one exists.
    fn add(&mut self, primitive: PrimitiveResource) -> u32 {
        let known = self.primitives.iter().position(|p| p.hash == primitive.hash);
        known.unwrap_or_else(|| {
            self.primitives.push(primitive);
            self.primitives.len() - 1
        }) as u32
    }
}

#[derive(Default)]
struct Builder {
    resources: SceneResources,
    primitives: HashMap<[u8; 16], u32>,
    materials: HashMap<[u8; 16], u32>,
    textures: HashMap<([u8; 16], bool), u32>,
    /// Primitives of the earlier resources, which keep the meshes alive.
    known_primitives: HashMap<(*const Mesh, u32), ([u8; 16], PrimitiveInfo)>,
    /// Files share images by `Arc`, so each is hashed once.
    image_hashes: HashMap<*const Image, [u8; 16]>,
}

impl Builder {
    fn add_asset(&mut self, asset: &Asset) -> AssetEntry {
        let animated_color = asset.animated_base_colors();
        let animated = asset.changing_materials();
        let flag = |flags: &[bool], m: u32| flags.get(m as usize).is_some_and(|f| *f);
        let materials: Vec<u32> = (0..)
            .zip(&asset.materials)
            .map(|(index, m)| match flag(&animated_color, index) {
                true => {
                    let white = Material { base_color: Vec4::ONE, ..m.clone() };
                    self.add_material(asset, &white, flag(&animated, index))
                }
                false => self.add_material(asset, m, flag(&animated, index)),
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
                        let default = || self.add_material(asset, &Material::default(), false);
                        *default_material.get_or_insert_with(default)
                    });
                    PrimitiveEntry {
                        primitive: self.add_primitive(mesh, index),
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

    fn add_primitive(&mut self, mesh: &Arc<Mesh>, index: u32) -> u32 {
        let primitive = &mesh.primitives[index as usize];
        let known = self.known_primitives.get(&(Arc::as_ptr(mesh), index)).cloned();
        let hash = known.as_ref().map_or_else(|| shortened_hash(primitive.content_hash()), |(hash, _)| *hash);
        *self.primitives.entry(hash).or_insert_with(|| {
            let info = known.map_or_else(|| PrimitiveInfo::new(primitive), |(_, info)| info);
            self.resources.primitives.push(PrimitiveResource { mesh: mesh.clone(), index, hash, info });
            self.resources.primitives.len() as u32 - 1
        })
    }

    /// Index of a material. `animated`: keeps textures that its current factors hide, because later factors may show them.
    fn add_material(&mut self, asset: &Asset, m: &Material, animated: bool) -> u32 {
        let mut material = MaterialResource::new(m, animated);
        let keep_all = animated && m.shading != Shading::Unlit;
        for (slot, source) in slot_sources(m).enumerate() {
            let texture = source.texture.filter(|_| source.visible || keep_all);
            material.textures[slot] = texture.and_then(|t| self.add_texture(asset, t, source.srgb));
        }
        let hash = material_hash(&material);
        if let Some(known) = self.materials.get(&hash) {
            return *known;
        }
        let first = self.resources.materials.len() as u32;
        self.materials.insert(hash, first);
        let later_images = material
            .with_later_images(|stream, i, first| self.add_streamed_texture(stream, i, first.texture));
        self.resources.materials.push(material);
        self.resources.materials.extend(later_images);
        first
    }

    fn add_streamed_texture(&mut self, stream: &ImageStream, index: usize, first: u32) -> u32 {
        let textures = &mut self.resources.textures;
        let hash = shortened_hash(stream.hashes[index]);
        let TextureResource { mipmaps, image: like, srgb, .. } = textures[first as usize].clone();
        *self.textures.entry((hash, srgb)).or_insert_with(|| {
            let image =
                Image { name: format!("{} {index}", like.name), rgba: Vec::new(), file: None, ..*like };
            let streamed = Some((stream.pictures.clone(), index));
            textures.push(TextureResource { image: Arc::new(image), srgb, mipmaps, hash, streamed });
            textures.len() as u32 - 1
        })
    }

    fn add_texture(&mut self, asset: &Asset, t: &TextureRef, srgb: bool) -> Option<MaterialTexture> {
        let image = asset.images.get(t.image as usize)?;
        let bytes = 4 * u64::from(image.width) * u64::from(image.height);
        // Scenes that are only described, not drawn, know no pixels of their images, only the sizes.
        let is_header = image.rgba.is_empty();
        if bytes == 0 || !is_header && bytes != image.rgba.len() as u64 {
            return None;
        }
        let hash = || match is_header {
            true => shortened_hash(*blake3::hash(&(Arc::as_ptr(image) as usize).to_le_bytes()).as_bytes()),
            false => shortened_hash(image.content_hash()),
        };
        let hash = *self.image_hashes.entry(Arc::as_ptr(image)).or_insert_with(hash);
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

/// Hash of the primitives, materials and placements of a model.
fn model_content(
    entry: &AssetEntry,
    asset: &Asset,
    primitives: &[PrimitiveResource],
    materials: &[MaterialResource],
) -> [u8; 16] {
    let mut hasher = blake3::Hasher::new();
    for (instance, of_instance) in asset.instances.iter().zip(&entry.primitives) {
        let place = asset.rest_model_from_joint().get(instance.joint as usize).copied().unwrap_or_default();
        for number in place.to_cols_array() {
            hasher.update(&number.to_le_bytes());
        }
        for e in of_instance {
            hasher.update(&primitives[e.primitive as usize].hash);
            hasher.update(&materials[e.material as usize].hash);
        }
    }
    shortened_hash(*hasher.finalize().as_bytes())
}
