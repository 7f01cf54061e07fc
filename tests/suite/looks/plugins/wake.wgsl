// effect: wake
// about: where a hand was, frame by frame
// hook: overlay
// history: 20
// count: 20
// joint hand = mixamorig:RightHand: which
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    let color = vec4(0.9, 0.1, 0.05, 1.0 - f32(index) / 20.0);
    return Line(previous_joint(index, hand()), previous_joint(index + 1u, hand()), 3.0, color);
}
