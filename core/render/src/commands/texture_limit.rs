//! Textures of materials that are left out on a device with few texture bindings.

use crate::plan::Features;
use crate::plan::features::material_textures;
use crate::plan::shader_features::texture_slots;
use crate::scene_resources::material::MaterialResource;

/// Textures in the order in which they are left out, the least visible first; their factors are used instead.
const LEAST_VISIBLE: [(Features, &str); 16] = [
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

/// Reduces the features to as many textures as a device can bind. Also returns the names of the textures left out.
pub(super) fn fitting(features: Features, most: Option<u32>) -> (Features, Vec<&'static str>) {
    let (mut features, mut out) = (features, Vec::new());
    let too_many = |f: Features| most.is_some_and(|most| texture_slots(f).count_ones() > most);
    for (bit, name) in LEAST_VISIBLE {
        if too_many(features) && features.has(bit) {
            features = features.without(bit);
            out.push(name);
        }
    }
    (features, out)
}

/// Names of a material's textures that are left out on a device that binds `most`.
pub(crate) fn textures_beyond(material: &MaterialResource, most: u32) -> Vec<&'static str> {
    fitting(material_textures(material), Some(most)).1
}
