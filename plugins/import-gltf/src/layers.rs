//! Clearcoat, sheen, transmission, volume, index of refraction, thin films, brushed metal and light from behind
//! (KHR_materials_clearcoat, _sheen, _transmission, _volume, _ior, _iridescence, _anisotropy, _diffuse_transmission).

use crate::materials::{Reader, TextureUse};
use crate::problem::{Problem, Result};
use crate::repair::{self, whole};
use choreo_asset::{Material, MaterialLayers, Shading, TextureRef};
use glam::Vec3;
use serde_json::{Map, Value};

/// Reflectance at normal incidence of index 1.5, which `specular_color` is in units of.
const F0_OF_GLASS: f32 = 0.04;

/// What one extension says of a material.
struct Said<'v> {
    name: &'static str,
    value: &'v Value,
}

impl Said<'_> {
    fn place(&self, reader: &Reader<'_, '_, '_>, key: &str) -> String {
        format!("{}.extensions.{}.{key}", reader.place(), self.name)
    }

    /// Brought into the range; what is no number is an error.
    fn number(&self, reader: &Reader<'_, '_, '_>, key: &str, default: f32, max: f32) -> Result<f32> {
        let Some(value) = self.value.get(key) else { return Ok(default) };
        match value.as_f64().map(|v| v as f32).filter(|v| v.is_finite()) {
            Some(v) => Ok(v.clamp(0.0, max)),
            None => Err(Problem::new(self.place(reader, key), format!("is {value}; a number is needed"))),
        }
    }

    /// Radians, of any size.
    fn angle(&self, reader: &Reader<'_, '_, '_>, key: &str) -> Result<f32> {
        let Some(value) = self.value.get(key) else { return Ok(0.0) };
        match value.as_f64().map(|v| v as f32).filter(|v| v.is_finite()) {
            Some(v) => Ok(v % std::f32::consts::TAU),
            None => Err(Problem::new(self.place(reader, key), format!("is {value}; a number is needed"))),
        }
    }

    fn color(&self, reader: &Reader<'_, '_, '_>, key: &str, default: Vec3) -> Result<Vec3> {
        let Some(value) = self.value.get(key) else { return Ok(default) };
        let numbers: Option<Vec<f32>> =
            value.as_array().and_then(|list| list.iter().map(|v| v.as_f64().map(|v| v as f32)).collect());
        match numbers.as_deref() {
            Some(&[r, g, b]) if Vec3::new(r, g, b).is_finite() => Ok(Vec3::new(r, g, b).max(Vec3::ZERO)),
            _ => Err(Problem::new(self.place(reader, key), "is not a colour; three numbers are needed")),
        }
    }

    fn texture(&self, reader: &mut Reader<'_, '_, '_>, key: &'static str) -> Result<Option<TextureRef>> {
        let Some(info) = self.value.get(key) else { return Ok(None) };
        let number = |key: &str| info.get(key).and_then(whole);
        let Some(texture) = number("index").and_then(|n| usize::try_from(n).ok()) else {
            return Err(Problem::new(self.place(reader, key), "does not say which texture (index)"));
        };
        let transform = info.get("extensions").and_then(|e| e.get("KHR_texture_transform"));
        let transform = transform.and_then(|t| repair::typed(t).ok());
        let uv_set = number("texCoord").map_or(0, |n| u32::try_from(n).unwrap_or(u32::MAX));
        reader.texture(TextureUse { slot: key, texture, uv_set, transform: transform.as_ref() })
    }
}

/// Nothing where the material has no such extension or is not of metallic-roughness.
pub fn read(reader: &mut Reader<'_, '_, '_>, others: &Map<String, Value>, out: &mut Material) -> Result<()> {
    if out.shading != Shading::MetallicRoughness {
        return Ok(());
    }
    let said = |name: &'static str| others.get(name).map(|value| Said { name, value });
    let mut layers = MaterialLayers::default();
    if let Some(ior) = said("KHR_materials_ior") {
        let ior = ior.number(reader, "ior", 1.5, 1e3)?;
        layers.ior = ior;
        // F0 = ((n − 1) / (n + 1))²; 0 stands for "all is reflected" (KHR_materials_ior, "Extending Materials").
        let f0 = if ior == 0.0 { 1.0 } else { ((ior - 1.0) / (ior + 1.0)) * ((ior - 1.0) / (ior + 1.0)) };
        out.specular_color *= f0 / F0_OF_GLASS;
    }
    let mut any = false;
    if let Some(coat) = said("KHR_materials_clearcoat") {
        any = true;
        layers.clearcoat = coat.number(reader, "clearcoatFactor", 0.0, 1.0)?;
        layers.clearcoat_roughness = coat.number(reader, "clearcoatRoughnessFactor", 0.0, 1.0)?;
        layers.clearcoat_texture = coat.texture(reader, "clearcoatTexture")?;
        layers.clearcoat_roughness_texture = coat.texture(reader, "clearcoatRoughnessTexture")?;
        layers.clearcoat_normal_texture = coat.texture(reader, "clearcoatNormalTexture")?;
        if let Some(scale) = coat.value.get("clearcoatNormalTexture").and_then(|t| t.get("scale")?.as_f64()) {
            layers.clearcoat_normal_scale = scale as f32;
        }
    }
    if let Some(sheen) = said("KHR_materials_sheen") {
        any = true;
        layers.sheen_color = sheen.color(reader, "sheenColorFactor", Vec3::ZERO)?.min(Vec3::ONE);
        layers.sheen_roughness = sheen.number(reader, "sheenRoughnessFactor", 0.0, 1.0)?;
        layers.sheen_color_texture = sheen.texture(reader, "sheenColorTexture")?;
        layers.sheen_roughness_texture = sheen.texture(reader, "sheenRoughnessTexture")?;
    }
    if let Some(transmission) = said("KHR_materials_transmission") {
        any = true;
        layers.transmission = transmission.number(reader, "transmissionFactor", 0.0, 1.0)?;
        layers.transmission_texture = transmission.texture(reader, "transmissionTexture")?;
    }
    if let Some(volume) = said("KHR_materials_volume") {
        any = true;
        layers.thickness = volume.number(reader, "thicknessFactor", 0.0, 1e6)?;
        layers.thickness_texture = volume.texture(reader, "thicknessTexture")?;
        let far = volume.number(reader, "attenuationDistance", f32::MAX, f32::MAX)?;
        layers.attenuation_distance = if far > 0.0 && far < f32::MAX { far } else { f32::INFINITY };
        layers.attenuation_color = volume.color(reader, "attenuationColor", Vec3::ONE)?.min(Vec3::ONE);
    }
    if let Some(dispersion) = said("KHR_materials_dispersion") {
        layers.dispersion = dispersion.number(reader, "dispersion", 0.0, 1e3)?;
    }
    if let Some(film) = said("KHR_materials_iridescence") {
        any = true;
        layers.iridescence = film.number(reader, "iridescenceFactor", 0.0, 1.0)?;
        layers.iridescence_texture = film.texture(reader, "iridescenceTexture")?;
        layers.iridescence_ior = film.number(reader, "iridescenceIor", 1.3, 10.0)?.max(1.0);
        layers.iridescence_thickness = [
            film.number(reader, "iridescenceThicknessMinimum", 100.0, 1e5)?,
            film.number(reader, "iridescenceThicknessMaximum", 400.0, 1e5)?,
        ];
        layers.iridescence_thickness_texture = film.texture(reader, "iridescenceThicknessTexture")?;
    }
    if let Some(brushed) = said("KHR_materials_anisotropy") {
        any = true;
        layers.anisotropy = brushed.number(reader, "anisotropyStrength", 0.0, 1.0)?;
        layers.anisotropy_rotation = brushed.angle(reader, "anisotropyRotation")?;
        layers.anisotropy_texture = brushed.texture(reader, "anisotropyTexture")?;
    }
    if let Some(leaf) = said("KHR_materials_diffuse_transmission") {
        any = true;
        layers.diffuse_transmission = leaf.number(reader, "diffuseTransmissionFactor", 0.0, 1.0)?;
        layers.diffuse_transmission_texture = leaf.texture(reader, "diffuseTransmissionTexture")?;
        layers.diffuse_transmission_color =
            leaf.color(reader, "diffuseTransmissionColorFactor", Vec3::ONE)?;
        layers.diffuse_transmission_color_texture =
            leaf.texture(reader, "diffuseTransmissionColorTexture")?;
    }
    if !layers.clearcoat_normal_scale.is_finite() || !out.specular_color.is_finite() {
        return Err(Problem::new(reader.place(), "has a factor that is not finite"));
    }
    if any {
        out.layers = Some(Box::new(layers));
    }
    Ok(())
}
