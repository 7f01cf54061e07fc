//! Which shader features a material's layers need: none for a material without them.

use crate::plan::Features;
use crate::scene_resources::material::{BASE_SLOTS, LAYER_SLOTS, MaterialResource, MaterialTexture};
use choreo_asset::MaterialLayers;
use glam::Vec3;

/// Features of textures in the order of `MaterialLayers::textures`.
pub const TEXTURES: [Features; LAYER_SLOTS] = [
    Features::CLEARCOAT_TEXTURE,
    Features::CLEARCOAT_ROUGHNESS_TEXTURE,
    Features::CLEARCOAT_NORMAL_TEXTURE,
    Features::SHEEN_COLOR_TEXTURE,
    Features::SHEEN_ROUGHNESS_TEXTURE,
    Features::TRANSMISSION_TEXTURE,
    Features::THICKNESS_TEXTURE,
    Features::IRIDESCENCE_TEXTURE,
    Features::IRIDESCENCE_THICKNESS_TEXTURE,
    Features::ANISOTROPY_TEXTURE,
    Features::DIFFUSE_TRANSMISSION_TEXTURE,
    Features::DIFFUSE_TRANSMISSION_COLOR_TEXTURE,
];

/// Features of all layers.
pub const ALL: Features = Features::LAYERS
    .with(Features::CLEARCOAT)
    .with(Features::SHEEN)
    .with(Features::TRANSMISSION)
    .with(Features::VOLUME)
    .with(Features::REFRACTION)
    .with(Features::DISPERSION)
    .with(Features::IRIDESCENCE)
    .with(Features::ANISOTROPY)
    .with(Features::DIFFUSE_TRANSMISSION);

/// What a frame without them leaves out.
pub const WORDS: &[(Features, &str, &str)] = &[
    (Features::CLEARCOAT, "clear coats", "one"),
    (Features::SHEEN, "sheen", "any"),
    (Features::TRANSMISSION, "transmission", "any: none lets light through"),
    (Features::VOLUME, "absorption", "a volume that takes light"),
    (Features::REFRACTION, "refraction", "a volume that bends light"),
    (Features::DISPERSION, "dispersion", "a volume that bends colours apart"),
    (Features::IRIDESCENCE, "iridescence", "a thin film"),
    (Features::ANISOTROPY, "anisotropy", "highlights that are drawn out"),
    (Features::DIFFUSE_TRANSMISSION, "diffuse transmission", "any: none lets light from behind through"),
];

/// (texture, its bit, whether it may be read at all). A coat's normal map is never forced in: it needs tangents.
pub fn textures(
    material: &MaterialResource,
    layers: Option<&MaterialLayers>,
) -> [(Option<MaterialTexture>, Features, bool); LAYER_SLOTS] {
    let on = |slot: usize| match (layers, slot) {
        (None, _) => false,
        (Some(l), 0..=1) => l.clearcoat > 0.0,
        (Some(_), 2) => material.textures[BASE_SLOTS + 2].is_some(),
        (Some(l), 3..=4) => l.sheen_color != Vec3::ZERO,
        (Some(l), 5) => l.transmission > 0.0,
        (Some(l), 6) => l.absorbs() || l.refracts(),
        (Some(l), 7..=8) => l.iridescence > 0.0,
        (Some(_), 9) => material.textures[BASE_SLOTS + 9].is_some(),
        (Some(l), _) => l.diffuse_transmission > 0.0,
    };
    std::array::from_fn(|slot| (material.textures[BASE_SLOTS + slot], TEXTURES[slot], on(slot)))
}

/// A coat, sheen, film and light from behind of nothing change no pixel, so they can be forced in where the material has layers at all.
pub fn bits(layers: Option<&MaterialLayers>, tangents: bool, force_all: bool) -> [(bool, Features); 10] {
    let has = |f: fn(&MaterialLayers) -> bool| layers.is_some_and(f);
    let force = force_all && layers.is_some();
    [
        (layers.is_some(), Features::LAYERS),
        (has(|l| l.clearcoat > 0.0) || force, Features::CLEARCOAT),
        (has(|l| l.sheen_color != Vec3::ZERO) || force, Features::SHEEN),
        (has(|l| l.transmission > 0.0), Features::TRANSMISSION),
        (has(MaterialLayers::absorbs), Features::VOLUME),
        (has(MaterialLayers::refracts), Features::REFRACTION),
        (has(|l| l.refracts() && l.dispersion > 0.0), Features::DISPERSION),
        (has(|l| l.iridescence > 0.0) || force, Features::IRIDESCENCE),
        (has(|l| l.anisotropy > 0.0) && tangents, Features::ANISOTROPY),
        (has(|l| l.diffuse_transmission > 0.0) || force, Features::DIFFUSE_TRANSMISSION),
    ]
}
