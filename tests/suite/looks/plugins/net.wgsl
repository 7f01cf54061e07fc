// effect: net
// about: the edges of triangles
// hook: shell
fn effect(p: array<f32, 8>) -> Edges {
    return Edges(vec3(0.0, 0.02, 0.2));
}
