//! Materials: Phong and Lambert become Blinn–Phong; the physical ones of 3ds Max, Arnold, Stingray and Blender become
//! metallic-roughness.

use crate::alpha::Alpha;
use crate::file::{File, place_of};
use crate::textures::{Channel, ChannelSource, ImageTable};
use choreo_asset::{AlphaMode, Material, Shading, TextureRef};
use choreo_importer_kit::Result;
use glam::{Vec3, Vec4};
use ufbx::{MaterialMap, ShaderType, Texture};

/// Reflectance of a dielectric of index 1.5 at normal incidence, the unit of `Material::specular_color`.
const DIELECTRIC_F0: f32 = 0.04;

/// A material, and the data to finish it with when its images are decoded.
pub(crate) struct MaterialDraft {
    pub material: Material,
    /// Names of further texture coordinate sets that its textures use.
    pub uv_names: Vec<String>,
    pub alpha: Alpha,
}

pub(crate) fn read(file: &File<'_>, table: &mut ImageTable) -> Result<Vec<MaterialDraft>> {
    let scene = file.scene;
    file.charge(scene.materials.len(), size_of::<MaterialDraft>() + 64, || "materials".into())?;
    // The first mesh with the material determines which set a name means.
    let mut mesh_of = vec![None; scene.materials.len()];
    for mesh in &scene.meshes {
        for material in &mesh.materials {
            if let Some(slot) = mesh_of.get_mut(material.element.typed_id as usize) {
                slot.get_or_insert(mesh);
            }
        }
    }
    let mut out = Vec::with_capacity(scene.materials.len());
    for (material, mesh) in scene.materials.as_ref().iter().zip(mesh_of) {
        let place = place_of(&material.element);
        let mut reader = Reader { file, table, place: &place, mesh, uv_names: Vec::new() };
        let (mut own, alpha) = match material.shader_type {
            ShaderType::FbxLambert
            | ShaderType::FbxPhong
            | ShaderType::Unknown
            | ShaderType::WavefrontMtl => reader.read_phong(material)?,
            _ => reader.read_physical(material)?,
        };
        own.name = material.element.name.to_string();
        let double_sided = &material.features.double_sided;
        // FBX's own materials are drawn double-sided by default.
        own.double_sided = !double_sided.is_explicit || double_sided.enabled;
        if material.features.unlit.enabled {
            own.shading = Shading::Unlit;
        }
        repair(file, &mut own, &place);
        out.push(MaterialDraft { material: own, uv_names: reader.uv_names, alpha });
    }
    Ok(out)
}

struct Reader<'a, 'f> {
    file: &'a File<'f>,
    table: &'a mut ImageTable,
    place: &'a str,
    mesh: Option<&'a ufbx::Mesh>,
    uv_names: Vec<String>,
}

fn map_number(map: &MaterialMap, default: f32) -> f32 {
    if map.has_value { map.value_vec4.x as f32 } else { default }
}

fn map_color(map: &MaterialMap, default: Vec3) -> Vec3 {
    let v = &map.value_vec4;
    if map.has_value { Vec3::new(v.x as f32, v.y as f32, v.z as f32) } else { default }
}

fn map_texture(map: &MaterialMap) -> Option<&Texture> {
    map.texture.as_ref().filter(|_| map.texture_enabled).map(|t| t.as_ref())
}

impl Reader<'_, '_> {
    /// Color and texture of a map. A connected texture replaces the color; the factor still applies.
    fn read_color(
        &mut self,
        map: &MaterialMap,
        factor: f32,
        default: Vec3,
    ) -> Result<(Vec3, Option<TextureRef>)> {
        let found = self.read_texture(map_texture(map))?;
        let own = if found.is_some() { Vec3::ONE } else { map_color(map, default) };
        Ok((own * factor, found))
    }

    fn read_texture(&mut self, texture: Option<&Texture>) -> Result<Option<TextureRef>> {
        let Some(texture) = texture else { return Ok(None) };
        let slot = self.uv_slot(texture);
        self.table.texture_ref(self.file, texture, slot)
    }

    /// Texture coordinate slot: 0 for the mesh's first set, 1 for any other.
    fn uv_slot(&mut self, texture: &Texture) -> u8 {
        let name = texture.uv_set.as_ref();
        let set = self.mesh.and_then(|m| m.uv_sets.as_ref().iter().position(|s| s.name.as_ref() == name));
        match set {
            Some(set) if set > 0 => {
                self.uv_names.push(name.to_string());
                1
            }
            _ => 0,
        }
    }

    /// Reads FBX's own shading models, Phong and Lambert.
    fn read_phong(&mut self, m: &ufbx::Material) -> Result<(Material, Alpha)> {
        let fbx = &m.fbx;
        let (diffuse, base_color_texture) =
            self.read_color(&fbx.diffuse_color, map_number(&fbx.diffuse_factor, 1.0), Vec3::splat(0.8))?;
        let (emissive, emissive_texture) =
            self.read_color(&fbx.emission_color, map_number(&fbx.emission_factor, 1.0), Vec3::ZERO)?;
        let mut out = Material {
            shading: Shading::BlinnPhong,
            base_color: diffuse.extend(1.0),
            base_color_texture,
            metallic: 0.0,
            emissive,
            emissive_texture,
            specular_color: Vec3::ZERO,
            ..Material::default()
        };
        if m.shader_type != ShaderType::FbxLambert {
            let (specular, texture) =
                self.read_color(&fbx.specular_color, map_number(&fbx.specular_factor, 1.0), Vec3::ZERO)?;
            // A Phong lobe is as wide as a Blinn lobe of four times the exponent. Our lobe is normalized and FBX's is not; the
            // factor keeps the brightness of the highlight's center.
            out.shininess = (4.0 * map_number(&fbx.specular_exponent, 20.0)).clamp(1.0, 4096.0);
            out.specular_color = specular * (8.0 / (out.shininess + 8.0));
            out.specular_color_texture = texture;
        }
        out.normal_texture = self.read_normal_map(map_texture(&fbx.normal_map), map_texture(&fbx.bump))?;
        let map = map_texture(&fbx.transparency_color).or(map_texture(&fbx.transparency_factor));
        let alpha = match map {
            // The map holds transparency, not opacity.
            Some(map) => self.apply_opacity_map(map, base_texture(m), &mut out, true)?,
            None => {
                out.base_color.w = self.read_opacity(m);
                Alpha::Constant
            }
        };
        Ok((out, alpha))
    }

    /// Opacity of a material. Programs disagree on `TransparencyFactor`, so a fully transparent material is taken as opaque.
    fn read_opacity(&self, m: &ufbx::Material) -> f32 {
        let explicit = m.element.props.props.as_ref().iter().find(|p| p.name.as_ref() == "Opacity");
        if let Some(opacity) = explicit {
            return (opacity.value_vec4.x as f32).clamp(0.0, 1.0);
        }
        let seen_through = map_color(&m.fbx.transparency_color, Vec3::ONE).element_sum() / 3.0;
        let transparent = (map_number(&m.fbx.transparency_factor, 0.0) * seen_through).clamp(0.0, 1.0);
        if transparent >= 1.0 {
            self.file.notes.warn(
                self.place,
                "is fully transparent in the file, which some programs write \
                for opaque materials; it is shown opaque",
            );
            return 1.0;
        }
        1.0 - transparent
    }

    fn read_physical(&mut self, m: &ufbx::Material) -> Result<(Material, Alpha)> {
        let pbr = &m.pbr;
        let multiplies = m.shader_type == ShaderType::GltfMaterial;
        let (mut base, base_color_texture) =
            self.read_color(&pbr.base_color, map_number(&pbr.base_factor, 1.0), Vec3::splat(0.8))?;
        if multiplies {
            base = map_color(&pbr.base_color, Vec3::ONE) * map_number(&pbr.base_factor, 1.0);
        }
        let (emissive, emissive_texture) =
            self.read_color(&pbr.emission_color, map_number(&pbr.emission_factor, 1.0), Vec3::ZERO)?;
        let glossy = m.features.roughness_as_glossiness.enabled;
        let roughness = match glossy {
            true => 1.0 - map_number(&pbr.glossiness, map_number(&pbr.roughness, 0.5)),
            false => map_number(&pbr.roughness, 0.5),
        };
        let mut out = Material {
            base_color: base.extend(1.0),
            base_color_texture,
            emissive,
            emissive_texture,
            roughness,
            metallic: map_number(&pbr.metalness, 0.0),
            specular: map_number(&pbr.specular_factor, 1.0).clamp(0.0, 1.0),
            ..Material::default()
        };
        if m.shader_type == ShaderType::E3DsMaxPbrSpecGloss {
            let (specular, texture) =
                self.read_color(&pbr.specular_color, 1.0, Vec3::splat(DIELECTRIC_F0))?;
            out.specular_color = specular / DIELECTRIC_F0;
            out.specular_color_texture = texture;
        } else {
            out.specular_color = map_color(&pbr.specular_color, Vec3::ONE);
        }
        self.add_metallic_roughness(pbr, glossy, &mut out)?;
        out.normal_texture = self.read_normal_map(map_texture(&pbr.normal_map), map_texture(&m.fbx.bump))?;
        out.occlusion_texture = self.read_texture(map_texture(&pbr.ambient_occlusion))?;
        let alpha = match map_texture(&pbr.opacity) {
            Some(map) => self.apply_opacity_map(map, map_texture(&pbr.base_color), &mut out, false)?,
            None => {
                out.base_color.w = map_number(&pbr.opacity, 1.0).clamp(0.0, 1.0);
                Alpha::Constant
            }
        };
        if m.features.transmission.enabled && map_number(&pbr.transmission_factor, 0.0) > 0.0 {
            self.file.notes.warn(self.place, "has transmission, which is not drawn");
        }
        Ok((out, alpha))
    }

    /// Puts one or two images into the green (roughness) and blue (metalness) channels of one.
    fn add_metallic_roughness(
        &mut self,
        pbr: &ufbx::MaterialPbrMaps,
        glossy: bool,
        out: &mut Material,
    ) -> Result<()> {
        let rough = map_texture(if glossy && pbr.glossiness.texture.is_some() {
            &pbr.glossiness
        } else {
            &pbr.roughness
        });
        let metal = map_texture(&pbr.metalness);
        let slot = rough.or(metal).map_or(0, |t| self.uv_slot(t));
        let rough_source =
            rough.map(|t| ChannelSource { texture: t, channel: Channel::Gray, invert: glossy });
        let metal_source = metal.map(|t| ChannelSource { texture: t, channel: Channel::Gray, invert: false });
        if let Some(made) =
            self.table.combined_texture_ref(self.file, [None, rough_source, metal_source, None], slot)?
        {
            if rough.is_some() {
                out.roughness = 1.0;
            }
            if metal.is_some() {
                out.metallic = 1.0;
            }
            out.metallic_roughness_texture = Some(made);
        }
        Ok(())
    }

    /// The normal map. Many programs put normal maps into FBX's bump slot; a true height map there is left out.
    fn read_normal_map(
        &mut self,
        normal: Option<&Texture>,
        bump: Option<&Texture>,
    ) -> Result<Option<TextureRef>> {
        if normal.is_some() {
            return self.read_texture(normal);
        }
        let Some(bump) = bump else { return Ok(None) };
        let names =
            format!("{} {}", bump.element.name.as_ref(), bump.relative_filename.as_ref()).to_lowercase();
        if ["normal", "nrm", "_n.", "_nor"].iter().any(|mark| names.contains(mark)) {
            return self.read_texture(Some(bump));
        }
        self.file
            .notes
            .warn(self.place, format!("has a height map, {}, which is not drawn", place_of(&bump.element)));
        Ok(None)
    }

    /// Uses an opacity image: it already is the alpha of the base color's image, or it is combined into that.
    fn apply_opacity_map(
        &mut self,
        map: &Texture,
        base: Option<&Texture>,
        out: &mut Material,
        shows_through: bool,
    ) -> Result<Alpha> {
        let same = match (self.table.image_index(self.file, map)?, base) {
            (None, _) => return Ok(Alpha::Constant),
            (Some(map), Some(base)) => self.table.image_index(self.file, base)? == Some(map),
            (Some(_), None) => false,
        };
        if same {
            return Ok(Alpha::OfTexture);
        }
        let slot = self.uv_slot(base.unwrap_or(map));
        let of = |channel| base.map(|texture| ChannelSource { texture, channel, invert: false });
        let alpha = ChannelSource { texture: map, channel: Channel::AlphaOrGray, invert: shows_through };
        let sources = [of(Channel::Red), of(Channel::Green), of(Channel::Blue), Some(alpha)];
        if let Some(made) = self.table.combined_texture_ref(self.file, sources, slot)? {
            out.base_color_texture = Some(made);
        }
        Ok(Alpha::OfTexture)
    }
}

fn base_texture(m: &ufbx::Material) -> Option<&Texture> {
    map_texture(&m.fbx.diffuse_color)
}

/// Replaces numbers that no renderer can use.
fn repair(file: &File<'_>, m: &mut Material, place: &str) {
    let mut bad = false;
    let mut number = |v: &mut f32, low: f32, high: f32, default: f32| {
        bad |= !v.is_finite();
        *v = if v.is_finite() { v.clamp(low, high) } else { default };
    };
    number(&mut m.metallic, 0.0, 1.0, 0.0);
    number(&mut m.roughness, 0.0, 1.0, 0.5);
    number(&mut m.shininess, 1.0, 4096.0, 32.0);
    number(&mut m.specular, 0.0, 1.0, 1.0);
    for v in [&mut m.emissive, &mut m.specular_color] {
        for c in [&mut v.x, &mut v.y, &mut v.z] {
            number(c, 0.0, 1e6, 0.0);
        }
    }
    let mut base = m.base_color.to_array();
    base[..3].iter_mut().for_each(|c| number(c, 0.0, 1e3, 1.0));
    number(&mut base[3], 0.0, 1.0, 1.0);
    m.base_color = Vec4::from_array(base);
    if bad {
        file.notes.warn(place, "has a number that is not finite; a default is used");
    }
    m.alpha_mode = if m.base_color.w < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
}
