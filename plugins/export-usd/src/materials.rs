//! Materials as UsdPreviewSurface with textures (the UsdPreviewSurface specification).

use crate::layer::{
    ASSET, COLOR3F, FLOAT, FLOAT2, FLOAT3, FLOAT4, NORMAL3F, Prim, STRING, TOKEN, Type, Value,
};
use crate::textures::Textures;
use choreo_exporter_kit::losses::{self, Losses};
use choreo_plugin::asset::{AlphaMode, Asset, Material, Shading, TextureRef, Wrap};
use choreo_plugin::glam::{Affine2, Vec3, Vec4};

/// The shader network of a material. Materials that differ only in numbers have the same shaders and inputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Network {
    pub shaders: Vec<Shader>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shader {
    pub name: String,
    id: &'static str,
    pub inputs: Vec<Input>,
    outputs: Vec<(&'static str, Type)>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Input {
    pub name: &'static str,
    pub value_type: Type,
    pub value: InputValue,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum InputValue {
    Numbers(Vec<f32>),
    Text(String),
    /// Connection to an output of another shader of the network: `normal.outputs:rgb`.
    Output(String),
}

/// The asset data that a shader network depends on.
#[derive(Clone, Copy)]
pub(crate) struct MaterialContext<'a> {
    pub asset: &'a Asset,
    /// Whether all primitives with the material have the first and the second set of texture coordinates.
    pub uvs: [bool; 2],
    /// Whether all primitives with the material have vertex colors.
    pub has_vertex_colors: bool,
}

struct Builder<'b> {
    material_context: MaterialContext<'b>,
    textures: &'b mut Textures,
    surface: Vec<Input>,
    other_shaders: Vec<Shader>,
}

/// How a texture is sampled: scale and bias of its values, color space.
struct TextureSampling {
    scale: Vec4,
    bias: Vec4,
    color_space: &'static str,
}

impl TextureSampling {
    fn color(scale: Vec4) -> TextureSampling {
        TextureSampling { scale, bias: Vec4::ZERO, color_space: "sRGB" }
    }

    fn raw(scale: Vec4, bias: Vec4) -> TextureSampling {
        TextureSampling { scale, bias, color_space: "raw" }
    }
}

/// The shader network of a material, the surface shader first.
pub(crate) fn network(
    m: &Material,
    material_context: MaterialContext<'_>,
    textures: &mut Textures,
    losses: &mut Losses,
) -> Network {
    let mut builder = Builder { material_context, textures, surface: Vec::new(), other_shaders: Vec::new() };
    builder.add_material_inputs(m, losses);
    let surface = Shader {
        name: "surface".into(),
        id: "UsdPreviewSurface",
        inputs: builder.surface,
        outputs: vec![("surface", TOKEN)],
    };
    let mut shaders = vec![surface];
    shaders.append(&mut builder.other_shaders);
    note_losses(m, losses);
    Network { shaders }
}

impl Builder<'_> {
    fn add_input(&mut self, name: &'static str, value_type: Type, numbers: &[f32]) {
        self.surface.push(Input { name, value_type, value: InputValue::Numbers(numbers.to_vec()) });
    }

    fn add_connection(&mut self, name: &'static str, value_type: Type, output: String) {
        self.surface.push(Input { name, value_type, value: InputValue::Output(output) });
    }

    fn add_material_inputs(&mut self, m: &Material, losses: &mut Losses) {
        let color = m.base_color.clamp(Vec4::ZERO, Vec4::ONE);
        let unlit = matches!(m.shading, Shading::Unlit | Shading::Toon);
        let base = self.add_texture("base_color", &m.base_color_texture, TextureSampling::color(color));
        let (lit, name) = if unlit { (false, "emissiveColor") } else { (true, "diffuseColor") };
        match &base {
            Some(texture) => {
                if self.material_context.has_vertex_colors {
                    losses.insert("vertex colors multiplied by textures");
                }
                self.add_connection(name, COLOR3F, format!("{texture}.outputs:rgb"));
            }
            None if self.material_context.has_vertex_colors => {
                if color.truncate() != Vec3::ONE {
                    losses.insert("material colors multiplied by vertex colors");
                }
                self.add_primvar_reader("vertex_color", "UsdPrimvarReader_float3", "displayColor", FLOAT3);
                self.add_connection(name, COLOR3F, "vertex_color.outputs:result".into());
            }
            None => self.add_input(name, COLOR3F, &color.truncate().to_array()),
        }
        if !lit {
            self.add_input("diffuseColor", COLOR3F, &[0.0; 3]);
        } else {
            let emissive = m.emissive.max(Vec3::ZERO);
            let sampling = TextureSampling::color(emissive.extend(1.0));
            match self.add_texture("emissive", &m.emissive_texture, sampling) {
                Some(texture) => {
                    self.add_connection("emissiveColor", COLOR3F, format!("{texture}.outputs:rgb"))
                }
                None => self.add_input("emissiveColor", COLOR3F, &emissive.to_array()),
            }
        }
        self.add_reflection_inputs(m, unlit);
        let opacity = match m.alpha_mode {
            AlphaMode::Opaque => None,
            AlphaMode::Mask(cutoff) => Some(cutoff),
            AlphaMode::Blend => Some(0.0),
        };
        if let Some(threshold) = opacity {
            match &base {
                Some(texture) => self.add_connection("opacity", FLOAT, format!("{texture}.outputs:a")),
                None => self.add_input("opacity", FLOAT, &[color.w]),
            }
            self.add_input("opacityThreshold", FLOAT, &[threshold]);
        } else if m.layers.as_ref().is_some_and(|layers| layers.transmission > 0.0) {
            let through = m.layers.as_ref().map_or(0.0, |layers| layers.transmission);
            losses.insert("transmission (written as opacity)");
            self.add_input("opacity", FLOAT, &[(1.0 - 0.85 * through).clamp(0.0, 1.0)]);
        }
        let s = m.normal_scale;
        let sampling =
            TextureSampling::raw(Vec4::new(2.0 * s, 2.0 * s, 2.0, 1.0), Vec4::new(-s, -s, -1.0, 0.0));
        if let Some(texture) = self.add_texture("normal", &m.normal_texture, sampling) {
            self.add_connection("normal", NORMAL3F, format!("{texture}.outputs:rgb"));
        }
        let s = m.occlusion_strength.clamp(0.0, 1.0);
        let sampling = TextureSampling::raw(Vec4::splat(s), Vec4::splat(1.0 - s));
        if let Some(texture) = self.add_texture("occlusion", &m.occlusion_texture, sampling) {
            self.add_connection("occlusion", FLOAT, format!("{texture}.outputs:r"));
        }
    }

    fn add_reflection_inputs(&mut self, m: &Material, unlit: bool) {
        let (metallic, roughness) = match m.shading {
            Shading::MetallicRoughness => (m.metallic.clamp(0.0, 1.0), m.roughness.clamp(0.0, 1.0)),
            Shading::BlinnPhong | Shading::Phong => (0.0, m.mirror_roughness().clamp(0.0, 1.0)),
            Shading::Unlit | Shading::Toon => (0.0, 1.0),
        };
        let texture =
            m.metallic_roughness_texture.clone().filter(|_| m.shading == Shading::MetallicRoughness);
        let sampling = TextureSampling::raw(Vec4::new(1.0, roughness, metallic, 1.0), Vec4::ZERO);
        match self.add_texture("metallic_roughness", &texture, sampling) {
            Some(texture) => {
                self.add_connection("metallic", FLOAT, format!("{texture}.outputs:b"));
                self.add_connection("roughness", FLOAT, format!("{texture}.outputs:g"));
            }
            None => {
                self.add_input("metallic", FLOAT, &[metallic]);
                self.add_input("roughness", FLOAT, &[roughness]);
            }
        }
        let layers = m.layers.as_deref();
        // An unlit surface must not reflect: index 1.
        let index = if unlit { 1.0 } else { layers.map_or(1.5, |l| l.ior) };
        if index != 1.5 {
            self.add_input("ior", FLOAT, &[index]);
        }
        if let Some(coat) = layers.filter(|l| l.clearcoat > 0.0) {
            self.add_input("clearcoat", FLOAT, &[coat.clearcoat]);
            self.add_input("clearcoatRoughness", FLOAT, &[coat.clearcoat_roughness]);
        }
    }

    /// Adds the shader of a texture and returns its name; `None` without a texture, or without coordinates for it.
    fn add_texture(
        &mut self,
        name: &'static str,
        texture: &Option<TextureRef>,
        sampling: TextureSampling,
    ) -> Option<String> {
        let has_uvs =
            |t: &&TextureRef| self.material_context.uvs.get(usize::from(t.uv_set)).is_some_and(|has| *has);
        let texture = texture.as_ref().filter(has_uvs)?;
        let image = self
            .material_context
            .asset
            .images
            .get(texture.image as usize)
            .filter(|i| i.width > 0 && i.height > 0)?;
        let file = self.textures.image_path(image);
        let (reader, primvar) = [("uv", "st"), ("uv1", "st1")][usize::from(texture.uv_set > 0)];
        if !self.other_shaders.iter().any(|shader| shader.name == reader) {
            self.add_primvar_reader(reader, "UsdPrimvarReader_float2", primvar, FLOAT2);
        }
        // The transform is always written, so that materials that differ only in numbers have the same shaders.
        let (translation, rotation, scale) = with_v_flipped(&texture.uv_transform);
        let numbers = |name, value_type, list: &[f32]| Input {
            name,
            value_type,
            value: InputValue::Numbers(list.to_vec()),
        };
        let output = |text: String| InputValue::Output(text);
        let transform = format!("{name}_uv");
        self.other_shaders.push(Shader {
            name: transform.clone(),
            id: "UsdTransform2d",
            inputs: vec![
                Input { name: "in", value_type: FLOAT2, value: output(format!("{reader}.outputs:result")) },
                numbers("rotation", FLOAT, &[rotation]),
                numbers("scale", FLOAT2, &scale),
                numbers("translation", FLOAT2, &translation),
            ],
            outputs: vec![("result", FLOAT2)],
        });
        let wrap = |wrap: Wrap| {
            let name = match wrap {
                Wrap::Repeat => "repeat",
                Wrap::MirroredRepeat => "mirror",
                Wrap::ClampToEdge => "clamp",
            };
            InputValue::Text(name.into())
        };
        self.other_shaders.push(Shader {
            name: name.into(),
            id: "UsdUVTexture",
            inputs: vec![
                Input { name: "file", value_type: ASSET, value: InputValue::Text(file) },
                Input {
                    name: "st",
                    value_type: FLOAT2,
                    value: output(format!("{transform}.outputs:result")),
                },
                Input { name: "wrapS", value_type: TOKEN, value: wrap(texture.sampler.wrap_u) },
                Input { name: "wrapT", value_type: TOKEN, value: wrap(texture.sampler.wrap_v) },
                Input {
                    name: "sourceColorSpace",
                    value_type: TOKEN,
                    value: InputValue::Text(sampling.color_space.into()),
                },
                numbers("scale", FLOAT4, &sampling.scale.to_array()),
                numbers("bias", FLOAT4, &sampling.bias.to_array()),
            ],
            outputs: vec![("r", FLOAT), ("g", FLOAT), ("b", FLOAT), ("a", FLOAT), ("rgb", FLOAT3)],
        });
        Some(name.into())
    }

    fn add_primvar_reader(&mut self, name: &str, id: &'static str, primvar: &str, value_type: Type) {
        let varname = Input { name: "varname", value_type: STRING, value: InputValue::Text(primvar.into()) };
        self.other_shaders.push(Shader {
            name: name.into(),
            id,
            inputs: vec![varname],
            outputs: vec![("result", value_type)],
        });
    }
}

/// Converts a texture transform with the origin at the top left to one at the bottom left: translation, degrees, scale. Loses
/// shear.
fn with_v_flipped(a: &Affine2) -> ([f32; 2], f32, [f32; 2]) {
    let (x, y, at) = (a.matrix2.x_axis, a.matrix2.y_axis, a.translation);
    let (x_below, y_below) = ([x.x, -x.y], [-y.x, y.y]);
    let rotation = libm::atan2f(x_below[1], x_below[0]);
    let (sin, cos) = (libm::sinf(rotation), libm::cosf(rotation));
    let scale = [libm::sqrtf(x.x * x.x + x.y * x.y), y_below[1] * cos - y_below[0] * sin];
    ([at.x + y.x, 1.0 - y.y - at.y], rotation.to_degrees(), scale)
}

impl Network {
    /// The material with all its shaders. `path`: the path that the prim will have.
    pub(crate) fn prim<'a>(&self, name: &str, path: &str, display_name: &str) -> Prim<'a> {
        let mut out = Prim::new("Material", name);
        out.display_name = (display_name != name && !display_name.is_empty()).then(|| display_name.into());
        out.add_attribute(TOKEN, "outputs:surface").connection =
            Some(format!("{path}/surface.outputs:surface"));
        for shader in &self.shaders {
            let mut prim = Prim::new("Shader", shader.name.clone());
            prim.set_uniform_token("info:id", shader.id);
            for input in &shader.inputs {
                let name = format!("inputs:{}", input.name);
                match &input.value {
                    InputValue::Numbers(numbers) => _ = prim.set_number(input.value_type, name, numbers),
                    InputValue::Text(text) => _ = prim.set(input.value_type, name, Value::text(text)),
                    InputValue::Output(output) => {
                        prim.add_attribute(input.value_type, name).connection =
                            Some(format!("{path}/{output}"));
                    }
                }
            }
            for (output, value_type) in &shader.outputs {
                prim.add_attribute(*value_type, format!("outputs:{output}"));
            }
            out.children.push(prim);
        }
        out
    }

    /// The numbers of a shader input; `None` where it has none.
    pub(crate) fn numbers(&self, shader: usize, input: usize) -> Option<&[f32]> {
        match &self.shaders.get(shader)?.inputs.get(input)?.value {
            InputValue::Numbers(numbers) => Some(numbers),
            _ => None,
        }
    }

    /// Whether another network has the same shaders, inputs and connections, numbers aside.
    pub(crate) fn is_alike(&self, other: &Network) -> bool {
        let is_of_numbers = |a: &InputValue, b: &InputValue| matches!((a, b), (InputValue::Numbers(a), InputValue::Numbers(b)) if a.len() == b.len());
        self.shaders.len() == other.shaders.len()
            && self.shaders.iter().zip(&other.shaders).all(|(a, b)| {
                a.name == b.name
                    && a.inputs.len() == b.inputs.len()
                    && a.inputs.iter().zip(&b.inputs).all(|(a, b)| {
                        a.name == b.name && (a.value == b.value || is_of_numbers(&a.value, &b.value))
                    })
            })
    }
}

fn note_losses(m: &Material, losses: &mut Losses) {
    let layers = m.layers.as_deref();
    losses::of_material(m, losses);
    let own = [
        (m.shading == Shading::Toon, "toon shading (written as emission)"),
        (m.shading == Shading::Unlit, "surfaces without shading (written as emission)"),
        (
            matches!(m.shading, Shading::Phong | Shading::BlinnPhong),
            "Phong highlights (written as roughness)",
        ),
        (layers.is_some_and(|l| l.sheen_color != Vec3::ZERO), "sheen"),
        (layers.is_some_and(|l| l.iridescence > 0.0), "iridescence"),
        (layers.is_some_and(|l| l.anisotropy != 0.0), "anisotropy"),
        (
            m.shading == Shading::MetallicRoughness && (m.specular != 1.0 || m.specular_color != Vec3::ONE),
            "the strength and color of highlights",
        ),
    ];
    losses::add(&own, losses);
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::glam::{Mat2, Vec2};

    /// Order as in UsdTransform2d: scale, then rotation, then translation.
    #[test]
    fn uv_transforms_with_v_flipped_move_the_same_points() {
        for (rotation, scale) in [(0.7f32, Vec2::new(2.0, 3.0)), (-2.0, Vec2::new(0.5, -1.5))] {
            let above = choreo_plugin::stage::uv_transform(Vec2::new(0.25, -0.5), rotation, scale);
            let (translation, degrees, scale) = with_v_flipped(&above);
            let turn = Mat2::from_angle(degrees.to_radians());
            for uv in [Vec2::ZERO, Vec2::new(0.3, 0.8), Vec2::ONE] {
                let below = Vec2::new(uv.x, 1.0 - uv.y);
                let moved = turn * (below * Vec2::from(scale)) + Vec2::from(translation);
                let truth = above.transform_point2(uv);
                let apart = (moved - Vec2::new(truth.x, 1.0 - truth.y)).length();
                assert!(apart < 1e-5, "{uv}: {moved} is {apart} from {truth}");
            }
        }
    }
}
