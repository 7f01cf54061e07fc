//! Shaders without a GPU: the layouts of their structs equal the Rust structs field by field.

use choreo_render::plan::{ActiveMorph, Features, Instance, PipelineKey, PlanLight};
use choreo_render::shader::uniforms::{
    FrameUniform, LayersUniform, MaterialUniform, PostUniform, RebuiltUniform, ShadowUniform, SkyUniform,
    UvTransform,
};
use choreo_render::shader::*;
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

fn compare(module: &naga::Module, name: &str, size: usize, fields: &[(&str, usize)]) {
    let (members, span) = layout(module, name);
    let rust: Vec<(String, u32)> = fields.iter().map(|(n, o)| (n.to_string(), *o as u32)).collect();
    assert_eq!(members, rust, "struct {name}");
    assert_eq!(span as usize, size, "size of struct {name}");
}

macro_rules! fields {
    ($t:ty: $($f:ident),*) => { &[$((stringify!($f), offset_of!($t, $f))),*] };
}

fn variant(features: Features) -> SceneVariant {
    SceneVariant {
        key: PipelineKey::of(features),
        tint: true,
        joints_uniform: false,
        lights: LightLoop::All,
        shadow_pass: false,
        peel: PeelPass::No,
        deferred: DeferredPass::No,
    }
}

#[test]
fn layouts_equal_the_rust_structs() {
    let all = Features((1 << 54) - (1 << 32) + (1 << 19) - 1 - Features::BLINN_PHONG.0 + Features::SHADOW.0)
        .with(Features::SKY);
    let on = switches(&variant(all));
    let (m, _) = parse(&sources().files(&SCENE).unwrap(), &on).unwrap();
    let frame = fields!(FrameUniform: clip_from_relative, eye, camera, ambient_up, ambient_down, background_top,
        background_bottom, size, light_count, pad);
    compare(&m, "Frame", size_of::<FrameUniform>(), frame);
    let material = fields!(MaterialUniform: base_color, emissive, alpha_cutoff, specular_color, specular, metallic,
        roughness, normal_scale, occlusion_strength, shininess, rim_lighting_mix, outline_width, outline_on_screen, toon, rim,
        matcap, outline, uv_moved, triplanar, uv);
    compare(&m, "Material", size_of::<MaterialUniform>(), material);
    let layers = fields!(LayersUniform: sheen_color, sheen_roughness, extinction, thickness, clearcoat,
        clearcoat_roughness, clearcoat_normal_scale, transmission, diffuse_transmission_color, diffuse_transmission,
        anisotropy_direction, anisotropy, iridescence, iridescence_thickness, iridescence_ior, pad, iors, pad_iors, uv);
    compare(&m, "Layers", size_of::<LayersUniform>(), layers);
    let lookup = fields!(ShadowUniform: texel_from_relative, inside, texel);
    let sky = fields!(SkyUniform: harmonics, levels, turn, texel, right, down, ahead);
    compare(&m, "Sky", size_of::<SkyUniform>(), sky);
    compare(&m, "ShadowView", size_of::<ShadowUniform>(), lookup);
    compare(&m, "UvTransform", size_of::<UvTransform>(), fields!(UvTransform: x, y));
    compare(&m, "Light", size_of::<PlanLight>(), fields!(PlanLight: position, direction, color, cone));
    compare(&m, "Rows", 48, &[("x", 0), ("y", 16), ("z", 32)]);
    let (members, span) = layout(&m, "Instance");
    let rust =
        fields!(Instance: relative_from_mesh, tint, first_joint, first_morph, morph_count, width).iter();
    let rust: Vec<u32> = rust.map(|(_, o)| *o as u32).collect();
    assert_eq!(members.iter().map(|(_, o)| *o).collect::<Vec<_>>(), rust);
    assert_eq!(span as usize, size_of::<Instance>());
    assert_eq!(layout(&m, "ActiveMorph").1 as usize, size_of::<ActiveMorph>());
    assert_eq!(offset_of!(ActiveMorph, weight), layout(&m, "ActiveMorph").0[1].1 as usize);

    let on =
        switches(&SceneVariant { deferred: DeferredPass::Light, ..variant(Features::METALLIC_ROUGHNESS) });
    let (m, _) = parse(&sources().files(&SCENE).unwrap(), &on).unwrap();
    compare(&m, "Rebuilt", size_of::<RebuiltUniform>(), fields!(RebuiltUniform: relative_from_clip));

    let effect =
        "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color * p[0]; }";
    let (m, _) = parse(&sources().post("test", effect, 0, false).unwrap(), &[]).unwrap();
    compare(
        &m,
        "Post",
        size_of::<PostUniform>(),
        fields!(PostUniform: parameters, size, number, shrink, input, whole),
    );
}

#[test]
#[should_panic(expected = "struct Frame")]
fn a_moved_field_is_found() {
    let text = sources().file("frame.wgsl").unwrap().text;
    let moved = text
        .replace("    eye: vec4<f32>,\n", "")
        .replace("light_count: u32,", "light_count: u32,\n eye: vec4<f32>,");
    assert_ne!(text, moved);
    let mut files = sources().files(&BACKGROUND).unwrap();
    files[0].text = moved;
    let (m, _) = parse(&files, &[]).unwrap();
    let frame = fields!(FrameUniform: clip_from_relative, eye, camera, ambient_up, ambient_down, background_top,
        background_bottom, size, light_count, pad);
    compare(&m, "Frame", size_of::<FrameUniform>(), frame);
}
