// effect: hem
// about: a line around bodies that grows with its parameter
// hook: outline
// param width = 2 in 0..20: pixels of the image
fn effect(p: array<f32, 8>) -> InvertedHull {
    return InvertedHull(p[width], vec3(0.02, 0.05 * p[width], 0.4), 0.0);
}
