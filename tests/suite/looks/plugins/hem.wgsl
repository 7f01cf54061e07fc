// effect: hem
// about: a line around bodies that grows with its parameter
// hook: shell
// param width = 2 in 0..20: pixels of the image
fn effect(p: array<f32, 8>) -> Shell {
    return Shell(p[width], vec3(0.02, 0.05 * p[width], 0.4), 0.0);
}
