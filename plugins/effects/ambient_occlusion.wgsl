// effect: ambient_occlusion
// about: darkens creases and contacts, where nearby surfaces block ambient light
// hook: image
// view: before
// passes: 3
// off: strength = 0
// param strength = 1 in 0..4: how dark creases become
// param radius = 0.5 m in 0.01..20: how far surfaces darken each other
// param samples = int(16) in 4..64: samples per pixel
// param bias = 0.02 m in 0..1: height above a surface that causes no darkening; hides the facets of round meshes
//
// Scalable Ambient Obscurance (McGuire, Mara, Luebke, "Scalable Ambient Obscurance", HPG 2012, §2.3): samples on a spiral around the
// pixel, each weighed by how near it is and how far above the tangent plane. Then a blur across and down that
// stays on surfaces of about the same depth.

fn obscured(at: vec2<i32>, count: i32, radius: f32, bias: f32) -> f32 {
    let c = view_at(at);
    if (c.z < -1e8) { return 0.0; }
    let n = (view_from_world() * vec4<f32>(normal_at(at), 0.0)).xyz;
    let pixels = min(abs(pixel_of(c + vec3<f32>(radius, 0.0, 0.0)).x - pixel_of(c).x), 0.25 * resolution().y);
    if (pixels < 1.0) { return 0.0; }
    // Interleaved gradient noise (Jimenez, "Next Generation Post Processing in Call of Duty", SIGGRAPH 2014) turns the spiral.
    let turn = 6.2831853 * fract(52.9829189 * fract(dot(vec2<f32>(at), vec2<f32>(0.06711056, 0.00583715))));
    let r2 = radius * radius;
    var sum = 0.0;
    for (var i = 0; i < count; i++) {
        let share = (f32(i) + 0.5) / f32(count);
        let angle = share * 6.2831853 * 7.0 + turn;
        let v = view_at(at + vec2<i32>(round(share * pixels * vec2<f32>(cos(angle), sin(angle))))) - c;
        let vv = dot(v, v);
        let near = max(r2 - vv, 0.0);
        sum += near * near * near * max((dot(v, n) - bias) / (vv + 0.01 * r2), 0.0);
    }
    return sum * 5.0 * radius / (r2 * r2 * r2 * f32(count));
}

// Mean along a line over pixels of about the same depth.
fn blurred(at: vec2<i32>, along: vec2<i32>, radius: f32) -> f32 {
    let depth = depth_at(at);
    var sum = 0.0;
    var weights = 0.0;
    for (var i = -4; i <= 4; i++) {
        let there = at + i * along;
        let same = max(1.0 - abs(depth_at(there) - depth) / (0.25 * radius), 0.0);
        let weight = exp(-0.08 * f32(i * i)) * same;
        sum += weight * picture(there).r;
        weights += weight;
    }
    return sum / max(weights, 1e-6);
}

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    if (pass_number == 0u) {
        let dark = p.strength * obscured(at, p.samples, p.radius, p.bias);
        return vec4<f32>(max(1.0 - dark, 0.0));
    }
    if (pass_number == 1u) { return vec4<f32>(blurred(at, vec2<i32>(1, 0), p.radius)); }
    let color = original(at);
    return vec4<f32>(color.rgb * blurred(at, vec2<i32>(0, 1), p.radius), color.a);
}
