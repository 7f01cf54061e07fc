// Inputs of every shader of the scene. Layouts are compared with the Rust structs (core/render/src/shader/uniforms.rs, plan/mod.rs) by a test.
// Lines such as `@if(SKIN) …` are kept only if the plan requests the feature; see core/render/src/plan/shader_features.rs, which
// also declares the material textures.

struct Frame {
    clip_from_relative: mat4x4<f32>,
    // Perspective: w = 1, xyz = 0, the eye. Orthographic: w = 0, xyz = direction to the viewer.
    eye: vec4<f32>,
    // World position of the camera, rounded to f32.
    camera: vec4<f32>,
    ambient_up: vec4<f32>,
    ambient_down: vec4<f32>,
    background_top: vec4<f32>,
    background_bottom: vec4<f32>,
    // Pixels.
    size: vec2<f32>,
    light_count: u32,
    // Factor on all light.
    exposure: f32,
    // Clip space from camera-relative space in the frame before, and the camera's position then, for motion vectors.
    clip_before: mat4x4<f32>,
    camera_before: vec4<f32>,
}

// relative-from-mesh, three rows of an affine 3×4 matrix.
struct Rows {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Length of the second row of a view's matrix, without the offset of a tile from the view axis.
fn tall(rows: mat4x4<f32>) -> f32 {
    return length(rows[1].xyz - rows[3].xyz * dot(rows[1].xyz, rows[3].xyz));
}

struct Instance {
    relative_from_mesh: Rows,
    tint: vec4<f32>,
    // Pre-skinned mesh: first_joint is the index of the first number in the buffer, and first_morph the number of vertices.
    first_joint: u32,
    first_morph: u32,
    morph_count: u32,
    // Width of lines and points in pixels; negative: in metres.
    width: f32,
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

struct MetallicRoughness {
    specular_color: vec3<f32>,
    specular: f32,
    metallic: f32,
    roughness: f32,
    pad: vec2<f32>,
}

struct Phong {
    specular_color: vec3<f32>,
    shininess: f32,
    // Reflectivity, linear RGB.
    reflection: vec3<f32>,
    reflection_roughness: f32,
}

// MToon.
struct Toon {
    shade_color: vec3<f32>,
    shading_shift: f32,
    rim_color: vec3<f32>,
    rim_fresnel_power: f32,
    matcap: vec3<f32>,
    rim_lift: f32,
    shading_toony: f32,
    gi_equalization: f32,
    shading_shift_scale: f32,
    rim_lighting_mix: f32,
}

struct Outline {
    color: vec3<f32>,
    // Share of the surface's lighting in the outline's color.
    lighting_mix: f32,
    // Metres, or a share of the image's height where `on_screen` is 1.
    width: f32,
    on_screen: f32,
    pad: vec2<f32>,
}

struct Material {
    base_color: vec4<f32>,
    emissive: vec3<f32>,
    alpha_cutoff: f32,
    normal_scale: f32,
    occlusion_strength: f32,
    // Depth of the height map, in widths of the texture.
    parallax_depth: f32,
    triplanar_sharpness: f32,
    triplanar_middle: vec3<f32>,
    // 1 / width of the textures.
    triplanar_scale: f32,
    // Current state of the masked UV animation: offset in widths of the texture, rotation in radians.
    uv_motion: vec3<f32>,
    pad: f32,
    metallic_roughness: MetallicRoughness,
    phong: Phong,
    toon: Toon,
    outline: Outline,
    // Slots of the base textures, then those of the outline width and of the mask of the UV animation.
    uv: array<UvTransform, 9>,
}

@if(LAYERS)
struct Layers {
    sheen_color: vec3<f32>,
    sheen_roughness: f32,
    // Volume: extinction per metre, and thickness in metres.
    extinction: vec3<f32>,
    thickness: f32,
    clearcoat: f32,
    clearcoat_roughness: f32,
    clearcoat_normal_scale: f32,
    transmission: f32,
    diffuse_transmission_color: vec3<f32>,
    diffuse_transmission: f32,
    // Cosine and sine of the rotation.
    anisotropy_direction: vec2<f32>,
    anisotropy: f32,
    iridescence: f32,
    // Thickness in nanometers where the texture is 0 and where it is 1.
    iridescence_thickness: vec2<f32>,
    iridescence_ior: f32,
    pad: f32,
    // Indices of refraction of red, green and blue.
    iors: vec3<f32>,
    pad_iors: f32,
    // clearcoat, its roughness, its normal, sheen color, its roughness, transmission, thickness, iridescence, its thickness,
    // anisotropy, diffuse transmission, its color
    uv: array<UvTransform, 12>,
}
@end

// Lookup parameters of one shadow map.
struct ShadowView {
    // xy: texels of the shared image; z: depth; all multiplied by w.
    texel_from_relative: mat4x4<f32>,
    // Rectangle in which all texels of the filter lie inside the map: from (xy), to (zw).
    inside: vec4<f32>,
    // x = size of a texel in metres where w is 1, y = penumbra in texels per depth, zw = 1 / texels of the image
    texel: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> instances: array<Instance>;
@if(SKIN && !JOINTS_UNIFORM) @group(0) @binding(2) var<storage, read> joints: array<Rows>;
@if(SKIN && JOINTS_UNIFORM) @group(0) @binding(5) var<uniform> joints: array<Rows, 1365>;
@if(MORPH) @group(0) @binding(3) var<storage, read> active_morphs: array<ActiveMorph>;
@if(LIT) @group(0) @binding(4) var<uniform> lights: array<Light, 256>;

@if(LIT && LIGHT_CLUSTERS) @group(0) @binding(9) var<storage, read> light_lists: array<u32>;

@if(!LIGHT_PASS) @group(3) @binding(0) var<uniform> material: Material;
@if(LAYERS) @group(3) @binding(43) var<uniform> layers: Layers;

@if(SHADOW) @group(2) @binding(0) var<uniform> shadow_views: array<ShadowView, 32>;
@if(SHADOW) @group(2) @binding(1) var shadow_map: texture_depth_2d;
@if(SHADOW) @group(2) @binding(2) var shadow_sampler: sampler_comparison;
@if(REFRACTION) @group(2) @binding(3) var behind_texture: texture_2d<f32>;
@if(REFRACTION) @group(2) @binding(4) var behind_sampler: sampler;

// Morph targets of one primitive: for each target its first vertex, the number of vertices and the start of its offsets. Then for
// each target its offsets of positions, and as many of normals and tangents if the mesh has these.
@if(MORPH) @group(1) @binding(0) var<storage, read> morphs: array<vec4<u32>>;
// Vertices of meshes that a compute stage pre-skinned; see preskin.wgsl.
@if(PRE_SKINNED) @group(1) @binding(0) var<storage, read> posed: array<f32>;
