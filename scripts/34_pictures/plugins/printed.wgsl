// effect: printed
// about: the image on paper: its grain shows where the ink is thin
// version: 1
// param amount = 0.8 in 0..1: strength of the paper grain
// param across = 4 in 0.5..64: repetitions of the paper texture across the image
// texture paper = paper.png: fibers, white where there is most paper
//
// A texture's name is a function of its place, 0 to 1 from the top left and repeated; what it gives is linear.
fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    let grain = paper(p.across * uv * vec2(1.0, 0.5625)).r;
    let ink = 1.0 - clamp(max(color.r, max(color.g, color.b)), 0.0, 1.0);
    let seen = mix(1.0, 0.55 + 0.9 * grain, p.amount * (0.35 + 0.65 * ink));
    return vec4(color.rgb * seen + 0.02 * p.amount * grain, color.a);
}
