//! Replaces textures of an asset's materials: `asset.texture(material, slot, image)`.

use super::image_sequence::sequence_of_images;
use crate::call::{ApiError, Call, Options, Reply, one_of, unknown};
use crate::value::{AssetRef, ImageRef, ImageSequenceRef};
use choreo_asset::{
    AlphaMode, Asset, ImageSequence, ImageStream, Material, Mesh, Reflection, Shading, TextureRef,
    TextureSlot,
};
use choreo_importer_kit::tangents;
use glam::{Affine2, Vec3};
use rhai::{Array, Dynamic};
use std::sync::Arc;

/// Names of the texture slots: those of glTF, and the reflection of Blinn–Phong.
const SLOTS: &[&str] = &[
    "color",
    "normal",
    "metallic_roughness",
    "occlusion",
    "emissive",
    "specular",
    "specular_color",
    "reflection",
];

/// Whether a shading model reads a texture slot. Toon shading may read all slots of glTF.
fn reads_slot(shading: Shading, slot: &str) -> bool {
    match shading {
        Shading::BlinnPhong | Shading::Phong => !matches!(slot, "metallic_roughness" | "specular"),
        _ => slot != "reflection",
    }
}

/// Runs `asset.texture(material, slot, image)`: makes a copy of the asset with another texture.
pub(crate) fn texture(c: &mut Call) -> Reply {
    let source = c.this_asset()?;
    let material_name = c.text(0)?;
    let slot = one_of(&c.value(1), "texture: slot", SLOTS)?;
    let o = c.options(3, &["fps", "once", "uv_set"])?;
    let given = read_image(c, &o)?;
    let index = source.materials.iter().position(|m| m.name == material_name).ok_or_else(|| {
        let names = source.materials.iter().map(|m| m.name.as_str());
        unknown("material", &material_name, &format!(" in {}", source.name), names)
    })?;
    let mut asset = Asset { derived: Default::default(), ..Asset::clone(&source) };
    let image = asset.images.len() as u32;
    asset.images.push(given.image.clone());
    let material = &mut asset.materials[index];
    let requested_uv_set = read_uv_set(&o)?;
    if requested_uv_set.is_some() && material.triplanar.is_some() {
        let text = format!("texture: {material_name} has a triplanar projection, which needs no uv_set");
        return Err(ApiError::new(text).focus("uv_set"));
    }
    let new_texture = |old: &Option<TextureRef>| {
        let (uv_set, uv_transform) = match (old, requested_uv_set) {
            (Some(t), None) => (t.uv_set, t.uv_transform),
            (Some(t), Some(set)) if set == t.uv_set => (set, t.uv_transform),
            (_, set) => (set.unwrap_or(0), Affine2::IDENTITY),
        };
        Some(TextureRef { image, sampler: given.sampler, uv_set, uv_transform })
    };
    check_slot(material, slot)?;
    replace_texture(material, slot, new_texture);
    set_sequence(&o, material, slot, given.sequence.as_ref())?;
    if slot == "color" && material.alpha_mode == AlphaMode::Opaque {
        let alpha_mode = || super::material::alpha_mode_of(&given.image);
        material.alpha_mode = given.sequence.as_ref().map_or_else(alpha_mode, |f| f.alpha);
    }
    let uv_set = usize::from(texture_mut(material, slot).as_ref().map_or(0, |t| t.uv_set));
    let has_uvs = add_tangents(&mut asset, index as u32, slot, uv_set);
    if !has_uvs {
        let which = if uv_set == 1 { "second " } else { "" };
        let text = format!(
            "texture: the meshes of the material \"{material_name}\" have no {which}texture coordinates"
        );
        return Err(ApiError::new(text).focus(&material_name));
    }
    c.stage_draft().mark_used(&source);
    let load = c.stage_draft().add_procedural_load(&Arc::new(asset), &c.place);
    Ok(Dynamic::from(AssetRef { load, dead: false }))
}

/// The image or image sequence of the third argument.
fn read_image(c: &Call, o: &Options) -> Result<ImageRef, ApiError> {
    let value = c.value(2);
    let given = match value.read_lock::<Array>() {
        Some(array) => {
            let all: Option<Vec<ImageRef>> = array.iter().map(|v| v.clone().try_cast()).collect();
            Some(all.ok_or_else(|| c.wrong(2, "an Image, from image(…), or an array of them"))?)
                .map(|all| sequence_of_images(o, "image", &all))
                .transpose()?
        }
        None => value.clone().try_cast::<ImageRef>(),
    };
    given.ok_or_else(|| c.wrong(2, "an Image, from image(…), or an array of them"))
}

/// The index of the texture coordinates, from the option `uv_set`.
fn read_uv_set(o: &Options) -> Result<Option<u8>, ApiError> {
    match o.number("uv_set")? {
        None => Ok(None),
        Some(0.0) => Ok(Some(0)),
        Some(1.0) => Ok(Some(1)),
        Some(_) => {
            let text = "texture: uv_set must be 0, for uvs, or 1, for uvs2";
            Err(ApiError::new(text).focus("uv_set"))
        }
    }
}

/// Refuses a slot that the shading of a material does not read.
fn check_slot(material: &Material, slot: &str) -> Result<(), ApiError> {
    let name = &material.name;
    if material.shading == Shading::Unlit && slot != "color" {
        let text = format!("texture: {name} is unlit; it reads no {slot}");
        return Err(ApiError::new(text).hint("use the slot \"color\""));
    }
    if !reads_slot(material.shading, slot) {
        let (model, instead) = match slot {
            "reflection" => ("roughness, and mirrors by it", "metallic_roughness"),
            "specular" => ("shininess", "specular_color"),
            _ => ("shininess", "reflection"),
        };
        let text = format!("texture: {name} has {model}; it reads no {slot}");
        return Err(ApiError::new(text).focus(slot).hint(format!("use the slot \"{instead}\"")));
    }
    Ok(())
}

/// Adds tangents to the primitives with a material if a normal map needs them. Returns whether any of these primitives has
/// texture coordinates.
fn add_tangents(asset: &mut Asset, material: u32, slot: &str, uv_set: usize) -> bool {
    let mut has_uvs = false;
    for mesh in &mut asset.meshes {
        if !mesh.primitives.iter().any(|p| p.material == Some(material)) {
            continue;
        }
        let made = Mesh::clone(mesh);
        let mut made = Mesh { primitives: Vec::new(), ..made };
        for p in &mesh.primitives {
            let mut p = p.clone();
            if p.material == Some(material) {
                has_uvs |= !p.uvs[uv_set].is_empty();
                let can_have_tangents =
                    !p.uvs[uv_set].is_empty() && !p.normals.is_empty() && p.morphs.is_empty();
                if slot == "normal" && p.tangents.is_empty() && can_have_tangents {
                    tangents::add(&mut p, uv_set);
                }
            }
            made.primitives.push(p);
        }
        *mesh = Arc::new(made);
    }
    has_uvs
}

/// The texture in a slot of a material.
fn texture_mut<'a>(material: &'a mut Material, slot: &str) -> &'a mut Option<TextureRef> {
    match slot {
        "normal" => &mut material.normal_texture,
        "metallic_roughness" => &mut material.metallic_roughness_texture,
        "occlusion" => &mut material.occlusion_texture,
        "emissive" => &mut material.emissive_texture,
        "specular" => &mut material.specular_texture,
        "specular_color" => &mut material.specular_color_texture,
        "reflection" => &mut material.reflection.get_or_insert_with(full_reflection).texture,
        _ => &mut material.base_color_texture,
    }
}

/// A reflection with the factor 1, because the map contains the amount.
fn full_reflection() -> Box<Reflection> {
    Box::new(Reflection { color: Vec3::ONE, texture: None, environment: None })
}

/// Replaces the texture in a slot by the result of `new`, which gets the old texture.
fn replace_texture(
    material: &mut Material,
    slot: &str,
    new: impl Fn(&Option<TextureRef>) -> Option<TextureRef>,
) {
    let texture = texture_mut(material, slot);
    *texture = new(texture);
    // A black emissive factor would make the image invisible.
    if slot == "emissive" && material.emissive == Vec3::ZERO {
        material.emissive = Vec3::ONE;
    }
}

/// Sets the image sequence of a slot in the texture animation of the material, whose slots all change together. `slot_name`: one
/// of [`SLOTS`].
fn set_sequence(
    o: &Options,
    material: &mut Material,
    slot_name: &str,
    sequence: Option<&ImageSequenceRef>,
) -> Result<(), ApiError> {
    let slot = match slot_name {
        "normal" => TextureSlot::Normal,
        "metallic_roughness" => TextureSlot::MetallicRoughness,
        "occlusion" => TextureSlot::Occlusion,
        "emissive" => TextureSlot::Emissive,
        "specular" | "reflection" => TextureSlot::Specular,
        "specular_color" => TextureSlot::SpecularColor,
        _ => TextureSlot::BaseColor,
    };
    let before = material.sequence.take();
    let mut streams = before.as_ref().map_or(Vec::new(), |s| s.streams.clone());
    streams.retain(|s| s.slot != slot);
    let (fps, once) = (o.number_in("fps", 0.0, 1000.0)?, o.flag("once")?);
    let time_option = if fps.is_some() { "fps" } else { "once" };
    let Some(sequence) = sequence else {
        if fps.is_some() || once.is_some() {
            let text = format!("texture: {time_option} is for image sequences");
            return Err(ApiError::new(text).focus(time_option));
        }
        if let (false, Some(before)) = (streams.is_empty(), before) {
            material.sequence = Some(Arc::new(ImageSequence { streams, ..ImageSequence::clone(&before) }));
        }
        return Ok(());
    };
    let other_count = streams.first().map(|s| s.hashes.len());
    let before = before.filter(|_| other_count.is_some());
    let old_timing = before.as_ref().map_or((12.0, false), |s| (s.fps, s.once));
    let new_timing = (fps.map_or(old_timing.0, |v| v as f32), once.unwrap_or(old_timing.1));
    if let Some(count) = other_count.filter(|n| *n != sequence.hashes.len()) {
        let text = format!(
            "texture: {} images, and {count} in another slot; sequences on one surface must have the same length",
            sequence.hashes.len()
        );
        return Err(ApiError::new(text));
    }
    if other_count.is_some() && new_timing != old_timing {
        let text =
            format!("texture: {time_option} differs from that of another slot; all images change together");
        return Err(ApiError::new(text).focus(time_option));
    }
    streams.push(ImageStream { slot, pictures: sequence.images.clone(), hashes: sequence.hashes.clone() });
    streams.sort_by_key(|s| s.slot);
    let (fps, once) = new_timing;
    material.sequence = Some(Arc::new(ImageSequence { streams, fps, once }));
    Ok(())
}
