// effect: example
// about: fades to one colour's shades
// param amount = 1.0 in 0..1: 0 = untouched, 1 = only shades
// param warmth = 0.5 in -1..1: -1 = blue, 1 = brown
//
// Twin: `Example::cpu` in lib.rs. p holds the parameters in the order of the manifest.
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    let grey = 0.2126 * color.r + 0.7152 * color.g + 0.0722 * color.b;
    let shade = vec3<f32>(grey * (1.0 + 0.2 * p[1]), grey, grey * (1.0 - 0.2 * p[1]));
    return vec4<f32>(color.rgb * (1.0 - p[0]) + shade * p[0], color.a);
}
