// What every shader of the scene reads. Layouts are compared with the Rust structs (gpu_types.rs, plan.rs) by a test.
// Lines such as `@if(SKIN) …` are kept only where the plan asks for the feature; see shaders.rs.

struct Frame {
    clip_from_relative: mat4x4<f32>,
    // Perspective: w = 1, xyz = 0, the eye. Orthographic: w = 0, xyz = direction to the viewer.
    eye: vec4<f32>,
    // Where in the world the camera stands, as exactly as f32 can say.
    camera: vec4<f32>,
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

// How long the second row of a view's matrix is, without what the middle of a part of the picture lies beside the view's.
fn tall(rows: mat4x4<f32>) -> f32 {
    return length(rows[1].xyz - rows[3].xyz * dot(rows[1].xyz, rows[3].xyz));
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
    // Of a body that a compute stage posed: the first of its numbers, and how many vertices it has.
    first_joint: u32,
    first_morph: u32,
    morph_count: u32,
    // Of lines and points: pixels, below 0: metres
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
    outline_width: f32,
    outline_on_screen: f32,
    // Toon: shading shift, toony, GI equalization, scale of the shift texture
    toon: vec4<f32>,
    // rim colour, Fresnel power
    rim: vec4<f32>,
    // matcap colour, rim lift
    matcap: vec4<f32>,
    // Outline's colour, and how much the surface's light counts
    outline: vec4<f32>,
    // How far a masked motion has come: textures, radians; w = how deep heights go, in textures
    uv_moved: vec4<f32>,
    // Of textures from three sides: their middle, 1 / their width; their sharpness is uv_moved.x
    triplanar: vec4<f32>,
    // base colour, metallic-roughness, normal, occlusion, emissive, specular, specular colour, outline width, mask of what moves
    uv: array<UvTransform, 9>,
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
    diffuse_transmission_color: vec3<f32>,
    diffuse_transmission: f32,
    // Cosine and sine of the rotation.
    anisotropy_direction: vec2<f32>,
    anisotropy: f32,
    iridescence: f32,
    // Nanometres where the texture is 0 and where it is 1.
    iridescence_thickness: vec2<f32>,
    iridescence_ior: f32,
    pad: f32,
    // Indices of refraction of red, green and blue.
    iors: vec3<f32>,
    pad_iors: f32,
    // clearcoat, its roughness, its normal, sheen colour, its roughness, transmission, thickness, iridescence, its thickness,
    // anisotropy, diffuse transmission, its colour
    uv: array<UvTransform, 12>,
}
@end

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

@if(LIT && LIGHT_LISTS) @group(0) @binding(9) var<storage, read> light_lists: array<u32>;

@if(!LIGHT_PASS) @group(3) @binding(0) var<uniform> material: Material;
@if(BASE_COLOR_TEXTURE) @group(3) @binding(1) var base_color_texture: texture_2d<f32>;
@if(BASE_COLOR_TEXTURE) @group(3) @binding(2) var base_color_sampler: sampler;
@if(METALLIC_ROUGHNESS_TEXTURE) @group(3) @binding(3) var metallic_roughness_texture: texture_2d<f32>;
@if(METALLIC_ROUGHNESS_TEXTURE) @group(3) @binding(4) var metallic_roughness_sampler: sampler;
@if(NORMAL_TEXTURE) @group(3) @binding(5) var normal_texture: texture_2d<f32>;
@if(NORMAL_TEXTURE) @group(3) @binding(6) var normal_sampler: sampler;
@if(OCCLUSION_TEXTURE) @group(3) @binding(7) var occlusion_texture: texture_2d<f32>;
@if(OCCLUSION_TEXTURE) @group(3) @binding(8) var occlusion_sampler: sampler;
@if(EMISSIVE_TEXTURE) @group(3) @binding(9) var emissive_texture: texture_2d<f32>;
@if(EMISSIVE_TEXTURE) @group(3) @binding(10) var emissive_sampler: sampler;
@if(SPECULAR_TEXTURE) @group(3) @binding(11) var specular_texture: texture_2d<f32>;
@if(SPECULAR_TEXTURE) @group(3) @binding(12) var specular_sampler: sampler;
@if(SPECULAR_COLOR_TEXTURE) @group(3) @binding(13) var specular_color_texture: texture_2d<f32>;
@if(SPECULAR_COLOR_TEXTURE) @group(3) @binding(14) var specular_color_sampler: sampler;
@if(CLEARCOAT_TEXTURE) @group(3) @binding(15) var clearcoat_texture: texture_2d<f32>;
@if(CLEARCOAT_TEXTURE) @group(3) @binding(16) var clearcoat_sampler: sampler;
@if(CLEARCOAT_ROUGHNESS_TEXTURE) @group(3) @binding(17) var clearcoat_roughness_texture: texture_2d<f32>;
@if(CLEARCOAT_ROUGHNESS_TEXTURE) @group(3) @binding(18) var clearcoat_roughness_sampler: sampler;
@if(CLEARCOAT_NORMAL_TEXTURE) @group(3) @binding(19) var clearcoat_normal_texture: texture_2d<f32>;
@if(CLEARCOAT_NORMAL_TEXTURE) @group(3) @binding(20) var clearcoat_normal_sampler: sampler;
@if(SHEEN_COLOR_TEXTURE) @group(3) @binding(21) var sheen_color_texture: texture_2d<f32>;
@if(SHEEN_COLOR_TEXTURE) @group(3) @binding(22) var sheen_color_sampler: sampler;
@if(SHEEN_ROUGHNESS_TEXTURE) @group(3) @binding(23) var sheen_roughness_texture: texture_2d<f32>;
@if(SHEEN_ROUGHNESS_TEXTURE) @group(3) @binding(24) var sheen_roughness_sampler: sampler;
@if(TRANSMISSION_TEXTURE) @group(3) @binding(25) var transmission_texture: texture_2d<f32>;
@if(TRANSMISSION_TEXTURE) @group(3) @binding(26) var transmission_sampler: sampler;
@if(THICKNESS_TEXTURE) @group(3) @binding(27) var thickness_texture: texture_2d<f32>;
@if(THICKNESS_TEXTURE) @group(3) @binding(28) var thickness_sampler: sampler;
@if(IRIDESCENCE_TEXTURE) @group(3) @binding(29) var iridescence_texture: texture_2d<f32>;
@if(IRIDESCENCE_TEXTURE) @group(3) @binding(30) var iridescence_sampler: sampler;
@if(IRIDESCENCE_THICKNESS_TEXTURE) @group(3) @binding(31) var iridescence_thickness_texture: texture_2d<f32>;
@if(IRIDESCENCE_THICKNESS_TEXTURE) @group(3) @binding(32) var iridescence_thickness_sampler: sampler;
@if(ANISOTROPY_TEXTURE) @group(3) @binding(33) var anisotropy_texture: texture_2d<f32>;
@if(ANISOTROPY_TEXTURE) @group(3) @binding(34) var anisotropy_sampler: sampler;
@if(DIFFUSE_TRANSMISSION_TEXTURE) @group(3) @binding(35) var diffuse_transmission_texture: texture_2d<f32>;
@if(DIFFUSE_TRANSMISSION_TEXTURE) @group(3) @binding(36) var diffuse_transmission_sampler: sampler;
@if(DIFFUSE_TRANSMISSION_COLOR_TEXTURE) @group(3) @binding(37) var diffuse_transmission_color_texture: texture_2d<f32>;
@if(DIFFUSE_TRANSMISSION_COLOR_TEXTURE) @group(3) @binding(38) var diffuse_transmission_color_sampler: sampler;
@if(OUTLINE_WIDTH_TEXTURE) @group(3) @binding(39) var outline_width_texture: texture_2d<f32>;
@if(OUTLINE_WIDTH_TEXTURE) @group(3) @binding(40) var outline_width_sampler: sampler;
@if(UV_MASK) @group(3) @binding(41) var uv_mask_texture: texture_2d<f32>;
@if(UV_MASK) @group(3) @binding(42) var uv_mask_sampler: sampler;
@if(LAYERS) @group(3) @binding(43) var<uniform> layers: Layers;

@if(SHADOW) @group(2) @binding(0) var<uniform> shadow_views: array<ShadowView, 32>;
@if(SHADOW) @group(2) @binding(1) var shadow_map: texture_depth_2d;
@if(SHADOW) @group(2) @binding(2) var shadow_sampler: sampler_comparison;
@if(REFRACTION) @group(2) @binding(3) var behind_texture: texture_2d<f32>;
@if(REFRACTION) @group(2) @binding(4) var behind_sampler: sampler;

// Of one primitive, for each target: its first vertex, how many, where their offsets begin. Then the offsets of each target: positions,
// and as many normals and tangents where the mesh has them.
@if(MORPH) @group(1) @binding(0) var<storage, read> morphs: array<vec4<u32>>;
// Vertices of meshes that a compute stage posed; see posed.wgsl.
@if(POSED) @group(1) @binding(0) var<storage, read> posed: array<f32>;
