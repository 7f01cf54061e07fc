// effect: ring
// about: a turning ring of beads around a body, and its line as the ground has it
// version: 1
// hook: overlay
// count: beads
// param beads = int(48) in 0..1000: how many
// param radius = 0.6 m in 0..10: of the ring
// param height = 0.02 m in -10..10: above the body's own ground
// param turns = 0.1 in -10..10: a second
// param size = 4 px in 0..64: of a bead
// param color = rgb(0.2, 0.9, 0.6): of the beads
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    let angle = 6.2831853 * (f32(index) / max(f32(p.beads), 1.0) + p.turns * actor.time);
    let at = in_world(vec3(p.radius * cos(angle), p.height, p.radius * sin(angle)));
    let pulse = 0.5 + 0.5 * sin(3.0 * angle + 4.0 * actor.time);
    return Line(at, at, p.size * (0.5 + pulse), vec4(p.color, 0.4 + 0.6 * pulse));
}
