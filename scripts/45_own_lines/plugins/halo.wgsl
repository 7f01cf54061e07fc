// effect: halo
// about: a line around actors that widens
// version: 1
// hook: outline
// param width = 2 px in 0..30: width of the line
// param color = rgb(0.9, 0.8, 0.3): color of the line
fn effect(p: Parameters) -> InvertedHull {
    return InvertedHull(p.width, p.color, 0.0);
}
