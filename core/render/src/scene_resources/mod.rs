//! What all frames of a stage share: every distinct primitive, material and texture once, keyed by content.

pub mod bounds;
pub mod content_hash;
pub mod hausdorff;
pub(crate) mod image_sequences;
pub mod lod;
pub mod mipmap;
pub mod morph_buffers;
pub mod thick_lines;
pub mod vertex_layout;
pub mod watertight;

use crate::scene_resources::bounds::PrimitiveInfo;
use crate::scene_resources::content_hash::{material_content, material_hash, short};
use crate::scene_resources::image_sequences::Streamed;
use crate::scene_resources::lod::{CROWD, Level, coarser};
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::scene_resources::watertight::Closed;
use crate::shader::uniforms::{BASE_SLOTS, LAYER_SLOTS, TEXTURE_SLOTS, TOON_SLOT, TOON_SLOTS};
use choreo_asset::{
    AlphaMode, Asset, Image, Material, MaterialLayers, Panorama, Primitive, Sampler, Shading, Stream,
    TextureRef, Toon,
};
use choreo_stage::Stage;
use glam::{Affine2, Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

#[derive(Clone, Debug, Default)]
pub struct Catalog {
    pub primitives: Vec<CatalogPrimitive>,
    pub materials: Vec<CatalogMaterial>,
    pub textures: Vec<CatalogTexture>,
    /// Of the stage's sky; its maps are made where a renderer first asks for them ([`crate::sky::SkyMaps::of`]).
    pub sky: Option<Arc<Panorama>>,
    /// Which catalogue entries an asset's mesh instances use; see [`Catalog::entry`].
    pub assets: Vec<AssetEntry>,
    /// Per actor of the stage: index into `assets`.
    pub asset_of_actor: Vec<u32>,
    /// Per primitive: its coarser versions, the finest first; only of crowds.
    pub levels: Vec<Vec<Level>>,
}

/// One distinct primitive; holds its asset's mesh alive.
#[derive(Clone, Debug)]
pub struct CatalogPrimitive {
    pub mesh: Arc<choreo_asset::Mesh>,
    /// Index into `mesh.primitives`.
    pub index: u32,
    /// Content hash (first 16 bytes of BLAKE3): cache and dedup key.
    pub hash: [u8; 16],
    /// Bounds, and what of the arrays is worth reading.
    pub info: PrimitiveInfo,
}

impl CatalogPrimitive {
    /// Of a mesh of its own.
    fn alone(name: String, primitive: Primitive) -> CatalogPrimitive {
        let (hash, info) = (short(primitive.content_hash()), PrimitiveInfo::new(&primitive));
        let mesh = choreo_asset::Mesh {
            name,
            morph_targets: primitive.morphs.len(),
            primitives: vec![primitive],
            ..choreo_asset::Mesh::default()
        };
        CatalogPrimitive { mesh: Arc::new(mesh), index: 0, hash, info }
    }

    pub fn primitive(&self) -> &Primitive {
        &self.mesh.primitives[self.index as usize]
    }

    /// Which of its triangles close bodies; of valid primitives.
    pub fn closed(&self) -> &Closed {
        self.info.closed.get_or_init(|| Closed::of(self.primitive()))
    }

    /// For each morph target the vertices from the first to the last that it moves.
    pub fn moved(&self) -> &[Range<u32>] {
        let p = self.primitive();
        let every = || (0..p.positions.len() as u32).collect::<Vec<_>>();
        self.info.moved.get_or_init(|| crate::scene_resources::morph_buffers::moved(p, &every()))
    }

    /// Its indices in the order in which a vertex buffer of this layout has them.
    pub fn indices(&self, layout: VertexLayout) -> &[u32] {
        match layout.0 & VertexLayout::CLOSED {
            0 => &self.primitive().indices,
            _ => &self.closed().indices,
        }
    }
}

/// A material with its textures as catalogue ids. Those of toon shading stand in the slots named at [`crate::plan::Features::TOON`].
/// Textures that cannot change a pixel (the normal map of an unlit
/// material, an emissive texture times zero) are `None` here, so no renderer uploads them.
#[derive(Clone, Debug)]
pub struct CatalogMaterial {
    pub material: Material,
    /// Content hash, with that of its textures: equal in the catalogues of different stages.
    pub hash: [u8; 16],
    pub base_color: Option<CatalogTextureRef>,
    pub metallic_roughness: Option<CatalogTextureRef>,
    pub normal: Option<CatalogTextureRef>,
    pub occlusion: Option<CatalogTextureRef>,
    pub emissive: Option<CatalogTextureRef>,
    pub specular: Option<CatalogTextureRef>,
    pub specular_color: Option<CatalogTextureRef>,
    /// In the order of `MaterialLayers::textures`.
    pub layers: [Option<CatalogTextureRef>; LAYER_SLOTS],
    /// Of toon shading: width of the outline, mask of what moves.
    pub toon: [Option<CatalogTextureRef>; TOON_SLOTS],
}

impl CatalogMaterial {
    /// The same material with the factors and texture transforms that it has now.
    pub fn changed(&self, now: &Material, white: bool) -> CatalogMaterial {
        let toon = now.toon.as_deref().filter(|_| now.shading == Shading::Toon);
        let moved = |known: Option<CatalogTextureRef>, texture: &Option<TextureRef>| {
            let uv_transform = texture.as_ref().map(|t| t.uv_transform);
            known.map(|k| CatalogTextureRef { uv_transform: uv_transform.unwrap_or(k.uv_transform), ..k })
        };
        let plain = now.mirrors().map_or(&now.specular_texture, |r| &r.texture);
        CatalogMaterial {
            // Of what it was; what it is now belongs to one frame.
            hash: self.hash,
            material: Material {
                base_color: if white { Vec4::ONE } else { now.base_color },
                layers: self.material.layers.clone(),
                ..now.clone()
            },
            base_color: moved(self.base_color, &now.base_color_texture),
            metallic_roughness: match toon {
                Some(_) => self.metallic_roughness,
                None => moved(self.metallic_roughness, &now.metallic_roughness_texture),
            },
            normal: moved(self.normal, &now.normal_texture),
            occlusion: moved(self.occlusion, toon.map_or(&now.occlusion_texture, |t| &t.rim_texture)),
            emissive: moved(self.emissive, &now.emissive_texture),
            specular: moved(self.specular, toon.map_or(plain, |t| &t.shading_shift_texture)),
            specular_color: moved(
                self.specular_color,
                toon.map_or(&now.specular_color_texture, |t| &t.shade_texture),
            ),
            layers: self.layers,
            toon: self.toon,
        }
    }

    /// All textures in the order of the fields.
    pub fn texture_refs(&self) -> [Option<CatalogTextureRef>; TEXTURE_SLOTS] {
        let base = [
            self.base_color,
            self.metallic_roughness,
            self.normal,
            self.occlusion,
            self.emissive,
            self.specular,
            self.specular_color,
        ];
        let mut all = [None; TEXTURE_SLOTS];
        all[..BASE_SLOTS].copy_from_slice(&base);
        all[BASE_SLOTS..TOON_SLOT].copy_from_slice(&self.layers);
        all[TOON_SLOT..].copy_from_slice(&self.toon);
        all
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CatalogTextureRef {
    /// Index into `Catalog::textures`.
    pub texture: u32,
    pub sampler: Sampler,
    pub uv_set: u8,
    pub uv_transform: Affine2,
}

#[derive(Clone, Debug)]
pub struct CatalogTexture {
    pub image: Arc<Image>,
    /// Colour channels are sRGB-encoded and filtered in linear light.
    pub srgb: bool,
    /// Some use of it asks for mipmaps.
    pub mipmaps: bool,
    pub hash: [u8; 16],
    /// The image has no pixels: they are made when it is seen.
    pub streamed: Option<Streamed>,
}

/// Catalogue ids of one asset: `primitives[instance][primitive of its mesh]`.
#[derive(Clone, Debug, Default)]
pub struct AssetEntry {
    pub primitives: Vec<Vec<PrimitiveEntry>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveEntry {
    pub primitive: u32,
    pub material: u32,
    /// The asset's material; `None`: the default one.
    pub of_asset: Option<u32>,
    /// The asset's material whose base colour its clips animate: white in the catalogue, it comes with each copy's tint.
    pub animated: Option<u32>,
    /// The asset's material where more than that may change with the time; see `ActorState::materials`.
    pub changes: Option<u32>,
}

impl Catalog {
    /// Every distinct primitive, material and texture of the stage's assets, in order of first use.
    pub fn new(stage: &Stage) -> Catalog {
        Catalog::after(&Catalog::default(), stage)
    }

    /// The same as `new`; what the catalogue of an earlier stage holds of the same assets is not looked through again.
    pub fn after(earlier: &Catalog, stage: &Stage) -> Catalog {
        let mut builder = Builder::default();
        for p in &earlier.primitives {
            builder.known_primitives.insert((Arc::as_ptr(&p.mesh), p.index), (p.hash, p.info.clone()));
        }
        builder.image_hashes = earlier.textures.iter().map(|t| (Arc::as_ptr(&t.image), t.hash)).collect();
        let mut asset_ids: HashMap<*const Asset, u32> = HashMap::new();
        for actor in &stage.actors {
            let id = *asset_ids.entry(Arc::as_ptr(&actor.asset)).or_insert_with(|| {
                let entry = builder.asset(&actor.asset);
                builder.catalog.assets.push(entry);
                builder.catalog.assets.len() as u32 - 1
            });
            builder.catalog.asset_of_actor.push(id);
        }
        builder.levels(earlier, stage);
        let mut catalog = builder.catalog;
        catalog.sky = stage.sky.as_ref().map(|sky| sky.panorama.clone());
        for m in &mut catalog.materials {
            m.hash = material_content(m, &catalog.textures);
        }
        catalog
    }

    pub fn entry(&self, actor: usize) -> &AssetEntry {
        &self.assets[self.asset_of_actor[actor] as usize]
    }
}

#[derive(Default)]
struct Builder {
    catalog: Catalog,
    primitives: HashMap<[u8; 16], u32>,
    materials: HashMap<[u8; 16], u32>,
    textures: HashMap<([u8; 16], bool), u32>,
    /// Of an earlier catalogue, which holds the meshes alive.
    known_primitives: HashMap<(*const choreo_asset::Mesh, u32), ([u8; 16], PrimitiveInfo)>,
    /// Files share images by `Arc`: hashed once.
    image_hashes: HashMap<*const Image, [u8; 16]>,
}

impl Builder {
    /// Coarser versions of primitives that are on stage often enough, behind all others.
    fn levels(&mut self, earlier: &Catalog, stage: &Stage) {
        let mut copies = vec![0usize; self.catalog.primitives.len()];
        for (at, actor) in stage.actors.iter().enumerate() {
            for (instance, entries) in actor.asset.instances.iter().zip(&self.catalog.entry(at).primitives) {
                entries.iter().for_each(|e| copies[e.primitive as usize] += actor.asset.times(instance));
            }
        }
        let catalog = &mut self.catalog;
        catalog.levels = vec![Vec::new(); copies.len()];
        let crowds = |at: &usize| copies[*at] >= CROWD && catalog.primitives[*at].info.valid;
        let crowds: Vec<usize> = (0..copies.len()).filter(crowds).collect();
        let known = |at: usize| {
            let same = |p: &CatalogPrimitive| p.hash == catalog.primitives[at].hash;
            let levels = earlier.levels.get(earlier.primitives.iter().position(same)?)?;
            let found = levels.iter().map(|l| (earlier.primitives[l.primitive as usize].clone(), l.error));
            Some(found.collect::<Vec<_>>()).filter(|levels| !levels.is_empty())
        };
        let make = |at: &usize| {
            let new = || {
                let fine = &catalog.primitives[*at];
                let name = || format!("{}, coarser", fine.mesh.name);
                let levels = coarser(fine.primitive()).into_iter();
                levels.map(|(level, error)| (CatalogPrimitive::alone(name(), level), error)).collect()
            };
            (*at, known(*at).unwrap_or_else(new))
        };
        let made: Vec<(usize, Vec<(CatalogPrimitive, f32)>)> = crowds.par_iter().map(make).collect();
        for (at, levels) in made {
            for (primitive, error) in levels {
                catalog.levels[at].push(Level { primitive: catalog.primitives.len() as u32, error });
                catalog.primitives.push(primitive);
            }
        }
    }

    fn asset(&mut self, asset: &Asset) -> AssetEntry {
        let animated = asset.animated_base_colors();
        let is_animated = |m: u32| animated.get(m as usize).is_some_and(|a| *a);
        let changing = asset.changing_materials();
        let changes = |m: u32| changing.get(m as usize).is_some_and(|c| *c);
        let material_ids: Vec<u32> = (0..)
            .zip(&asset.materials)
            .map(|(index, m)| match is_animated(index) {
                true => {
                    let white = Material { base_color: Vec4::ONE, ..m.clone() };
                    self.material(asset, &white, changes(index))
                }
                false => self.material(asset, m, changes(index)),
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
            if meshes[instance.mesh as usize].is_none() {
                let mut ids = Vec::with_capacity(mesh.primitives.len());
                for (index, primitive) in mesh.primitives.iter().enumerate() {
                    let material = primitive.material.and_then(|m| material_ids.get(m as usize).copied());
                    let material = material.unwrap_or_else(|| {
                        *default_material
                            .get_or_insert_with(|| self.material(asset, &Material::default(), false))
                    });
                    let animated = primitive.material.filter(|m| is_animated(*m));
                    let changes = primitive.material.filter(|m| changes(*m));
                    let primitive = self.primitive(mesh, index as u32);
                    let of_asset = mesh.primitives[index].material;
                    ids.push(PrimitiveEntry { primitive, material, of_asset, animated, changes });
                }
                meshes[instance.mesh as usize] = Some(ids);
            }
            entry.primitives.push(meshes[instance.mesh as usize].clone().unwrap_or_default());
        }
        entry
    }

    fn primitive(&mut self, mesh: &Arc<choreo_asset::Mesh>, index: u32) -> u32 {
        let primitive = &mesh.primitives[index as usize];
        let known = self.known_primitives.get(&(Arc::as_ptr(mesh), index)).cloned();
        let hash = known.as_ref().map_or_else(|| short(primitive.content_hash()), |(hash, _)| *hash);
        *self.primitives.entry(hash).or_insert_with(|| {
            let info = known.map_or_else(|| PrimitiveInfo::new(primitive), |(_, info)| info);
            self.catalog.primitives.push(CatalogPrimitive { mesh: mesh.clone(), index, hash, info });
            self.catalog.primitives.len() as u32 - 1
        })
    }

    /// `changing`: what its factors leave out now may come in later.
    fn material(&mut self, asset: &Asset, m: &Material, changing: bool) -> u32 {
        let lit = m.shading != Shading::Unlit;
        let metallic_roughness = m.shading == Shading::MetallicRoughness;
        let toon = m.toon.as_deref().filter(|_| m.shading == Shading::Toon);
        let mirror = m.reflection.as_deref().filter(|_| m.mirrors().is_some());
        let mut texture = |t: &Option<TextureRef>, srgb, needed| {
            t.as_ref().filter(|_| needed || (changing && lit)).and_then(|t| self.texture(asset, t, srgb))
        };
        let layers = m.layers.as_deref().filter(|_| metallic_roughness).filter(|l| shows(l));
        let layer_textures = layers.map_or([None; LAYER_SLOTS], |l| {
            let coat = l.clearcoat > 0.0;
            let sheen = l.sheen_color != glam::Vec3::ZERO;
            let (film, behind) = (l.iridescence > 0.0, l.diffuse_transmission > 0.0);
            let uses = [
                (&l.clearcoat_texture, false, coat),
                (&l.clearcoat_roughness_texture, false, coat && l.clearcoat_roughness > 0.0),
                (&l.clearcoat_normal_texture, false, coat && l.clearcoat_normal_scale != 0.0),
                (&l.sheen_color_texture, true, sheen),
                (&l.sheen_roughness_texture, false, sheen && l.sheen_roughness > 0.0),
                (&l.transmission_texture, false, l.transmission > 0.0),
                (&l.thickness_texture, false, l.absorbs()),
                (&l.iridescence_texture, false, film),
                (&l.iridescence_thickness_texture, false, film),
                (&l.anisotropy_texture, false, l.anisotropy > 0.0),
                (&l.diffuse_transmission_texture, false, behind),
                (&l.diffuse_transmission_color_texture, true, behind),
            ];
            uses.map(|(t, srgb, needed)| texture(t, srgb, needed))
        });
        let material = CatalogMaterial {
            // Known once all textures are.
            hash: [0; 16],
            layers: layer_textures,
            toon: [
                toon.and_then(|t| texture(&t.outline.as_ref()?.width_texture, false, true)),
                toon.filter(|t| t.uv_motion.is_some()).and_then(|t| texture(&t.uv_mask, false, true)),
            ],
            base_color: texture(&m.base_color_texture, true, true),
            metallic_roughness: match (toon, mirror) {
                (Some(t), _) => texture(&t.matcap_texture, true, t.matcap != Vec3::ZERO),
                (None, Some(mirror)) => texture(&mirror.environment, true, true),
                (None, None) => texture(
                    &m.metallic_roughness_texture,
                    false,
                    metallic_roughness && (m.metallic != 0.0 || m.roughness != 0.0),
                ),
            },
            normal: texture(&m.normal_texture, false, lit && m.normal_scale != 0.0),
            occlusion: match toon {
                Some(t) => texture(&t.rim_texture, true, has_rim(t)),
                None => texture(&m.occlusion_texture, false, lit && m.occlusion_strength != 0.0),
            },
            emissive: texture(&m.emissive_texture, true, lit && m.emissive != Vec3::ZERO),
            specular: match (toon, mirror) {
                (Some(t), _) => texture(&t.shading_shift_texture, false, t.shading_shift_scale != 0.0),
                (None, Some(mirror)) => texture(&mirror.texture, true, true),
                (None, None) => texture(&m.specular_texture, false, metallic_roughness && m.specular != 0.0),
            },
            specular_color: match toon {
                Some(t) => texture(&t.shade_texture, true, t.shade_color != Vec3::ZERO),
                None => texture(&m.specular_color_texture, true, lit && m.specular_color != Vec3::ZERO),
            },
            material: Material {
                // A cutoff of zero discards nothing.
                alpha_mode: match m.alpha_mode {
                    AlphaMode::Mask(cutoff) if cutoff.is_nan() || (cutoff <= 0.0 && !changing) => {
                        AlphaMode::Opaque
                    }
                    mode => mode,
                },
                layers: layers.map(|l| Box::new(l.clone())),
                ..m.clone()
            },
        };
        let hash = material_hash(&material);
        if let Some(known) = self.materials.get(&hash) {
            return *known;
        }
        let first = self.catalog.materials.len() as u32;
        self.materials.insert(hash, first);
        let following = material.following(|stream, i, first| self.streamed(stream, i, first.texture));
        self.catalog.materials.push(material);
        // The pictures after the first, in this order.
        self.catalog.materials.extend(following);
        first
    }

    fn streamed(&mut self, stream: &Stream, index: usize, first: u32) -> u32 {
        let textures = &mut self.catalog.textures;
        let hash = short(stream.hashes[index]);
        let CatalogTexture { mipmaps, image: like, srgb, .. } = textures[first as usize].clone();
        *self.textures.entry((hash, srgb)).or_insert_with(|| {
            let image = Image { name: format!("{} {index}", like.name), rgba: Vec::new(), ..*like };
            let streamed = Some((stream.pictures.clone(), index));
            textures.push(CatalogTexture { image: Arc::new(image), srgb, mipmaps, hash, streamed });
            textures.len() as u32 - 1
        })
    }

    fn texture(&mut self, asset: &Asset, t: &TextureRef, srgb: bool) -> Option<CatalogTextureRef> {
        let image = asset.images.get(t.image as usize)?;
        let bytes = 4 * u64::from(image.width) * u64::from(image.height);
        if bytes == 0 || bytes != image.rgba.len() as u64 {
            return None;
        }
        let hash =
            *self.image_hashes.entry(Arc::as_ptr(image)).or_insert_with(|| short(image.content_hash()));
        let textures = &mut self.catalog.textures;
        let id = *self.textures.entry((hash, srgb)).or_insert_with(|| {
            textures.push(CatalogTexture {
                image: image.clone(),
                srgb,
                mipmaps: false,
                hash,
                streamed: None,
            });
            textures.len() as u32 - 1
        });
        textures[id as usize].mipmaps |= t.sampler.mip_linear.is_some();
        Some(CatalogTextureRef {
            texture: id,
            sampler: t.sampler,
            uv_set: t.uv_set.min(1),
            uv_transform: t.uv_transform,
        })
    }
}

/// Whether a rim or a matcap adds anything.
fn has_rim(t: &Toon) -> bool {
    t.rim_color != Vec3::ZERO || (t.matcap != Vec3::ZERO && t.matcap_texture.is_some())
}

/// Layers of which nothing is seen cost nothing.
fn shows(l: &MaterialLayers) -> bool {
    let over = l.clearcoat > 0.0 || l.sheen_color != glam::Vec3::ZERO || l.iridescence > 0.0;
    over || l.transmission > 0.0 || l.diffuse_transmission > 0.0 || l.anisotropy > 0.0
}

/// Marker for callers: a catalogue belongs to one stage.
pub fn belongs(catalog: &Catalog, stage: &Stage) -> bool {
    catalog.asset_of_actor.len() == stage.actors.len()
}
