//! Shaders without a GPU: the layouts of their structs equal the Rust structs field by field.

use choreo_render::plan::{ActiveMorph, Features, Instance, LightType, PipelineKey, PlanLight};
use choreo_render::shader::uniforms::{
    FrameUniform, LayersUniform, MaterialUniform, MetallicRoughnessUniform, OutlineUniform, PhongUniform,
    PostUniform, RebuiltUniform, ShadowUniform, SkyUniform, ToonUniform, UvTransform,
};
use choreo_render::shader::{
    BACKGROUND, DeferredPass, ParameterRows, SCENE, SceneVariant, ShaderSources, parse, switches,
};
use naga::TypeInner;
use std::mem::offset_of;

fn sources() -> ShaderSources {
    ShaderSources::default()
}

/// Byte offsets of a WGSL struct's members and its size.
fn layout(module: &naga::Module, name: &str) -> (Vec<(String, u32)>, u32) {
    for (_, ty) in module.types.iter() {
        if let (Some(n), TypeInner::Struct { members, span }) = (&ty.name, &ty.inner)
            && n == name
        {
            return (members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect(), *span);
        }
    }
    panic!("no struct {name} in the module");
}

fn compare_layout(module: &naga::Module, name: &str, size: usize, fields: &[(&str, usize)]) {
    let (members, span) = layout(module, name);
    let rust: Vec<(String, u32)> = fields.iter().map(|(n, o)| (n.to_string(), *o as u32)).collect();
    assert_eq!(members, rust, "struct {name}");
    assert_eq!(span as usize, size, "size of struct {name}");
}

macro_rules! fields {
    ($t:ty: $($f:ident),*) => { &[$((stringify!($f), offset_of!($t, $f))),*] };
}

/// The module of the scene for these features.
fn scene(features: Features, deferred: DeferredPass) -> naga::Module {
    let variant = SceneVariant { deferred, ..SceneVariant::of(PipelineKey::of(features)) };
    parse(&sources().files(&SCENE).unwrap(), &switches(&variant)).unwrap().0
}

#[test]
fn uniform_layouts_equal_the_rust_structs() {
    let features = [Features::SHADOW, Features::SKY, Features::LAYERS, Features::SKIN, Features::MORPH];
    let lit = Features::METALLIC_ROUGHNESS.with(Features::LOCAL_LIGHTS);
    let m = scene(features.into_iter().fold(lit, Features::with), DeferredPass::No);
    macro_rules! uniforms {
        ($($module:expr, $name:literal: $uniform:ty;)*) => {
            $(compare_layout($module, $name, size_of::<$uniform>(), <$uniform>::FIELDS);)*
        };
    }
    let light_pass = scene(Features::METALLIC_ROUGHNESS, DeferredPass::Light);
    let effect =
        "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color * p[0]; }";
    let (post, _) = parse(
        &sources()
            .post("test", effect, [0, 0], ParameterRows { first: 0, length: 8, reads_frame: false }, false)
            .unwrap(),
        &["EFFECTS"],
    )
    .unwrap();
    uniforms! {
        &m, "Frame": FrameUniform;
        &m, "MetallicRoughness": MetallicRoughnessUniform;
        &m, "Phong": PhongUniform;
        &m, "Toon": ToonUniform;
        &m, "Outline": OutlineUniform;
        &m, "Material": MaterialUniform;
        &m, "Layers": LayersUniform;
        &m, "Sky": SkyUniform;
        &m, "ShadowView": ShadowUniform;
        &m, "UvTransform": UvTransform;
        &light_pass, "Rebuilt": RebuiltUniform;
        &post, "Post": PostUniform;
    }
    let light = fields!(PlanLight: position, kind, direction, shadow_views, color, inverse_range_squared, cone, polynomial);
    compare_layout(&m, "Light", size_of::<PlanLight>(), light);
    compare_layout(&m, "Rows", 48, &[("x", 0), ("y", 16), ("z", 32)]);
    let (members, span) = layout(&m, "Instance");
    let rust =
        fields!(Instance: relative_from_mesh, tint, first_joint, first_morph, morph_count, width).iter();
    let rust: Vec<u32> = rust.map(|(_, o)| *o as u32).collect();
    assert_eq!(members.iter().map(|(_, o)| *o).collect::<Vec<_>>(), rust);
    assert_eq!(span as usize, size_of::<Instance>());
    assert_eq!(layout(&m, "ActiveMorph").1 as usize, size_of::<ActiveMorph>());
    assert_eq!(offset_of!(ActiveMorph, weight), layout(&m, "ActiveMorph").0[1].1 as usize);
}

#[test]
fn light_type_constants_equal_the_rust_enum() {
    let m = scene(Features::METALLIC_ROUGHNESS, DeferredPass::No);
    for (name, kind) in [
        ("LIGHT_DIRECTIONAL", LightType::Directional),
        ("LIGHT_POINT", LightType::Point),
        ("LIGHT_SPOT", LightType::Spot),
    ] {
        let (_, constant) = m.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name)).unwrap();
        let value = naga::Expression::Literal(naga::Literal::U32(kind as u32));
        assert_eq!(m.global_expressions[constant.init], value, "{name}");
    }
}

#[test]
#[should_panic(expected = "struct Frame")]
fn the_comparison_finds_a_moved_field() {
    let text = sources().file("frame.wgsl").unwrap().text;
    let moved = text
        .replace("    eye: vec4<f32>,\n", "")
        .replace("light_count: u32,", "light_count: u32,\n eye: vec4<f32>,");
    assert_ne!(text, moved);
    let mut files = sources().files(&BACKGROUND).unwrap();
    files[0].text = moved;
    let (m, _) = parse(&files, &[]).unwrap();
    compare_layout(&m, "Frame", size_of::<FrameUniform>(), FrameUniform::FIELDS);
}
