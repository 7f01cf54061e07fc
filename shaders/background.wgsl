// A vertical gradient behind everything: one triangle at depth 0, drawn last where the depth is still 0, so that covered pixels
// cost nothing. CPU reference: core/render/src/cpu/mod.rs.

struct BackgroundOut {
    @builtin(position) position: vec4<f32>,
}

@vertex
fn background_vs(@builtin(vertex_index) index: u32) -> BackgroundOut {
    let x = f32(i32(index & 1u) * 4 - 1);
    let y = f32(i32(index >> 1u) * 4 - 1);
    return BackgroundOut(vec4(x, y, 0.0, 1.0));
}

@fragment
fn background_fs(in: BackgroundOut) -> @location(0) vec4<f32> {
    let t = in.position.y / frame.size.y;
    let color = mix(frame.background_top, frame.background_bottom, t);
    return shown_behind(color, in.position.xy);
}

// Final color of the background: after effects, and dithered if the target has 8 bits.
fn shown_behind(color: vec4<f32>, pixel: vec2<f32>) -> vec4<f32> {
    var shown = color;
    @if(SURFACE) shown = background_effects(shown, pixel);
    @if(DITHER) shown = to_dithered_codes(shown, pixel, 0.0);
    return shown;
}

@if(SURFACE)
// Applies the effects on everything to the background. CPU reference: core/render/src/cpu/background_effects.rs.
fn background_effects(color: vec4<f32>, pixel: vec2<f32>) -> vec4<f32> {
    // The rows of a perspective matrix without translation are orthogonal, except for the offset of a tile from the view axis.
    // Without that offset, dividing each row by its squared length inverts the matrix.
    let rows = transpose(frame.clip_from_relative);
    let back = rows[3].xyz;
    let beyond = vec2(dot(rows[0].xyz, back) + rows[0].w, dot(rows[1].xyz, back) + rows[1].w);
    let across = rows[0].xyz - back * beyond.x;
    let down = rows[1].xyz - back * beyond.y;
    let at = pixel / frame.size * 2.0 - 1.0 - beyond;
    let x = across * (at.x / max(dot(across, across), 1e-20));
    let y = down * (at.y / max(dot(down, down), 1e-20));
    let ahead = select(-frame.eye.xyz, rows[3].xyz + x + y, frame.eye.w > 0.5);
    let beside = select(x + y, vec3<f32>(0.0), frame.eye.w > 0.5);
    let way = ahead * inverseSqrt(max(dot(ahead, ahead), 1e-20));
    effect_at(pixel);
    var surface: SurfaceSample;
    surface.viewer = frame.camera.xyz + beside;
    // BACKGROUND_DISTANCE of core/plugin/src/effect_data.rs.
    surface.distance = 1e9;
    surface.world = surface.viewer + way * surface.distance;
    surface.background = color.rgb;
    return surface_effects(color, surface);
}
@end
