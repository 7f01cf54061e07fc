// effect: torch
// about: a point where a hand is
// hook: overlay
// count: 1
// joint hand = RightHand: where it burns
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    return Line(joint(hand()), joint(hand()), 8.0, vec4(1.0, 0.6, 0.1, 1.0));
}
