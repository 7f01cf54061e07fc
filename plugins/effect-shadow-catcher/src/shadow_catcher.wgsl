fn effect(color: vec4<f32>, seen: Seen, p: array<f32, 8>) -> vec4<f32> {
    return vec4(p[1], p[2], p[3], p[0] * seen.shadow);
}
