// effect: example
// about: fades the image to shades of one color
// param amount = 1.0 in 0..1: 0 = untouched, 1 = only shades
// param warmth = 0.5 in -1..1: -1 = blue, 1 = brown

fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    let grey = 0.2126 * color.r + 0.7152 * color.g + 0.0722 * color.b;
    let shade = vec3(grey * (1.0 + 0.2 * p.warmth), grey, grey * (1.0 - 0.2 * p.warmth));
    return vec4(color.rgb * (1.0 - p.amount) + shade * p.amount, color.a);
}
