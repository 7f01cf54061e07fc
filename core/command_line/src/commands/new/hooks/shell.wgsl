// effect: NAME
// about: a line around actors, equally wide at any distance
// version: 0.1.0
// hook: shell
// param width = 3 px in 0..64: of the line
// param pulse = 0 in 0..1: key it over time: how much wider it is now
// param color = color(tomato): of the line
//
// A hull around surfaces of which the inside is seen: width (pixels), color (linear), lighting_mix (0: the color as it is, 1: times what the
// surface shows). Or -> Edges, the edges of triangles as lines of one pixel: return Edges(vec3(0.0, 1.0, 0.0)).
// Put it beside the script, into a folder plugins there, or name its folder with --plugins; then:
// effect("NAME", #{ color: "gold" }).on(anna).key("pulse", [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]])
fn effect(p: Parameters) -> Shell {
    return Shell(p.width * (1.0 + p.pulse), p.color, 0.0);
}
