// effect: wrapped
// about: light that reaches around surfaces, warm where it fades: skin, wax, clay
// version: 1
// hook: lighting
// param wrap = 0.5 in 0..1: how far the light wraps around; 1 reaches the opposite side
// param warmth = 0.6 in 0..1: how red the edge of the shadow is
//
// What one light adds to a place. sample.lit is what the surface's own model would make of it.
// After half-Lambert (Mitchell, McTaggart, Green, "Shading in Valve's Source Engine", SIGGRAPH 2006 course).
fn effect(sample: LightSample, p: Parameters) -> vec3<f32> {
    let own = clamp(sample.cosine, 0.0, 1.0);
    let around = clamp((sample.cosine + p.wrap) / (1.0 + p.wrap), 0.0, 1.0);
    // More of the light where only the wrapping brings it, and of that the red goes farthest.
    let edge = around * around - own;
    let tone = mix(vec3(1.0), vec3(1.0, 0.35, 0.2), p.warmth);
    return sample.lit + max(edge, 0.0) * tone * sample.base * sample.color * mix(0.4, 1.0, sample.share);
}
