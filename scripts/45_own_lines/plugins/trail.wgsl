// effect: trail
// about: a ribbon along the path of a hand during the last second
// version: 1
// hook: overlay
// history: 30
// count: 60
// joint hand = mixamorig:RightHand|hand.r: what it hangs on
// joint arm = mixamorig:RightForeArm|lowerarm.r: the ribbon's other edge is on the way there
// param width = 0.5 in 0..1: width of the ribbon, as a fraction of the distance from hand to arm
// param color = rgb(1, 0.55, 0.1): color of the ribbon
//
// Two triangles from each frame to the frame before it, fainter the older they are.
fn edge(frames: u32, p: Parameters) -> vec3<f32> {
    return mix(previous_joint(frames, hand()), previous_joint(frames, arm()), p.width);
}

fn effect(index: u32, actor: ActorSample, p: Parameters) -> Triangle {
    let frames = index / 2u;
    let tip = previous_joint(frames, hand());
    let inner = edge(frames + 1u, p);
    let fade = 1.0 - f32(frames) / 30.0;
    let color = vec4(p.color, 0.7 * fade * fade);
    if index % 2u == 0u {
        return Triangle(tip, previous_joint(frames + 1u, hand()), inner, color);
    }
    return Triangle(tip, inner, edge(frames, p), color);
}
