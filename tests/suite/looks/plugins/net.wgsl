// effect: net
// about: the edges of triangles
// hook: outline
fn effect(p: Parameters) -> Wireframe {
    return Wireframe(vec3(0.0, 0.02, 0.2));
}
