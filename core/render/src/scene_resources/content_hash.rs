//! Content hashes of materials: the first 16 bytes of BLAKE3. Primitives and images are hashed by the stage.

use crate::scene_resources::TextureResource;
use crate::scene_resources::material::MaterialResource;
use choreo_asset::ContentHash;
use choreo_asset::hash::{Hashed, hash_of};

/// The first 16 bytes of a hash. They still distinguish contents, and cost half as much to compare.
pub(crate) fn shortened_hash(hash: ContentHash) -> [u8; 16] {
    let mut out = [0; 16];
    out.copy_from_slice(&hash[..16]);
    out
}

/// Hash of a material with its textures by index, for comparing materials of one stage.
pub(crate) fn material_hash(m: &MaterialResource) -> [u8; 16] {
    hash_with(m, |texture| texture)
}

/// Hash of a material with its textures by content, for comparing materials of different stages.
pub(crate) fn material_content(m: &MaterialResource, textures: &[TextureResource]) -> [u8; 16] {
    let content = |t: &TextureResource| (t.hash.to_vec(), t.srgb, t.mipmaps);
    hash_with(m, |texture| textures.get(texture as usize).map(content))
}

/// Hash of a material with the scene's textures in place of the file's.
fn hash_with<T: Hashed>(m: &MaterialResource, texture_id: impl Fn(u32) -> T) -> [u8; 16] {
    let textures = m
        .textures
        .map(|texture| texture.map(|t| (texture_id(t.texture), (t.sampler, t.uv_set, t.uv_transform))));
    shortened_hash(hash_of(|w| (m.material.hash_without_textures(), textures.as_slice()).hash(w)))
}
