//! Content hashes: the first 16 bytes of BLAKE3 over the numbers that reach pixels, names left out.

use crate::catalog::{CatalogMaterial, CatalogTextureRef};
use choreo_stage::{AlphaMode, Image, Primitive, Wrap};
use glam::{Vec3, Vec4};

fn finish(hasher: &blake3::Hasher) -> [u8; 16] {
    let mut out = [0; 16];
    out.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    out
}

/// Arrays are preceded by their length, so that no two lists can run into each other.
fn array<T: bytemuck::NoUninit>(hasher: &mut blake3::Hasher, data: &[T]) {
    hasher.update(&(data.len() as u64).to_le_bytes());
    hasher.update(bytemuck::cast_slice(data));
}

/// The material is not part of it: equal shapes in different colours share their buffers.
pub fn primitive_hash(p: &Primitive) -> [u8; 16] {
    let mut h = blake3::Hasher::new();
    array(&mut h, &[p.topology as u32, p.influences as u32, p.morphs.len() as u32]);
    array(&mut h, &p.indices);
    array(&mut h, &p.positions);
    array(&mut h, &p.normals);
    array(&mut h, &p.tangents);
    array(&mut h, &p.uvs[0]);
    array(&mut h, &p.uvs[1]);
    array(&mut h, &p.colors);
    array(&mut h, &p.joint_indices);
    array(&mut h, &p.joint_weights);
    for m in &p.morphs {
        array(&mut h, &m.positions);
        array(&mut h, &m.normals);
        array(&mut h, &m.tangents);
    }
    finish(&h)
}

pub fn pixel_hash(image: &Image) -> [u8; 16] {
    let mut h = blake3::Hasher::new();
    array(&mut h, &[image.width, image.height]);
    array(&mut h, &image.rgba);
    finish(&h)
}

pub fn material_hash(m: &CatalogMaterial) -> [u8; 16] {
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
        &[cutoff, f.metallic, f.roughness, f.normal_scale, f.occlusion_strength, f.specular, f.shininess],
    );
    for t in m.texture_refs() {
        texture_ref(&mut h, t);
    }
    finish(&h)
}

fn vec4(v: Vec3) -> Vec4 {
    v.extend(0.0)
}

fn texture_ref(h: &mut blake3::Hasher, t: Option<CatalogTextureRef>) {
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
    h.update(&t.texture.to_le_bytes());
    array(h, &t.uv_transform.to_cols_array());
}
