//! Materials, with the extensions that choreo also imports (glTF 2.0, §3.9; KHR_materials_*).

use crate::document::Index;
use crate::textures::Textures;
use choreo_exporter_kit::losses::{self, Losses};
use choreo_plugin::asset::{AlphaMode, Asset, Material, MaterialLayers, Shading, TextureRef};
use choreo_plugin::glam::{Vec3, Vec4};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Reflectance of glass (index 1.5) at normal incidence: the unit of specular colors.
const F0_OF_GLASS: f32 = 0.04;

#[derive(Default)]
pub(crate) struct Materials {
    pub list: Vec<Value>,
    /// Extensions in use.
    pub extensions: BTreeSet<&'static str>,
    /// Material features that glTF cannot express.
    pub losses: Losses,
    index_of_json: BTreeMap<String, Index>,
}

impl Materials {
    /// The index of a material. Equal materials share one, unless `own`: the material is animated. `uvs`: the texture coordinate
    /// sets of its primitives; textures that need another set are left out.
    pub(crate) fn add(
        &mut self,
        textures: &mut Textures,
        asset: &Asset,
        material: &Material,
        (own, uvs): (bool, [bool; 2]),
    ) -> Index {
        textures.animated = own;
        let losses = &mut self.losses;
        let mut writer = Writer { textures, asset, uvs, extensions: Map::new(), losses };
        let value = writer.material(material);
        for name in USED.iter().filter(|name| value["extensions"].get(**name).is_some()) {
            self.extensions.insert(name);
        }
        let text = value.to_string();
        if let Some(known) = self.index_of_json.get(&text).filter(|_| !own) {
            return *known;
        }
        let index = self.list.len() as Index;
        self.list.push(value);
        if !own {
            self.index_of_json.insert(text, index);
        }
        index
    }
}

const USED: [&str; 12] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
];

struct Writer<'w> {
    textures: &'w mut Textures,
    asset: &'w Asset,
    uvs: [bool; 2],
    extensions: Map<String, Value>,
    losses: &'w mut Losses,
}

/// A JSON object without members that have their default values.
#[derive(Default)]
struct Object(Map<String, Value>);

impl Object {
    fn number(&mut self, name: &str, value: f32, default: f32) {
        if value != default {
            self.0.insert(name.into(), value.into());
        }
    }

    fn color(&mut self, name: &str, value: Vec3, default: Vec3) {
        if value != default {
            self.0.insert(name.into(), json!(value.to_array()));
        }
    }

    fn insert_some(&mut self, name: &str, value: Option<Map<String, Value>>) {
        if let Some(value) = value {
            self.0.insert(name.into(), value.into());
        }
    }
}

impl Writer<'_> {
    fn info(&mut self, texture: &Option<TextureRef>) -> Option<Map<String, Value>> {
        let readable = |t: &&TextureRef| self.uvs.get(usize::from(t.uv_set)).is_some_and(|has| *has);
        let texture = texture.as_ref().filter(readable)?;
        self.textures.info(self.asset, texture)
    }

    /// A textureInfo with a further number, which is left out where it is 1.
    fn scaled(&mut self, texture: &Option<TextureRef>, name: &str, value: f32) -> Option<Map<String, Value>> {
        let mut info = self.info(texture)?;
        if value != 1.0 {
            info.insert(name.into(), value.into());
        }
        Some(info)
    }

    fn material(&mut self, m: &Material) -> Value {
        let mut out = Object::default();
        out.0.insert("name".into(), m.name.clone().into());
        let pbr = self.metallic_roughness(m);
        out.0.insert("pbrMetallicRoughness".into(), pbr.0.into());
        out.insert_some("normalTexture", self.scaled(&m.normal_texture, "scale", m.normal_scale));
        out.insert_some(
            "occlusionTexture",
            self.scaled(&m.occlusion_texture, "strength", m.occlusion_strength.clamp(0.0, 1.0)),
        );
        let emissive = m.emissive.max(Vec3::ZERO);
        let strength = emissive.max_element().max(1.0);
        out.color("emissiveFactor", emissive / strength, Vec3::ZERO);
        out.insert_some("emissiveTexture", self.info(&m.emissive_texture));
        if strength > 1.0 {
            let value = json!({ "emissiveStrength": strength });
            self.extensions.insert("KHR_materials_emissive_strength".into(), value);
        }
        match m.alpha_mode {
            AlphaMode::Opaque => {}
            AlphaMode::Mask(cutoff) => {
                out.0.insert("alphaMode".into(), "MASK".into());
                out.number("alphaCutoff", cutoff, 0.5);
            }
            AlphaMode::Blend => _ = out.0.insert("alphaMode".into(), "BLEND".into()),
        }
        if m.double_sided {
            out.0.insert("doubleSided".into(), true.into());
        }
        self.shading(m);
        self.note_losses(m);
        let extensions = std::mem::take(&mut self.extensions);
        if !extensions.is_empty() {
            out.0.insert("extensions".into(), extensions.into());
        }
        out.0.into()
    }

    fn metallic_roughness(&mut self, m: &Material) -> Object {
        let mut pbr = Object::default();
        let color = m.base_color.clamp(Vec4::ZERO, Vec4::ONE);
        if color != Vec4::ONE {
            pbr.0.insert("baseColorFactor".into(), json!(color.to_array()));
        }
        pbr.insert_some("baseColorTexture", self.info(&m.base_color_texture));
        let (metallic, roughness) = match m.shading {
            Shading::MetallicRoughness => (m.metallic, m.roughness),
            Shading::BlinnPhong | Shading::Phong => (0.0, m.mirror_roughness()),
            Shading::Unlit | Shading::Toon => (0.0, 0.9),
        };
        pbr.number("metallicFactor", metallic.clamp(0.0, 1.0), 1.0);
        pbr.number("roughnessFactor", roughness.clamp(0.0, 1.0), 1.0);
        if m.shading == Shading::MetallicRoughness {
            pbr.insert_some("metallicRoughnessTexture", self.info(&m.metallic_roughness_texture));
        }
        pbr
    }

    fn shading(&mut self, m: &Material) {
        match m.shading {
            Shading::MetallicRoughness => {
                let layers = m.layers.as_deref();
                let ior = layers.map_or(1.5, |l| l.ior);
                // The asset's specular color is relative to glass, the file's to the index of refraction.
                let root = (ior - 1.0) / (ior + 1.0);
                let f0 = if ior == 0.0 { 1.0 } else { root * root };
                let unit = if f0 > 0.0 { f0 / F0_OF_GLASS } else { 1.0 };
                let color = if f0 > 0.0 && ior != 1.5 { m.specular_color / unit } else { m.specular_color };
                // A difference from white by rounding only is no color.
                let white = (color - Vec3::ONE).abs().max_element() < 1e-6 || f0 == 0.0;
                self.specular(m, m.specular, if white { Vec3::ONE } else { color });
                if ior != 1.5 {
                    self.extensions.insert("KHR_materials_ior".into(), json!({ "ior": ior }));
                }
                if let Some(layers) = layers {
                    self.layers(layers);
                }
            }
            Shading::BlinnPhong | Shading::Phong => {
                self.losses.insert("Phong highlights (written as roughness)");
                // A Phong highlight's color is no reflectance; a tinted plastic comes nearest.
                self.specular(m, 1.0, m.specular_color);
            }
            Shading::Unlit | Shading::Toon => {
                if m.shading == Shading::Toon {
                    self.losses.insert("toon shading (written as unlit)");
                }
                self.extensions.insert("KHR_materials_unlit".into(), json!({}));
            }
        }
    }

    fn specular(&mut self, m: &Material, factor: f32, color: Vec3) {
        let mut specular = Object::default();
        specular.number("specularFactor", factor.clamp(0.0, 1.0), 1.0);
        specular.color("specularColorFactor", color.max(Vec3::ZERO), Vec3::ONE);
        specular.insert_some("specularTexture", self.info(&m.specular_texture));
        specular.insert_some("specularColorTexture", self.info(&m.specular_color_texture));
        self.extend("KHR_materials_specular", specular);
    }

    /// Adds an extension, unless it is empty.
    fn extend(&mut self, name: &str, object: Object) {
        if !object.0.is_empty() {
            self.extensions.insert(name.into(), object.0.into());
        }
    }

    fn layers(&mut self, l: &MaterialLayers) {
        let mut coat = Object::default();
        if l.clearcoat > 0.0 {
            coat.number("clearcoatFactor", l.clearcoat, 0.0);
            coat.number("clearcoatRoughnessFactor", l.clearcoat_roughness, 0.0);
            coat.insert_some("clearcoatTexture", self.info(&l.clearcoat_texture));
            coat.insert_some("clearcoatRoughnessTexture", self.info(&l.clearcoat_roughness_texture));
            let normal = self.scaled(&l.clearcoat_normal_texture, "scale", l.clearcoat_normal_scale);
            coat.insert_some("clearcoatNormalTexture", normal);
        }
        self.extend("KHR_materials_clearcoat", coat);
        let mut sheen = Object::default();
        if l.sheen_color != Vec3::ZERO {
            sheen.color("sheenColorFactor", l.sheen_color, Vec3::ZERO);
            sheen.number("sheenRoughnessFactor", l.sheen_roughness, 0.0);
            sheen.insert_some("sheenColorTexture", self.info(&l.sheen_color_texture));
            sheen.insert_some("sheenRoughnessTexture", self.info(&l.sheen_roughness_texture));
        }
        self.extend("KHR_materials_sheen", sheen);
        let mut transmission = Object::default();
        transmission.number("transmissionFactor", l.transmission, 0.0);
        if l.transmission > 0.0 {
            transmission.insert_some("transmissionTexture", self.info(&l.transmission_texture));
        }
        self.extend("KHR_materials_transmission", transmission);
        self.volume(l);
        self.iridescence_anisotropy_translucency(l);
    }

    fn volume(&mut self, l: &MaterialLayers) {
        // A volume has an effect only where the surface transmits light.
        if l.transmission <= 0.0 && l.diffuse_transmission <= 0.0 {
            return;
        }
        let mut volume = Object::default();
        if l.thickness > 0.0 {
            volume.number("thicknessFactor", l.thickness, 0.0);
            volume.insert_some("thicknessTexture", self.info(&l.thickness_texture));
            if l.attenuation_distance > 0.0 && l.attenuation_distance.is_finite() {
                volume.number("attenuationDistance", l.attenuation_distance, f32::INFINITY);
                volume.color("attenuationColor", l.attenuation_color.clamp(Vec3::ZERO, Vec3::ONE), Vec3::ONE);
            }
        }
        let is_thick = !volume.0.is_empty();
        self.extend("KHR_materials_volume", volume);
        let mut dispersion = Object::default();
        dispersion.number("dispersion", if is_thick { l.dispersion } else { 0.0 }, 0.0);
        self.extend("KHR_materials_dispersion", dispersion);
    }

    /// Writes iridescence, anisotropy and diffuse transmission.
    fn iridescence_anisotropy_translucency(&mut self, l: &MaterialLayers) {
        let mut film = Object::default();
        if l.iridescence > 0.0 {
            let [least, most] = l.iridescence_thickness;
            film.number("iridescenceFactor", l.iridescence, 0.0);
            film.number("iridescenceIor", l.iridescence_ior, 1.3);
            film.number("iridescenceThicknessMaximum", most, 400.0);
            film.insert_some("iridescenceTexture", self.info(&l.iridescence_texture));
            let thickness = self.info(&l.iridescence_thickness_texture);
            if thickness.is_some() {
                film.number("iridescenceThicknessMinimum", least, 100.0);
            }
            film.insert_some("iridescenceThicknessTexture", thickness);
        }
        self.extend("KHR_materials_iridescence", film);
        let mut brushed = Object::default();
        if l.anisotropy != 0.0 {
            brushed.number("anisotropyStrength", l.anisotropy, 0.0);
            brushed.number("anisotropyRotation", l.anisotropy_rotation, 0.0);
            brushed.insert_some("anisotropyTexture", self.info(&l.anisotropy_texture));
        }
        self.extend("KHR_materials_anisotropy", brushed);
        let mut leaf = Object::default();
        if l.diffuse_transmission > 0.0 {
            leaf.number("diffuseTransmissionFactor", l.diffuse_transmission, 0.0);
            leaf.insert_some("diffuseTransmissionTexture", self.info(&l.diffuse_transmission_texture));
            leaf.color("diffuseTransmissionColorFactor", l.diffuse_transmission_color, Vec3::ONE);
            let color = self.info(&l.diffuse_transmission_color_texture);
            leaf.insert_some("diffuseTransmissionColorTexture", color);
        }
        self.extend("KHR_materials_diffuse_transmission", leaf);
    }

    fn note_losses(&mut self, m: &Material) {
        losses::of_material(m, self.losses);
        let lost = m.shading != Shading::MetallicRoughness && m.layers.is_some();
        losses::add(&[(lost, "layers of materials")], self.losses);
    }
}
