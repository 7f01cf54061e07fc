// effect: ring
// about: a rotating ring of beads around an actor
// version: 1
// hook: overlay
// count: beads
// param beads = int(48) in 0..1000: number of beads
// param radius = 0.6 m in 0..10: radius of the ring
// param height = 0.02 m in -10..10: height above the actor's origin
// param turns = 0.1 in -10..10: rotations per second
// param size = 4 px in 0..64: size of a bead
// param color = rgb(0.2, 0.9, 0.6): color of the beads
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    let angle = 6.2831853 * (f32(index) / max(f32(p.beads), 1.0) + p.turns * actor.time);
    let at = in_world(vec3(p.radius * cos(angle), p.height, p.radius * sin(angle)));
    let pulse = 0.5 + 0.5 * sin(3.0 * angle + 4.0 * actor.time);
    return Line(at, at, p.size * (0.5 + pulse), vec4(p.color, 0.4 + 0.6 * pulse));
}
