// effect: NAME
// about: a line around actors, with the same width at every distance
// version: 0.1.0
// hook: outline
// param width = 3 px in 0..64: width of the line
// param pulse = 0 in 0..1: additional width, as a fraction; key it over time
// param color = color(tomato): color of the line
//
// Draws an inverted hull around surfaces as an outline: width (pixels), color (linear), lighting_mix (0: the plain color, 1: the color
// times that of the surface). With -> Wireframe the edges of triangles are drawn, one pixel wide: return Wireframe(vec3(0.0, 1.0, 0.0)).
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then:
// effect("NAME", #{ color: "gold" }).on(anna).key("pulse", [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]])
fn effect(p: Parameters) -> InvertedHull {
    return InvertedHull(p.width * (1.0 + p.pulse), p.color, 0.0);
}
