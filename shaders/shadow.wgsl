// Lookup of shadow maps, and the fragment shader that draws them. CPU reference: core/render/src/cpu/shadow.rs.

@if(SHADOW)
// Share of a light that reaches a point, 0 to 1. `n`: normal without the normal map; `l`: to the light.
fn shadow_share(light: Light, relative: vec3<f32>, n: vec3<f32>, l: vec3<f32>) -> f32 {
    let first = light.shadow_views & 0xffffu;
    let end = first + (light.shadow_views >> 16u);
    let nl = clamp(dot(n, l), 0.0, 1.0);
    // Normal offset (Holbert, "Saying Goodbye to Shadow Acne", GDC 2011): the depth of a slope changes by tan over a texel. An
    // offset along the normal by the filter's reach in texels, times the sine, compensates this at every angle.
    let slope = 3.0 * sqrt(1.0 - nl * nl);
    for (var i = first; i < end; i++) {
        let view = shadow_views[i];
        let here = view.texel_from_relative * vec4(relative, 1.0);
        let texel = view.texel.x * here.w;
        let moved = relative + n * (slope * texel) + l * (0.25 * texel);
        let p = view.texel_from_relative * vec4(moved, 1.0);
        let at = p.xyz / max(p.w, 1e-6);
        // A point beyond the depth range of this map lies in a later one.
        if (p.w > 0.0 && at.z >= 0.0 && all(at.xy >= view.inside.xy) && all(at.xy <= view.inside.zw)) {
            if (view.texel.y == 0.0) { return shadow_filtered(at, view.texel.zw); }
            let slope = shadow_slope(view, n);
            let width = penumbra_width(at, slope, view.texel.y);
            if (width <= 3.0) { return shadow_filtered(at, view.texel.zw); }
            return penumbra_filtered(at, slope, width, view.texel.zw);
        }
    }
    return 1.0;
}

// Widest penumbra in texels.
const MAX_PENUMBRA = 12.0;

// Change of a surface's depth per texel in x and y, limited to that of a surface at 79° to the light.
fn shadow_slope(view: ShadowView, n: vec3<f32>) -> vec2<f32> {
    let rows = transpose(view.texel_from_relative);
    let z = rows[2].xyz;
    let nz = max(dot(n, z), 0.2 * length(z));
    return -vec2(dot(n, rows[0].xyz), dot(n, rows[1].xyz)) * (view.texel.x * view.texel.x * dot(z, z) / nz);
}

// Width of the penumbra in texels, from the mean distance of the blockers among 4 × 4 texels (Fernando, "Percentage-Closer Soft
// Shadows", 2005). The 4 × 4 texels span the widest penumbra, so that none begins with a step. The narrowest, 3, if all or none
// of them are blockers.
fn penumbra_width(at: vec3<f32>, slope: vec2<f32>, texels_per_depth: f32) -> f32 {
    var sum = 0.0;
    var count = 0.0;
    for (var y = 0; y < 4; y++) {
        for (var x = 0; x < 4; x++) {
            let off = (vec2(f32(x), f32(y)) - 1.5) * (MAX_PENUMBRA / 3.0);
            let texel = floor(at.xy + off);
            let depth = at.z + dot(slope, texel + 0.5 - at.xy);
            let found = textureLoad(shadow_map, vec2<i32>(texel), 0);
            if (found > depth) {
                sum += found - depth;
                count += 1.0;
            }
        }
    }
    if (count == 0.0 || count == 16.0) { return 3.0; }
    return clamp(sum / count * texels_per_depth, 3.0, MAX_PENUMBRA);
}

// Box filter of width × width texels. The compared depth follows the surface in steps of 2 × 2 texels.
fn penumbra_filtered(at: vec3<f32>, slope: vec2<f32>, width: f32, scale: vec2<f32>) -> f32 {
    let low = at.xy - 0.5 * width;
    let high = at.xy + 0.5 * width;
    let first = floor(low);
    let texels = vec2<i32>(floor(high) - first) + 1;
    var sum = 0.0;
    for (var y = 0; y < texels.y; y += 2) {
        for (var x = 0; x < texels.x; x += 2) {
            let corner = first + vec2(f32(x), f32(y)) + 1.0;
            let depth = max(at.z + dot(slope, corner - at.xy), 0.0);
            let lit = textureGatherCompare(shadow_map, shadow_sampler, corner * scale, depth);
            let left = clamp(min(corner, high) - max(corner - 1.0, low), vec2(0.0), vec2(1.0));
            let right = clamp(min(corner + 1.0, high) - max(corner, low), vec2(0.0), vec2(1.0));
            let wx = vec4(left.x, right.x, right.x, left.x);
            sum += dot(wx * vec4(right.y, right.y, left.y, left.y), lit);
        }
    }
    return sum / (width * width);
}

// Box filter of 3 × 3 texels over 4 × 4 depth comparisons, weighted 1 − f, 1, 1, f.
fn shadow_filtered(at: vec3<f32>, scale: vec2<f32>) -> f32 {
    let corner = floor(at.xy - 0.5);
    let f = at.xy - 0.5 - corner;
    let depth = max(at.z, 0.0);
    // Each gather reads the four texels around a corner: x, y, z, w are lower left, lower right, upper right, upper left.
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
