// effect: net
// about: the edges of triangles
// hook: shell
fn effect(p: Parameters) -> Edges {
    return Edges(vec3(0.0, 0.02, 0.2));
}
