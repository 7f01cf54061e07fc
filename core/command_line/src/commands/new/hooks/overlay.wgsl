// effect: NAME
// about: sparks that circle around an actor
// version: 0.1.0
// hook: overlay
// count: sparks
// param sparks = int(60) in 0..1000: how many
// param turns = 0.25 in -10..10: how often they go around a second
// param size = 5 px in 1..64: of a spark
// param color = color(orange): of the sparks
//
// One line of the effect's own, the index-th of // count: NUMBER or a parameter: its ends a and b (metres in the world), width (pixels), color
// (linear, with alpha); a point where both ends are one; none of width 0. Or -> Triangle, both faces seen: a, b, c, color.
// body: time (seconds), place, low and high (its box), joints (how many bones), number (which of the actors that have it). joint(i) is where a
// bone stands, parent(i) the bone above it or -1, in_world(place) a place in the body's own space. // over: true draws over everything
// else; // joint hand = Hand: ABOUT gives hand(), the number of that joint; // history: 30 gives previous_joint(frames, i), where it was so
// many frames ago; // of: scene draws once for all of the scene. Put it beside the script, into a folder plugins there, or name its folder with --plugins; then:
// effect("NAME", #{ color: "lime" }).on(anna)
fn effect(index: u32, body: Body, p: Parameters) -> Line {
    let share = f32(index) / max(f32(p.sparks), 1.0);
    let extent = body.high - body.low;
    let middle = 0.5 * (body.low + body.high);
    let angle = 6.2831853 * (3.0 * share + p.turns * body.time);
    let radius = 0.6 * max(extent.x, extent.z) + 0.05;
    let at = vec3(middle.x + radius * cos(angle), body.low.y + share * extent.y, middle.z + radius * sin(angle));
    return Line(at, at, p.size, vec4(p.color, 1.0));
}
