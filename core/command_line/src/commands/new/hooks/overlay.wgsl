// effect: NAME
// about: sparks that circle around an actor
// version: 0.1.0
// hook: overlay
// count: sparks
// param sparks = int(60) in 0..1000: number of sparks
// param turns = 0.25 in -10..10: turns per second
// param size = 5 px in 1..64: size of a spark
// param color = color(orange): color of the sparks
//
// Returns line number `index` of an actor; the header states how many there are (// count: NUMBER or a parameter). A Line has the ends a and b
// (world space, metres), width (pixels) and color (linear, with alpha); with a equal to b it is a point, with width 0 it is not drawn.
// With -> Triangle the function returns two-sided triangles: a, b, c, color.
// actor: time (seconds), position, low and high (bounding box), joints (number of bones), number (counts the actors with this effect).
// joint(i) is the position of a bone, parent(i) its parent or -1, in_world(p) a point of the actor's own space in the world.
// // over: true draws over everything; // joint hand = Hand: ABOUT declares hand(), the number of that joint; // history: 30 declares
// previous_joint(frames, i), its position that many frames ago; // of: scene draws once for the whole scene.
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then:
// effect("NAME", #{ color: "lime" }).on(anna)
fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line {
    let share = f32(index) / max(f32(p.sparks), 1.0);
    let extent = actor.high - actor.low;
    let middle = 0.5 * (actor.low + actor.high);
    let angle = 6.2831853 * (3.0 * share + p.turns * actor.time);
    let radius = 0.6 * max(extent.x, extent.z) + 0.05;
    let at = vec3(middle.x + radius * cos(angle), actor.low.y + share * extent.y, middle.z + radius * sin(angle));
    return Line(at, at, p.size, vec4(p.color, 1.0));
}
