// Effects on surfaces: the samples of a surface and of light that they read. Their functions are appended, and `surface_effects`
// and `light_effects`, which call them. CPU reference: `SurfaceSample` of core/plugin/src/effect_data.rs, filled in
// core/render/src/cpu/surface.rs.

@if(SURFACE)
struct Seen {
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
struct Falling {
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

fn seen_of(in: VertexOut, front: bool) -> Seen {
    var seen: Seen;
    seen.world = in.relative + frame.camera.xyz;
    seen.distance = select(-dot(in.relative, frame.eye.xyz), length(in.relative), frame.eye.w > 0.5);
    @if(NORMAL_OUT)
    seen.normal = unit(in.normal);
    seen.normal = select(-seen.normal, seen.normal, front);
    seen.facing = dot(seen.normal, unit(frame.eye.xyz - in.relative * frame.eye.w));
    @end
    seen.background = mix(frame.background_top.xyz, frame.background_bottom.xyz, in.position.y / frame.size.y);
    @if(SKY)
    if (sky.texel.z > 0.5) {
        seen.background = sky_mirrored(select(-frame.eye.xyz, in.relative, frame.eye.w > 0.5), 0.0);
        @if(EXPOSURE || VIEW_TRANSFORM) seen.background = displayed(seen.background);
    }
    @end
    @if(EFFECT_JOINTS) seen.joints = in.joints;
    @if(UV0) seen.uv = in.uv0;
    @if(EFFECT_SHADOW) seen.shadow = light_lost / max(light_whole, 1e-6);
    seen.viewer = seen.world - in.relative * frame.eye.w + frame.eye.xyz * seen.distance;
    return seen;
}
@end
