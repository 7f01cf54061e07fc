// Effects on surfaces: the samples of a surface and of light that they read. Their functions are appended, and `surface_effects`
// and `light_effects`, which call them. CPU reference: `SurfaceSample` of core/plugin/src/effect_data.rs, filled in
// core/render/src/cpu/surface.rs.

@if(SURFACE)
struct SurfaceSample {
    world: vec3<f32>,
    distance: f32,
    normal: vec3<f32>,
    facing: f32,
    background: vec3<f32>,
    joints: vec3<f32>,
    uv: vec2<f32>,
    shadow: f32,
    viewer: vec3<f32>,
}
@end

@if(LIGHTING)
struct LightSample {
    cosine: f32,
    share: f32,
    color: vec3<f32>,
    base: vec3<f32>,
    normal: vec3<f32>,
    viewer: vec3<f32>,
    light: vec3<f32>,
    lit: vec3<f32>,
}
@end

@if(TEXTURES) @group(0) @binding(8) var<storage, read> effect_texels: array<vec2<u32>>;

@if(FAULT_RECORDS) @group(0) @binding(10) var<storage, read_write> effect_faults: array<atomic<u32>>;

@if(EFFECTS)
// The largest displacement of up to eight effects in two rows; then the parameters of each effect. Functions that read them are
// appended.
@group(0) @binding(6) var<uniform> surface_parameters: array<vec4<f32>, surface_rows>;

@end

@if(SURFACE && POSITION_OUT)
@if(EFFECT_SHADOW) var<private> light_whole: f32;
@if(EFFECT_SHADOW) var<private> light_lost: f32;

fn surface_sample(in: VertexOut, front: bool) -> SurfaceSample {
    var surface: SurfaceSample;
    surface.world = in.relative + frame.camera.xyz;
    surface.distance = select(-dot(in.relative, frame.eye.xyz), length(in.relative), frame.eye.w > 0.5);
    @if(NORMAL_OUT)
    surface.normal = unit(in.normal);
    surface.normal = select(-surface.normal, surface.normal, front);
    surface.facing = dot(surface.normal, unit(frame.eye.xyz - in.relative * frame.eye.w));
    @end
    surface.background = mix(frame.background_top.xyz, frame.background_bottom.xyz, in.position.y / frame.size.y);
    @if(SKY)
    if (sky.texel.z > 0.5) {
        surface.background = sky_mirrored(select(-frame.eye.xyz, in.relative, frame.eye.w > 0.5), 0.0);
        @if(EXPOSURE || VIEW_TRANSFORM) surface.background = displayed(surface.background);
    }
    @end
    @if(EFFECT_JOINTS) surface.joints = in.joints;
    @if(UV0) surface.uv = in.uv0;
    @if(EFFECT_SHADOW) surface.shadow = light_lost / max(light_whole, 1e-6);
    surface.viewer = surface.world - in.relative * frame.eye.w + frame.eye.xyz * surface.distance;
    return surface;
}
@end
