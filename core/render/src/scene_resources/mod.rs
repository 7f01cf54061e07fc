//! Data that all frames of a stage share: each distinct primitive, material and texture once, keyed by content.

mod appearance;
pub mod bounds;
mod build;
pub mod content_hash;
pub(crate) mod hausdorff;
pub(crate) mod image_sequences;
mod large_triangles;
pub mod lod;
pub(crate) mod material;
pub mod mipmap;
pub mod morph_buffers;
mod simplify;
pub(crate) mod thick_lines;
pub mod vertex_layout;
pub(crate) mod watertight;

use crate::scene_resources::bounds::PrimitiveInfo;
use crate::scene_resources::content_hash::shortened_hash;
use crate::scene_resources::image_sequences::Streamed;
use crate::scene_resources::lod::LodLevel;
use crate::scene_resources::material::MaterialResource;
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::scene_resources::watertight::WatertightOrder;
use choreo_asset::{Image, Mesh, Panorama, Primitive};
use std::ops::Range;
use std::sync::Arc;

#[derive(Clone, Debug, Default)]
pub struct SceneResources {
    pub primitives: Vec<PrimitiveResource>,
    pub materials: Vec<MaterialResource>,
    pub textures: Vec<TextureResource>,
    /// The stage's sky. Its maps are computed when a renderer first requests them ([`crate::sky::SkyMaps::of`]).
    pub sky: Option<Arc<Panorama>>,
    /// Entries of each asset; see [`SceneResources::entry`].
    pub assets: Vec<AssetEntry>,
    /// Index into `assets` for each actor of the stage.
    pub asset_of_actor: Vec<u32>,
}

/// One distinct primitive. Keeps its asset's mesh alive.
#[derive(Clone, Debug)]
pub struct PrimitiveResource {
    pub mesh: Arc<Mesh>,
    /// Index into `mesh.primitives`.
    pub index: u32,
    /// Content hash (first 16 bytes of BLAKE3): the key of caches and deduplication.
    pub hash: [u8; 16],
    pub info: PrimitiveInfo,
}

impl PrimitiveResource {
    /// A primitive in its own new mesh.
    fn alone(name: String, primitive: Primitive) -> PrimitiveResource {
        let (hash, info) = (shortened_hash(primitive.content_hash()), PrimitiveInfo::new(&primitive));
        let morph_targets = primitive.morphs.len();
        let mesh = Mesh { name, morph_targets, primitives: vec![primitive], ..Mesh::default() };
        PrimitiveResource { mesh: Arc::new(mesh), index: 0, hash, info }
    }

    pub fn primitive(&self) -> &Primitive {
        &self.mesh.primitives[self.index as usize]
    }

    /// The triangles, those of watertight surfaces first. The primitive must be valid.
    pub fn watertight(&self) -> &WatertightOrder {
        self.info.watertight.get_or_init(|| WatertightOrder::of(self.primitive()))
    }

    /// Range of vertices that each morph target moves, from the first to the last.
    pub(crate) fn morphed_ranges(&self) -> &[Range<u32>] {
        let p = self.primitive();
        let every = || (0..p.positions.len() as u32).collect::<Vec<_>>();
        self.info.morphed_ranges.get_or_init(|| morph_buffers::morphed_ranges(p, &every()))
    }

    /// The indices in the order of a vertex buffer of this layout.
    pub fn indices(&self, layout: VertexLayout) -> &[u32] {
        match layout.0 & VertexLayout::WATERTIGHT_FIRST {
            0 => &self.primitive().indices,
            _ => &self.watertight().indices,
        }
    }
}

#[derive(Clone, Debug)]
pub struct TextureResource {
    pub image: Arc<Image>,
    /// Whether color channels are sRGB-encoded, and so filtered in linear light.
    pub srgb: bool,
    /// Whether some use of the texture requests mipmaps.
    pub mipmaps: bool,
    pub hash: [u8; 16],
    /// The image sequence that supplies the pixels while the texture is visible; `None` if the image has its pixels.
    pub streamed: Option<Streamed>,
}

/// Resources of one asset: `primitives[mesh instance][primitive of its mesh]`.
#[derive(Clone, Debug, Default)]
pub struct AssetEntry {
    pub primitives: Vec<Vec<PrimitiveEntry>>,
    /// Levels of detail, the finest first; empty if they do not pay.
    pub levels: Vec<LodLevel>,
    /// Whether levels would pay but are not made ([`SceneResources::without_levels`]).
    pub wants_levels: bool,
    /// Hash of all inputs of levels of detail.
    content: [u8; 16],
}

/// A primitive and its material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveEntry {
    /// Index into `SceneResources::primitives`.
    pub primitive: u32,
    /// Index into `SceneResources::materials`.
    pub material: u32,
    /// The asset's material; `None`: the default one.
    pub of_asset: Option<u32>,
    /// The asset's material if clips animate its base color, which is then white in the scene resources and in each instance's
    /// tint instead.
    pub animated_color: Option<u32>,
    /// The asset's material if any other property of it may be animated; see `ActorState::materials`.
    pub animated: Option<u32>,
}

impl SceneResources {
    pub fn entry(&self, actor: usize) -> &AssetEntry {
        &self.assets[self.asset_of_actor[actor] as usize]
    }
}
