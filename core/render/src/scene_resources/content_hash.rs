//! Content hashes of materials: the first 16 bytes of BLAKE3. Primitives and images are hashed by the stage.

use crate::scene_resources::TextureResource;
use crate::scene_resources::material::{MaterialResource, MaterialTexture};
use choreo_asset::{AlphaMode, ContentHash, Shading, Wrap};
use glam::{Vec3, Vec4};

/// Hashes an array after its length, so that no two lists can run into each other.
fn array<T: bytemuck::NoUninit>(hasher: &mut blake3::Hasher, data: &[T]) {
    hasher.update(&(data.len() as u64).to_le_bytes());
    hasher.update(bytemuck::cast_slice(data));
}

/// The first 16 bytes, which name buffers: they tell contents apart as well and are compared at half the cost.
pub(crate) fn short(hash: ContentHash) -> [u8; 16] {
    let mut out = [0; 16];
    out.copy_from_slice(&hash[..16]);
    out
}

/// Hash of a material with its textures by index: equal materials of one stage.
pub(crate) fn material_hash(m: &MaterialResource) -> [u8; 16] {
    hash_with(m, &|texture| texture.to_le_bytes().to_vec())
}

/// Hash of a material with its textures by content: equal materials of different stages.
pub(crate) fn material_content(m: &MaterialResource, textures: &[TextureResource]) -> [u8; 16] {
    hash_with(m, &|texture| match textures.get(texture as usize) {
        Some(t) => [&t.hash[..], &[u8::from(t.srgb), u8::from(t.mipmaps)]].concat(),
        None => Vec::new(),
    })
}

fn hash_with(m: &MaterialResource, texture_id: &dyn Fn(u32) -> Vec<u8>) -> [u8; 16] {
    let mut h = blake3::Hasher::new();
    let f = &m.material;
    let (alpha, cutoff) = match f.alpha_mode {
        AlphaMode::Opaque => (0u32, 0.0),
        AlphaMode::Mask(cutoff) => (1, cutoff),
        AlphaMode::Blend => (2, 0.0),
    };
    array(&mut h, &[f.shading as u32, alpha, u32::from(f.double_sided)]);
    array(&mut h, &[f.base_color, vec4(f.emissive), vec4(f.specular_color)]);
    array(
        &mut h,
        &[
            cutoff,
            f.metallic,
            f.roughness,
            f.normal_scale,
            f.occlusion_strength,
            f.specular,
            f.shininess,
            f.relief,
        ],
    );
    if let Some(r) = f.mirrors() {
        array(&mut h, &[vec4(r.color)]);
    }
    if let Some(s) = &f.sequence {
        for stream in &s.streams {
            array(&mut h, &[stream.slot as u32]);
            stream.hashes.iter().for_each(|hash| array(&mut h, hash));
        }
        array(&mut h, &[s.fps, f32::from(u8::from(s.once))]);
    }
    if let Some(t) = f.triplanar {
        array(&mut h, &[t.middle.extend(t.size)]);
        array(&mut h, &[t.sharpness]);
    }
    if let Some(pen) = f.line_style {
        array(&mut h, &[pen.width, f32::from(u8::from(pen.metres)), f32::from(u8::from(pen.round))]);
    }
    if let Some(t) = f.toon.as_deref().filter(|_| f.shading == Shading::Toon) {
        let colors = [
            t.shade_color.extend(t.shading_shift),
            t.matcap.extend(t.shading_toony),
            t.rim_color.extend(t.gi_equalization),
        ];
        array(&mut h, &colors);
        array(&mut h, &[t.uv_moved.extend(0.0)]);
        array(&mut h, &[t.shading_shift_scale, t.rim_fresnel_power, t.rim_lift, t.rim_lighting_mix]);
    }
    // Effects give outlines to surfaces of any shading.
    if let Some(o) = f.toon.as_deref().and_then(|t| t.outline.as_ref()) {
        array(&mut h, &[o.color.extend(o.lighting_mix)]);
        array(&mut h, &[o.width, f32::from(u8::from(o.on_screen))]);
    }
    for t in m.textures {
        texture_ref(&mut h, t, texture_id);
    }
    if let Some(l) = f.layers.as_deref() {
        let colors = [
            l.sheen_color.extend(l.sheen_roughness),
            l.extinction().extend(l.thickness),
            l.diffuse_transmission_color.extend(l.diffuse_transmission),
            l.iors().extend(l.iridescence_ior),
        ];
        array(&mut h, &colors);
        let factors = [
            l.clearcoat,
            l.clearcoat_roughness,
            l.clearcoat_normal_scale,
            l.transmission,
            l.anisotropy,
            l.anisotropy_rotation,
            l.iridescence,
        ];
        array(&mut h, &factors);
        array(&mut h, &[m.film_thickness()]);
    }
    short(*h.finalize().as_bytes())
}

fn vec4(v: Vec3) -> Vec4 {
    v.extend(0.0)
}

fn texture_ref(h: &mut blake3::Hasher, t: Option<MaterialTexture>, id: &dyn Fn(u32) -> Vec<u8>) {
    let Some(t) = t else {
        h.update(&[0]);
        return;
    };
    let wrap = |w: Wrap| w as u8;
    h.update(&[
        1,
        wrap(t.sampler.wrap_u),
        wrap(t.sampler.wrap_v),
        u8::from(t.sampler.mag_linear),
        u8::from(t.sampler.min_linear),
        t.sampler.mip_linear.map_or(2, u8::from),
        t.uv_set,
    ]);
    h.update(&id(t.texture));
    array(h, &t.uv_transform.to_cols_array());
}
