// effect: NAME
// about: light in two tones
// version: 0.1.0
// hook: lighting
// param edge = 0.1 in -1..1: cosine between the normal and the light where the tones meet
// param soft = 0.05 in 0.001..1: softness of the edge
// param dark = 0.25 in 0..1: brightness of the darker tone
//
// Returns the light that one point of a surface reflects from one light. sample: cosine (between normal and light, -1 to 1), share (the
// fraction that shadows let through), color (of the arriving light), base (color of the surface), normal, viewer, light (directions), and
// lit (the light that the surface's own shading model reflects).
// Put the file beside the script or into its folder plugins, or name its folder with --plugins; then: effect("NAME").on(anna)
fn effect(sample: LightSample, p: Parameters) -> vec3<f32> {
    let bright = smoothstep(p.edge - p.soft, p.edge + p.soft, sample.cosine) * sample.share;
    return sample.base * sample.color * mix(p.dark, 1.0, bright);
}
