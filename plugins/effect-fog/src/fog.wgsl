// Air that hides what is far. p: density, start, height, falloff, sky, color. Twin: `Fog::cpu_surface` in lib.rs.

// How much of unit density lies below a height above the one from which the fog thins.
fn fog_up_to(y: f32, falloff: f32) -> f32 {
    if (y > 0.0) { return (1.0 - exp(-falloff * y)) / falloff; }
    return y;
}

fn mean_density(start: f32, end: f32, falloff: f32) -> f32 {
    let rise = end - start;
    // Their difference would be rounding only.
    if (abs(rise) * falloff < 0.02) { return exp(-falloff * max((start + end) * 0.5, 0.0)); }
    return (fog_up_to(end, falloff) - fog_up_to(start, falloff)) / rise;
}

fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32> {
    let metres = max(seen.distance - p[1], 0.0);
    let start = mix(seen.viewer.y, seen.world.y, min(p[1] / max(seen.distance, 1e-6), 1.0));
    let left = exp(-p[0] * metres * mean_density(start - p[2], seen.world.y - p[2], p[3]));
    let fog = select(vec3<f32>(p[5], p[6], p[7]), seen.background, p[4] > 0.5);
    return vec4<f32>(fog + (color.rgb - fog) * left, color.a);
}
