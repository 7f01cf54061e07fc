// effect: outline
// about: a line around actors, as wide wherever they stand
// hook: outline
// off: width = 0
// param width = 2 px in 0..64: pixels of the image
// param color = rgb(0, 0, 0): of the line
// param light = 0 in 0..1: 0: the color as it is, 1: times what the surface shows
fn effect(p: Parameters) -> InvertedHull {
    return InvertedHull(p.width, p.color, p.light);
}
