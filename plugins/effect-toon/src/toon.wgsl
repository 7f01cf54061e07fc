// Light in steps. p: steps, softness, white. Twin: `Toon::cpu_surface` in lib.rs.
fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32> {
    let light = max(max(color.r, max(color.g, color.b)), 1e-6);
    let at = sqrt(min(light / p[2], 1.0)) * p[0];
    let step = min(floor(at), p[0] - 1.0);
    let edge = clamp((at - step - (1.0 - p[1])) / max(p[1], 1e-4), 0.0, 1.0);
    let up = edge * edge * (3.0 - 2.0 * edge);
    let flat_light = max(min(step + 0.5 + up, p[0] - 0.5), 0.5) / p[0];
    return vec4<f32>(color.rgb * (flat_light * flat_light * p[2] / light), color.a);
}
