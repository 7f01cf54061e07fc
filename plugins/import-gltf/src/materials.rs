//! Materials and textures (glTF 2.0 §3.8, §3.9 and the KHR_materials extensions).

use crate::file::File;
use crate::glossiness::Glossy;
use crate::images::ImageTable;
use crate::layers;
use crate::problem::{Problem, Result, WithPlace, element};
use crate::profile::Profile;
use crate::repair::{self, as_integer};
use choreo_asset::{AlphaMode, Material, Sampler, Shading, TextureRef, Wrap};
use choreo_importer_kit::text;
use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use gltf::json;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::validation::Checked;
use json::texture::{MagFilter, MinFilter, WrappingMode};

/// Reflectance of a dielectric with index 1.5 at normal incidence (glTF 2.0 Appendix B.2.2).
const DIELECTRIC_F0: f32 = 0.04;

/// Reads the materials, and lists those that [`crate::glossiness`] must finish.
pub(crate) fn read<'a>(
    file: &'a File<'_>,
    images: &mut ImageTable<'a>,
    wants_textures: bool,
    profile: &dyn Profile,
) -> Result<(Vec<Material>, Vec<Glossy>)> {
    let none = serde_json::Map::new();
    let mut out = Vec::with_capacity(file.root.materials.len());
    let mut glossy = Vec::new();
    for (index, material) in file.root.materials.iter().enumerate() {
        let place = format!("materials[{index}]");
        let mut reader = Reader { file, images, wants_textures, place: &place, glossy: None };
        let others = material.extensions.as_ref().map_or(&none, |e| &e.others);
        let mut material = reader.read_material(material)?;
        let factor = reader.glossy;
        profile.material(&file.document(None), index, others, &mut reader, &mut material)?;
        if !all_finite(&material) {
            return Err(Problem::new(place, "has a factor that is not finite"));
        }
        if let (Some(factor), Some(texture)) = (factor, &material.specular_color_texture) {
            let pixels = images.entries.get(texture.image as usize).map_or(0, |e| e.pixels());
            file.charge(pixels, 4).at(|| format!("materials[{index}]"))?;
            glossy.push(Glossy { material: index, factor });
        }
        out.push(material);
    }
    // A refracting volume blurs the scene behind it by roughness; a thin wall does not.
    let thin = |m: &Material| m.layers.as_ref().is_some_and(|l| l.transmission > 0.0 && !l.refracts());
    let see_through = |m: &&Material| thin(m) && m.roughness > 0.0;
    if let Some(first) = out.iter().position(|m| see_through(&m)) {
        let count = out.iter().filter(see_through).count();
        let has = if count == 1 { "has" } else { "have" };
        let what = "transmission with thin, rough walls: the background is tinted, but not blurred \
            by the roughness";
        let materials = text::count(count, "material");
        file.warn(format!("materials[{first}]"), format!("{materials} {has} {what}"));
    }
    Ok((out, glossy))
}

pub(crate) struct Reader<'a, 'b, 'f> {
    file: &'a File<'f>,
    images: &'b mut ImageTable<'a>,
    wants_textures: bool,
    place: &'b str,
    /// Glossiness factor of a specular-glossiness material.
    glossy: Option<f32>,
}

/// Reads the textures in a profile's material extension.
pub trait MaterialTextures {
    /// `info` is a glTF textureInfo: index, texCoord, KHR_texture_transform. `None` where textures are not requested, or where the
    /// texture cannot be used, which gives a warning. `slot` names the texture in messages.
    fn texture(&mut self, slot: &'static str, info: &serde_json::Value) -> Result<Option<TextureRef>>;
}

impl MaterialTextures for Reader<'_, '_, '_> {
    fn texture(&mut self, slot: &'static str, value: &serde_json::Value) -> Result<Option<TextureRef>> {
        let parsed = repair::typed::<json::texture::Info>(value)
            .map_err(|e| Problem::new(format!("{}.{slot}", self.place), format!("is no textureInfo: {e}")))?;
        Reader::read_texture(self, texture_use(slot, &parsed))
    }
}

/// A reference to a texture, of any kind, before it is looked up.
pub(crate) struct TextureUse<'u> {
    pub slot: &'static str,
    pub texture: usize,
    pub uv_set: u32,
    pub transform: Option<&'u TextureTransform>,
}

fn texture_use<'u>(slot: &'static str, info: &'u json::texture::Info) -> TextureUse<'u> {
    TextureUse {
        slot,
        texture: info.index.value(),
        uv_set: info.tex_coord,
        transform: info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref()),
    }
}

impl<'a> Reader<'a, '_, '_> {
    fn read_material(&mut self, m: &json::Material) -> Result<Material> {
        let pbr = &m.pbr_metallic_roughness;
        let mut out = Material {
            name: m.name.clone().unwrap_or_default(),
            base_color: Vec4::from(pbr.base_color_factor.0),
            base_color_texture: self.read_optional_texture(
                pbr.base_color_texture.as_ref().map(|t| texture_use("baseColorTexture", t)),
            )?,
            metallic: pbr.metallic_factor.0.clamp(0.0, 1.0),
            roughness: pbr.roughness_factor.0.clamp(0.0, 1.0),
            metallic_roughness_texture: self.read_optional_texture(
                pbr.metallic_roughness_texture.as_ref().map(|t| texture_use("metallicRoughnessTexture", t)),
            )?,
            emissive: Vec3::from(m.emissive_factor.0),
            emissive_texture: self.read_optional_texture(
                m.emissive_texture.as_ref().map(|t| texture_use("emissiveTexture", t)),
            )?,
            double_sided: m.double_sided,
            ..Material::default()
        };
        if let Some(t) = &m.normal_texture {
            let transform = untyped_transform(t.extensions.as_ref().map(|e| &e.others));
            out.normal_scale = t.scale;
            out.normal_texture = self.read_texture(TextureUse {
                slot: "normalTexture",
                texture: t.index.value(),
                uv_set: t.tex_coord,
                transform: transform.as_ref(),
            })?;
        }
        if let Some(t) = &m.occlusion_texture {
            let transform = untyped_transform(t.extensions.as_ref().map(|e| &e.others));
            out.occlusion_strength = t.strength.0.clamp(0.0, 1.0);
            out.occlusion_texture = self.read_texture(TextureUse {
                slot: "occlusionTexture",
                texture: t.index.value(),
                uv_set: t.tex_coord,
                transform: transform.as_ref(),
            })?;
        }
        out.alpha_mode = match m.alpha_mode {
            Checked::Valid(json::material::AlphaMode::Opaque) => AlphaMode::Opaque,
            Checked::Valid(json::material::AlphaMode::Mask) => {
                AlphaMode::Mask(m.alpha_cutoff.map_or(0.5, |c| c.0))
            }
            Checked::Valid(json::material::AlphaMode::Blend) => AlphaMode::Blend,
            Checked::Invalid => {
                self.file.warn(self.place, "has an unknown alphaMode; OPAQUE is used");
                AlphaMode::Opaque
            }
        };
        if let Some(extensions) = &m.extensions {
            self.read_extensions(extensions, &mut out)?;
        }
        Ok(out)
    }

    fn read_extensions(
        &mut self,
        e: &json::extensions::material::Material,
        out: &mut Material,
    ) -> Result<()> {
        if let Some(s) = &e.specular {
            out.specular = s.specular_factor.0.clamp(0.0, 1.0);
            out.specular_color = Vec3::from(s.specular_color_factor.0).max(Vec3::ZERO);
            out.specular_texture = self.read_optional_texture(
                s.specular_texture.as_ref().map(|t| texture_use("specularTexture", t)),
            )?;
            out.specular_color_texture = self.read_optional_texture(
                s.specular_color_texture.as_ref().map(|t| texture_use("specularColorTexture", t)),
            )?;
        }
        if let Some(s) = &e.pbr_specular_glossiness {
            // The reflectance is exact: F0 = 0.04 · specular_color, and the dielectric's F0 is specularFactor. Glossiness that
            // varies over the texture becomes a roughness texture, once the image is decoded.
            out.metallic = 0.0;
            out.metallic_roughness_texture = None;
            out.roughness = (1.0 - s.glossiness_factor.0).clamp(0.0, 1.0);
            out.base_color = Vec4::from(s.diffuse_factor.0);
            out.base_color_texture = self.read_optional_texture(
                s.diffuse_texture.as_ref().map(|t| texture_use("diffuseTexture", t)),
            )?;
            out.specular = 1.0;
            out.specular_color = Vec3::from(s.specular_factor.0).max(Vec3::ZERO) / DIELECTRIC_F0;
            out.specular_color_texture = self.read_optional_texture(
                s.specular_glossiness_texture.as_ref().map(|t| texture_use("specularGlossinessTexture", t)),
            )?;
            self.glossy = Some(s.glossiness_factor.0);
        }
        if let Some(s) = &e.emissive_strength {
            out.emissive *= s.emissive_strength.0.max(0.0);
        }
        if e.unlit.is_some() {
            out.shading = Shading::Unlit;
        }
        // Specular-glossiness materials have no layers.
        if e.pbr_specular_glossiness.is_none() {
            layers::read(self, &e.others, out)?;
        }
        Ok(())
    }

    fn read_optional_texture(&mut self, texture: Option<TextureUse<'_>>) -> Result<Option<TextureRef>> {
        texture.map_or(Ok(None), |t| self.read_texture(t))
    }

    pub(crate) fn place(&self) -> &str {
        self.place
    }

    pub(crate) fn read_texture(&mut self, usage: TextureUse<'_>) -> Result<Option<TextureRef>> {
        if !self.wants_textures {
            return Ok(None);
        }
        let file = self.file;
        let place = format!("{}.{}", self.place, usage.slot);
        let texture = element(&file.root.textures, usage.texture, "textures", || place.clone())?;
        let uv_set = usage.transform.and_then(|t| t.tex_coord).unwrap_or(usage.uv_set);
        let Ok(uv_set @ 0..=1) = u8::try_from(uv_set) else {
            file.warn(
                place,
                format!(
                    "uses TEXCOORD_{uv_set}; only sets 0 and 1 are supported, so this texture is left out"
                ),
            );
            return Ok(None);
        };
        let extension = |name: &str| {
            let extension = texture.extensions.as_ref()?.others.get(name)?;
            extension.get("source").and_then(as_integer)
        };
        let source = match (texture.source.value(), extension("EXT_texture_webp")) {
            (_, Some(webp)) => webp as usize,
            // The maximum is the typed form's mark for "no source". An image in another format is preferred to KTX2, as it is as
            // good or better.
            (source, None) if source == u32::MAX as usize => match extension("KHR_texture_basisu") {
                Some(basis) => basis as usize,
                None => {
                    file.warn(
                        place,
                        format!(
                            "textures[{}] has no image of a supported kind; it is left out",
                            usage.texture
                        ),
                    );
                    return Ok(None);
                }
            },
            (source, None) => source,
        };
        let sampler = match texture.sampler {
            Some(index) => {
                let user = || format!("textures[{}].sampler", usage.texture);
                read_sampler(element(&file.root.samplers, index.value(), "samplers", user)?)
            }
            None => Sampler::default(),
        };
        let user = format!("textures[{}].source", usage.texture);
        let Some(image) = self.images.index_of(file, source, &user)? else { return Ok(None) };
        let uv_transform = usage.transform.map_or(Affine2::IDENTITY, uv_transform);
        if !uv_transform.is_finite() {
            return Err(Problem::new(place, "has a KHR_texture_transform that is not finite"));
        }
        Ok(Some(TextureRef { image, sampler, uv_set, uv_transform }))
    }
}

/// The KHR_texture_transform of normal and occlusion textures, whose extensions the crate leaves untyped.
fn untyped_transform(
    others: Option<&serde_json::Map<String, serde_json::Value>>,
) -> Option<TextureTransform> {
    repair::typed(others?.get("KHR_texture_transform")?).ok()
}

/// KHR_texture_transform: offset · rotation · scale. A counter-clockwise rotation turns +u towards −v, because v points down.
fn uv_transform(t: &TextureTransform) -> Affine2 {
    let (sin, cos) = (libm::sinf(t.rotation.0), libm::cosf(t.rotation.0));
    let rotation = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
    let scale = Vec2::from(t.scale.0);
    let matrix = Mat2::from_cols(rotation.x_axis * scale.x, rotation.y_axis * scale.y);
    Affine2 { matrix2: matrix, translation: Vec2::from(t.offset.0) }
}

fn read_sampler(s: &json::texture::Sampler) -> Sampler {
    let wrap = |w: Checked<WrappingMode>| match w {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::ClampToEdge,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::MirroredRepeat,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    };
    let (min_linear, mip_linear) = match s.min_filter {
        Some(Checked::Valid(MinFilter::Nearest)) => (false, None),
        Some(Checked::Valid(MinFilter::Linear)) => (true, None),
        Some(Checked::Valid(MinFilter::NearestMipmapNearest)) => (false, Some(false)),
        Some(Checked::Valid(MinFilter::LinearMipmapNearest)) => (true, Some(false)),
        Some(Checked::Valid(MinFilter::NearestMipmapLinear)) => (false, Some(true)),
        Some(Checked::Valid(MinFilter::LinearMipmapLinear)) | Some(Checked::Invalid) | None => {
            (true, Some(true))
        }
    };
    Sampler {
        wrap_u: wrap(s.wrap_s),
        wrap_v: wrap(s.wrap_t),
        mag_linear: !matches!(s.mag_filter, Some(Checked::Valid(MagFilter::Nearest))),
        min_linear,
        mip_linear,
    }
}

fn all_finite(m: &Material) -> bool {
    let cutoff = if let AlphaMode::Mask(c) = m.alpha_mode { c } else { 0.0 };
    m.base_color.is_finite()
        && m.emissive.is_finite()
        && m.specular_color.is_finite()
        && [m.metallic, m.roughness, m.normal_scale, m.occlusion_strength, m.specular, cutoff]
            .iter()
            .all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uv_rotation_is_counterclockwise() {
        let t = TextureTransform {
            rotation: json::extensions::texture::TextureTransformRotation(std::f32::consts::FRAC_PI_2),
            offset: json::extensions::texture::TextureTransformOffset([0.25, 0.5]),
            scale: json::extensions::texture::TextureTransformScale([2.0, 3.0]),
            ..Default::default()
        };
        let m = uv_transform(&t);
        let close = |a: Vec2, b: Vec2| assert!((a - b).length() < 1e-6, "{a} {b}");
        close(m.transform_point2(Vec2::ZERO), Vec2::new(0.25, 0.5));
        close(m.transform_point2(Vec2::X), Vec2::new(0.25, -1.5));
        close(m.transform_point2(Vec2::Y), Vec2::new(3.25, 0.5));
    }
}
