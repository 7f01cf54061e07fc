// effect: film_grain
// about: grain of photographic film, different in each frame
// hook: image
// off: strength = 0
// param strength = 0.03 in 0..1: strength of the grain: standard deviation at medium gray, as a share of white
// param size = 1.5 px in 1..32: width of a grain
// param colored = false: each color channel has its own grain
// param still = false: every frame has the grain of the first
//
// Noise by a hash of pixel and frame (PCG3D: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 2020), so each frame has
// the same grain however often it is drawn. It is added to the square root of the light, about as bright as it looks, and
// fades in black and white, where film is clear or dense all over.

fn pcg3d(seed: vec3<u32>) -> vec3<u32> {
    var v = seed * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v = v ^ (v >> vec3<u32>(16u));
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// Three numbers with mean 0 and variance 1, each from −√3 to √3.
fn noise(cell: vec2<i32>, number: u32) -> vec3<f32> {
    let bits = pcg3d(vec3<u32>(vec2<u32>(cell + 65536), number));
    return (vec3<f32>(bits >> vec3<u32>(8u)) / 16777216.0 - 0.5) * 3.4641016;
}

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let color = picture(at);
    let number = select(frame(), 0u, p.still);
    let place = vec2<f32>(at) / p.size;
    let cell = vec2<i32>(floor(place));
    let f = place - floor(place);
    let a = (1.0 - f.x) * (1.0 - f.y);
    let b = f.x * (1.0 - f.y);
    let c = (1.0 - f.x) * f.y;
    let d = f.x * f.y;
    let sum = a * noise(cell, number) + b * noise(cell + vec2<i32>(1, 0), number)
        + c * noise(cell + vec2<i32>(0, 1), number) + d * noise(cell + vec2<i32>(1, 1), number);
    // The variance of a mean is smaller: made 1 again.
    var grain = sum / sqrt(a * a + b * b + c * c + d * d);
    if (!p.colored) { grain = vec3<f32>(grain.x); }
    let root = sqrt(clamp(color.rgb, vec3<f32>(0.0), vec3<f32>(1.0)));
    let amount = p.strength * 2.0 * sqrt(root * (1.0 - root));
    let grained = clamp(root + amount * grain, vec3<f32>(0.0), vec3<f32>(1.0));
    return vec4<f32>(select(grained * grained, color.rgb, color.rgb > vec3<f32>(1.0)), color.a);
}
