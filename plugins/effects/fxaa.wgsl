// effect: fxaa
// about: smooths jagged edges, from the finished image alone
// hook: image
// param contrast = 0.125 in 0.01..1: smallest difference in brightness that counts as an edge, relative to the brightest pixel
// param span = 3 in 1..16: longest search along an edge, in pixels of the rendered image
//
// Timothy Lottes, "FXAA", NVIDIA 2009, in its first, short form: the mean of two or four samples along the edge.

// Brightness as the eye has it: the square root stands in for the display's curve.
fn brightness(c: vec4<f32>) -> f32 {
    return sqrt(dot(clamp(c.rgb, vec3<f32>(0.0), vec3<f32>(1.0)), vec3<f32>(0.299, 0.587, 0.114)));
}

// Between the four pixels around a place; centers of pixels are whole numbers.
fn between(at: vec2<f32>) -> vec4<f32> {
    let first = floor(at);
    let i = vec2<i32>(first);
    let f = at - first;
    let top = picture(i) * (1.0 - f.x) + picture(i + vec2<i32>(1, 0)) * f.x;
    let bottom = picture(i + vec2<i32>(0, 1)) * (1.0 - f.x) + picture(i + vec2<i32>(1, 1)) * f.x;
    return top * (1.0 - f.y) + bottom * f.y;
}

fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let here = picture(at);
    let nw = brightness(picture(at + vec2<i32>(-1, -1)));
    let ne = brightness(picture(at + vec2<i32>(1, -1)));
    let sw = brightness(picture(at + vec2<i32>(-1, 1)));
    let se = brightness(picture(at + vec2<i32>(1, 1)));
    let m = brightness(here);
    let low = min(m, min(min(nw, ne), min(sw, se)));
    let high = max(m, max(max(nw, ne), max(sw, se)));
    // Drivers that draw on the CPU leave a loop that no pixel of a group needs after one turn, but execute both sides of a branch.
    let samples = select(4, 0, high - low < max(high * p.contrast, 1.0 / 32.0));
    let way = vec2<f32>((sw + se) - (nw + ne), (nw + sw) - (ne + se));
    let reduce = max((nw + ne + sw + se) * 0.03125, 1.0 / 128.0);
    let scale = 1.0 / (min(abs(way.x), abs(way.y)) + reduce);
    let along = clamp(way * scale, vec2<f32>(-p.span), vec2<f32>(p.span));
    let middle = vec2<f32>(at);
    var inner = vec4<f32>(0.0);
    var outer = vec4<f32>(0.0);
    for (var i = 0; i < samples; i++) {
        let share = select(select(0.5, -0.5, i == 2), select(f32(2.0) / 3.0 - 0.5, f32(1.0) / 3.0 - 0.5, i == 0), i < 2);
        let c = between(middle + along * share);
        inner += select(vec4<f32>(0.0), c, i < 2);
        outer += select(c, vec4<f32>(0.0), i < 2);
    }
    if (samples == 0) { return here; }
    let near = inner * 0.5;
    let far = near * 0.5 + outer * 0.25;
    let of_far = brightness(far);
    if (of_far < low || of_far > high) { return near; }
    return far;
}
