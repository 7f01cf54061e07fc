// effect: frame
// about: the box around all that is seen, as lines
// hook: overlay
// of: scene
// count: 12
fn corner(actor: ActorSample, bits: u32) -> vec3<f32> {
    let high = vec3((bits & 1u) != 0u, (bits & 2u) != 0u, (bits & 4u) != 0u);
    return select(actor.low, actor.high, high);
}

fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    // Four edges along each axis: the corner without that axis' bit, and with it.
    let axis = index / 4u;
    let others = index % 4u;
    let low = (1u << axis) - 1u;
    let bits = (others & low) | ((others & ~low) << 1u);
    return Line(corner(actor, bits), corner(actor, bits | (1u << axis)), 2.0, vec4(0.9, 0.1, 0.05, 1.0));
}
