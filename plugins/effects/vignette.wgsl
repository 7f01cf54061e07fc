// effect: vignette
// about: darkens the image towards its corners
// off: strength = 0
// param strength = 0.35 in 0..1: how much of the light the corners lose, 0 = none, 1 = all
// param radius = 0.5 in 0..0.99: where the darkening starts, as a part of the distance from the middle to a corner
fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    let from_middle = length(uv * 2.0 - 1.0) * 0.70710678;
    let x = clamp((from_middle - p.radius) / (1.0 - p.radius), 0.0, 1.0);
    let light = 1.0 - p.strength * (x * x * (3.0 - 2.0 * x));
    return vec4<f32>(color.rgb * light, color.a);
}
