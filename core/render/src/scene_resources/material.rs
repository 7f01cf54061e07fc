//! Materials with their textures as indices into the scene resources.

use choreo_asset::{AlphaMode, Material, MaterialLayers, Sampler, Shading, TextureRef, TextureSlot, Toon};
use glam::{Affine2, Vec2, Vec3, Vec4};

/// Slots of every material, in the order of [`TextureSlot`].
pub(crate) const BASE_SLOTS: usize = 7;
/// Slots of a material's layers, in the order of `MaterialLayers::textures`: clearcoat, its roughness, its normal, sheen color,
/// its roughness, transmission, thickness, iridescence, its thickness, anisotropy, diffuse transmission, its color.
pub(crate) const LAYER_SLOTS: usize = 12;
/// Slots of toon shading: outline width, mask of the UV animation.
pub(crate) const TOON_SLOTS: usize = 2;
/// First slot of toon shading.
pub(crate) const TOON_SLOT: usize = BASE_SLOTS + LAYER_SLOTS;
/// All texture slots of a material. Vulkan guarantees 16 bindings; `commands::texture_limit` leaves out textures that a device
/// cannot bind.
pub(crate) const TEXTURE_SLOTS: usize = TOON_SLOT + TOON_SLOTS;
/// Slot of the thin film's thickness.
const FILM_THICKNESS_SLOT: usize = BASE_SLOTS + 8;

/// A material with its textures as indices into [`crate::scene_resources::SceneResources::textures`].
///
/// Textures that cannot change a pixel (the normal map of an unlit material, an emissive texture times zero) are `None`, so
/// that no renderer uploads them. Shading models reuse slots that they do not read: toon shading keeps its matcap in
/// metallic-roughness, its rim in occlusion, its shading shift in specular and its shade color in specular color; a
/// Blinn–Phong mirror keeps its environment map in metallic-roughness and its reflection map in specular.
#[derive(Clone, Debug)]
pub struct MaterialResource {
    pub material: Material,
    /// Content hash, including that of the textures: equal in the resources of different stages.
    pub hash: [u8; 16],
    pub textures: [Option<MaterialTexture>; TEXTURE_SLOTS],
}

/// A texture as a material samples it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialTexture {
    /// Index into `SceneResources::textures`.
    pub texture: u32,
    pub sampler: Sampler,
    pub uv_set: u8,
    pub uv_transform: Affine2,
}

/// Source of a slot's texture.
pub(crate) struct SlotSource<'a> {
    pub texture: Option<&'a TextureRef>,
    /// Whether color channels are sRGB-encoded.
    pub srgb: bool,
    /// Whether the texture can change a pixel.
    pub visible: bool,
}

impl MaterialResource {
    /// The material without invisible layers, textures and hash.
    pub(crate) fn new(m: &Material, animated: bool) -> MaterialResource {
        let alpha_mode = match m.alpha_mode {
            // A cutoff of zero discards nothing.
            AlphaMode::Mask(cutoff) if cutoff.is_nan() || (cutoff <= 0.0 && !animated) => AlphaMode::Opaque,
            mode => mode,
        };
        let layers = visible_layers(m).map(|l| Box::new(l.clone()));
        let material = Material { alpha_mode, layers, ..m.clone() };
        MaterialResource { material, hash: [0; 16], textures: [None; TEXTURE_SLOTS] }
    }

    /// The same material with the factors and texture transforms of `now`. `white`: the base color is in each instance's tint
    /// instead.
    pub(crate) fn with_values(&self, now: &Material, white: bool) -> MaterialResource {
        let mut textures = self.textures;
        let sources = base_sources(now);
        for (slot, (texture, source)) in textures.iter_mut().zip(sources).enumerate() {
            // The slot of matcaps and environment maps is not sampled by texture coordinates.
            let has_uv = slot != TextureSlot::MetallicRoughness as usize || now.shading != Shading::Toon;
            if let (Some(texture), Some(source)) = (texture, source.texture.filter(|_| has_uv)) {
                texture.uv_transform = source.uv_transform;
            }
        }
        let base_color = if white { Vec4::ONE } else { now.base_color };
        let layers = self.material.layers.clone();
        // The hash stays that of the scene's material: these values belong to one frame.
        MaterialResource {
            material: Material { base_color, layers, ..now.clone() },
            hash: self.hash,
            textures,
        }
    }

    pub(crate) fn texture(&self, slot: TextureSlot) -> Option<MaterialTexture> {
        self.textures[slot as usize]
    }

    /// Thickness of the thin film in nanometers where the texture's green channel is 0, and where it is 1. Without a texture both
    /// are equal, so that forcing the texture in changes nothing.
    pub(crate) fn film_thickness(&self) -> Vec2 {
        let [thin, thick] = self.material.layers.as_deref().map_or([0.0; 2], |l| l.iridescence_thickness);
        let textured = self.textures[FILM_THICKNESS_SLOT].is_some();
        Vec2::new(if textured { thin } else { thick }, thick)
    }

    pub(crate) fn has_outline(&self) -> bool {
        let toon = self.material.toon.as_ref();
        self.material.shading == Shading::Toon && toon.is_some_and(|t| t.outline.is_some())
    }
}

/// Whether GPUs filter a texture anisotropically: only if it is filtered between texels and levels, so that a request for hard
/// texels is honored.
pub(crate) fn is_anisotropic(s: &Sampler) -> bool {
    s.mag_linear && s.min_linear && s.mip_linear == Some(true)
}

/// Sources of all slots, in order.
pub(crate) fn slot_sources(m: &Material) -> impl Iterator<Item = SlotSource<'_>> {
    let toon = m.toon.as_deref().filter(|_| m.shading == Shading::Toon);
    let toon_sources = [
        slot_source(toon.and_then(|t| t.outline.as_ref()?.width_texture.as_ref()), false, true),
        slot_source(toon.filter(|t| t.uv_motion.is_some()).and_then(|t| t.uv_mask.as_ref()), false, true),
    ];
    base_sources(m).into_iter().chain(layer_sources(m)).chain(toon_sources)
}

fn slot_source(texture: Option<&TextureRef>, srgb: bool, visible: bool) -> SlotSource<'_> {
    SlotSource { texture, srgb, visible }
}

fn base_sources(m: &Material) -> [SlotSource<'_>; BASE_SLOTS] {
    let lit = m.shading != Shading::Unlit;
    let pbr = m.shading == Shading::MetallicRoughness;
    let toon = m.toon.as_deref().filter(|_| m.shading == Shading::Toon);
    let mirror = m.environment_reflection();
    [
        slot_source(m.base_color_texture.as_ref(), true, true),
        match (toon, mirror) {
            (Some(t), _) => slot_source(t.matcap_texture.as_ref(), true, t.matcap != Vec3::ZERO),
            (None, Some(mirror)) => slot_source(mirror.environment.as_ref(), true, true),
            (None, None) => {
                let visible = pbr && (m.metallic != 0.0 || m.roughness != 0.0);
                slot_source(m.metallic_roughness_texture.as_ref(), false, visible)
            }
        },
        slot_source(m.normal_texture.as_ref(), false, lit && m.normal_scale != 0.0),
        match toon {
            Some(t) => slot_source(t.rim_texture.as_ref(), true, has_rim(t)),
            None => slot_source(m.occlusion_texture.as_ref(), false, lit && m.occlusion_strength != 0.0),
        },
        slot_source(m.emissive_texture.as_ref(), true, lit && m.emissive != Vec3::ZERO),
        match (toon, mirror) {
            (Some(t), _) => {
                slot_source(t.shading_shift_texture.as_ref(), false, t.shading_shift_scale != 0.0)
            }
            (None, Some(mirror)) => slot_source(mirror.texture.as_ref(), true, true),
            (None, None) => slot_source(m.specular_texture.as_ref(), false, pbr && m.specular != 0.0),
        },
        match toon {
            Some(t) => slot_source(t.shade_texture.as_ref(), true, t.shade_color != Vec3::ZERO),
            None => {
                slot_source(m.specular_color_texture.as_ref(), true, lit && m.specular_color != Vec3::ZERO)
            }
        },
    ]
}

fn layer_sources(m: &Material) -> [SlotSource<'_>; LAYER_SLOTS] {
    let Some(l) = visible_layers(m) else { return std::array::from_fn(|_| slot_source(None, false, false)) };
    let coat = l.clearcoat > 0.0;
    let sheen = l.sheen_color != Vec3::ZERO;
    let (film, diffuse) = (l.iridescence > 0.0, l.diffuse_transmission > 0.0);
    [
        slot_source(l.clearcoat_texture.as_ref(), false, coat),
        slot_source(l.clearcoat_roughness_texture.as_ref(), false, coat && l.clearcoat_roughness > 0.0),
        slot_source(l.clearcoat_normal_texture.as_ref(), false, coat && l.clearcoat_normal_scale != 0.0),
        slot_source(l.sheen_color_texture.as_ref(), true, sheen),
        slot_source(l.sheen_roughness_texture.as_ref(), false, sheen && l.sheen_roughness > 0.0),
        slot_source(l.transmission_texture.as_ref(), false, l.transmission > 0.0),
        slot_source(l.thickness_texture.as_ref(), false, l.absorbs()),
        slot_source(l.iridescence_texture.as_ref(), false, film),
        slot_source(l.iridescence_thickness_texture.as_ref(), false, film),
        slot_source(l.anisotropy_texture.as_ref(), false, l.anisotropy > 0.0),
        slot_source(l.diffuse_transmission_texture.as_ref(), false, diffuse),
        slot_source(l.diffuse_transmission_color_texture.as_ref(), true, diffuse),
    ]
}

/// Whether a rim light or a matcap adds anything.
fn has_rim(t: &Toon) -> bool {
    t.rim_color != Vec3::ZERO || (t.matcap != Vec3::ZERO && t.matcap_texture.is_some())
}

/// The layers of a metallic-roughness material, if any of them is visible.
fn visible_layers(m: &Material) -> Option<&MaterialLayers> {
    let shows = |l: &&MaterialLayers| {
        let over = l.clearcoat > 0.0 || l.sheen_color != Vec3::ZERO || l.iridescence > 0.0;
        over || l.transmission > 0.0 || l.diffuse_transmission > 0.0 || l.anisotropy > 0.0
    };
    m.layers.as_deref().filter(|_| m.shading == Shading::MetallicRoughness).filter(shows)
}
