//! Textures of materials that are left out on a device with few texture bindings.

use crate::plan::Features;
use crate::plan::features::material_textures;
use crate::plan::shader_features::texture_slots;
use crate::scene_resources::material::MaterialResource;

/// Textures in the order in which they are left out, from the least visible on. The material's factor replaces each.
const TEXTURES_BY_VISIBILITY: [(Features, &str); 16] = [
    (Features::IRIDESCENCE_THICKNESS_TEXTURE, "thickness of the film"),
    (Features::SHEEN_ROUGHNESS_TEXTURE, "roughness of the sheen"),
    (Features::CLEARCOAT_ROUGHNESS_TEXTURE, "roughness of the coat"),
    (Features::DIFFUSE_TRANSMISSION_TEXTURE, "diffuse transmission"),
    (Features::THICKNESS_TEXTURE, "thickness"),
    (Features::SPECULAR_TEXTURE, "specular"),
    (Features::SHADING_SHIFT_TEXTURE, "shading shift"),
    (Features::REFLECTION_TEXTURE, "reflection"),
    (Features::CLEARCOAT_NORMAL_TEXTURE, "normals of the coat"),
    (Features::IRIDESCENCE_TEXTURE, "iridescence"),
    (Features::ANISOTROPY_TEXTURE, "anisotropy"),
    (Features::OCCLUSION_TEXTURE, "occlusion"),
    (Features::RIM_TEXTURE, "rim light"),
    (Features::SPECULAR_COLOR_TEXTURE, "specular color"),
    (Features::SHADE_COLOR_TEXTURE, "shade color"),
    (Features::SHEEN_COLOR_TEXTURE, "sheen color"),
];

/// Removes the least visible textures until at most `limit` remain (`None`: unlimited). Returns the features that are left, and
/// the names of the removed textures.
pub(super) fn fit_texture_limit(features: Features, limit: Option<u32>) -> (Features, Vec<&'static str>) {
    let (mut features, mut removed) = (features, Vec::new());
    let too_many = |f: Features| limit.is_some_and(|limit| texture_slots(f).count_ones() > limit);
    for (bit, name) in TEXTURES_BY_VISIBILITY {
        if too_many(features) && features.has(bit) {
            features = features.without(bit);
            removed.push(name);
        }
    }
    (features, removed)
}

/// Names of a material's textures that are left out on a device that binds at most `limit` textures.
pub(crate) fn textures_beyond_limit(material: &MaterialResource, limit: u32) -> Vec<&'static str> {
    fit_texture_limit(material_textures(material), Some(limit)).1
}
