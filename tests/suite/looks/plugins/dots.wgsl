// effect: dots
// about: a row of dots beside each body, one above the other
// hook: overlay
// count: dots
// over: over
// param dots = 4 in 0..100: how many
// param size = 8 in 0..64: pixels of one
// param over = false: over the image, rather than hidden by what is nearer
// param color_r = 1 in 0..100: red, linear
// param color_g = 0 in 0..100: green, linear
// param color_b = 0 in 0..100: blue, linear
fn effect(index: u32, body: Body, p: array<f32, 8>) -> Line {
    let at = in_world(vec3(0.6, 0.3 * f32(index) + 0.2, 0.0));
    return Line(at, at, p[size], vec4(p[color_r], p[color_g], p[color_b], 1.0));
}
