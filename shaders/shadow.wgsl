// Shadow maps: how they are looked up, and what is drawn into them. CPU reference: core/render/src/cpu/shadow.rs.

@if(SHADOW)
// How much of a light arrives at a place, 0 to 1. `n`: the surface's own normal, without normal map; `l`: to the light.
fn shadow_share(light: Light, relative: vec3<f32>, n: vec3<f32>, l: vec3<f32>) -> f32 {
    let first = light.shadow_views & 0xffffu;
    let end = first + (light.shadow_views >> 16u);
    let nl = clamp(dot(n, l), 0.0, 1.0);
    // A slope's depth changes by tan over a texel; a step of as many texels as the filter reaches along the normal, times
    // the sine, makes up for it at every angle (Holbert, "Saying Goodbye to Shadow Acne", GDC 2011).
    let slope = 3.0 * sqrt(1.0 - nl * nl);
    for (var i = first; i < end; i++) {
        let view = shadow_views[i];
        let here = view.texel_from_relative * vec4(relative, 1.0);
        let texel = view.texel.x * here.w;
        let moved = relative + n * (slope * texel) + l * (0.25 * texel);
        let p = view.texel_from_relative * vec4(moved, 1.0);
        let at = p.xyz / max(p.w, 1e-6);
        if (p.w > 0.0 && all(at.xy >= view.inside.xy) && all(at.xy <= view.inside.zw)) {
            return shadow_filtered(at, view.texel.zw);
        }
    }
    return 1.0;
}

// A box of 3 × 3 texels moved over the depth comparisons of 4 × 4: weights 1 − f, 1, 1, f.
fn shadow_filtered(at: vec3<f32>, scale: vec2<f32>) -> f32 {
    let corner = floor(at.xy - 0.5);
    let f = at.xy - 0.5 - corner;
    let depth = max(at.z, 0.0);
    // Each gather stands on the corner between four texels: x, y, z, w are lower left, lower right, upper right, upper left.
    let a = textureGatherCompare(shadow_map, shadow_sampler, corner * scale, depth);
    let b = textureGatherCompare(shadow_map, shadow_sampler, (corner + vec2(2.0, 0.0)) * scale, depth);
    let c = textureGatherCompare(shadow_map, shadow_sampler, (corner + vec2(0.0, 2.0)) * scale, depth);
    let d = textureGatherCompare(shadow_map, shadow_sampler, (corner + 2.0) * scale, depth);
    let x = vec4(1.0 - f.x, 1.0, 1.0, f.x);
    let rows = vec4(
        dot(x, vec4(a.w, a.z, b.w, b.z)),
        dot(x, vec4(a.x, a.y, b.x, b.y)),
        dot(x, vec4(c.w, c.z, d.w, d.z)),
        dot(x, vec4(c.x, c.y, d.x, d.y)),
    );
    return dot(rows, vec4(1.0 - f.y, 1.0, 1.0, f.y)) / 9.0;
}
@end

@if(SHADOW_PASS && ALPHA_MASK)
@fragment
fn shadow_fs(in: VertexOut) {
    @if(UV_MOTION_MASK) read_uv_mask(in);
    var alpha = material.base_color.a;
    @if(VERTEX_COLOR) alpha *= in.color.a;
    @if(TRIPLANAR) read_planes(in);
    @if(BASE_COLOR_TEXTURE && TRIPLANAR) alpha *= from_three_sides(base_color_texture, base_color_sampler, 0u).a;
    @if(BASE_COLOR_TEXTURE && !TRIPLANAR) alpha *= textureSample(base_color_texture, base_color_sampler, texture_uv(in, 0u)).a;
    if (alpha < material.alpha_cutoff) { discard; }
}
@end
