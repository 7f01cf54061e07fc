// effect: wireframe
// about: the edges of triangles as lines of one pixel
// hook: outline
// param color = rgb(0.02, 0.02, 0.02): color of the lines
fn effect(p: Parameters) -> Wireframe {
    return Wireframe(p.color);
}
