// effect: xray
// about: transparent surfaces with bright edges
// hook: surface
// see_through: true
// param opacity = 0.08 in 0..1: opacity of surfaces that face the camera
// param power = 2 in 0.1..32: how narrow the edges are
// param color = rgb(0.25, 0.75, 1): color of the edges
fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    let edge = clamp(1.0 - abs(surface.facing), 0.0, 1.0);
    let share = pow(max(edge, 1e-6), p.power);
    return vec4<f32>(p.color, p.opacity + (1.0 - p.opacity) * share);
}
