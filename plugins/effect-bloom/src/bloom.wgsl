// Light that spills over. p: strength, threshold, radius. Twin: `Bloom::cpu_picture` in lib.rs.
fn bright(color: vec4<f32>, threshold: f32) -> vec3<f32> {
    let c = clamp(color.rgb, vec3<f32>(0.0), vec3<f32>(1000.0));
    let most = max(c.r, max(c.g, c.b));
    return c * (max(most - threshold, 0.0) / max(most, 1e-6));
}

fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> {
    let step = max(p[2] * post.size.y / 16.0, 1.0);
    var sum = vec3<f32>(0.0);
    var weights = 0.0;
    for (var i = -16; i <= 16; i++) {
        let t = f32(i) * (3.0 / 16.0);
        let weight = exp(-0.5 * t * t);
        let away = i32(floor(f32(i) * step + 0.5));
        if (pass_number == 0u) {
            sum += weight * bright(picture(at + vec2<i32>(away, 0)), p[1]);
        } else {
            sum += weight * picture(at + vec2<i32>(0, away)).rgb;
        }
        weights += weight;
    }
    let blurred = sum / weights;
    if (pass_number == 0u) { return vec4<f32>(blurred, 1.0); }
    let here = original(at);
    return vec4<f32>(here.rgb + blurred * p[0], here.a);
}
