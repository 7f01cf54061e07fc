// effect: halo
// about: a line around actors that widens
// version: 1
// hook: shell
// param width = 2 in 0..30: pixels
// param color_r = 0.9 in 0..100: red, linear
// param color_g = 0.8 in 0..100: green, linear
// param color_b = 0.3 in 0..100: blue, linear
fn effect(p: array<f32, 8>) -> Shell {
    return Shell(p[width], vec3(p[color_r], p[color_g], p[color_b]), 0.0);
}
