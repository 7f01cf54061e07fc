// effect: NAME
// about: a line around actors, equally wide at any distance
// version: 1
// hook: shell
// param width = 3 in 0..64: pixels of the image
// param pulse = 0 in 0..1: key it over time: how much wider it is now
// param color_r = 1 in 0..100: of the line: red, linear
// param color_g = 0.2 in 0..100: of the line: green, linear
// param color_b = 0.05 in 0..100: of the line: blue, linear
//
// A hull around surfaces of which the inside is seen: width (pixels), color (linear), lighting_mix (0: the color as it is, 1: times what the
// surface shows). Or -> Edges, the edges of triangles as lines of one pixel: return Edges(vec3(0.0, 1.0, 0.0)).
// Put it beside the script, into a folder plugins there, or name its folder with --plugins; then:
// effect("NAME", #{ color: "gold" }).on(anna).key("pulse", [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]])
fn effect(p: array<f32, 8>) -> Shell {
    return Shell(p[width] * (1.0 + p[pulse]), vec3(p[color_r], p[color_g], p[color_b]), 0.0);
}
