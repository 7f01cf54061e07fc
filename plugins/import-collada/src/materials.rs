//! `<material>` and `<effect>` (profile_COMMON), as bound to mesh instances.

use crate::xml::Node;
use crate::xml::{Xml, child, children, descendant, label_of, name_of, text_of};
use choreo_asset::Reflection;
use choreo_asset::{AlphaMode, Material, Sampler, Shading, TextureRef, Wrap};
use choreo_importer_kit::Result;
use choreo_importer_kit::color::linear_channel;
use choreo_importer_kit::textures::{BumpMap, Textures};
use choreo_plugin::Files;
use glam::{Affine2, Vec3, Vec4};
use std::collections::BTreeMap;

pub(crate) struct Materials<'f> {
    pub textures: Option<Textures>,
    pub files: &'f dyn Files,
    pub srgb: bool,
    pub list: Vec<Material>,
    pub bumps: Vec<BumpMap>,
    /// Materials by material element and texture coordinate sets.
    index_of_key: BTreeMap<String, u32>,
}

/// Maps the texture coordinates that an effect names to the uv sets of a primitive.
#[derive(Clone, Debug, Default)]
struct Uvs {
    /// Semantic in the effect → `set` in the mesh.
    bound: BTreeMap<String, usize>,
    /// `set` of each uv list of the primitive.
    sets: Vec<usize>,
}

impl Uvs {
    fn list(&self, texcoord: &str) -> u8 {
        let digits = texcoord.trim_start_matches(|c: char| !c.is_ascii_digit());
        let set = self.bound.get(texcoord).copied().or_else(|| digits.parse().ok());
        set.and_then(|set| self.sets.iter().position(|s| *s == set)).unwrap_or(0) as u8
    }
}

/// The `<color>`, `<float>` or `<texture>` of an effect's slot.
#[derive(Clone, Debug, Default)]
struct Value {
    color: Option<Vec4>,
    texture: Option<TextureRef>,
}

impl<'f> Materials<'f> {
    pub(crate) fn new(textures: bool, files: &'f dyn Files, srgb: bool) -> Materials<'f> {
        let textures = textures.then(Textures::default);
        Materials {
            textures,
            files,
            srgb,
            list: Vec::new(),
            bumps: Vec::new(),
            index_of_key: BTreeMap::new(),
        }
    }

    /// The material that an instance binds to a material symbol of its mesh.
    pub(crate) fn bind(
        &mut self,
        xml: &Xml<'_>,
        instance: Node<'_>,
        symbol: &str,
        uv_sets: &[usize],
    ) -> Result<u32> {
        let bindings = descendant(instance, "bind_material").and_then(|b| child(b, "technique_common"));
        let bound = bindings
            .and_then(|b| children(b, "instance_material").find(|m| m.attribute("symbol") == Some(symbol)));
        let mut uvs = Uvs { bound: BTreeMap::new(), sets: uv_sets.to_vec() };
        let material = match bound {
            Some(bound) => {
                for input in children(bound, "bind_vertex_input") {
                    let set = input.attribute("input_set").and_then(|s| s.trim().parse().ok()).unwrap_or(0);
                    uvs.bound.insert(input.attribute("semantic").unwrap_or_default().to_string(), set);
                }
                xml.resolve_instance(bound, "target", "material", "gray is used")
            }
            // Some exporters bind nothing, and use the material's id as symbol.
            None => xml.by_id(symbol).filter(|n| name_of(*n) == "material"),
        };
        let key = format!("{:?} {uvs:?}", material.map(|m| m.id()));
        if let Some(known) = self.index_of_key.get(&key) {
            return Ok(*known);
        }
        let made = match material {
            Some(material) => self.material(xml, material, &uvs)?,
            None => {
                if bound.is_none() && !symbol.is_empty() {
                    xml.warn(
                        instance,
                        format!("material \"{symbol}\" of the mesh is not bound; gray is used"),
                    );
                }
                Material {
                    name: symbol.to_string(),
                    base_color: Vec4::new(0.6, 0.6, 0.6, 1.0),
                    metallic: 0.0,
                    roughness: 0.7,
                    ..Material::default()
                }
            }
        };
        let index = self.list.len() as u32;
        self.list.push(made);
        self.index_of_key.insert(key, index);
        Ok(index)
    }

    fn material(&mut self, xml: &Xml<'_>, material: Node<'_>, uvs: &Uvs) -> Result<Material> {
        let name = label_of(material).unwrap_or_default().to_string();
        let mut out = Material {
            name,
            shading: Shading::BlinnPhong,
            specular_color: Vec3::ZERO,
            ..Material::default()
        };
        let Some(instance) = child(material, "instance_effect") else { return Ok(out) };
        let Some(effect) = xml.resolve_instance(instance, "url", "effect", "white is used") else {
            return Ok(out);
        };
        let Some(profile) = child(effect, "profile_COMMON") else {
            xml.warn(effect, "has no profile_COMMON; white is used");
            return Ok(out);
        };
        let technique = child(profile, "technique");
        let shader = technique.and_then(|t| {
            t.children().find(|n| ["phong", "blinn", "lambert", "constant"].contains(&name_of(*n)))
        });
        let Some(shader) = shader else {
            xml.warn(effect, "has no phong, blinn, lambert or constant technique; white is used");
            return Ok(out);
        };
        self.shader(xml, profile, shader, uvs, &mut out)?;
        out.double_sided = [Some(effect), Some(material), technique].into_iter().flatten().any(|n| {
            descendant(n, "double_sided")
                .is_some_and(|d| text_of(d) == "1" || text_of(d).eq_ignore_ascii_case("true"))
        });
        if let Some(bump) = descendant(effect, "bump") {
            let found = self.value(xml, profile, bump, uvs)?.texture;
            let material = self.list.len();
            self.bumps.extend(found.map(|texture| BumpMap { material, texture, strength: 1.0 }));
        }
        Ok(out)
    }

    /// Reads colors, textures and transparency of a `<phong>`, `<blinn>`, `<lambert>` or `<constant>`.
    fn shader(
        &mut self,
        xml: &Xml<'_>,
        profile: Node<'_>,
        shader: Node<'_>,
        uvs: &Uvs,
        out: &mut Material,
    ) -> Result<()> {
        let mut value = |slot: &'static str| -> Result<Value> {
            child(shader, slot).map_or(Ok(Value::default()), |n| self.value(xml, profile, n, uvs))
        };
        let (emission, diffuse, specular) = (value("emission")?, value("diffuse")?, value("specular")?);
        let (transparent, reflective) = (value("transparent")?, value("reflective")?);
        let float = |slot| child(shader, slot).map_or(Ok(None), |n| xml.child_number(n, "float"));
        let (shininess, transparency) = (float("shininess")?, float("transparency")?);
        let reflectivity = float("reflectivity")?.map_or(0.0, |v| v.clamp(0.0, 1.0) as f32);

        let srgb = self.srgb;
        let rgb = |c: Vec4| Vec3::from(c.truncate().to_array().map(|c| linear_channel(c, srgb)));
        let white = if diffuse.texture.is_some() { Vec4::ONE } else { Vec4::new(0.8, 0.8, 0.8, 1.0) };
        let base = rgb(diffuse.color.unwrap_or(white));
        let alpha = self.alpha(xml, shader, transparent.color, transparency);
        out.base_color = base.extend(alpha);
        out.base_color_texture = diffuse.texture;
        out.emissive = emission.color.map_or(Vec3::ZERO, rgb);
        if emission.texture.is_some() {
            out.emissive = Vec3::ONE;
            out.emissive_texture = emission.texture;
        }
        out.alpha_mode = if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
        if let Some(mask) = &transparent.texture {
            match out.base_color_texture.as_ref().is_some_and(|b| b.image == mask.image) {
                true => out.alpha_mode = AlphaMode::Blend,
                false => xml.warn(shader, "the transparent texture is not that of diffuse; only its alpha channel can be used, so it is left out"),
            }
        }
        match name_of(shader) {
            "constant" => {
                // Constant shading shows emission only.
                out.shading = Shading::Unlit;
                out.base_color = out.emissive.extend(alpha);
                out.base_color_texture = out.emissive_texture.take();
                out.emissive = Vec3::ZERO;
            }
            "lambert" => {}
            _ => {
                // Most exporters write exponents, and some a value from 0 to 1 that stands for up to 128.
                let s = shininess.unwrap_or(20.0);
                out.shininess = if s > 0.0 && s <= 1.0 { s * 128.0 } else { s }.clamp(1.0, 10_000.0) as f32;
                // Our Blinn–Phong lobe is normalized by (s + 8) / 8; COLLADA's has the specular color at its peak.
                out.specular_color = specular.color.map_or(Vec3::ZERO, rgb) * (8.0 / (out.shininess + 8.0));
                out.specular_color_texture = specular.texture;
                // Reflective color ("the color of a perfect mirror reflection") times reflectivity. Exporters that omit the
                // reflectivity mean no reflection.
                let share = match &reflective.texture {
                    Some(_) => Vec3::ONE,
                    None => reflective.color.map_or(Vec3::ZERO, rgb),
                };
                let color = (share * reflectivity).min(Vec3::ONE);
                if color != Vec3::ZERO {
                    let texture = reflective.texture;
                    out.reflection = Some(Box::new(Reflection { color, texture, environment: None }));
                }
            }
        }
        Ok(())
    }

    /// Opacity (COLLADA 1.4.1, "Determining Transparency"). Many files have it inverted, which would make everything invisible,
    /// so a fully transparent material is taken as opaque.
    fn alpha(&self, xml: &Xml<'_>, shader: Node<'_>, color: Option<Vec4>, transparency: Option<f64>) -> f32 {
        if color.is_none() && transparency.is_none() {
            return 1.0;
        }
        let mode = child(shader, "transparent").and_then(|t| t.attribute("opaque")).unwrap_or("A_ONE");
        let factor = transparency.unwrap_or(1.0) as f32;
        let c = color.unwrap_or(Vec4::ONE);
        let luminance = c.truncate().dot(Vec3::new(0.212671, 0.715160, 0.072169));
        let alpha = match mode {
            "RGB_ZERO" => 1.0 - luminance * factor,
            "A_ZERO" => 1.0 - c.w * factor,
            "RGB_ONE" => luminance * factor,
            _ => c.w * factor,
        };
        if alpha <= 0.0 || !alpha.is_finite() {
            xml.warn(shader, format!("transparent and transparency ({mode}) make it invisible, which many exporters write for opaque; opaque is used"));
            return 1.0;
        }
        alpha.min(1.0)
    }

    fn value(&mut self, xml: &Xml<'_>, profile: Node<'_>, slot: Node<'_>, uvs: &Uvs) -> Result<Value> {
        let mut out = Value::default();
        if let Some(color) = child(slot, "color") {
            let c = xml.floats(color)?;
            match c.len() {
                3 => out.color = Some(Vec4::new(c[0], c[1], c[2], 1.0)),
                4 => out.color = Some(Vec4::new(c[0], c[1], c[2], c[3])),
                n => return Err(xml.problem(color, format!("has {n} numbers, but needs 4"))),
            }
        } else if let Some(float) = child(slot, "float") {
            let v = xml.number(float)? as f32;
            out.color = Some(Vec4::new(v, v, v, 1.0));
        }
        if let Some(texture) = child(slot, "texture") {
            out.texture = self.texture(xml, profile, texture, uvs);
        }
        Ok(out)
    }

    fn texture(
        &mut self,
        xml: &Xml<'_>,
        profile: Node<'_>,
        texture: Node<'_>,
        uvs: &Uvs,
    ) -> Option<TextureRef> {
        let textures = self.textures.as_mut()?;
        let name = texture.attribute("texture").unwrap_or_default();
        let (image, sampler) = image(xml, profile, name);
        let Some(image) = image else {
            xml.warn(texture, format!("texture \"{name}\" leads to no image; it is left out"));
            return None;
        };
        let from = descendant(image, "init_from")?;
        // COLLADA 1.4 has the path itself, 1.5 has it in a <ref>.
        let path = child(from, "ref").map_or(text_of(from), text_of);
        let index = textures.find(path, &xml.place(image), self.files, xml.budget, xml.notes)?;
        let wrap = |name: &'static str| match sampler.and_then(|s| child(s, name)).map(text_of) {
            Some("CLAMP" | "BORDER") => Wrap::ClampToEdge,
            Some("MIRROR") => Wrap::MirroredRepeat,
            _ => Wrap::Repeat,
        };
        let sampler = Sampler { wrap_u: wrap("wrap_s"), wrap_v: wrap("wrap_t"), ..Sampler::default() };
        let uv_set = uvs.list(texture.attribute("texcoord").unwrap_or_default());
        Some(TextureRef { image: index, sampler, uv_set, uv_transform: Affine2::IDENTITY })
    }
}

/// The image and sampler of a texture: follows a sampler's sid through its surface, or takes the name as an image's id, as older
/// exporters mean it.
fn image<'a>(xml: &Xml<'a>, profile: Node<'a>, name: &str) -> (Option<Node<'a>>, Option<Node<'a>>) {
    let param = |sid: &str| {
        let effect = profile.parent();
        let both = [Some(profile), effect].into_iter().flatten();
        both.flat_map(|n| children(n, "newparam")).find(|n| n.attribute("sid") == Some(sid))
    };
    let by_id = |id: &str| xml.by_id(id).filter(|n| name_of(*n) == "image");
    let Some(sampler) = param(name).and_then(|p| child(p, "sampler2D")) else { return (by_id(name), None) };
    if let Some(instance) = child(sampler, "instance_image") {
        return (xml.resolve_reference(instance, "url").ok(), Some(sampler));
    }
    let source = child(sampler, "source").map(text_of).unwrap_or_default();
    let surface = param(source).and_then(|p| child(p, "surface"));
    let id = surface.and_then(|s| child(s, "init_from")).map(text_of);
    (id.and_then(by_id).or_else(|| by_id(source)), Some(sampler))
}
