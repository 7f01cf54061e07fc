// effect: ring
// about: a turning ring of beads around a body, and its line as the ground has it
// version: 1
// hook: overlay
// count: beads
// param beads = 48 in 0..1000: how many
// param radius = 0.6 in 0..10: metres
// param height = 0.02 in -10..10: metres above the body's own ground
// param turns = 0.1 in -10..10: a second
// param size = 4 in 0..64: pixels of a bead
// param color_r = 0.2 in 0..100: red, linear
// param color_g = 0.9 in 0..100: green, linear
// param color_b = 0.6 in 0..100: blue, linear
fn effect(index: u32, body: Body, p: array<f32, 8>) -> Line {
    let angle = 6.2831853 * (f32(index) / max(p[beads], 1.0) + p[turns] * body.time);
    let at = in_world(vec3(p[radius] * cos(angle), p[height], p[radius] * sin(angle)));
    let pulse = 0.5 + 0.5 * sin(3.0 * angle + 4.0 * body.time);
    return Line(at, at, p[size] * (0.5 + pulse), vec4(p[color_r], p[color_g], p[color_b], 0.4 + 0.6 * pulse));
}
