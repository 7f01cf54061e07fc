//! UsdPreviewSurface materials (the UsdPreviewSurface specification).

use crate::layer::Prim;
use choreo_asset::{AlphaMode, Material, Sampler, TextureRef, Wrap};
use choreo_importer_kit::textures::Textures;
use choreo_importer_kit::{Budget, Notes};
use choreo_plugin::Files;
use glam::{Affine2, DVec2, DVec3, Mat2, Vec2, Vec3, Vec4};
use std::collections::BTreeMap;

/// The materials of a scene, with the texture coordinate names that each reads.
pub(crate) struct Materials<'a> {
    pub root: &'a Prim,
    pub list: Vec<Material>,
    pub textures: Textures,
    pub files: &'a dyn Files,
    pub budget: &'a Budget,
    pub notes: &'a Notes,
    info_of_path: BTreeMap<String, MaterialInfo>,
    wants_textures: bool,
}

/// A material that has been read.
#[derive(Clone, Debug, Default)]
pub(crate) struct MaterialInfo {
    pub index: Option<u32>,
    pub uvs: [String; 2],
    /// The material reads vertex colors.
    pub reads_vertex_colors: bool,
    /// The material has a texture.
    has_texture: bool,
}

/// A texture with the settings of the shader that reads it.
struct TextureInput {
    texture: TextureRef,
    channel: String,
    scale: Vec4,
    bias: Vec4,
}

impl<'a> Materials<'a> {
    pub(crate) fn new(
        root: &'a Prim,
        (files, budget, notes): (&'a dyn Files, &'a Budget, &'a Notes),
        wants_textures: bool,
    ) -> Materials<'a> {
        let (list, textures, info_of_path) = (Vec::new(), Textures::default(), BTreeMap::new());
        Materials { root, list, textures, files, budget, notes, info_of_path, wants_textures }
    }

    /// The material at a path, read on first use.
    pub(crate) fn at(&mut self, path: &str) -> MaterialInfo {
        if let Some(known) = self.info_of_path.get(path) {
            return known.clone();
        }
        let known = match self.root.at(path) {
            Some(prim) => self.read_material(prim, path),
            None => {
                self.notes.warn(path, "is bound as a material, but does not exist");
                MaterialInfo::default()
            }
        };
        self.info_of_path.insert(path.to_string(), known.clone());
        known
    }

    fn read_material(&mut self, prim: &'a Prim, path: &str) -> MaterialInfo {
        let surface = ["outputs:surface", "outputs:mtlx:surface", "outputs:surface:surface"];
        let source = surface.iter().find_map(|name| prim.connections.get(*name)?.first());
        let shader = source.and_then(|source| self.root.at(prim_path(source)));
        let Some(shader) = shader.filter(|s| s.text("info:id") == "UsdPreviewSurface") else {
            self.notes.warn(path, "has no UsdPreviewSurface; it is gray");
            let gray = Material {
                base_color: Vec4::new(0.18, 0.18, 0.18, 1.0),
                metallic: 0.0,
                roughness: 0.5,
                ..named_material(prim)
            };
            self.list.push(gray);
            return MaterialInfo { index: Some(self.list.len() as u32 - 1), ..MaterialInfo::default() };
        };
        let mut known = MaterialInfo { uvs: ["st".into(), String::new()], ..MaterialInfo::default() };
        let mut out = Material { metallic: 0.0, ..named_material(prim) };
        self.read_colors(shader, (path, &mut known), &mut out);
        self.read_reflection(shader, (path, &mut known), &mut out);
        replace_non_finite(&mut out);
        self.list.push(out);
        known.index = Some(self.list.len() as u32 - 1);
        known
    }

    fn read_colors(
        &mut self,
        shader: &'a Prim,
        (path, known): (&str, &mut MaterialInfo),
        out: &mut Material,
    ) {
        let color = |name: &str, default: f32| -> Vec3 {
            let found = shader.numbers(name).and_then(|v| v.first_chunk::<3>());
            found.map_or(Vec3::splat(default), |v| DVec3::from_array(*v).as_vec3())
        };
        out.base_color = color("inputs:diffuseColor", 0.18).extend(1.0);
        if let Some(read) = self.read_texture(shader, "inputs:diffuseColor", (path, known)) {
            out.base_color = read.scale.truncate().extend(1.0);
            out.base_color_texture = Some(read.texture);
        } else if known.reads_vertex_colors {
            out.base_color = Vec4::ONE;
        }
        out.emissive = color("inputs:emissiveColor", 0.0);
        if let Some(read) = self.read_texture(shader, "inputs:emissiveColor", (path, known)) {
            out.emissive = read.scale.truncate();
            out.emissive_texture = Some(read.texture);
        }
        let opacity = shader.number("inputs:opacity").unwrap_or(1.0) as f32;
        let threshold = shader.number("inputs:opacityThreshold").unwrap_or(0.0) as f32;
        let texture = self.read_texture(shader, "inputs:opacity", (path, known));
        let is_of_base = match (&texture, &out.base_color_texture) {
            (Some(read), Some(base)) => read.texture.image == base.image && read.channel == "a",
            _ => false,
        };
        match texture {
            Some(read) if is_of_base => out.base_color.w = read.scale.w,
            Some(_) => self
                .notes
                .warn(path, "takes its opacity from another texture than its color; the opacity is left out"),
            None => out.base_color.w = opacity,
        }
        if threshold > 0.0 && (is_of_base || opacity < 1.0) {
            out.alpha_mode = AlphaMode::Mask(threshold);
        } else if is_of_base || opacity < 1.0 {
            out.alpha_mode = AlphaMode::Blend;
        }
    }

    fn read_reflection(
        &mut self,
        shader: &'a Prim,
        (path, known): (&str, &mut MaterialInfo),
        out: &mut Material,
    ) {
        let number = |name: &str, default: f32| shader.number(name).map_or(default, |v| v as f32);
        out.metallic = number("inputs:metallic", 0.0);
        out.roughness = number("inputs:roughness", 0.5);
        let metallic = self.read_texture(shader, "inputs:metallic", (path, known));
        let roughness = self.read_texture(shader, "inputs:roughness", (path, known));
        let fits = |read: &TextureInput, channel: &str| read.channel == channel || read.channel == "rgb";
        match (metallic, roughness) {
            (Some(m), Some(r)) if m.texture == r.texture && fits(&m, "b") && fits(&r, "g") => {
                (out.metallic, out.roughness) = (m.scale.z, r.scale.y);
                out.metallic_roughness_texture = Some(m.texture);
            }
            (None, Some(r)) if fits(&r, "g") && out.metallic == 0.0 => {
                out.roughness = r.scale.y;
                out.metallic_roughness_texture = Some(r.texture);
            }
            (None, None) => {}
            _ => self
                .notes
                .warn(path, "has roughness or metalness in channels of other textures; they are left out"),
        }
        if let Some(read) = self.read_texture(shader, "inputs:normal", (path, known)) {
            out.normal_scale = if read.bias.x < 0.0 { read.scale.x * 0.5 } else { 1.0 };
            out.normal_texture = Some(read.texture);
        }
        if let Some(read) = self.read_texture(shader, "inputs:occlusion", (path, known)) {
            out.occlusion_strength = read.scale.x.clamp(0.0, 1.0);
            out.occlusion_texture = Some(read.texture);
        }
        let (index, coat) = (number("inputs:ior", 1.5), number("inputs:clearcoat", 0.0));
        if index != 1.5 || coat > 0.0 {
            out.layers = Some(Box::new(choreo_asset::MaterialLayers {
                ior: index.max(1.0),
                clearcoat: coat.clamp(0.0, 1.0),
                clearcoat_roughness: number("inputs:clearcoatRoughness", 0.01).clamp(0.0, 1.0),
                ..Default::default()
            }));
        }
    }

    /// The texture that drives an input.
    fn read_texture(
        &mut self,
        shader: &'a Prim,
        input: &str,
        (path, known): (&str, &mut MaterialInfo),
    ) -> Option<TextureInput> {
        let source = shader.connections.get(input)?.first()?.clone();
        let (at, output) = source.rsplit_once('.')?;
        let texture = self.root.at(at)?;
        match texture.text("info:id") {
            "UsdUVTexture" => {}
            "UsdPrimvarReader_float3" if texture.text("inputs:varname") == "displayColor" => {
                known.reads_vertex_colors = true;
                return None;
            }
            other => {
                let what = format!(
                    "takes {} from \"{other}\", which is not supported",
                    input.trim_start_matches("inputs:")
                );
                self.notes.warn(path, what);
                return None;
            }
        }
        let (set, uv_transform) = self.uv_set_and_transform(texture);
        let uv_set = match known.uvs.iter().position(|known| *known == set) {
            Some(known) => known,
            None if known.uvs[1].is_empty() => {
                // The first set may be replaced as long as no texture uses it.
                let next = usize::from(known.has_texture);
                known.uvs[next] = set;
                next
            }
            None => return None,
        };
        let file = texture.text("inputs:file");
        if !self.wants_textures || file.is_empty() {
            return None;
        }
        let image = self.textures.find(file, path, self.files, self.budget, self.notes)?;
        let wrap = |name: &str| match texture.text(name) {
            "clamp" | "black" => Wrap::ClampToEdge,
            "mirror" => Wrap::MirroredRepeat,
            _ => Wrap::Repeat,
        };
        let sampler =
            Sampler { wrap_u: wrap("inputs:wrapS"), wrap_v: wrap("inputs:wrapT"), ..Sampler::default() };
        let four = |name: &str, default: Vec4| {
            let found = texture.numbers(name).and_then(|v| v.first_chunk::<4>());
            found.map_or(default, |v| Vec4::from_array(v.map(|v| v as f32)))
        };
        let (scale, bias) = (four("inputs:scale", Vec4::ONE), four("inputs:bias", Vec4::ZERO));
        let channel = output.trim_start_matches("outputs:").to_string();
        let texture = TextureRef { image, sampler, uv_set: uv_set as u8, uv_transform };
        known.has_texture = true;
        Some(TextureInput { texture, channel, scale, bias })
    }

    /// The primvar name of a texture's coordinates, and their transform with the origin at the top.
    fn uv_set_and_transform(&self, texture: &Prim) -> (String, Affine2) {
        let mut transform = Affine2::IDENTITY;
        let mut at = texture.connections.get("inputs:st").and_then(|list| list.first());
        // A transform, then a primvar reader; at most four nodes are followed.
        for _ in 0..4 {
            let Some(prim) = at.and_then(|path| self.root.at(prim_path(path))) else { break };
            match prim.text("info:id") {
                "UsdTransform2d" => {
                    transform = with_v_flipped(prim);
                    at = prim.connections.get("inputs:in").and_then(|list| list.first());
                }
                _ => {
                    let own = prim.text("inputs:varname").to_string();
                    // The name may be connected to an input of the material.
                    let source = prim.connections.get("inputs:varname").and_then(|list| list.first());
                    let of_material = source.and_then(|path| {
                        let (at, name) = path.rsplit_once('.')?;
                        Some(self.root.at(at)?.text(name).to_string())
                    });
                    let name = if own.is_empty() { of_material.unwrap_or_default() } else { own };
                    return (if name.is_empty() { "st".into() } else { name }, transform);
                }
            }
        }
        ("st".into(), transform)
    }
}

fn prim_path(path: &str) -> &str {
    path.rsplit_once('.').map_or(path, |(prim, _)| prim)
}

fn named_material(prim: &Prim) -> Material {
    let name = if prim.display_name.is_empty() { &prim.name } else { &prim.display_name };
    Material { name: name.clone(), ..Material::default() }
}

/// Converts scale, rotation and translation with the origin at the bottom to a transform with the origin at the top.
fn with_v_flipped(prim: &Prim) -> Affine2 {
    let two = |name: &str, default: Vec2| {
        let found = prim.numbers(name).and_then(|v| v.first_chunk::<2>());
        found.map_or(default, |v| DVec2::from_array(*v).as_vec2())
    };
    let angle = prim.number("inputs:rotation").unwrap_or(0.0).to_radians() as f32;
    let (scale, at) = (two("inputs:scale", Vec2::ONE), two("inputs:translation", Vec2::ZERO));
    let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
    let (x, y) = (Vec2::new(cos, sin) * scale.x, Vec2::new(-sin, cos) * scale.y);
    let matrix = Mat2::from_cols(Vec2::new(x.x, -x.y), Vec2::new(-y.x, y.y));
    Affine2::from_mat2_translation(matrix, Vec2::new(at.x + y.x, 1.0 - y.y - at.y))
}

/// Replaces non-finite numbers in the material of a damaged file.
fn replace_non_finite(m: &mut Material) {
    let plain = Material::default();
    if !m.base_color.is_finite() {
        m.base_color = plain.base_color;
    }
    if !m.emissive.is_finite() {
        m.emissive = plain.emissive;
    }
    for number in [&mut m.metallic, &mut m.roughness, &mut m.normal_scale, &mut m.occlusion_strength] {
        *number = if number.is_finite() { *number } else { 1.0 };
    }
    let textures = [
        &mut m.base_color_texture,
        &mut m.metallic_roughness_texture,
        &mut m.normal_texture,
        &mut m.occlusion_texture,
        &mut m.emissive_texture,
    ];
    for texture in textures.into_iter().flatten().filter(|t| !t.uv_transform.is_finite()) {
        texture.uv_transform = Affine2::IDENTITY;
    }
}
