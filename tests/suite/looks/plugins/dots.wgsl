// effect: dots
// about: a row of dots beside each body, one above the other
// hook: overlay
// count: dots
// over: over
// param dots = 4 in 0..100: how many
// param size = 8 in 0..64: pixels of one
// param over = false: over the image, rather than hidden by what is nearer
// param color = rgb(1, 0, 0): of the dots
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    let at = in_world(vec3(0.6, 0.3 * f32(index) + 0.2, 0.0));
    return Line(at, at, p.size, vec4(p.color, 1.0));
}
