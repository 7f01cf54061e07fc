// effect: wireframe
// about: the edges of triangles as lines of one pixel
// hook: shell
// param color = rgb(0.02, 0.02, 0.02): of the lines
fn effect(p: array<f32, 8>) -> Edges {
    return Edges(vec3(p[color_r], p[color_g], p[color_b]));
}
