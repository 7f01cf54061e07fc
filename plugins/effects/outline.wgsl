// effect: outline
// about: a line around actors, as wide wherever they stand
// hook: shell
// off: width = 0
// param width = 2 in 0..64: pixels of the image
// param color = rgb(0, 0, 0): of the line
// param light = 0 in 0..1: 0: the color as it is, 1: times what the surface shows
fn effect(p: array<f32, 8>) -> Shell {
    return Shell(p[width], vec3(p[color_r], p[color_g], p[color_b]), p[light]);
}
