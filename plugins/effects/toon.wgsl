// effect: toon
// about: light in steps, as in drawn cartoons
// hook: surface
// param steps = 3 in 1..32: number of steps
// param softness = 0.1 in 0..1: share of a step in which it blends into the next
// param white = 1 in 0.01..100: light that counts as the brightest step
//
// The brightest channel goes to the middle of its step, and the hue stays. Steps are even to the eye, which sees about the
// square root of light.

fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    let light = max(max(color.r, max(color.g, color.b)), 1e-6);
    let at = sqrt(min(light / p.white, 1.0)) * p.steps;
    let step = min(floor(at), p.steps - 1.0);
    let edge = clamp((at - step - (1.0 - p.softness)) / max(p.softness, 1e-4), 0.0, 1.0);
    let up = edge * edge * (3.0 - 2.0 * edge);
    let flat_light = max(min(step + 0.5 + up, p.steps - 0.5), 0.5) / p.steps;
    return vec4<f32>(color.rgb * (flat_light * flat_light * p.white / light), color.a);
}
