// What every shader of the scene reads. Layouts are compared with the Rust structs (gpu_types.rs, plan.rs) by a test.
// Lines such as `@if(SKIN) …` are kept only where the plan asks for the feature; see shaders.rs.

struct Frame {
    clip_from_relative: mat4x4<f32>,
    // Perspective: w = 1, xyz = 0, the eye. Orthographic: w = 0, xyz = direction to the viewer.
    eye: vec4<f32>,
    ambient_up: vec4<f32>,
    ambient_down: vec4<f32>,
    background_top: vec4<f32>,
    background_bottom: vec4<f32>,
    // Pixels.
    size: vec2<f32>,
    light_count: u32,
    pad: u32,
}

// relative-from-mesh, three rows of an affine 3×4 matrix.
struct Rows {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

struct Light {
    // xyz position, w = 1/range² or 0
    position: vec4<f32>,
    // xyz unit direction in which it shines, w = 0 directional, 1 point, 2 spot
    direction: vec4<f32>,
    color: vec4<f32>,
    // x = angle scale, y = angle offset, z = first shadow view, w = how many
    cone: vec4<f32>,
}

struct Instance {
    relative_from_mesh: Rows,
    tint: vec4<f32>,
    first_joint: u32,
    first_morph: u32,
    morph_count: u32,
    pad: u32,
}

struct ActiveMorph {
    target_index: u32,
    weight: f32,
}

// u = dot(x.xy, uv) + x.z, v = dot(y.xy, uv) + y.z; x.w = uv set
struct UvTransform {
    x: vec4<f32>,
    y: vec4<f32>,
}

struct Material {
    base_color: vec4<f32>,
    emissive: vec3<f32>,
    alpha_cutoff: f32,
    specular_color: vec3<f32>,
    specular: f32,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    occlusion_strength: f32,
    shininess: f32,
    rim_lighting_mix: f32,
    pad0: f32,
    pad1: f32,
    // Toon: shading shift, toony, GI equalization, scale of the shift texture
    toon: vec4<f32>,
    // rim colour, Fresnel power
    rim: vec4<f32>,
    // matcap colour, rim lift
    matcap: vec4<f32>,
    // base colour, metallic-roughness, normal, occlusion, emissive, specular, specular colour
    uv: array<UvTransform, 7>,
}

@if(LAYERS)
struct Layers {
    sheen_color: vec3<f32>,
    sheen_roughness: f32,
    // Of the volume: light lost a metre, and metres.
    extinction: vec3<f32>,
    thickness: f32,
    clearcoat: f32,
    clearcoat_roughness: f32,
    clearcoat_normal_scale: f32,
    transmission: f32,
    // clearcoat, its roughness, its normal, sheen colour, its roughness, transmission, thickness
    uv: array<UvTransform, 7>,
}
@end

// Offsets of one primitive: for each target, `stride` lists of vertex_count vectors: positions, normals, tangents.
struct Morphs {
    vertex_count: u32,
    stride: u32,
    pad0: u32,
    pad1: u32,
    offsets: array<vec4<f32>>,
}

// One shadow map as it is looked up.
struct ShadowView {
    // xy: texels of the image, z: depth, all times w
    texel_from_relative: mat4x4<f32>,
    // Where the filter's texels all lie in the map: from, to
    inside: vec4<f32>,
    // x = metres of a texel where w is 1, zw = 1 / texels of the image
    texel: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> instances: array<Instance>;
@if(SKIN && !JOINTS_UNIFORM) @group(0) @binding(2) var<storage, read> joints: array<Rows>;
@if(SKIN && JOINTS_UNIFORM) @group(0) @binding(5) var<uniform> joints: array<Rows, 1365>;
@if(MORPH) @group(0) @binding(3) var<storage, read> active_morphs: array<ActiveMorph>;
@if(LIT) @group(0) @binding(4) var<uniform> lights: array<Light, 256>;

@group(1) @binding(0) var<uniform> material: Material;
@if(BASE_COLOR_TEXTURE) @group(1) @binding(1) var base_color_texture: texture_2d<f32>;
@if(BASE_COLOR_TEXTURE) @group(1) @binding(2) var base_color_sampler: sampler;
@if(METALLIC_ROUGHNESS_TEXTURE) @group(1) @binding(3) var metallic_roughness_texture: texture_2d<f32>;
@if(METALLIC_ROUGHNESS_TEXTURE) @group(1) @binding(4) var metallic_roughness_sampler: sampler;
@if(NORMAL_TEXTURE) @group(1) @binding(5) var normal_texture: texture_2d<f32>;
@if(NORMAL_TEXTURE) @group(1) @binding(6) var normal_sampler: sampler;
@if(OCCLUSION_TEXTURE) @group(1) @binding(7) var occlusion_texture: texture_2d<f32>;
@if(OCCLUSION_TEXTURE) @group(1) @binding(8) var occlusion_sampler: sampler;
@if(EMISSIVE_TEXTURE) @group(1) @binding(9) var emissive_texture: texture_2d<f32>;
@if(EMISSIVE_TEXTURE) @group(1) @binding(10) var emissive_sampler: sampler;
@if(SPECULAR_TEXTURE) @group(1) @binding(11) var specular_texture: texture_2d<f32>;
@if(SPECULAR_TEXTURE) @group(1) @binding(12) var specular_sampler: sampler;
@if(SPECULAR_COLOR_TEXTURE) @group(1) @binding(13) var specular_color_texture: texture_2d<f32>;
@if(SPECULAR_COLOR_TEXTURE) @group(1) @binding(14) var specular_color_sampler: sampler;
@if(CLEARCOAT_TEXTURE) @group(1) @binding(15) var clearcoat_texture: texture_2d<f32>;
@if(CLEARCOAT_TEXTURE) @group(1) @binding(16) var clearcoat_sampler: sampler;
@if(CLEARCOAT_ROUGHNESS_TEXTURE) @group(1) @binding(17) var clearcoat_roughness_texture: texture_2d<f32>;
@if(CLEARCOAT_ROUGHNESS_TEXTURE) @group(1) @binding(18) var clearcoat_roughness_sampler: sampler;
@if(CLEARCOAT_NORMAL_TEXTURE) @group(1) @binding(19) var clearcoat_normal_texture: texture_2d<f32>;
@if(CLEARCOAT_NORMAL_TEXTURE) @group(1) @binding(20) var clearcoat_normal_sampler: sampler;
@if(SHEEN_COLOR_TEXTURE) @group(1) @binding(21) var sheen_color_texture: texture_2d<f32>;
@if(SHEEN_COLOR_TEXTURE) @group(1) @binding(22) var sheen_color_sampler: sampler;
@if(SHEEN_ROUGHNESS_TEXTURE) @group(1) @binding(23) var sheen_roughness_texture: texture_2d<f32>;
@if(SHEEN_ROUGHNESS_TEXTURE) @group(1) @binding(24) var sheen_roughness_sampler: sampler;
@if(TRANSMISSION_TEXTURE) @group(1) @binding(25) var transmission_texture: texture_2d<f32>;
@if(TRANSMISSION_TEXTURE) @group(1) @binding(26) var transmission_sampler: sampler;
@if(THICKNESS_TEXTURE) @group(1) @binding(27) var thickness_texture: texture_2d<f32>;
@if(THICKNESS_TEXTURE) @group(1) @binding(28) var thickness_sampler: sampler;
@if(LAYERS) @group(1) @binding(29) var<uniform> layers: Layers;

@if(SHADOW) @group(3) @binding(0) var<uniform> shadow_views: array<ShadowView, 32>;
@if(SHADOW) @group(3) @binding(1) var shadow_map: texture_depth_2d;
@if(SHADOW) @group(3) @binding(2) var shadow_sampler: sampler_comparison;

@if(MORPH) @group(2) @binding(0) var<storage, read> morphs: Morphs;
