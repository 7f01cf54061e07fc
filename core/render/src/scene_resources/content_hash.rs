//! Content hashes: the first 16 bytes of BLAKE3. Those of primitives and images are the stage's own.

use crate::scene_resources::{CatalogMaterial, CatalogTexture, CatalogTextureRef};
use choreo_asset::{AlphaMode, ContentHash, Shading, Wrap};
use glam::{Vec3, Vec4};

/// Arrays are preceded by their length, so that no two lists can run into each other.
fn array<T: bytemuck::NoUninit>(hasher: &mut blake3::Hasher, data: &[T]) {
    hasher.update(&(data.len() as u64).to_le_bytes());
    hasher.update(bytemuck::cast_slice(data));
}

/// As it names buffers: 16 bytes are told apart well enough and compared at half the cost.
pub fn short(hash: ContentHash) -> [u8; 16] {
    let mut out = [0; 16];
    out.copy_from_slice(&hash[..16]);
    out
}

/// Of what the catalogue keeps of a material: textures count by their index there.
pub fn material_hash(m: &CatalogMaterial) -> [u8; 16] {
    hash_with(m, &|texture| texture.to_le_bytes().to_vec())
}

/// The same for the catalogues of different stages: textures count by their content.
pub fn material_content(m: &CatalogMaterial, textures: &[CatalogTexture]) -> [u8; 16] {
    hash_with(m, &|texture| match textures.get(texture as usize) {
        Some(t) => [&t.hash[..], &[u8::from(t.srgb), u8::from(t.mipmaps)]].concat(),
        None => Vec::new(),
    })
}

fn hash_with(m: &CatalogMaterial, texture_id: &dyn Fn(u32) -> Vec<u8>) -> [u8; 16] {
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
    if let Some(pen) = f.pen {
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
    for t in m.texture_refs() {
        texture_ref(&mut h, t, texture_id);
    }
    if let Some(l) = crate::shader::uniforms::LayersUniform::new(m) {
        h.update(bytemuck::bytes_of(&l));
    }
    short(*h.finalize().as_bytes())
}

fn vec4(v: Vec3) -> Vec4 {
    v.extend(0.0)
}

fn texture_ref(h: &mut blake3::Hasher, t: Option<CatalogTextureRef>, id: &dyn Fn(u32) -> Vec<u8>) {
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
