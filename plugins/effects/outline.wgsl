// effect: outline
// about: a line around actors, equally wide at any distance
// hook: outline
// off: width = 0
// param width = 2 px in 0..64: width of the line, in pixels of the image
// param color = rgb(0, 0, 0): color of the line
// param light = 0 in 0..1: 0: the color as it is, 1: multiplied by the lit color of the surface
fn effect(p: Parameters) -> InvertedHull {
    return InvertedHull(p.width, p.color, p.light);
}
