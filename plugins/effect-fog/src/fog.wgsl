// Air that hides what is far. p: density, start, height, falloff, sky, color. Twin: `Fog::cpu_surface` in lib.rs.
fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32> {
    let metres = max(seen.distance - p[1], 0.0);
    let thinned = exp(-p[3] * max(seen.world.y - p[2], 0.0));
    let left = exp(-p[0] * thinned * metres);
    let fog = select(vec3<f32>(p[5], p[6], p[7]), seen.background, p[4] > 0.5);
    return vec4<f32>(fog + (color.rgb - fog) * left, color.a);
}
