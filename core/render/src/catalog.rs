//! What all frames of a stage share: every distinct primitive, material and texture once, keyed by content.

use choreo_stage::{Image, Material, Primitive, Sampler, Stage};
use glam::Affine2;
use std::sync::Arc;

#[derive(Clone, Debug, Default)]
pub struct Catalog {
    pub primitives: Vec<CatalogPrimitive>,
    pub materials: Vec<CatalogMaterial>,
    pub textures: Vec<CatalogTexture>,
    /// Which catalogue entries an asset's mesh instances use; see [`Catalog::entry`].
    pub assets: Vec<AssetEntry>,
    /// Per actor of the stage: index into `assets`.
    pub asset_of_actor: Vec<u32>,
}

/// One distinct primitive; holds its asset's mesh alive.
#[derive(Clone, Debug)]
pub struct CatalogPrimitive {
    pub mesh: Arc<choreo_stage::Mesh>,
    /// Index into `mesh.primitives`.
    pub index: u32,
    /// Content hash (first 16 bytes of BLAKE3): cache and dedup key.
    pub hash: [u8; 16],
}

impl CatalogPrimitive {
    pub fn primitive(&self) -> &Primitive {
        &self.mesh.primitives[self.index as usize]
    }
}

#[derive(Clone, Debug)]
pub struct CatalogMaterial {
    pub material: Material,
    pub base_color: Option<CatalogTextureRef>,
    pub metallic_roughness: Option<CatalogTextureRef>,
    pub normal: Option<CatalogTextureRef>,
    pub occlusion: Option<CatalogTextureRef>,
    pub emissive: Option<CatalogTextureRef>,
    pub specular: Option<CatalogTextureRef>,
    pub specular_color: Option<CatalogTextureRef>,
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
}

impl Catalog {
    pub fn entry(&self, actor: usize) -> &AssetEntry {
        &self.assets[self.asset_of_actor[actor] as usize]
    }
}

/// Marker for callers: a catalogue belongs to one stage.
pub fn belongs(catalog: &Catalog, stage: &Stage) -> bool {
    catalog.asset_of_actor.len() == stage.actors.len()
}
