// effect: old_photo
// about: brown shades, a bright middle and worn corners
// param amount = 1.0 in 0..1: how old it is
// param grain = 0.06 in 0..0.5: how coarse the paper is
//
// A function of one pixel; the same text runs on Vulkan and is evaluated on the CPU. Lesson 8 uses it.

fn noise(at: vec2<f32>) -> f32 {
    let cell = vec2<u32>(at * 997.0);
    var h = cell.x * 1664525u + cell.y * 1013904223u;
    h = (h ^ (h >> 15u)) * 2246822519u;
    h = (h ^ (h >> 13u)) * 3266489917u;
    return f32((h ^ (h >> 16u)) & 65535u) / 65535.0;
}

fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    let grey = dot(color.rgb, vec3(0.2126, 0.7152, 0.0722));
    let brown = grey * vec3(1.08, 0.95, 0.72);
    let worn = 1.0 - 0.7 * smoothstep(0.35, 0.95, length(uv * 2.0 - 1.0) * 0.7071);
    let paper = 1.0 + p.grain * (noise(uv) - 0.5);
    return vec4(mix(color.rgb, brown * worn * paper, p.amount), color.a);
}
