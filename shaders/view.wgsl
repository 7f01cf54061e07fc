// The view transform from light to display colors, for lit surfaces and the sky. CPU reference:
// core/render/src/cpu/view_transform.rs.

@if(VIEW_TRANSFORM && !AGX)
// Khronos PBR Neutral Tone Mapper 1.0. A dielectric's reflection of 0.04 is taken off, so that a matte surface in even light shows its
// base color; from 0.76 on the brightest channel is compressed and the color turns pale; below, hue and saturation stay.
fn view_transform(light: vec3<f32>) -> vec3<f32> {
    // Bounded, so that infinite light does not become NaN below.
    var color = clamp(light, vec3(0.0), vec3(16777216.0));
    let least = min(color.x, min(color.y, color.z));
    let low = min(least, 0.08);
    color -= low - 6.25 * low * low;
    let peak = max(color.x, max(color.y, color.z));
    if (peak < 0.76) { return color; }
    let shown = 1.0 - 0.0576 / (peak - 0.52);
    let pale = 1.0 - 1.0 / (0.15 * (peak - shown) + 1.0);
    return mix(color * (shown / peak), vec3(shown), pale);
}
@end

@if(AGX)
// Troy Sobotka's AgX by Benjamin Wrensch's polynomial ("Minimal AgX Implementation", 2023), as in plugins/effects/tonemap.wgsl.
fn view_transform(light: vec3<f32>) -> vec3<f32> {
    let color = clamp(light, vec3(0.0), vec3(16777216.0));
    let inset = vec3(
        dot(vec3(0.84247905, 0.0784336, 0.079223745), color),
        dot(vec3(0.042328242, 0.8784686, 0.07916613), color),
        dot(vec3(0.042375655, 0.0784336, 0.879143), color),
    );
    let x = clamp((log2(max(inset, vec3(1e-10))) + 12.47393) / 16.5, vec3(0.0), vec3(1.0));
    let x2 = x * x;
    let x4 = x2 * x2;
    let y = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let out = vec3(
        dot(vec3(1.196879, -0.09802088, -0.09902974), y),
        dot(vec3(-0.052896852, 1.1519032, -0.098961174), y),
        dot(vec3(-0.052971636, -0.09804345, 1.1510737), y),
    );
    // The curve gives codes of a display with gamma 2.2; the image is linear.
    return clamp(pow(max(out, vec3(0.0)), vec3(2.2)), vec3(0.0), vec3(1.0));
}
@end

@if(EXPOSURE || VIEW_TRANSFORM)
// Display color of the sky's light.
fn displayed(light: vec3<f32>) -> vec3<f32> {
    var color = light;
    @if(EXPOSURE) color *= frame.exposure;
    @if(VIEW_TRANSFORM) color = view_transform(color);
    return color;
}
@end
