// Seen through but for the edges. p: opacity, power, color. Twin: `Xray::cpu_surface` in lib.rs.
fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32> {
    let edge = clamp(1.0 - abs(seen.facing), 0.0, 1.0);
    let share = pow(max(edge, 1e-6), p[1]);
    return vec4<f32>(p[2], p[3], p[4], p[0] + (1.0 - p[0]) * share);
}
