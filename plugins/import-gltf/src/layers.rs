//! Material layers: clearcoat, sheen, transmission, volume, index of refraction, iridescence, anisotropy and diffuse transmission
//! (KHR_materials_clearcoat, _sheen, _transmission, _volume, _ior, _iridescence, _anisotropy, _diffuse_transmission).

use crate::materials::{Reader, TextureUse};
use crate::problem::{Problem, Result};
use crate::repair::{self, as_integer};
use choreo_asset::{Material, MaterialLayers, Shading, TextureRef};
use glam::Vec3;
use serde_json::{Map, Value};

/// Reflectance of glass (index 1.5) at normal incidence: the unit of `specular_color`.
const F0_OF_GLASS: f32 = 0.04;

/// One material extension while it is read.
struct Extension<'r, 'v, 'a, 'b, 'f> {
    reader: &'r mut Reader<'a, 'b, 'f>,
    name: &'static str,
    value: &'v Value,
}

impl Extension<'_, '_, '_, '_, '_> {
    fn problem(&self, key: &str, what: impl Into<String>) -> Problem {
        Problem::new(format!("{}.extensions.{}.{key}", self.reader.place(), self.name), what)
    }

    /// A finite number; `None` where the member is absent, an error where it is no finite number.
    fn read_finite(&self, key: &str) -> Result<Option<f32>> {
        let Some(value) = self.value.get(key) else { return Ok(None) };
        let number = value.as_f64().map(|v| v as f32).filter(|v| v.is_finite());
        number.map(Some).ok_or_else(|| self.problem(key, format!("is {value}; a number is needed")))
    }

    /// A number clamped to the range from 0 to `max`.
    fn read_number(&self, key: &str, default: f32, max: f32) -> Result<f32> {
        Ok(self.read_finite(key)?.map_or(default, |v| v.clamp(0.0, max)))
    }

    /// An angle in radians, reduced to less than a full turn.
    fn read_angle(&self, key: &str) -> Result<f32> {
        Ok(self.read_finite(key)?.unwrap_or(0.0) % std::f32::consts::TAU)
    }

    fn read_color(&self, key: &str, default: Vec3) -> Result<Vec3> {
        let Some(value) = self.value.get(key) else { return Ok(default) };
        let numbers: Option<Vec<f32>> =
            value.as_array().and_then(|list| list.iter().map(|v| v.as_f64().map(|v| v as f32)).collect());
        match numbers.as_deref() {
            Some(&[r, g, b]) if Vec3::new(r, g, b).is_finite() => Ok(Vec3::new(r, g, b).max(Vec3::ZERO)),
            _ => Err(self.problem(key, "is not a color; three numbers are needed")),
        }
    }

    fn read_texture(&mut self, key: &'static str) -> Result<Option<TextureRef>> {
        let Some(info) = self.value.get(key) else { return Ok(None) };
        let number = |key: &str| info.get(key).and_then(as_integer);
        let Some(texture) = number("index").and_then(|n| usize::try_from(n).ok()) else {
            return Err(self.problem(key, "has no index of a texture"));
        };
        let transform = info.get("extensions").and_then(|e| e.get("KHR_texture_transform"));
        let transform = transform.and_then(|t| repair::typed(t).ok());
        let uv_set = number("texCoord").map_or(0, |n| u32::try_from(n).unwrap_or(u32::MAX));
        self.reader.read_texture(TextureUse { slot: key, texture, uv_set, transform: transform.as_ref() })
    }
}

/// Reads the layers of a metallic-roughness material; other materials have none.
pub(crate) fn read(
    reader: &mut Reader<'_, '_, '_>,
    others: &Map<String, Value>,
    out: &mut Material,
) -> Result<()> {
    if out.shading != Shading::MetallicRoughness {
        return Ok(());
    }
    let mut layers = MaterialLayers::default();
    if let Some(ior) = find_extension(reader, others, "KHR_materials_ior") {
        let ior = ior.read_number("ior", 1.5, 1e3)?;
        layers.ior = ior;
        // F0 = ((n − 1) / (n + 1))²; an index of 0 means that everything is reflected (KHR_materials_ior, "Extending Materials").
        let f0 = if ior == 0.0 { 1.0 } else { ((ior - 1.0) / (ior + 1.0)) * ((ior - 1.0) / (ior + 1.0)) };
        out.specular_color *= f0 / F0_OF_GLASS;
    }
    let mut any = false;
    if let Some(mut coat) = find_extension(reader, others, "KHR_materials_clearcoat") {
        any = true;
        layers.clearcoat = coat.read_number("clearcoatFactor", 0.0, 1.0)?;
        layers.clearcoat_roughness = coat.read_number("clearcoatRoughnessFactor", 0.0, 1.0)?;
        layers.clearcoat_texture = coat.read_texture("clearcoatTexture")?;
        layers.clearcoat_roughness_texture = coat.read_texture("clearcoatRoughnessTexture")?;
        layers.clearcoat_normal_texture = coat.read_texture("clearcoatNormalTexture")?;
        if let Some(scale) = coat.value.get("clearcoatNormalTexture").and_then(|t| t.get("scale")?.as_f64()) {
            layers.clearcoat_normal_scale = scale as f32;
        }
    }
    if let Some(mut sheen) = find_extension(reader, others, "KHR_materials_sheen") {
        any = true;
        layers.sheen_color = sheen.read_color("sheenColorFactor", Vec3::ZERO)?.min(Vec3::ONE);
        layers.sheen_roughness = sheen.read_number("sheenRoughnessFactor", 0.0, 1.0)?;
        layers.sheen_color_texture = sheen.read_texture("sheenColorTexture")?;
        layers.sheen_roughness_texture = sheen.read_texture("sheenRoughnessTexture")?;
    }
    if let Some(mut transmission) = find_extension(reader, others, "KHR_materials_transmission") {
        any = true;
        layers.transmission = transmission.read_number("transmissionFactor", 0.0, 1.0)?;
        layers.transmission_texture = transmission.read_texture("transmissionTexture")?;
    }
    if let Some(mut volume) = find_extension(reader, others, "KHR_materials_volume") {
        any = true;
        layers.thickness = volume.read_number("thicknessFactor", 0.0, 1e6)?;
        layers.thickness_texture = volume.read_texture("thicknessTexture")?;
        let far = volume.read_number("attenuationDistance", f32::MAX, f32::MAX)?;
        layers.attenuation_distance = if far > 0.0 && far < f32::MAX { far } else { f32::INFINITY };
        layers.attenuation_color = volume.read_color("attenuationColor", Vec3::ONE)?.min(Vec3::ONE);
    }
    if let Some(dispersion) = find_extension(reader, others, "KHR_materials_dispersion") {
        layers.dispersion = dispersion.read_number("dispersion", 0.0, 1e3)?;
    }
    any |= read_thin_layers(reader, others, &mut layers)?;
    if !layers.clearcoat_normal_scale.is_finite() || !out.specular_color.is_finite() {
        return Err(Problem::new(reader.place(), "has a factor that is not finite"));
    }
    if any {
        out.layers = Some(Box::new(layers));
    }
    Ok(())
}

/// Reads iridescence, anisotropy and diffuse transmission. True where the material has any of them.
fn read_thin_layers(
    reader: &mut Reader<'_, '_, '_>,
    others: &Map<String, Value>,
    layers: &mut MaterialLayers,
) -> Result<bool> {
    let mut any = false;
    if let Some(mut film) = find_extension(reader, others, "KHR_materials_iridescence") {
        any = true;
        layers.iridescence = film.read_number("iridescenceFactor", 0.0, 1.0)?;
        layers.iridescence_texture = film.read_texture("iridescenceTexture")?;
        layers.iridescence_ior = film.read_number("iridescenceIor", 1.3, 10.0)?.max(1.0);
        layers.iridescence_thickness = [
            film.read_number("iridescenceThicknessMinimum", 100.0, 1e5)?,
            film.read_number("iridescenceThicknessMaximum", 400.0, 1e5)?,
        ];
        layers.iridescence_thickness_texture = film.read_texture("iridescenceThicknessTexture")?;
    }
    if let Some(mut brushed) = find_extension(reader, others, "KHR_materials_anisotropy") {
        any = true;
        layers.anisotropy = brushed.read_number("anisotropyStrength", 0.0, 1.0)?;
        layers.anisotropy_rotation = brushed.read_angle("anisotropyRotation")?;
        layers.anisotropy_texture = brushed.read_texture("anisotropyTexture")?;
    }
    if let Some(mut leaf) = find_extension(reader, others, "KHR_materials_diffuse_transmission") {
        any = true;
        layers.diffuse_transmission = leaf.read_number("diffuseTransmissionFactor", 0.0, 1.0)?;
        layers.diffuse_transmission_texture = leaf.read_texture("diffuseTransmissionTexture")?;
        layers.diffuse_transmission_color = leaf.read_color("diffuseTransmissionColorFactor", Vec3::ONE)?;
        layers.diffuse_transmission_color_texture = leaf.read_texture("diffuseTransmissionColorTexture")?;
    }
    Ok(any)
}

fn find_extension<'r, 'v, 'a, 'b, 'f>(
    reader: &'r mut Reader<'a, 'b, 'f>,
    others: &'v Map<String, Value>,
    name: &'static str,
) -> Option<Extension<'r, 'v, 'a, 'b, 'f>> {
    Some(Extension { value: others.get(name)?, reader, name })
}
