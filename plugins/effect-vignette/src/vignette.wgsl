// Darkens towards the corners. p[0] strength, p[1] radius. Twin: `Vignette::cpu` in lib.rs.
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    let from_middle = length(uv * 2.0 - 1.0) * 0.70710678;
    let x = clamp((from_middle - p[1]) / (1.0 - p[1]), 0.0, 1.0);
    let light = 1.0 - p[0] * (x * x * (3.0 - 2.0 * x));
    return vec4<f32>(color.rgb * light, color.a);
}
