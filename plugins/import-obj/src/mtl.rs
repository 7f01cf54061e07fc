//! MTL material libraries.

use choreo_asset::{AlphaMode, Material, Reflection, Sampler, Shading, TextureRef, Wrap};
use choreo_importer_kit::color::linear_channel;
use choreo_importer_kit::text::{Lines, next_word, number, shown};
use choreo_importer_kit::textures::Textures;
use choreo_importer_kit::{Budget, Notes, Result};
use choreo_plugin::Files;
use glam::{Affine2, Mat2, Vec2, Vec3};
use std::collections::BTreeMap;

/// A material as the library has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mtl {
    pub name: String,
    pub place: String,
    pub diffuse: Option<Vec3>,
    pub specular: Option<Vec3>,
    pub emissive: Option<Vec3>,
    pub shininess: f32,
    pub alpha: f32,
    pub illum: Option<i64>,
    pub roughness: Option<f32>,
    pub metallic: Option<f32>,
    /// A cube map for reflections is named, which is not read.
    pub cube: bool,
    pub maps: BTreeMap<Slot, Map>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Slot {
    Diffuse,
    Specular,
    Emissive,
    Alpha,
    Roughness,
    Metallic,
    Bump,
    Normal,
    /// `refl` without a type: how much each place mirrors.
    Reflection,
    /// `refl -type sphere`: the mirrored panorama.
    Environment,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Map {
    pub file: String,
    pub scale: Vec2,
    pub offset: Vec2,
    pub clamp: bool,
    /// `-bm`: strength of a bump or normal map.
    pub strength: f32,
    /// `-type` of a reflection map.
    pub kind: Option<String>,
}

/// The materials of one library, in order. Faults are warnings only: a half-right material is better than none.
pub(crate) fn read(bytes: &[u8], library: &str, notes: &Notes) -> Vec<Mtl> {
    let mut out: Vec<Mtl> = Vec::new();
    let mut unknown: BTreeMap<String, usize> = BTreeMap::new();
    for (line, text) in Lines::new(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)) {
        let mut rest = text;
        let Some(word) = next_word(&mut rest) else { continue };
        let place = || format!("{library} line {line}");
        if word.starts_with(b"#") {
            continue;
        }
        let keyword = word.to_ascii_lowercase();
        if keyword == b"newmtl" {
            let name = String::from_utf8_lossy(rest.trim_ascii()).into_owned();
            out.push(Mtl { name, place: place(), alpha: 1.0, ..Mtl::default() });
            continue;
        }
        let Some(material) = out.last_mut() else {
            notes
                .warn(place(), format!("\"{}\" stands before the first newmtl; it is left out", shown(word)));
            continue;
        };
        if let Err(problem) = line_of(material, &keyword, rest, &mut unknown) {
            notes.warn(place(), format!("\"{}\": {}; it is left out", shown(word), problem.what));
        }
    }
    if !unknown.is_empty() {
        let names: Vec<&str> = unknown.keys().map(String::as_str).take(12).collect();
        notes.warn(library, format!("not used: {}", names.join(", ")));
    }
    out
}

fn line_of(m: &mut Mtl, keyword: &[u8], rest: &[u8], unknown: &mut BTreeMap<String, usize>) -> Result<()> {
    let slot = match keyword {
        b"map_kd" => Some(Slot::Diffuse),
        b"map_ks" => Some(Slot::Specular),
        b"map_ke" => Some(Slot::Emissive),
        b"map_d" | b"map_opacity" => Some(Slot::Alpha),
        b"map_pr" => Some(Slot::Roughness),
        b"map_pm" => Some(Slot::Metallic),
        b"bump" | b"map_bump" => Some(Slot::Bump),
        b"norm" | b"map_kn" => Some(Slot::Normal),
        _ => None,
    };
    if let Some(slot) = slot {
        m.maps.insert(slot, read_map(rest)?);
        return Ok(());
    }
    if let b"refl" | b"map_refl" = keyword {
        let map = read_map(rest)?;
        match map.kind.as_deref() {
            None => m.maps.insert(Slot::Reflection, map),
            Some("sphere") => m.maps.insert(Slot::Environment, map),
            // A cube map has six sides, but gets one warning.
            Some(kind) if kind.starts_with("cube_") => {
                return match std::mem::replace(&mut m.cube, true) {
                    true => Ok(()),
                    false => Err(format!(
                        "-type {kind} is a side of a cube map; only a panorama, -type sphere, can be used \
                         for reflections"
                    )
                    .into()),
                };
            }
            Some(kind) => {
                return Err(format!("-type {kind} is neither sphere nor a side of a cube map").into());
            }
        };
        return Ok(());
    }
    match keyword {
        b"kd" => m.diffuse = Some(read_color(rest)?),
        b"ks" => m.specular = Some(read_color(rest)?),
        b"ke" => m.emissive = Some(read_color(rest)?),
        b"ns" => m.shininess = read_number(rest)?.max(0.0),
        b"d" => {
            let rest = rest.trim_ascii();
            // `-halo` makes the opacity fade towards the silhouette; only its factor is used.
            m.alpha = read_number(rest.strip_prefix(b"-halo").unwrap_or(rest))?.clamp(0.0, 1.0);
        }
        b"tr" => m.alpha = 1.0 - read_number(rest)?.clamp(0.0, 1.0),
        b"illum" => m.illum = Some(read_number(rest)? as i64),
        b"pr" => m.roughness = Some(read_number(rest)?.clamp(0.0, 1.0)),
        b"pm" => m.metallic = Some(read_number(rest)?.clamp(0.0, 1.0)),
        // Ambient color, transmission filter, index of refraction and map sharpness have no effect on the material models used
        // here.
        b"ka" | b"tf" | b"ni" | b"map_ka" | b"sharpness" => {}
        _ => *unknown.entry(shown(keyword)).or_insert(0) += 1,
    }
    Ok(())
}

fn read_number(mut rest: &[u8]) -> Result<f32> {
    let word = next_word(&mut rest).ok_or("needs a number")?;
    let value = number(word).map(|v| v as f32).filter(|v| v.is_finite());
    value.ok_or_else(|| format!("\"{}\" is not a finite number", shown(word)).into())
}

/// Reads a color, `r g b`, or a gray, `r`.
fn read_color(mut rest: &[u8]) -> Result<Vec3> {
    let mut values = Vec::with_capacity(3);
    while let (Some(word), true) = (next_word(&mut rest), values.len() < 3) {
        if matches!(word, b"spectral" | b"xyz") {
            return Err(format!("{} colors are not supported", shown(word)).into());
        }
        values.push(read_number(word)?);
    }
    match values[..] {
        [r, g, b] => Ok(Vec3::new(r, g, b)),
        [gray] => Ok(Vec3::splat(gray)),
        _ => Err("needs one or three numbers".into()),
    }
}

/// Reads the options of a map, then its file name, which may contain spaces.
fn read_map(rest: &[u8]) -> Result<Map> {
    let mut out = Map {
        file: String::new(),
        scale: Vec2::ONE,
        offset: Vec2::ZERO,
        clamp: false,
        strength: 1.0,
        kind: None,
    };
    let mut rest = rest;
    loop {
        let before = rest;
        let Some(word) = next_word(&mut rest) else { return Err("names no file".into()) };
        let plain = |rest: &mut &[u8]| -> Option<f32> {
            let mut ahead = *rest;
            let value = number(next_word(&mut ahead)?)? as f32;
            *rest = ahead;
            Some(value).filter(|v| v.is_finite())
        };
        match word {
            b"-o" | b"-s" | b"-t" => {
                // One to three numbers. A missing second one has the default; the third is ignored.
                let default = if word == b"-s" { 1.0 } else { 0.0 };
                let u = plain(&mut rest).ok_or_else(|| format!("{} needs a number", shown(word)))?;
                let v = plain(&mut rest);
                let _depth = v.and_then(|_| plain(&mut rest));
                let value = Vec2::new(u, v.unwrap_or(default));
                match word {
                    b"-o" => out.offset = value,
                    b"-s" => out.scale = value,
                    _ => {}
                }
            }
            b"-clamp" => out.clamp = next_word(&mut rest) == Some(b"on"),
            b"-bm" => out.strength = plain(&mut rest).ok_or("-bm needs a number")?,
            b"-mm" => {
                let _base = plain(&mut rest);
                let _gain = plain(&mut rest);
            }
            b"-type" => out.kind = next_word(&mut rest).map(|w| shown(w).to_ascii_lowercase()),
            b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-boost" | b"-texres" => {
                let _value = next_word(&mut rest);
            }
            _ => {
                out.file = String::from_utf8_lossy(before.trim_ascii()).into_owned();
                return Ok(out);
            }
        }
    }
}

/// Context in which materials are read.
pub(crate) struct Source<'a> {
    pub textures: Option<&'a mut Textures>,
    pub files: &'a dyn Files,
    pub budget: &'a Budget,
    pub notes: &'a Notes,
    pub srgb: bool,
}

/// A material, and its bump map, if any: only the decoded image shows whether that is a normal map.
pub(crate) fn material(m: &Mtl, source: &mut Source<'_>) -> (Material, Option<(TextureRef, f32)>) {
    let srgb = source.srgb;
    let color = |c: Vec3| Vec3::from(c.to_array().map(|c| linear_channel(c, srgb)));
    let mut diffuse = color(m.diffuse.unwrap_or(Vec3::splat(0.8)));
    let diffuse_map = texture(m, Slot::Diffuse, source);
    if diffuse_map.is_some() && m.diffuse.is_none_or(|d| d == Vec3::ZERO) {
        if m.diffuse.is_some() {
            source.notes.warn(
                m.place.as_str(),
                format!("\"{}\" has a texture and the color black; the color is taken as white", m.name),
            );
        }
        diffuse = Vec3::ONE;
    }
    let pbr = m.roughness.is_some()
        || m.metallic.is_some()
        || m.maps.contains_key(&Slot::Roughness)
        || m.maps.contains_key(&Slot::Metallic);
    // Our Blinn–Phong lobe is normalized by (s + 8) / 8; MTL's is not, and has Ks at its peak.
    let specular = if m.illum == Some(1) || m.illum == Some(0) {
        Vec3::ZERO
    } else {
        color(m.specular.unwrap_or_default())
    };
    let mut out = Material {
        name: m.name.clone(),
        shading: if pbr { Shading::MetallicRoughness } else { Shading::BlinnPhong },
        base_color: diffuse.extend(m.alpha),
        base_color_texture: diffuse_map,
        metallic: m.metallic.unwrap_or(0.0),
        roughness: m.roughness.unwrap_or(0.5),
        emissive: color(m.emissive.unwrap_or_default()),
        shininess: m.shininess.clamp(1.0, 10_000.0),
        alpha_mode: if m.alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
        // The format does not say which side is visible.
        double_sided: true,
        ..Material::default()
    };
    if !pbr {
        out.specular_color = specular * (8.0 / (out.shininess + 8.0));
        out.specular_color_texture = texture(m, Slot::Specular, source);
        out.reflection = reflection(m, source).map(Box::new);
    } else if m.maps.keys().any(|slot| matches!(slot, Slot::Reflection | Slot::Environment)) {
        source.notes.warn(
            m.place.as_str(),
            format!("\"{}\" has Pr or Pm, which set its reflections; its refl is left out", m.name),
        );
    }
    out.emissive_texture = texture(m, Slot::Emissive, source);
    if out.emissive_texture.is_some() && m.emissive.is_none_or(|e| e == Vec3::ZERO) {
        out.emissive = Vec3::ONE;
    }
    if let Some(alpha) = m.maps.get(&Slot::Alpha) {
        match m.maps.get(&Slot::Diffuse) {
            Some(diffuse) if diffuse.file == alpha.file => out.alpha_mode = AlphaMode::Blend,
            _ => source.notes.warn(m.place.as_str(), format!("map_d \"{}\" is not the file of map_Kd; only its alpha channel can be used, so it is left out", alpha.file)),
        }
    }
    if pbr {
        // glTF's layout: G roughness, B metallic.
        match (m.maps.get(&Slot::Roughness), m.maps.get(&Slot::Metallic)) {
            (Some(a), Some(b)) if a.file == b.file => {
                out.metallic_roughness_texture = texture(m, Slot::Roughness, source);
                out.metallic = m.metallic.unwrap_or(1.0);
                out.roughness = m.roughness.unwrap_or(1.0);
            }
            (None, None) => {}
            _ => source.notes.warn(m.place.as_str(), "map_Pr and map_Pm are used where both are one file (roughness in green, metallic in blue); they are left out"),
        }
    }
    if let Some(normal) = texture(m, Slot::Normal, source) {
        out.normal_texture = Some(normal);
        out.normal_scale = m.maps.get(&Slot::Normal).map_or(1.0, |m| m.strength);
        return (out, None);
    }
    let strength = m.maps.get(&Slot::Bump).map_or(1.0, |m| m.strength);
    let bump = texture(m, Slot::Bump, source).map(|t| (t, strength));
    (out, bump)
}

/// The mirror reflection of a material (MTL, "Illumination models" and "Reflection map"). Illumination models 3 to 8 reflect with
/// Ks, and so does a surface with a panorama of its own. A map without a type states the amount itself, as Blender writes it.
/// Models 0 to 2 alone reflect nothing.
fn reflection(m: &Mtl, source: &mut Source<'_>) -> Option<Reflection> {
    let map = texture(m, Slot::Reflection, source);
    let environment = texture(m, Slot::Environment, source).map(|t| TextureRef {
        sampler: Reflection::panorama_sampler(),
        uv_transform: Affine2::IDENTITY,
        ..t
    });
    let srgb = source.srgb;
    let specular = m.specular.map(|c| Vec3::from(c.to_array().map(|c| linear_channel(c, srgb).min(1.0))));
    let mirrors = matches!(m.illum, Some(3..=8));
    let color = match (&map, &environment) {
        (Some(_), _) => Vec3::ONE,
        (None, Some(_)) => specular.unwrap_or(Vec3::ONE),
        (None, None) if mirrors => specular.unwrap_or_default(),
        (None, None) => return None,
    };
    (color != Vec3::ZERO).then_some(Reflection { color, texture: map, environment })
}

fn texture(m: &Mtl, slot: Slot, source: &mut Source<'_>) -> Option<TextureRef> {
    let map = m.maps.get(&slot)?;
    let textures = source.textures.as_deref_mut()?;
    let image = textures.find(&map.file, &m.place, source.files, source.budget, source.notes)?;
    let wrap = if map.clamp { Wrap::ClampToEdge } else { Wrap::Repeat };
    // MTL looks the map up at uv · scale + offset with v from the bottom; our v runs from the top: 1 − ((1 − v) · s + o).
    let uv_transform = Affine2 {
        matrix2: Mat2::from_diagonal(map.scale),
        translation: Vec2::new(map.offset.x, 1.0 - map.scale.y - map.offset.y),
    };
    Some(TextureRef {
        image,
        sampler: Sampler { wrap_u: wrap, wrap_v: wrap, ..Sampler::default() },
        uv_set: 0,
        uv_transform,
    })
}
